"""What makes a value of a topic unusable: wrong lengths, numbers that are not finite or that no arm reaches.

Messages that come over topics and what a node returns are refused for the same reasons, in the same words.  What a node
returns may be any sequence of numbers, as a numpy array; the others get lists and tuples of Python's own.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence, Set
from itertools import repeat
from math import isfinite, isinf, isnan
from typing import Any

import numpy as np

from wam_description.arm import Arm
from wam_description.signals import BASE, Point, State, Table, Wrench
from wam_description.topics import JOINT_STATE, LARGEST, LINK, POINT, TABLE, WRENCH, Topic, columns_of

Check = Callable[[Any], Any]  # the value in lists and tuples of floats; raises UnusableOutput
_KINDS: dict[str, Any] = {JOINT_STATE: State, WRENCH: Wrench, POINT: Point, TABLE: Table}


class UnusableOutput(ValueError):
    """A step returned a value that no other node could use; the text names node, topic, value and what is allowed."""

    def __init__(self, node: str, topic: str, defect: str) -> None:
        self.what = f"unusable {topic}: {defect}"
        super().__init__(f"node '{node}' returned an {self.what}")


def owners(topic: Topic, arm: Arm) -> tuple[str, ...]:
    """The motors or joints of the numbers of a JointState topic, in their order."""
    return arm.motors.names if topic.side == "motors" else arm.joints.names


def frames(arm: Arm) -> tuple[str, ...]:
    """The frames that a force, a point or a table may have."""
    return (BASE, *arm.covers.names)


def defect_finder(topic: Topic, arm: Arm, arrays: str) -> Callable[[Any], str]:
    """What finds the defect of a value of a topic, '' where there is none.

    Parameters
    ----------
    topic : row of the table of topics, of one of the types that carry numbers.
    arrays : of a JointState, the arrays that must be filled; one with a '?' may be empty.
    """
    if topic.type == JOINT_STATE:
        names, wanted = owners(topic, arm), frozenset(arrays.split())
        return lambda value: state_defect(value, names, wanted)
    allowed = frames(arm)
    finders: dict[str, Callable[[Any], str]] = {
        WRENCH: wrench_defect,
        POINT: point_defect,
        TABLE: lambda table: table_defect(table, topic.columns, allowed[1:]),
    }
    find = finders[topic.type]

    def defect(value: Any) -> str:
        if value.frame not in allowed:
            return f"frame_id is '{value.frame}'; allowed: {', '.join(allowed)}"
        return find(value)

    return defect


def output_check(node: str, topic: Topic, defect_of: Callable[[Any], str] = lambda value: "") -> Check:
    """What refuses an unusable output of a node, and returns another as the nodes of the stack take it.

    Parameters
    ----------
    node : its name.
    topic : row of the table of topics, of one of the types that carry numbers.
    defect_of : see `defect_finder`; without it NaN, too, is a value, as where no other node takes the output.
    """
    kind = _KINDS[topic.type]

    def check(value: Any) -> Any:
        defect = "" if isinstance(value, kind) else f"{value!r} is no {kind.__name__}; give one"
        try:
            if not defect and not (
                defect := defect_of(taken := kind(*map(_as_taken, repeat(kind), kind._fields, value)))
            ):
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
        raise TypeError(f"{name} has {value!r}; give floats")
    return float(value)


def _listed(name: str, values: Any, of: str = "floats") -> Iterable[Any]:
    if isinstance(values, (str, bytes, bytearray, memoryview, Set, Mapping)) or not isinstance(values, Iterable):
        raise TypeError(f"{name} is {values!r}; give a list of {of}")
    return values


def _as_taken(kind: Any, name: str, value: Any) -> Any:
    """A field of a message of a kind: a frame, the rows of a table, or numbers."""
    if name == "frame":
        if not isinstance(value, str):
            raise TypeError(f"frame is {value!r}; give a text")
        return value
    if name == "rows":
        return tuple(tuple(_floats("a row", row)) for row in _listed(name, value, "rows"))
    numbers = _floats(name, value)
    return numbers if kind is State else tuple(numbers)


_STATE_LIMITS = tuple((name, LARGEST[name]) for name in State._fields)


def state_defect(state: State, owners: Sequence[str], wanted: Collection[str]) -> str:
    """What is wrong with positions, velocities and torques of motors or joints.

    Parameters
    ----------
    state : the values.
    owners : motors or joints in the order of the values.
    wanted : arrays that must be filled.
    """
    count = len(owners)
    for values, (name, limit) in zip(state, _STATE_LIMITS, strict=True):
        if len(values) != count and (len(values) or name in wanted):
            return f"{name} has {len(values)} values; send {count}, one for each of {', '.join(owners)}"
        for value in values:
            if not -limit <= value <= limit:  # NaN, too
                owner = owners[[-limit <= one <= limit for one in values].index(False)]
                if isfinite(value):
                    return f"{name} of {owner} is {value:g}; {_allowed(limit)}"
                return f"{name} of {owner} is {value}; send finite numbers"
    return ""


def wrench_defect(wrench: Wrench) -> str:
    """What is wrong with a force and a torque."""
    if [len(vector) for vector in wrench[1:]] != [3, 3]:
        return f"force {wrench.force} N, torque {wrench.torque} N m; send three numbers for each"
    for name, unit, vector in (("force", "N", wrench.force), ("torque", "N m", wrench.torque)):
        limit = LARGEST[name]
        for value in vector:
            if not isfinite(value):
                return f"force {wrench.force} N, torque {wrench.torque} N m; send finite numbers"
            if abs(value) > limit:
                return f"{name} has {abs(value):g} {unit}; {_allowed(limit)}"
    return ""


def point_defect(point: Point) -> str:
    """What is wrong with a position; NaN means that a coordinate is not known."""
    position = point.position
    if [len(each) for each in point[1:]] != [3]:
        return f"position is {position} m; send three numbers"
    if any(isinf(value) for value in position):
        return f"position is {position} m; send finite numbers, or NaN where it is not known"
    if any(abs(value) > LARGEST["point"] for value in position):
        return f"position is {position} m; {_allowed(LARGEST['point'])}, or NaN where it is not known"
    return ""


def table_defect(table: Table, columns: Sequence[str], covers: Sequence[str]) -> str:
    """What is wrong with rows of numbers under these columns; NaN in some means that a number is not known."""
    if sizes := {len(row) for row in table.rows} - {len(columns)}:
        return f"a row has {min(sizes)} numbers; send {len(columns)}: {', '.join(columns)}"
    known = columns_of(tuple(columns))
    for row in table.rows:
        for value, (name, largest, may_be_unknown) in zip(row, known, strict=True):
            if abs(value) <= largest or (may_be_unknown and isnan(value)):
                continue
            if isfinite(value):
                return f"{name} is {value:g}; {_allowed(largest)}, or NaN where it is not known"
            return f"{name} is {value}; send a finite number{', or NaN where it is not known' * may_be_unknown}"
    for link in (row[0] for row in table.rows if columns[0] == LINK):
        if link not in range(len(covers)):
            return f"link is {link}; send the index of one of {', '.join(covers)}"
    return ""


def _allowed(limit: float) -> str:
    return f"no arm reaches that, send at most {limit:g}"
