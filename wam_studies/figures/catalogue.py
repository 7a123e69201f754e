"""Every figure: caption, function of its numbers, function that draws it, distance of the plant from the lines."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, NamedTuple

from wam_analysis.table import markdown
from wam_sim import batch
from wam_studies.figures import (
    backdrivability,
    bandwidth,
    cables,
    friction_claims,
    inner_loops,
    links,
    open_loop,
    reducer,
    responses,
    stability,
    transmissions,
)
from wam_studies.figures import force_control_drawings as force_control
from wam_studies.figures import friction_claim_drawings as in_words
from wam_studies.figures import transmission_drawings as transmission
from wam_studies.figures.panels import distances, draw_panels
from wam_studies.figures.series import Series


class ThesisFigure(NamedTuple):
    """A figure of the thesis; `distance` is the greatest distance of its plant points, by name."""

    caption: str
    compute: Callable[[], Any]
    draw: Callable[[Any, Path], None]
    distance: Callable[[Any], dict[str, float]]


def _no_plant(_: Any) -> dict[str, float]:
    return {}


def _across(*names: str) -> Callable[[Any], dict[str, float]]:
    """Distances from the lines of these fields."""

    def distance(numbers: Any) -> dict[str, float]:
        found: dict[str, Series] = {name: getattr(numbers, name) for name in names}
        return {name: series.distance for name, series in found.items()}

    return distance


def _breakpoints_distance(numbers: bandwidth.Breakpoints) -> dict[str, float]:
    family = max(series.relative_distance for series in numbers.family)
    return {"lower": numbers.lower.relative_distance, "upper": numbers.upper.relative_distance, "family": family}


def _describing_function_distance(numbers: stability.DescribingFunction) -> dict[str, float]:
    return {f"gamma {gamma:g}": series.distance for gamma, series in zip(numbers.gammas, numbers.curves, strict=True)}


def _bound_distance(numbers: stability.StabilityBound) -> dict[str, float]:
    return {"bound": numbers.bound.relative_distance}


def _start_distance(numbers: friction_claims.AsymmetricStart) -> dict[str, float]:
    return {
        "asymmetry": max(series.distance for series in numbers.asymmetry),
        "period": max(series.distance for series in numbers.period),
    }


def _harmonics_distance(numbers: friction_claims.HarmonicsOfFriction) -> dict[str, float]:
    return {"shares": max(series.relative_distance for series in numbers.shares)}


def _kept_contact_distance(numbers: friction_claims.KeptContact) -> dict[str, float]:
    return {"step down": max(series.relative_distance for series in numbers.series)}


FIGURES: dict[str, ThesisFigure] = {
    "1.1": ThesisFigure(
        "Various types of transmissions: cables, shaft and gears, direct drive.",
        transmissions.transmissions,
        draw_panels,
        distances,
    ),
    "2.1.1": ThesisFigure(
        "Error of the force without feedback over the workspace of the arm.",
        open_loop.open_loop,
        draw_panels,
        _no_plant,
    ),
    "2.1.2": ThesisFigure(
        "Inner loops on torque, and on velocity or position.", inner_loops.inner_loops, draw_panels, distances
    ),
    "3.1": ThesisFigure(
        "Effect of aspect ratio on available contact length.", links.grasp, transmission.draw_grasp, _no_plant
    ),
    "3.2.6": ThesisFigure(
        "Backdriven inertia and friction with 2 kg over the workspace.",
        backdrivability.backdrivability,
        backdrivability.draw,
        _no_plant,
    ),
    "4.5": ThesisFigure(
        "Where the reducer is, and the torque that bandwidth by feedback costs.",
        reducer.reducer,
        draw_panels,
        distances,
    ),
    "4.9": ThesisFigure(
        "Open-loop force bandwidth versus contact stiffness.",
        bandwidth.breakpoints,
        transmission.draw_breakpoints,
        _breakpoints_distance,
    ),
    "5.3": ThesisFigure(
        "Step response with a simple transmission.",
        responses.simple_responses,
        force_control.draw_simple,
        _across("proportional", "integral"),
    ),
    "5.4-start": ThesisFigure(
        "Asymmetric start of the stiction cycle.",
        friction_claims.asymmetric_start,
        in_words.draw_start,
        _start_distance,
    ),
    "5.5.1-harmonics": ThesisFigure(
        "Harmonics that the describing function neglects, and the cycles it has and has not.",
        friction_claims.harmonics_of_friction,
        in_words.draw_harmonics,
        _harmonics_distance,
    ),
    "5.5.2-contact": ThesisFigure(
        "Step down that loses contact.",
        friction_claims.kept_contact,
        in_words.draw_kept_contact,
        _kept_contact_distance,
    ),
    "5.5": ThesisFigure(
        "Step response in a nearly-inertialess transmission with stiction.",
        responses.staircase,
        force_control.draw_staircase,
        _across("force", "motor"),
    ),
    "5.7": ThesisFigure(
        "SIDF analysis: complex plot of -1/N(A) and G(jω) for two G_I.",
        stability.describing_function,
        force_control.draw_describing_function,
        _describing_function_distance,
    ),
    "5.8": ThesisFigure(
        "Extended stability region for a system with Coulomb friction.",
        stability.stability_bound,
        force_control.draw_bound,
        _bound_distance,
    ),
    "5.9": ThesisFigure(
        "Typical step response of the inertial system with Coulomb friction.",
        responses.coulomb_response,
        force_control.draw_coulomb,
        _across("force", "motor"),
    ),
    "5.10": ThesisFigure(
        "Phase-plane visualization of the unmodeled discontinuous-contact limit cycle.",
        responses.lost_contact,
        force_control.draw_lost_contact,
        _across("cycle"),
    ),
    "5.11": ThesisFigure(
        "Three-dimensional trajectory illustrating an actuator-only limit cycle.",
        responses.coulomb_response,
        force_control.draw_trajectory,
        _across("force", "motor"),
    ),
    "6-efficiency": ThesisFigure(
        "Limiting efficiency of cable stages (6.15).",
        cables.efficiencies,
        transmission.draw_efficiency,
        _across("testbed"),
    ),
    "6-creep": ThesisFigure(
        "Creep out and back under a constant load (6.19).", cables.creep, transmission.draw_creep, _across("creep")
    ),
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


def numbers_of(name: str) -> Any:
    """Numbers of a figure, a NamedTuple of arrays."""
    return FIGURES[name].compute()


def numbers(
    names: Sequence[str],
    executor: Executor,
    file: Path | None = None,
    report: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
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


def table(found: dict[str, Any]) -> str:
    """Greatest distance of the plant's points from the lines, one row per series (Markdown)."""
    rows = [
        (name, part, _percent(distance))
        for name, values in found.items()
        for part, distance in FIGURES[name].distance(values).items()
    ]
    return markdown(("figure", "points", "greatest distance from the line"), rows)


def _percent(distance: float) -> str:
    return "below 0.05 %" if distance < 5e-4 else f"{100.0 * distance:.1f} %"
