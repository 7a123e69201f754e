"""What a study has measured: values with their 95 % intervals, compared with what is required and aimed at."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple, TypeVar

import numpy as np

from wam_analysis.table import markdown

Found = TypeVar("Found")  # what the rows of a group follow from
Bound = tuple[float, float]  # least and greatest allowed value
ANY: Final[Bound] = (-math.inf, math.inf)
NONE_AT_ALL: Final[Bound] = (0.0, 0.0)  # a count that must be zero
Z: Final = 1.96  # of a two-sided 95 % interval
RESAMPLED: Final = 400  # bootstrap samples
FEW: Final = "too few"
FEWEST: Final = 20  # observations, below which a verdict on an estimate, or on what never happens, is not certain
MET, TARGET_MET, MARGINAL, MISSED = "met", "**target met**", "met, marginal", "**MISSED**"
MISSED_MARGINAL, TARGET_MISSED = "**MISSED**, marginal", "target missed"


class Interval(NamedTuple):
    """A value, its 95 % interval and the number of observations.

    NaN without observations; an end of the interval is NaN if there are too few.
    """

    value: float
    low: float
    high: float
    observed: int


NONE: Final = Interval(math.nan, math.nan, math.nan, 0)


def exact(value: float, observed: int) -> Interval:
    """A value that is no estimate, as a largest error or a count."""
    return Interval(value, value, value, observed)


def share(hits: int, count: int) -> Interval:
    """Share of hits with its Wilson interval (1927)."""
    if count == 0:
        return NONE
    p, z2 = hits / count, Z * Z
    centre = (p + z2 / (2.0 * count)) / (1.0 + z2 / count)
    half = Z * math.sqrt(p * (1.0 - p) / count + z2 / (4.0 * count * count)) / (1.0 + z2 / count)
    # at its ends without the rounding
    return Interval(p, centre - half if hits else 0.0, centre + half if hits < count else 1.0, count)


def quantile(values: Sequence[float], level: float) -> Interval:
    """A quantile with its interval by order statistics; infinite values are the greatest."""
    n = len(values)
    if n == 0:
        return NONE
    ordered = sorted(values)
    half = Z * math.sqrt(n * level * (1.0 - level))
    ranks = (math.floor(n * level + side * half) for side in (-1.0, 1.0))
    low, high = (ordered[rank] if 0 <= rank < n else math.nan for rank in ranks)
    middle = n * level - 0.5
    lower, upper = (ordered[min(max(k, 0), n - 1)] for k in (math.floor(middle), math.ceil(middle)))
    value = lower if lower == upper else lower + (middle - math.floor(middle)) * (upper - lower)
    return Interval(value, low, high, n)


def rms(sums: Sequence[float], counts: Sequence[int]) -> Interval:
    """Root mean square of observations in correlated groups; the interval is a bootstrap over the groups.

    Parameters
    ----------
    sums : sum of squares of each group.
    counts : observations of each group.
    """
    total = sum(counts)
    if total == 0:
        return NONE
    squares, sizes = np.array(sums), np.array(counts, dtype=float)
    chosen = np.random.default_rng(0).integers(0, len(squares), (RESAMPLED, len(squares)))
    values = np.sqrt(squares[chosen].sum(axis=1) / np.maximum(sizes[chosen].sum(axis=1), 1.0))
    low, high = np.quantile(values, (0.025, 0.975)).tolist()
    return Interval(math.sqrt(float(squares.sum()) / total), low, high, total)


def events(count: int, seconds: float) -> Interval:
    """Number of events in a time, s, with its Poisson interval (Byar's approximation)."""
    if seconds <= 0.0:
        return NONE
    low = count * (1.0 - 1.0 / (9.0 * count) - Z / (3.0 * math.sqrt(count))) ** 3 if count else 0.0
    more = count + 1
    high = more * (1.0 - 1.0 / (9.0 * more) + Z / (3.0 * math.sqrt(more))) ** 3
    return Interval(float(count), low, high, round(seconds))


class Row(NamedTuple):
    """A quantity of the table.

    Attributes
    ----------
    name : of the quantity, with what it is of.
    found : in SI.
    unit, scale : as text; of the value in that unit.
    required, target : allowed values in SI; ANY for none.
    enough : observations from which none of what must not happen counts as required and as the target.
    """

    name: str
    found: Interval
    unit: str = ""
    scale: float = 1.0
    required: Bound = ANY
    target: Bound = ANY
    enough: tuple[float, float] = (0.0, 0.0)

    @property
    def is_bounded(self) -> bool:
        """Whether something is required, or aimed at."""
        return (self.required, self.target) != (ANY, ANY)

    @property
    def mark(self) -> str:
        """Comparison with the required and the target values, '' without any."""
        found, required, target = self.found, self.required, self.target
        if not self.is_bounded:
            return ""
        if math.isnan(found.value):
            return "no data"
        counts = required == NONE_AT_ALL  # the interval of a count never is zero
        least, least_for_target = self.enough
        if (counts and found.value == 0.0 and found.observed < least) or math.isnan(found.low + found.high):
            return FEW
        if target != ANY and holds(found.value, target) and not (counts and found.observed < least_for_target):
            return TARGET_MET
        if required == ANY:
            return TARGET_MISSED
        if not holds(found.value, required):
            low, high = required
            return MISSED if counts or found.high < low or found.low > high else MISSED_MARGINAL
        return MET if counts or (holds(found.low, required) and holds(found.high, required)) else MARGINAL

    @property
    def is_missed(self) -> bool:
        """Whether the required value is missed."""
        return self.mark in (MISSED, MISSED_MARGINAL)

    @property
    def verdict(self) -> str:
        """The mark; with a remark on few observations, unless the value is that of the cases themselves.

        A largest error is that of its cases, however few they are; an estimate, and that something never happens, need
        more.
        """
        mark, found = self.mark, self.found
        needs_more = found.low != found.high or self.required == NONE_AT_ALL
        is_few = mark and needs_more and found.observed < FEWEST and FEW not in mark
        return f"{mark} (n={found.observed}: {FEW})" if is_few else mark

    @property
    def cells(self) -> list[str]:
        """Value, 95 % interval, number of observations and verdict as text."""
        low, high = number(self.found.low, self.scale), number(self.found.high, self.scale)
        span = "" if self.found.low == self.found.high else f"{low} to {high}"
        return [number(self.found.value, self.scale), span, str(self.found.observed), self.verdict]


def percent(name: str, found: Interval, required: Bound = ANY, target: Bound = ANY) -> Row:
    """A row of a share in percent."""
    return Row(name, found, "%", 100.0, required, target)


def named(rows: Iterable[Row], addition: str) -> Iterator[Row]:
    """Rows with what they are of added to their names."""
    return (row._replace(name=f"{row.name}, {addition}") for row in rows)


class ScoreTable(NamedTuple):
    """A table: its title, the cells of its head and rows, what a reader has to know, and whether pages have it."""

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    is_in_page: bool = False

    def text(self) -> str:
        """The table in Markdown, with its title."""
        parts = [f"## {self.title}", self.note, markdown(self.head, self.rows)]
        return "\n\n".join(filter(None, parts))


def grouped(records: Iterable[Found], key: Callable[[Found], str]) -> dict[str, list[Found]]:
    """Records by a text, in the order in which these come first."""
    found: dict[str, list[Found]] = {}
    for one in records:
        found.setdefault(key(one), []).append(one)
    return found


def by_group(
    title: str, groups: Mapping[str, Found], rows: Callable[[Found], Iterable[Row]], note: str = ""
) -> ScoreTable:
    """A line of each quantity with its number of observations, a column of each group."""
    lines = []
    for first, *others in zip(*map(rows, groups.values()), strict=True):
        cells = [f"{row.cells[0]} ({row.found.observed})" for row in (first, *others)]
        lines.append([first.name + f" [{first.unit}]" * bool(first.unit), *cells])
    return ScoreTable(title, ["quantity (observations)", *groups], lines, note)


class Scores(NamedTuple):
    """What follows from the records of a study.

    Attributes
    ----------
    rows : what is required, and other quantities.
    tables : further tables.
    """

    rows: Sequence[Row]
    tables: Sequence[ScoreTable] = ()

    @property
    def missed(self) -> list[str]:
        """Each quantity whose required value is missed, with its value."""
        return [
            f"{row.name}: {row.cells[0]} {row.unit}".rstrip() + f", required {bound_text(row.required, row.scale)}"
            for row in self.rows
            if row.is_missed
        ]


def rows_table(rows: Sequence[Row], by_seed: Mapping[int, Sequence[Row]] = {}) -> str:
    """Quantities by row in Markdown: a column for each seed, then all seeds; rows that have nothing are left out.

    Parameters
    ----------
    rows : of all seeds.
    by_seed : the same of each; no columns of its own where there is one seed.
    """
    seeds = list(by_seed) if len(by_seed) > 1 else []
    single = {(seed, row.name): number(row.found.value, row.scale) for seed in seeds for row in by_seed[seed]}
    of_all = ["all seeds" if seeds else "value", "95 % interval", "n", ""]
    head = ["quantity", "unit", "required", "target", *(f"seed {seed}" for seed in seeds), *of_all]
    lines = []
    for row in rows:
        if row.found.observed or row.is_bounded:
            bounds = [bound_text(row.required, row.scale), bound_text(row.target, row.scale)]
            of_seeds = [single.get((seed, row.name), "–") for seed in seeds]
            lines.append([row.name, row.unit, *bounds, *of_seeds, *row.cells])
    return markdown(head, lines)


def holds(value: float, bound: Bound) -> bool:
    """Whether a value is allowed, apart from rounding."""
    low, high = bound
    return low - 1e-12 <= value <= high + 1e-12


def number(value: float, scale: float) -> str:
    """A measured value as text; none is infinite or could not be measured."""
    if math.isnan(value):
        return "–"
    return "none" if math.isinf(value) else f"{scale * value:.3g}"


def bound_text(bound: Bound, scale: float) -> str:
    """Allowed values as text, '' for any."""
    low, high = (f"{scale * end:.3g}" for end in bound)
    if bound == ANY:
        return ""
    if bound[0] <= 0.0:
        return f"≤{high}" if bound[1] > 0.0 else high
    return f"≥{low}" if bound[1] in (1.0, math.inf) else f"{low} to {high}"
