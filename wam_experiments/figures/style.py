"""Style of the figures: theory as lines, the plant as points."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from wam_experiments.figures.series import Series

BLUE, ORANGE, GREEN, GREY = "#0072b2", "#d55e00", "#009e73", "#777777"  # distinguishable with colour blindness
SHADES = ("#08306b", "#0072b2", "#009e73", "#e69f00", "#cc79a7")
DPI = 200
_STYLE: Any = {
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "lines.linewidth": 1.4,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
}


_PLAIN: Any = {"font.size": 9, "axes.spines.top": False, "axes.spines.right": False, "axes.titlesize": 9}


@contextmanager
def picture(file: Path, width: float, height: float) -> Iterator[Figure]:
    """A figure of this size, inches, which is written to the file at the end."""
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(figure)
        yield figure
        figure.savefig(file, dpi=DPI)


@contextmanager
def panels(
    file: Path, rows: int, columns: int, width: float, height: float, dpi: float = 110
) -> Iterator[tuple[Figure, list[Axes]]]:
    """A plain figure of this size, inches, with its axes row by row, which is written to the file at the end."""
    with mpl.rc_context(_PLAIN):
        figure = Figure(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(figure)
        yield figure, list(figure.subplots(rows, columns, squeeze=False).ravel())
        figure.savefig(file, dpi=dpi)


def theory_and_plant(axes: Axes, series: Series, colour: str = BLUE, label: str = "theory") -> None:
    """Draw the line and its points."""
    axes.plot(series.x, series.y, color=colour, label=label)
    plant(axes, series)


def plant(axes: Axes, series: Series) -> None:
    """Draw the points only."""
    axes.plot(series.plant_x, series.plant_y, "o", color=ORANGE, markersize=3.4, mfc="none", mew=0.9, label="plant")


def legend(axes: Axes, **where: Any) -> None:
    """The legend, each label once."""
    handles, labels = axes.get_legend_handles_labels()
    once = dict(sorted(zip(labels, handles, strict=True), key=lambda entry: entry[0] == "plant"))
    axes.legend(list(once.values()), list(once), **where)
