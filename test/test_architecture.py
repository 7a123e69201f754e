"""The arrows of docs/house.md hold in every import of every module, lazy ones too."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

# package -> what it may import of ours.  A shell (x_node.py) may import wam_ros on top.
ARROWS = {
    "wam_theory": set(),
    "wam_description": {"wam_theory"},
    "wam_driver": {"wam_description", "wam_theory"},
    "wam_control": {"wam_description", "wam_theory"},
    "wam_ros": {"wam_description"},
    "wam_analysis": {"wam_theory", "wam_description", "wam_driver", "wam_control", "wam_ros"},
}
# Where the stack is put together; they may name everything, and nobody else may import them.
ROOTS = {"wam_ros.cli", "wam_ros.commands", "wam_ros.bring_up"}
MACHINES = ("wam_theory", "wam_description", "wam_driver", "wam_control")
ROS = {
    "ament_index_python",
    "builtin_interfaces",
    "launch",
    "launch_ros",
    "rcl_interfaces",
    "rclpy",
    "std_srvs",
}
CLOCKS = {"time", "datetime"}
BANNED_NAMES = {"base", "common", "helper", "helpers", "manager", "managers", "util", "utils"}


def modules_under(root: Path) -> dict[str, ast.Module]:
    """Every module of the stack by its dotted name."""
    found = {}
    for package in ARROWS:
        for path in sorted(root.glob(f"{package}/**/*.py")):
            parts = path.relative_to(root).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = ast.parse(path.read_text(), path)
    return found


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
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith(("import_module", "__import__")):
            for argument in node.args[:1]:
                if isinstance(argument, ast.Constant):
                    yield str(argument.value), node.lineno


def is_shell(name: str) -> bool:
    return name.partition(".")[2].split(".")[0].endswith("_node")


def is_ros(target: str) -> bool:
    top = target.split(".")[0]
    return top in ROS or top.endswith("_msgs") or top.startswith("rosidl")


def is_root(name: str) -> bool:
    return any(name == root or name.startswith(root + ".") for root in ROOTS)


def refusal(name: str, target: str) -> str | None:
    """Why the module may not import the target, None where it may."""
    own, top = name.split(".")[0], target.split(".")[0]
    if is_root(name):
        return None
    if is_root(target):
        return "only the command line puts the stack together"
    if top in ARROWS and is_shell(target):
        return "nobody imports a shell"
    if is_ros(target) and not is_shell(name) and own != "wam_ros":
        return "only shells and wam_ros know ROS"
    if top in ARROWS and top != own and top not in ARROWS[own] and not (is_shell(name) and top == "wam_ros"):
        return f"{own} may import {', '.join(sorted(ARROWS[own])) or 'nothing of ours'}"
    if own == "wam_theory" and top not in {own, "numpy", *sys.stdlib_module_names}:
        return "theory is numpy and the standard library"
    if own in MACHINES and not is_shell(name) and top in {*CLOCKS, "random"}:
        return "a machine has no clock and no hidden randomness: time is dt, chance a seeded generator"
    return None


def reaches_ros(start: str, graph: dict[str, list[str]]) -> list[str] | None:
    """The shortest way from a module over ours to ROS, None where there is none."""
    ways = [[start]]
    seen = {start}
    for way in ways:
        for target in graph[way[-1]]:
            if is_ros(target):
                return [*way, target]
            parts = target.split(".")
            for step in (".".join(parts[:length]) for length in range(1, len(parts) + 1)):
                if step in graph and step not in seen:
                    seen.add(step)
                    ways.append([*way, step])
    return None


def complaints(root: Path) -> list[str]:
    """Everything in the packages under root that breaks the architecture, one line each."""
    found = []
    graph = {}
    for name, tree in modules_under(root).items():
        is_package = (root / name.replace(".", "/") / "__init__.py").is_file()
        imports = list(imports_of(name, tree, is_package))
        graph[name] = [target for target, _ in imports]
        found += [f"{name}:{line} imports {to}: {why}" for to, line in imports if (why := refusal(name, to))]
        if name.split(".")[-1].split("_")[-1] in BANNED_NAMES:
            found.append(f"{name}: name it after what it holds")
        for node in ast.walk(tree):
            if not isinstance(node, ast.Call):
                continue
            call = ast.unparse(node.func)
            if call == "print" and not name.startswith("wam_ros.commands."):
                found.append(f"{name}:{node.lineno} prints: a library logs, returns or raises")
            if call.endswith("default_rng") and not node.args and not node.keywords:
                found.append(f"{name}:{node.lineno} default_rng() without a seed: no hidden randomness")
    for name in graph:
        if name.startswith("wam_analysis") and (way := reaches_ros(name, graph)):
            found.append(f"{' -> '.join(way)}: analysis works without ROS")
    return found


def test_every_module_obeys_the_architecture():
    assert complaints(ROOT) == []


def test_every_package_is_looked_at():
    assert {name.split(".")[0] for name in modules_under(ROOT)} == set(ARROWS)
    assert {path.name for path in ROOT.glob("wam_*") if path.is_dir()} == set(ARROWS)


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("wam_theory/friction.py", "import scipy"),
        ("wam_theory/friction.py", "from wam_description import units"),
        ("wam_description/arm.py", "import wam_driver.plant"),
        ("wam_driver/plant.py", "from wam_control.gravity import Gravity"),
        ("wam_driver/plant.py", "def f():\n    import rclpy"),
        ("wam_driver/plant.py", "from sensor_msgs.msg import JointState"),
        ("wam_driver/plant.py", "import wam_ros"),
        ("wam_driver/plant.py", "from . import driver_node"),
        ("wam_driver/plant.py", "from .driver_node import DriverNode"),
        ("wam_driver/plant.py", "from .. import wam_control"),
        ("wam_driver/driver_node.py", "from wam_control import gravity"),
        ("wam_control/gravity_node.py", "import wam_driver"),
        ("wam_control/gravity.py", "import importlib\nimportlib.import_module('wam_driver.plant')"),
        ("wam_control/gravity.py", "from time import monotonic"),
        ("wam_control/gravity.py", "import datetime"),
        ("wam_control/gravity.py", "import numpy as np\nnoise = np.random.default_rng()"),
        ("wam_control/gravity.py", "print('here')"),
        ("wam_ros/lockstep.py", "import wam_driver"),
        ("wam_ros/lockstep.py", "from wam_ros import cli"),
        ("wam_analysis/report.py", "import rclpy"),
        ("wam_analysis/report.py", "from wam_driver import driver_node"),
        ("wam_analysis/report.py", "from wam_ros.messages import read"),
        ("wam_driver/motor_utils.py", ""),
        ("wam_control/base.py", ""),
    ],
)
def test_a_planted_fault_is_found(tmp_path, path, source):
    plant_a_sound_tree(tmp_path)
    assert complaints(tmp_path) == []
    (tmp_path / path).write_text(source)
    assert complaints(tmp_path) != []


def plant_a_sound_tree(root: Path) -> None:
    """Write a small stack in which each kind of module uses all that it may."""
    sources = {
        "wam_theory/friction.py": "import math\nimport numpy as np",
        "wam_description/arm.py": "import pinocchio\nfrom wam_theory import friction",
        "wam_driver/plant.py": "import mujoco\nfrom wam_description.arm import Arm\nfrom . import amplifier",
        "wam_driver/driver_node.py": "import time\nimport rclpy\nfrom std_msgs.msg import Bool\n"
        "from wam_ros.messages import read\nfrom .plant import Plant",
        "wam_control/gravity.py": "import numpy as np\nnoise = np.random.default_rng(seed=1)",
        "wam_ros/messages.py": "import rclpy\nimport wam_description.arm",
        "wam_ros/topics.py": "from typing import NamedTuple",
        "wam_ros/cli.py": "import importlib",
        "wam_ros/commands/up.py": "import wam_driver.driver_node\nfrom wam_analysis import report\nprint('hello')",
        "wam_analysis/report.py": "import matplotlib\nfrom wam_ros import topics\nimport wam_control.gravity",
    }
    for path, source in sources.items():
        file = root / path
        file.parent.mkdir(exist_ok=True)
        (file.parent / "__init__.py").touch()
        file.write_text(source)
