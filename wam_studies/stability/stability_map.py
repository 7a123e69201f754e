"""The stability map of figure 5.8, computed in parallel."""

import csv
from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_sim import batch
from wam_theory.stability_map import largest_stable_steps

Numbers = NDArray[np.float64]
PIECE = 2000  # points computed together; arrays pay off for many


class StabilityMap(NamedTuple):
    """Largest stable steps, F_error/F_dynamic, (zetas, gammas), for one k_tr/k_c and one F_static/F_dynamic."""

    gamma: Numbers
    zeta: Numbers
    stiffness_ratio: float
    stiction: float
    steps: Numbers


class MapPiece(NamedTuple):
    """All gammas for some zetas."""

    gamma: Numbers
    zeta: Numbers
    stiffness_ratio: float
    stiction: float


def steps_of(piece: MapPiece) -> Numbers:
    """Largest stable steps of a piece, (zetas, gammas)."""
    return largest_stable_steps(piece.gamma, piece.zeta[:, np.newaxis], piece.stiffness_ratio, piece.stiction)


def stability_map(
    gamma: Numbers,
    zeta: Numbers,
    stiffness_ratio: float,
    stiction: float,
    executor: Executor,
    file: Path | None = None,
    report: Callable[[int, int], None] | None = None,
) -> StabilityMap:
    """Compute the map.

    Parameters
    ----------
    gamma, zeta : (gammas,) and (zetas,), axes of the map, above zero.
    stiffness_ratio : k_tr/k_c.
    stiction : F_static/F_dynamic.
    executor, file, report : as in `batch.results`.
    """
    each = max(1, PIECE // len(gamma))
    pieces = [MapPiece(gamma, zeta[i : i + each], stiffness_ratio, stiction) for i in range(0, len(zeta), each)]
    steps = np.concatenate(batch.results(steps_of, pieces, executor, file, report))
    return StabilityMap(gamma, zeta, stiffness_ratio, stiction, steps)


def write_csv(found: StabilityMap, file: Path) -> None:
    """Write a map as CSV, one line per point; inf if every step is stable, 0 if none is."""
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["gamma", "zeta", "k_tr/k_c", "F_static/F_dynamic", "largest stable F_error/F_dynamic"])
        for zeta, steps in zip(found.zeta.tolist(), found.steps.tolist(), strict=True):
            for gamma, step in zip(found.gamma.tolist(), steps, strict=True):
                writer.writerow([gamma, zeta, found.stiffness_ratio, found.stiction, step])
