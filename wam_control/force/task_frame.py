"""The law of a task: each axis its own control, in strict priority, the posture in what they leave.

For each axis in turn, with its row r (velocity along it per joint velocity) and the projector N onto what the
axes before it leave: a = N r, qd += a (v - r.qd)/(|a|^2 + lambda^2), N -= a a'/|a|^2; at the end qd += N qd_posture.
A force axis is sensed by its own generalised least squares (`force_axis`), with the forces of the other
axes as unknowns.  lambda is zero except near singular poses: for a force it limits the mass of the arm that
appears in the measured force, for a motion it begins where the lever is shorter than `short_lever`.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.force.contact_position import ForcePoint
from wam_control.force.force_axis import ForceAxes, ForceAxis, PressedForce, SensingParameters
from wam_control.force.force_law import ForceLaw
from wam_control.force.task import AxisKind, TaskAxis, TaskCommand, TaskParameters
from wam_control.force.thresholds import FORCE
from wam_description.arm import Arm
from wam_description.number_text import brief
from wam_description.rigid_body import RigidBody
from wam_description.signals import BASE

Array = NDArray[np.float64]


class AxisState(NamedTuple):
    """One axis in one pose.

    Attributes
    ----------
    axis : what is commanded.
    row : velocity along the axis per joint velocity, and torque on the joints per force (n,), m or 1.
    direction : in the base frame (3,), towards what is touched; zeros for a joint.
    coordinate : present position along the axis, m or rad.
    sensed, point : how the force along it is measured, and where it acts; None for a motion or a joint.
    """

    axis: TaskAxis
    row: Array
    direction: Array
    coordinate: float
    sensed: ForceAxis | None
    point: ForcePoint | None = None

    @property
    def force_sd(self) -> float:
        """Standard deviation of the measured force, N; NaN where none is measured at a point."""
        return self.sensed.force_sd if self.sensed else math.nan

    def force(self, external: Array) -> float:
        """Force of the arm on the world along the axis, from torques of the world on the joints (n,), N m."""
        return -float((self.sensed.sense if self.sensed else self.row) @ external)


class Resolved(NamedTuple):
    """Joint velocities (n,), rad/s, of the axes and the posture; of each axis what is left, and its speed fraction."""

    velocity: Array
    posture: Array
    independence: tuple[float, ...]
    speed_fraction: tuple[float, ...]


class TaskFrame:
    """The axes of tasks of one arm.

    Parameters
    ----------
    arm : the arm as the controller knows it.
    body : its kinematics and dynamics.
    axes : of forces, with their sensing.
    parameters : limits of tasks.
    sensing : limits of the measured force.
    """

    def __init__(
        self, arm: Arm, body: RigidBody, axes: ForceAxes, parameters: TaskParameters, sensing: SensingParameters
    ) -> None:
        self._arm, self._body, self._axes = arm, body, axes
        self._parameters, self._sensing = parameters, sensing

    def states(
        self,
        task: TaskCommand,
        q: Sequence[float],
        points: Sequence[ForcePoint],
        begun: Sequence[float] = (),
        sides: Sequence[float] = (),
    ) -> list[AxisState]:
        """Every axis of a task.

        Parameters
        ----------
        task : what is commanded.
        q : joint angles (n,), rad.
        points : where each axis acts.
        begun : joint angles at which the task began (n,), rad; as q by default.
        sides : of each impedance, 1 or -1, where along its direction the link is touched; 1 by default.
        """
        n = len(q)
        rotation = np.eye(3) if task.frame == BASE else self._body.cover_pose(q, task.frame).rotation
        directions = [rotation @ np.array(axis.direction) for axis in task.axes]
        # a force is positive along its direction, which is the normal of the surface
        directions = [-d if _pulls(axis) else d for axis, d in zip(task.axes, directions, strict=True)]
        sides = sides or [1.0] * len(directions)
        torques = [
            self._torques(q, begun, axis, point, side * u) if axis.is_sensed and axis.joint < 0 else []
            for axis, u, point, side in zip(task.axes, directions, points, sides, strict=True)
        ]
        found = []
        for i, (axis, u, own, side) in enumerate(zip(task.axes, directions, torques, sides, strict=True)):
            if axis.joint >= 0:
                found.append(AxisState(axis, np.eye(n)[axis.joint], u, q[axis.joint], None))
                continue
            position, position_sd = points[i].position, points[i].position_sd
            axis_point = np.array([position, *self._arm.covers.aside(axis.cover, position)])
            coordinate = float(u @ self._body.point(q, axis.cover, axis_point))
            if not own:
                row: Array = u @ self._body.point_jacobian(q, axis.cover, axis_point)
                found.append(AxisState(axis, row, u, coordinate, None))
                continue
            others = []
            for k, other in enumerate(torques):
                # two axes at one position are parts of one force, whose friction is that of `sensed` already
                is_same = (task.axes[k].cover, task.axes[k].position) == (axis.cover, axis.position)
                others += [] if k == i else other[:1] if is_same else other
            turned = self._turned(q, begun, axis.cover, u) if others else 0.0
            pressed = PressedForce(axis.cover, position, position_sd, side * u, _size(axis))
            sensed = self._axes.axis(q, pressed, others, turned).times(side)
            found.append(AxisState(axis, sensed.lever, side * u, coordinate, sensed, points[i]))
        return found

    def _turned(self, q: Sequence[float], begun: Sequence[float], cover: str, direction: Array) -> float:
        """By how much a link has turned towards a force since the task began: a smooth rod turns its force with it."""
        now, then = (self._body.cover_pose(at, cover).rotation[:, 0] for at in (q, begun or q))
        return abs(float(direction @ (now - then)))

    def _torques(
        self, q: Sequence[float], begun: Sequence[float], axis: TaskAxis, point: ForcePoint, direction: Array
    ) -> list[Array]:
        """Torques (n,), N m, by which a force along this axis disturbs the other ones; a hand has no friction."""
        if axis.kind is AxisKind.IMPEDANCE:
            return [FORCE.hand * self._axes.lever(q, axis.cover, point.position, direction)]
        pressed = PressedForce(axis.cover, point.position, point.position_sd, direction, _size(axis))
        return self._axes.disturbance(q, pressed, self._turned(q, begun, axis.cover, direction))

    def refusal(self, states: Sequence[AxisState]) -> str:
        """Why this task cannot be done in this pose, with the number; '' where it can."""
        own, joints = self._parameters, len(self._arm.joints.names)
        for state in states:
            lever = float(np.linalg.norm(state.row))
            if lever < FORCE.short_lever:
                return (
                    f"{state.axis.name}: its lever on the joints is {brief(lever)} m; allowed: {FORCE.short_lever:g} "
                    "m and above; "
                    "bend the arm, or command another axis"
                )
        forces = [state.axis for state in states if state.sensed and state.axis.kind is AxisKind.FORCE]
        positions = {(axis.cover, axis.position) for axis in forces}
        if len(positions) > 1 and self._sensing.friction < FORCE.least_friction:
            return (
                f"{len(positions)} forces at once: the friction of each is measured as a part of the others, and "
                f"sensing.friction is {self._sensing.friction:g}; allowed: {FORCE.least_friction:g} and above; "
                "declare it"
            )
        limit = own.condition_limit
        rank, condition = rank_and_condition([state.row for state in states], limit)
        if rank < len(states):
            return (
                f"the task has {len(states)} axes and {joints} joints; here they can do {rank} at once (condition "
                f"number {condition:.3g}, allowed: task.condition_limit, {limit:g}); leave out an axis, or "
                "go to another posture"
            )
        for state in states:
            most = self._sensing.sd_limit(_size(state.axis), is_pinned=state.axis.position is not None)
            if state.sensed and state.force_sd > most:
                return (
                    f"{state.axis.name}: the force is measured with a standard deviation of {state.force_sd:.3g} N; "
                    f"allowed: {most:g} N (sensing.force_sd_limit, force_sd_fraction); bend the arm, or command "
                    "another direction or position"
                )
        return next((reason for state in states if (reason := self._too_stiff(state.axis))), "")

    def _too_stiff(self, axis: TaskAxis) -> str:
        """Why an impedance is refused; '' where it is not, or the axis is none."""
        own = self._parameters
        if axis.kind is not AxisKind.IMPEDANCE:
            return ""
        name, least = ("least_damping", own.least_damping)
        if axis.joint >= 0:
            name, least = "least_joint_damping", own.least_joint_damping
        if axis.damping and axis.damping < least:
            return f"{axis.name}: damping is {axis.damping:g}; allowed: task.{name}, {least:g}, and above"
        damping = self._damping(axis)
        if axis.stiffness > own.largest_rate * damping:
            return (
                f"{axis.name}: stiffness is {axis.stiffness:g} at a damping of {damping:g}; allowed: up to "
                f"{own.largest_rate * damping:g} (task.largest_rate); give it more damping"
            )
        return ""

    def velocity(self, state: AxisState, force: float, anchor: float) -> float:
        """Velocity along a motion or an impedance, m/s or rad/s.

        Parameters
        ----------
        state : of the axis.
        force : of the arm on the world along it, N or N m.
        anchor : position to hold, m or rad.
        """
        axis, own = state.axis, self._parameters
        is_joint = axis.joint >= 0
        fastest, _ = own.fastest(is_joint)
        if axis.kind is AxisKind.VELOCITY:
            speed = axis.value or 0.0
        elif axis.kind is AxisKind.POSITION:
            speed = axis.rate + own.largest_rate * (anchor - state.coordinate)
        else:
            damping = self._damping(axis)
            drive = axis.stiffness * (anchor - state.coordinate) - force
            deadband = own.joint_deadband if is_joint else own.deadband
            speed = axis.rate + math.copysign(max(abs(drive) - deadband, 0.0), drive) / damping
        return min(max(speed, -fastest), fastest)

    def resolve(
        self, states: Sequence[AxisState], speeds: Sequence[float], posture: Sequence[float], q: Sequence[float]
    ) -> Resolved:
        """Joint velocities that move each axis with its speed, m/s or rad/s, the posture (n,), rad/s, in the rest."""
        inertia, most = self._axes.inertia(q), self._sensing.apparent_mass_limit
        n = len(q)
        left, velocity = np.eye(n), np.zeros(n)
        independence, fractions = [], []
        for state, speed in zip(states, speeds, strict=True):
            a = left @ state.row
            square, whole = float(a @ a), float(state.row @ state.row)
            independence.append(math.sqrt(square / whole) if whole else 0.0)
            if square <= (FORCE.lost_axis * FORCE.lost_axis) * max(whole, FORCE.short_lever * FORCE.short_lever):
                fractions.append(0.0)
                continue
            damped = max(square, FORCE.short_lever * FORCE.short_lever)
            if state.sensed is not None:
                damped = max(square, abs(float(state.sensed.sense @ inertia @ a)) / most if most else 0.0)
            velocity += a * ((speed - float(state.row @ velocity)) / damped)
            left -= np.outer(a, a) / square
            fractions.append(square / damped)
        return Resolved(velocity, left @ np.array(posture), tuple(independence), tuple(fractions))

    def linear(
        self,
        states: Sequence[AxisState],
        frame_law: ForceLaw,
        joint_law: ForceLaw,
        posture_gain: float,
        q: Sequence[float],
    ) -> tuple[Array, Array, Array, Array, Array]:
        """The law of the task for small motions, for the guard: fields of `wam_control.force.sampled_loop.Axes`.

        Returns
        -------
        tuple
            sense (p, n), move (n, p), gain and proportional gain (p,), hold (n, n).
        """
        n, count = len(q), len(states)
        no_speed, no_posture = [0.0] * count, [0.0] * n
        move = np.array([self.resolve(states, unit, no_posture, q).velocity for unit in np.eye(count).tolist()]).T
        left = np.array([self.resolve(states, no_speed, unit, q).posture for unit in np.eye(n).tolist()]).T
        hold, sense, gain = posture_gain * left, np.zeros((count, n)), np.zeros((2, count))
        for i, state in enumerate(states):
            axis = state.axis
            if axis.is_sensed:
                sense[i] = state.sensed.sense if state.sensed else state.row
            if axis.kind is AxisKind.FORCE:
                law = joint_law if axis.joint >= 0 else frame_law.along(axis.direction)
                k = max(axis.joint, 0)
                gain[:, i] = law.gain[k], law.proportional_gain[k]
            elif axis.kind is not AxisKind.VELOCITY:
                rate = self._parameters.largest_rate
                if axis.kind is AxisKind.IMPEDANCE:
                    damping = self._damping(axis)
                    rate, gain[0, i] = axis.stiffness / damping, 1.0 / damping
                hold = hold + rate * np.outer(move[:, i], state.row)
        return sense, move, gain[0], gain[1], hold

    def _damping(self, axis: TaskAxis) -> float:
        """Damping of an impedance, N s/m or N m s/rad."""
        own = self._parameters
        return axis.damping or (own.least_joint_damping if axis.joint >= 0 else own.least_damping)


def rank_and_condition(rows: Sequence[Array], limit: float) -> tuple[int, float]:
    """How many of these rows (m, n), scaled to length 1, are independent up to a condition number; that number."""
    scaled = np.array([row / np.linalg.norm(row) for row in rows])
    found = np.linalg.svd(scaled, compute_uv=False)
    smallest = float(found[-1]) if len(found) == len(rows) else 0.0
    condition = float(found[0]) / smallest if smallest > 1e-12 else math.inf
    return int(np.sum(found > found[0] / limit)), condition


def force_speed(
    state: AxisState, frame_law: ForceLaw, joint_law: ForceLaw, force: float, before: float, dt: float
) -> float:
    """Velocity of a force axis, m/s or rad/s; `force` and `before` are measured along it now and a period ago, N."""
    axis = state.axis
    wanted = axis.value or 0.0
    if axis.joint >= 0:
        return joint_law.velocity(axis.joint, wanted - force, wanted - before, dt)
    law = frame_law.along(axis.direction)
    return law.velocity(0, abs(wanted) - force, abs(wanted) - before, dt)


def _pulls(axis: TaskAxis) -> bool:
    """Whether the commanded force is against the direction of the axis."""
    return axis.kind is AxisKind.FORCE and axis.joint < 0 and (axis.value or 0.0) < 0.0


def _size(axis: TaskAxis) -> float:
    """Size of the force along an axis, N, as an unknown of the others."""
    return abs(axis.value or 0.0) if axis.kind is AxisKind.FORCE else FORCE.hand
