"""What an evaluation says: predicted against measured, row by row, with curves to look at."""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]


class Row(NamedTuple):
    """One quantity, predicted from the recorded parameters and measured in the bag.

    Attributes
    ----------
    bound : largest deviation that counts as agreement, as a share of the prediction; NaN where nothing is claimed.
        Words agree where they are equal.
    absolute : whether deviation and bound are in the quantity's own unit.
    """

    quantity: str
    predicted: float | str
    measured: float | str
    unit: str = ""
    bound: float = 0.0
    equation: str = ""
    absolute: bool = False

    @property
    def deviation(self) -> float:
        """Measured over predicted less one, or their difference; NaN for words."""
        if isinstance(self.predicted, str) or isinstance(self.measured, str):
            return math.nan
        difference = self.measured - self.predicted
        if self.absolute:
            return difference
        return difference / abs(self.predicted) if self.predicted else math.inf

    @property
    def agrees(self) -> bool:
        """Whether the bound is kept; a measurement that could not be made does not agree."""
        if math.isnan(self.bound):
            return True
        if isinstance(self.predicted, str) or isinstance(self.measured, str):
            return self.predicted == self.measured
        return abs(self.deviation) <= self.bound


class Curve(NamedTuple):
    """One line of a picture; `role` is predicted or measured."""

    role: str
    label: str
    x: Numbers
    y: Numbers


class Panel(NamedTuple):
    """One pair of axes."""

    title: str
    x: str
    y: str
    curves: Sequence[Curve]
    logarithmic: str = ""  # of '', 'x', 'y', 'xy'


class Result(NamedTuple):
    """What came out of an experiment."""

    rows: list[Row]
    panels: list[Panel]
    remarks: tuple[str, ...] = ()

    @property
    def agrees(self) -> bool:
        """Whether every bound is kept."""
        return all(row.agrees for row in self.rows)


HEAD = ("quantity", "predicted", "measured", "unit", "deviation", "bound", "equation", "")


def cells(row: Row) -> tuple[str, ...]:
    """The texts of a row, in the order of `HEAD`."""
    return (
        row.quantity,
        _value(row.predicted),
        _value(row.measured),
        row.unit,
        _deviation(row, row.deviation, "+"),
        _deviation(row, row.bound, ""),
        row.equation,
        "" if math.isnan(row.bound) else "ok" if row.agrees else "MISSED",
    )


def plain(rows: Iterable[Row]) -> str:
    """The rows as a table for a terminal."""
    lines = [HEAD, *map(cells, rows)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(HEAD))]
    left = (0, 3, 6, 7)
    return "\n".join(
        "  ".join(
            text.ljust(width) if i in left else text.rjust(width)
            for i, (text, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    )


def markdown(rows: Iterable[Row]) -> str:
    """The rows as a table of Markdown."""
    lines = [HEAD, ("---",) * len(HEAD), *map(cells, rows)]
    return "\n".join("| " + " | ".join(text.replace("|", "\\|") for text in line) + " |" for line in lines) + "\n"


def _value(value: float | str) -> str:
    return value if isinstance(value, str) else "-" if math.isnan(value) else f"{value:.4g}"


def _deviation(row: Row, value: float, sign: str) -> str:
    if math.isnan(value) or isinstance(row.predicted, str) or isinstance(row.measured, str):
        return ""
    return f"{value:{sign}.2g}" if row.absolute else f"{100.0 * value:{sign}.2f} %"
