"""Control of a task in one outer period: whether it can be done here, the velocities of its axes, what they do."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.force.arm_push import ArmPush
from wam_control.force.contact_position import ForceCase, ForcePoint, position_is_certain, slid_position
from wam_control.force.feed_forward import FeedForward
from wam_control.force.force_axis import ForceAxes, ForceAxis, PressedForce
from wam_control.force.force_hold import ForceHold, by_seriousness
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.given_way import GivenWay
from wam_control.force.guard import Supervision
from wam_control.force.held_arm import HeldArm, RetreatForce
from wam_control.force.hybrid_velocity import followed, posture_velocity
from wam_control.force.motion_watch import MotionWatch
from wam_control.force.posture_watch import PostureWatch
from wam_control.force.stability_guard import GuardedContact, GuardedForces
from wam_control.force.task import AxisKind, TaskCommand
from wam_control.force.task_frame import AxisState, TaskFrame, force_speed
from wam_control.force.thresholds import FORCE
from wam_control.force.torque_watch import TorqueWatch
from wam_description.arm import Arm
from wam_description.event import Code, Event, warning
from wam_description.rigid_body import RigidBody
from wam_description.signals import Contact

Array = NDArray[np.float64]
AxisRow = tuple[float, float, float, float, float, float]  # under TASK_AXIS_COLUMNS


class TaskOutput(NamedTuple):
    """What a task commands in one period.

    Attributes
    ----------
    velocity, effort : of the joints (n,), rad/s and N m.
    measured, error : sum of the forces along the force axes, and of their errors, in the frame of the task (3,), N.
    rows : of each axis, as the topic task_axes has them.
    reactions : what is done instead of what is commanded, the most serious first.
    has_changed : whether the law has changed since the period before.
    desired : N, of all its forces, where the task is nothing but forces of points, and one touches; else 0.
    pressed : the commanded force, where that is at one known position.
    """

    velocity: list[float]
    effort: list[float]
    measured: Array
    error: Array
    rows: tuple[AxisRow, ...]
    reactions: dict[Code, Event]
    has_changed: bool
    desired: float
    pressed: PressedForce | None


class TaskControl:
    """Controls one task after the other.

    A task that cannot be done where it begins is refused, and one that can no longer be done stops; the arm then
    holds its position until the task is changed.

    Parameters
    ----------
    arm : the arm as the controller knows it.
    body : its kinematics and dynamics.
    given : how far the arm has given way.

    Notes
    -----
    `retune` comes before the first `step`.
    """

    def __init__(self, arm: Arm, body: RigidBody, given: GivenWay) -> None:
        self._arm, self._body, self._covers = arm, body, arm.covers
        self._held, self._given, self._feed_forward = HeldArm(body, given), given, FeedForward(arm)
        self.restart()

    def retune(self, axes: ForceAxes, parameters: ForceLoopParameters, supervision: Supervision) -> None:
        """Take new parameters; a task goes on with them, and one that was refused is tried again.

        Parameters
        ----------
        axes : of forces, with their sensing.
        parameters : of the force loop.
        supervision : the guard of its gains.
        """
        self._frame = TaskFrame(self._arm, self._body, axes, parameters.task, parameters.sensing)
        self._force_axes, self._parameters, self._supervision = axes, parameters, supervision
        self._refusal = ""

    def restart(self) -> None:
        """Forget the task."""
        self._task: TaskCommand | None = None
        self._anchors: dict[object, float] = {}
        self._holds: list[ForceHold] = []
        self._torques: list[TorqueWatch] = []
        self._motions: list[MotionWatch] = []
        self._paths: list[PostureWatch] = []
        self.share = 1.0  # of the velocities that were commanded last, which joint_speed_limit allows
        # by cover and position: m since something is touched or approached there, s since it is no more
        self._slid: dict[tuple[str, float], tuple[float, float]] = {}
        self._q_before: list[float] = []
        self._begun: list[float] = []  # (n,) rad, where the task began
        self._sides: list[float] = []  # of each axis, 1 or -1: where along it the link is touched
        self._held.release()
        self._feed_forward.reset()
        self._refusal = ""
        self._positions: dict[str, tuple[float, float]] = {}  # m, of the last certain estimate, and its sd, by cover

    def step(
        self,
        task: TaskCommand,
        q: Sequence[float],
        torques: tuple[Array, Array],
        contact: Contact,
        posture: Sequence[float],
        rate: Sequence[float] | None,
        dt: float,
        unknown: tuple[Array, float],
        push: ArmPush,
    ) -> TaskOutput:
        """One outer period.

        Parameters
        ----------
        task : what is commanded.
        q : joint angles (n,), rad.
        torques : filtered torques of the world on the joints (n,), N m, now and a period ago.
        contact : estimated contact.
        posture, rate : joint angles to hold in what the task leaves (n,), rad, and their velocity, rad/s.
        dt : outer period, s.
        unknown : torques at rest before that no touched surface gives (n,), N m, and the mass, kg, that explains them.
        push : what pushes an arm that holds, as far as it is allowed without a task.
        """
        own = self._parameters
        moved = self._slide(q, dt)
        has_changed = self._begin(task)
        if has_changed:
            self._begun = list(q)
            self._given.restart()
        states = self._frame.states(task, q, self._points(task, contact), self._begun, self._sides)
        anchors = self._find_anchors(states)
        forces = [state.force(torques[0]) if state.axis.is_sensed else math.nan for state in states]
        self._find_sides(states, forces)
        self._refusal = self._refusal or self._beyond(task) or self._frame.refusal(states)
        found = (
            [warning(Code.TASK_REFUSED, "task", reason=self._refusal)]
            if self._refusal
            else [
                *self._watch(states, forces, torques[0], push.torque_sd, moved, dt, unknown),
                *self._watch_motions(states, anchors, moved, dt),
            ]
        )
        reactions = by_seriousness(found)
        holds = any(code.holds for code in reactions)
        if holds != self._held.is_holding:
            has_changed = True
            if holds:
                self._held.hold(q)
                for motion, path in zip(self._motions, self._paths, strict=True):
                    motion.restart()
                    path.restart()
            else:
                self._held.release()
        factor, is_other = self._supervision.factor(lambda: self._guarded(states, q), dt)
        speeds = [
            self._speed(state, force, anchor, torques[1], hold, factor, dt)
            for state, force, anchor, hold in zip(states, forces, anchors, self._holds, strict=True)
        ]
        held = posture_velocity(posture, q, own.posture_gain, own.joint_speed_limit, rate)
        resolved = self._frame.resolve(states, speeds, held, q)
        held_slowly = resolved.posture if rate else self._followed(states, resolved.posture, q)
        velocity, self.share = _limited(resolved.velocity + held_slowly, own.joint_speed_limit)
        fed = np.sum([self._fed(*pair, dt) for pair in zip(states, self._holds, strict=True)], axis=0)
        if self._held.is_holding:
            allowed = math.fsum(map(_desired, states)) or push.allowed
            push = push._replace(allowed=min(push.allowed, allowed))
            pairs = zip(states, forces, self._holds, strict=True)
            back = [self._back(*one, self._torque_error(one[0], push.torque_sd), factor, dt) for one in pairs]
            inertia = self._force_axes.moved_inertia(q)
            velocity, is_yielding = self._held.step(q, [one for one in back if one], push, inertia, own)
            if pushed := self._held.pushed:
                reactions = {code: event.with_values(pushed=pushed) for code, event in reactions.items()}
            fed = np.zeros(len(q)) if is_yielding else None
        effort = [0.0] * len(q) if fed is None else self._feed_forward.step(fed, velocity, own, dt)
        rows = tuple(map(_row, states, anchors, forces, resolved.independence, resolved.speed_fraction))
        measured, error = _vectors(states, forces)
        is_pressing = self.is_touching and all(state.point and state.axis.kind is AxisKind.FORCE for state in states)
        desired = math.fsum(map(_desired, states)) if is_pressing else 0.0
        pressed, has_changed = self._pressed(states) if is_pressing else None, has_changed or is_other
        return TaskOutput(velocity, effort, measured, error, rows, reactions, has_changed, desired, pressed)

    def _begin(self, task: TaskCommand) -> bool:
        """Take a task; whether it has other axes than the one before."""
        before, self._task = self._task, task
        if before == task:
            return False
        self._refusal = ""
        if before is not None and _axes(before) == _axes(task):
            return False
        self._anchors = {key: self._anchors[key] for key in _axes(task) if key in self._anchors}
        self._sides = [1.0] * len(task.axes)
        self._holds = [ForceHold() for _ in task.axes]
        self._torques = [TorqueWatch(axis.name) for axis in task.axes]
        self._motions = [MotionWatch(axis.name, axis.unit) for axis in task.axes]
        limits = [self._parameters.task.fastest(axis.joint >= 0)[1] for axis in task.axes]
        self._paths = [
            PostureWatch([axis.name], "position", limit, f"{axis.unit}/s")
            for axis, limit in zip(task.axes, limits, strict=True)
        ]
        return True

    def _slide(self, q: Sequence[float], dt: float) -> Array:
        """Count how far the link has slid along what each force presses, which stays where it is.

        Where nothing but forces is commanded, the way to the touch counts, too; another motion may lead to what is to
        be touched.  Other axes, and a touch that is lost for a moment, change nothing of that.  Returns the motion of
        the joints since the period before (n,), rad.
        """
        moved = np.array(q) - np.array(self._q_before or q)
        self._q_before = list(q)
        axes = self._task.axes if self._task else ()
        is_approach = all(axis.kind is AxisKind.FORCE for axis in axes)
        pressed = dict.fromkeys(self._slid, False)
        for axis, hold in zip(axes, self._holds, strict=True):
            if axis.kind is AxisKind.FORCE and axis.cover and axis.position is not None:
                at = axis.cover, axis.position
                pressed[at] = pressed.get(at, False) or hold.is_touching or (is_approach and bool(axis.value))
        before, self._slid = self._slid, {}
        for at, is_pressed in pressed.items():
            slid, lost = before.get(at, (0.0, math.inf))
            lost = 0.0 if is_pressed else lost + dt
            if lost < FORCE.lost_touch:
                self._slid[at] = slid + self._force_axes.slide(q, *at, moved), lost
        return moved

    @property
    def is_touching(self) -> bool:
        """Whether one of the forces shows that something is touched."""
        return any(hold.is_touching for hold in self._holds)

    @property
    def is_pushed(self) -> bool:
        """Whether something has pushed the arm since it holds."""
        return self._held.pushed > 0.0

    def _find_anchors(self, states: Sequence[AxisState]) -> list[float]:
        """Commanded position of each axis; where none is, the position at which it has begun."""
        assert self._task is not None
        found = []
        for key, state in zip(_axes(self._task), states, strict=True):
            begun = self._anchors.setdefault(key, state.coordinate)
            found.append(begun if state.axis.value is None else state.axis.value)
        return found

    def _find_sides(self, states: Sequence[AxisState], forces: Sequence[float]) -> None:
        """On which side an impedance is touched: a force is commanded on one, an impedance presses on either."""
        for i, (state, force) in enumerate(zip(states, forces, strict=True)):
            if state.axis.kind is AxisKind.IMPEDANCE and force * self._sides[i] < -self._parameters.task.deadband:
                self._sides[i] = -self._sides[i]

    def _beyond(self, task: TaskCommand) -> str:
        """Why a task is refused: the first axis beyond a limit; '' if there is none."""
        own = self._parameters
        for axis in task.axes:
            value, is_joint = abs(axis.value or 0.0), axis.joint >= 0
            if axis.kind is AxisKind.FORCE:
                name, limit, unit = "force_limit", own.force_limit, "N"
                if is_joint:
                    name, limit, unit = "torque_limit", own.torque_limit, "N m"
            elif axis.kind is AxisKind.VELOCITY:
                (limit, name), unit = own.task.fastest(is_joint), "rad/s" if is_joint else "m/s"
            else:
                continue
            if value > limit:
                return f"{axis.name}: {value:.4g} {unit} is commanded; allowed: up to {name}, {limit:g} {unit}"
        return ""

    def _watch(
        self,
        states: Sequence[AxisState],
        forces: Sequence[float],
        external: Array,
        external_sd: Array,
        moved: Array,
        dt: float,
        unknown: tuple[Array, float],
    ) -> list[Event]:
        """What the force axes report; `moved` by the joints since the period before (n,), rad."""
        found: list[Event] = []
        is_led = any(state.axis.kind is not AxisKind.FORCE for state in states)
        for state, force, hold, torque in zip(states, forces, self._holds, self._torques, strict=True):
            desired = _desired(state)
            if (joint := state.axis.joint) >= 0:
                sd, error = float(external_sd[joint]), -float(unknown[0][joint])
                if state.axis.kind is AxisKind.FORCE:
                    found.append(torque.step(desired, force, sd, self._parameters, dt, error, unknown[1]))
            elif state.sensed and state.point and desired:
                case = self._case(state, state.sensed, state.point, external_sd, unknown)
                is_holding = self._held.is_holding
                if not is_holding:
                    hold.travel(float(state.row @ moved), dt, is_led)
                given_way = 0.0 if is_holding else self._given.way
                found += hold.step(case, external, force, self._parameters, dt, given_way=given_way)
                if hold.goes_back and not is_holding:
                    self._given.give(-state.direction)
        return found

    def _watch_motions(
        self, states: Sequence[AxisState], anchors: Sequence[float], moved: Array, dt: float
    ) -> list[Event]:
        """What the positions and velocities report; an arm that holds its position is not to follow them."""
        if self._held.is_holding:
            return []
        own = self._parameters
        found: list[Event] = []
        for state, anchor, motion, path in zip(states, anchors, self._motions, self._paths, strict=True):
            axis = state.axis
            if axis.kind not in (AxisKind.VELOCITY, AxisKind.POSITION):
                continue
            lever = 1.0 if axis.joint >= 0 else math.hypot(*state.row.tolist())
            if axis.kind is AxisKind.VELOCITY:
                way = float(state.row @ moved)
                found.append(motion.velocity(axis.value or 0.0, way, lever, self.share, own, dt))
            else:
                at, (fastest, _) = state.coordinate, own.task.fastest(axis.joint >= 0)
                law = own.task.largest_rate, fastest
                if late := path.step([anchor], axis.rate != 0.0, [at], fastest, dt):
                    found.append(late)
                found.append(motion.position(anchor, axis.rate, at, lever, law, self.share, own, dt))
        return found

    def _points(self, task: TaskCommand, contact: Contact) -> list[ForcePoint]:
        """Where each axis acts; an estimated position is the last certain one, at first the middle of the link."""
        own = self._parameters
        known = [axis.cover for axis in task.axes if axis.is_sensed and axis.cover]
        conflict = ""
        if contact.cover and contact.cover not in known and contact.probability >= own.link_probability_limit:
            conflict = contact.cover
        is_single = contact.is_single or len(set(known)) > 1  # a task may press at two positions
        limit = own.position_uncertainty_limit
        if (
            is_single
            and position_is_certain(contact.position, contact.position_sd, limit)
            and not (contact.probability < own.link_probability_limit)
        ):
            sd = 0.0 if math.isnan(contact.position_sd) else contact.position_sd
            self._positions[contact.cover] = contact.position, sd
        found = []
        for axis in task.axes:
            if axis.position is not None:
                slid, _ = self._slid.get((axis.cover, axis.position), (0.0, 0.0))
                position = slid_position(self._covers, axis.cover, axis.position, slid) if slid else axis.position
                sd = own.contact_position_sd
                found.append(ForcePoint(axis.cover, position, sd, True, True, True, False, "", conflict, is_single))
                continue
            length = self._covers.length_of(axis.cover)
            position, sd = self._positions.get(axis.cover, (length / 2.0, length / math.sqrt(12.0)))
            is_known = axis.cover in self._positions
            found.append(
                ForcePoint(axis.cover, position, sd, is_known, False, is_known, False, "", conflict, is_single)
            )
        return found

    def _guarded(self, states: Sequence[AxisState], q: Sequence[float]) -> list[GuardedForces]:
        """All contacts of the task at once; none where nothing is sensed at a point, or not here."""
        contacts = []
        for state in states:
            if state.point and state.force_sd < math.inf:
                x, y, z = state.direction.tolist()
                point, force = state.point, _desired(state) or FORCE.hand
                where = (point.cover, point.position, point.position_sd)
                contacts.append(GuardedContact(tuple(q), *where, (x, y, z), force))
        laws = self._supervision.force_law, self._supervision.torque_law
        loop = self._frame.linear(states, *laws, self._parameters.posture_gain, q) if contacts else None
        return [GuardedForces(tuple(contacts), *loop)] if loop else []

    def _speed(
        self,
        state: AxisState,
        force: float,
        anchor: float,
        before: Array,
        hold: ForceHold,
        factor: float,
        dt: float,
    ) -> float:
        """Velocity along one axis, m/s or rad/s."""
        if state.axis.kind is not AxisKind.FORCE:
            return self._frame.velocity(state, force, anchor)
        laws = self._supervision.force_law, self._supervision.torque_law
        speed = factor * hold.share * force_speed(state, *laws, force, state.force(before), dt)
        if state.sensed and state.point and (desired := _desired(state)):
            speed = min(speed, hold.approach_speed(state.sensed, state.point, desired, self._parameters))
        fastest, _ = self._parameters.task.fastest(is_joint=not state.sensed)
        return min(max(speed, -fastest), fastest)

    def _followed(self, states: Sequence[AxisState], posture: Array, q: Sequence[float]) -> Array:
        """Velocities towards the posture (n,), rad/s, slower where a link would slide fast on what it presses."""
        law = self._supervision.force_law
        for state, hold in zip(states, self._holds, strict=True):
            if hold.has_touched and state.point and state.axis.kind is AxisKind.FORCE:
                gain = law.along(state.axis.direction).gain[0]
                on_axis = (state.point.position, *self._covers.aside(state.point.cover, state.point.position))
                jacobian = self._body.point_jacobian(q, state.point.cover, on_axis)
                posture = followed(posture, jacobian, _desired(state), gain)
        return posture

    def _case(
        self, state: AxisState, axis: ForceAxis, point: ForcePoint, torque_sd: Array, unknown: tuple[Array, float]
    ) -> ForceCase:
        """The force of an axis, with what is known of the torques now."""
        desired = _desired(state)
        return ForceCase(
            axis,
            point,
            desired,
            signal=axis.signal(desired, torque_sd.tolist()) if self._parameters.is_estimated else math.inf,
            torque_error=self._torque_error(state, torque_sd),
            unknown=-float(axis.sense @ unknown[0]),
            payload=unknown[1],
        )

    def _torque_error(self, state: AxisState, torque_sd: Array) -> float:
        """Standard deviation of a force, N, by those of the estimated torques (n,), N m; 0 with sensors."""
        is_estimated = self._parameters.is_estimated and state.sensed
        return state.sensed.error(torque_sd.tolist()) if is_estimated and state.sensed else 0.0

    def _back(
        self, state: AxisState, force: float, hold: ForceHold, torque_error: float, factor: float, dt: float
    ) -> RetreatForce | None:
        """How an arm that holds goes back along a force, N; None along other axes."""
        desired = _desired(state)
        if not (state.sensed and state.point and desired):
            return None
        excess = hold.excess(state.sensed, force, desired, torque_error)
        law = self._supervision.force_law.along(state.axis.direction)
        return RetreatForce(state.sensed, factor * law.velocity(0, -excess, -excess, dt) if excess else 0.0)

    def _pressed(self, states: Sequence[AxisState]) -> PressedForce | None:
        """The commanded force, where all axes, which are forces, are at one position that is given."""
        points = [state.point for state in states if state.point and state.point.is_pinned]
        is_one = len(points) == len(states) and len({point[:2] for point in points}) == 1
        if not is_one:
            return None
        whole = np.sum([_desired(state) * state.direction for state in states], axis=0)
        size = float(np.linalg.norm(whole))
        return PressedForce(*points[0][:3], whole / size, size) if size else None

    def _fed(self, state: AxisState, hold: ForceHold, dt: float) -> Array:
        """Torque of a commanded force that is fed forward (n,), N m."""
        own = self._parameters
        share = hold.feed(state.point, own, dt) if state.point else own.force_feedforward
        return share * _desired(state) * state.row


def _axes(task: TaskCommand) -> list[object]:
    """What makes an axis the same as before, whatever is commanded along it."""
    return [(task.frame, axis.kind, axis.joint, axis.cover, axis.position, axis.direction) for axis in task.axes]


def _desired(state: AxisState) -> float:
    """Force along the axis, N or N m; 0 where it is no force axis.  That of a point is along its direction."""
    axis = state.axis
    if axis.kind is not AxisKind.FORCE:
        return 0.0
    return (axis.value or 0.0) if axis.joint >= 0 else abs(axis.value or 0.0)


def _limited(velocity: Array, limit: float) -> tuple[list[float], float]:
    """All velocities reduced by one factor, so that no joint is faster than the limit, rad/s; that factor."""
    fastest = float(np.abs(velocity).max())
    share = limit / fastest if fastest > limit else 1.0
    limited: list[float] = (velocity * share if share < 1.0 else velocity).tolist()
    return limited, share


def _row(state: AxisState, anchor: float, force: float, independence: float, fraction: float) -> AxisRow:
    axis = state.axis
    is_coordinate = axis.kind in (AxisKind.POSITION, AxisKind.IMPEDANCE)
    commanded = anchor if is_coordinate else _desired(state) if axis.kind is AxisKind.FORCE else axis.value or 0.0
    measured = force if axis.is_sensed else state.coordinate
    return float(axis.kind), commanded, measured, state.force_sd, independence, fraction


def _vectors(states: Sequence[AxisState], forces: Sequence[float]) -> tuple[Array, Array]:
    """Sum of the measured forces of the arm on the world, and of their errors, frame of the task (3,), N."""
    measured, error = np.zeros(3), np.zeros(3)
    for state, force in zip(states, forces, strict=True):
        if state.axis.kind is AxisKind.FORCE and state.sensed:
            along = np.array(state.axis.direction) * math.copysign(1.0, state.axis.value or 0.0)
            measured += along * force
            error += along * (_desired(state) - force)
    return measured, error
