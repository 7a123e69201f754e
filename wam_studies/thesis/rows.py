"""The result of an evaluation: predicted and measured quantities, and curves."""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple, SupportsFloat

from wam_analysis import table
from wam_analysis.findings.finding import Finding, titled
from wam_studies.figures.panels import Panel
from wam_studies.thesis.bounds import BOUNDS


class Comparison(NamedTuple):
    """One quantity, predicted from the recorded parameters and measured in the bag.

    Attributes
    ----------
    bound : largest deviation of agreement, relative to the prediction; NaN without a claim.  Texts agree if equal.
    absolute : whether deviation and bound are in the quantity's unit.
    """

    quantity: str
    predicted: float | str
    measured: float | str
    unit: str = ""
    bound: float = 0.0
    equation: str = ""
    absolute: bool = False

    @property
    def title(self) -> str:
        """Of its column: the quantity with its unit."""
        return titled(self.quantity, self.unit)

    @property
    def deviation(self) -> float:
        """Relative deviation from the prediction, or the difference if absolute; NaN for texts."""
        if isinstance(self.predicted, str) or isinstance(self.measured, str):
            return math.nan
        difference = self.measured - self.predicted
        if self.absolute:
            return difference
        return difference / abs(self.predicted) if self.predicted else math.inf

    @property
    def is_claimed(self) -> bool:
        """Whether the quantity has to agree."""
        return not math.isnan(self.bound)

    @property
    def agrees(self) -> bool:
        """Whether the deviation is within its bound; a missing measurement does not agree."""
        if not self.is_claimed:
            return True
        if isinstance(self.predicted, str) or isinstance(self.measured, str):
            return self.predicted == self.measured
        return abs(self.deviation) <= self.bound

    @property
    def nearness(self) -> float:
        """Deviation per bound: 1 at the bound, -1 without a claim or for texts that agree."""
        if not self.agrees:
            return math.inf
        return abs(self.deviation) / self.bound if self.bound > 0.0 and self.deviation == self.deviation else -1.0


def near(
    quantity: str,
    predicted: SupportsFloat,
    measured: SupportsFloat,
    unit: str,
    equation: str = "",
    within: float = BOUNDS.within,
) -> Comparison:
    """A measured number that is near the predicted one, relative to it."""
    return Comparison(quantity, float(predicted), float(measured), unit, within, equation)


def below(quantity: str, measured: SupportsFloat, unit: str, most: float, equation: str = "") -> Comparison:
    """A measured number that should be zero, and is at most another one in its unit."""
    return Comparison(quantity, 0.0, float(measured), unit, most, equation, True)


def noted(quantity: str, measured: SupportsFloat, unit: str) -> Comparison:
    """A measured number of which nothing is claimed."""
    return Comparison(quantity, math.nan, float(measured), unit, math.nan)


def of_finding(found: Finding) -> Comparison:
    """A number of an analysis; one that is only a bound was not measured, and nothing is claimed of what was not."""
    measured = math.nan if found.is_lower_bound else found.measured
    bound = math.nan if math.isnan(measured) else found.bound
    return Comparison(found.name, found.predicted, measured, found.unit, bound, absolute=True)


class Result(NamedTuple):
    """Result of an experiment; `reported` is what the stack reported in its runs."""

    rows: Sequence[Comparison]
    panels: Sequence[Panel]
    remarks: tuple[str, ...] = ()
    reported: tuple[str, ...] = ()

    @property
    def agrees(self) -> bool:
        """Whether every quantity is within its bound."""
        return all(row.agrees for row in self.rows)


NOTHING = "-"  # no prediction
PAGE_HEAD = ("quantity", "predicted", "measured", "deviation", "bound")
HEAD = ("quantity", "predicted", "measured", "unit", "deviation", "bound", "equation", "")


def cells(row: Comparison) -> tuple[str, ...]:
    """The texts of a row, in the order of `HEAD`."""
    return (
        row.quantity,
        value_text(row.predicted),
        value_text(row.measured),
        row.unit,
        _deviation(row, row.deviation, "+"),
        _deviation(row, row.bound, ""),
        row.equation,
        "" if not row.is_claimed else "ok" if row.agrees else "MISSED",
    )


def plain(rows: Iterable[Comparison]) -> str:
    """The rows as a table for a terminal."""
    return "\n".join(table.plain([HEAD], [cells(row) for row in rows], left=(0, 3, 6, 7)))


def markdown(rows: Iterable[Comparison]) -> str:
    """The rows that have a prediction as a table of Markdown."""
    return table.markdown(PAGE_HEAD, [_page_cells(row) for row in rows if value_text(row.predicted) != NOTHING])


def _page_cells(row: Comparison) -> tuple[str, ...]:
    """The texts of a row in the order of `PAGE_HEAD`."""
    quantity, predicted, measured, unit, deviation, bound, _, verdict = cells(row)
    name = f"{quantity}, {unit}" if unit else quantity
    return name, predicted, measured, deviation, f"{bound} MISSED" if verdict == "MISSED" else bound


def summary(rows: Sequence[Comparison]) -> tuple[str, ...]:
    """How many rows agree, and the cells of the row that is nearest to its bound, in the order of `PAGE_HEAD`."""
    claimed = [row for row in rows if row.is_claimed]
    agreeing = sum(row.agrees for row in claimed)
    verdict = f"{agreeing} of {len(claimed)}" + (" MISSED" if agreeing < len(claimed) else "")
    nearest = max(claimed, key=lambda row: row.nearness, default=None)
    return verdict, *(_page_cells(nearest) if nearest else (NOTHING,) * len(PAGE_HEAD))


def value_text(value: float | str) -> str:
    """A cell of a table."""
    return value if isinstance(value, str) else NOTHING if math.isnan(value) else f"{value:.4g}"


def _deviation(row: Comparison, value: float, sign: str) -> str:
    if math.isnan(value) or isinstance(row.predicted, str) or isinstance(row.measured, str):
        return ""
    return f"{value:{sign}.2g}" if row.absolute else f"{100.0 * value:{sign}.2f} %"
