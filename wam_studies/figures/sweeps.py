"""Results of `wam sweep` over each parameter."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from wam_analysis.drawing import MEASURED, TRUE
from wam_sim.sweep import Axis, SweepResult
from wam_studies.figures.style import panels
from wam_studies.thesis.sweeping import ExperimentOutcome

Sets = list[tuple[Any, ...]]
Points = tuple[str, str, str, list[list[float]]]  # label, marker, colour, and the values of each set


def scenario_figure(file: Path, axes: Sequence[Axis], sets: Sets, found: Sequence[SweepResult]) -> None:
    """One panel for each parameter; runs that failed are crosses on the axis."""
    good = [[r.force_rms] if not r.failure and math.isfinite(r.force_rms) else [] for r in found]
    bad = [[0.0] if r.failure else [] for r in found]
    rows = {"rms of the settled force error [N]": [("held", "o", TRUE, good), ("failed", "x", MEASURED, bad)]}
    _draw(file, axes, sets, rows)


def experiment_figure(file: Path, axes: Sequence[Axis], sets: Sets, found: Sequence[ExperimentOutcome]) -> None:
    """One row for each quantity that is a number, one column for each parameter."""
    units = {c.quantity: c.unit for one in found for c in one.rows if not isinstance(c.measured, str)}

    def values(quantity: str, role: str) -> list[list[float]]:
        every = [[getattr(c, role) for c in one.rows if c.quantity == quantity] for one in found]
        return [[value for value in some if not isinstance(value, str)] for some in every]

    roles = (("predicted", TRUE), ("measured", MEASURED))
    rows = {
        f"{name} [{unit}]": [(role, "o", colour, values(name, role)) for role, colour in roles]
        for name, unit in units.items()
    }
    _draw(file, axes, sets, rows)


def _draw(file: Path, axes: Sequence[Axis], sets: Sets, rows: Mapping[str, Sequence[Points]]) -> None:
    """A panel for each row and each parameter."""
    count = max(len(rows), 1)
    with panels(file, count, len(axes), 3.6 * len(axes), max(3.0, 2.2 * count)) as (_, shown):
        for place, (name, lines) in enumerate(rows.items()):
            for i, axis in enumerate(axes):
                part = shown[place * len(axes) + i]
                column = [row[i] if isinstance(row[i], (int, float)) else str(row[i]) for row in sets]
                for label, marker, colour, found in lines:
                    pairs = [(value, one) for value, some in zip(column, found, strict=True) for one in some]
                    if pairs:
                        across, up = zip(*pairs, strict=True)
                        part.scatter(across, up, s=14, label=label, marker=marker, color=colour)
                part.set(xlabel=axis.name, ylabel=name)
                part.legend()
