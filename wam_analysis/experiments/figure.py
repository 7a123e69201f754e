"""The picture of an experiment: predicted lines, measured traces."""

import textwrap
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from wam_analysis.experiments.definition import Experiment
from wam_analysis.experiments.rows import Panel, Result

COLOURS = ("#d55e00", "#0b6fb8", "#009e73", "#cc79a7", "#7a5c00")
MOST_POINTS = 2000
FEW = 40  # points that are drawn one by one


def draw(experiment: Experiment, result: Result, file: Path) -> None:
    """Draw the panels of a result side by side.

    Parameters
    ----------
    file : picture to write, its ending says the format.
    """
    count = len(result.panels)
    columns = min(count, 2)
    rows = -(-count // columns)
    with plt.rc_context({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False, "axes.titlesize": 9}):
        picture, axes = plt.subplots(
            rows, columns, figsize=(4.6 * columns, 2.6 * rows + 0.3), layout="constrained", squeeze=False
        )
        for panel, place in zip(result.panels, axes.ravel(), strict=False):
            _panel(place, panel)
        for place in axes.ravel()[count:]:
            place.set_axis_off()
        title = f"{experiment.title} (section {experiment.section})"
        picture.suptitle("\n".join(textwrap.wrap(title, 60 * columns)), fontsize=9)
        picture.savefig(file, dpi=110)
        plt.close(picture)


def _panel(axes: Axes, panel: Panel) -> None:
    colour = -1
    for curve in panel.curves:
        step = max(1, len(curve.x) // MOST_POINTS)
        x, y = curve.x[::step], curve.y[::step]
        if curve.role == "predicted":
            axes.plot(x, y, color="black", linewidth=0.9, linestyle="--", label=curve.label or None, zorder=3)
            continue
        colour += 1
        label = curve.label or None
        if len(x) < FEW:
            axes.plot(x, y, "o", color=COLOURS[colour % len(COLOURS)], markersize=3.5, mfc="none", label=label)
        else:
            axes.plot(x, y, color=COLOURS[colour % len(COLOURS)], linewidth=1.1, label=label)
    axes.set(title=panel.title, xlabel=panel.x, ylabel=panel.y)
    if "x" in panel.logarithmic:
        axes.set_xscale("log")
    if "y" in panel.logarithmic:
        axes.set_yscale("log")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, fontsize=7.5)
