"""A figure as data: panels of lines of theory with points of the plant, and their distance; `style` draws it."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Numbers = NDArray[np.float64]
FEW = 130  # points, up to which each is drawn as a circle


class Series(NamedTuple):
    """A line, arrays (n,), and the points of the plant that should lie on it, (m,)."""

    x: Numbers
    y: Numbers
    plant_x: Numbers = np.zeros(0)
    plant_y: Numbers = np.zeros(0)

    @property
    def distance(self) -> float:
        """Greatest distance of a point from the line, relative to the line's extent in x and y.

        Normal to the line, because on a steep part a small error in x would be a large one in y.
        """
        spans = np.array([np.ptp(self.x), np.ptp(self.y)])
        line = np.transpose([self.x, self.y]) / spans
        return float(max(_distance(line, point) for point in np.transpose([self.plant_x, self.plant_y]) / spans))

    def relative_distance(self, is_logarithmic: bool) -> float:
        """Greatest relative difference of a point from the line at its x, which is interpolated on its axis."""
        plant_x, x = (np.log(self.plant_x), np.log(self.x)) if is_logarithmic else (self.plant_x, self.x)
        line = np.exp(np.interp(plant_x, x, np.log(self.y)))
        return float(np.abs(self.plant_y / line - 1.0).max())

    def scaled(self, x: float, y: float) -> "Series":
        """The series in other units: x and y times these factors."""
        return Series(x * self.x, y * self.y, x * self.plant_x, y * self.plant_y)


def _distance(line: Numbers, point: Numbers) -> float:
    """Of a point from a polyline with corners (n, 2)."""
    begin, along = line[:-1], np.diff(line, axis=0)
    lengths = np.maximum(np.sum(along**2, axis=1), 1e-300)
    fraction = np.clip(np.sum((point - begin) * along, axis=1) / lengths, 0.0, 1.0)
    return float(np.min(np.linalg.norm(begin + fraction[:, np.newaxis] * along - point, axis=1)))


Line = tuple[str, Series]  # with its label


class Mark(NamedTuple):
    """A point with a name; of a NaN coordinate a line across the panel."""

    text: str
    x: float = math.nan
    y: float = math.nan


class Panel(NamedTuple):
    """One pair of axes.

    Attributes
    ----------
    title, x, y : texts; a y axis without one has no numbers.
    lines : label and numbers of each line.
    logarithmic : of '', 'x', 'y', 'xy'.
    marks : what is named in it.
    limits : lowest and highest x and y that are shown; NaN for those of the lines.
    is_relative : whether a distance is one over the value of the line; so it is where y is logarithmic.
    """

    title: str
    x: str
    y: str
    lines: Sequence[Line]
    logarithmic: str = ""
    marks: tuple[Mark, ...] = ()
    limits: tuple[float, float, float, float] = (math.nan,) * 4
    is_relative: bool = False

    @property
    def distance(self) -> float:
        """Greatest distance of a point from its line, NaN without points."""
        measured = [series for _, series in self.lines if len(series.plant_x)]
        if "y" in self.logarithmic or self.is_relative:
            return max((s.relative_distance("x" in self.logarithmic) for s in measured), default=math.nan)
        return max((series.distance for series in measured), default=math.nan)

    def line(self, label: str) -> Series:
        """The line of a label."""
        return dict(self.lines)[label]


Panels = tuple[Panel, ...]


def distances(found: Panels) -> dict[str, float]:
    """Greatest distance of the plant from the lines of each panel that has points, by title."""
    return {panel.title: panel.distance for panel in found if not math.isnan(panel.distance)}


def line_only(x: ArrayLike, y: ArrayLike) -> Series:
    """A line without points."""
    return Series(np.asarray(x, dtype=float), np.asarray(y, dtype=float))


def measured(x: ArrayLike, y: ArrayLike) -> Series:
    """What was measured, without a line."""
    return Series(np.zeros(0), np.zeros(0), np.asarray(x, dtype=float), np.asarray(y, dtype=float))
