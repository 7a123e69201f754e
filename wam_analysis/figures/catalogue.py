"""Every figure: its caption, what computes it, what draws it, and how far the plant is from the lines."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, NamedTuple

from wam_analysis import batch
from wam_analysis.figures import bandwidth, cables, links, responses, stability
from wam_analysis.figures import force_control_drawings as force_control
from wam_analysis.figures import transmission_drawings as transmission
from wam_analysis.figures.series import Series


class Figure(NamedTuple):
    """A figure of the thesis; `off` gives the greatest difference of its plant points by name."""

    caption: str
    compute: Callable[[], Any]
    draw: Callable[[Any, Path], None]
    off: Callable[[Any], dict[str, float]]


def _nothing(_: Any) -> dict[str, float]:
    return {}


def _across(*names: str) -> Callable[[Any], dict[str, float]]:
    """Distances from the lines of these fields."""

    def off(numbers: Any) -> dict[str, float]:
        found: dict[str, Series] = {name: getattr(numbers, name) for name in names}
        return {name: series.off for name, series in found.items()}

    return off


def _breakpoints_off(numbers: bandwidth.Breakpoints) -> dict[str, float]:
    family = max(series.off_by_factor for series in numbers.family)
    return {"lower": numbers.lower.off_by_factor, "upper": numbers.upper.off_by_factor, "family": family}


def _describing_function_off(numbers: stability.DescribingFunction) -> dict[str, float]:
    return {f"gamma {gamma:g}": series.off for gamma, series in zip(numbers.gammas, numbers.curves, strict=True)}


def _bound_off(numbers: stability.StabilityBound) -> dict[str, float]:
    return {"bound": numbers.bound.off_by_factor}


FIGURES: dict[str, Figure] = {
    "3.1": Figure(
        "Effect of aspect ratio on available contact length.", links.grasp, transmission.draw_grasp, _nothing
    ),
    "4.9": Figure(
        "Open-loop force bandwidth versus contact stiffness.",
        bandwidth.breakpoints,
        transmission.draw_breakpoints,
        _breakpoints_off,
    ),
    "5.3": Figure(
        "Step response with a simple transmission.",
        responses.simple_responses,
        force_control.draw_simple,
        _across("proportional", "integral"),
    ),
    "5.5": Figure(
        "Step response in a nearly-inertialess transmission with stiction.",
        responses.staircase,
        force_control.draw_staircase,
        _across("force", "motor"),
    ),
    "5.7": Figure(
        "SIDF analysis: complex plot of -1/N(A) and G(jω) for two G_I.",
        stability.describing_function,
        force_control.draw_describing_function,
        _describing_function_off,
    ),
    "5.8": Figure(
        "Extended stability region for a system with Coulomb friction.",
        stability.stability_bound,
        force_control.draw_bound,
        _bound_off,
    ),
    "5.9": Figure(
        "Typical step response of the inertial system with Coulomb friction.",
        responses.coulomb_response,
        force_control.draw_coulomb,
        _across("force", "motor"),
    ),
    "5.10": Figure(
        "Phase-plane visualization of the unmodeled discontinuous-contact limit cycle.",
        responses.lost_contact,
        force_control.draw_lost_contact,
        _across("cycle"),
    ),
    "5.11": Figure(
        "Three-dimensional trajectory illustrating an actuator-only limit cycle.",
        responses.coulomb_response,
        force_control.draw_trajectory,
        _across("force", "motor"),
    ),
    "6-efficiency": Figure(
        "Limiting efficiency of cable stages (6.15).",
        cables.efficiencies,
        transmission.draw_efficiency,
        _across("testbed"),
    ),
    "6-creep": Figure(
        "Creep out and back under a constant load (6.19).", cables.creep, transmission.draw_creep, _across("way")
    ),
}


def known(names: Sequence[str]) -> Sequence[str]:
    """Those names.

    Raises
    ------
    ValueError
        where one is not that of a figure.
    """
    for name in names:
        if name not in FIGURES:
            raise ValueError(f"there is no figure {name}; there are {', '.join(FIGURES)}")
    return names


def numbers_of(name: str) -> Any:
    """Numbers of a figure, a NamedTuple of arrays."""
    return FIGURES[name].compute()


def numbers(
    names: Sequence[str],
    executor: Executor,
    kept: Path | None = None,
    report: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Numbers of these figures, computed as a battery.

    Parameters
    ----------
    names : of `FIGURES`.
    executor, kept, report : as in `batch.results`.
    """
    return dict(zip(names, batch.results(numbers_of, list(known(names)), executor, kept, report), strict=True))


def file_of(name: str, folder: Path) -> Path:
    """Picture of a figure."""
    return folder / f"figure-{name}.png"


def table(found: dict[str, Any]) -> str:
    """Greatest difference of the plant's points from the lines, one row a series (Markdown)."""
    lines = ["| figure | points | greatest difference from the line |", "| --- | --- | --- |"]
    for name, values in found.items():
        lines += [f"| {name} | {part} | {_percent(off)} |" for part, off in FIGURES[name].off(values).items()]
    return "\n".join(lines) + "\n"


def _percent(off: float) -> str:
    return "below 0.05 %" if off < 5e-4 else f"{100.0 * off:.1f} %"
