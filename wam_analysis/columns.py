"""Messages of a topic as columns: what each type becomes, decoded in bulk.

Messages of a topic mostly have the same counts and strings.  Then every number stands at the same
place in each, and a column is a look at many records at once.
"""

from collections.abc import Callable, Iterator, Sequence
from operator import attrgetter
from typing import Any, NamedTuple, overload

import numpy as np
from numpy.typing import NDArray

from wam_analysis.cdr import ENCAPSULATION, Decoder, Definitions, Layout
from wam_analysis.mcap_file import DATA, Offsets, at, log_times, messages, sizes
from wam_analysis.mcap_records import Bytes, Damage

Times = NDArray[np.int64]
Numbers = NDArray[np.float64]
Texts = NDArray[np.object_]
Index = NDArray[np.intp]

_BEFORE = 8 - ENCAPSULATION  # bytes before the data that put its numbers on multiples of eight
_MOST_LAYOUTS = 64  # that are kept in mind; a topic with more has them read message by message


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


class Decoded(Sequence[Any]):
    """Messages that are decoded when somebody looks at them.

    Parameters
    ----------
    data : serialized messages.
    decode : makes an object of one.
    """

    def __init__(self, data: list[bytes], decode: Callable[[bytes], Any]) -> None:
        self._data, self._decode = data, decode
        self._known: dict[int, Any] = {}

    def __len__(self) -> int:
        return len(self._data)

    @overload
    def __getitem__(self, index: int) -> Any: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Any]: ...
    def __getitem__(self, index: int | slice) -> Any:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        number = range(len(self))[index]
        if number not in self._known:
            self._known[number] = self._decode(self._data[number])
        return self._known[number]


class _Group(NamedTuple):
    """Messages of one layout: which of the topic they are, and their bytes, one row each."""

    rows: Index
    layout: Layout
    words: NDArray[np.uint64]

    def numbers(self, path: str) -> NDArray[Any]:
        """Numbers of each message at a path, (m, n)."""
        try:
            leaf = self.layout.numbers[path]
        except KeyError:
            raise Damage(f"its type has no numbers '{path}'") from None
        size = leaf.dtype.itemsize * (1 if leaf.length is None else leaf.length)
        begin = 8 + leaf.offset
        return self.words.view(np.uint8)[:, begin : begin + size].view(leaf.dtype)

    def text(self, path: str) -> tuple[str, ...]:
        """Strings at a path."""
        try:
            return self.layout.texts[path]
        except KeyError:
            raise Damage(f"its type has no strings '{path}'") from None

    def time(self, path: str) -> Times:
        """Time at a path, ns, (m,)."""
        seconds = self.numbers(f"{path}.sec")[:, 0].astype(np.int64)
        return np.asarray(seconds * 1_000_000_000 + self.numbers(f"{path}.nanosec")[:, 0])

    def vector(self, path: str) -> Numbers:
        """x, y and z at a path, (m, 3)."""
        return np.hstack([self.numbers(f"{path}.{axis}") for axis in "xyz"])


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
        self._known: list[_Known] = []
        self._groups: list[Any] = []
        self._data: list[bytes] = []
        self._kept = 0

    def takes(self, kind: str, definitions: Definitions) -> bool:
        """Whether messages of a type belong into these columns."""
        return kind == self._kind and definitions == self._definitions

    def add(self, buffer: Bytes, offsets: Offsets) -> None:
        """Take messages whose records begin at these places of the buffer."""
        times = log_times(buffer, offsets)
        wanted = (times >= self._begin) & (times < self._end)
        if not wanted.all():
            offsets, times = offsets[wanted], times[wanted]
        self._times.append(times)
        if (extract := _EXTRACTS.get(self._kind)) is None:
            self._data += messages(buffer, offsets)
        else:
            for group in self._grouped(buffer, offsets + DATA, sizes(buffer, offsets)):
                self._groups.append((group.rows + self._kept, *extract(group)))
        self._kept += len(offsets)

    def columns(self, decode: Callable[[Callable[[bytes], Any], bytes], Any]) -> Columns:
        """Everything that came, in the order of log times.

        Parameters
        ----------
        decode : called with a function that decodes a message and with the message, when it is looked at.
        """
        times = np.concatenate(self._times) if self._times else np.empty(0, np.int64)
        order = None if (np.diff(times) >= 0).all() else np.argsort(times, kind="stable")
        if self._kind not in _ASSEMBLE:
            one = Decoder(self._kind, self._definitions)
            data = self._data if order is None else [self._data[i] for i in order]
            return Messages(times if order is None else times[order], Decoded(data, lambda item: decode(one, item)))
        columns: Any = _ASSEMBLE[self._kind](times, self._groups)
        if order is None:
            return columns
        return type(columns)(*(column[order] if isinstance(column, np.ndarray) else column for column in columns))

    def _grouped(self, buffer: Bytes, starts: Offsets, sizes: Offsets) -> Iterator[_Group]:
        for size in [int(sizes[0])] if len(sizes) and (sizes == sizes[0]).all() else np.unique(sizes).tolist():
            rows = np.flatnonzero(sizes == size)
            words = _rows(buffer, starts[rows], size)
            tried = iter([known for known in self._known if known.size == size])
            while len(rows):
                known = next(tried, None)
                if known is None:
                    first = int(starts[rows[0]])
                    known = _Known.of(Layout(self._kind, self._definitions, buffer[first : first + size].tobytes()))
                    if len(self._known) < _MOST_LAYOUTS:
                        self._known.append(known)
                fits = known.fits(words)
                if fits is None:
                    yield _Group(rows, known.layout, words)
                    break
                if fits.any():
                    yield _Group(rows[fits], known.layout, words[fits])
                    rows, words = rows[~fits], words[~fits]


class _Known(NamedTuple):
    """A layout and how its messages are recognised: spans of words with the bits that must be equal."""

    size: int
    layout: Layout
    spans: list[tuple[int, int, NDArray[np.uint64], NDArray[np.uint64]]]

    @staticmethod
    def of(layout: Layout) -> "_Known":
        """What the messages of this layout have in common."""
        size = len(layout.fixed)
        width = 8 * _words(size)
        mask, want = np.zeros(width, np.uint8), np.zeros(width, np.uint8)
        mask[_BEFORE : _BEFORE + size][layout.fixed] = 255
        want[_BEFORE : _BEFORE + size] = np.frombuffer(layout.data, np.uint8)
        masks, wants = mask.view(np.uint64), (want & mask).view(np.uint64)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], masks != 0, [0]])))
        spans = [(a, b, masks[a:b], wants[a:b]) for a, b in edges.reshape(-1, 2).tolist()]
        return _Known(size, layout, spans)

    def fits(self, words: NDArray[np.uint64]) -> NDArray[np.bool_] | None:
        """Which rows are of this layout; None where all are."""
        wrong = [((words[:, a:b] & mask) != want) for a, b, mask, want in self.spans]
        if not any(each.any() for each in wrong):
            return None
        return ~np.logical_or.reduce([each.any(axis=1) for each in wrong])


def _words(size: int) -> int:
    return -(-(_BEFORE + size) // 8)


def _rows(buffer: Bytes, starts: Offsets, size: int) -> NDArray[np.uint64]:
    """Messages of one size, a row each, as words; numbers stand where words allow it."""
    width = 8 * _words(size)
    return at(buffer, starts - _BEFORE, f"V{width}").view(np.uint64).reshape(len(starts), -1)


def _joints(group: _Group) -> tuple[Any, ...]:
    fields = [group.numbers(name).astype(np.float64) for name in ("position", "velocity", "effort")]
    return group.time("header.stamp"), group.text("header.frame_id")[0], (group.text("name"), fields)


def _wrench(group: _Group) -> tuple[Any, ...]:
    values = np.hstack([group.vector("wrench.force"), group.vector("wrench.torque")])
    return group.time("header.stamp"), group.text("header.frame_id")[0], values


def _point(group: _Group) -> tuple[Any, ...]:
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
        array = np.full((len(times), len(names)), np.nan)
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


_EXTRACTS: dict[str, Callable[[_Group], tuple[Any, ...]]] = {
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
