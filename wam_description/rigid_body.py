"""Kinematics and dynamics of the links as rigid bodies, by pinocchio, from the arm's parameters."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wam_description.arm import Arm
from wam_description.parameters import rows
from wam_description.parts import tensor
from wam_description.thresholds import MODEL

Array = NDArray[np.float64]
INERTIA = (0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)  # axes xx, xy, yy, xz, yz, zz of the last six parameters of a link
FLOAT = np.dtype(float)


class Pose(NamedTuple):
    """A frame in base coordinates.

    Attributes
    ----------
    rotation : (3, 3), turns coordinates in the frame into coordinates in the base frame.
    position : (3,), origin of the frame in the base frame, m.
    """

    rotation: Array
    position: Array


class RigidBody:
    """The chain of links: positions, Jacobians, gravity, inertia; no rotors, pulleys or friction.

    Joint i turns about z of frame i of (A.4).  Base frame: frame 0, z up.  Joint angles q, rad,
    and velocities qd, rad/s, have shape (n,) and may be any sequence.  Every result is a new array.

    Parameters
    ----------
    arm : the arm's parameters.
    mass_scale : factor on mass and inertia of each link, n; None leaves them as they are.

    Raises
    ------
    ValueError
        if `mass_scale` has not one factor per link or a factor is not above zero.

    Attributes
    ----------
    covers : names of all.
    moving : names of the covers whose origin moves: that of the elbow, and of a wrist.
    reach : distance from the base frame's origin, m, beyond which the tool comes in no posture.
    """

    def __init__(self, arm: Arm, mass_scale: Sequence[float] | None = None) -> None:
        self.arm = arm
        self.covers = arm.covers.names
        self._model = _model(arm, [1.0] * arm.n if mass_scale is None else mass_scale)
        self._data = self._model.createData()
        self._tool = self._model.getFrameId("tool")
        self._frame = {name: self._model.getFrameId(name) for name in self.covers}
        self._joint = {name: self._model.frames[frame].parentJoint for name, frame in self._frame.items()}
        self.moving = tuple(name for name in self.covers if self.moves(name, (0.0, 0.0, 0.0)))
        tool = self._model.frames[self._tool].placement
        parts = [placement.translation for placement in (*list(self._model.jointPlacements)[1:], tool)]
        self.reach = math.fsum(math.hypot(*part.tolist()) for part in parts)
        self._starts_and_tool = [*(self._frame[name] for name in self.moving), self._tool]

    def cover_pose(self, q: ArrayLike, cover: str) -> Pose:
        """Frame of a cover in base coordinates."""
        return self._pose(q, self._known(cover))

    def tool_pose(self, q: ArrayLike) -> Pose:
        """Frame of the tool (frame 5 of A.4) in base coordinates."""
        return self._pose(q, self._tool)

    def point(self, q: ArrayLike, cover: str, p: ArrayLike) -> Array:
        """Base coordinates, (3,), m, of a point p, (3,), m, given in the cover's frame."""
        return self._placement(q, self._known(cover)).act(_vector(p))

    def point_jacobian(self, q: ArrayLike, cover: str, p: ArrayLike) -> Array:
        """Velocity of a point of a cover per joint velocity.

        Parameters
        ----------
        q : (n,), rad.
        cover : name of the cover.
        p : (3,), the point in the cover's frame, m.

        Returns
        -------
        (3, n), m/rad, in base coordinates; its transpose turns a force on the point, N, in base
        coordinates, into joint torques, N m.
        """
        frame = self._known(cover)
        jacobians = _columns(pin.computeJointJacobians(self._model, self._data, _vector(q)))
        point = pin.updateFramePlacement(self._model, self._data, frame).act(_vector(p))
        result: Array = jacobians[:3] - pin.skew(point).dot(jacobians[3:])  # as in `momentum_bias`
        result[:, self._joint[cover] :] = 0.0
        return result

    def moves(self, cover: str, p: ArrayLike) -> bool:
        """Whether some joint moves the point p, (3,), m, of a cover, given in its frame."""
        n = self._model.nv
        poses = ([0.3 * (i + 1) * sign for i in range(n)] for sign in (1.0, -1.0))
        return any(float(np.abs(self.point_jacobian(q, cover, p)).max()) >= MODEL.small for q in poses)

    def cover_jacobian(self, q: ArrayLike, cover: str) -> Array:
        """Motion of a cover per joint velocity, in the cover's frame.

        Parameters
        ----------
        q : (n,), rad.
        cover : name of the cover.

        Returns
        -------
        (6, n), velocity of the origin of the cover's frame, m/rad, and angular velocity, rad/rad, in
        the cover's frame; its transpose turns a wrench on the cover (force, N, and moment about that
        origin, N m, in the cover's frame) into joint torques, N m.
        """
        local = pin.ReferenceFrame.LOCAL
        return _columns(pin.computeFrameJacobian(self._model, self._data, _vector(q), self._known(cover), local))

    def tool_jacobian(self, q: ArrayLike) -> Array:
        """Velocity of the tool's origin per joint velocity, (3, n), m/rad, in base coordinates."""
        aligned = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        return _columns(pin.computeFrameJacobian(self._model, self._data, _vector(q), self._tool, aligned))[:3]

    def start_and_tool_speeds(self, q: ArrayLike, qd: ArrayLike) -> list[float]:
        """Speeds, m/s, of the origins of the covers in `moving`, then of the tool's, from one pass along the chain."""
        pin.forwardKinematics(self._model, self._data, _vector(q), _vector(qd))
        local = pin.ReferenceFrame.LOCAL  # the size is the same in every frame
        velocities = [pin.getFrameVelocity(self._model, self._data, frame, local) for frame in self._starts_and_tool]
        return [math.hypot(*velocity.linear.tolist()) for velocity in velocities]

    def gravity_torque(self, q: ArrayLike) -> Array:
        """Joint torques that carry the links at rest, (n,), N m."""
        return pin.computeGeneralizedGravity(self._model, self._data, _vector(q))

    def mass_matrix(self, q: ArrayLike) -> Array:
        """Inertia of the links at the joints, (n, n), kg m^2, symmetric, without pulleys and rotors."""
        return pin.crba(self._model, self._data, _vector(q))

    def momentum_bias(self, q: ArrayLike, qd: ArrayLike) -> Array:
        """C(q, qd)^T qd - g(q), (n,), N m, with dM/dt = C + C^T: what changes the momentum M qd without torques."""
        at, velocity = _vector(q), _vector(qd)
        # dot: of two small arrays three times as fast as @, the same bits
        coriolis = velocity.dot(pin.computeCoriolisMatrix(self._model, self._data, at, velocity))
        return coriolis - pin.computeGeneralizedGravity(self._model, self._data, at)

    def inverse_dynamics(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
        """Joint torques, (n,), N m, that give the links the acceleration qdd, (n,), rad/s^2."""
        return pin.rnea(self._model, self._data, _vector(q), _vector(qd), _vector(qdd))

    def inverse_dynamics_regressor(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
        """Torques of `inverse_dynamics` per inertial parameter, (n, 10 n).

        Of each link: mass, kg; mass times centre x y z, kg m; inertia xx, xy, yy, xz, yz, zz about the frame's origin,
        kg m^2.  The torques are linear in them (Atkeson, An & Hollerbach 1986).
        """
        args = (_vector(q), _vector(qd), _vector(qdd))
        return pin.computeJointTorqueRegressor(self._model, self._data, *args).reshape(self._model.nv, -1)

    def _known(self, cover: str) -> int:
        if cover not in self._frame:
            raise ValueError(f"cover '{cover}' is not on arm '{self.arm.name}'; covers: {', '.join(self.covers)}")
        return self._frame[cover]

    def _placement(self, q: ArrayLike, frame: int) -> pin.SE3:
        pin.forwardKinematics(self._model, self._data, _vector(q))
        return pin.updateFramePlacement(self._model, self._data, frame)

    def _pose(self, q: ArrayLike, frame: int) -> Pose:
        placement = self._placement(q, frame)
        return Pose(placement.rotation.copy(), placement.translation.copy())


def point_mass(at: ArrayLike) -> Array:
    """The ten inertial parameters of 1 kg at a point of a link's frame, m, about its origin."""
    place = _vector(at)
    return np.concatenate(([1.0], place, (place @ place * np.eye(3) - np.outer(place, place))[INERTIA]))


def joint_placement(joint: Any) -> pin.SE3:
    """Frame of a joint (A.4) at angle zero in the frame before it; the joint is one of the `rows`, lengths in m."""
    rotation = pin.rpy.rpyToMatrix(joint.twist, 0.0, 0.0)
    return pin.SE3(rotation, rotation @ np.array([joint.length, 0.0, joint.offset]))


def cover_placement(cover: Any) -> pin.SE3:
    """Frame of a cover in its link's frame; the cover is one of the `rows`, lengths in m.

    `rotation` is about fixed x, then y, then z, as in URDF.
    """
    return pin.SE3(pin.rpy.rpyToMatrix(*cover.rotation), np.array(cover.origin))


def _columns(jacobian: Array) -> Array:
    """A Jacobian as (6, n); pinocchio returns a flat array for one joint."""
    return jacobian.reshape(6, -1)


def _vector(values: ArrayLike) -> Array:
    if type(values) is np.ndarray and values.dtype is FLOAT:  # most are: a fifth of the time of asarray
        return values
    return np.asarray(values, FLOAT)


def _model(arm: Arm, mass_scale: Sequence[float]) -> pin.Model:
    if len(mass_scale) != arm.n or not all(factor > 0.0 for factor in mass_scale):
        raise ValueError(f"mass_scale is {list(mass_scale)}; it needs {arm.n} factors above 0, one per link")
    model = pin.Model()
    model.name = arm.name
    model.gravity.linear = np.array(arm.gravity)
    at = 0
    for joint, link, scale in zip(rows(arm.joints), rows(arm.carried), mass_scale, strict=True):
        at = model.addJoint(at, pin.JointModelRZ(), joint_placement(joint), joint.name)
        inertia = pin.Inertia(link.mass * scale, np.array(link.centre), tensor(link) * scale)
        model.appendBodyToJoint(at, inertia, pin.SE3.Identity())
    _add_frame(model, "tool", at, pin.SE3(np.eye(3), np.array(arm.tool)))
    for cover in rows(arm.covers):
        _add_frame(model, cover.name, 1 + arm.links.names.index(cover.link), cover_placement(cover))
    return model


def _add_frame(model: pin.Model, name: str, joint: int, placement: pin.SE3) -> None:
    model.addFrame(pin.Frame(name, joint, 0, placement, pin.FrameType.OP_FRAME))
