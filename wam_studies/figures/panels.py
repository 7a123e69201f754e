"""A figure as data: panels of lines with points of the plant, one function that draws them all."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from wam_studies.figures.series import Series
from wam_studies.figures.style import SHADES, legend, picture, theory_and_plant


class ThesisPanel(NamedTuple):
    """One pair of axes.

    Attributes
    ----------
    title, x, y : texts.
    lines : label and numbers of each line; NaN or no points where nothing was measured.
    logarithmic : of '', 'x', 'y', 'xy'.
    """

    title: str
    x: str
    y: str
    lines: tuple[tuple[str, Series], ...]
    logarithmic: str = ""

    @property
    def distance(self) -> float:
        """Greatest distance of a point from its line; relative to the line's value where y is logarithmic."""
        measured = [series for _, series in self.lines if len(series.plant_x)]
        return max(_relative(s) if "y" in self.logarithmic else s.distance for s in measured)


def _relative(series: Series) -> float:
    line = np.exp(np.interp(series.plant_x, series.x, np.log(series.y)))
    return float(np.abs(series.plant_y / line - 1.0).max())


Panels = tuple[ThesisPanel, ...]


def distances(panels: Panels) -> dict[str, float]:
    """Greatest distance of the plant from the lines of each panel that has points, by title."""
    shown = [panel for panel in panels if any(len(series.plant_x) for _, series in panel.lines)]
    return {panel.title: panel.distance for panel in shown}


def line_only(x: object, y: object) -> Series:
    """A line without points."""
    none = np.zeros(0)
    return Series(np.asarray(x, dtype=float), np.asarray(y, dtype=float), none, none)


def draw_panels(panels: Panels, file: Path) -> None:
    """Draw the panels in a row."""
    with picture(file, 3.7 * len(panels), 3.0) as figure:
        for axes, panel in zip(np.atleast_1d(figure.subplots(1, len(panels))), panels, strict=True):
            for (label, series), colour in zip(panel.lines, SHADES[1:] + SHADES[:1], strict=False):
                theory_and_plant(axes, series, colour, label)
            axes.set(title=panel.title, xlabel=panel.x, ylabel=panel.y)
            axes.set_xscale("log" if "x" in panel.logarithmic else "linear")
            axes.set_yscale("log" if "y" in panel.logarithmic else "linear")
            legend(axes)
