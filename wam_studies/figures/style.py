"""Style of the figures: sizes, colours, a file that is written at the end; panels drawn."""

import math
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wam_analysis.drawing import COLOURS, PREDICTED, SHAFTS, STYLE
from wam_studies.figures.panels import FEW, Mark, Panel

GREY = "#777777"
SHADES = (*SHAFTS[1:5], SHAFTS[0], *SHAFTS[5:])
DPI = 200
MOST_POINTS = 2000  # of a recording, drawn
STILL = 1e-5  # rad, rad/s, N: a smaller range of a plot is not blown up
FLAT = 1e-4  # of the value, the same


@contextmanager
def picture(file: Path, width: float, height: float) -> Iterator[Figure]:
    """A figure of this size, inches, which is written to the file at the end."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        yield figure
        figure.savefig(file, dpi=DPI)


@contextmanager
def panels(file: Path, rows: int, columns: int, width: float, height: float) -> Iterator[tuple[Figure, list[Axes]]]:
    """A figure of this size, inches, with its axes row by row."""
    with picture(file, width, height) as figure:
        yield figure, list(figure.subplots(rows, columns, squeeze=False).ravel())


def draw_panels(found: Sequence[Panel], file: Path, columns: int = 3, title: str = "") -> None:
    """Draw the panels row by row; the suffix of the file is its format."""
    columns = min(columns, len(found))
    rows = -(-len(found) // columns)
    with panels(file, rows, columns, 3.7 * max(columns, 1.4), 2.9 * rows) as (figure, axes):
        for one, panel in zip(axes, found, strict=False):
            draw_panel(one, panel)
        for unused in axes[len(found) :]:
            unused.set_axis_off()
        if title:
            figure.suptitle("\n".join(textwrap.wrap(title, 60 * columns)), fontsize=9)


def draw_panel(axes: Axes, panel: Panel) -> None:
    """Draw a panel: few points as circles, a recording as a line with what is predicted dashed."""
    is_recorded = any(len(series.plant_x) > FEW for _, series in panel.lines)
    unnamed = iter(SHADES * 9)
    for label, series in panel.lines:
        is_line = len(series.x) > 0
        colour = COLOURS.get(label) or (PREDICTED if is_recorded and is_line else next(unnamed))
        axes.plot(series.x, series.y, "--" if is_recorded else "-", color=colour, label=label if is_line else None)
        each = slice(None, None, max(1, len(series.plant_x) // MOST_POINTS))
        style: dict[str, Any] = {} if len(series.plant_x) > FEW else {"ls": "", "marker": "o", "ms": 3.4, "mfc": "none"}
        name = None if is_line else label
        axes.plot(series.plant_x[each], series.plant_y[each], color=colour, label=name, **style)
    for mark in panel.marks:
        _name(axes, mark)
    axes.set(title=panel.title, xlabel=panel.x, ylabel=panel.y)
    axes.yaxis.set_visible(bool(panel.y))
    axes.set_xscale("log" if "x" in panel.logarithmic else "linear")
    axes.set_yscale("log" if "y" in panel.logarithmic else "linear")
    low_x, high_x, low_y, high_y = (None if math.isnan(limit) else limit for limit in panel.limits)
    axes.set_xlim(low_x, high_x)
    axes.set_ylim(low_y, high_y)
    if not panel.logarithmic:
        _widen_flat(axes)
    handles, labels = axes.get_legend_handles_labels()
    if any(labels):
        once = dict(zip(labels, handles, strict=True))
        axes.legend(once.values(), once)


def _widen_flat(axes: Any) -> None:
    """Show a quantity that does not change as a line, not its rounding errors."""
    for limits, widen in ((axes.get_xlim(), axes.set_xlim), (axes.get_ylim(), axes.set_ylim)):
        low, high = limits
        least = max(STILL, FLAT * abs(low + high) / 2.0)
        if high - low < least:
            widen((low + high - least) / 2.0, (low + high + least) / 2.0)


def _name(axes: Axes, mark: Mark) -> None:
    if math.isnan(mark.y):
        axes.axvline(mark.x, color=GREY, linewidth=0.7, linestyle=":")
        across = axes.get_xaxis_transform()
        axes.text(
            mark.x, 0.1, mark.text, transform=across, fontsize=7.5, color=GREY, rotation=90, ha="right", in_layout=False
        )
    elif math.isnan(mark.x):
        axes.axhline(mark.y, color=GREY, linewidth=0.7, linestyle=":")
        axes.text(0.6, mark.y, mark.text, transform=axes.get_yaxis_transform(), fontsize=7.5, color=GREY)
    else:
        axes.plot(mark.x, mark.y, "s", color=GREY, markersize=4)
        axes.annotate(mark.text, (mark.x, mark.y), (4, 4), textcoords="offset points", fontsize=7.5)
