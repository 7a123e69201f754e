"""Where the messages are in the records of a chunk, found in bulk."""

from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from wam_bag.arrays import Bytes, Index, Mask, Rows, Times
from wam_bag.errors import Damage
from wam_bag.mcap_records import FIRST_PRIVATE, HEAD, MESSAGE, walk

NEVER: Final = 2**63  # ns; later than every log time
DATA: Final = MESSAGE.size  # bytes of a message record before its data
TAIL: Final = 16  # bytes behind the records of a batch, so that a wide read of the last one stays inside
_HEADS: Final = np.dtype(  # first bytes of a message record
    [("opcode", "u1"), ("length", "<i8"), ("channel", "<u2"), ("sequence", "<u4"), ("log", "<i8"), ("publish", "<i8")]
)
_INDEX_HEAD: Final = HEAD.size + 6  # bytes of a message index record before its entries

Define = Callable[[int, bytes], None]
"""Takes the opcode and the content of a schema or channel record."""


class MessageBatch(NamedTuple):
    """Some records in memory, and the messages in them in the order of the file, (n,).

    Attributes
    ----------
    buffer : the records.
    channels : ids.
    offsets, sizes : where the record of each starts, and bytes of the message.
    times : of the log, ns.
    """

    buffer: Bytes
    channels: Rows
    offsets: Rows
    sizes: Rows
    times: Times

    def of(self, rows: Mask | Index) -> "MessageBatch":
        """Some of them."""
        return MessageBatch(self.buffer, *(column[rows] for column in self[1:]))

    def messages(self) -> list[bytes]:
        """The messages, serialized."""
        starts = self.offsets + DATA
        ends = starts + self.sizes
        return [self.buffer[start:end].tobytes() for start, end in zip(starts.tolist(), ends.tolist(), strict=True)]


def find(part: Bytes, index: bytes, define: Define, begin: int) -> Rows:
    """The messages among the records of a chunk: rows 1 to 4 of a batch, (4, n).

    Parameters
    ----------
    part : the records.
    index : message index records of the chunk, empty if there are none.  They make the search fast and need
        not be right: every byte of the chunk is accounted for.
    define : is called with each definition.
    begin : of the records in the buffer.
    """
    indexed = _indexed(part, index)
    data, walked = part[: indexed[0] if len(indexed) else len(part)].tobytes(), []
    for opcode, start, end in walk(data, 0, len(data)):
        if opcode == Opcode.MESSAGE:
            if end - start < DATA:
                raise Damage("a message record ends early")
            walked.append(start)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            define(opcode, data[start + HEAD.size : end])
        elif opcode < FIRST_PRIVATE:
            raise Damage(f"a record among messages has opcode {opcode}, which does not belong there")
    offsets = np.concatenate([np.array(walked, np.int64), indexed])
    heads = at(part, offsets, f"V{DATA}").view(_HEADS)
    channels, lengths, times = (heads[name].astype(np.int64) for name in ("channel", "length", "log"))
    if (times < 0).any():
        raise Damage(f"a message has the log time {times.min() % 2**64} ns")
    return np.stack([channels, offsets + begin, lengths - (DATA - HEAD.size), times])


def _indexed(part: Bytes, index: bytes) -> Rows:
    """Where the records start that an index names; none unless these are messages that fill all bytes to the end."""
    none = np.empty(0, np.int64)
    try:
        records = walk(index, 0, len(index))
        entries = [np.frombuffer(index[start + _INDEX_HEAD : end], "<i8")[1::2] for _, start, end in records]
    except (Damage, ValueError):
        return none
    offsets = np.sort(np.concatenate([none, *entries]))
    if not len(offsets) or offsets[0] < 0 or offsets[-1] > len(part) - DATA:
        return none
    heads = at(part, offsets, f"V{DATA}").view(_HEADS)
    are_messages = (heads["opcode"] == Opcode.MESSAGE).all() and (heads["length"] >= DATA - HEAD.size).all()
    follow = offsets + HEAD.size + heads["length"] == np.append(offsets[1:], len(part))
    return offsets if are_messages and follow.all() else none


def packed(messages: Sequence[tuple[int, int, bytes]]) -> MessageBatch:
    """A batch of messages: channel id, log time, ns, and data of each."""
    parts = [bytes(DATA) + data for *_, data in messages]  # without heads, which nobody reads
    sizes = np.array([len(data) for *_, data in messages], np.int64)
    channels, times = np.array([one[:2] for one in messages], np.int64).reshape(-1, 2).T
    buffer = np.frombuffer(b"".join([*parts, bytes(TAIL)]), np.uint8)
    return MessageBatch(buffer, channels, np.cumsum(sizes + DATA) - sizes - DATA, sizes, times)


def at(buffer: Bytes, offsets: Rows, dtype: str) -> NDArray[Any]:
    """Values of a type that start at these places of a buffer."""
    kind = np.dtype(dtype)
    view: NDArray[Any] = np.ndarray((max(len(buffer) - kind.itemsize + 1, 0),), kind, buffer, strides=(1,))
    return view[offsets]
