"""Cost as the work grows: joints, contacts, minutes of a bag, points of a map, runs on workers.

A run that is not quick keeps every cost as soon as it is known and draws `growth.png` next to this file: one that was
interrupted, or was given `--only`, is continued by the next within some hours, which measures what is missing.
"""

import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from comparing import RESULTS, machine, mark, options, quartiles, ratios, table
from long_bag import repeated
from plant import FREE, Case

from wam_analysis.drawing import STYLE, TRUE
from wam_analysis.findings.analysis import TOPICS_READ, analyse_bag
from wam_bag.bag import read
from wam_control.task.scenario import ScenarioStep
from wam_description.configuration import SHARED, Configuration, packaged
from wam_description.rigid_body import RigidBody
from wam_sim.batch import processes, results
from wam_sim.simulated_bag import record
from wam_sim.simulation import Simulation
from wam_theory.stability_map import largest_stable_steps

PICTURE: Final = Path(__file__).with_name("growth.png")
KEPT: Final = RESULTS / "growth.jsonl"  # of each measurement when, where, work, size and cost in s
RECENT: Final = 12 * 3600.0  # s; older ones may be of another source
Costs = dict[str, dict[int, list[float]]]  # by work and size
ARMS: Final = {4: "wam", 7: "barrett-wam7"}  # joints: configuration; none has more
MORE: Final = 7  # joints behind those, each
DISTANCE: Final = 0.03  # m behind the one before, with
RATIO: Final = 1.0 / 9.7  # of joint to motor, and
CABLE: Final = 0.6  # m of cable, which is soft enough for the plant's step and a light link
RUNS: Final = 24  # of the batch
FASTER: Final = (1.9, 1.95)  # two workers against one: must, aim
POST, DEPTH = 0.05, 1e-3  # m, half length; how far the link is in its surface at the start
LENGTH: Final = 1.0  # s of the arm in a direct run


class Work(NamedTuple):
    """A kind of work, the cost of one size in s, and its sizes: in a quick run, and in others."""

    name: str
    cost: Callable[[int], float]
    quick: tuple[int, ...]
    sizes: tuple[int, ...]


def seconds(work: Callable[[], Any]) -> float:
    """Processor time, because other programs disturb it less."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


def named(name: str) -> Configuration:
    """A configuration of the package."""
    return Configuration.load(packaged(name))


def moving(configuration: Configuration, length: float) -> tuple[Configuration, list[ScenarioStep]]:
    """A configuration with steps that release its arm and move all joints."""
    posture = tuple(angle + 0.1 for angle in configuration.shared.arm.joints.start)
    release = ScenarioStep("release", 0.1 * length, request="enable")
    return configuration, [release, ScenarioStep("move", 0.9 * length, posture)]


def joints(count: int) -> float:
    """A direct run of the whole stack, for a second of the arm."""
    configuration = named(ARMS[min(count, max(ARMS))])
    run = Simulation(*moving(configuration if count in ARMS else lengthened(configuration), LENGTH))
    failures: list[str] = []
    cost = seconds(lambda: failures.append(run.play())) / LENGTH
    if failures != [""]:
        raise SystemExit(f"{count} joints: {failures[0]}")
    return cost


def lengthened(configuration: Configuration) -> Configuration:
    """The production WAM with `MORE` joints behind its wrist, with motors as that of joint 6 and links as the last."""
    shared = configuration.sections[SHARED]
    stages, present = len(shared["arm.cables.stage_length"]), len(shared["arm.joints.names"])
    added = range(present, present + MORE)
    values: dict[str, Any] = {}
    for section, flat in configuration.sections.items():
        for key, given in flat.items():
            if not isinstance(given, (list, tuple)) or len(given) not in (present, stages):
                continue
            more = [given[-1] if key.startswith("arm.links.") else given[-2]] * MORE
            if given[-1] in (f"joint{present}", f"motor{present}", f"link{present}"):
                more = [f"{given[-1].rstrip('0123456789')}{i + 1}" for i in added]
            values[key if section == SHARED else f"{section}:{key}"] = [*given, *more]
    for key in ("centre", "inertia", "product"):
        given = shared[f"arm.links.{key}"]
        values[f"arm.links.{key}"] = [*given, *(given[-3:] * MORE)]
    transmission = np.diag([RATIO] * (present + MORE))
    transmission[:present, :present] = np.reshape(shared["arm.joint_from_motor"], (present, present))
    twist, length, offset = (shared[f"arm.joints.{key}"] for key in ("twist", "length", "offset"))
    return configuration.with_values(
        {
            **values,
            "arm.joint_from_motor": transmission.ravel().tolist(),
            "arm.joints.twist": [*twist, *(0.5 * np.pi * (-1.0) ** i for i in added)],
            # the cover of the wrist ends at the next joint
            "arm.joints.length": [*length, 0.0, *[DISTANCE] * (MORE - 1)],
            "arm.joints.offset": [*offset, *[0.0] * MORE],
            "arm.cables.stage_length": [*shared["arm.cables.stage_length"], *[CABLE] * MORE],
        }
    )


def contacts(count: int) -> float:
    """A substep of the plant, the outer link on that many posts."""
    arm = named("wam").shared.arm
    body, length, radius = RigidBody(arm), arm.covers.length[-1], arm.covers.radius[-1]
    along = np.linspace(0.2, 0.8, count) * length if count > 1 else [0.5 * length]
    root, tip, *posts = (np.array(body.point(FREE, arm.covers.names[-1], (x, 0.0, 0.0))) for x in (0.0, length, *along))
    slope = np.hypot(*(tip - root)[:2]) / np.linalg.norm(tip - root)
    posts = np.array(posts) - [0.0, 0.0, radius / slope + POST - DEPTH]
    one = {"shapes": "cylinder", "stiffness": 4000.0, "damping": 20.0, "hardening": 0.0, "friction": 0.3}
    posted = {key: [value] * count for key, value in one.items()} | {
        "names": [f"post{i}" for i in range(count)],
        "positions": posts.ravel().tolist(),
        "rotations": [0.0] * (3 * count),
        "sizes": [0.003, POST, 0.0] * count,
    }
    case = Case(FREE, 0.0, values={f"driver:world.obstacles.{key}": value for key, value in posted.items()})
    if (found := case.plant.data.ncon) != count:
        raise SystemExit(f"{found} contacts, not {count}; look at `contacts`")
    return min(case.measure(40)[0] for _ in range(50))


def stability_map(points: int) -> float:
    """The map of figure 5.8."""
    side = round(points**0.5)
    gamma, zeta = np.meshgrid(np.linspace(1.02, 3.0, side), np.geomspace(0.05, 1.0, side))
    return seconds(lambda: largest_stable_steps(gamma, zeta))


def played(_: int) -> int:
    """One run of the batch: the stamp at its end."""
    run = Simulation(*moving(named("wam"), LENGTH))
    run.play()
    return run.driver.stamp


def batch(workers: int, runs: int) -> float:
    """Direct runs on the wall clock, after the workers have started."""
    with processes(workers) as executor:
        results(played, range(2 * workers), executor)
        begin = time.perf_counter()
        results(played, range(runs), executor)
        return time.perf_counter() - begin


class Bags:
    """Bags of some minutes in a folder, made from one of a few seconds."""

    def __init__(self, folder: Path, length: float) -> None:
        self._folder, self._length = folder, length

    def _bag(self, minutes: int) -> Path:
        """A bag of this length; written the first time."""
        bag, short = self._folder / str(minutes), self._folder / "short"
        if not short.exists() and (failure := record(*moving(named("wam"), self._length), short)):
            raise SystemExit(failure)
        if not bag.exists():
            repeated(short, bag, 60.0 * minutes)
        return bag

    def read(self, minutes: int) -> float:
        """Reading the topics of the analysis."""
        bag = self._bag(minutes)
        return seconds(lambda: read(bag, TOPICS_READ, may_lack=True))

    def analysed(self, minutes: int) -> float:
        """Analysis of what was read."""
        bag = read(self._bag(minutes), TOPICS_READ, may_lack=True)
        return seconds(lambda: analyse_bag(bag, lambda doing: None))


def kept() -> Costs:
    """The costs that recent runs have kept."""
    costs: Costs = {}
    lines = KEPT.read_text(encoding="utf-8").splitlines() if KEPT.exists() else []
    for known in map(json.loads, lines):
        if time.time() - known["at"] < RECENT and known["machine"] == machine():
            costs.setdefault(known["work"], {}).setdefault(known["size"], []).append(known["cost"])
    return costs


def keep(work: str, size: int, cost: float) -> None:
    """Keep one cost."""
    RESULTS.mkdir(exist_ok=True)
    with KEPT.open("a", encoding="utf-8") as file:
        line = {"at": time.time(), "machine": machine(), "work": work, "size": size, "cost": cost}
        file.write(json.dumps(line) + "\n")


def draw(costs: Costs) -> None:
    """Cost against size, relative to the smallest; dashed: in proportion."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(1, len(costs), figsize=(9.0, 2.4), layout="constrained")
        for panel, (name, found) in zip(axes, costs.items(), strict=True):
            sizes = np.array(list(found)) / min(found)
            growth = np.array([quartiles(values).median for values in found.values()])
            panel.loglog(sizes, growth / growth[0], "o-", color=TRUE)
            panel.loglog(sizes, sizes ** (-1.0 if name == "workers" else 1.0), "--", color="0.6", linewidth=1.0)
            panel.set_title(name)
            panel.set_xticks(sizes, [f"{size:g}" for size in found])
            panel.minorticks_off()
        axes[0].set_ylabel("cost, relative")
        figure.savefig(PICTURE, dpi=110)


def main() -> None:
    """Measure in turns, print the table, draw the picture."""
    parser = options(__doc__ or "", rounds=1)
    parser.add_argument("--only", help="measure this kind of work alone, as 'minutes read'")
    given = parser.parse_args()
    rounds = given.rounds or 1
    costs = {} if given.quick else kept()
    with tempfile.TemporaryDirectory(prefix="wam_bench_") as folder:
        bags = Bags(Path(folder), 2.0 if given.quick else 20.0)
        works = [
            Work("joints", joints, (4, 14), (4, 7, 14)),
            Work("contacts", contacts, (1, 2), (1, 2, 4, 8)),
            Work("minutes read", bags.read, (1, 2), (1, 4, 10, 60)),
            Work("minutes analysed", bags.analysed, (1, 2), (1, 4, 10, 60)),
            Work("points of a map", stability_map, (100, 400), (10_000, 90_000, 1_000_000)),
            Work("workers", lambda workers: batch(workers, 4 if given.quick else RUNS), (1, 2), (1, 2, 4)),
        ]
        names = [work.name for work in works]
        if given.only not in (None, *names):
            parser.error(f"--only is '{given.only}'; allowed: {', '.join(names)}")
        for turn in range(rounds):
            for work in works:
                for size in work.quick if given.quick else work.sizes:
                    values = costs.setdefault(work.name, {}).setdefault(size, [])
                    if len(values) <= turn and given.only in (None, work.name):
                        values.append(work.cost(size))
                        if not given.quick:
                            keep(work.name, size, values[-1])
    costs = {name: {size: costs[name][size] for size in sorted(costs[name]) if costs[name][size]} for name in names}
    rows = []
    for name, found in costs.items():
        for size, values in found.items():
            smallest = min(found)
            count = min(len(values), len(found[smallest]))
            growth = ratios(values[:count], found[smallest][:count])
            each = f"{growth.median * (size / smallest if name == 'workers' else smallest / size):.2f}"
            reached = mark(1.0 / growth.median, *FASTER) if (name, size) == ("workers", 2) else ""
            rows.append([f"{name}: {size}", f"{1e3 * quartiles(values).median:.3g}", f"{growth:.2f}", each, reached])
    print(machine())
    print(table(["work", "cost [ms]", "relative to the smallest", "the same, in proportion", "[must, aim]"], rows))
    if not (given.quick or given.only):
        draw({name: found for name, found in costs.items() if found})


if __name__ == "__main__":
    main()
