"""A task as data: what is commanded along each of its axes; as a table and back.

An axis is a direction at a point of a link, or a joint.  Along it the task commands a force, a velocity, a
position, or an impedance, which is free to be led by hand where its stiffness is zero [Raibert 81, Hogan 85].
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from operator import mul
from typing import Any, NamedTuple

from wam_control.task.scenario_values import is_one_of, number, numbers
from wam_description.arm import Arm
from wam_description.parameters import ParameterError, parameter, require
from wam_description.signals import BASE, ZERO, Table, Triple
from wam_description.small_matrices import cross
from wam_description.topics import TASK_COLUMNS


class AxisKind(IntEnum):
    """What is commanded along an axis, as a number for a topic."""

    FORCE = 1  # of the arm on the world, N or N m
    VELOCITY = 2  # m/s or rad/s
    POSITION = 3  # coordinate along the axis, from the origin of the base, m; or joint angle, rad
    IMPEDANCE = 4  # spring about a position, and damper


class TaskAxis(NamedTuple):
    """One axis of a task.

    Attributes
    ----------
    kind : what is commanded.
    joint : index of the joint; -1 for a point of a link.
    cover, position : link and position along it, m, of the point; '' and 0 for a joint; position None: the estimated
        one, on any link where no cover is named.
    direction : unit vector in the frame of the task (3,); zeros for a joint.
    value : N, m/s or m; of a joint N m, rad/s or rad; None for the position where the axis is when it begins.
    rate : at which a commanded position moves, m/s or rad/s.
    stiffness, damping : of an impedance, N/m and N s/m; of a joint N m/rad and N m s/rad.
    """

    kind: AxisKind
    joint: int = -1
    cover: str = ""
    position: float | None = 0.0
    direction: Triple = ZERO
    value: float | None = 0.0
    rate: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0

    @property
    def is_force(self) -> bool:
        """Whether a force or a torque is commanded along it."""
        return self.kind is AxisKind.FORCE

    @property
    def is_joint(self) -> bool:
        """Whether it is a joint."""
        return self.joint >= 0

    @property
    def bare(self) -> "TaskAxis":
        """The same axis whatever is commanded along it."""
        return self._replace(value=0.0, rate=0.0, stiffness=0.0, damping=0.0)

    @property
    def is_sensed(self) -> bool:
        """Whether a force is measured along it."""
        return self.is_force or self.kind is AxisKind.IMPEDANCE

    @property
    def speed(self) -> float:
        """At which its goal moves, m/s or rad/s."""
        return (self.value or 0.0) if self.kind is AxisKind.VELOCITY else self.rate

    @property
    def unit(self) -> str:
        """Of a position along it."""
        return "rad" if self.is_joint else "m"

    @property
    def name(self) -> str:
        """The axis in words."""
        kind = self.kind.name.lower()
        if self.is_joint:
            return f"{'torque' if self.is_force else kind} of joint {self.joint + 1}"
        x, y, z = self.direction
        at, on = ("", "on") if self.position is None else (f" at {self.position:.3g} m", "along")
        return f"{kind} along ({x:.3g}, {y:.3g}, {z:.3g}){at}{f' {on} {self.cover}' if self.cover else ''}"


class TaskCommand(NamedTuple):
    """Axes of equal weight; their directions are in `frame`, 'base' or a cover."""

    frame: str
    axes: tuple[TaskAxis, ...]


def joint_axes(kind: AxisKind, values: Sequence[float | None], damping: float = 0.0) -> tuple[TaskAxis, ...]:
    """The same for every joint; joint torques, for example, or a free arm that is led by hand."""
    return tuple(TaskAxis(kind, i, value=value, damping=damping) for i, value in enumerate(values))


def line_axes(arm: Arm, cover: str, point: Triple, along: Triple) -> tuple[TaskAxis, ...]:
    """The axis of a link on a line, free to slide along it (section 7.2.1): four axes in the base frame.

    Two across the line at the beginning of the cover, two at its end.

    Parameters
    ----------
    arm : the arm.
    cover : the link.
    point : on the line (3,), base frame, m.
    along : direction of the line (3,), base frame.
    """
    length = arm.covers.length_of(cover)
    first, second = across(along)
    return tuple(
        TaskAxis(AxisKind.POSITION, -1, cover, place, axis, sum(map(mul, axis, point)))
        for place in (0.0, length)
        for axis in (first, second)
    )


def across(along: Triple) -> tuple[Triple, Triple]:
    """Two unit vectors across a direction (3,) and each other; the first one is level."""
    axis = x, y, _ = unit(along)
    level = unit((-y, x, 0.0)) if math.hypot(x, y) > 1e-6 else (0.0, 1.0, 0.0)
    return level, unit(cross(axis, level))


def table_of(task: TaskCommand | None, covers: Sequence[str]) -> Table:
    """A task as the rows of the topic task_command; no row for none."""
    if task is None:
        return Table(BASE, ())
    return Table(task.frame, tuple(_row(axis, covers) for axis in task.axes))


def _row(axis: TaskAxis, covers: Sequence[str]) -> tuple[float, ...]:
    link = float(covers.index(axis.cover)) if axis.cover else -1.0
    value = math.nan if axis.value is None else axis.value
    place = (math.nan if axis.position is None else axis.position, *axis.direction)
    motion = (value, axis.rate, axis.stiffness, axis.damping)
    return (float(axis.kind), float(axis.joint), link, *place, *motion)


def task_of(table: Table | None, arm: Arm) -> TaskCommand | None:
    """The task of a message, None for none.

    Raises
    ------
    ParameterError
        names the row and the value that is not allowed.
    """
    if table is None or not table.rows:
        return None
    return checked_task(
        TaskCommand(table.frame, tuple(_axis(f"row {i + 1}", row, arm) for i, row in enumerate(table.rows)))
    )


def watched_axes(task: TaskCommand | None) -> tuple[TaskAxis, ...]:
    """The axes of a task along which it is watched whether what is commanded is reached: all but an impedance."""
    axes = task.axes if task else ()
    return tuple(
        axis
        for axis in axes
        if axis.kind in (AxisKind.VELOCITY, AxisKind.POSITION) or (axis.is_force and (axis.is_joint or axis.value))
    )


def is_pressing(table: Table) -> bool:
    """Whether the task of a message commands a force."""
    kind, value = (TASK_COLUMNS.index(name) for name in ("kind", "value"))
    return any(row[kind] == AxisKind.FORCE and row[value] for row in table.rows)


def _axis(where: str, row: Sequence[float], arm: Arm) -> TaskAxis:
    kind, joint, link, place, x, y, z, value, rate, stiffness, damping = row
    kinds, covers = tuple(AxisKind), arm.covers.names
    require(
        kind in kinds, f"{where}: kind is {kind:g}; allowed: {', '.join(f'{k.value} {k.name.lower()}' for k in kinds)}"
    )
    require(
        link in range(-1, len(covers)),
        f"{where}: link is {link:g}; allowed: 0 to {len(covers) - 1}, for {', '.join(covers)}, or -1 with a joint",
    )
    wanted, whole = None if math.isnan(value) else value, int(joint) if joint.is_integer() else joint
    at: tuple[Any, ...] = ("", 0.0, ZERO)  # of a joint, whatever these columns are
    if link >= 0 or joint == -1:
        at = covers[int(link)] if link >= 0 else "", None if math.isnan(place) else place, (x, y, z)
    given: tuple[Any, ...] = (whole, *at, wanted, rate, stiffness, damping)
    axis = checked(where, TaskAxis(AxisKind(int(kind)), *given), arm)
    return axis if axis.is_joint else axis._replace(direction=unit(axis.direction))


def checked(where: str, axis: TaskAxis, arm: Arm) -> TaskAxis:
    """An axis of a message, of a file or made in Python as it is, or refused.

    Raises
    ------
    ParameterError
        names the value that is not allowed.
    """
    require(isinstance(axis, TaskAxis), f"{where} is {axis!r}; give a TaskAxis")
    require(isinstance(axis.kind, AxisKind), f"{where}: kind is {axis.kind!r}; give an AxisKind")
    for key in ("rate", "stiffness", "damping"):
        number(where, key, getattr(axis, key))
    is_place, is_joint = axis.kind in (AxisKind.POSITION, AxisKind.IMPEDANCE), axis.joint != -1
    direction, joints = numbers(where, "along", axis.direction, 3), arm.joints
    require(
        axis.value is not None or is_place,
        f"{where}: value is not a number; give one, only that of a position or an impedance may be left out",
    )
    if axis.value is not None:
        number(where, "value", axis.value)
    if axis.position is not None:
        number(where, "contact_position", axis.position)
    require(
        isinstance(axis.joint, int)
        and not isinstance(axis.joint, bool)
        and axis.joint in range(-1, len(joints.names))
        and (not is_joint or (axis.cover, axis.position, any(direction)) == ("", 0.0, False)),
        f"{where}: joint is {axis.joint!r}, cover {axis.cover!r}, contact_position {axis.position}, along {direction}; "
        f"give a joint alone, 0 to {len(joints.names) - 1}, or joint -1 and a cover with position and direction",
    )
    require(
        axis.kind is AxisKind.IMPEDANCE or not (axis.stiffness or axis.damping),
        f"{where}: stiffness and damping are for an impedance only; this axis is a {axis.kind.name.lower()}",
    )
    require(
        axis.stiffness >= 0.0 and axis.damping >= 0.0,
        f"{where}: stiffness is {axis.stiffness:g} and damping {axis.damping:g}; allowed: 0 and above",
    )
    require(
        axis.rate == 0.0 or is_place,
        f"{where}: rate is {axis.rate:g}; it is for a position or an impedance only: leave it out",
    )
    if is_joint:
        low, high = joints.lower[axis.joint], joints.upper[axis.joint]
        require(
            not is_place or axis.value is None or low <= axis.value <= high or not _is_held(axis),
            f"{where}: {joints.names[axis.joint]} is commanded to {axis.value} rad; allowed: {low:.4g} to {high:.4g}",
        )
        return axis
    require(any(direction), f"{where}: along is {direction}; give a direction that is not zero")
    length = arm.covers.length_of(known_cover(where, axis.cover, arm))
    require(
        axis.position is not None or axis.is_sensed,
        f"{where}: contact_position is missing; it is estimated for a force only",
    )
    require(
        axis.position is None or 0.0 <= axis.position <= length,
        f"{where}: contact_position is {axis.position} m; allowed: 0 to {length:g} m, on {axis.cover}",
    )
    return axis


def known_cover(where: str, name: Any, arm: Arm) -> str:
    """The name of a cover, or refused."""
    if not is_one_of(name, arm.covers.names):
        raise ParameterError(f"{where}: cover is {name!r}; allowed: {', '.join(arm.covers.names)}")
    return str(name)


def checked_task(task: TaskCommand, where: str = "") -> TaskCommand:
    """A task as it is, or refused where it has positions along axes that turn with a link.

    Parameters
    ----------
    where : what begins a refusal: file and step; '' for a message.

    Raises
    ------
    ParameterError
        names the axis.
    """
    for axis in task.axes:
        if task.frame != BASE and not axis.is_joint and _is_held(axis):
            raise ParameterError(
                f"{where}{': ' * bool(where)}{axis.name} is in the frame of {task.frame}, which turns with it; "
                "command positions in the base frame"
            )
    return task


def _is_held(axis: TaskAxis) -> bool:
    return axis.kind is AxisKind.POSITION or axis.stiffness > 0.0


def unit(vector: Triple) -> Triple:
    """The vector (3,), which is not zero, scaled to length 1."""
    size = math.hypot(*vector)
    return vector[0] / size, vector[1] / size, vector[2] / size


@dataclass(frozen=True)
class TaskParameters:
    """Limits of tasks."""

    speed_limit: float = parameter("largest speed along an axis of a task", "m/s", high=10.0)
    joint_speed_limit: float = parameter("largest speed of a joint that is an axis of a task", "rad/s", high=10.0)
    least_damping: float = parameter("least damping of an impedance along an axis", "N s/m", low=1e-3, high=1e6)
    least_joint_damping: float = parameter("least damping of an impedance of a joint", "N m s/rad", low=1e-3, high=1e6)
    largest_rate: float = parameter(
        "largest ratio of stiffness to damping of an impedance; also velocity per error of a commanded position",
        "1/s",
        high=100.0,
    )
    deadband: float = parameter("force along an impedance below which the arm does not yield", "N", high=100.0)
    joint_deadband: float = parameter(
        "torque of a joint impedance below which the joint does not yield", "N m", high=100.0
    )

    def fastest(self, is_joint: bool) -> tuple[float, str]:
        """Largest speed along an axis, m/s, or of a joint, rad/s, and the name of that parameter."""
        if is_joint:
            return self.joint_speed_limit, "task.joint_speed_limit"
        return self.speed_limit, "task.speed_limit"

    def damping(self, axis: TaskAxis) -> float:
        """Damping of an impedance, N s/m or N m s/rad."""
        return axis.damping or (self.least_joint_damping if axis.is_joint else self.least_damping)

    def too_stiff(self, axis: TaskAxis) -> str:
        """Why an impedance is refused, '' where it is not."""
        name = "least_joint_damping" if axis.is_joint else "least_damping"
        least, damping = float(getattr(self, name)), self.damping(axis)
        if damping < least:
            return f"{axis.name}: damping is {damping:g}; allowed: task.{name}, {least:g}, and above"
        if axis.stiffness > self.largest_rate * damping:
            return (
                f"{axis.name}: stiffness is {axis.stiffness:g} at a damping of {damping:g}; allowed: up to "
                f"{self.largest_rate * damping:g} (task.largest_rate); give it more damping"
            )
        return ""
