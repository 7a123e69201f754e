"""The direct run with `wam_description.small_matrices`, and with numpy.linalg in its place: equal bits, or it fails."""

import time
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import comparing.source_tree  # noqa: F401 - before the packages
import numpy as np
from comparing import arguments, machine, quartiles, ratios, save, table
from speed import scenario_steps

from wam_description import small_matrices
from wam_description.configuration import Configuration, packaged
from wam_sim.simulation import Simulation

CHUNK = 10  # periods, of which each is counted at its fastest
WAYS: dict[str, Any] = {
    "without the checks": small_matrices.LAPACK,
    "numpy.linalg": SimpleNamespace(inv=np.linalg.inv, solve1=small_matrices.checked_solutions),
}


def chunks(run: Simulation) -> list[float]:
    """Seconds of each chunk of periods of a run."""
    times, is_over = [time.perf_counter()], False
    while not is_over:
        is_over = any(run.step() for _ in range(CHUNK))
        times.append(time.perf_counter())
    return [end - begin for begin, end in pairwise(times)]


def main() -> None:
    """Measure in turns, print the table."""
    given = arguments(__doc__, rounds=15, quick_rounds=1)
    configuration = Configuration.load(packaged("wam"))
    steps = scenario_steps(1.0 if given.quick else 4.0, configuration.shared)
    found: dict[str, list[list[float]]] = {name: [] for name in WAYS}
    for _ in range(given.rounds):
        rows = []
        for name, functions in WAYS.items():
            small_matrices.LAPACK = functions
            run = Simulation(configuration, steps)
            found[name].append(chunks(run))
            rows.append(repr(run.rows))
        if rows[0] != rows[1]:
            raise SystemExit("the bits differ")
    periods = len(found["numpy.linalg"][0]) * CHUNK / 1e6
    whole = {name: [sum(chunk) / periods for chunk in rounds] for name, rounds in found.items()}
    compared = {name: ratios(values, whole["numpy.linalg"]) for name, values in whole.items()}
    least = {name: sum(map(min, zip(*rounds, strict=True))) / periods for name, rounds in found.items()}
    print(machine())
    lines = [[name, f"{least[name]:.1f}", f"{quartiles(whole[name]):.1f}", f"{compared[name]:.3f}"] for name in WAYS]
    print(table(["direct run", "us of a period, at the fastest", "middle half", "ratio"], lines))
    save("small_matrices", given, compared)


if __name__ == "__main__":
    main()
