"""Results of `wam sweep` over each parameter."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from wam_analysis.drawing import MEASURED, TRUE
from wam_sim.sweep import Axis, SweepResult
from wam_studies.figures.style import panels
from wam_studies.thesis.sweeping import ExperimentOutcome

Sets = list[tuple[Any, ...]]


def _column(sets: Sets, i: int) -> list[Any]:
    return [row[i] if isinstance(row[i], (int, float)) else str(row[i]) for row in sets]


def scenario_figure(file: Path, axes: Sequence[Axis], sets: Sets, found: Sequence[SweepResult]) -> None:
    """One panel for each parameter; runs that failed are crosses on the axis."""
    with panels(file, 1, len(axes), 3.6 * len(axes), 3.0) as (_, shown):
        for i, (axis, part) in enumerate(zip(axes, shown, strict=True)):
            rows = list(zip(_column(sets, i), found, strict=True))
            good = [(value, r.force_rms) for value, r in rows if not r.failure and math.isfinite(r.force_rms)]
            bad = [(value, 0.0) for value, r in rows if r.failure]
            for pairs, marker, colour, label in ((good, "o", TRUE, "held"), (bad, "x", MEASURED, "failed")):
                if pairs:
                    across, up = zip(*pairs, strict=True)
                    part.scatter(across, up, s=14, label=label, marker=marker, color=colour)
            part.set(xlabel=axis.name, ylabel="rms of the settled force error [N]")
            part.legend()


def experiment_figure(file: Path, axes: Sequence[Axis], sets: Sets, found: Sequence[ExperimentOutcome]) -> None:
    """One row for each quantity that is a number, one column for each parameter."""
    units = {c.quantity: c.unit for one in found for c in one.rows if not isinstance(c.measured, str)}
    with panels(file, max(len(units), 1), len(axes), 3.6 * len(axes), 2.2 * max(len(units), 1)) as (_, shown):
        for place, (quantity, unit) in enumerate(units.items()):
            for i, axis in enumerate(axes):
                part = shown[place * len(axes) + i]
                for role, colour in (("predicted", TRUE), ("measured", MEASURED)):
                    pairs = [
                        (value, getattr(c, role))
                        for value, one in zip(_column(sets, i), found, strict=True)
                        for c in one.rows
                        if c.quantity == quantity and not isinstance(getattr(c, role), str)
                    ]
                    if pairs:
                        across, up = zip(*pairs, strict=True)
                        part.scatter(across, up, s=14, label=role, color=colour)
                part.set(xlabel=axis.name, ylabel=f"{quantity} [{unit}]")
                part.legend()
