"""Messages of a topic as columns: what each type becomes, decoded in bulk.

Messages of a topic mostly have the same counts and strings.  Then every number is at the same place in each
of them, and a column is a view of many records at once.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_bag.arrays import Index, Mask, Numbers, Texts, Times
from wam_bag.cdr import CDR, Decoder, MessageType
from wam_bag.definitions import schema
from wam_bag.errors import BagError, Damage
from wam_bag.message_groups import Decoded, Group, Grouping
from wam_bag.message_search import DATA, MessageBatch, packed
from wam_bag.message_text import definitions
from wam_bag.point_clouds import points, table_columns

Series = dict[str, NDArray[Any]]
AXES = ("x", "y", "z")
JOINT_FIELDS = ("position", "velocity", "effort")
UNNAMED, DOUBLED = "joints without a name", "a joint's name twice"


class JointColumns(NamedTuple):
    """sensor_msgs/JointState, k messages of n joints, matched by name.

    `names` are in the order of their first appearance, see `joint_names`; values that a message leaves out are NaN, and
    so are those of a field of another length than its names.  A field that every message leaves empty has shape (k, 0).
    `irregular` counts messages by what is wrong with their names or fields.
    """

    log_time_ns: Times
    stamp_ns: Times
    frames: Texts
    names: tuple[str, ...]
    position: Numbers
    velocity: Numbers
    effort: Numbers
    irregular: Mapping[str, int] = {}


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


class TableColumns(NamedTuple):
    """sensor_msgs/PointCloud2, k messages with p points together: a table with a row for each point.

    `message` (p,) is the index of the message of each row; a message may have no points.  `columns` are the
    fields of the points by name, (p,), or (p, n) for a field of n numbers, in the type of the field.
    """

    log_time_ns: Times
    stamp_ns: Times
    frames: Texts
    message: Index
    columns: dict[str, NDArray[Any]]

    @property
    def row_stamp_ns(self) -> Times:
        """Stamp of the message of each row, ns, (p,)."""
        return self.stamp_ns[self.message]


class BoolColumns(NamedTuple):
    """std_msgs/Bool, k messages."""

    log_time_ns: Times
    data: Mask


class Messages(NamedTuple):
    """Messages of any other type; fields are attributes, arrays of numbers numpy arrays."""

    log_time_ns: Times
    messages: Sequence[Any]


Columns = JointColumns | WrenchColumns | PointColumns | TableColumns | BoolColumns | Messages
Extract = Callable[[Group], tuple[Any, ...]]
Assemble = Callable[[Times, list[Any]], Columns]


def series(columns: Columns) -> Series:
    """Named series of equal length (k,), as data frames and spreadsheets take them.

    'time', s, is the stamp, or the log time where messages have none.  A field with several values is a series for
    each of them, as 'position.joint1' or 'force.x'; that of a table has a row for each of its rows.
    """
    found: Series = {"time": getattr(columns, "stamp_ns", columns.log_time_ns) / 1e9}
    names: Sequence[object] = AXES
    if isinstance(columns, JointColumns):
        fields, names = {name: getattr(columns, name) for name in JOINT_FIELDS}, columns.names
    elif isinstance(columns, TableColumns):
        fields, names = {"message": columns.message, **columns.columns}, range(2**16)
        found["time"] = found["time"][columns.message]
    elif isinstance(columns, Messages):
        fields = {"message": np.fromiter(columns.messages, object, len(columns.messages))}
    else:
        fields = {name.replace("frames", "frame"): column for name, column in columns._asdict().items()}
        fields = {name: column for name, column in fields.items() if not name.endswith("_ns")}
    for field, values in fields.items():
        if values.ndim < 2:
            found[field] = values
        else:
            found |= {f"{field}.{name}": column for name, column in zip(names, values.T, strict=False)}
    return found


class Collector:
    """Takes the messages of one topic batch by batch and makes columns of them.

    Parameters
    ----------
    kind : type of the messages.
    as_messages : whether no columns of the fields are made.
    """

    def __init__(self, kind: MessageType, as_messages: bool = False) -> None:
        self.kind = kind
        self._columned = _TYPES.get(kind.name) if kind.encoding == CDR and not as_messages else None
        self._times: list[Times] = []
        self._groups_of = Grouping(Decoder(*kind))
        self._groups: list[tuple[Index, Any]] = []
        self._data: list[bytes] = []
        self._number = 0

    def add(self, found: MessageBatch) -> None:
        """Take these messages."""
        self._times.append(found.times)
        if self._columned is not None:
            extract, _ = self._columned
            for group in self._groups_of(found.buffer, found.offsets + DATA, found.sizes):
                self._groups.append((group.rows + self._number, extract(group)))
        else:
            self._data += found.messages()
        self._number += len(found.times)

    def columns(self, label: str) -> Columns:
        """All messages in the order of log times; the label names bag and topic in later errors."""
        times = np.concatenate([np.empty(0, np.int64), *self._times])
        order = np.argsort(times, kind="stable")
        times, rank = times[order], np.argsort(order)
        if self._columned is None:
            return Messages(times, Decoded([self._data[i] for i in order], self.kind.decode, label))
        _, assemble = self._columned
        groups = [(rank[rows], values) for rows, values in self._groups]
        groups.sort(key=lambda group: int(group[0].min()))
        try:
            return assemble(times, [(_where(rows), values) for rows, values in groups])
        except Damage as error:
            raise BagError(f"{label}: {error}; read the others of its topics") from None


def _header(group: Group) -> tuple[Times, str]:
    return group.time("header.stamp"), group.value("header.frame_id")


def _where(rows: Index) -> slice | Index:
    """Rows as a slice if they follow each other, which is faster."""
    first, number = int(rows[0]), len(rows)
    follow = rows[-1] - first == number - 1 and (np.diff(rows) == 1).all()
    return slice(first, first + number) if follow else rows


def _filled(groups: list[Any], place: int, shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
    """A column of the values that groups of messages have at a place."""
    column = np.empty(shape, dtype)
    for where, values in groups:
        column[where] = values[place]
    return column


def _vectors(kind: Any, *paths: str) -> tuple[Extract, Assemble]:
    """How columns of stamps, frames and vectors are made, those at some paths in the messages."""

    def assemble(times: Times, groups: list[Any]) -> Columns:
        arrays = (_filled(groups, i, (len(times), 3), np.float64) for i, _ in enumerate(paths, 2))
        return kind(*_stamped(times, groups), *arrays)

    return lambda group: (*_header(group), *map(group.vector, paths)), assemble


def _stamped(times: Times, groups: list[Any]) -> tuple[Times, Times, Texts]:
    k = len(times)
    return times, _filled(groups, 0, (k,), np.int64), _filled(groups, 1, (k,), np.object_)


def joint_names(names: Sequence[str], width: int) -> tuple[str, ...]:
    """Names of the values of a message: a joint without one is numbered, and so is one whose name is there twice.

    Parameters
    ----------
    names : as the message has them.
    width : its values.
    """
    found: list[str] = []
    for i, name in enumerate([*names, *[""] * (width - len(names))]):
        own = name or f"joint{i + 1}"
        found.append(own if own not in found else f"{own} ({i + 1})")
    return tuple(found)


def irregularities(names: Sequence[str], widths: Mapping[str, int], number: int) -> Iterator[str]:
    """What is wrong with the names of a message of so many joints and the lengths of its fields."""
    if not any(widths.values()):
        yield "no value"
    named = [*filter(None, names)]
    if len(named) < number:
        yield UNNAMED
    if len({*named}) < len(named):
        yield DOUBLED
    yield from (
        f"{field} of another length than the names" for field, width in widths.items() if width not in (0, number)
    )


def joint_columns(times: Times, groups: list[Any]) -> JointColumns:
    """Joint states of k messages.

    Parameters
    ----------
    times : log times, ns, (k,).
    groups : rows of messages that are alike, with their stamps, ns, frame, names, and fields, each (m, n).
    """
    irregular = Counter[str]()
    owners = []
    for _, (stamps, _, given, fields) in groups:
        widths = {name: field.shape[1] for name, field in zip(JOINT_FIELDS, fields, strict=True)}
        # as many joints as most of its lists have that are not shorter than that of the names
        lengths = [len(given), *widths.values()]
        number = max(lengths, key=lambda n: (n >= max(lengths[0], 1), lengths.count(n), n))
        irregular.update({what: len(stamps) for what in irregularities(given, widths, number)})
        owners.append(joint_names(given, number))
    names = tuple(dict.fromkeys(name for own in owners for name in own))
    arrays = []
    for place in range(len(JOINT_FIELDS)):
        width = len(names) * any(values[3][place].size for _, values in groups)
        array = np.full((len(times), width), np.nan)
        for (where, (_, _, _, fields)), own in zip(groups, owners, strict=True):
            values = fields[place]
            if values.shape[1] != len(own):
                continue
            if own == names:
                array[where] = values
                continue
            for i, name in enumerate(own):
                array[where, names.index(name)] = values[:, i]
        arrays.append(array)
    position, velocity, effort = arrays
    return JointColumns(*_stamped(times, groups), names, position, velocity, effort, irregular)


def _table_columns(times: Times, groups: list[Any]) -> TableColumns:
    rows = np.arange(len(times))
    return TableColumns(
        *_stamped(times, groups), *table_columns([(rows[where], every) for where, (*_, every) in groups])
    )


_TYPES: Final[dict[str, tuple[Extract, Assemble]]] = {
    "sensor_msgs/msg/JointState": (
        lambda group: (*_header(group), tuple(group.value("name")), list(map(group.numbers, JOINT_FIELDS))),
        joint_columns,
    ),
    "geometry_msgs/msg/WrenchStamped": _vectors(WrenchColumns, "wrench.force", "wrench.torque"),
    "geometry_msgs/msg/PointStamped": _vectors(PointColumns, "point"),
    "sensor_msgs/msg/PointCloud2": (lambda group: (*_header(group), points(group)), _table_columns),
    "std_msgs/msg/Bool": (
        lambda group: (group.numbers("data")[:, 0] != 0,),
        lambda times, groups: BoolColumns(times, _filled(groups, 0, (len(times),), np.bool_)),
    ),
}


def columns_of(kind: str, data: Sequence[bytes]) -> Columns:
    """Serialized messages of one installed type, ``package/msg/Type``, as columns; the log times are 0."""
    collector = Collector(MessageType(kind, CDR, definitions(kind, schema(kind))))
    collector.add(packed([(0, 0, one) for one in data]))
    return collector.columns("recorded")
