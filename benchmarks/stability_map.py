"""Time of the stability map of figure 5.8 relative to scipy's solve_ivp with events, and to the scalar bisection."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from comparing import arguments, machine, quartiles, ratios, save, table
from comparing.solve_ivp import BEST, Node
from comparing.solve_ivp import largest_stable_step as by_solve_ivp

from wam_theory.stability_map import largest_stable_steps
from wam_theory.stick_slip import FrictionNode, IntegralLoop, largest_stable_step

GAMMA, ZETA = np.meshgrid(np.linspace(1.02, 3.0, 100), np.geomspace(0.05, 1.0, 100))
CLOSE = 5e-3


def scalar(node: Node) -> float:
    """Our exact integrator, one response after the other."""
    friction = FrictionNode(1.0, node.b, node.ktr, node.kc, 1.0, node.static)
    return largest_stable_step(friction, IntegralLoop(node.gain), rtol=1e-4)


def seconds(work: Callable[[], Any]) -> tuple[float, Any]:
    """Duration and result."""
    begin = time.perf_counter()
    result = work()
    return time.perf_counter() - begin, result


def main() -> None:
    """Measure in turns, print the table."""
    given = arguments(__doc__, rounds=4, quick_rounds=1)
    each = 4 if given.quick else 250
    chance = np.random.default_rng(58)
    times: dict[str, list[float]] = {"map": [], "sample": [], "solve_ivp": [], "scalar": []}
    worst = {"solve_ivp": 0.0, "scalar": 0.0}
    for _ in range(given.rounds):
        took, steps = seconds(lambda: largest_stable_steps(GAMMA, ZETA))
        times["map"].append(took / GAMMA.size)
        points = chance.choice(GAMMA.size, each, replace=False)
        gammas, zetas, mine = GAMMA.ravel()[points], ZETA.ravel()[points], steps.ravel()[points]
        took, again = seconds(lambda g=gammas, z=zetas: largest_stable_steps(g, z))
        assert np.array_equal(again, mine)
        times["sample"].append(took / each)
        nodes = [Node.of(g, z) for g, z in zip(gammas.tolist(), zetas.tolist(), strict=True)]
        guesses = [1.0 / (z * (g - 1.0)) for g, z in zip(gammas.tolist(), zetas.tolist(), strict=True)]
        found: dict[str, Any] = {}
        took, found["solve_ivp"] = seconds(lambda n=nodes, s=guesses: list(map(by_solve_ivp, n, s)))
        times["solve_ivp"].append(took / each)
        took, found["scalar"] = seconds(lambda n=nodes: list(map(scalar, n)))
        times["scalar"].append(took / each)
        for name, values in found.items():
            off = [abs(a - b) / b if b else float(a != b) for a, b in zip(values, mine.tolist(), strict=True)]
            worst[name] = max(worst[name], *off)
    rows, measured = [], dict[str, Any]()
    for title, fast, slow in (
        ("map, against solve_ivp", "map", "solve_ivp"),
        ("the same points only, against solve_ivp", "sample", "solve_ivp"),
        ("map, against the scalar bisection", "map", "scalar"),
    ):
        ratio = ratios(times[slow], times[fast])
        micro = [1e6 * quartiles(times[name]).median for name in (fast, slow)]
        rows.append([title, f"{micro[0]:.1f}", f"{micro[1]:.0f}", f"{ratio:.2f}", f"{100.0 * worst[slow]:.2f} %"])
        measured[title] = {"ratio": ratio, "us": micro, "worst": worst[slow]}
    print(f"{machine()}; {BEST}")
    print(table(["per point", "map [us]", "other [us]", "ratio (middle half)", "greatest difference"], rows))
    assert max(worst.values()) < CLOSE, f"differences {worst}, more than {CLOSE}"
    save("stability_map", given, measured)


if __name__ == "__main__":
    main()
