"""Motor torques per parameter: tau = M^T (Y(q, qd, qdd) phi + J qdd + friction of joints) + I thetadd + friction.

The friction of a window is the mean over its states, each with the direction, speed and load of its own.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from wam_analysis.identification.motion import MotionSamples
from wam_analysis.identification.unknowns import DIRECTIONS, OF_LINK, Unknowns
from wam_analysis.thresholds import IDENTIFY
from wam_bag.arrays import Mask, Numbers
from wam_description.arm import Shared
from wam_description.rigid_body import INERTIA, RigidBody, point_mass

STEP = 1e-6  # kg, kg m, kg m^2, of a link, by which the slopes of its parameters are found


class Equations(NamedTuple):
    """Rows of the least squares problem.

    Attributes
    ----------
    time : (k,), s.
    torque : (k, n), of each motor, less what is not estimated, N m.
    columns : (k, n, p), torque per parameter.
    is_used : (k, n), whether the motor, and each joint that it moves, turns in one direction.
    """

    time: Numbers
    torque: Numbers
    columns: Numbers
    is_used: Mask


class Regressor:
    """The equations of a motion, linearised about values of the parameters.

    Parameters
    ----------
    shared : arm and present model.
    unknowns : what is estimated.
    motion : samples.
    least : s of motion of a motor, with less of which none is used.

    Attributes
    ----------
    is_used : (k, n), as in `Equations`.
    """

    def __init__(self, shared: Shared, unknowns: Unknowns, motion: MotionSamples, least: float = 0.0) -> None:
        self._shared, self.unknowns, self._motion = shared, unknowns, motion
        self._matrix = shared.arm.transmission.joint_from_motor
        # friction of joints with a motor of their own at that motor, N m: the cables transmit it
        own = np.abs(self._matrix) * [[j not in unknowns.joints] for j in range(len(self._matrix))]
        self._through = own.T @ shared.arm.joints.dynamic_friction
        self._qd = motion.velocities @ self._matrix.T  # of each state
        q, qd, qdd = (values @ self._matrix.T for values in (motion.theta, motion.thetad, motion.thetadd))
        body = RigidBody(shared.arm)
        links = np.array([body.inverse_dynamics_regressor(*state) for state in zip(q, qd, qdd, strict=True)])
        self._links = np.einsum("ji,kjp->kip", self._matrix, links)
        self._at_tool = point_mass(shared.arm.tool)
        rest = np.zeros(qd.shape[1])
        self._weights = np.array([body.inverse_dynamics_regressor(each, rest, rest) for each in q])
        self._carried = (qdd * shared.model.joints.armature) @ self._matrix
        motor, joint = (  # in one direction during the window
            (each.min(1) > slowest) | (each.max(1) < -slowest)
            for each, slowest in ((motion.velocities, IDENTIFY.slowest_motor), (self._qd, IDENTIFY.slowest_joint))
        )
        steady = motor & ~(~joint @ (self._matrix != 0.0))
        self.is_used = steady & (steady.sum(0) * float(np.median(np.diff(motion.time))) >= least)

    def equations(self, values: Numbers) -> Equations:
        """The equations about the values, (p,), of the parameters."""
        motion, unknowns = self._motion, self.unknowns
        n = motion.theta.shape[1]
        columns = np.zeros((*motion.theta.shape, len(unknowns.names)))
        _, load = self.loads(values)
        friction = self._friction(load, values)
        velocities = unknowns.places("motors.stribeck_velocity")
        friction["motors.stribeck_velocity"] = self._by_stribeck(friction, values)
        for group, each in friction.items():
            found = np.einsum("w,kwn->kn", motion.weights, each)
            columns[:, range(n), unknowns.places(group)] = found
        columns[:, range(n), unknowns.places("motors.inertia")] = motion.thetadd
        self._add_joints(columns, load)
        driving = np.sum(self.joint_torques(values), axis=(0, 3))
        for place, motor in zip(unknowns.places("motors.torque_difference"), unknowns.sharing[1:], strict=True):
            first = unknowns.sharing[0]
            columns[:, first, place], columns[:, motor, place] = driving[:, first], -driving[:, motor]
        at, jacobian, constant = self._inertial(values)
        columns[:, :, at] = self._links @ jacobian
        torque = motion.torque - self._carried - self._links @ constant
        torque += columns[:, range(n), velocities] * values[velocities]
        return Equations(motion.time, torque, columns, self.is_used)

    def _by_stribeck(self, friction: Mapping[str, Numbers], values: Numbers) -> Numbers:
        """Torque per Stribeck velocity v_s at each state, (k, w, n), from the derivative of exp(-(v / v_s)^2)."""
        static = [f"motors.static_{way}" for way in DIRECTIONS]
        rise = sum(friction[group] * values[self.unknowns.places(group)] for group in static)
        slow = values[self.unknowns.places("motors.stribeck_velocity")]
        return 2.0 * rise * self._motion.velocities**2 / slow**3

    def _friction(self, load: Numbers, values: Numbers) -> dict[str, Numbers]:
        """Torque per parameter that it is linear in at each state, (k, w, n), by group."""
        v = self._motion.velocities
        slow = np.exp(-((v / values[self.unknowns.places("motors.stribeck_velocity")]) ** 2))
        found = {"motors.viscous": v}
        for way, sign in zip(DIRECTIONS, (1.0, -1.0), strict=True):
            moves = np.where(sign * v > 0.0, sign, 0.0)
            found[f"motors.coulomb_{way}"] = moves
            found[f"motors.static_{way}"] = moves * slow
            found[f"motors.load_{way}"] = moves * np.abs(load)
        return found

    def loads(self, values: Numbers) -> tuple[Numbers, Numbers]:
        """Torque that each rotor gives to the links, and to the cables, at each state, (k, w, n) each, N m.

        The cables also transmit the friction of an own joint, which is counted at its motor: as the arm is configured.
        """
        motion, unknowns = self._motion, self.unknowns
        rotor = values[unknowns.places("motors.inertia")] * motion.thetadd
        load = motion.torques - rotor[:, None, :]
        friction = self._friction(load, values)
        load -= sum(each * values[unknowns.places(group)] for group, each in friction.items())
        return load, load + np.sign(motion.velocities) * self._through

    def joint_torques(self, values: Numbers) -> tuple[Numbers, Numbers]:
        """Torques of the motors by the weight, and by the inertia of links, pulleys and rotors at each joint.

        (k, n motors, n joints) each, N m.
        """
        motion, unknowns = self._motion, self.unknowns
        at, jacobian, constant = self._inertial(values)
        links = constant + jacobian @ values[at]
        at_motors = self._carried + self._links @ links
        at_motors += values[unknowns.places("motors.inertia")] * motion.thetadd
        weights = self._weights @ links
        inertias = at_motors @ np.linalg.inv(self._matrix) - weights
        return weights[:, None, :] * self._matrix.T, inertias[:, None, :] * self._matrix.T

    def asymmetric_loads(self, values: Numbers) -> Numbers:
        """Torques of the motors, (k, n, joints), by the part of joints' load friction that has one sign, per torque."""
        at_joints = np.einsum("w,kwn->kn", self._motion.weights, self._at_joints(self.loads(values)[1]))
        joints = list(self.unknowns.joints)
        return at_joints[:, None, joints] * self._matrix[joints].T

    def carried_friction(self, values: Numbers) -> Numbers:
        """Friction of the motors, (k, n), N m, by one sd of the friction of own joints, which loads them."""
        (links, load), unknowns = self.loads(values), self.unknowns
        carrying = self._friction(load + IDENTIFY.friction * (load - links), values)
        found = np.zeros(load.shape)
        for group, each in self._friction(load, values).items():
            found += (carrying[group] - each) * values[unknowns.places(group)]
        return np.einsum("w,kwn->kn", self._motion.weights, found)

    def _at_joints(self, load: Numbers) -> Numbers:
        """Size of the torque that the cables transmit to each joint at each state, (k, w, n), N m."""
        return np.abs(load @ np.linalg.inv(self._matrix))  # tau = M^-T tau_motor

    def _add_joints(self, columns: Numbers, load: Numbers) -> None:
        weights, matrix, unknowns = self._motion.weights, self._matrix, self.unknowns
        at_joints, sign = self._at_joints(load), np.sign(self._qd)
        found = {"joints.coulomb": sign, "joints.load": sign * at_joints, "joints.viscous": self._qd}
        for group, each in found.items():
            mean = np.einsum("w,kwn->kn", weights, each)
            for at, j in zip(unknowns.places(group), unknowns.joints, strict=True):
                columns[:, :, at] = mean[:, j, None] * matrix[j]

    @property
    def payload_torque(self) -> Numbers:
        """Torques of the motors, (k, n), by 1 kg at the tool, N m/kg."""
        return self._links[:, :, -10:] @ self._at_tool

    def _inertial(self, values: Numbers) -> tuple[list[int], Numbers, Numbers]:
        """Where the parameters of the links are, and the ten of each link as jacobian @ parameters + constant."""
        unknowns, links = self.unknowns, self._shared.arm.links
        n = len(links.names)
        at = np.array([unknowns.places(f"links.{name}") for name in OF_LINK])  # (7, n)
        jacobian, constant = np.zeros((10 * n, 7 * n)), np.zeros(10 * n)
        for i in range(n):
            link, product = values[at[:, i]], links.product[3 * i : 3 * i + 3]
            ways = STEP * np.eye(7)
            after, before = (np.array([about_origin(link + side * way, product) for way in ways]) for side in (1, -1))
            slope = (after - before).T / (2.0 * STEP)
            rows, own = slice(10 * i, 10 * i + 10), np.arange(7) * n + i
            jacobian[rows, own] = slope
            constant[rows] = about_origin(link, product) - slope @ link
        constant[-10:] += self._shared.arm.payload * self._at_tool
        return at.ravel().tolist(), jacobian, constant


def about_origin(link: Numbers, product: Sequence[float]) -> Numbers:
    """The ten parameters of a link about its frame's origin, (10,).

    Parameters
    ----------
    link : (7,), mass, kg; mass times centre, kg m; moments of inertia about the centre, kg m^2.
    product : elements xy, xz, yz of that inertia, kg m^2, which are not estimated.
    """
    moment, (xx, yy, zz), (xy, xz, yz) = link[1:4], link[4:], product
    shifted = (moment @ moment * np.eye(3) - np.outer(moment, moment)) / link[0]
    return np.concatenate([link[:4], shifted[INERTIA] + [xx, xy, yy, xz, yz, zz]])
