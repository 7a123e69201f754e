"""Messages of one layout decoded together: their numbers as columns, and many objects made at once."""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple, overload

import numpy as np
from numpy.typing import NDArray

from wam_bag.cdr import ENCAPSULATION, Decoder, Definitions, Layout
from wam_bag.errors import BagError, Damage
from wam_bag.limits import READING_LIMITS
from wam_bag.mcap_records import Bytes
from wam_bag.message_search import Offsets, at
from wam_bag.message_text import PRIMITIVES

Index = NDArray[np.intp]
Words = NDArray[np.uint64]
Times = NDArray[np.int64]
Numbers = NDArray[np.float64]

BEFORE: Final = 8 - ENCAPSULATION  # bytes before a message that align its numbers to multiples of eight


class Group(NamedTuple):
    """Messages of one layout: which of all they are, and their bytes, one row each."""

    rows: Index
    layout: Layout
    words: Words

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

    def objects(self, decoder: Decoder, kind: str, path: str = "") -> list[Any]:
        """The messages as a `Decoder` makes them, or their parts at a path, of this type."""
        columns = [
            self._values(decoder, f"{path}.{name}" if path else name, inner, length)
            for name, inner, length in decoder.definitions[kind]
        ]
        return list(map(decoder.maker(kind), zip(*columns, strict=True) if columns else [()] * len(self.rows)))

    def _values(self, decoder: Decoder, path: str, kind: str, length: int | None) -> list[Any]:
        if kind == "string":
            texts = self.layout.texts[path]
            return [texts[0] if length is None else list(texts) for _ in self.rows]
        if kind in PRIMITIVES:
            numbers = self.numbers(path)
            if length is not None:
                return list(numbers.copy())
            return (numbers[:, 0] != 0 if kind == "bool" else numbers[:, 0]).tolist()
        if length is None:
            return self.objects(decoder, kind, path)
        items = [self.objects(decoder, kind, f"{path}[{i}]") for i in range(self.layout.counts[path])]
        return list(map(list, zip(*items, strict=True))) if items else [[] for _ in self.rows]


class Known(NamedTuple):
    """A layout and how its messages are recognised: spans of words with the bits that must be equal."""

    size: int
    layout: Layout
    spans: list[tuple[int, int, Words, Words]]

    @staticmethod
    def of(layout: Layout) -> "Known":
        """What the messages of this layout have in common."""
        size = len(layout.fixed)
        width = 8 * _words(size)
        mask, want = np.zeros(width, np.uint8), np.zeros(width, np.uint8)
        mask[BEFORE : BEFORE + size][layout.fixed] = 255
        want[BEFORE : BEFORE + size] = np.frombuffer(layout.data, np.uint8)
        masks, wants = mask.view(np.uint64), (want & mask).view(np.uint64)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], masks != 0, [0]])))
        spans = [(a, b, masks[a:b], wants[a:b]) for a, b in edges.reshape(-1, 2).tolist()]
        return Known(size, layout, spans)

    def fits(self, words: Words) -> NDArray[np.bool_] | None:
        """Which rows are of this layout; None if all are."""
        wrong = [((words[:, a:b] & mask) != want) for a, b, mask, want in self.spans]
        if not any(each.any() for each in wrong):
            return None
        return ~np.logical_or.reduce([each.any(axis=1) for each in wrong])


class Grouping:
    """Puts messages of one type into groups; keeps the layouts it has found.

    Parameters
    ----------
    kind : ``package/msg/Type``.
    definitions : fields of it and of the types it consists of.
    """

    def __init__(self, kind: str, definitions: Definitions) -> None:
        self._kind, self._definitions = kind, definitions
        self._known: list[Known] = []

    def __call__(self, buffer: Bytes, starts: Offsets, sizes: Offsets) -> Iterator[Group]:
        """Groups of the messages that begin at these places of a buffer and have these sizes."""
        for size in [int(sizes[0])] if len(sizes) and (sizes == sizes[0]).all() else np.unique(sizes).tolist():
            rows = np.flatnonzero(sizes == size)
            words = at(buffer, starts[rows] - BEFORE, f"V{8 * _words(size)}").view(np.uint64).reshape(len(rows), -1)
            tried = iter([known for known in self._known if known.size == size])
            while len(rows):
                known = next(tried, None)
                if known is None:
                    first = int(starts[rows[0]])
                    known = Known.of(Layout(self._kind, self._definitions, buffer[first : first + size].tobytes()))
                    if len(self._known) < READING_LIMITS.layouts:
                        self._known.append(known)
                fits = known.fits(words)
                if fits is None:
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
    decoder : makes objects of them.
    label : their origin, for errors.
    """

    def __init__(self, data: list[bytes], decoder: Decoder, label: str) -> None:
        self._data, self._decoder, self._label = data, decoder, label
        self._made: list[Any] | None = None

    def __len__(self) -> int:
        return len(self._data)

    @overload
    def __getitem__(self, index: int) -> Any: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Any]: ...
    def __getitem__(self, index: int | slice) -> Any:
        if self._made is None:
            try:
                self._made = decoded(self._data, self._decoder)
            except Damage as error:
                raise BagError(f"{self._label}: {error}; copy the bag again") from None
        return self._made[index]


def decoded(data: list[bytes], decoder: Decoder) -> list[Any]:
    """Messages as objects: those of one layout together, the others one by one."""
    made: list[Any] = [None] * len(data)
    single = set(range(len(data)))
    for size, number in Counter(map(len, data)).items():
        if number < READING_LIMITS.group or size < ENCAPSULATION:
            continue
        rows = np.array([i for i, item in enumerate(data) if len(item) == size])
        padded = np.zeros((number, 8 * _words(size)), np.uint8)
        joined = np.frombuffer(b"".join([data[i] for i in rows]), np.uint8)
        padded[:, BEFORE : BEFORE + size] = joined.reshape(number, size)
        words = padded.view(np.uint64)
        for _ in range(READING_LIMITS.trials):
            layout = Layout(decoder.kind, decoder.definitions, data[rows[0]])
            fits = Known.of(layout).fits(words)
            chosen = slice(None) if fits is None else fits
            group = Group(rows[chosen], layout, words[chosen])
            if len(group.rows) < READING_LIMITS.group:
                break
            for i, message in zip(group.rows.tolist(), group.objects(decoder, decoder.kind), strict=True):
                made[i] = message
            single.difference_update(group.rows.tolist())
            if fits is None or len(rows) - len(group.rows) < READING_LIMITS.group:
                break
            rows, words = rows[~fits], words[~fits]
    for i in sorted(single):
        made[i] = decoder(data[i])
    return made


def _words(size: int) -> int:
    return -(-(BEFORE + size) // 8)
