"""The figure of an experiment: predicted lines, measured traces."""

import textwrap
from pathlib import Path

from matplotlib.axes import Axes

from wam_analysis.drawing import COLOURS, MEASURED, PREDICTED, SHAFTS, widen_flat
from wam_studies.figures.style import panels
from wam_studies.thesis.definition import Experiment
from wam_studies.thesis.rows import Panel, Result

MOST_POINTS = 2000
WIDTH = {1: 5.4, 2: 8.4}  # inches, by columns
FEW = 40  # points, below which each is drawn as a circle


def draw(experiment: Experiment, result: Result, file: Path) -> None:
    """Draw the panels of a result, of which there is at least one, side by side.

    Parameters
    ----------
    file : picture; its suffix is the format.
    """
    count = len(result.panels)
    columns = min(count, 2)
    rows = -(-count // columns)
    with panels(file, rows, columns, WIDTH[columns], 2.6 * rows + 0.3) as (picture, axes):
        for panel, panel_axes in zip(result.panels, axes, strict=False):
            draw_panel(panel_axes, panel)
        for unused in axes[count:]:
            unused.set_axis_off()
        title = f"{experiment.title} (section {experiment.section})"
        picture.suptitle("\n".join(textwrap.wrap(title, 60 * columns)), fontsize=9)


def draw_panel(axes: Axes, panel: Panel) -> None:
    """Draw the curves of a panel: predictions dashed; what is commanded, true, estimated in the colours of that."""
    several = sum(curve.role == "measured" and curve.label not in COLOURS for curve in panel.curves) > 1
    others = iter(SHAFTS * 4)
    for curve in panel.curves:
        step = max(1, len(curve.x) // MOST_POINTS)
        x, y = curve.x[::step], curve.y[::step]
        if curve.role == "predicted":
            colour, style = COLOURS.get(curve.label, PREDICTED), "-" if curve.label == "true" else "--"
            axes.plot(x, y, color=colour, linewidth=1.1, linestyle=style, label=curve.label or None, zorder=3)
            continue
        colour = COLOURS.get(curve.label) or (next(others) if several else MEASURED)
        label = curve.label or None
        if len(x) < FEW:
            axes.plot(x, y, "o", color=colour, markersize=3.5, mfc="none", label=label)
        else:
            axes.plot(x, y, color=colour, linewidth=1.1, label=label)
    axes.set(title=panel.title, xlabel=panel.x, ylabel=panel.y)
    if "x" in panel.logarithmic:
        axes.set_xscale("log")
    if "y" in panel.logarithmic:
        axes.set_yscale("log")
    else:
        widen_flat(axes)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, fontsize=8)
