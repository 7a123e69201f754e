"""A task as a scenario writes it, in YAML.

One task as an example::

    task:
      frame: base                      # or a cover, or {of: base, rpy: [0, 0, 0.3]}: axes of a frame of your own
      axes:                            # axes that contradict each other share what is left
        - {force: 10.0, along: [0, 0, -1], cover: outer_link, contact_position: 0.28}   # or estimated
        - {velocity: 0.04, along: [0, 1, 0], cover: outer_link, contact_position: 0.28}
        - {position: here, along: [1, 0, 0], cover: outer_link, contact_position: 0.4}
        - {impedance: here, stiffness: 400, damping: 100, along: [1, 0, 0], cover: outer_link, contact_position: 0.4}
        - {free: 100, along: [1, 0, 0], cover: outer_link, contact_position: 0.4}   # led by hand, with this damping
        - {position: 0.3, joint: joint3}
        - {line: outer_link, point: [0.4, 0, -0.2], along: [0, 1, 0], hold: [start_up, end_up]}
"""

from collections.abc import Mapping
from typing import Any, Final

import pinocchio as pin

from wam_control.force.task import (
    AxisKind,
    TaskAxis,
    TaskCommand,
    checked,
    checked_task,
    joint_axes,
    known_cover,
    line_axes,
    unit,
)
from wam_control.task.scenario_values import frame, known, number, numbers, plain, require_list, triple
from wam_description.arm import Arm
from wam_description.parameters import require
from wam_description.signals import BASE, ZERO, Triple

PARTS: Final = ("start_side", "start_up", "end_side", "end_up")  # of a line: where, and which way across it
HERE: Final = "here"
ESTIMATED: Final = "estimated"
KINDS: Final = (*(kind.name.lower() for kind in AxisKind), "free")


def torque_task(where: str, body: Any, arm: Arm) -> TaskCommand:
    """A torque of each joint, N m."""
    return TaskCommand(BASE, joint_axes(AxisKind.FORCE, numbers(where, "torque", body, arm.n)))


def task_of_text(where: str, body: Any, arm: Arm) -> TaskCommand:
    """The task of a step.

    Raises
    ------
    ParameterError
        names the step, the axis and the value that is not allowed.
    """
    known(f"{where}, task", body, ("frame", "axes"), ("axes",))
    own, rotation = _frame(where, body.get("frame", BASE), arm)
    axes = body["axes"]
    require(isinstance(axes, list) and len(axes) > 0, f"{where}: axes of the task is {axes!r}; give a list of them")
    found: list[TaskAxis] = []
    for i, one in enumerate(axes):
        place = f"{where}, axis {i + 1}"
        require(isinstance(one, Mapping), f"{place} is {one!r}; it must be a mapping")
        found += _line(place, one, own, arm) if "line" in one else [_axis(place, one, rotation, arm)]
    return checked_task(TaskCommand(own, tuple(found)), where)


def require_task(where: str, task: TaskCommand, arm: Arm) -> None:
    """Refuse a task that was made in Python for what one of a file is refused.

    Raises
    ------
    ParameterError
        names the step, the axis and the value that is not allowed.
    """
    require(isinstance(task, TaskCommand), f"{where}: task is {task!r}; give a TaskCommand")
    require_list(where, "axes of the task", task.axes, "TaskAxis")
    frame(where, task.frame, arm)
    require(len(task.axes) > 0, f"{where}: the task has no axes; give at least one, or no task")
    for i, axis in enumerate(task.axes):
        checked(f"{where}, axis {i + 1}", axis, arm)
    checked_task(task, where)


def as_of_file(task: TaskCommand) -> TaskCommand:
    """A task that was made in Python with tuples and floats as one of a file has them."""
    return task._replace(axes=tuple(plain(axis)._replace(kind=axis.kind, joint=axis.joint) for axis in task.axes))


def _frame(where: str, given: Any, arm: Arm) -> tuple[str, Any]:
    """Frame of the table, and the rotation into it from the frame in which the axes are written."""
    angles: tuple[float, ...] = (0.0, 0.0, 0.0)
    if isinstance(given, Mapping):
        known(f"{where}, frame", given, ("of", "rpy"), ("of", "rpy"))
        angles = numbers(where, "rpy", given["rpy"], 3)
        given = given["of"]
    return frame(where, given, arm, ", or of one of them with rpy"), pin.rpy.rpyToMatrix(*angles)


def _line(where: str, body: Mapping[str, Any], own: str, arm: Arm) -> list[TaskAxis]:
    known(where, body, ("line", "point", "along", "hold"), ("line", "point", "along"))
    require(own == BASE, f"{where}: the frame of the task is {own}; a line needs the frame base")
    cover = known_cover(where, body["line"], arm)
    held = body.get("hold", list(PARTS))
    require(
        isinstance(held, list) and len(held) > 0 and all(part in PARTS for part in held),
        f"{where}: hold is {held!r}; allowed: a list of {', '.join(PARTS)}",
    )
    point, along = triple(where, "point", body["point"]), _direction(where, body["along"])
    return [axis for part, axis in zip(PARTS, line_axes(arm, cover, point, along), strict=True) if part in held]


def _axis(where: str, body: Mapping[str, Any], rotation: Any, arm: Arm) -> TaskAxis:
    kinds = [name for name in KINDS if name in body]
    require(len(kinds) == 1, f"{where} has {', '.join(kinds) or 'no kind'}; give one of {', '.join((*KINDS, 'line'))}")
    name = kinds[0]
    is_joint = "joint" in body
    given = ("joint",) if is_joint else ("along", "cover", "contact_position")
    extra = ("stiffness", "damping") if name == "impedance" else ("rate",) if name == "position" else ()
    known(where, body, (name, *given, *extra), (name, *given))
    kind = AxisKind.IMPEDANCE if name == "free" else AxisKind[name.upper()]
    value = None if body[name] == HERE or name == "free" else number(where, name, body[name])
    damping = body[name] if name == "free" else body.get("damping", 0.0)
    motion = (value, body.get("rate", 0.0), body.get("stiffness", 0.0), damping)
    if is_joint:
        names = arm.joints.names
        require(body["joint"] in names, f"{where}: joint is {body['joint']!r}; allowed: {', '.join(names)}")
        return checked(where, TaskAxis(kind, names.index(body["joint"]), "", 0.0, ZERO, *motion), arm)
    place = None if body["contact_position"] == ESTIMATED else body["contact_position"]
    x, y, z = (rotation @ _direction(where, body["along"])).tolist()
    return checked(where, TaskAxis(kind, -1, body["cover"], place, (x, y, z), *motion), arm)


def _direction(where: str, body: Any) -> Triple:
    direction = triple(where, "along", body)
    require(any(direction), f"{where}: along is {body!r}; give a direction that is not zero")
    return unit(direction)
