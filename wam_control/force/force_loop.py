"""The outer loop: force control through velocity-controlled motors (figure 5.2, sections 5.1.2 and 5.7).

F_error = F_des - F_c goes through the law of `wam_control.force.force_law`, axis by axis, and becomes a
commanded velocity along the direction of the force; the posture is held in the complement (hybrid
control, [Raibert 81]).  The axes are x y z of the command's frame, or the joints in the mode
joint_torque.  Forces are those of the arm on the world.
"""

import math
from collections.abc import Sequence
from operator import add
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.force.arm_push import ArmPush
from wam_control.force.contact_position import ContactPosition, ForceCase, ForcePoint
from wam_control.force.feed_forward import FeedForward
from wam_control.force.force_axis import ForceAxes, ForceAxis, PressedForce
from wam_control.force.force_command import CommandAdmission, Commands
from wam_control.force.force_hold import ForceHold, by_seriousness
from wam_control.force.force_law import BumplessTransfer, DelayLine
from wam_control.force.force_loop_parameters import ForceLoopParameters, sensing_of
from wam_control.force.force_measurement import ForceMeasurement, LowPass
from wam_control.force.given_way import GivenWay, has_left
from wam_control.force.guard import Report, Supervision, Watch
from wam_control.force.held_arm import HeldArm, RetreatForce
from wam_control.force.hybrid_velocity import followed, hybrid_velocity, posture_velocity
from wam_control.force.motion_limits import AT_COMMANDED, AT_LEAST, AT_MIDDLE, HowKnown, MotionLimits, WholeForce
from wam_control.force.motion_watch import MotionWatch
from wam_control.force.posture_watch import PostureWatch, ShortfallWatch
from wam_control.force.sensing_advice import OtherForces, Turnable
from wam_control.force.stability_guard import GuardAssessment
from wam_control.force.task import AxisKind, TaskCommand
from wam_control.force.task_control import AxisRow, TaskControl
from wam_control.force.thresholds import FORCE
from wam_control.force.torque_watch import TorqueWatch
from wam_control.thresholds import MOTION
from wam_description.arm import Arm, Servo, Timing
from wam_description.event import OBEYED, Code, Event, refused, warning
from wam_description.rigid_body import RigidBody
from wam_description.signals import BASE, NO_CONTACT, Contact, ForceCommand, State, Triple

__all__ = ["ForceCommand", "ForceLoop", "ForceLoopParameters", "ForceOutput"]

Array = NDArray[np.float64]
TASK = "task"  # in place of a frame of the force
RESTED = 3.0 * FORCE.steady_time  # s at rest, after which it is
SHORTEST = FORCE.shortest_lever**2  # m^2, square of a lever


class ForceOutput(NamedTuple):
    """Commands of one period of the force loop, and the forces behind them.

    Measured force and error are components along the commanded direction, as vectors in the frame of the
    command in force; limited is the error after saturation.
    """

    velocity: list[float]  # (n,) rad/s, empty for torque only
    effort: list[float]  # (n,) N m
    measured: Triple = (0.0, 0.0, 0.0)  # N
    error: Triple = (0.0, 0.0, 0.0)  # N
    limited: Triple = (0.0, 0.0, 0.0)  # N
    frame: str = BASE
    axis: ForceAxis | None = None  # of the commanded force; None where none is commanded
    point: ForcePoint | None = None  # where it acts
    sd_limit: float = math.inf  # N, of its standard deviation
    rows: tuple[AxisRow, ...] = ()  # of the axes of a task
    desired: float = 0.0  # N, of all that is commanded, where it presses on something
    pressed: PressedForce | None = None  # where all of it acts at one known position


class ForceLoop:
    """Force, posture and torque control at the outer rate.

    Parameters
    ----------
    arm : the arm as the controller knows it.
    servo : gains of the velocity loop, on which the guard relies.
    parameters : gains and limits.
    timing : periods of the loops, for the guard.
    command_age : time for which the last good command counts while others are refused, s; without end by default.

    Attributes
    ----------
    parameters : those in force.
    refused : number of refused commands.
    refusals : why a present command is refused, by topic; the last good one remains in force.
    fallback : why the estimated contact position is not used, '' if it is or if no contact is detected.
    reactions : what the loop does instead of what is commanded, the most serious first; none where it obeys.
    """

    def __init__(
        self,
        arm: Arm,
        servo: Servo,
        parameters: ForceLoopParameters,
        timing: Timing,
        command_age: float = math.inf,
    ) -> None:
        self._arm, self._timing = arm, timing
        self._body = RigidBody(arm)
        self._n = len(arm.joints.names)
        self._joints: tuple[float, ...] = ()
        self._admission = CommandAdmission(arm.joints, arm.covers, command_age)
        self._position = ContactPosition(arm.covers)
        self._contact_rejected = False
        self._given = GivenWay(self._body)
        self._held = HeldArm(self._body, self._given)
        self._tasks = TaskControl(arm, self._body, self._given)
        self._goes_back = False
        self._q_before: list[float] = []
        self._measurement = ForceMeasurement(self._body)
        self._filter, self._motion, self._delay = LowPass(), LowPass(), DelayLine()
        self._inertia = LowPass()
        self._approached = [0.0] * self._n
        self._feed_forward = FeedForward(arm)
        self._pressed_at: list[float] | None = None
        self._free_at: list[float] = []
        self._is_free = False
        self._external = np.zeros(self._n), np.zeros(self._n)
        self._resting: Array | None = None
        self._is_moving = self._is_fast = False
        self._rested = 0.0  # s
        self._unknown: tuple[Array, float] = np.zeros(self._n), 0.0  # torques at rest that no surface gives
        self._external_sd: Sequence[float] | None = None
        self._transfer = BumplessTransfer(self._n)
        self._hold = ForceHold()
        self._axes = ""
        self._torque_before: list[float] = []
        self._rate: Sequence[float] | None = None
        self._posture_watch = PostureWatch(arm.joints.names, "posture", "joint_speed_limit", "rad/s")
        self._posture_shortfall = ShortfallWatch(arm.joints.names)
        self._posture_motions = [MotionWatch(f"posture of {name}", "rad", "posture_taken") for name in arm.joints.names]
        self._posture_before: list[float] = []  # (n,) rad, as the task began
        self._has_posture = False  # whether another one has been commanded since
        self.refused = 0
        self.refusals: dict[str, Event] = {}
        self.fallback = ""
        self.reactions: dict[Code, Event] = {}
        self._take(servo, parameters)

    @property
    def reaction(self) -> Event:
        """The most serious one; OBEYED where the loop obeys."""
        return next(iter(self.reactions.values()), OBEYED)

    @property
    def assessment(self) -> GuardAssessment | None:
        """The guard's assessment of the parameters; None where it is off or nothing is fed back."""
        return self._supervision.assessment

    @property
    def watch(self) -> Watch | None:
        """What the guard does while the arm moves; None with the assessment."""
        return self._supervision.watch

    @property
    def report(self) -> Report:
        """The guard's report; a new object where it has changed."""
        return self._supervision.report

    @property
    def free_torques(self) -> list[float]:
        """Torques of the joint sensors (n,), N m, that count as those of a free arm; zeros with estimated torques."""
        return [0.0] * self._n if self.parameters.is_estimated else self._measurement.free

    @property
    def is_stopping(self) -> bool:
        """Whether the arm still comes to rest from a motion in which the force began; then its reason is another."""
        return self._is_fast

    @property
    def is_advised(self) -> bool:
        """Whether the reason of a refused force states what would help: it is looked for in several periods."""
        return self._hold.is_advised

    def tune(self, parameters: ForceLoopParameters) -> None:
        """Take new parameters, or refuse the set.

        Raises
        ------
        ParameterError
            where values do not fit each other or the arm, or the guard does not accept the set; nothing has
            changed then.
        """
        self._take(self._servo, parameters)

    def retune_servo(self, servo: Servo) -> None:
        """Take new gains of the velocity loop, on which the guard relies, or refuse them.

        Raises
        ------
        ParameterError
            where the guard does not accept the present parameters with them; nothing has changed then.
        """
        self._take(servo, self.parameters)

    def _take(self, servo: Servo, parameters: ForceLoopParameters) -> None:
        parameters.require_fit(self._arm)
        self._supervision = Supervision(self._arm, servo, self._timing, parameters, self._joints)
        self._servo, self.parameters = servo, parameters
        sensing = sensing_of(parameters)
        self._torque_sd = np.full(self._n, sensing.torque_sd)
        self._force_axes = ForceAxes(self._arm, self._body, sensing)
        self._limits = MotionLimits(self._arm, self._body, parameters.limits, parameters.joint_speed_limit, self._given)
        self._tasks.retune(self._force_axes, parameters, self._supervision)
        self._transfer.restart()

    def tare(self) -> str:
        """Take the present external torques as zero; '' or why they are not those of a free arm."""
        if self._axes:
            return "a force is commanded: end the command, and free the arm"
        if not self._is_at_rest:
            return "the arm moves: let it come to rest"
        if not self._has_left:
            return "the arm still is where it pressed: free it first"
        self._measurement.tare()
        self._filter.reset()
        return ""

    @property
    def is_pushed(self) -> bool:
        """Whether something has pushed the arm since it holds."""
        return bool(self._held.pushed or self._tasks.is_pushed)

    @property
    def _is_at_rest(self) -> bool:
        return self._speed < MOTION.at_rest

    @property
    def _speed(self) -> float:
        """Mean speed of the fastest joint, rad/s; infinite where it is not known yet."""
        speed = self._motion.value
        return math.inf if speed is None else max(map(abs, speed))

    @property
    def _has_left(self) -> bool:
        """Whether the arm has moved away from where it last pressed on something."""
        at = self._pressed_at
        return at is None or has_left(at, self._joints)

    def step(
        self,
        joints: State,
        sensors: State | None,
        contact: Contact | None,
        external: Sequence[float] | None,
        command: ForceCommand | None,
        posture: Sequence[float] | None,
        torque: Sequence[float] | None,
        dt: float,
        task: TaskCommand | None = None,
        posture_rate: Sequence[float] | None = None,
        external_sd: Sequence[float] | None = None,
    ) -> ForceOutput:
        """One outer period.

        Parameters
        ----------
        joints : joint state from the motors.  Where no motor gives any torque they are braked or in
            fault: all controller state is reset then.
        sensors : joint-side sensors, None where there are none.
        contact : estimated contact, force of the world on the cover; None where nobody estimates it.  Without
            the signals that `feedback` names neither force nor joint torque is controlled.
        external : estimated torques of the world on the joints (n,), N m.
        command : commanded force; None or zero leaves all axes to the posture.  Where a force ends with None, the arm
            stays where it is.
        posture : commanded joint angles (n,), rad; None holds those of the start, or those where a posture ended.
        torque : commanded joint torques on the world in the joint_torque mode (n,), N m.
        dt : outer period, s.
        task : takes the place of force and torque; where it ends, the arm stays where it is.
        posture_rate : velocity at which the commanded posture moves (n,), rad/s.
        external_sd : standard deviations of `external` (n,), N m; None where they are not published.
        """
        own = self.parameters
        self._external_sd = external_sd if own.is_estimated else None
        is_braked = not any(joints.effort)
        if not self._joints or is_braked:
            self._reset(joints.position)
        self._joints = tuple(joints.position)
        if (contact if own.is_estimated else sensors) is None:
            task = None
            if own.mode != "open_loop":
                command = torque = None  # a force that is not measured would grow without bounds
        self._is_free = contact is not None and not contact.cover
        self._given.step(joints.position, dt)
        self._motion.step(joints.velocity, FORCE.steady_time, dt)
        self._rested = self._rested + dt if self._is_at_rest else 0.0
        contact = contact or NO_CONTACT
        if task is None and self._axes == TASK:
            self._reset(joints.position)
        commands = self._admission.step(own, joints.position, command, posture, torque, dt, task)
        self._rate = posture_rate if posture_rate and commands.posture == posture else None
        if commands.refusals:
            self.refused += sum(event != self.refusals.get(topic) for topic, event in commands.refusals.items())
        self.refusals, self.fallback = commands.refusals, ""
        self.reactions = {}
        self._measurement.step(own, sensors, external, dt)
        is_touched = not own.is_estimated or bool(contact.cover) or self._hold.is_touching
        present = self._measurement.external if is_touched else [0.0] * self._n
        now, before = self._filter.step(present, own.force_filter, dt)
        self._external = np.array(now), np.array(before)
        self._acceleration, _ = self._inertia.step(self._measurement.acceleration, own.force_filter, dt)
        if task is not None:
            out = self._task(joints.position, contact, task, commands.posture, dt)
        elif own.mode == "joint_torque":
            out = self._joint_torque(contact, commands.torque, dt)
        else:
            out = self._force(joints.position, contact, commands.force, commands.posture, dt)
        velocity = self._transfer.step(out.velocity, joints.velocity, own.blend_time, dt)
        push = self._push_on_arm(joints.position, contact, _known_position(out.point, task))
        limited = self._limits.step(velocity, joints.position, push, dt, self._whole(out))
        if is_braked:
            self._limits.forget()  # the force with which brakes stop the arm is none of the world
        else:
            self._react_too(limited.contact_force)
        self._react_too(limited.joint_end)
        self._watch_rise(commands)
        self._watch_posture(commands, posture is not None, joints.position, dt)
        return ForceOutput(limited.velocity, *out[1:])

    def _watch_rise(self, commands: Commands) -> None:
        """State that the set point is not the command yet, in each reaction and, if that lasts, as one."""
        if not commands.rising or self._axes in ("", TASK):
            return
        self.reactions = {code: event.with_values(**commands.rising) for code, event in self.reactions.items()}
        if commands.risen > self.parameters.limits.settling_time:
            self._react(warning(Code.NOT_REACHED, "rising", **commands.rising), *self.reactions.values())

    def _watch_posture(self, commands: Commands, is_commanded: bool, q: Sequence[float], dt: float) -> None:
        """React to a posture that moves on faster than the arm follows, or is not reached where it is all there is."""
        is_held = self.reaction.code.holds or "joint_posture_command" in commands.refusals
        own, is_pushed = self.parameters, Code.CONTACT_FORCE in self.reactions
        if is_held or is_pushed or self._axes or not is_commanded or own.mode != "hybrid":
            self._posture_shortfall.restart()
        else:
            short = self._posture_shortfall.step(commands.posture, q, own.posture_gain, own.joint_speed_limit, dt)
            self._react_too(short)
        if self._axes != TASK or is_held or not self._posture_before:
            self._posture_before, self._has_posture = commands.posture, False
        if is_held:
            self._posture_watch.restart()
            return
        limit = self.parameters.joint_speed_limit
        late = (
            self._posture_watch.step(commands.posture, self._rate is not None, q, limit, dt)
            if is_commanded
            else self._posture_watch.wait(dt)
        )
        self._react_too(late)
        if self._posture_before is not commands.posture:
            self._watch_posture_of_task(commands.posture, q, dt)

    def _watch_posture_of_task(self, posture: Sequence[float], q: Sequence[float], dt: float) -> None:
        """React to a posture that has moved next to a task, and that the task does not leave to the arm."""
        before = self._posture_before
        if not self._has_posture:
            if posture == before or not any(abs(a - b) > MOTION.arrived for a, b in zip(posture, before, strict=True)):
                return
            self._has_posture = True
            for watch in self._posture_motions:
                watch.restart()
        own, rate, share = self.parameters, self._rate or [0.0] * self._n, self._tasks.share
        law = own.posture_gain, own.joint_speed_limit
        for goal, speed, at, watch in zip(posture, rate, q, self._posture_motions, strict=True):
            self._react_too(watch.position(goal, speed, at, 1.0, law, share, own, dt))

    def _whole(self, out: ForceOutput) -> WholeForce | None:
        """The force that presses on something, and how it is known in all; None where none does."""
        if not out.desired:
            return None
        pressed = out.pressed
        return WholeForce(out.desired, (lambda: self._whole_force(pressed)) if pressed else lambda: None)

    def _whole_force(self, pressed: PressedForce) -> tuple[float, HowKnown]:
        """The force in all, N, and how it is known: at its position, or on another link if it would be less there.

        Torques that no force along the commanded direction gives may be those of a push on another link.  They may
        look like a force along this one, which would have to be many times as large.
        """
        q, torques, axes = self._joints, self._external[0], self._force_axes
        size = axes.whole(q, pressed, torques)
        if size <= FORCE.slow_from * self.parameters.limits.whole_force * pressed.force:
            return size, AT_COMMANDED
        axis = axes.axis(q, pressed)
        if axis.unexplained(torques) <= FORCE.unexplained * max(-float(axis.sense @ torques) / pressed.force, 1.0) ** 2:
            return size, AT_COMMANDED
        here = self._push(q, pressed[:2]).least(self._body, q), AT_LEAST
        others = [
            (self._push(q, (cover, FORCE.middle * length)).least(self._body, q), (AT_MIDDLE, cover))
            for cover, length in self._other_covers(pressed)
        ]
        return min((size, AT_COMMANDED), max([here, *others]))

    def _react(self, *found: Event) -> None:
        self.reactions = by_seriousness(found)

    def _react_too(self, event: Event | None) -> None:
        """React to this, too, where there is something."""
        if event:
            self._react(*self.reactions.values(), event)

    def _reset(self, q: Sequence[float]) -> None:
        """Hold this posture and forget what was before."""
        self._admission.restart(q)
        self._given.restart()
        self._posture_watch.restart()
        self._posture_shortfall.restart()
        self._transfer.reset()
        self._filter.reset()
        self._begin("")

    def _begin(self, axes: str) -> None:
        """Control other axes, without a memory of the force on those before; '' for none.

        What a free arm at rest measures is the error of its model.
        """
        self._hold.reset()
        self._position.restart()
        self._delay.reset()
        self._feed_forward.reset()
        self._torque_before, self._q_before, self._free_at = [], [], []
        self._torques = [TorqueWatch(name) for name in self._arm.joints.names]
        self._external = self._external[0], self._external[0]
        self._resting = None
        if axes != self._axes:
            self._given.restart()
        self._axes = axes
        self._approached = [0.0] * self._n  # along the force: as its lever turns, the posture would pull this back
        self._held.release()
        self._transfer.restart()
        limit = self.parameters.sensing.zero_limit
        self._is_moving, self._is_fast = not self._is_at_rest, False
        if not (axes and limit and self._has_left):
            return
        self._is_fast = self._speed > FORCE.fast and axes != TASK
        if self._is_moving:
            self._resting = self._external[0]
            if self.parameters.feedback == "joint_sensors":
                self._resting = self._resting + self._force_axes.inertia(self._joints) @ self._acceleration
            return
        if self._is_free and self._measurement.zero(limit):
            self._filter.reset()
            self._external = np.zeros(self._n), np.zeros(self._n)  # not a touch, as it would be without this zero
        self._resting = self._measurement.resting

    def _force(
        self, q: Sequence[float], contact: Contact, command: ForceCommand | None, posture: list[float], dt: float
    ) -> ForceOutput:
        """Force along the commanded direction, posture in the complement."""
        own, law = self.parameters, self._supervision.force_law
        is_open = own.mode == "open_loop"
        desired = math.hypot(*command.force) if command is not None else 0.0
        axes = command.frame if command is not None and desired else ""
        if axes != self._axes or (self._is_fast and self._rested > RESTED):
            self._begin(axes)
        goal = list(map(add, posture, self._approached))
        held = posture_velocity(goal, q, own.posture_gain, own.joint_speed_limit, self._rate)
        if command is None or not desired:
            return ForceOutput([] if is_open else held, [0.0] * self._n, frame=command.frame if command else BASE)
        rotation = np.eye(3) if command.frame == "base" else self._body.cover_pose(q, command.frame).rotation
        direction = rotation @ (np.array(command.force) / desired)
        axis = (rotation.T @ direction).tolist()
        point = self._point(contact, command, direction)
        force_axis = self._force_axes.axis(q, point.pressed(direction, desired))
        measured, before, free = self._measured(force_axis)
        scalar = law.along(axis)
        error, is_touching = desired - measured, self._hold.is_touching
        out = ForceOutput(
            [],
            [0.0] * self._n,
            _triple([part * measured for part in axis]),
            _triple([part * error for part in axis]),
            _triple([part * scalar.limited(0, error) for part in axis]),
            command.frame,
            force_axis,
            point,
            own.sensing.sd_limit(desired, point.is_pinned),
            desired=desired if is_touching or contact.cover else 0.0,
            pressed=point.pressed(direction, desired) if is_touching and point.is_certain else None,
        )
        moved = np.array(q) - np.array(self._q_before or q)
        self._q_before = list(q)
        is_watching = self._is_watching(force_axis, moved, dt)
        self._react(*self._found(q, force_axis, point, direction, (measured, free), desired, dt, command.frame))
        self._remember(q, moved, contact, point, force_axis, direction, dt)
        if self.reaction.code.holds:
            measured -= -float(force_axis.sense @ self._unknown[0])
            excess = self._hold.excess(force_axis, measured, desired, self._torque_error(force_axis))
            factor = self._gain_factor(point, _triple(direction.tolist()), desired, dt)
            force = RetreatForce(force_axis, factor * scalar.velocity(0, -excess, -excess, dt) if excess else 0.0)
            velocity, effort = self._hold_still(q, contact, point, force, desired, dt)
            if pushed := self._held.pushed:
                self._react(self.reaction.with_values(pushed=pushed))
            self.refusals["force_command"] = self.reaction
            return out._replace(velocity=[] if is_open else velocity, effort=effort)
        if self._held.is_holding:
            self._held.release()
            self._transfer.restart()
        if is_open:
            return out._replace(effort=(force_axis.lever * desired).tolist())
        if contact.cover and not point.is_identified:
            error = min(error, self._shortfall(q, point, direction, desired))
        if self._hold.keeps(force_axis, measured, desired, own):
            error, held = 0.0, self._at_rest(held)
        speeds = self._delay.step(scalar.velocities([error], [desired - before], dt), own.delay_samples)
        speed = speeds[0] * self._gain_factor(point, _triple(direction.tolist()), desired, dt)
        speed *= self._hold.share
        speed = min(speed, 0.0 if is_watching else self._hold.approach_speed(force_axis, point, desired, own))
        if self._hold.has_touched and self._rate is None:
            held = self._followed(q, point, force_axis, held, desired, scalar.gain[0])
        velocity = hybrid_velocity(held, force_axis, speed, own.joint_speed_limit)
        fed = force_axis.lever * (self._hold.feed(point, own, dt) * desired)
        return out._replace(velocity=velocity, effort=self._feed_forward.step(fed, velocity, own, dt))

    def _followed(
        self, q: Sequence[float], point: ForcePoint, axis: ForceAxis, held: list[float], desired: float, gain: float
    ) -> list[float]:
        """Velocities of the posture (n,), rad/s, slower where the link would slide fast on what it presses."""
        on_axis = (point.position, *self._arm.covers.aside(point.cover, point.position))
        across = np.array(hybrid_velocity(held, axis, 0.0, self.parameters.joint_speed_limit))
        slow: list[float] = followed(across, self._body.point_jacobian(q, point.cover, on_axis), desired, gain).tolist()
        return slow

    def _measured(self, axis: ForceAxis) -> tuple[float, float, float]:
        """Force along an axis, N, now and one period before, and now without the inertia of the arm itself.

        The last one shows whether something is touched, and is the measured one until then: near a straight elbow the
        apparent mass of the arm has either sign, and the arm would chatter in free space.
        """
        measured, before = (-float(axis.sense @ torques) for torques in self._external)
        if self.parameters.feedback != "joint_sensors":
            return measured, before, measured
        # the acceleration is the mean of a period
        free = 0.5 * (measured + before) - float(axis.carried @ self._acceleration)
        return (measured, before, free) if self._hold.is_touching else (free, free, free)

    def _found(
        self,
        q: Sequence[float],
        axis: ForceAxis,
        point: ForcePoint,
        direction: Array,
        measured: tuple[float, float],
        desired: float,
        dt: float,
        frame: str,
    ) -> list[Event]:
        """What the loop does instead of the command; forces in N, the measured one without inertia, too."""
        if self._is_fast:
            return [warning(Code.NOT_SENSED, "moved_fast", speed=FORCE.fast)]
        if self._resting is not None:
            self._judge(q, point, direction, self._resting)
        return self._hold.step(
            self._case(q, axis, point, direction, desired),
            self._external[0],
            measured[0],
            self.parameters,
            dt,
            pushed=measured[1],
            others=lambda: self._others(q, point, direction, frame),
            given_way=0.0 if self._held.is_holding else self._given.way,
        )

    def _case(
        self, q: Sequence[float], axis: ForceAxis, point: ForcePoint, direction: Array, desired: float
    ) -> ForceCase:
        """A force in a pose, with what is known of the torques now."""
        return ForceCase(
            axis,
            point,
            desired,
            signal=axis.signal(desired, self._external_sd) if self._external_sd else math.inf,
            elsewhere=math.inf if point.is_pinned else self._signal_elsewhere(q, point, direction, desired),
            torque_error=self._torque_error(axis),
            unknown=-float(axis.sense @ self._unknown[0]),
            payload=self._unknown[1],
        )

    def _others(self, q: Sequence[float], point: ForcePoint, direction: Array, frame: str) -> OtherForces:
        """A force along the same direction of its frame in other poses, of other sizes, and at a pinned position."""
        body, joints, margin = self._body, self._arm.joints, self.parameters.limits.joint_margin
        known = point._replace(is_pinned=True, is_certain=True, is_identified=True, is_doubtful=False)
        pinned = known._replace(position_sd=self.parameters.contact_position_sd)

        def turn(pose: Sequence[float]) -> Array:
            return np.eye(3) if frame == BASE else body.cover_pose(pose, frame).rotation

        along = turn(q).T @ direction

        def at(pose: Sequence[float], force: float, is_pinned: bool) -> ForceCase:
            there, u = pinned if is_pinned else point, turn(pose) @ along
            return self._case(pose, self._force_axes.axis(pose, there.pressed(u, force)), there, u, force)

        moving = np.flatnonzero(np.any(body.cover_jacobian(q, point.cover) != 0.0, axis=0))[::-1].tolist()
        turnable = [Turnable(i, joints.names[i], joints.lower[i] + margin, joints.upper[i] - margin) for i in moving]
        where = (
            "" if point.is_pinned else f"by a force in the frame of {point.cover}; computed for {point.position:.3g} m"
        )
        return OtherForces(q, turnable, where, at)

    def _torque_error(self, axis: ForceAxis) -> float:
        """Standard deviation of the force by those of the estimated torques, N; 0 with sensors."""
        return axis.error(self._external_sd) if self._external_sd else 0.0

    def _judge(self, q: Sequence[float], point: ForcePoint, direction: Array, resting: Array) -> None:
        """Whether torques that are there as a force begins (n,), N m, are those of a surface that is touched already.

        Otherwise they are an error of the force.  What a mass at the tool explains may always be one.
        """
        pressed = point.pressed(direction, 0.0)
        force = -float(self._force_axes.axis(q, pressed).sense @ resting)
        axis = self._force_axes.axis(q, pressed._replace(force=abs(force)))
        carried = self._carried(q, resting)
        is_pressed = force > 0.0 and axis.unexplained(resting) <= FORCE.unexplained
        is_contact = (is_pressed or self._is_moving) and not carried
        self._resting, self._unknown = None, (np.zeros(self._n), 0.0) if is_contact else (resting, carried)

    def _judge_load(self, q: Sequence[float]) -> None:
        """The same for no direction: what no mass at the tool explains may be surfaces that are touched already."""
        if (resting := self._resting) is not None:
            carried = self._carried(q, resting)
            self._resting, self._unknown = None, (resting if carried else np.zeros(self._n), carried)

    def _carried(self, q: Sequence[float], resting: Array) -> float:
        """The mass at the tool, kg, that explains torques at rest (n,), N m; 0 where none does."""
        sd = math.hypot(sensing_of(self.parameters).torque_sd, FORCE.payload_rest * float(np.abs(resting).max()))
        mass, left = self._measurement.payload(q, resting, sd)
        return mass if mass > 0.0 and left <= FORCE.unexplained else 0.0

    def _hold_still(
        self,
        q: Sequence[float],
        contact: Contact,
        point: ForcePoint,
        force: RetreatForce,
        desired: float,
        dt: float,
    ) -> tuple[list[float], list[float]]:
        """Velocities and torques of an arm that holds: to where it does, or away from what pushes too hard."""
        own, still = self.parameters, [0.0] * self._n
        self._hold.fed = 0.0
        goes_back = self.reaction.code is Code.OTHER_LINK
        if not self._held.is_holding or goes_back != self._goes_back:
            self._goes_back = goes_back
            self._held.hold(self._free_of(force.axis) if goes_back else q)
            self._transfer.restart()
        push = self._push(q, self._pushed_position(contact, _known_position(point, None)))
        push = push._replace(allowed=min(push.allowed, desired))
        velocity, is_yielding = self._held.step(q, [force], push, self._force_axes.moved_inertia(q), own)
        return velocity, self._feed_forward.step(np.zeros(self._n), velocity, own, dt) if is_yielding else still

    def _push(self, q: Sequence[float], where: tuple[str, float] | None) -> ArmPush:
        """What pushes the arm, at a position of a cover or wherever it does."""
        own = self.parameters
        torques = self._external[0] - self._unknown[0]
        if own.feedback == "joint_sensors":
            torques = torques + self._force_axes.inertia(q).dot(self._acceleration)
        gain = self._supervision.present * max(own.force_gain)
        return ArmPush(torques, self._push_sd, where, own.limits.contact_force, gain)

    def _push_on_arm(self, q: Sequence[float], contact: Contact, where: tuple[str, float] | None) -> ArmPush:
        """What pushes the arm: where the commanded force acts, or no nearer to the base than a contact is estimated."""
        if self.reaction.code.holds:
            return self._push(q, self._pushed_position(contact, where))
        probable = self.parameters.link_probability_limit
        if where is not None or not contact.cover or not contact.probability >= probable:
            return self._push(q, where)
        length = self._arm.covers.length_of(contact.cover)
        farthest = contact.position + FORCE.certain * contact.position_sd
        where = contact.cover, min(length if math.isnan(farthest) else farthest, length)
        return self._push(q, where)._replace(is_estimated=True)

    @property
    def _push_sd(self) -> Array:
        """Standard deviations of the torques of the world on the joints (n,), N m."""
        return np.array(self._external_sd) if self._external_sd else self._torque_sd

    def _pushed_position(self, contact: Contact, where: tuple[str, float] | None) -> tuple[str, float] | None:
        """Where an arm that holds is pushed: estimated, if on another cover than that of the known position."""
        if contact.cover and (where is None or where[0] != contact.cover):
            middle = FORCE.middle * self._arm.covers.length_of(contact.cover)
            where = contact.cover, middle if math.isnan(contact.position) else contact.position
        return where

    def _is_watching(self, axis: ForceAxis, moved: Array, dt: float) -> bool:
        """Whether it is still watched how the dither shakes the arm, by the motion of the joints (n,), rad."""
        cycle = self._timing.dither_cycle
        if not self.parameters.is_estimated or not cycle:
            return False
        return self._hold.watch_shaking(axis, moved, 2.0 * math.pi / (cycle * self._timing.period), dt)

    def _remember(
        self,
        q: Sequence[float],
        moved: Array,
        contact: Contact,
        point: ForcePoint,
        axis: ForceAxis,
        direction: Array,
        dt: float,
    ) -> None:
        """Keep where the arm presses, how far it has slid, its way there and back, and where it was free."""
        if not self.reaction.code.holds and self.parameters.mode != "open_loop":
            self._hold.travel(float(axis.lever @ moved), dt, self._posture_watch.is_moving)
            if self._hold.goes_back:
                self._given.give(-direction)
        self._position.slide(self._force_axes.slide(q, point.cover, point.position, moved))
        if self._hold.is_touching:
            if not self.reaction.code.holds:
                self._pressed_at = list(q)
        else:
            way = axis.lever * (float(axis.lever @ moved) / max(float(axis.lever @ axis.lever), SHORTEST))
            self._approached = [a + b for a, b in zip(self._approached, way.tolist(), strict=True)]
        if not (contact.cover or self._hold.is_touching) or not self._free_at:
            self._free_at = list(q)

    def _at_rest(self, held: list[float]) -> list[float]:
        """Velocities of the posture, without those of a small error: they would wind up friction across the force."""
        is_small = self._rate is None and max(map(abs, held)) < FORCE.slow_posture
        return [0.0] * self._n if is_small else held

    def _free_of(self, axis: ForceAxis) -> list[float]:
        """Where the arm was free, and `way_back` further against the force: friction would hold it in less."""
        away = axis.lever * (FORCE.way_back / float(axis.lever @ axis.lever))
        return [a - b for a, b in zip(self._free_at, away.tolist(), strict=True)]

    def _signal_elsewhere(self, q: Sequence[float], point: ForcePoint, direction: Array, desired: float) -> float:
        """Torques of the commanded force on another cover, near its base, in sd of the estimated torques."""
        if not self._external_sd:
            return math.inf
        sd = np.array(self._external_sd)
        found = [
            desired
            * float(np.linalg.norm(self._force_axes.lever(q, cover, FORCE.faint_position * length, direction) / sd))
            for cover, length in self._other_covers(point)
        ]
        return min(found, default=math.inf)

    def _shortfall(self, q: Sequence[float], point: ForcePoint, direction: Array, desired: float) -> float:
        """Force that is missing, N, if another cover is touched: below 0 in its middle, 0 if nearer to the base."""
        middle = self._largest_force(q, point, direction, desired, FORCE.middle)
        if self.parameters.is_estimated:
            return desired - middle  # the motors identify a link only by a large force
        return max(
            desired - self._largest_force(q, point, direction, desired, FORCE.near_end), min(desired - middle, 0.0)
        )

    def _largest_force(
        self, q: Sequence[float], point: ForcePoint, direction: Array, desired: float, part: float
    ) -> float:
        """Largest force along a direction, N, that the torques would be of at a part of the length of other covers."""
        found = -math.inf
        for cover, length in self._other_covers(point):
            axis = self._force_axes.axis(q, PressedForce(cover, part * length, 0.0, direction, desired))
            if axis.force_sd <= FORCE.vague * self.parameters.sensing.sd_limit(desired, is_pinned=False):
                found = max(found, -float(axis.sense @ self._external[0]))
        return found

    def _other_covers(self, point: ForcePoint | PressedForce) -> list[tuple[str, float]]:
        """Names and lengths, m, of the covers on which the force is not commanded."""
        covers = self._arm.covers
        return [one for one in zip(covers.names, covers.length, strict=True) if one[0] != point.cover]

    def _task(
        self, q: Sequence[float], contact: Contact, task: TaskCommand, posture: list[float], dt: float
    ) -> ForceOutput:
        """Force, motion or impedance along each axis of a task, posture in what they leave."""
        if self._axes != TASK:
            self._begin(TASK)
            self._tasks.restart()
        self._judge_load(q)
        push = self._push(q, self._pushed_position(contact, _known_position(None, task)))
        found = self._tasks.step(task, q, self._external, contact, posture, self._rate, dt, self._unknown, push)
        self.reactions = found.reactions
        if self.reaction.code.holds:
            self.refusals["task_command"] = self.reaction
        elif self._tasks.is_touching:
            self._pressed_at = list(q)
        if found.has_changed:
            self._transfer.restart()
        measured, error = _triple(found.measured.tolist()), _triple(found.error.tolist())
        out = ForceOutput(found.velocity, found.effort, measured, error, error, task.frame)
        return out._replace(rows=found.rows, desired=found.desired, pressed=found.pressed)

    def _joint_torque(self, contact: Contact, torque: Sequence[float] | None, dt: float) -> ForceOutput:
        """Torque of each joint; without a command the arm holds still."""
        axes = "joints" if torque is not None else ""
        if axes != self._axes:
            self._begin(axes)
        if torque is None:
            return ForceOutput([0.0] * self._n, [0.0] * self._n)
        measured = [-torque for torque in self._measurement.external]
        before, self._torque_before = self._torque_before or measured, measured
        self._judge_load(self._joints)
        self._watch_torques(torque, dt)
        if self.reaction.code.holds:
            self._delay.reset()
            return ForceOutput([0.0] * self._n, [0.0] * self._n)
        errors, errors_before = ([a - b for a, b in zip(torque, values, strict=True)] for values in (measured, before))
        velocity = self._supervision.torque_law.velocities(errors, errors_before, dt)
        velocity = self._delay.step(velocity, self.parameters.delay_samples)
        point = self._position.step(contact, None, 0.0, self.parameters)
        factor = self._gain_factor(point, None, 0.0, dt)
        share = self.parameters.force_feedforward
        return ForceOutput([factor * v for v in velocity], [share * value for value in torque])

    def _watch_torques(self, desired: Sequence[float], dt: float) -> None:
        """React to the torques of the joints, N m."""
        values = (values.tolist() for values in (-self._external[0], self._push_sd, -self._unknown[0]))
        self._react(
            *(
                watch.step(torque, measured, sd, self.parameters, dt, unknown, self._unknown[1])
                for watch, torque, measured, sd, unknown in zip(self._torques, desired, *values, strict=True)
            )
        )

    def _point(self, contact: Contact, command: ForceCommand, direction: Array) -> ForcePoint:
        """Point of action of the force; where the loop relies on the estimate, a rejected one counts as refused."""
        lean = 0.0
        if contact.cover:
            along = self._body.cover_pose(self._joints, contact.cover).rotation[:, 0]
            lean = math.asin(min(abs(float(direction @ along)), 1.0))
        point = self._position.step(contact, command, lean, self.parameters)
        self.fallback = point.rejection
        if point.rejection and self.parameters.is_estimated:
            self.refused += not self._contact_rejected
            self.refusals["contact/hypotheses"] = refused("contact/hypotheses", point.rejection)
        self._contact_rejected = bool(point.rejection)
        return point

    def _gain_factor(self, point: ForcePoint, direction: Triple | None, force: float, dt: float) -> float:
        """The guard's factor of the gains; `direction` and `force` as in `Supervision.step`."""
        factor, has_changed = self._supervision.step(self._joints, point, direction, force, dt)
        if has_changed:
            self._transfer.restart()
        return factor


def _known_position(point: ForcePoint | None, task: TaskCommand | None) -> tuple[str, float] | None:
    """Cover and position, m, where the one commanded force acts; None where that is not known."""
    if point is not None:
        return (point.cover, point.position) if point.is_pinned or point.is_certain else None
    forces = [axis for axis in task.axes if axis.kind is AxisKind.FORCE] if task is not None else []
    positions = [(axis.cover, axis.position) for axis in forces if axis.cover and axis.position is not None]
    return positions[0] if len(forces) == len(positions) == 1 else None


def _triple(values: Sequence[float]) -> Triple:
    x, y, z = values
    return x, y, z
