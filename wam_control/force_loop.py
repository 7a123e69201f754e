"""The outer loop: force control through velocity-controlled motors (figure 5.2, sections 5.1.2 and 5.7).

F_error = F_des - F_c goes through the law of `wam_control.force_law`, axis by axis, and becomes a
commanded velocity along the direction of the force; the posture is held in the complement (hybrid
control, [Raibert 81]).  The axes are x y z of the command's frame, or the joints in the mode
joint_torque.  Forces are those of the arm on the world.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.force_law import ForceLaw
from wam_control.force_loop_parameters import ForceLoopParameters, force_law, task_of, torque_law
from wam_control.guard_report import report
from wam_control.guard_watch import Watch, place_is_sure, possible_touches
from wam_control.stability_guard import REACH, SMALLEST_LEVER, Judgement, StabilityGuard, Touch
from wam_description.arm import Arm, Timing
from wam_description.parameters import lengths, require
from wam_description.rigid_body import RigidBody
from wam_description.signals import Contact, State

__all__ = ["ForceCommand", "ForceLoop", "ForceLoopParameters", "ForceOutput"]

Array = NDArray[np.float64]


class ForceCommand(NamedTuple):
    """Force of the arm on the world that is asked for; `frame` is 'base' or a cover."""

    frame: str
    force: tuple[float, float, float]  # N


class ForceOutput(NamedTuple):
    """What one period of the force loop asks for, and what it saw.

    Measured force and error are components along the commanded direction, as vectors in the command's
    frame; limited is the error of each axis of that frame after its own saturation.
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
    timing : periods of the loops, for the guard.

    Attributes
    ----------
    parameters : those in force.
    judgement : what the guard finds of them; None where it is off or nothing is fed back.
    watch : what the guard does while the arm moves; None with the judgement.
    report : what the guard says; a new object where that has changed.
    refused : how many commands were not taken.
    refusals : why a present command is not taken, by topic; the last good one stands.
    fallback : why a felt contact is not believed and another place is used, '' where it is or none is felt.
    """

    def __init__(self, arm: Arm, parameters: ForceLoopParameters, timing: Timing) -> None:
        self._arm, self._timing = arm, timing
        self._body = RigidBody(arm)
        self._n = len(arm.joints.names)
        self._still = [0.0] * self._n
        self._joints: tuple[float, ...] = ()
        self._guard: StabilityGuard | None = None
        self.judgement: Judgement | None = None
        self.watch: Watch | None = None
        self._bias = np.zeros(self._n)
        self._external = np.zeros(self._n)
        self._admitted: ForceCommand | None = None
        self._admitted_torque: Sequence[float] | None = None
        self._is_forsaken = self._is_doubtful = False
        self._touched: tuple[str, float] | None = None
        self._start([])
        self.refused = 0
        self.refusals: dict[str, str] = {}
        self.fallback = ""
        self.tune(parameters)

    def tune(self, parameters: ForceLoopParameters) -> None:
        """Take new parameters, or refuse the set.

        Raises
        ------
        ParameterError
            where values do not fit each other or the arm, or the guard finds the set not stable.
        """
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
        self._force_law, self._torque_law = self._guarded(parameters)
        self.parameters = parameters
        self._say()
        self._is_new = True  # blend into what the new set asks for

    def _guarded(self, parameters: ForceLoopParameters) -> tuple[ForceLaw, ForceLaw]:
        """The laws of a set, of the force and of the joints, once the guard has let it pass."""
        laws = force_law(parameters), torque_law(parameters, self._arm.joints.names)
        guard = StabilityGuard(self._arm, self._timing, parameters.guard)
        if parameters.guard.mode == "off" or parameters.mode == "open_loop":
            self._guard = self.judgement = self.watch = None
            return laws
        which = int(parameters.mode == "joint_torque")
        task = task_of(parameters, laws[which])
        postures = [parameters.guard.posture] + ([self._joints] if self._joints else [])
        places = [guard.touches(q, parameters.contact_cover, parameters.contact_place) for q in postures]
        found = guard.judge(task, [touch for touches in places for touch in touches])
        mode = parameters.guard.mode
        if found.reason and found.stable_error and mode == "limit":
            limits = tuple(min(limit, found.stable_error) for limit in task.law.error_limit)
            task = task._replace(law=replace(task.law, error_limit=limits))
            found = found._replace(reason="")
        require(not found.reason or mode == "warn", found.reason)
        self._guard, self.judgement = guard, found
        self.watch = Watch(guard, task, found, parameters.schedule == "place")
        return (laws[0], task.law) if which else (task.law, laws[1])

    def _say(self) -> None:
        mode, is_joints = self.parameters.guard.mode, self.parameters.mode == "joint_torque"
        self.report = report(self.judgement, self.watch, mode, is_joints)

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
        joints : joint state from the motors.  Where no motor gives any torque they are braked or in
            fault: all that the loop remembers then starts anew.
        sensors : joint-side sensors, None where there are none.
        contact : estimated contact, force of the world on the cover.
        external : estimated torques of the world on the joints (n,), N m.
        command : force asked for; None or zero leaves all axes to the posture.
        command_age : time since the state that the command answers, s; an old command counts as none.
        posture : joint angles asked for (n,), rad; None holds those of the start.
        torque : joint torques on the world asked for in the joint_torque mode (n,), N m.
        dt : outer period, s.
        """
        if not self._hold or not any(joints.effort):
            self._start(joints.position)
        self._joints = tuple(joints.position)
        command, torque = self._admit(command, torque)
        command = self._fresh(joints.position, command, command_age, posture)
        self._external = self._external_torque(sensors, external) - self._bias
        if self.parameters.mode == "joint_torque":
            out = self._joint_torque(contact, torque, dt)
        else:
            out = self._along(joints.position, contact, command, dt)
        return out._replace(velocity=self._blend(out.velocity, joints.velocity, dt))

    def _start(self, q: Sequence[float]) -> None:
        """Forget what was before: stand still here, and blend into what is asked for."""
        self._hold = list(q)  # empty before the first state
        self._forget()
        self._speeds: deque[list[float]] = deque()
        self._offset = self._said = self._still
        self._is_new = True

    def _forget(self) -> None:
        """Forget the force of the period before, and the axes it belonged to."""
        self._filtered: float | None = None
        self._before: list[float] = []
        self._axes = ""

    def _admit(
        self, command: ForceCommand | None, torque: Sequence[float] | None
    ) -> tuple[ForceCommand | None, Sequence[float] | None]:
        """Commands within the limits; in place of another the last good one."""
        own = self.parameters
        self.refusals, self.fallback = {}, ""
        if command is not None and (asked := math.hypot(*command.force)) > own.force_limit:
            self._refuse("force_command", asked, "force_limit", own.force_limit, "N")
        else:
            self._admitted = command
        if torque is not None and (asked := max(map(abs, torque))) > own.torque_limit:
            self._refuse("joint_torque_command", asked, "torque_limit", own.torque_limit, "N m")
        else:
            self._admitted_torque = torque
        return self._admitted, self._admitted_torque

    def _refuse(self, topic: str, asked: float, name: str, limit: float, unit: str) -> None:
        self.refused += 1
        self.refusals[topic] = (
            f"{asked:.4g} {unit} is asked for; allowed: up to {name}, {limit:g} {unit}; the last good command stands"
        )

    def _fresh(
        self, q: Sequence[float], command: ForceCommand | None, age: float, posture: Sequence[float] | None
    ) -> ForceCommand | None:
        """The command where it is not too old, and the posture to hold beside it."""
        is_old = command is not None and any(command.force) and age > self.parameters.command_timeout
        if is_old:
            if not self._is_forsaken:
                self._hold = list(q)  # whoever pressed is gone: stay here, and ask for no force
            command = None
        elif posture is not None:
            self._hold = list(posture)
        self._is_forsaken = is_old
        return command

    def _along(self, q: Sequence[float], contact: Contact, command: ForceCommand | None, dt: float) -> ForceOutput:
        """Force along the commanded direction, posture in the complement."""
        is_open = self.parameters.mode == "open_loop"
        self._begin(command.frame if command is not None and any(command.force) else "")
        direction, frame_rotation, asked = self._direction(q, command)
        if direction is None:
            return ForceOutput([] if is_open else self._posture_velocity(q), [0.0] * self._n, *_ZERO_FORCES)
        jacobian = self._contact_jacobian(q, contact)
        along = direction @ jacobian
        effort = along * asked
        measured = self._low_pass(self._measured(q, jacobian, contact, direction), dt)
        axis = (frame_rotation.T @ direction).tolist()
        error = asked - measured
        limited = [self._force_law.limited(i, error * share) for i, share in enumerate(axis)]
        velocity: list[float] = []
        if not is_open:
            before = self._before or [measured]
            speeds = [
                self._force_law.velocity(i, error * share, (asked - before[0]) * share, dt)
                for i, share in enumerate(axis)
            ]
            speed = sum(share * held for share, held in zip(axis, self._held_back(speeds), strict=True))
            speed *= self._factor(contact, direction, dt)
            velocity = self._hybrid_velocity(q, along, speed)
        self._before = [measured]
        return ForceOutput(
            velocity,
            effort.tolist(),
            _scaled(axis, measured),
            _scaled(axis, error),
            (limited[0], limited[1], limited[2]),
        )

    def _begin(self, axes: str) -> None:
        """Start anew on other axes; '' for none."""
        if axes != self._axes:
            self._forget()
            self._speeds.clear()
            self._axes, self._is_new = axes, True

    def _held_back(self, speeds: list[float]) -> list[float]:
        """What the law asked for `delay_samples` periods ago; nothing where there was none yet."""
        count = self.parameters.delay_samples
        if not count:
            self._speeds.clear()
            return speeds
        self._speeds.append(speeds)
        while len(self._speeds) > count + 1:
            self._speeds.popleft()
        return self._speeds.popleft() if len(self._speeds) > count else [0.0] * len(speeds)

    def _blend(self, velocity: list[float], moving: Sequence[float], dt: float) -> list[float]:
        """Velocity that goes over from what was said before, or from what the arm does, to what the law asks for."""
        time = self.parameters.blend_time
        if not velocity or not time:
            self._offset = self._still
        elif self._is_new:
            self._offset = [a - b for a, b in zip(self._said or moving, velocity, strict=True)]
        elif any(self._offset):
            decay = math.exp(-dt / time)
            self._offset = [decay * offset for offset in self._offset]
        self._is_new = False
        if any(self._offset):
            velocity = [a + b for a, b in zip(velocity, self._offset, strict=True)]
        self._said = velocity
        return velocity

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
        cover, place = self._place(contact)
        return self._body.point_jacobian(q, cover, (place, 0.0, 0.0))

    def _place(self, contact: Contact) -> tuple[str, float]:
        """Where the force acts: where it is felt for sure, or was in this touch, else where the parameters say."""
        parameters, is_sure = self.parameters, self._is_sure(contact)
        is_doubtful = bool(contact.cover) and not is_sure
        if not contact.cover:
            self._touched = None
        elif is_sure:
            self._touched = contact.cover, contact.place
        if is_doubtful:
            self.fallback = (
                f"the felt place on {contact.cover} has a standard deviation of {contact.place_sd:.3g} m, a probability"
                f" of {contact.probability:.2f}; allowed: up to place_uncertainty_limit, "
                f"{parameters.place_uncertainty_limit:g} m, and from link_probability_limit, "
                f"{parameters.link_probability_limit:g}; "
                + ("the last sure place is used" if self._touched else "contact_cover and contact_place are used")
            )
        if is_doubtful and parameters.feedback == "contact_estimate":  # else the place is only wished for
            self.refused += not self._is_doubtful
            self.refusals["contact/spread"] = self.fallback
        self._is_doubtful = is_doubtful
        return self._touched or (parameters.contact_cover, parameters.contact_place)

    def _is_sure(self, contact: Contact) -> bool:
        """Whether the felt place is sure enough to build on; where nobody says how sure it is, it is."""
        return place_is_sure(contact.place, contact.place_sd, self.parameters.place_uncertainty_limit) and not (
            contact.probability < self.parameters.link_probability_limit
        )

    def _measured(self, q: Sequence[float], jacobian: Array, contact: Contact, direction: Array) -> float:
        """F_c: force of the arm on the world along the direction, N."""
        is_estimated = self.parameters.feedback == "contact_estimate"
        if is_estimated and not contact.cover:
            return 0.0
        if is_estimated and (math.isnan(contact.place) or not self._is_doubtful):
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

    def _joint_torque(self, contact: Contact, torque: Sequence[float] | None, dt: float) -> ForceOutput:
        self._begin("joints" if torque is not None else "")
        if torque is None:  # nothing is asked for: stand still
            return ForceOutput([0.0] * self._n, [0.0] * self._n, *_ZERO_FORCES)
        measured = (-self._external).tolist()
        before = self._before or measured
        velocity = self._held_back(
            [self._torque_law.velocity(i, asked - measured[i], asked - before[i], dt) for i, asked in enumerate(torque)]
        )
        self._before = measured
        factor = self._factor(contact, None, dt)
        return ForceOutput([factor * v for v in velocity], list(torque), *_ZERO_FORCES)

    def _factor(self, contact: Contact, direction: Array | None, dt: float) -> float:
        """Factor of the gains by the guard; `direction` None for both across the cover."""
        if self.watch is None or self._guard is None:
            return 1.0
        guard = self._guard

        def where() -> list[Touch]:
            cover, place = self._place(contact)
            sure = self._is_sure(contact)
            if self.parameters.schedule == "place" and not sure:
                length = self._arm.covers.length[self._arm.covers.names.index(cover)]
                return possible_touches(guard, self._joints, cover, length)
            if direction is None:
                return guard.touches(self._joints, cover, place)
            return guard.touching(Touch(self._joints, cover, place, _triple(direction)))

        if self.watch.step(where, dt):
            self._is_new = True
            self._say()
        return 1.0 if self.parameters.guard.mode == "warn" else self.watch.factor


_ZERO_FORCES = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def _triple(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def _scaled(axis: Sequence[float], value: float) -> tuple[float, float, float]:
    x, y, z = axis
    return x * value, y * value, z * value


def _list(values: Array) -> list[float]:
    result: list[float] = values.tolist()
    return result
