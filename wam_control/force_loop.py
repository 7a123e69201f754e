"""The outer loop: force control through velocity-controlled motors (figure 5.2, sections 5.1.2 and 5.7).

F_error = F_des - F_c is saturated and integrated through the commanded velocity,
v = G_I sat(F_error), along the direction of the force; the posture is held in the complement
(hybrid control, [Raibert 81]).  Forces are those of the arm on the world.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_description.arm import Arm
from wam_description.parameters import lengths, parameter, require
from wam_description.rigid_body import RigidBody
from wam_description.signals import Contact, State

Array = NDArray[np.float64]
REACH = 1e-3  # m; a force whose lever on every joint is shorter cannot be applied
SMALLEST_LEVER = 0.05  # relative singular value below which a direction of force is left out


@dataclass(frozen=True)
class ForceLoopParameters:
    """Gains and limits of the force loop."""

    mode: str = parameter(
        "hybrid: force along its direction, posture elsewhere; joint_torque: torque of each joint; "
        "open_loop: J^T F fed forward, no feedback",
        choices=("hybrid", "joint_torque", "open_loop"),
        live=True,
    )
    feedback: str = parameter(
        "where F_c comes from", choices=("joint_sensors", "contact_estimate", "joint_position"), live=True
    )
    force_gain: float = parameter("G_I, velocity per force error", "m/s/N", low=0.0, live=True)
    force_error_limit: float = parameter("saturation of F_error", "N", low=0.0, live=True)
    torque_gain: float = parameter("G_I of the joint_torque mode", "rad/s/(N m)", low=0.0, live=True)
    torque_error_limit: float = parameter("saturation of the torque error", "N m", low=0.0, live=True)
    posture_gain: float = parameter("joint velocity per posture error", "1/s", low=0.0, live=True)
    joint_speed_limit: float = parameter(
        "largest joint speed that posture and force ask for", "rad/s", low=0.0, live=True
    )
    force_filter: float = parameter("time constant of the low pass on the measured force", "s", low=0.0, live=True)
    spring_stiffness: tuple[float, ...] = parameter(
        "stiffness of a known spring at each joint, for the feedback joint_position", "N m/rad", low=0.0, live=True
    )
    spring_rest: tuple[float, ...] = parameter("joint angle at which that spring is not pressed", "rad", live=True)
    command_timeout: float = parameter(
        "age at which a force command no longer counts and the arm holds where it is", "s", low=0.001, live=True
    )
    contact_cover: str = parameter("cover that is taken to touch while no contact is felt", live=True)
    contact_place: float = parameter("place on it", "m", live=True)


class ForceCommand(NamedTuple):
    """Force of the arm on the world that is asked for; `frame` is 'base' or a cover."""

    frame: str
    force: tuple[float, float, float]  # N


class ForceOutput(NamedTuple):
    """What one period of the force loop asks for, and what it saw.

    The three forces are components along the commanded direction, as vectors in the command's frame.
    """

    velocity: list[float]  # (n,) rad/s, empty for torque only
    effort: list[float]  # (n,) N m
    measured: tuple[float, float, float]  # N
    error: tuple[float, float, float]  # N
    limited: tuple[float, float, float]  # N


class ForceLoop:
    """Force, posture and torque control at the outer rate.

    Parameters
    ----------
    arm : the arm as the controller knows it.
    parameters : gains and limits.
    """

    def __init__(self, arm: Arm, parameters: ForceLoopParameters) -> None:
        self._arm = arm
        self._body = RigidBody(arm)
        self._n = len(arm.joints.names)
        self._hold: list[float] | None = None
        self._filtered: float | None = None
        self._is_forsaken = False
        self._bias = np.zeros(self._n)
        self._external = np.zeros(self._n)
        self.tune(parameters)

    def tune(self, parameters: ForceLoopParameters) -> None:
        """Take new parameters, or refuse the set."""
        covers = self._arm.covers.names
        require(
            parameters.contact_cover in covers,
            f"contact_cover is '{parameters.contact_cover}'; allowed: {', '.join(covers)}",
        )
        require(
            parameters.feedback == "contact_estimate" or self._arm.joint_sensors,
            f"feedback is '{parameters.feedback}' but arm.joint_sensors is false; use 'contact_estimate'",
        )
        springs = {"spring_stiffness": parameters.spring_stiffness, "spring_rest": parameters.spring_rest}
        lengths("force_loop", self._arm.joints.names, springs)
        self.parameters = parameters

    def tare(self) -> None:
        """Take the external torques that are felt now as zero."""
        self._bias = self._bias + self._external

    def step(
        self,
        joints: State,
        sensors: State | None,
        contact: Contact,
        external: Sequence[float] | None,
        command: ForceCommand | None,
        command_age: float,
        posture: Sequence[float] | None,
        torque: Sequence[float] | None,
        dt: float,
    ) -> ForceOutput:
        """One outer period.

        Parameters
        ----------
        joints : joint state from the motors.
        sensors : joint-side sensors, None where there are none.
        contact : estimated contact, force of the world on the cover.
        external : estimated torques of the world on the joints (n,), N m.
        command : force asked for; None or zero leaves all axes to the posture.
        command_age : time since the state that the command answers, s; an old command counts as none.
        posture : joint angles asked for (n,), rad; None holds those of the first period.
        torque : joint torques on the world asked for in the joint_torque mode (n,), N m.
        dt : outer period, s.
        """
        q = joints.position
        if self._hold is None:
            self._hold = list(q)
        is_old = command is not None and any(command.force) and command_age > self.parameters.command_timeout
        if is_old:
            if not self._is_forsaken:
                self._hold = list(q)  # whoever pressed is gone: stay here, and ask for no force
            command = None
        elif posture is not None:
            self._hold = list(posture)
        self._is_forsaken = is_old
        self._external = self._external_torque(sensors, external) - self._bias
        if self.parameters.mode == "joint_torque":
            return self._joint_torque(q, torque)
        direction, frame_rotation, asked = self._direction(q, command)
        if direction is None:
            self._filtered = None
            velocity = [] if self.parameters.mode == "open_loop" else self._posture_velocity(q)
            return ForceOutput(velocity, [0.0] * self._n, *_ZERO_FORCES)
        jacobian = self._contact_jacobian(q, contact)
        along = direction @ jacobian
        effort = along * asked
        measured = self._low_pass(self._measured(q, jacobian, contact, direction), dt)
        error = asked - measured
        limit = self.parameters.force_error_limit
        limited = min(max(error, -limit), limit)
        if self.parameters.mode == "open_loop":
            velocity = []
        else:
            velocity = self._hybrid_velocity(q, along, self.parameters.force_gain * limited)
        axis = frame_rotation.T @ direction
        return ForceOutput(
            velocity, effort.tolist(), _vector(axis * measured), _vector(axis * error), _vector(axis * limited)
        )

    def _external_torque(self, sensors: State | None, estimated: Sequence[float] | None) -> Array:
        """Torque of the world on the joints, by the feedback that is chosen.

        joint_sensors: at rest, what carries the links and is not strain.  joint_position: the
        deflection of a known spring, as in section 5.6.
        """
        parameters = self.parameters
        if parameters.feedback == "contact_estimate":
            return np.zeros(self._n) if estimated is None else np.array(estimated)
        if sensors is None:
            return np.zeros(self._n)
        if parameters.feedback == "joint_position":
            return np.array(parameters.spring_stiffness) * (np.array(parameters.spring_rest) - sensors.position)
        return self._body.gravity_torque(sensors.position) - np.array(sensors.effort)

    def _direction(self, q: Sequence[float], command: ForceCommand | None) -> tuple[Array | None, Array, float]:
        if command is None:
            return None, np.eye(3), 0.0
        asked = math.hypot(*command.force)
        if asked == 0.0:
            return None, np.eye(3), 0.0
        rotation = np.eye(3) if command.frame == "base" else self._body.cover_pose(q, command.frame).rotation
        return rotation @ (np.array(command.force) / asked), rotation, asked

    def _contact_jacobian(self, q: Sequence[float], contact: Contact) -> Array:
        cover, place = contact.cover, contact.place
        if not cover or math.isnan(place):
            cover, place = self.parameters.contact_cover, self.parameters.contact_place
        return self._body.point_jacobian(q, cover, (place, 0.0, 0.0))

    def _measured(self, q: Sequence[float], jacobian: Array, contact: Contact, direction: Array) -> float:
        """F_c: force of the arm on the world along the direction, N."""
        if self.parameters.feedback == "contact_estimate":
            if not contact.cover:
                return 0.0
            return -float(direction @ (self._body.cover_pose(q, contact.cover).rotation @ np.array(contact.force)))
        force = np.linalg.pinv(jacobian.T, rcond=SMALLEST_LEVER) @ self._external
        return -float(direction @ force)

    def _low_pass(self, value: float, dt: float) -> float:
        before = self._filtered
        self._filtered = (
            value if before is None else before + (value - before) * dt / (dt + self.parameters.force_filter)
        )
        return self._filtered

    def _posture_velocity(self, q: Sequence[float]) -> list[float]:
        gain, limit = self.parameters.posture_gain, self.parameters.joint_speed_limit
        assert self._hold is not None
        return [min(max(gain * (a - b), -limit), limit) for a, b in zip(self._hold, q, strict=True)]

    def _hybrid_velocity(self, q: Sequence[float], along: Array, speed: float) -> list[float]:
        """Joint velocities with `speed` along the force and the posture's part that does not move along it."""
        posture = np.array(self._posture_velocity(q))
        square = float(along @ along)
        if square <= REACH * REACH:
            return _list(posture)
        force = along * (speed / square)
        fastest, limit = float(np.abs(force).max()), self.parameters.joint_speed_limit
        if fastest > limit:  # a short lever would turn a small speed into a wild one
            force *= limit / fastest
        return _list(force + posture - along * (float(along @ posture) / square))

    def _joint_torque(self, q: Sequence[float], torque: Sequence[float] | None) -> ForceOutput:
        if torque is None:  # nothing is asked for: stand still
            return ForceOutput([0.0] * self._n, [0.0] * self._n, *_ZERO_FORCES)
        limit = self.parameters.torque_error_limit
        error = np.clip(np.array(torque) + self._external, -limit, limit)
        return ForceOutput(_list(self.parameters.torque_gain * error), list(torque), *_ZERO_FORCES)


_ZERO_FORCES = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def _vector(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def _list(values: Array) -> list[float]:
    result: list[float] = values.tolist()
    return result
