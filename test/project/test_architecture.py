"""The arrows of docs/concepts.md hold in every import of every module, lazy ones too."""

import ast
import sys
from collections import Counter
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# package -> packages of ours that it may import
ARROWS = {
    "wam_theory": set(),
    "wam_description": {"wam_theory"},
    "wam_bag": set(),
    "wam_driver": {"wam_theory", "wam_description"},
    "wam_control": {"wam_theory", "wam_description"},
    "wam_ros": {"wam_description", "wam_bag"},
    "wam_sim": {"wam_theory", "wam_description", "wam_bag", "wam_driver", "wam_control"},
    "wam_analysis": {"wam_theory", "wam_description", "wam_bag", "wam_control", "wam_sim"},
    "wam_live": {"wam_description", "wam_bag", "wam_control", "wam_ros", "wam_sim", "wam_analysis"},
    "wam_studies": {
        "wam_theory", "wam_description", "wam_bag", "wam_driver", "wam_control", "wam_ros", "wam_sim", "wam_analysis",
    },
    "wam_stack": {"wam_description", "wam_bag", "wam_control", "wam_sim", "wam_analysis"},
    "wam_cli": {
        "wam_theory", "wam_description", "wam_bag", "wam_driver", "wam_control", "wam_ros", "wam_sim", "wam_analysis",
        "wam_live", "wam_stack", "wam_studies",
    },
}  # fmt: skip
# package -> all that it may import of others; the rest take what they need
DEPENDENCIES = {
    "wam_theory": {"numpy"},
    # pandas where somebody asks for a DataFrame, rosbags for ROS 1 and SQLite
    "wam_bag": {"numpy", "mcap", "lz4", "zstandard", "yaml", "pandas", "rosbags"},
}
KNOW_ROS = ("wam_ros", "wam_cli", "wam_live", "wam_studies")
WITHOUT_CLOCK = ("wam_theory", "wam_description", "wam_driver", "wam_control")
ROS = {"builtin_interfaces", "launch", "launch_ros", "rcl_interfaces", "rclpy", "std_srvs"}
CLOCKS = {"time", "datetime"}
BANNED_NAMES = {"base", "common", "helper", "helpers", "manager", "managers", "util", "utils"}
MOST_CONSTANTS, MOST_ATTRIBUTES = 300, 30
LARGEST_PART = 1.0 / 3.0  # of the source lines, in one package


parsed = cache(ast.parse)


def modules_under(root: Path) -> dict[str, ast.Module]:
    """Every module of the stack by its dotted name."""
    found = {}
    for package in ARROWS:
        for path in sorted(root.glob(f"{package}/**/*.py")):
            parts = path.relative_to(root).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = parsed(path.read_text())
    return found


def called(function: ast.expr) -> str:
    """The last name of what is called."""
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")


def imports_of(name: str, tree: ast.Module, is_package: bool) -> Iterator[tuple[str, int]]:
    """Each dotted name that a module imports anywhere, and the line."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, node.lineno
        elif isinstance(node, ast.ImportFrom):
            parts = name.split(".")
            parents = parts[: len(parts) - node.level + is_package] if node.level else []
            for alias in node.names:
                yield ".".join(filter(None, [*parents, node.module, alias.name])), node.lineno
        elif isinstance(node, ast.Call) and called(node.func) in ("import_module", "__import__"):
            for argument in node.args[:1]:
                if isinstance(argument, ast.Constant):
                    yield str(argument.value), node.lineno


def is_node(name: str) -> bool:
    """Whether a dotted name is a module x_node.py of ours, or something in it."""
    parts = name.split(".")
    # a part is a module where all before it are packages, and a function or a class where not
    modules = [part for i, part in enumerate(parts) if i and ROOT.joinpath(*parts[:i]).is_dir()]
    return parts[0] in ARROWS and any(part.endswith("_node") for part in modules)


def is_ros(target: str) -> bool:
    top = target.split(".")[0]
    return top in ROS or top.endswith("_msgs") or top.startswith("rosidl")


def refusal(name: str, target: str) -> str | None:
    """Why the module may not import the target, None where it may."""
    own, top = name.split(".")[0], target.split(".")[0]
    if is_node(target) and not (is_node(name) and own == top):  # a driver builds on what all drivers have
        return "a node is imported by its entry in the table of nodes, or by a node of its package"
    if is_ros(target) and not is_node(name) and own not in KNOW_ROS:
        return "only nodes, wam_ros and what runs them know ROS"
    allowed = {own, *ARROWS[own], *(["wam_ros"] if is_node(name) else [])}
    if top in ARROWS and top not in allowed:
        return f"{own} may import {', '.join(sorted(ARROWS[own])) or 'nothing of ours'}"
    if own in DEPENDENCIES and top not in {own, *DEPENDENCIES[own], *sys.stdlib_module_names}:
        return f"{own} needs {', '.join(sorted(DEPENDENCIES[own]))} and the standard library, nothing else"
    if own in WITHOUT_CLOCK and not is_node(name) and top in {*CLOCKS, "random"}:
        return "no clock and no hidden randomness: time is dt, chance a seeded generator"
    return None


def faults_in(name: str, tree: ast.Module) -> Iterator[str]:
    """What is wrong in a module besides its imports, with the line."""
    if name.split(".")[-1].split("_")[-1] in BANNED_NAMES:
        yield f"{name}: name it after what it holds"
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        if getattr(node.func, "id", "") == "print" and not name.startswith("wam_cli."):
            yield f"{name}:{node.lineno} prints: a library logs, returns or raises"
        if called(node.func) == "default_rng" and not node.args and not node.keywords:
            yield f"{name}:{node.lineno} default_rng() without a seed: no hidden randomness"


def complaints(root: Path) -> list[str]:
    """Everything in the packages under root that breaks the architecture, one line each."""
    found = []
    classes: dict[str, list[str]] = {}
    modules = modules_under(root)
    for name, tree in modules.items():
        is_package = (root / name.replace(".", "/") / "__init__.py").is_file()
        imports = imports_of(name, tree, is_package)
        found += [f"{name}:{line} imports {to}: {why}" for to, line in imports if (why := refusal(name, to))]
        found += faults_in(name, tree)
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                classes.setdefault(node.name, []).append(name)
        if name in ARROWS:
            contents = ast.get_docstring(tree) or ""
            inside = {module.split(".")[1] for module in modules if module.startswith(f"{name}.")}
            missing = [module for module in sorted(inside) if module.removesuffix("_node") not in contents]
            found += [f"{name}: its docstring, the table of contents, lacks {', '.join(missing)}"] if missing else []
    found += [f"class {name} is in {' and '.join(where)}" for name, where in classes.items() if len(where) > 1]
    return found


def circles(root: Path) -> list[str]:
    """Modules of one package that import each other in a circle."""
    modules = modules_under(root)
    below: dict[str, set[str]] = {}
    for name, tree in modules.items():
        is_package = (root / name.replace(".", "/") / "__init__.py").is_file()
        targets = {target for target, _ in imports_of(name, tree, is_package)}
        targets |= {target.rpartition(".")[0] for target in targets}  # what is imported may be a name in a module
        own = name.split(".")[0]
        below[name] = {to for to in targets & modules.keys() - {name} if to.split(".")[0] == own}
    try:
        TopologicalSorter(below).prepare()
    except CycleError as error:
        return sorted({*error.args[1]})
    return []


def source_lines(root: Path) -> Counter[str]:
    """Lines of each package."""
    paths = [path for package in ARROWS for path in root.glob(f"{package}/**/*.py")]
    lines: Counter[str] = Counter()
    for path in paths:
        lines[path.relative_to(root).parts[0]] += len(path.read_text().splitlines())
    return lines


def constants_in(tree: ast.Module) -> int:
    """Numbers that a module assigns at its top level, those of tuples counted one by one."""
    values = [one.value for one in tree.body if isinstance(one, ast.Assign | ast.AnnAssign)]
    parts = [part for value in values for part in (value.elts if isinstance(value, ast.Tuple) else [value])]
    numbers = [part.operand if isinstance(part, ast.UnaryOp) else part for part in parts]
    return sum(isinstance(one, ast.Constant) and type(one.value) in (int, float) for one in numbers)


def attributes_of(kind: ast.ClassDef) -> int:
    """Attributes that a class assigns on self."""
    stored = [one for one in ast.walk(kind) if isinstance(one, ast.Attribute) and isinstance(one.ctx, ast.Store)]
    return len({one.attr for one in stored if isinstance(one.value, ast.Name) and one.value.id == "self"})


@pytest.mark.slow
def test_numbers_have_homes_and_classes_are_small():
    """A threshold belongs to the dataclass of its subsystem."""
    trees = modules_under(ROOT).values()
    assert sum(map(constants_in, trees)) <= MOST_CONSTANTS
    classes = [one for tree in trees for one in ast.walk(tree) if isinstance(one, ast.ClassDef)]
    large = {one.name for one in classes if attributes_of(one) > MOST_ATTRIBUTES}
    assert not large


@pytest.mark.slow
def test_every_module_obeys_the_architecture():
    assert complaints(ROOT) == []


@pytest.mark.slow
def test_no_module_of_a_package_imports_itself_through_others():
    assert circles(ROOT) == []


def test_a_planted_circle_is_found(tmp_path):
    plant_a_sound_tree(tmp_path)
    assert circles(tmp_path) == []
    (tmp_path / "wam_driver" / "amplifier.py").write_text("def step():\n    from wam_driver import plant")
    assert circles(tmp_path) == ["wam_driver.amplifier", "wam_driver.plant"]


def test_no_package_holds_more_than_a_third_of_the_source():
    lines = source_lines(ROOT)
    large = {package: count for package, count in lines.items() if count > LARGEST_PART * lines.total()}
    assert large == {}, f"of {lines.total()} lines"


@pytest.mark.slow
def test_every_package_is_looked_at():
    assert {name.split(".")[0] for name in modules_under(ROOT)} == set(ARROWS)
    assert {path.name for path in ROOT.glob("wam_*") if path.is_dir()} == set(ARROWS)


def test_arrows_point_downwards():
    order = list(ARROWS)
    for package, below in ARROWS.items():
        assert below <= set(order[: order.index(package)]), package


@pytest.mark.slow
@pytest.mark.parametrize(("path", "source"), [
    ("wam_theory/friction.py", "import scipy"), ("wam_description/arm.py", "import wam_driver.plant"),
    ("wam_description/synchroniser.py", "from wam_ros import run"),
    ("wam_bag/writer.py", "from wam_description.topics import TOPICS"),
    ("wam_driver/plant.py", "from wam_control.gravity import Gravity"),
    ("wam_driver/plant.py", "def f():\n    import rclpy"),
    ("wam_driver/plant.py", "from sensor_msgs.msg import JointState"),
    ("wam_driver/plant.py", "from . import driver_node"), ("wam_driver/plant.py", "from .. import wam_control"),
    ("wam_driver/driver_node.py", "from wam_control import gravity"),
    ("wam_control/velocity/gravity_node.py", "import wam_driver"),
    ("wam_control/gravity.py", "import importlib\nimportlib.import_module('wam_driver.plant')"),
    ("wam_control/gravity.py", "from time import monotonic"),
    ("wam_control/gravity.py", "import numpy as np\nnoise = np.random.default_rng()"),
    ("wam_control/gravity.py", "print('here')"), ("wam_control/gravity.py", "class Arm:\n    pass"),
    ("wam_ros/messages.py", "from wam_control.gravity import Gravity"),
    ("wam_sim/simulation.py", "from wam_ros.messages import read"), ("wam_analysis/report.py", "import rclpy"),
    ("wam_analysis/report.py", "from wam_studies import press"), ("wam_studies/press.py", "print('pressed')"),
    ("wam_cli/commands/up.py", "from wam_driver.driver_node import DriverNode"), ("wam_driver/motor_utils.py", ""),
    ("wam_control/unnamed.py", ""), ("wam_studies/losses.py", "from wam_cli import main"),
])  # fmt: skip
def test_a_planted_fault_is_found(tmp_path, path, source):
    plant_a_sound_tree(tmp_path)
    assert complaints(tmp_path) == []
    (tmp_path / path).write_text(source)
    assert complaints(tmp_path) != []


def plant_a_sound_tree(root: Path) -> None:
    """Write a small stack in which each kind of module uses all that it may."""
    sources = {
        "wam_theory/friction.py": "import math\nimport numpy as np",
        "wam_description/arm.py": "import pinocchio\nfrom wam_theory import friction\nclass Arm:\n    pass",
        "wam_description/topics.py": "from typing import NamedTuple",
        "wam_description/synchroniser.py": "NODES = {'driver': 'wam_driver.driver_node:DriverNode'}",
        "wam_bag/writer.py": "import numpy\nimport mcap.writer",
        "wam_driver/plant.py": "import mujoco\nfrom wam_description.arm import Arm\nfrom . import amplifier",
        "wam_driver/driver_node.py": "import time\nimport rclpy\nfrom std_msgs.msg import Bool\n"
        "from wam_ros.messages import read\nfrom .plant import Plant",
        "wam_control/gravity.py": "import numpy as np\nnoise = np.random.default_rng(seed=1)",
        "wam_control/velocity/gravity_node.py": "from wam_description.arm import Arm\nfrom .gravity import Gravity",
        "wam_ros/messages.py": "import rclpy\nimport wam_description.arm\nfrom wam_bag import writer",
        "wam_sim/simulation.py": "import wam_driver.plant\nfrom wam_control.gravity import Gravity",
        "wam_analysis/report.py": "import matplotlib\nimport wam_sim.simulation\nimport wam_control.gravity",
        "wam_studies/press.py": "from wam_analysis import report\nimport wam_driver.plant\nimport wam_sim",
        "wam_live/page.py": "import viser\nimport rclpy\nfrom wam_ros import messages\nfrom wam_analysis import report",
        "wam_studies/losses.py": "import rclpy\nimport wam_ros.messages\nfrom wam_studies import press",
        "wam_stack/simulate.py": "from wam_sim.simulation import Simulation",
        "wam_cli/main.py": "import importlib",
        "wam_cli/commands/up.py": "import rclpy\nimport wam_ros.messages\nfrom wam_studies import press\nprint(1)",
    }
    for path, source in sources.items():
        file = root / path
        file.parent.mkdir(parents=True, exist_ok=True)
        (file.parent / "__init__.py").touch()
        file.write_text(source)
    for package in ARROWS:
        names = " ".join(path.stem for path in (root / package).iterdir())
        (root / package / "__init__.py").write_text(f'"""{names}"""')


def test_a_subclass_of_a_compiled_class_is_compiled_too() -> None:
    """Compiled, the package could not be imported otherwise; the tests themselves run the plain files."""
    listed = next(
        ast.literal_eval(node.value)
        for node in parsed((ROOT / "setup.py").read_text()).body
        if isinstance(node, ast.Assign) and [called(target) for target in node.targets] == ["COMPILED"]
    )
    compiled = {path.removesuffix(".py").replace("/", ".") for path in listed}
    classes = {
        node.name: (module, {called(one) for one in node.bases})
        for module, tree in modules_under(ROOT).items()
        for node in tree.body
        if isinstance(node, ast.ClassDef)
    }
    native = {name for name, (module, _) in classes.items() if module in compiled}
    plain = {name: sorted(bases & native) for name, (module, bases) in classes.items() if module not in compiled}
    assert native
    assert {name: bases for name, bases in plain.items() if bases} == {}
