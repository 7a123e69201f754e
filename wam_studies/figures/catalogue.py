"""Every figure: caption and function of its panels; distance of the plant from the lines."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import NamedTuple

from wam_analysis.table import markdown
from wam_sim import batch
from wam_studies.figures import (
    backdrivability,
    closed_forms,
    inner_loops,
    open_loop,
    responses,
    stability,
    transmissions,
)
from wam_studies.figures.panels import Panels, distances


class ThesisFigure(NamedTuple):
    """A figure of the thesis, or for one of its claims."""

    caption: str
    compute: Callable[[], Panels]


FIGURES: dict[str, ThesisFigure] = {
    name: ThesisFigure(caption, compute)
    for name, caption, compute in (
        ("1.1", "Various types of transmissions: cables, shaft and gears, direct drive.", transmissions.transmissions),
        ("2.1.1", "Error of the force without feedback over the workspace of the arm.", open_loop.open_loop),
        ("2.1.2", "Inner loops on torque, and on velocity or position.", inner_loops.inner_loops),
        ("3.1", "Effect of aspect ratio on available contact length.", closed_forms.grasp),
        (
            "3.2.6",
            "Backdriven inertia and friction with 2 kg over the workspace.",
            backdrivability.backdrivability,
        ),
        ("4.5", "Where the reducer is, and the torque that bandwidth by feedback costs.", closed_forms.reducer),
        ("4.9", "Open-loop force bandwidth versus contact stiffness.", closed_forms.breakpoints),
        ("5.3", "Step response with a simple transmission.", responses.simple_responses),
        ("5.5", "Step response in a nearly-inertialess transmission with stiction.", responses.staircase),
        ("5.7", "SIDF analysis: complex plot of -1/N(A) and G(jω) for two G_I.", stability.describing_function),
        ("5.8", "Extended stability region for a system with Coulomb friction.", stability.stability_bound),
        ("5.9", "Typical step response of the inertial system with Coulomb friction.", responses.coulomb_response),
        (
            "5.10",
            "Phase-plane visualization of the unmodeled discontinuous-contact limit cycle.",
            responses.lost_contact,
        ),
        ("5.11", "Three-dimensional trajectory illustrating an actuator-only limit cycle.", responses.trajectory),
        ("6-efficiency", "Limiting efficiency of cable stages (6.15).", closed_forms.efficiencies),
    )
}


def known(names: Sequence[str]) -> Sequence[str]:
    """The names, checked.

    Raises
    ------
    ValueError
        if one is not the name of a figure.
    """
    for name in names:
        if name not in FIGURES:
            raise ValueError(f"no figure {name}; choose from {', '.join(FIGURES)}")
    return names


def numbers_of(name: str) -> Panels:
    """Numbers of a figure."""
    return FIGURES[name].compute()


def numbers(
    names: Sequence[str],
    executor: Executor,
    file: Path | None = None,
    report: Callable[[int, int], None] | None = None,
) -> dict[str, Panels]:
    """Numbers of these figures, computed in parallel.

    Parameters
    ----------
    names : of `FIGURES`.
    executor, file, report : as in `batch.results`.
    """
    return dict(zip(names, batch.results(numbers_of, list(known(names)), executor, file, report), strict=True))


def file_of(name: str, folder: Path) -> Path:
    """File of a figure."""
    return folder / f"figure-{name}.png"


def table(found: dict[str, Panels]) -> str:
    """Greatest distance of the plant's points from the lines, one row per panel (Markdown)."""
    rows = [
        (name, part, percent(distance))
        for name, values in found.items()
        for part, distance in distances(values).items()
    ]
    return markdown(("figure", "points", "greatest distance from the line"), rows)


def percent(distance: float) -> str:
    """A distance as text."""
    return "below 0.05 %" if distance < 5e-4 else f"{100.0 * distance:.1f} %"
