"""Messages of one layout decoded together: their numbers as columns; others as objects."""

from collections.abc import Callable, Iterator, Sequence
from operator import attrgetter
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_bag.arrays import Bytes, Index, Mask, Numbers, Rows, Times
from wam_bag.cdr import ENCAPSULATION, Decoder, Reading
from wam_bag.errors import BagError, Damage
from wam_bag.limits import READING_LIMITS
from wam_bag.message_search import at

Words = NDArray[np.uint64]

BEFORE: Final = 8 - ENCAPSULATION  # bytes before a message that align its numbers to multiples of eight


class Group(NamedTuple):
    """Messages of one layout: which of all they are, and their bytes, one row each."""

    rows: Index
    layout: Reading
    words: Words

    def numbers(self, path: str) -> NDArray[Any]:
        """Numbers of each message at a path, (m, n)."""
        try:
            leaf = self.layout.numbers_at[f".{path}"]
        except KeyError:
            raise Damage(f"its type has no numbers '{path}'") from None
        size = leaf.dtype.itemsize * (1 if leaf.length is None else leaf.length)
        begin = 8 + leaf.offset
        return self.words.view(np.uint8)[:, begin : begin + size].view(leaf.dtype)

    def value(self, path: str) -> Any:
        """What every message has at a path: strings, or a number that is no stamp."""
        try:
            return attrgetter(path)(self.layout.message)
        except AttributeError:
            raise Damage(f"its type has no field '{path}'") from None

    def time(self, path: str) -> Times:
        """Time at a path, ns, (m,)."""
        seconds = self.numbers(f"{path}.sec")[:, 0].astype(np.int64)
        return np.asarray(seconds * 1_000_000_000 + self.numbers(f"{path}.nanosec")[:, 0])

    def vector(self, path: str) -> Numbers:
        """x, y and z at a path, (m, 3)."""
        return np.hstack([self.numbers(f"{path}.{axis}") for axis in "xyz"])


class Known(NamedTuple):
    """A layout and how its messages are recognised: the bits of their words that must be equal, and their values."""

    size: int
    layout: Reading
    mask: Words
    want: Words

    @staticmethod
    def of(layout: Reading) -> "Known":
        """What the messages of this layout have in common: byte order, counts, strings, and integers but stamps."""
        size = len(layout.data)
        width = 8 * _words(size)
        mask, want = np.zeros(width, np.uint8), np.zeros(width, np.uint8)
        fixed = [(0, 2), *((place, place + 4) for place, _ in layout.counts_at), *layout.texts_at]
        for path, (offset, dtype, length) in layout.numbers_at.items():
            if dtype.kind in "iu" and length is None and ".stamp." not in path:
                fixed.append((ENCAPSULATION + offset, ENCAPSULATION + offset + dtype.itemsize))
        for start, end in fixed:
            mask[BEFORE + start : BEFORE + end] = 255
        want[BEFORE : BEFORE + size] = np.frombuffer(layout.data, np.uint8)
        return Known(size, layout, mask.view(np.uint64), (want & mask).view(np.uint64))

    def fits(self, words: Words) -> Mask:
        """Which rows are of this layout."""
        return ((words & self.mask) == self.want).all(axis=1)


class Grouping:
    """Puts messages of one type into groups; keeps the layouts it has found.

    Parameters
    ----------
    decoder : of this type.
    """

    def __init__(self, decoder: Decoder) -> None:
        self._decoder = decoder
        self._known: list[Known] = []

    def __call__(self, buffer: Bytes, starts: Rows, sizes: Rows) -> Iterator[Group]:
        """Groups of the messages that begin at these places of a buffer and have these sizes."""
        for size in np.unique(sizes).tolist():
            rows = np.flatnonzero(sizes == size)
            words = at(buffer, starts[rows] - BEFORE, f"V{8 * _words(size)}").view(np.uint64).reshape(len(rows), -1)
            tried = iter([known for known in self._known if known.size == size])
            while len(rows):
                known = next(tried, None)
                if known is None:
                    first = int(starts[rows[0]])
                    known = Known.of(self._decoder.read(buffer[first : first + size].tobytes()))
                    if len(self._known) < READING_LIMITS.layouts:
                        self._known.append(known)
                fits = known.fits(words)
                if fits.all():
                    yield Group(rows, known.layout, words)
                    break
                if fits.any():
                    yield Group(rows[fits], known.layout, words[fits])
                    rows, words = rows[~fits], words[~fits]


class Decoded(Sequence[Any]):
    """Messages as objects, all made at the first access to one.

    Parameters
    ----------
    data : serialized messages.
    decode : makes an object of one.
    label : their origin, for errors.
    """

    def __init__(self, data: list[bytes], decode: Callable[[bytes], Any], label: str) -> None:
        self._data, self._decode, self._label = data, decode, label
        self._made: list[Any] | None = None

    def __len__(self) -> int:
        return len(self._data)

    def __getitem__(self, index: Any) -> Any:
        if self._made is None:
            try:
                self._made = [self._decode(data) for data in self._data]
            except Damage as error:
                raise BagError(f"{self._label}: {error}; copy the bag again") from None
        return self._made[index]


def _words(size: int) -> int:
    return -(-(BEFORE + size) // 8)
