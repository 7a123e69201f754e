"""Write the generated parts of the documentation: tables, listings, pictures.

Pages are written by hand, apart from the blocks between `<!-- generated: NAME -->` and `<!-- end -->`, which this
program fills.  `make docs` runs it; a test fails if a block is stale.
"""

import argparse
import ast
import math
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from functools import cache, partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.patches import Polygon

from wam_analysis.drawing import INK, SHAFTS
from wam_analysis.table import markdown
from wam_control.task.scenario import STEP_KEYS
from wam_control.velocity.dither import Dither
from wam_control.velocity.velocity_loop import VelocityLoopParameters
from wam_description.arm import Arm, Shared, Timing
from wam_description.configuration import Configuration
from wam_description.driver_contract import REQUIREMENTS
from wam_description.interface import Interface, declared
from wam_description.nodes import NODES
from wam_description.parameters import fields
from wam_description.topics import FORCE_AXIS, TOPICS
from wam_description.wiring import Input
from wam_sim.batch import processes
from wam_sim.pieces import default_file, sources
from wam_studies.figures import backdrivability, open_loop, transmissions
from wam_studies.figures.catalogue import FIGURES, file_of, numbers, percent
from wam_studies.figures.catalogue import table as figures_table
from wam_studies.figures.panels import Panels, distances
from wam_studies.figures.style import GREY, draw_panels, picture
from wam_studies.force_benchmark.straight_arm import elbow_table
from wam_studies.plant import effects
from wam_studies.scorecard import measures, stiffness_table
from wam_studies.scorecard import report as scorecard
from wam_studies.tasks.pictures import save as save_task
from wam_studies.thesis import claims
from wam_studies.thesis.definition import load, tasks
from wam_studies.thesis.evaluation import evaluate
from wam_studies.thesis.rows import markdown as rows_of_a_result
from wam_theory.equations import EQUATIONS

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs"))
import moving_picture  # noqa: E402

CONFIGURATION = ROOT / "config" / "wam.yaml"
SAMPLES = ROOT / "bags" / "sample"
CLAIMS = ROOT / "docs" / "thesis.yaml"
DITHER_CYCLE, DITHER_POSE = 40, (0.1, -0.9, 0.2, 0.9)  # periods; rad
LISTED = 4  # elements of a list in the table of parameters
CITED = re.compile(r"\((\d\.\d+)(?:\.[ab])?\)")
BLOCK = re.compile(r"(<!-- generated: (?P<name>[^>]+?) -->\n).*?(<!-- end -->)", re.DOTALL)


def number(value: Any) -> str:
    """A value as text, with at most seven digits."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (tuple, list)):
        return ", ".join(map(number, value))
    return f"{value:.7g}" if isinstance(value, float) else str(value)


# topics


def rate(name: str, timing: Timing) -> str:
    """Rate of a topic with the periods of config/wam.yaml."""
    periods = {"inner": 1, "outer": timing.outer_divisor, "display": timing.outer_divisor * timing.display_divisor}
    if name not in periods:
        return name
    return f"{name}, {1.0 / (timing.period * periods[name]):g} Hz"


def topics(configuration: Configuration) -> str:
    """The table of topics, with the nodes that publish and take each."""
    every = set(NODES)
    interface = Interface(configuration.with_values({"nodes": list(NODES)}).shared)

    def nodes(names: Sequence[str]) -> str:
        return "every node" if set(names) == every else ", ".join(names) or "–"

    timing = configuration.shared.timing
    rows = [
        [
            f"`{topic.name}`",
            topic.type,
            nodes(interface.publishers(topic.name)),
            nodes([name for name in interface.subscribers(topic.name) if name != "recorder"]),
            rate(topic.rate, timing),
            topic.doc,
        ]
        for topic in TOPICS
    ]
    return markdown(["topic", "type", "from", "to", "rate", "content"], rows)


def steps(configuration: Configuration) -> str:
    """What each step of each node waits for in lockstep, and what it takes the newest of."""
    interface = Interface(configuration.with_values({"nodes": [name for name in NODES if name != "recorder"]}).shared)

    def named(item: Input) -> str:
        late = " from `d` earlier" if item.delayed else " from one outer period earlier" if item.answers else ""
        return f"`{item.topic}`{late}"

    rows = []
    for name, one in interface.declarations.items():
        for reaction in one.reactions:
            waited = [named(item) for item in reaction.inputs if interface.is_streamed(item.topic)]
            newest = [named(item) for item in reaction.inputs if not interface.is_streamed(item.topic)]
            trigger = f"`{reaction.trigger.topic}`{' of an outer period' if reaction.thinned else ''}"
            rows.append([name, trigger, ", ".join(waited) or "nothing", ", ".join(newest) or "–"])
    return markdown(["node", "trigger, at time t", "waits for", "takes the newest of"], rows)


# parameters


def parameter_rows(cls: type, given: Mapping[str, Any]) -> Iterator[list[str]]:
    """One row for each parameter of a class; a star marks one that can be set while the node runs."""
    for field in fields(cls):
        default = "as in arm" if field.follows else "" if field.default is None else field.default
        value = short(given.get(field.name, default))
        allowed = f"{field.allowed} {field.unit}".strip() or field.kind.__name__
        yield [f"`{field.name}`{'*' * field.live}", f"`{value}`" if value else "empty", allowed, field.doc]


def short(value: Any) -> str:
    """A value as text; of equal elements the first one, of a long list the first ones."""
    if isinstance(value, (tuple, list)) and len(value) > 1:
        if len(set(value)) == 1:
            return f"{number(value[0])} each"
        if len(value) > LISTED:
            return f"{number(value[:2])} ... ({len(value)})"
    return number(value)


def parameters(configuration: Configuration) -> str:
    """Every parameter of every node."""
    head = ["parameter", "value in `wam`", "allowed", "meaning"]
    shared = list(parameter_rows(Shared, configuration.sections["/**"]))
    parts = ["## Shared by all nodes, section `/**`\n", markdown(head, shared)]
    for node in NODES:
        rows = list(parameter_rows(declared(node).parameter_class, configuration.sections[node]))
        parts += [f"## `{node}`\n", markdown(head, rows) if rows else "None of its own.\n"]
    return "\n".join(parts)


# equations


def functions(path: Path) -> Iterator[ast.FunctionDef]:
    """The public functions of a module."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            yield node


def citing() -> dict[str, list[str]]:
    """Equation number to the functions, module.name, that cite it in the first line of their docstring."""
    found: dict[str, list[str]] = {}
    for path in sorted(ROOT.glob("wam_theory/*.py")):
        for function in functions(path):
            summary = (ast.get_docstring(function) or "").split("\n")[0]
            for number_ in dict.fromkeys(CITED.findall(summary)):
                found.setdefault(number_, []).append(f"{path.stem}.{function.name}")
    return found


def tests_by_function() -> dict[str, list[str]]:
    """Name of a function to the tests, file.name, that use it, apart from tests of shapes and refusals."""
    found: dict[str, list[str]] = {}
    paths = [*sorted(ROOT.glob("test/theory/test_equations_*.py")), ROOT / "test" / "theory" / "test_stick_slip.py"]
    for path in paths:
        named = {function.name: names_in(function) for function in functions(path)}
        for test, names in named.items():
            if test.startswith("test_") and not re.search("refus|broadcast", test):
                through = set().union(*(named[name] for name in names & set(named)))
                for name in sorted(names | through):
                    found.setdefault(name, []).append(f"{path.stem}.{test}")
    return found


def names_in(function: ast.FunctionDef) -> set[str]:
    """Every name and attribute that a function mentions."""
    return {getattr(node, "id", getattr(node, "attr", "")) for node in ast.walk(function)}


def equations() -> str:
    """Every numbered equation: section, content, functions and a test of them; a star marks a correction."""
    citing_, using, rows = citing(), tests_by_function(), []
    for row in EQUATIONS:
        names = citing_.get(row.number, [])
        tests = [test for name in names for test in using.get(name.split(".")[1], [])]
        shown = row.reason or ", ".join(f"`{name}`" for name in names)
        number_ = f"({row.number}){'*' * bool(row.correction)}"
        rows.append([number_, row.section, row.content, shown, f"`{tests[0].partition('.')[2]}`" if tests else ""])
    return markdown(["", "section", "content", "function", "test"], rows)


# pages


plant_study = cache(effects.errors)


@cache
def found_figures() -> dict[str, Panels]:
    """Numbers of every figure."""
    with processes() as executor:
        return numbers(list(FIGURES), executor, default_file("figures"))


def draw_figures() -> None:
    """Draw the thesis's figures."""
    for name, values in found_figures().items():
        draw_panels(values, file_of(name, ROOT / "docs" / "figures"))


def blocks() -> dict[str, Callable[[], str]]:
    """Blocks of the pages, by name."""
    configuration = Configuration.load(CONFIGURATION)
    return {
        "topics": lambda: topics(configuration),
        "parameters": lambda: parameters(configuration),
        "steps": lambda: steps(configuration),
        "driver contract": lambda: markdown(
            ["row", "a driver"], [[f"`{key}`", row.text] for key, row in REQUIREMENTS.items()]
        ),
        "plant": lambda: effects.table(plant_study()),
        "steps of a scenario": lambda: markdown(
            ["key", "value"], [[f"`{key}`", text] for key, text in STEP_KEYS.items()]
        ),
        "dither": lambda: dither(configuration),
        "columns of force_axis": lambda: markdown(["column", "meaning"], list(FORCE_AXIS.items())),
        "elbow": lambda: f"\n{(ROOT / 'docs' / 'elbow.txt').read_text(encoding='utf-8')}",
        "figures": lambda: figures_table(found_figures()),
        "equations": equations,
        "scorecard": lambda: scorecard(configuration),
        "recorded dynamic range": lambda: recorded_range(configuration),
        "transmissions": transmissions.table,
        "open-loop accuracy": lambda: open_loop.table(found_figures()["2.1.1"]),
        "backdrivability": lambda: backdrivability.table(found_figures()["3.2.6"]),
        "stiffness rule": lambda: stiffness_table(configuration),
        **{f"task {name}": partial(task_of, name) for name in tasks()},
        "claims, count": lambda: claims.count(claims.load(CLAIMS)),
        "verdict of the demonstration": partial(verdict, "demo.txt"),
        "verdict of barrett-wam7": partial(verdict, "barrett-demo.txt"),
        "joints of barrett-wam7": joints_of_today,
        "motors of barrett-wam7": motors_of_today,
        "examples/direct_run.py": lambda: f"```python\n{(ROOT / 'examples' / 'direct_run.py').read_text()}```\n",
    }


def every_claim() -> str:
    """The table of claims, with the distances that were measured."""
    named = {
        f"figure {name}": max(distances(found).values(), default=math.nan) for name, found in found_figures().items()
    }
    named |= {f"effect {name}": distance for name, distance in plant_study().items()}
    return claims.table(chain(*claims.load(CLAIMS).values()), {name: percent(value) for name, value in named.items()})


def recorded_range(configuration: Configuration) -> str:
    """Dynamic range of the presses in the sample of `wam-press`."""
    rows = evaluate(load("wam-press"), SAMPLES / "wam-press").rows
    force = measures(configuration).steady_force
    errors = [
        (row.quantity, abs(row.deviation * float(row.predicted))) for row in rows if row.quantity.endswith("true")
    ]
    shown = [(name.removesuffix(", true"), f"{error:.2g}", f"{force / error:.0f}") for name, error in errors]
    return markdown(("step of `wam-press`", "error, N", "steady force / this error"), shown)


def verdict(file: str) -> str:
    """The verdict of a demonstration, as `wam demo` prints it."""
    _, head, rest = (ROOT / "docs" / file).read_text(encoding="utf-8").partition("Result")
    return "\n```text\n" + f"{head}{rest}".partition("\n\n")[0].rstrip() + "\n```\n"


@cache
def today() -> Arm:
    """The production WAM with its wrist."""
    return Configuration.load(ROOT / "config" / "barrett-wam7.yaml").shared.arm


def joints_of_today() -> str:
    """Geometry, range and strength of its joints, as the configuration has them."""
    joints, through = today().joints, today().transmission
    degrees = [f"{math.degrees(twist):.0f}" for twist in joints.twist]
    strength = [f"{torque:.3g}" for torque in through.largest_joint_torques(today().motors.peak_torque)]
    ranges = [f"{low:g} to {high:g}" for low, high in zip(joints.lower, joints.upper, strict=True)]
    columns = zip(joints.names, degrees, joints.length, joints.offset, ranges, strength, strict=True)
    head = ["joint i", "alpha of i-1 [deg]", "a of i-1 [m]", "d of i [m]", "range [rad]", "peak torque [N m]"]
    return markdown(head, [[name, *map(number, rest)] for name, *rest in columns])


def motors_of_today() -> str:
    """Its motors; the last two columns are assumed."""
    motors, rows = today().motors, []
    for i, motor in enumerate(motors.names):
        ratios = zip(today().joints.names, today().transmission.motor_from_joint[i].tolist(), strict=True)
        turns = " ".join(f"{ratio:+.7g} {joint}" for joint, ratio in ratios if abs(ratio) > 1e-9)
        known = (motors.inertia, motors.torque_constant, motors.peak_torque, motors.continuous_torque)
        circuit = today().circuits[i]
        assumed = (motors.static_friction[i], circuit.stiffness)
        rows.append([motor, turns, *(number(values[i]) for values in known), *(f"{value:.3g}" for value in assumed)])
    head = ["motor", "motor angle from joint angles", "drive inertia [kg m²]", "torque constant [N m/A]",
            "peak torque [N m]", "continuous torque [N m]", "static friction [N m], assumed",
            "cable stiffness [N m/rad], assumed"]  # fmt: skip
    return markdown(head, rows)


def task_of(name: str) -> str:
    """The numbers of a whole-arm task, from its sample bag."""
    result = evaluate(load(name), SAMPLES / name)
    return f"{rows_of_a_result(result.rows)}\n![{load(name).title}](tasks/{name}.png)\n"


def draw_tasks() -> None:
    """The pictures of the whole-arm tasks, from their sample bags."""
    folder = ROOT / "docs" / "tasks"
    folder.mkdir(exist_ok=True)
    for name in tasks():
        task = load(name)
        save_task(task, SAMPLES / name, evaluate(task, SAMPLES / name), folder / f"{name}.png")
        print(f"docs/tasks/{name}.png", flush=True)


def dither(configuration: Configuration) -> str:
    """Cost of the dither."""
    shared = configuration.with_values({"timing.dither_cycle": DITHER_CYCLE}).shared
    own = configuration.node("velocity_loop", VelocityLoopParameters).dither
    cost = Dither(shared.arm, shared.timing, own).cost(DITHER_POSE)
    rows = [
        ["frequency", f"{1.0 / (shared.timing.dither_cycle * shared.timing.period):g} Hz"],
        ["amplitude divided by static friction of motor and joints", f"{own.level:g}"],
        ["motion of the tool without friction, peak to peak", f"{1e3 * cost.tip_motion:.2g} mm"],
        ["heat of the hottest winding, fraction of its continuous rating", f"{100.0 * max(cost.heat):.2g} %"],
    ]
    return markdown(["the dither", ""], rows)


def filled(text: str) -> str:
    """A page with its generated blocks up to date."""
    known = blocks()
    return BLOCK.sub(lambda found: f"{found[1]}\n{known[found['name']]()}\n{found[3]}", text)


def pages(chosen: Sequence[Path] = ()) -> dict[Path, str]:
    """Pages with their generated blocks up to date: the chosen ones; or every one, and the table of claims."""
    every = chosen or [ROOT / "README.md", *sorted(ROOT.glob("docs/*.md"))]
    texts = {path: path.read_text(encoding="utf-8") for path in every}
    found = {path: filled(text) for path, text in texts.items() if BLOCK.search(text)}
    return found if chosen else {**found, CLAIMS.with_suffix(".csv"): every_claim()}


def demonstrate(name: str, kept: str, is_moving: bool = False) -> None:
    """Run the demonstration of a configuration in lockstep and keep its report, and its moving picture, by a name."""
    with tempfile.TemporaryDirectory(prefix="wam_docs_") as folder:
        configuration = Configuration.load(ROOT / "config" / name).with_values({"recorder:directory": folder})
        file = Path(folder) / "wam.yaml"
        file.write_text(configuration.text, encoding="utf-8")
        words = ["demo", "--no-live", "--real-time-factor", "0", "--name", "demo", "--config", str(file)]
        done = subprocess.run(
            [sys.executable, "-m", "wam_cli.main", *words], stdout=subprocess.PIPE, text=True, check=False
        )
        if done.returncode:
            raise SystemExit(f"the demonstration failed, see above; docs/{kept}.* are unchanged")
        report = done.stdout[done.stdout.index("Verdict\n") :].partition("\nProvenance")[0].rstrip()
        command = f"wam demo --no-live --real-time-factor 0 --config {Path(name).stem}"
        code = sources(None)[:12]
        origin = f"Written by `{command}` on {datetime.now(UTC):%Y-%m-%d}, code and configuration `{code}`."
        (ROOT / "docs" / f"{kept}.txt").write_text(f"{origin}\n\n{report}\n", encoding="utf-8")
        if is_moving:
            moving_picture.save(Path(folder) / "demo", ROOT / "docs" / f"{kept}.webp")
    print(*(f"docs/{kept}{ending}" for ending in (".txt", *[".webp"] * is_moving)), sep="\n", flush=True)


def draw_motor_space() -> None:
    """What the two motors of the differential can give, at the motors and at joints 2 and 3."""
    arm = Configuration.load(CONFIGURATION).shared.arm
    change = arm.transmission.motor_from_joint[1:3, 1:3].T  # joint torques from motor torques
    square = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    peak, friction = (np.array(values[1:3]) for values in (arm.motors.peak_torque, arm.motors.static_friction))
    with picture(ROOT / "docs" / "concepts" / "motor-space.png", 7.2, 3.4) as figure:
        left, right = figure.subplots(1, 2)
        for axes, limits, name in ((left, peak, "peak torque"), (right, friction, "static friction")):
            colour = SHAFTS[axes is right]
            corners = square * limits @ change.T
            axes.add_patch(Polygon(corners, facecolor=colour, alpha=0.15, edgecolor="none"))
            axes.add_patch(Polygon(corners, fill=False, edgecolor=colour, linewidth=1.6))
            box = np.abs(corners).max(axis=0)
            axes.add_patch(Polygon(square * box, fill=False, edgecolor=GREY, linewidth=0.9, linestyle="--"))
            for i, side in ((0, "right"), (1, "left")):
                tip = change @ (np.eye(2)[i] * limits[i])
                axes.annotate("", tip, (0.0, 0.0), arrowprops={"arrowstyle": "-|>", "color": INK})
                axes.annotate(f"motor {i + 2}", tip, (0, -12), textcoords="offset points", fontsize=8, ha=side)
            axes.set(xlim=(-1.35 * box[0], 1.35 * box[0]), ylim=(-1.35 * box[1], 1.35 * box[1]), title=name)
            axes.set(xlabel="torque at joint 2 [N m]", ylabel="torque at joint 3 [N m]")


def run_examples() -> None:
    """Run the notebooks and the sweep."""
    notebooks = sorted(str(path) for path in (ROOT / "docs" / "notebooks").glob("*.ipynb"))
    for command in (["docs/notebook.py", *notebooks], ["examples/sweep.py", "--picture", "docs/sweep.png"]):
        subprocess.run([sys.executable, *command], cwd=ROOT, check=True)


DRAWN = {
    "demonstration": partial(demonstrate, "wam.yaml", "demo", is_moving=True),
    "barrett": partial(demonstrate, "barrett-wam7.yaml", "barrett-demo"),
    "tasks": draw_tasks,
    "figures": draw_figures,
    "concepts": draw_motor_space,
    "examples": run_examples,
}


def main() -> None:
    """Draw the pictures, then write the pages."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=DRAWN, default="", help="nothing but these pictures, and what goes with them")
    parser.add_argument(
        "--pages", nargs="*", type=ROOT.joinpath, metavar="PAGE", help="no pictures; only these pages, or all of them"
    )
    given = parser.parse_args()
    if given.only:
        DRAWN[given.only]()
        return
    if given.pages is None:
        (ROOT / "docs" / "elbow.txt").write_text(elbow_table(Configuration.load(CONFIGURATION)), encoding="utf-8")
        for draw in DRAWN.values():
            draw()
    for path, text in pages(given.pages or ()).items():  # last: they have numbers of the demonstration
        path.write_text(text, encoding="utf-8")
        print(path.relative_to(ROOT))


if __name__ == "__main__":
    main()
