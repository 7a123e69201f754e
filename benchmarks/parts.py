"""Where a period of the direct run goes: processor time of the parts of the simulation, of the driver and of a sample.

The whole is measured without clocks in it, its parts and what they consist of in runs of their own, in turns.
"""

import tempfile
import time
from collections import Counter
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import comparing.source_tree  # noqa: F401 - before the packages
import yaml
from comparing import arguments, machine, quartiles, save, table
from speed import scenario

from wam_control.task.scenario import load
from wam_description.configuration import Configuration, packaged
from wam_description.interface import declared
from wam_sim.simulation import Simulation

NODES = ("contact_estimator", "force_loop", "velocity_loop", "transform", "gravity", "scenario")
TRUTH, REST = "true state, published", "bus, synchronisers, scheduling"
WITHIN = {  # methods of an object of the simulation, by part
    "driver: substeps": ("driver.plant", "step"),
    "driver: measuring": ("driver", "_measure"),
    "driver: limits": ("driver", "_watch_limits"),
    "driver: amplifier": ("driver.amplifier", "step"),
    "contact_estimator: observe": ("nodes.contact_estimator._estimator", "observe"),
    "contact_estimator: estimate": ("nodes.contact_estimator._estimator", "estimate"),
}
PARTS = (
    "whole",
    *(row for part in ("driver", *NODES) for row in (part, *(one for one in WITHIN if one.startswith(f"{part}: ")))),
    TRUTH,
    REST,
)
Spent = Counter[str]


def timed(spent: Spent, part: str, work: Callable[..., Any]) -> Callable[..., Any]:
    """A function whose time counts for a part, s."""

    @wraps(work)
    def call(*given: Any) -> Any:
        begin = time.perf_counter()
        result = work(*given)
        spent[part] += time.perf_counter() - begin
        return result

    return call


def node_class(spent: Spent, name: str) -> Any:
    """A node of the stack whose steps are timed."""
    kind = declared(name).node
    steps = {step: value for step in dir(kind) if hasattr(value := getattr(kind, step), "reaction")}
    body = {step: timed(spent, name, value) for step, value in steps.items()}
    return type(kind.__qualname__, (kind,), {**body, "__module__": kind.__module__})


def play(configuration: Configuration, script: Path, which: str) -> Spent:
    """Microseconds per period of the parts: '' the whole, 'nodes' the nodes and the driver, 'within' parts of these."""
    spent: Spent = Counter()
    classes = {name: node_class(spent, name) for name in NODES} if which == "nodes" else {}
    run = Simulation(configuration, load(script, configuration.shared), classes)
    places = {"driver": ("driver", "advance"), TRUTH: ("", "_publish_truth")}
    for part, (path, name) in {"": {}, "nodes": places, "within": WITHIN}[which].items():
        place: Any = run
        for step in filter(None, path.split(".")):
            place = place[step] if isinstance(place, dict) else getattr(place, step)
        setattr(place, name, timed(spent, part, getattr(place, name)))
    wall, own = time.perf_counter(), time.process_time()
    if failure := run.play():
        raise SystemExit(failure)
    wall, own = time.perf_counter() - wall, time.process_time() - own
    if not which:
        spent["whole"] = wall
    periods = run.driver.stamp / configuration.shared.timing.period_ns
    # what others ran meanwhile is taken off every part alike: to read the processor time costs more than some parts
    return Counter({part: 1e6 * own / wall * seconds / periods for part, seconds in spent.items()})


def main() -> None:
    """Measure in turns, print the table."""
    given = arguments(__doc__, rounds=15, quick_rounds=1)
    found: dict[str, list[float]] = {}
    with tempfile.TemporaryDirectory(prefix="wam_bench_") as folder:
        script = Path(folder) / "script.yaml"
        script.write_text(yaml.safe_dump(scenario(1.0 if given.quick else 5.0)), encoding="utf-8")
        values = {"timing.mode": "lockstep", "scenario:script": str(script)}
        configuration = Configuration.load(packaged("wam")).with_values(values)
        for _ in range(given.rounds):
            whole, nodes, within = (play(configuration, script, which) for which in ("", "nodes", "within"))
            nodes[REST] = max(whole["whole"] - sum(nodes.values()), 1e-9)
            for part, value in {**whole, **nodes, **within}.items():
                found.setdefault(part, []).append(value)
    print(machine())
    rows = [[part, f"{quartiles(found[part]):.1f}"] for part in PARTS]
    print(table(["part", "us of a period (middle half)"], rows))
    save("parts", given, {part: quartiles(values) for part, values in found.items()})


if __name__ == "__main__":
    main()
