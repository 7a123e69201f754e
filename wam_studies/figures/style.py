"""Style of the figures: theory as lines, the plant as points."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from wam_analysis.drawing import PREDICTED, SHAFTS, STYLE, TRUE, WRONG
from wam_studies.figures.series import Series

THEORY, GREY, SECOND, UNSTABLE = PREDICTED, "#777777", SHAFTS[0], WRONG
SHADES = SHAFTS[:5]
DPI = 200


@contextmanager
def picture(file: Path, width: float, height: float) -> Iterator[Figure]:
    """A figure of this size, inches, which is written to the file at the end."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(figure)
        yield figure
        figure.savefig(file, dpi=DPI)


@contextmanager
def panels(
    file: Path, rows: int, columns: int, width: float, height: float, dpi: float = DPI
) -> Iterator[tuple[Figure, list[Axes]]]:
    """A plain figure of this size, inches, with its axes row by row, which is written to the file at the end."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(figure)
        yield figure, list(figure.subplots(rows, columns, squeeze=False).ravel())
        figure.savefig(file, dpi=dpi)


def theory_and_plant(axes: Axes, series: Series, colour: str = THEORY, label: str = "theory") -> None:
    """Draw the line and its points."""
    axes.plot(series.x, series.y, color=colour, label=label)
    plant(axes, series)


def plant(axes: Axes, series: Series) -> None:
    """Draw the points only: the plant is what is true in the simulation."""
    axes.plot(series.plant_x, series.plant_y, "o", color=TRUE, markersize=3.4, mfc="none", mew=0.9, label="plant")


def legend(axes: Axes, **where: Any) -> None:
    """The legend, each label once."""
    handles, labels = axes.get_legend_handles_labels()
    once = dict(sorted(zip(labels, handles, strict=True), key=lambda entry: entry[0] == "plant"))
    axes.legend(list(once.values()), list(once), **where)
