"""The picture of the benchmark: true over commanded force by outcome, and peaks over stiffness."""

from collections.abc import Sequence

import numpy as np

from wam_studies.figures.panels import FEW, Panel, Panels, measured
from wam_studies.force_benchmark.groupings import FEEDBACK
from wam_studies.force_benchmark.outcome import TaskEnd
from wam_studies.force_benchmark.trial import ForceTrial

LEAST, MOST = 0.1, 10.0  # of the commanded force, drawn


def panels_of(trials: Sequence[ForceTrial]) -> Panels:
    """What is drawn of the trials, up to `FEW` of each outcome."""
    peaks = [one for one in trials if one.result.peak > 0.0][:FEW]
    stiffness = [one.task.surface.stiffness for one in peaks]
    over = [("", measured(stiffness, [one.result.peak / one.result.limit for one in peaks]))]
    return (
        *(_ratios(name, FEEDBACK.trials(trials, name)) for name in FEEDBACK.classes),
        Panel("peaks", "stiffness of the surface [N/m]", "peak / (1.5 commanded + impact) [-]", over, "x"),
    )


def _ratios(name: str, trials: Sequence[ForceTrial]) -> Panel:
    lines = []
    for end in TaskEnd:
        own = [one for one in trials if one.result.outcome is end][:FEW]
        ratio = np.clip([one.result.mean / one.task.force for one in own], LEAST, MOST)
        lines.append((end.value.partition(":")[0], measured([one.task.force for one in own], ratio)))
    return Panel(name, "commanded force [N]", "true force at the end / commanded [-]", lines, "xy")
