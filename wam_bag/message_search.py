"""Where the messages are in the records of a chunk, found in bulk."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from wam_bag.arrays import Bytes, Rows, Times
from wam_bag.errors import Damage
from wam_bag.mcap_records import FIRST_PRIVATE, HEAD, walk

NEVER: Final = 2**63  # ns; later than every log time
DATA: Final = HEAD.size + 22  # bytes of a message record before its data: head, channel, sequence, two times
_HEADS: Final = np.dtype([("opcode", "u1"), ("length", "<i8"), ("channel", "<u2")])  # first bytes of a message record
_INDEX_HEAD: Final = HEAD.size + 6  # bytes of a message index record before its entries

Define = Callable[[int, bytes], None]
"""Takes the opcode and the content of a schema or channel record."""


class Found(NamedTuple):
    """Messages in a buffer in the order of the file: where their records start, and the bytes of each message."""

    offsets: Rows
    sizes: Rows


class MessageBatch(NamedTuple):
    """Some records in memory, valid until the next batch is taken, and the messages in them by channel id."""

    buffer: Bytes
    found: dict[int, Found]


def find(part: Bytes, index: bytes, define: Define, begin: int) -> dict[int, Found]:
    """The messages among the records of a chunk, by channel id.

    Parameters
    ----------
    part : the records.
    index : message index records of the chunk, empty if there are none.  They make the search fast and need
        not be right: every byte of the chunk is accounted for.
    define : is called with each definition.
    begin : of the records in the buffer.
    """
    found = _by_index(part, index, define, begin) if index else None
    return _by_walking(part.tobytes(), define, begin) if found is None else found


def _by_index(part: Bytes, index: bytes, define: Define, begin: int) -> dict[int, Found] | None:
    """Messages that the index names, if they are distinct and fill all bytes behind the definitions, else None."""
    start, size = 0, len(part)
    while start + HEAD.size <= size and part[start] in (Opcode.SCHEMA, Opcode.CHANNEL):
        opcode, length = HEAD.unpack_from(part.data, start)
        content = start + HEAD.size
        if (end := content + length) > size:
            return None
        define(opcode, part[content:end].tobytes())
        start = end
    entries: dict[int, Rows] = {}
    try:
        for opcode, record, end in walk(index, 0, len(index)):
            first = record + _INDEX_HEAD
            if opcode != Opcode.MESSAGE_INDEX or end < first or (end - first) % 16:
                return None
            channel = int.from_bytes(index[first - 6 : first - 4], "little")
            if channel in entries:
                return None
            if end > first:
                entries[channel] = np.frombuffer(index[first:end], "<i8")[1::2]
    except Damage:
        return None
    if not entries:
        return None
    offsets = np.concatenate(list(entries.values()))
    counts = [len(some) for some in entries.values()]
    ends = np.cumsum(counts)
    is_rising = np.diff(offsets) > 0
    is_rising[ends[:-1] - 1] = True
    if not is_rising.all() or offsets.min() < start or offsets.max() > size - DATA:
        return None
    heads = at(part, offsets, f"V{_HEADS.itemsize}").view(_HEADS)
    sizes = heads["length"] - (DATA - HEAD.size)
    is_whole = (
        (heads["opcode"] == Opcode.MESSAGE).all()
        and (heads["channel"] == np.repeat([*entries], counts)).all()
        and sizes.min() >= 0
        and sizes.max() <= size
        and int(sizes.sum()) + DATA * len(offsets) == size - start
    )
    if not is_whole:
        return None
    rows = zip(entries, pairwise([0, *ends.tolist()]), strict=True)
    offsets = offsets + begin
    return {channel: Found(offsets[first:end], sizes[first:end]) for channel, (first, end) in rows}


def _by_walking(data: bytes, define: Define, begin: int) -> dict[int, Found]:
    places: dict[int, list[tuple[int, int]]] = {}
    for opcode, start, end in walk(data, 0, len(data)):
        if opcode == Opcode.MESSAGE:
            if end - start < DATA:
                raise Damage("a message record ends early")
            channel = int.from_bytes(data[start + HEAD.size : start + HEAD.size + 2], "little")
            places.setdefault(channel, []).append((begin + start, end - start - DATA))
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            define(opcode, data[start + HEAD.size : end])
        elif opcode < FIRST_PRIVATE:
            raise Damage(f"a record among messages has opcode {opcode}, which does not belong there")
    return {channel: Found(*np.array(found, np.int64).T) for channel, found in places.items()}


def at(buffer: Bytes, offsets: Rows, dtype: str) -> NDArray[Any]:
    """Values of a type that start at these places of a buffer."""
    kind = np.dtype(dtype)
    view: NDArray[Any] = np.ndarray((max(len(buffer) - kind.itemsize + 1, 0),), kind, buffer, strides=(1,))
    return view[offsets]


def log_times(buffer: Bytes, found: Found) -> Times:
    """Log times of messages, ns."""
    times = at(buffer, found.offsets + 15, "<u8")
    if (times >= NEVER).any():
        raise Damage(f"a message has the log time {times.max()} ns")
    return times.astype(np.int64)


def together(found: Sequence[Found]) -> Found:
    """Several one after the other."""
    if len(found) == 1:
        return found[0]
    return Found(np.concatenate([part.offsets for part in found]), np.concatenate([part.sizes for part in found]))


def messages(buffer: Bytes, found: Found) -> list[bytes]:
    """The messages, serialized."""
    starts = found.offsets + DATA
    ends = starts + found.sizes
    return [buffer[start:end].tobytes() for start, end in zip(starts.tolist(), ends.tolist(), strict=True)]
