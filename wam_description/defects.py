"""What makes a value of a topic unusable: wrong lengths, numbers that are not finite or that no arm reaches.

Messages that come over topics and what a node returns are refused for the same reasons, in the same words.  What a node
returns may be any sequence of numbers, as a numpy array; the others get lists and tuples of Python's own.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from math import isfinite, isinf, isnan
from typing import Any

import numpy as np

from wam_description.signals import Point, State, Table, Wrench
from wam_description.topics import JOINT_STATE, LARGEST, LINK, POINT, TABLE, WRENCH, Topic, columns_of

Check = Callable[[Any], Any]  # the value in lists and tuples of floats; raises UnusableOutput
_KINDS: dict[str, Any] = {JOINT_STATE: State, WRENCH: Wrench, POINT: Point, TABLE: Table}


class UnusableOutput(ValueError):
    """A step returned a value that no other node could use; the text names node, topic, value and what is allowed."""

    def __init__(self, node: str, topic: str, defect: str) -> None:
        self.what = f"unusable {topic}: {defect}"
        super().__init__(f"node '{node}' returned an {self.what}")


def output_check(node: str, topic: Topic, names: Sequence[str], frames: Sequence[str], arrays: str) -> Check:
    """What refuses an unusable output of a node, and returns another as the nodes of the stack take it.

    Parameters
    ----------
    node : its name.
    topic : row of the table of topics, of one of the types that carry numbers.
    names : of motors or joints, in the order of the numbers of a JointState.
    frames : that a force, a point or a table may have.
    arrays : of a JointState, the arrays that must be filled; one with a '?' may be empty.
    """
    defect_of: Callable[[Any], str] = {
        JOINT_STATE: lambda value: state_defect(value, names, arrays),
        WRENCH: lambda value: wrench_defect(value, frames),
        POINT: lambda value: point_defect(value, frames),
        TABLE: lambda value: table_defect(value, topic.columns, frames),
    }[topic.type]
    return _converting(node, topic, defect_of)


def conversion(node: str, topic: Topic) -> Check:
    """What makes an output that no other node takes into lists and tuples of floats; NaN, too, is a value there.

    Parameters
    ----------
    node : its name.
    topic : row of the table of topics, of one of the types that carry numbers.
    """
    return _converting(node, topic, lambda value: "")


def _converting(node: str, topic: Topic, defect_of: Callable[[Any], str]) -> Check:
    kind, convert = _KINDS[topic.type], _AS_TAKEN[topic.type]

    def check(value: Any) -> Any:
        defect = "" if isinstance(value, kind) else f"{value!r} is no {kind.__name__}; return one"
        try:
            if not defect and not (defect := defect_of(taken := convert(value))):
                return taken
        except (TypeError, ValueError, OverflowError) as error:
            defect = f"{value} cannot be sent: {error}"
        raise UnusableOutput(node, topic.name, defect)

    return check


def _floats(name: str, values: Any) -> list[float]:
    """An array of numbers in any sequence; a TypeError names what is none."""
    return [_float(name, value) for value in _listed(name, values)]


# numpy gives all of its scalars a __float__
_NO_NUMBERS = (bool, np.bool_, np.character, np.complexfloating)


def _float(name: str, value: Any) -> float:
    if isinstance(value, _NO_NUMBERS) or not hasattr(value, "__float__"):
        raise TypeError(f"{name} has {value!r}; return floats")
    return float(value)


def _listed(name: str, values: Any, of: str = "floats") -> Iterable[Any]:
    if isinstance(values, (str, bytes, bytearray, memoryview, Set, Mapping)) or not isinstance(values, Iterable):
        raise TypeError(f"{name} is {values!r}; return a list of {of}")
    return values


def _framed(frame: Any) -> str:
    if not isinstance(frame, str):
        raise TypeError(f"frame is {frame!r}; return a text")
    return frame


def _as_table(table: Table) -> Table:
    return Table(
        _framed(table.frame), tuple(tuple(_floats("a row", row)) for row in _listed("rows", table.rows, "rows"))
    )


_AS_TAKEN: dict[str, Callable[[Any], Any]] = {
    JOINT_STATE: lambda state: State(*map(_floats, State._fields, state)),
    WRENCH: lambda wrench: Wrench(
        _framed(wrench.frame),
        tuple(_floats("force", wrench.force)),  # type: ignore[arg-type]
        tuple(_floats("torque", wrench.torque)),  # type: ignore[arg-type]
    ),
    POINT: lambda point: Point(_framed(point.frame), tuple(_floats("position", point.position))),  # type: ignore[arg-type]
    TABLE: _as_table,
}


def state_defect(state: State, owners: Sequence[str], arrays: str) -> str:
    """What is wrong with positions, velocities and torques of motors or joints.

    Parameters
    ----------
    state : the values.
    owners : motors or joints in the order of the values.
    arrays : that must be filled; one with a '?' may be empty.
    """
    wanted, count = arrays.split(), len(owners)
    for name, values in zip(State._fields, state, strict=True):
        if len(values) != count and (len(values) or name in wanted):
            return f"{name} has {len(values)} values; send {count}, one for each of {', '.join(owners)}"
        for value, owner in zip(values, owners, strict=False):
            if not isfinite(value):
                return f"{name} of {owner} is {value}; send finite numbers"
            if abs(value) > LARGEST[name]:
                return f"{name} of {owner} is {value:g}; {_allowed(LARGEST[name])}"
    return ""


def wrench_defect(wrench: Wrench, frames: Sequence[str]) -> str:
    """What is wrong with a force and a torque in one of the frames."""
    if wrench.frame not in frames:
        return f"frame_id is '{wrench.frame}'; allowed are {', '.join(frames)}"
    if [len(vector) for vector in wrench[1:]] != [3, 3]:
        return f"force {wrench.force} N, torque {wrench.torque} N m; send three numbers for each"
    if not all(isfinite(value) for value in (*wrench.force, *wrench.torque)):
        return f"force {wrench.force} N, torque {wrench.torque} N m; send finite numbers"
    for name, unit, vector in (("force", "N", wrench.force), ("torque", "N m", wrench.torque)):
        if (most := max(map(abs, vector))) > LARGEST[name]:
            return f"{name} has {most:g} {unit}; {_allowed(LARGEST[name])}"
    return ""


def point_defect(point: Point, frames: Sequence[str]) -> str:
    """What is wrong with a position in one of the frames; NaN means that a coordinate is not known."""
    frame, position = point
    if frame not in frames:
        return f"frame_id is '{frame}'; allowed are {', '.join(frames)}"
    if [len(each) for each in point[1:]] != [3]:
        return f"position is {position} m; send three numbers"
    if any(isinf(value) for value in position):
        return f"position is {position} m; send finite numbers, or NaN where it is not known"
    if any(abs(value) > LARGEST["point"] for value in position):
        return f"position is {position} m; {_allowed(LARGEST['point'])}, or NaN where it is not known"
    return ""


def table_defect(table: Table, columns: Sequence[str], frames: Sequence[str]) -> str:
    """What is wrong with rows of numbers under these columns; NaN in some means that a number is not known."""
    if table.frame not in frames:
        return f"frame_id is '{table.frame}'; allowed are {', '.join(frames)}"
    if sizes := {len(row) for row in table.rows} - {len(columns)}:
        return f"a row has {min(sizes)} numbers; send {len(columns)}: {', '.join(columns)}"
    if any(isinf(value) for row in table.rows for value in row):
        return "a number is infinite; send finite numbers, or NaN where one is not known"
    for row in table.rows:
        for (name, largest, may_be_unknown), value in zip(columns_of(tuple(columns)), row, strict=True):
            if isnan(value) and not may_be_unknown:
                return f"{name} is nan; send a finite number"
            if abs(value) > largest:
                return f"{name} is {value:g}; {_allowed(largest)}, or NaN where it is not known"
    for link in (row[0] for row in table.rows if columns[0] == LINK):
        if link not in range(len(frames) - 1):
            return f"link is {link}; send the index of one of {', '.join(frames[1:])}"
    return ""


def _allowed(limit: float) -> str:
    return f"no arm reaches that, send at most {limit:g}"
