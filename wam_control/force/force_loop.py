"""The outer loop: force control through velocity-controlled motors (figure 5.2, sections 5.1.2 and 5.7).

What is commanded becomes the axes of one problem (`axes`).  The error F_des - F_c of each force goes through the law
of `force_law` and becomes a velocity along its axis; motions have laws of their own, and the posture is held in what
is left.  A belief of each force decides whether it is obeyed (`belief`), limits bound the motion (`limits`), one small
problem gives the joint velocities (`problem`), and events report what is not as commanded (`force_watch`).
Forces are those of the arm on the world.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wam_control.force.advice import Search, tries
from wam_control.force.axes import CommandedAxis, TaskAxes
from wam_control.force.belief import Belief, Errors
from wam_control.force.command_run import AxisRun, CommandRun
from wam_control.force.contact_place import ContactPlace, pinned_position
from wam_control.force.force_axis import ForceAxes, ForcePlace
from wam_control.force.force_command import CommandAdmission, beyond
from wam_control.force.force_input import ForceInput
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.force_measurement import ForceMeasurement
from wam_control.force.force_watch import Seen
from wam_control.force.guard import Supervision
from wam_control.force.held_arm import PushedArm
from wam_control.force.knowledge import Knowledge
from wam_control.force.limits import (
    approach_speed,
    calm,
    followed,
    joint_bounds,
    reachable,
    resolution,
    servo_yielding,
    yielding,
)
from wam_control.force.problem import VelocityRow, solve, unlimited
from wam_control.force.task import AxisKind, TaskAxis, TaskCommand, joint_axes
from wam_control.force.thresholds import FORCE
from wam_control.thresholds import MOTION
from wam_description.arm import Arm, Servo, Timing
from wam_description.event import OBEYED, Code, Event, holding, warning
from wam_description.parameters import require
from wam_description.rigid_body import Array, RigidBody
from wam_description.signals import BASE, NO_CONTACT, ZERO, Contact, ForceCommand, Triple

__all__ = ["ForceCommand", "ForceInput", "ForceLoop", "ForceLoopParameters", "ForceOutput", "by_seriousness"]

AxisRow = tuple[float, float, float, float, float]  # under TASK_AXIS_COLUMNS


class ForceOutput(NamedTuple):
    """Commands of one period of the force loop, and the forces behind them.

    Measured force and error are sums over the forces of points, as vectors in `frame`; limited is the error after
    saturation.
    """

    velocity: list[float]  # (n,) rad/s, empty for torque only
    effort: list[float]  # (n,) N m
    measured: Triple = ZERO  # N
    error: Triple = ZERO  # N
    limited: Triple = ZERO  # N
    frame: str = BASE
    axes: tuple[CommandedAxis, ...] = ()
    known: tuple[Belief, ...] = ()  # of each axis
    rows: tuple[AxisRow, ...] = ()  # of the axes of a task


class ForceLoop:
    """Force, posture, torque and task control at the outer rate.

    Parameters
    ----------
    arm : the arm as the controller knows it.
    servo : gains of the velocity loop, on which the guard relies.
    parameters : gains and limits.
    timing : periods of the loops, for the guard.
    command_age : time for which the last good command counts while others are refused, s; without end by default.

    Attributes
    ----------
    supervision : by the guard, with what it finds, does and reports.
    events : what the loop does instead of what is commanded, the most serious first; none where it obeys.
    """

    def __init__(
        self, arm: Arm, servo: Servo, parameters: ForceLoopParameters, timing: Timing, command_age: float = math.inf
    ) -> None:
        self._timing, self._servo, self._body = timing, servo, RigidBody(arm)
        self._admission = CommandAdmission(arm.joints, arm.covers, command_age)
        self._feedback = ""  # none so far
        self._pushed = PushedArm(self._body)
        zero = self._velocity = self._moved = np.zeros(arm.n)
        self._pose = np.zeros(0)  # none so far
        self._pressed_at = zero + math.inf
        self.events: tuple[Event, ...] = ()
        self.tune(parameters)
        self._run = CommandRun((), None, arm, timing, zero, zero, zero, False)

    def tune(self, parameters: ForceLoopParameters) -> None:
        """Take new parameters, or refuse the set.

        Raises
        ------
        ParameterError
            where values do not fit each other or the arm, or the guard does not accept the set; nothing has
            changed then.
        """
        arm, timing = self._body.arm, self._timing
        parameters.require_fit(arm)
        fastest = 2 * timing.outer_divisor
        require(
            not (parameters.is_estimated and 0 < timing.dither_cycle <= fastest),
            f"timing.dither_cycle is {timing.dither_cycle}: feedback 'contact_estimate' sees no swing of two outer "
            f"periods or less; allowed: 0, or above {fastest}",
        )
        self.supervision = Supervision(arm, self._servo, timing, parameters, tuple(self._pose.tolist()))
        self._axes = TaskAxes(self._body, ForceAxes(self._body, parameters.sensing_fed_back))
        if parameters.feedback != self._feedback:  # what counts as zero is that of one signal
            self._feedback, self._measurement = parameters.feedback, ForceMeasurement(self._body)

    @property
    def parameters(self) -> ForceLoopParameters:
        """Those in force; with guard.mode `limit` they may be lower than given."""
        return self.supervision.parameters

    @property
    def refusals(self) -> dict[str, Event]:
        """Why a present command is refused, by topic; the last good one remains in use."""
        return self._admission.refusals

    @property
    def event(self) -> Event:
        """The most serious one; OBEYED where the loop obeys."""
        return self.events[0] if self.events else OBEYED

    @property
    def is_advised(self) -> bool:
        """Whether the event of a refused force has what would help: it is looked for over several periods."""
        return self._run.search is not None and "searched" in self._run.search.ways

    @property
    def free_torques(self) -> list[float]:
        """Torques of the joint sensors (n,), N m, that count as those of a free arm; zeros with estimated torques."""
        free: list[float] = self._measurement.free.tolist()
        return [0.0] * len(free) if self.parameters.is_estimated else free

    def tare(self) -> str:
        """Take the present external torques as zero; '' or why they are not those of a free arm."""
        if self._run.axes:
            return "a force is commanded: end the command, and free the arm"
        if not self._measurement.rest.is_slow:
            # the mean speed of an arm that has stopped is that of an arm at rest after this time
            fastest = max(self._body.arm.joints.speed_limit)
            seconds = math.ceil(10.0 * FORCE.steady_time * math.log(fastest / MOTION.at_rest)) / 10.0
            return f"the arm moves: let it rest for {seconds:g} s first"
        if not self._has_left:
            return "the arm is still where it pressed: move it away first"
        self._measurement.tare()
        return ""

    @property
    def _has_left(self) -> bool:
        """Whether the arm has moved away from where it last pressed on something."""
        return bool(np.abs(self._pressed_at - self._pose).max() > MOTION.left_angle)

    def step(self, given: ForceInput) -> ForceOutput:
        """One outer period: the axes of what is commanded, then what is known of them, then the motion, then events."""
        own, joints, admitted = self.parameters, given.joints, self._admission
        is_braked, pose, before = not any(joints.effort), np.array(joints.position), self._pose
        self._pose = pose
        if is_braked or not before.size:
            self._reset()
        else:
            self._moved = pose - before
        given = self._measurable(given)
        contact = given.contact or NO_CONTACT
        # a spring to which a force counts only from where it is certain would swing about there
        springs = given.task is not None and any(axis.stiffness for axis in given.task.axes)
        self._measurement.step(own, given, self._run.is_touching or springs)
        topic = "force_command" if given.task is None else "task_command"
        if given.task is None and given.torque is not None and own.mode != "open_loop":
            topic, torques = "joint_torque_command", joint_axes(AxisKind.FORCE, given.torque)
            given = given._replace(task=TaskCommand(BASE, torques), torque=None)
        if given.task is None and self._run.key[:1] == (TaskCommand,):
            admitted.restart(joints.position)  # the arm stays where it is
        admitted.step(own, given)
        task, key = _task(admitted.force, given.task, own)
        run, is_free = self._run, given.contact is not None and not contact.cover
        waits = run.is_moving or (run.may_zero and is_free and run.held_at is not None)
        if key != run.key or (waits and self._measurement.rest.time > FORCE.friction_turn):
            self._begin(task, key, is_free, bool(contact.cover))
        self._find_axes(task, contact)
        if own.mode == "open_loop" and given.task is None:
            effort = sum((one.now.along * one.now.desired for one in self._run.axes), np.zeros(len(pose)))
            self.events, self._velocity = (), np.array(joints.velocity)
            return ForceOutput([], effort.tolist(), frame=self._run.frame)
        if given.posture is None or admitted.posture != list(given.posture):
            given = given._replace(rate=None)
        found = self._watch(given) if self._run.axes else []
        if given.task is not None and (reason := beyond(given.task, own)):
            found.append(holding(Code.REFUSED, "task", reason=reason))
        velocity, fed, limits = self._move(found, given)
        found += limits + ([] if self._pushed.event is None or is_braked else [self._pushed.event])
        found += self._watch_motions(found, given)
        self.events = by_seriousness(self._advised(found, task))
        if self.event.holds:
            self.refusals[topic] = self.event
        self._velocity = velocity
        return self._output(velocity, fed, given.task is not None)

    def _measurable(self, given: ForceInput) -> ForceInput:
        """Without the signals that are fed back, a force would grow without bounds."""
        own = self.parameters
        if (given.contact if own.is_estimated else given.sensors) is not None:
            return given
        if own.mode == "open_loop":
            return given._replace(task=None)
        return given._replace(task=None, command=None, torque=None)

    def _reset(self) -> None:
        """Hold this posture and forget what was before."""
        self._admission.restart(self._pose.tolist())
        self._measurement.restart()
        self._pushed.restart()
        self._velocity = np.zeros(len(self._pose))
        self._begin(None, ())

    def _begin(
        self, task: TaskCommand | None, key: tuple[object, ...], is_free: bool = False, is_touched: bool = False
    ) -> None:
        """Something else is commanded: what a free arm at rest measures is the error of its model."""
        measurement, limit = self._measurement, self.parameters.sensing.zero_limit
        before, still_sd, resting = self._run, measurement.torques.sd, np.zeros(len(self._velocity))
        is_zeroed, rests = task is not None and bool(limit), is_free and measurement.rest.is_slow
        has_left = is_zeroed and self._has_left
        if has_left:
            if rests:
                measurement.zero(limit)
            resting = measurement.before
        is_moving = is_zeroed and measurement.rest.speed > FORCE.slow
        self._run = CommandRun(key, task, self._body.arm, self._timing, self._pose, resting, still_sd, is_moving)
        self._run.may_zero = has_left and not rests
        self._run.go_on(before, is_touched)
        self._moved = np.zeros(len(self._pose))
        if self.supervision.watch is not None:
            self.supervision.watch.restart()

    def _find_axes(self, task: TaskCommand | None, contact: Contact) -> None:
        """The axes of what is commanded, each at its place, in this period."""
        run = self._run
        if task is None:
            return
        if self.parameters.is_estimated:
            self._axes.forces.torque_sd = run.still_sd
        places = [self._places(task, axis, contact, one.place) for axis, one in zip(task.axes, run.axes, strict=True)]
        sides = [one.side for one in run.axes]
        links = max(map(len, places))
        each = zip(*(at * (links // len(at)) for at in places), strict=True)
        axes = zip(*(self._axes.of(self._pose, task, at, sides) for at in each), strict=True)
        for one, axis, at in zip(run.axes, axes, places, strict=True):
            one.on_links = self._knowledge.among(self._pose, axis[: len(at)], contact)

    def _places(self, task: TaskCommand, axis: TaskAxis, contact: Contact, memory: ContactPlace) -> list[ForcePlace]:
        lean = 0.0
        if axis.is_joint:
            return [ForcePlace("", 0.0, 0.0)]
        if contact.cover and axis.position is None:
            direction = self._axes.rotation(self._pose, task.frame).dot(np.array(axis.direction))
            along = self._axes.forces.link_axis(self._pose, contact.cover)
            lean = abs(float(direction.dot(along)))
        return memory.step(axis, contact, lean, self.parameters)

    def _watch(self, given: ForceInput) -> list[Event]:
        """What is known of each axis, and what its watch reports."""
        own, run, forces, torques = self.parameters, self._run, self._axes.forces, self._measurement.torques
        q, contact = self._pose, given.contact or NO_CONTACT
        run.judge(q, self._measurement, forces, own.sensing.zero_limit)
        for one in run.axes:
            one.known = self._knowledge.of(q, one.on_links)
            # a held arm has not left what it touched, also where that is not estimated any more
            if one.now.of.position is None and one.touch.has_been and run.held_at is not None and not contact.cover:
                one.known = one.known._replace(errors=Errors(place=math.inf))
        run.move(self._moved, forces, q)
        found = [holding(Code.REFUSED, "moved_fast", speed=FORCE.slow)] if run.is_moving else []
        is_led = bool(given.rate) or not all(one.now.is_force for one in run.axes)
        covers = {one.now.of.cover for one in run.axes if one.now.place}
        probable = contact.probability >= own.link_probability_limit
        touched = contact.cover if covers and probable and not covers & {"", contact.cover} else ""
        for one in run.axes:
            axis, known = one.now, one.known
            size, force = (abs(v) if axis.is_joint else v for v in (axis.desired, known.force))
            one.touch.step(force, size, known.errors.torques, given.dt)
            if not axis.desired:
                continue
            way = 0.0 if run.held_at is not None or axis.is_joint else float(axis.along.dot(self._moved))
            is_touched = math.hypot(*contact.force) >= FORCE.touch * size
            seen = Seen(known, way, touched if is_touched else "", is_led)
            found += one.watch.step(axis, seen, torques.now, own, given.dt)
        if run.is_touching and not any(event.holds for event in found):
            self._pressed_at = q
        if not (contact.cover or run.is_touching):
            run.free_at = q
        return found

    @property
    def _knowledge(self) -> Knowledge:
        return Knowledge(self._run, self._measurement.torques, self._axes.forces, self.parameters)

    def _move(self, found: Sequence[Event], given: ForceInput) -> tuple[Array, list[float], list[Event]]:
        """Joint velocities and torques (n,), and what limits them."""
        own, run, sensing = self.parameters, self._run, self._axes.forces
        axes, contact, dt = [one.now for one in run.axes], given.contact or NO_CONTACT, given.dt
        holds = any(event.holds for event in found)
        if axes:
            self.supervision.step(self._pose.tolist(), axes, contact, dt)
        may_watch = bool(axes) and own.is_estimated and not run.is_touching
        is_watching = may_watch and run.shaking.is_watching(self._pose, sensing, self._servo, dt)
        torque_sd = self._measurement.torques.sd
        if holds or is_watching:
            run.still_sd = torque_sd
        forces = [axis for axis in axes if axis.is_force and axis.place is not None]
        allowed = min([own.limits.contact_force, *(axis.desired for axis in forces if axis.desired)])
        rows = [] if holds or not axes else self._rows(is_watching, dt)
        if holds:
            run.delayed = []
            if run.held_at is None:
                run.held_at = self._hold_at(found, contact)
            # what it may hit on its way back after a push
            wanted = calm(self._towards(run.held_at), sensing.moved_inertia(self._pose), own.impact_energy(allowed))
        else:
            run.held_at = None
            wanted = self._towards(np.array(self._admission.posture) + run.approached, given.rate)
            if not given.rate:
                wanted = self._slowed(rows, wanted)
        least = self._pushes(forces, contact, holds, allowed, dt)
        step = own.limits.joint_acceleration * dt or math.inf
        if self._pushed.is_yielding or any(axis.of.kind is AxisKind.IMPEDANCE for axis in axes):
            step = math.inf  # a stiff hand would make a late arm swing
        low, high = joint_bounds(self._pose.tolist(), self._body.arm.joints, own, self._velocity.tolist(), step)
        velocity, free = solve(rows, wanted, least, low, high)
        limits = [] if velocity is free else self._at_ends(free, velocity)
        fed = run.fed_forward(holds, own)
        if forces and not holds and own.friction_feedforward and not own.is_estimated:
            countered = sensing.dry_friction(velocity.tolist())
            friction = run.friction.step(countered, FORCE.friction_time, dt)
            fed += own.friction_feedforward * np.array(friction)
        return velocity, fed.tolist(), limits

    def _towards(self, goal: Array, rate: Sequence[float] | None = None) -> Array:
        """Velocities (n,), rad/s, towards joint angles (n,), rad, that move at a rate (n,), rad/s."""
        gain, most = self.parameters.posture_gain, self.parameters.joint_speed_limit
        each = zip(goal.tolist(), self._pose.tolist(), rate or [0.0] * len(goal), strict=True)
        return np.array([min(max(gain * (angle - at) + speed, -most), most) for angle, at, speed in each])

    def _hold_at(self, found: Sequence[Event], contact: Contact) -> Array:
        """Where the arm is to hold (n,), rad: here, or off another link, on from where it last was free."""
        run, q = self._run, self._pose
        torques = self._measurement.torques.now - run.resting
        is_elsewhere = any(event.holds and event.code is Code.UNEXPLAINED for event in found)
        if not is_elsewhere or not torques.any():
            return q
        away = torques * (math.hypot(*contact.force) / float(torques @ torques))
        return run.free_at + FORCE.creep * away  # friction would hold it in less

    def _rows(self, is_watching: bool, dt: float) -> list[VelocityRow]:
        """The commanded velocity along each axis; none while the arm is watched before it moves."""
        run, own = self._run, self.parameters
        speeds = [self._speed(one, dt) for one in run.axes]
        watch = self.supervision.watch
        if is_watching or not (watch is None or watch.is_assessed):
            speeds = [0.0] * len(speeds)
        run.delayed = [*run.delayed, speeds][-own.delay_samples - 1 :]
        late = run.delayed[0] if len(run.delayed) > own.delay_samples else [0.0] * len(speeds)
        rows = [VelocityRow(one.now.along, speed) for one, speed in zip(run.axes, late, strict=True)]
        forces = [row for row, one in zip(rows, run.axes, strict=True) if one.now.is_force]
        most = own.task.fastest(False)[0]
        return [
            row if (jacobian := one.now.jacobian) is None else reachable(row, jacobian, forces, most)
            for row, one in zip(rows, run.axes, strict=True)
        ]

    def _speed(self, one: AxisRun, dt: float) -> float:
        """Commanded speed along one axis, m/s or rad/s."""
        own, axis, known = self.parameters, one.now, one.known
        fastest = own.task.fastest(axis.is_joint)[0]
        if axis.is_force:
            speed = self._force_speed(one, dt)
            return min(max(speed, -fastest), fastest) if len(self._run.axes) > 1 else speed
        goal = one.goal(dt, own.limits.settling_time)
        if axis.of.kind is AxisKind.VELOCITY:
            speed = axis.of.speed
        elif axis.of.kind is AxisKind.POSITION:
            speed = axis.of.speed + own.task.largest_rate * (goal - axis.at)
        else:
            band = own.task.joint_deadband if axis.is_joint else own.task.deadband
            if not axis.is_joint and known.force < -band:
                one.side = -one.side  # an impedance may be pushed from either side
            drive = axis.of.stiffness * (axis.side * goal - axis.at) - known.force
            yielding = math.copysign(max(abs(drive) - band, 0.0), drive)
            speed = axis.side * axis.of.rate + self.supervision.factor * yielding / own.task.damping(axis.of)
        return min(max(speed, -fastest), fastest)

    def _force_speed(self, one: AxisRun, dt: float) -> float:
        """The law of a force or a torque, as fast as the limits allow."""
        own, axis, known, factor = self.parameters, one.now, one.known, self.supervision.factor
        if axis.sensed is None:
            error, before = axis.desired - known.force, axis.desired - known.before
            return factor * self.supervision.torque_law.velocity(axis.of.joint, error, before, dt)
        risen = one.rising
        law, expected = self.supervision.force_law.along(axis.in_frame.tolist()), one.expected(own, dt)
        if own.limits.impact:
            band = resolution(axis.sensed, axis.desired, own) * (2.0 if one.is_kept else 1.0)
            one.is_kept = one.touch.is_there and abs(axis.desired - known.force) < band
            if one.is_kept or (one.touch.is_there and one.is_settling(own)):
                return 0.0
        error = expected - known.force
        speed = factor * one.watch.oscillation.share * law.velocity(0, error, expected - known.before, dt)
        if one.touch.is_there and own.limits.impact:
            speed += (one.rising - risen) / dt * yielding(axis.sensed, own)
        if axis.desired:  # back no faster than the measured force can follow
            slack = servo_yielding(axis, self.supervision.servo_stiffness, own)
            most = approach_speed(axis, one.touch.is_there, own, slack)
            speed = min(max(speed, -most * max(-error / axis.desired, 1.0)), most)
        return axis.sensed.speed_fraction * speed

    def _slowed(self, rows: Sequence[VelocityRow], wanted: Array) -> Array:
        """Velocities of the posture (n,), rad/s, at which the forces stay right."""
        run, own = self._run, self.parameters
        if any(one.is_kept for one in run.axes) and float(np.abs(wanted).max()) < FORCE.slow_posture:
            return np.zeros_like(wanted)
        for one in run.axes:
            axis = one.now
            if axis.desired and axis.place and one.touch.has_been and own.limits.impact:
                left = unlimited([row._replace(speed=0.0) for row in rows], wanted)
                wanted = followed(left, axis, self._body, self._pose, own)
        return wanted

    def _pushes(
        self, forces: Sequence[CommandedAxis], contact: Contact, holds: bool, allowed: float, dt: float
    ) -> list[VelocityRow]:
        """What pushes harder than allowed."""
        own, run, torques = self.parameters, self._run, self._measurement.torques
        # whatever is touched is loaded by the arm's own motion, also where that is not along the commanded force
        has_touched = contact.cover or any(one.touch.has_been for one in run.axes)
        pressed = math.fsum(axis.desired for axis in forces) if has_touched else 0.0
        is_bouncing = any(one.touch.is_bouncing for one in run.axes)
        bounds = [(own.limits.contact_force, "limits.contact_force")]
        if holds:
            bounds.append((allowed, "the commanded force"))
        elif pressed and len(forces) == len(run.axes):
            factor = own.limits.whole_force
            bounds.append((factor * pressed, f"{factor:g} times the command, limits.whole_force"))
        now = torques.now - run.resting
        if torques.acceleration is not None:
            now = now + self._axes.forces.inertia(self._pose).dot(torques.acceleration)
        chi2 = max([one.known.chi2 for one in run.axes], default=0.0)
        gain = self.supervision.factor * max(own.force_gain)
        return self._pushed.step(
            self._pose, forces, now, torques.sd, contact, chi2, min(bounds), bool(pressed), is_bouncing, gain, own, dt
        )

    def _at_ends(self, unlimited: Array, velocity: Array) -> list[Event]:
        """The joints that do not move on at their ends."""
        own, joints = self.parameters, self._body.arm.joints
        found = []
        for i, (low, at, high) in enumerate(zip(joints.lower, self._pose.tolist(), joints.upper, strict=True)):
            end = low if unlimited[i] < 0.0 else high
            near = own.limits.joint_margin + FORCE.slow / max(own.limits.joint_gain, FORCE.slow)
            if abs(velocity[i]) < FORCE.stopped * abs(unlimited[i]) and abs(at - end) < near and own.limits.joint_gain:
                name, margin = joints.names[i], own.limits.joint_margin
                found.append(warning(Code.AT_LIMIT, "joint_end", joint=name, angle=at, end=end, margin=margin))
        return found

    def _watch_motions(self, found: Sequence[Event], given: ForceInput) -> list[Event]:
        """What the motions of a task do not reach, or a posture where it is all there is."""
        own, run = self.parameters, self._run
        if any(event.holds or event.code is Code.PUSHED for event in found):
            run.motions.clear()
            return []
        moving: list[tuple[str, str, float, float, float, float, float]] = []
        for one in run.axes:
            if one.of.kind in (AxisKind.POSITION, AxisKind.VELOCITY):
                axis, of, goal = one.now, one.now.of, one.goal(0.0, math.inf)
                law = own.task.largest_rate, own.task.fastest(axis.is_joint)[0]
                moving.append((of.name, of.unit, goal, of.speed, axis.at, *law))
        if not run.axes and given.posture is not None:
            law, rates = (own.posture_gain, own.joint_speed_limit), given.rate or [0.0] * len(self._pose)
            each = zip(self._body.arm.joints.names, self._admission.posture, rates, self._pose.tolist(), strict=True)
            moving = [(name, "rad", goal, speed, at, *law) for name, goal, speed, at in each]
        lasting = FORCE.quarter * own.limits.settling_time
        events = [run.motions[i].step(*each, lasting, given.dt) for i, each in enumerate(moving)]
        return [event for event in events if event]

    def _advised(self, found: list[Event], task: TaskCommand | None) -> list[Event]:
        """With what would help a refused force, which is looked for over several periods."""
        run = self._run
        is_one = len(run.axes) == 1 and not run.axes[0].now.is_joint
        is_refused = is_one and any(event.holds and event.cause == "error" for event in found)
        # what helps another force need not help this one
        if not is_refused or (run.search is not None and run.search.task != task):
            run.search = None
        if not is_refused or task is None or (run.shaking.is_watched and not run.is_touching):
            return found  # a larger force would shake, too
        if run.search is None:
            places = [(chance, at) for chance, axis in run.axes[0].on_links if (at := axis.place)]
            each = tries(
                self._pose.tolist(),
                task,
                places,
                self._axes,
                self._body.arm.joints,
                lambda pose, on_links: self._knowledge.of(pose, on_links),  # noqa: PLW0108
                self.parameters,
            )
            run.search = Search(task, each)
        ways = run.search.step()
        return [event.with_values(**ways) if event.cause == "error" else event for event in found]

    def _output(self, velocity: Array, effort: list[float], is_task: bool) -> ForceOutput:
        measured = error = limited = ZERO
        each = self._run.axes
        for one in each:
            axis, known = one.now, one.known
            if axis.is_force and axis.sensed is not None:
                law, off = self.supervision.force_law.along(axis.in_frame.tolist()), axis.desired - known.force
                measured = _added(measured, known.force, axis.in_frame)
                error = _added(error, off, axis.in_frame)
                limited = _added(limited, law.limited(0, off), axis.in_frame)
        return ForceOutput(
            velocity.tolist(),
            effort,
            measured,
            error,
            limited,
            self._run.frame,
            tuple(one.now for one in each),
            tuple(one.known for one in each),
            tuple(map(_row, each)) if is_task else (),
        )


def _task(
    force: ForceCommand | None, task: TaskCommand | None, own: ForceLoopParameters
) -> tuple[TaskCommand | None, tuple[object, ...]]:
    """What is commanded as a task, and what makes it the same command as before, whatever its values are."""
    if task is not None:
        return task, (TaskCommand, own.feedback, task.frame, *(axis.bare for axis in task.axes))
    if force is None or not any(force.force):
        return None, ()
    size = math.hypot(*force.force)
    x, y, z = (part / size for part in force.force)
    at: tuple[str, float | None] = pinned_position(force) or ("", None)
    if not at[0] and own.contact_source == "pinned":
        at = own.contact_cover, own.contact_position
    axis = TaskAxis(AxisKind.FORCE, -1, *at, (x, y, z), size)
    return TaskCommand(force.frame, (axis,)), (ForceCommand, own.feedback, force.frame)


def by_seriousness(found: Sequence[Event]) -> tuple[Event, ...]:
    """One event of each subject, those that stop the arm first, then in the order of the codes."""
    each = {event.subject: event for event in found}
    return tuple(sorted(each.values(), key=lambda event: (not event.holds, event.code.number)))


def _added(sum_before: Triple, size: float, direction: Array) -> Triple:
    (a, b, c), (x, y, z) = sum_before, direction.tolist()
    return a + size * x, b + size * y, c + size * z


def _row(one: AxisRun) -> AxisRow:
    axis, known = one.now, one.known
    commanded = axis.desired if axis.is_force else one.anchor if axis.of.value is None else axis.of.value
    sign = 1.0 if axis.is_force else axis.side
    measured = sign * known.force if axis.of.is_sensed else axis.at
    fraction = 1.0 if axis.sensed is None else axis.sensed.speed_fraction
    return float(axis.of.kind), commanded, measured, known.sd if axis.of.is_sensed else math.nan, fraction
