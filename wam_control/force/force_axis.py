"""One direction of force at one position on the arm: how it is sensed, how the arm moves along it, how well.

Shared by the force loop and its guard.  Torques of the world on the joints are tau = -(l f + J' P t + l' f dx) + e:
the force f along the direction u with its lever l = J'u, tangential forces t (P = I - u u'), an error dx of position,
whose lever changes by l' per metre, and an error e of the torques.  With e, t and dx as random numbers of
known size, f is sensed by generalised least squares, without shrinkage (s.l = 1).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.force.thresholds import FORCE
from wam_description.arm import Servo
from wam_description.parameters import parameter
from wam_description.rigid_body import Array, RigidBody
from wam_description.small_matrices import inverse, length, outer

Phasors = NDArray[np.complex128]
Angles = Sequence[float] | Array  # of the joints (n,), rad
ALONG = np.array([1.0, 0.0, 0.0])  # a metre along a cover
UNTURNED = np.eye(3)  # rotation of the base frame


@dataclass(frozen=True)
class SensingParameters:
    """What disturbs the measured force, and how exactly it has to be known."""

    torque_sd: float = parameter("sd of the error of each measured joint torque", "N m", low=1e-6, high=1e3)
    torque_fraction: float = parameter(
        "further part of this sd, as a fraction of the joint torque of the commanded force",
        high=1.0,
    )
    estimated_torque_sd: float = parameter(
        "as torque_sd, with feedback contact_estimate, until the estimator computes it",
        "N m",
        low=1e-6,
        high=1e3,
    )
    estimated_torque_fraction: float = parameter("as torque_fraction, with feedback contact_estimate", high=1.0)
    friction: float = parameter(
        "sd of the tangential force on the link, as a fraction of the commanded force", high=2.0
    )
    zero_limit: float = parameter(
        "when a force begins at rest without a detected contact, the loop subtracts the external joint torques, if "
        "all of them are below this; 0: it subtracts none",
        "N m",
        high=1e3,
    )
    least_apparent_mass: float = parameter(
        "the loop weights the joint torques such that the measured force has at least this apparent mass; a larger "
        "one permits a larger gain, but increases the error of oblique forces; 0: no bound",
        "kg",
        high=100.0,
    )
    apparent_mass_limit: float = parameter(
        "if the apparent mass along a force is larger, the arm moves along it more slowly, by their ratio; 0: no limit",
        "kg",
        high=1e6,
    )


class ForceAxis(NamedTuple):
    """A direction of force at a position on the arm.

    Attributes
    ----------
    lever : way along the direction per angle of each joint (n,), m.
    press : torque on each joint per force (n,), m, of all that the surface does to the link, without friction.
    sense : force per torque on each joint (n,), 1/m; sense @ press is 1.
    move : joint velocity per commanded velocity along the direction (n,), 1/m.
    force_sd : standard deviation of the sensed force, N; infinite where the force has no lever.
    friction_sd, place_sd : part of it by tangential and other forces, and by the position, N.
    carried : sensed force per acceleration of each joint (n,), kg m: of the arm itself, nothing touched.
    apparent_mass : the same per acceleration along the direction, kg.
    impact_mass : mass that hits a surface, with rotors, as the arm moves along the direction, kg.
    speed_fraction : velocity along the direction per commanded one, 0 to 1.
    compliance : of the cables along the direction, m/N.
    precision : (n, n), inverse covariance of the torques apart from the force, 1/(N m)^2.
    covariance_there : (n, n), of the torques apart from the force at a position that is known, (N m)^2.
    """

    lever: Array
    press: Array
    sense: Array
    move: Array
    force_sd: float
    friction_sd: float
    place_sd: float
    carried: Array
    apparent_mass: float
    impact_mass: float
    speed_fraction: float
    compliance: float
    precision: Array
    covariance_there: Array

    def error(self, torque_sd: Array | float) -> float:
        """Standard deviation of the force, N, by those of the torques (n,), or of each of them, N m."""
        return length(self.sense * torque_sd)

    def unexplained(self, torques: Array) -> float:
        """chi^2 of torques of the world on the joints (n,), N m, that no press along the direction explains."""
        return _unexplained(self.precision, self.press, torques, 0.0)

    def changed(self, change: Array) -> float:
        """The same of a change of the torques (n,), N m, at the same position."""
        return _unexplained(inverse(self.covariance_there), self.press, change)


class ForcePlace(NamedTuple):
    """Where a force acts.

    Attributes
    ----------
    cover, position, position_sd : cover, position along it and its standard deviation, m.
    is_pinned : whether the command or the parameters give it.
    is_known : whether it is pinned, or estimated well enough while something is touched.
    is_touched : whether the contact is estimated to be on that cover, but no torque shows where.
    """

    cover: str
    position: float
    position_sd: float
    is_pinned: bool = False
    is_known: bool = False
    is_touched: bool = False


class ForceAxes:
    """Makes the force axes of one arm.

    Parameters
    ----------
    body : its kinematics and dynamics.
    parameters : of sensing.

    Attributes
    ----------
    covers : of the arm.
    torque_sd : (n,), N m, of the errors of the torques: at first those of the parameters.
    """

    def __init__(self, body: RigidBody, parameters: SensingParameters) -> None:
        arm = body.arm
        self.torque_sd = np.full(arm.n, parameters.torque_sd)
        self._body, self.covers, self._parameters = body, arm.covers, parameters
        self._map = arm.transmission
        self._rotors = arm.rotors
        self._friction = np.array(arm.joints.dynamic_friction)
        self._compliance = np.linalg.inv(arm.stiffness)

    def inertia(self, q: Angles) -> Array:
        """Inertia at the joints with their pulleys (n, n), kg m^2, without rotors."""
        return self._body.mass_matrix(q) + self._body.arm.pulleys

    def moved_inertia(self, q: Angles) -> Array:
        """The same with rotors: what hits a surface."""
        return self.inertia(q) + self._rotors

    def dry_friction(self, velocity: Sequence[float]) -> list[float]:
        """Dry friction of motors and joints, N m at the joints (n,), in a motion of the joints (n,), rad/s.

        Less than all of it moves nothing.  Where the force is off to the other side, the velocity loops need not wind
        up through twice the friction, which takes them seconds.
        """
        arm = self._body.arm
        turning = zip(arm.motors.dynamic_friction, self._map.motor_motion(velocity), strict=True)
        turned = self._map.joint_torques([most * math.tanh(speed / FORCE.slow_motor) for most, speed in turning])
        moved = zip(arm.joints.dynamic_friction, velocity, turned, strict=True)
        return [torque + most * math.tanh(speed / FORCE.slow_joint) for most, speed, torque in moved]

    def friction_damping(self, q: Angles, motion: Phasors, frequency: float) -> Array:
        """Damping of the joints (n,), N m s/rad, that takes as much energy as their dry friction: 4 F/(pi w |x|).

        Parameters
        ----------
        q : joint angles (n,), rad.
        motion : complex amplitude of the motors' vibration at the joints (n,), rad; the links are free.
        frequency : of it, rad/s.
        """
        links, damping = self.inertia(q), np.zeros(len(q))
        for i in range(FORCE.balances):
            swing = np.maximum(np.abs(self._free(links, motion, frequency, damping)), FORCE.negligible)
            balanced = 4.0 * self._friction / (math.pi * frequency * swing)
            damping = np.sqrt(damping * balanced) if i else balanced
        return damping

    def vibration(
        self, q: Angles, motion: Phasors, frequency: float, damping: Array, servo: Servo
    ) -> tuple[Phasors, Phasors]:
        """Vibration of the free links (n,), rad, and their receptance, motion per torque on them (n, n), rad/(N m).

        The links swing on the cables, and the motors on their velocity loops.

        Parameters
        ----------
        q, motion, frequency : as those of `friction_damping`.
        damping : of the joints (n,), N m s/rad.
        servo : gains of the velocity loops.
        """
        links, square = self.inertia(q), frequency * frequency
        damped, stiffness = (self._map.at_joints(gain) for gain in (servo.proportional_gain, servo.integral_gain))
        motors = stiffness + 1j * frequency * damped - square * self._rotors
        through = np.linalg.inv(self._compliance + np.linalg.inv(motors))
        receptance = np.linalg.inv(through + _impedance(links, frequency, damping))
        return self._free(links, motion, frequency, damping), np.asarray(receptance, np.complex128)

    def _free(self, links: Array, motion: Phasors, frequency: float, damping: Array) -> Phasors:
        """Vibration of the free links (n,), rad, on the cables."""
        on_cables = np.eye(len(links)) + self._compliance @ _impedance(links, frequency, damping)
        return np.asarray(np.linalg.solve(on_cables, motion), np.complex128)

    def lever(self, q: Angles, cover: str, position: float, direction: Array) -> Array:
        """Torque on each joint per force (n,), m, along a direction (3,), base frame, at a position of a cover, m."""
        result: Array = direction.dot(self._jacobian(q, cover, position, direction)[0])
        return result

    def disturbance(self, q: Angles, place: ForcePlace, direction: Array, force: float) -> list[Array]:
        """Torques (n,), N m, of another force and of its friction, each as large as its standard deviation.

        Arguments as those of `axis`.
        """
        cover, position, position_sd = place[:3]
        size = max(force, FORCE.sized_force)
        jacobian, slide, _ = self._jacobian(q, cover, position, direction)
        friction = self._parameters.friction * size * _across(direction, direction)
        return [(size * direction).dot(jacobian), *friction.dot(jacobian), (position_sd * size * direction).dot(slide)]

    def link_axis(self, q: Angles, cover: str) -> Array:
        """Direction (3,) along a cover, base frame."""
        return self._body.cover_pose(q, cover).rotation[:, 0]

    def slide(self, q: Angles, cover: str, position: float, moved: Array) -> float:
        """Way of a point of a cover along the cover, m, by a motion of the joints (n,), rad."""
        point = self.covers.on_axis(cover, position)
        along = self.link_axis(q, cover)
        return float(along.dot(self._body.point_jacobian(q, cover, point)) @ moved)

    def _jacobian(self, q: Angles, cover: str, position: float, normal: Array) -> tuple[Array, Array, Array]:
        """Jacobian (3, n) of a point of the surface, one radius off the tube's axis, its change per m, and the axis."""
        covers, rotation = self.covers, self._body.cover_pose(q, cover).rotation
        point = np.array(covers.on_axis(cover, position))
        point += covers.radius_of(cover) * rotation.T.dot(normal)
        jacobian = self._body.point_jacobian(q, cover, point)
        return jacobian, self._body.point_jacobian(q, cover, point + ALONG) - jacobian, rotation[:, 0]

    def _push(self, along: Array, direction: Array) -> Array:
        """What a surface at the side of a link gives back in all (3,) per force along a direction, friction apart.

        Friction up to `friction` holds the link, and the force is along the direction.  Where this is inclined further
        to the normal of the link's side, the link slides, and the force turns to the normal; beyond `least_normal` only
        what holds the link gives such a force.
        """
        aside = along * float(along.dot(direction))
        across: Array = direction - aside
        size, most = length(across), self._parameters.friction
        slope = math.sqrt(max(1.0 - size * size, 0.0)) / max(size, FORCE.least_normal)
        if slope <= most or size < FORCE.least_normal:
            return direction
        force: Array = across + max(2.0 * most / slope - 1.0, 0.0) * aside
        return force / float(force.dot(direction))

    def axis(
        self, q: Angles, place: ForcePlace, direction: Array, force: float, others: Sequence[Array] = ()
    ) -> ForceAxis:
        """The axis of a force at a contact.

        Parameters
        ----------
        q : joint angles (n,), rad.
        place : where it acts.
        direction : unit vector of the force of the arm on the world (3,), base frame.
        force : commanded, N; tangential forces are proportional to it.
        others : torques (n,), N m, of other forces, each as large as its standard deviation.
        """
        parameters, n = self._parameters, len(q)
        cover, position, position_sd = place[:3]
        jacobian, slide, along = self._jacobian(q, cover, position, direction)  # friction acts at the surface
        lever: Array = direction.dot(jacobian)
        square = float(lever.dot(lever))
        if square <= FORCE.least_lever * FORCE.least_lever:
            zero = np.zeros(n)
            none = np.zeros((n, n))
            return ForceAxis(
                lever, zero, zero, zero, math.inf, 0.0, 0.0, zero, math.inf, math.inf, 0.0, 0.0, none, none
            )
        size = max(force, FORCE.sized_force)
        aside = self._push(along, direction)
        end = self.covers.length_of(cover) - self.covers.radius_of(cover)
        # the end of a link is round, and other forces at the same position press the surface as well
        is_side = position + 2.0 * position_sd < end and not others
        push = aside if is_side else direction
        friction = parameters.friction * size * _across(direction, push)
        tangential = friction.dot(jacobian)
        press: Array = push.dot(jacobian)
        shift = push.dot(slide) * size
        shifted = friction.dot(slide)  # friction at another position has another lever
        moved = outer(shift, shift) + shifted.T.dot(shifted)
        spread = np.diag(self.torque_sd**2 + (parameters.torque_fraction * size * press) ** 2)
        across = np.vstack([tangential, *others]) if others else tangential
        spread += across.T.dot(across)
        moved *= position_sd**2
        weight = inverse(spread + moved)
        inertia = self.inertia(q)
        least = parameters.least_apparent_mass * square if parameters.least_apparent_mass else -math.inf
        sense = _passive(weight, press, inertia.dot(lever), least)
        carried: Array = sense.dot(inertia)
        mass = float(carried.dot(lever)) / square
        impact = float(lever.dot(inertia + self._rotors).dot(lever)) / (square * square)
        damped = square
        if parameters.apparent_mass_limit:
            damped *= max(1.0, abs(mass) / parameters.apparent_mass_limit)
        friction_sd = length(across.dot(sense))
        place_sd = math.sqrt(float(sense.dot(moved).dot(sense)))
        return ForceAxis(
            lever,
            press,
            sense,
            lever / damped,
            math.sqrt(float(sense.dot(spread + moved).dot(sense))),
            friction_sd,
            place_sd,
            carried,
            mass,
            impact,
            square / damped,
            float(lever.dot(self._compliance).dot(lever)),
            weight,
            spread,
        )


def _impedance(inertia: Array, frequency: float, damping: Array) -> Phasors:
    """Torque per vibration (n, n), N m/rad, of an inertia (n, n), kg m^2, and damping of the joints (n,), N m s/rad."""
    return np.asarray(1j * frequency * np.diag(damping) - frequency**2 * inertia, np.complex128)


def _passive(weight: Array, press: Array, carried: Array, least: float) -> Array:
    """Force per torque on each joint (n,), 1/m: generalised least squares with at least this apparent mass.

    Minimises s'S s for s.press = 1 and, where that gives less, s.carried = least: with less than no mass, an arm that
    presses is pushed by its own motion.

    Parameters
    ----------
    weight : inverse of the covariance S (n, n), 1/(N m)^2.
    press : torque on each joint per force (n,), m.
    carried : torque on each joint as the arm moves along the force (n,), kg m^2.
    least : of s.carried, kg m^2.
    """
    pressed, moved = weight.dot(press), weight.dot(carried)
    size, mixed = float(press.dot(pressed)), float(press.dot(moved))
    sense: Array = pressed / size
    if mixed >= least * size:
        return sense
    moving = float(carried.dot(moved))
    apart = size * moving - mixed * mixed
    if apart <= FORCE.negligible * size * moving:
        return sense  # the torques of the force are those of the motion along it
    passive: Array = ((moving - least * mixed) * pressed + (least * size - mixed) * moved) / apart
    return passive


def _unexplained(precision: Array, press: Array, torques: Array, most: float = math.inf) -> float:
    """chi^2 of torques (n,), N m, apart from the multiple of `press`, at most this, that explains them best."""
    weighted = precision.dot(torques)
    force = min(float(press.dot(weighted)), most)
    return float(torques.dot(weighted)) - force * force / float(press.dot(precision).dot(press))


def _across(direction: Array, push: Array) -> Array:
    """Rows (3, 3) of forces across a push that leave its part along the direction as it is, each as large as 1 N/N."""
    square = float(push.dot(push))
    across = math.sqrt(square) * (UNTURNED - outer(push, push) / square)
    result: Array = across - outer(across.dot(direction), push)
    return result
