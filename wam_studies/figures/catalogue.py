"""Every figure: function of its panels; distance of the plant from the lines."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from pathlib import Path

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

FIGURES: dict[str, Callable[[], Panels]] = {  # of the thesis, or for one of its claims
    "1.1": transmissions.transmissions,
    "2.1.1": open_loop.open_loop,
    "2.1.2": inner_loops.inner_loops,
    "3.1": closed_forms.grasp,
    "3.2.6": backdrivability.backdrivability,
    "4.5": closed_forms.reducer,
    "4.9": closed_forms.breakpoints,
    "5.3": responses.simple_responses,
    "5.5": responses.staircase,
    "5.7": stability.describing_function,
    "5.8": stability.stability_bound,
    "5.9": responses.coulomb_response,
    "5.10": responses.lost_contact,
    "5.11": responses.trajectory,
    "6-efficiency": closed_forms.efficiencies,
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
    return FIGURES[name]()


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
    return markdown(("figure", "part", "greatest distance from the line"), rows)


def percent(distance: float) -> str:
    """A distance as text."""
    return "below 0.05 %" if distance < 5e-4 else f"{100.0 * distance:.1f} %"
