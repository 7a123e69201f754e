"""Messages of a topic as columns: what each type becomes, decoded in bulk.

Messages of a topic mostly have the same counts and strings.  Then every number stands at the same
place in each, and a column is a look at many records at once.
"""

from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.cdr import Decoder, Definitions
from wam_analysis.message_groups import Decoded, Group, Grouping, Index, Numbers, Times
from wam_ros.mcap_file import DATA, Found, log_times, messages
from wam_ros.mcap_records import Bytes

Texts = NDArray[np.object_]


class JointColumns(NamedTuple):
    """sensor_msgs/JointState, k messages of n joints, matched by name.

    `names` are in the order of their first appearance; what a message leaves empty is NaN.  A field
    that every message leaves empty has shape (k, 0).
    """

    log_time_ns: Times
    stamp_ns: Times
    frames: Texts
    names: tuple[str, ...]
    position: Numbers
    velocity: Numbers
    effort: Numbers


class WrenchColumns(NamedTuple):
    """geometry_msgs/WrenchStamped, k messages: force (k, 3) N, torque (k, 3) N m."""

    log_time_ns: Times
    stamp_ns: Times
    frames: Texts
    force: Numbers
    torque: Numbers


class PointColumns(NamedTuple):
    """geometry_msgs/PointStamped, k messages: point (k, 3) m."""

    log_time_ns: Times
    stamp_ns: Times
    frames: Texts
    point: Numbers


class BoolColumns(NamedTuple):
    """std_msgs/Bool, k messages."""

    log_time_ns: Times
    data: NDArray[np.bool_]


class ClockColumns(NamedTuple):
    """rosgraph_msgs/Clock, k messages."""

    log_time_ns: Times
    stamp_ns: Times


class Messages(NamedTuple):
    """Messages of any other type; fields are attributes, arrays of numbers numpy arrays."""

    log_time_ns: Times
    messages: Sequence[Any]

    def column(self, path: str) -> NDArray[Any]:
        """One field of every message, for example 'header.stamp.sec'; shape (k,), or (k, n) of equal arrays."""
        values = list(map(attrgetter(path), self.messages))
        return np.array(values, object if values and isinstance(values[0], str) else None)


Columns = JointColumns | WrenchColumns | PointColumns | BoolColumns | ClockColumns | Messages


class Collector:
    """Takes the messages of one topic batch by batch and makes columns of them.

    Parameters
    ----------
    kind : type, ``package/msg/Type``.
    definitions : fields of it and of the types it is made of.
    begin, end : log times that are wanted, ns, begin <= t < end.
    """

    def __init__(self, kind: str, definitions: Definitions, begin: int, end: int) -> None:
        self._kind, self._definitions = kind, definitions
        self._begin, self._end = begin, end
        self._times: list[Times] = []
        self._groups_of = Grouping(kind, definitions)
        self._groups: list[Any] = []
        self._data: list[bytes] = []
        self._kept = 0

    def takes(self, kind: str, definitions: Definitions) -> bool:
        """Whether messages of a type belong into these columns."""
        return kind == self._kind and definitions == self._definitions

    def add(self, buffer: Bytes, found: Found) -> None:
        """Take these messages of a buffer."""
        times = log_times(buffer, found.offsets)
        wanted = (times >= self._begin) & (times < self._end)
        if not wanted.all():
            found, times = Found(found.offsets[wanted], found.sizes[wanted]), times[wanted]
        self._times.append(times)
        if (extract := _EXTRACTS.get(self._kind)) is None:
            self._data += messages(buffer, found)
        else:
            for group in self._groups_of(buffer, found.offsets + DATA, found.sizes):
                self._groups.append((group.rows + self._kept, *extract(group)))
        self._kept += len(times)

    def columns(self, label: str) -> Columns:
        """Everything that came, in the order of log times; the label names bag and topic in errors to come."""
        times = np.concatenate(self._times) if self._times else np.empty(0, np.int64)
        order = None if (np.diff(times) >= 0).all() else np.argsort(times, kind="stable")
        if self._kind not in _ASSEMBLE:
            data = self._data if order is None else [self._data[i] for i in order]
            messages = Decoded(data, Decoder(self._kind, self._definitions), label)
            return Messages(times if order is None else times[order], messages)
        rank = np.arange(len(times)) if order is None else np.argsort(order)
        groups = sorted(self._groups, key=lambda group: int(rank[group[0]].min()))
        columns: Any = _ASSEMBLE[self._kind](times, groups)
        if order is None:
            return columns
        return type(columns)(*(column[order] if isinstance(column, np.ndarray) else column for column in columns))


def _joints(group: Group) -> tuple[Any, ...]:
    fields = [group.numbers(name).astype(np.float64) for name in ("position", "velocity", "effort")]
    return group.time("header.stamp"), group.text("header.frame_id")[0], (group.text("name"), fields)


def _wrench(group: Group) -> tuple[Any, ...]:
    values = np.hstack([group.vector("wrench.force"), group.vector("wrench.torque")])
    return group.time("header.stamp"), group.text("header.frame_id")[0], values


def _point(group: Group) -> tuple[Any, ...]:
    return group.time("header.stamp"), group.text("header.frame_id")[0], group.vector("point")


def _stamped(times: Times, groups: list[Any]) -> tuple[Times, Texts]:
    stamps, frames = np.empty(len(times), np.int64), np.empty(len(times), np.object_)
    for rows, stamp, frame, _ in groups:
        where = _span(rows)
        stamps[where] = stamp
        frames[where] = frame
    return stamps, frames


def _span(rows: Index) -> slice | Index:
    """Rows as a slice where they follow each other, which is faster."""
    if rows[-1] - rows[0] == len(rows) - 1:
        return slice(int(rows[0]), int(rows[-1]) + 1)
    return rows


def _joint_columns(times: Times, groups: list[Any]) -> JointColumns:
    stamps, frames = _stamped(times, groups)
    names = tuple(dict.fromkeys(name for group in groups for name in group[3][0]))
    arrays = []
    for field in range(3):
        if not any(group[3][1][field].shape[1] for group in groups):
            arrays.append(np.empty((len(times), 0)))
            continue
        is_filled = all(own == names and fields[field].shape[1] == len(names) for *_, (own, fields) in groups)
        array = np.empty((len(times), len(names)))
        if not is_filled:
            array[:] = np.nan
        for rows, _, _, (own, fields) in groups:
            values = fields[field][:, : len(own)]
            found = own[: values.shape[1]]
            if found == names:
                array[_span(rows)] = values
            else:
                for i, name in enumerate(found):
                    array[rows, names.index(name)] = values[:, i]
        arrays.append(array)
    return JointColumns(times, stamps, frames, names, *arrays)


def _vectors(times: Times, groups: list[Any], width: int) -> Numbers:
    values = np.empty((len(times), width))
    for rows, _, _, found in groups:
        values[_span(rows)] = found
    return values


def _wrench_columns(times: Times, groups: list[Any]) -> WrenchColumns:
    values = _vectors(times, groups, 6)
    return WrenchColumns(times, *_stamped(times, groups), values[:, :3], values[:, 3:])


def _point_columns(times: Times, groups: list[Any]) -> PointColumns:
    return PointColumns(times, *_stamped(times, groups), _vectors(times, groups, 3))


def _bool_columns(times: Times, groups: list[Any]) -> BoolColumns:
    data = np.empty(len(times), np.bool_)
    for rows, values in groups:
        data[rows] = values
    return BoolColumns(times, data)


def _clock_columns(times: Times, groups: list[Any]) -> ClockColumns:
    stamps = np.empty(len(times), np.int64)
    for rows, values in groups:
        stamps[rows] = values
    return ClockColumns(times, stamps)


_EXTRACTS: dict[str, Callable[[Group], tuple[Any, ...]]] = {
    "sensor_msgs/msg/JointState": _joints,
    "geometry_msgs/msg/WrenchStamped": _wrench,
    "geometry_msgs/msg/PointStamped": _point,
    "std_msgs/msg/Bool": lambda group: (group.numbers("data")[:, 0] != 0,),
    "rosgraph_msgs/msg/Clock": lambda group: (group.time("clock"),),
}
_ASSEMBLE: dict[str, Callable[[Times, list[Any]], Columns]] = {
    "sensor_msgs/msg/JointState": _joint_columns,
    "geometry_msgs/msg/WrenchStamped": _wrench_columns,
    "geometry_msgs/msg/PointStamped": _point_columns,
    "std_msgs/msg/Bool": _bool_columns,
    "rosgraph_msgs/msg/Clock": _clock_columns,
}
