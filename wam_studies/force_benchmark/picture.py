"""The figure of the benchmark: true against commanded force, outcomes by class, peaks."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from wam_analysis.drawing import BETWEEN, COMMANDED, REFUSED, RIGHT, WRONG
from wam_studies.figures.style import GREY, panels
from wam_studies.force_benchmark.groupings import FEEDBACK, FORCE, MOTORS, POSE, SENSORS, STIFFNESS, TaskGrouping
from wam_studies.force_benchmark.outcome import OUTCOME, TaskEnd
from wam_studies.force_benchmark.trial import ForceTrial

COLOURS = {
    TaskEnd.DONE: RIGHT,
    TaskEnd.REFUSED: REFUSED,
    TaskEnd.GIVEN_UP: COMMANDED,
    TaskEnd.ENDED: BETWEEN,
    TaskEnd.SILENT: WRONG,
}
LEAST, MOST = 0.1, 10.0  # of the commanded force, drawn
FORCES, RATIOS = (1, 2, 5, 10, 20, 40), (0.1, 0.2, 0.5, 1, 2, 5, 10)  # ticks, N and none


def draw(trials: Sequence[ForceTrial], file: Path) -> None:
    """Draw the figure into a file, and create its folder."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with panels(file, 3, 2, 8.8, 10.4) as (_, flat):
        _forces(flat[0], FEEDBACK.trials(trials, SENSORS), SENSORS)
        _forces(flat[1], FEEDBACK.trials(trials, MOTORS), MOTORS)
        _peaks(flat[2], trials)
        for axes, grouping in zip(flat[3:], (STIFFNESS, POSE, FORCE), strict=True):
            _outcomes(axes, trials, grouping)


def _forces(axes: Axes, trials: Sequence[ForceTrial], name: str) -> None:
    axes.axhspan(1.0 - OUTCOME.tolerance, 1.0 + OUTCOME.tolerance, color=GREY, alpha=0.2, lw=0)
    for end, colour in COLOURS.items():
        own = [trial for trial in trials if trial.result.outcome is end]
        ratio = [trial.result.mean / trial.task.force for trial in own]
        label = f"{end.value.split(':', maxsplit=1)[0]} ({len(own)})"
        axes.plot(
            [trial.task.force for trial in own], np.clip(ratio, LEAST, MOST), "o", ms=3.5, color=colour, label=label
        )
    axes.set(
        title=f"feedback from {name}",
        xlabel="commanded force [N]",
        ylabel="true force at the end / commanded",
        xscale="log",
        yscale="log",
        xlim=(0.9, 45.0),
        ylim=(0.9 * LEAST, 1.1 * MOST),
    )
    axes.set_xticks(FORCES, map(str, FORCES), minor=False)
    axes.set_yticks(RATIOS, map(str, RATIOS), minor=False)
    axes.minorticks_off()
    axes.legend(frameon=False, fontsize=8, loc="lower left")


def _peaks(axes: Axes, trials: Sequence[ForceTrial]) -> None:
    for is_over, colour, label in ((False, RIGHT, "below"), (True, WRONG, "above")):
        own = [trial for trial in trials if trial.result.is_over is is_over and trial.result.peak > 0.0]
        stiffness = [trial.task.surface.stiffness for trial in own]
        ratio = [trial.result.peak / trial.result.limit for trial in own]
        axes.semilogx(stiffness, ratio, "o", ms=3.5, color=colour, label=f"{label} ({len(own)})")
    axes.axhline(1.0, color=COMMANDED, lw=1)
    axes.set(
        title="peaks",
        xlabel="stiffness of the surface [N/m]",
        ylabel="largest true force / (1.5 commanded + impact)",
        ylim=(0.0, None),
    )
    axes.legend(frameon=False, fontsize=8)


def _outcomes(axes: Axes, trials: Sequence[ForceTrial], grouping: TaskGrouping) -> None:
    counts = [
        [sum(t.result.outcome is end for t in grouping.trials(trials, name)) for end in COLOURS]
        for name in grouping.classes
    ]
    wholes = [max(sum(row), 1) for row in counts]
    left = np.zeros(len(counts))
    for i, colour in enumerate(COLOURS.values()):
        shares = np.array([row[i] / whole for row, whole in zip(counts, wholes, strict=True)])
        axes.barh(range(len(counts)), shares, left=left, color=colour)
        left += shares
    labels = [f"{name} ({sum(row)})" for name, row in zip(grouping.classes, counts, strict=True)]
    axes.set_yticks(range(len(counts)), labels)
    axes.invert_yaxis()
    axes.set(title=grouping.title, xlabel="share of tasks", xlim=(0.0, 1.0))
