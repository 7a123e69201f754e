"""The package installs twice from one tree: with pip into a prefix, with colcon into a workspace."""

import argparse
import importlib.metadata
import os
import re
import runpy
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest
import yaml
from ament_index_python.packages import get_package_prefix, get_package_share_directory
from catkin_pkg.package import parse_package
from conftest import LONG, wait
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from wam_cli.commands import live, up
from wam_description.configuration import Configuration, packaged
from wam_description.nodes import NODES as TABLE
from wam_description.parameters import ParameterError
from wam_description.topics import BY_NAME
from wam_ros.network import occupant

pytestmark = pytest.mark.ros
ROOT = Path(__file__).resolve().parents[2]
SHIPPED = (
    "LICENSE", "package.xml", "pyproject.toml", "setup.cfg", "setup.py", "config", "launch", "rviz", "resource",
    "scripts",
)  # fmt: skip
NODES = tuple(TABLE)
PATHS = ("PATH", "PYTHONPATH", "AMENT_PREFIX_PATH", "LD_LIBRARY_PATH")


def copy_tree(target: Path) -> Path:
    """Copy what a clone holds and a build reads: pip and setuptools leave things behind where they build."""
    target.mkdir(parents=True)
    for path in (*(ROOT / name for name in SHIPPED), *ROOT.glob("wam_*")):
        if path.is_dir():
            shutil.copytree(path, target / path.name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(path, target)
    return target


def environment(prefix: Path, **more: str) -> dict[str, str]:
    """What a shell has after `source <prefix>/setup.sh`, with nothing of the user's."""
    paths = (str(Path(sys.executable).parent), "/usr/bin", "/bin")
    wheels = ("LD_LIBRARY_PATH", "_ROS_WHEELS_BOOTSTRAP_COMPLETE")
    return {
        "PATH": os.pathsep.join(paths),
        "HOME": str(prefix),
        "ROS_LOG_DIR": str(prefix / "ros_log"),
        "MPLCONFIGDIR": str(prefix / "matplotlib"),
        "ROS_DOMAIN_ID": os.environ["ROS_DOMAIN_ID"],
        "ROS_AUTOMATIC_DISCOVERY_RANGE": os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"],
        "AMENT_PREFIX_PATH": str(prefix),
        "PYTHONPATH": os.pathsep.join(str(path) for path in prefix.glob("lib/python3*/site-packages")),
        **{name: os.environ[name] for name in wheels if name in os.environ},
        **more,
    }


def clean_environment(home: Path) -> dict[str, str]:
    """What a shell has in which no workspace is sourced yet."""
    return environment(home, COLCON_HOME=str(home / "colcon"), AMENT_PREFIX_PATH="", PYTHONPATH="")


def sourced(workspace: Path) -> list[str]:
    """The beginning of a command that runs in a sourced workspace."""
    return ["sh", "-c", f'. "{workspace}/install/setup.sh" && exec "$@"', "sh"]


def run(*command: str | Path, cwd: Path, env: dict[str, str]) -> str:
    """Run a command to its end; its output, or a failure that shows it."""
    done = subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, timeout=LONG, check=False)
    assert done.returncode == 0, f"{command} gave {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def prefix(tmp_path_factory) -> Path:
    """`pip install` of this tree into an empty prefix, with no index at hand."""
    base = tmp_path_factory.mktemp("pip")
    tree = copy_tree(base / "tree")
    offline = ("--no-index", "--no-deps", "--no-build-isolation", "--no-warn-script-location")
    # --ignore-installed: pip would uninstall the copy that runs these tests
    command = ("install", "--quiet", "--ignore-installed", *offline, "--prefix", base / "prefix", tree)
    run(sys.executable, "-m", "pip", "--disable-pip-version-check", *command, cwd=base, env=environment(base))
    return base / "prefix"


@pytest.fixture(scope="module")
def workspace(tmp_path_factory) -> Path:
    """`colcon build` of this tree in a workspace of its own."""
    base = tmp_path_factory.mktemp("colcon")
    copy_tree(base / "src" / "wam_stack")
    env = clean_environment(base)
    run(Path(sys.executable).with_name("colcon"), "build", cwd=base, env=env)
    return base


@pytest.fixture(scope="module", params=["pip", "colcon"])
def installed(request) -> Path:
    """The prefix of the package, as each of the two builds lays it out."""
    if request.param == "pip":
        return request.getfixturevalue("prefix")
    return request.getfixturevalue("workspace") / "install" / "wam_stack"


def files_in(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir() if path.is_file()}


def test_ament_index_finds_the_package(installed, monkeypatch):
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(installed))
    assert get_package_prefix("wam_stack") == str(installed)
    share = Path(get_package_share_directory("wam_stack"))
    assert (share / "package.xml").read_bytes() == (ROOT / "package.xml").read_bytes()
    for folder in ("config", "config/experiments", "config/experiments/sets"):
        assert files_in(share / folder) == {path.name for path in ROOT.glob(f"{folder}/*.yaml")}
    assert files_in(share / "launch") == {path.name for path in ROOT.glob("launch/*.launch.*")}


def test_every_node_is_where_ros2_run_looks(installed):
    executables = installed / "lib" / "wam_stack"
    assert files_in(executables) - {"wam"} == {*NODES, "node"}
    assert all(os.access(path, os.X_OK) for path in executables.iterdir())


def test_every_python_module_is_installed(installed):
    (site,) = installed.glob("lib/python3*/site-packages")
    modules = {path.relative_to(ROOT) for path in ROOT.glob("wam_*/**/*.py")}
    assert {path.relative_to(site) for path in site.glob("wam_*/**/*.py")} == modules


def test_launchers_and_console_scripts_have_the_same_names_and_start_the_same_module(prefix, workspace):
    launchers = {}
    for path in (prefix / "lib" / "wam_stack").iterdir():
        launchers[path.name] = re.search(r"-m (\S+)", path.read_text())[1]
    (egg_info,) = (workspace / "install").glob("wam_stack/lib/python3*/site-packages/*.egg-info")
    (distribution,) = importlib.metadata.distributions(path=[str(egg_info.parent)])
    scripts = {
        point.name: point.module
        for point in distribution.entry_points
        if point.name != "wam" and point.group == "console_scripts"
    }
    assert launchers == scripts


def test_launcher_prefers_the_python_of_its_own_prefix(prefix, tmp_path):
    launcher = tmp_path / "lib" / "wam_stack" / "driver"
    python = tmp_path / "bin" / "python3"
    for path in (launcher, python):
        path.parent.mkdir(parents=True)
    shutil.copy2(prefix / "lib" / "wam_stack" / "driver", launcher)
    python.write_text("#!/bin/sh\nfor last; do :; done\necho own python got $last\n")
    python.chmod(0o755)
    said = run(launcher, "--ros-args", "-p", "a:=1", cwd=tmp_path, env=environment(tmp_path))
    assert said == "own python got a:=1\n"


def test_each_build_runs_its_own_copy(prefix, workspace):
    # with another one on the path of the interpreter, as in `make test`
    code = "import wam_ros, wam_description.configuration as own; print(wam_ros.__file__, own.packaged('wam'))"
    where = (sys.executable, "-P", "-c", code)
    said = run(*where, cwd=prefix, env=environment(prefix))
    assert all(line.startswith(str(prefix)) for line in said.split())
    said = run(*sourced(workspace), *where, cwd=workspace, env=clean_environment(workspace))
    assert all(line.startswith(str(workspace)) for line in said.split())


def start_and_stop(command: list[str | Path], name: str, ros, cwd: Path, env: dict[str, str]) -> None:
    """Start a node, wait until the ROS graph has it, interrupt it, and expect a clean end.

    The recorder, to which nothing came, reports that, with exit code 1.
    """
    onlooker = ros.node("onlooker")
    process = subprocess.Popen(command, cwd=cwd, env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        deadline = time.monotonic() + LONG
        while not onlooker.wait_for_node(f"/wam/{name}", timeout=0.5):
            assert process.poll() is None, f"{name} ended with {process.returncode}:\n{process.stdout.read()}"
            assert time.monotonic() < deadline, f"{name} did not appear within {LONG} s"
        process.send_signal(signal.SIGINT)
        said, _ = process.communicate(timeout=LONG)
        is_empty = name == "recorder"
        assert process.returncode == int(is_empty), f"{name} ended with {process.returncode}:\n{said}"
        assert ("is empty: no message came" in said) is is_empty, said
        assert "Traceback" not in said, said
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()


def arguments(prefix: Path) -> list[str]:
    config = prefix / "share" / "wam_stack" / "config" / "wam.yaml"
    return ["--ros-args", "--params-file", str(config), "-r", "__ns:=/wam"]


@pytest.mark.parametrize("name", ["driver", "recorder"])
def test_an_executable_starts_its_node_and_stops_when_interrupted(prefix, ros, tmp_path, name):
    command = [prefix / "lib" / "wam_stack" / name, *arguments(prefix)]
    start_and_stop(command, name, ros, tmp_path, environment(prefix))


def test_a_sourced_colcon_workspace_starts_a_node(workspace, ros, tmp_path):
    package = workspace / "install" / "wam_stack"
    command = [*sourced(workspace), package / "lib" / "wam_stack" / "velocity_loop", *arguments(package)]
    env = clean_environment(tmp_path)
    start_and_stop(command, "velocity_loop", ros, tmp_path, env)


@pytest.fixture
def launch_file(prefix, monkeypatch):
    """The installed launch file: its declared arguments and the function that makes its nodes."""
    # the module `launch` on PyPI is another program, so the few names that the file takes stand in for it
    for module, names in {
        "launch": {"LaunchContext": object, "LaunchDescription": list},
        "launch.actions": {
            "DeclareLaunchArgument": lambda name, **more: SimpleNamespace(name=name, **more),
            "ExecuteProcess": SimpleNamespace,
            "LogInfo": SimpleNamespace,
            "OpaqueFunction": SimpleNamespace,
            "Shutdown": SimpleNamespace,
        },
        "launch.substitutions": {
            "LaunchConfiguration": lambda name: SimpleNamespace(perform=lambda context: context[name])
        },
        "ament_index_python.packages": {
            "get_package_share_directory": lambda name: str(prefix / "share" / name),
            "get_packages_with_prefixes": lambda: {"wam_stack": str(prefix)},
        },
        "launch_ros": {},
        "launch_ros.actions": {"Node": SimpleNamespace},
    }.items():
        monkeypatch.setitem(sys.modules, module, SimpleNamespace(**names))
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(prefix))
    launch = runpy.run_path(str(prefix / "share" / "wam_stack" / "launch" / "wam.launch.py"))
    *declared, start = launch["generate_launch_description"]()
    return {argument.name: argument for argument in declared}, start.function


CHOSEN = {
    "config": "wam", "overrides": "", "namespace": "left", "mode": "lockstep", "processes": "true", "scenario": "",
    "record": "true", "bag": "", "log_level": "info", "tf": "false", "frame_prefix": "", "rviz": "false",
    "trajectory_action": "false", "use_sim_time": "true",
}  # fmt: skip


def test_launch_file_starts_an_executable_for_every_node_of_the_configuration(prefix, launch_file):
    declared, start = launch_file
    assert set(declared) == set(CHOSEN)
    nodes = start(CHOSEN)
    config = yaml.safe_load((prefix / "share" / "wam_stack" / "config" / "wam.yaml").read_text())
    assert [node.executable for node in nodes] == [*config["/**"]["ros__parameters"]["nodes"], "recorder"]
    assert {node.executable for node in nodes} <= set(NODES)
    assert {node.package for node in nodes} == {"wam_stack"}
    assert {node.namespace for node in nodes} == {"left"}
    config["/**"]["ros__parameters"]["timing"]["mode"] = "lockstep"
    config["/**"]["ros__parameters"]["nodes"].append("recorder")
    assert all(node.on_exit.reason for node in nodes), "the launch ends with the first node"
    assert all(node.ros_arguments == ["--log-level", "info"] for node in nodes)
    assert all(yaml.safe_load(Path(*node.parameters).read_text()) == config for node in nodes)
    assert len(start({**CHOSEN, "record": "false"})) == len(nodes) - 1
    assert len(start({**CHOSEN, "mode": "realtime"})) == len(nodes)
    for grouped in ({"processes": "grouped"}, {"mode": "realtime", "processes": "false"}):
        inner, outer, recorder = start({**CHOSEN, **grouped})
        assert (inner.executable, inner.arguments) == ("node", ["driver", "velocity_loop"])
        others = ["transform", "gravity", "force_loop", "contact_estimator"]
        assert (outer.executable, outer.arguments) == ("node", others)
        assert (recorder.executable, recorder.arguments) == ("recorder", [])


def test_launch_file_starts_one_process_that_ends_with_the_launch(launch_file):
    _, start = launch_file
    (whole,) = start({**CHOSEN, "processes": "false"})
    assert whole.cmd[1:4] == ["-m", "wam_cli.main", "up"]
    options = argparse.ArgumentParser()
    up.arguments(options)
    chosen = options.parse_args(whole.cmd[4:])
    assert (chosen.namespace, chosen.log_level) == ("left", "info")
    shared = yaml.safe_load(Path(chosen.config).read_text())["/**"]["ros__parameters"]
    assert (shared["timing"]["mode"], shared["nodes"][-1]) == ("lockstep", "recorder")
    assert whole.on_exit.reason
    assert whole.additional_env == {"WAM_STACK_PARENT": str(os.getpid())}


def test_launch_serves_the_action_where_its_type_is_installed(launch_file, monkeypatch):
    _, start = launch_file
    chosen = {**CHOSEN, "processes": "false"}
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: SimpleNamespace())
    for value in ("auto", "true"):
        _, server = start({**chosen, "trajectory_action": value})
        assert server.cmd[1:4] == ["-m", "wam_cli.main", "live"]
        options = argparse.ArgumentParser()
        live.arguments(options)
        assert options.parse_args(server.cmd[4:]) == options.parse_args(["--trajectories", "--namespace", "left"])
        assert server.additional_env == {"WAM_STACK_PARENT": str(os.getpid())}
    assert len(start(chosen)) == 1
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert not any("live" in getattr(one, "cmd", []) for one in start({**chosen, "trajectory_action": "auto"}))


def test_every_launch_argument_has_a_description_and_a_default_that_is_allowed(launch_file):
    declared, start = launch_file
    for argument in declared.values():
        assert len(argument.description) > 20
        assert argument.choices is None or argument.default_value in argument.choices
    defaults = {name: argument.default_value for name, argument in declared.items()}
    whole, note = start({**defaults, "trajectory_action": "false"})
    assert note.msg.startswith("no /tf: install robot_state_publisher")
    file = whole.cmd[whole.cmd.index("--config") + 1]
    assert Configuration.load(file).sections == Configuration.load(packaged("wam")).sections


def test_launch_plays_a_scenario_into_a_bag_with_values_of_its_own(launch_file, tmp_path):
    _, start = launch_file
    given = {"scenario": "demo_scenario", "record": "false", "bag": str(tmp_path / "first"), "processes": "false"}
    values = {"overrides": "force_loop:force_gain=[0.002]; timing.real_time_factor=0.0"}
    (whole,) = start(CHOSEN | given | values)
    config = Configuration.load(whole.cmd[whole.cmd.index("--config") + 1])
    assert config.shared.nodes[-2:] == ("scenario", "recorder")
    assert config.sections["scenario"]["script"] == str(packaged("demo_scenario", "scenario"))
    recorder = config.sections["recorder"]
    assert (recorder["directory"], recorder["name"]) == (str(tmp_path), "first")
    assert config.sections["force_loop"]["force_gain"] == [0.002]
    assert config.shared.timing.real_time_factor == 0.0
    with pytest.raises(ParameterError, match="no scenario 'nosuch'"):
        start({**CHOSEN, "scenario": "nosuch"})
    with pytest.raises(ParameterError, match="--set is 'gain'; write"):
        start({**CHOSEN, "overrides": "gain"})


def test_launch_starts_transforms_and_rviz_in_the_namespace_of_the_arm(launch_file):
    _, start = launch_file
    viewers = {"record": "false", "processes": "false", "tf": "true", "rviz": "true"}
    for more, fixed, tree in (({}, "base_link", True), ({"frame_prefix": "left/"}, "left/base_link", False)):
        _, state, rviz = start(CHOSEN | viewers | more)
        assert (state.package, rviz.package) == ("robot_state_publisher", "rviz2")
        assert {state.namespace, rviz.namespace} == {"left"}
        (parameters,) = state.parameters
        robot = ElementTree.fromstring(parameters["robot_description"])
        children = {joint.find("child").get("link") for joint in robot.iter("joint")}
        assert {link.get("name") for link in robot.iter("link")} - children == {"base_link"}, "the root, by REP 120"
        assert parameters["frame_prefix"] == more.get("frame_prefix", "")
        assert parameters["use_sim_time"] is rviz.parameters[0]["use_sim_time"] is True
        assert (("/tf", "tf") in state.remappings) == (("/tf", "tf") in rviz.remappings) == tree
        assert ("/clock", "clock") in rviz.remappings
        view = yaml.safe_load(Path(rviz.arguments[1]).read_text())["Visualization Manager"]
        assert view["Global Options"]["Fixed Frame"] == fixed
        topics = [
            shown[key]["Value"] for shown in view["Displays"] for key in ("Topic", "Description Topic") if key in shown
        ]
        assert {topic.removeprefix("/left/") for topic in topics} <= set(BY_NAME)
        (model,) = [shown for shown in view["Displays"] if shown["Class"].endswith("RobotModel")]
        assert model["TF Prefix"] == more.get("frame_prefix", "").rstrip("/")
    _, state, _ = start(CHOSEN | viewers | {"namespace": "wam"})
    assert state.remappings == [("robot_description", "~/robot_description")]


@pytest.mark.skipif(shutil.which("ros2") is None, reason="needs ros2 launch, of a ROS installation; not in the wheels")
@pytest.mark.parametrize("form", ["py", "xml"])
def test_ros2_launch_shows_every_argument_and_plays_a_scenario_to_its_end(form, prefix, tmp_path, domain_id):
    file = prefix / "share" / "wam_stack" / "launch" / f"wam.launch.{form}"
    own = environment(prefix)
    both = {key: os.pathsep.join(filter(None, (own.get(key), os.environ.get(key)))) for key in PATHS}
    env = {**os.environ, **own, **both, "ROS_DOMAIN_ID": str(domain_id)}
    shown = run("ros2", "launch", file, "--show-args", cwd=tmp_path, env=env)
    assert all(f"'{name}'" in shown for name in CHOSEN)
    short = tmp_path / "short.yaml"
    short.write_text("steps:\n  - {name: release the brakes, seconds: 0.3, request: enable}\n")
    bag = tmp_path / "first"
    run("ros2", "launch", file, f"scenario:={short}", f"bag:={bag}", "trajectory_action:=false", cwd=tmp_path, env=env)
    assert list(tmp_path.glob("first*"))


def test_the_launch_file_in_xml_has_the_same_arguments_and_defaults(prefix, launch_file):
    declared, _ = launch_file
    tree = ElementTree.parse(prefix / "share" / "wam_stack" / "launch" / "wam.launch.xml").getroot()
    assert {arg.get("name"): arg.get("default") for arg in tree.findall("arg")} == {
        name: argument.default_value for name, argument in declared.items()
    }
    (include,) = tree.findall("include")
    passed = {arg.get("name"): arg.get("value") for arg in include.findall("arg")}
    assert passed == {name: f"$(var {name})" for name in declared}
    assert include.get("file") == "$(find-pkg-share wam_stack)/launch/wam.launch.py"


def test_nodes_end_with_the_launch_even_where_it_ends_at_once(launch_file, tmp_path, domain_id):
    _, start = launch_file
    node = next(node for node in start(CHOSEN) if node.executable == "gravity")
    command = [sys.executable, "-P", "-m", "wam_cli.program", "node", "gravity", "--ros-args", "--params-file"]
    # what `ros2 launch` does with a Node, in a process that SIGTERM ends without another thought
    code = (
        "import os, subprocess, sys, time\n"
        "child = subprocess.Popen(sys.argv[2:], env={**os.environ, sys.argv[1]: str(os.getpid())})\n"
        "print(child.pid, flush=True); time.sleep(600)"
    )
    (name, given), *_ = node.additional_env.items()
    assert given == str(os.getpid()), "the launch itself"
    launch = subprocess.Popen(
        [sys.executable, "-c", code, name, *command, *node.parameters], stdout=subprocess.PIPE, text=True
    )
    pid = int(launch.stdout.readline())
    wait(lambda: occupant(domain_id, "/wam", "gravity") == pid, "the node")
    launch.terminate()
    launch.communicate()
    wait(lambda: not occupant(domain_id, "/wam", "gravity"), "an orphan")


def test_package_xml_is_valid_for_ros():
    warnings: list[str] = []
    package = parse_package(str(ROOT / "package.xml"), warnings=warnings)
    package.validate(warnings=warnings)
    assert warnings == []
    assert package.name == "wam_stack"
    assert package.get_build_type() == "ament_python"
    assert package.authors, "ros2 pkg xml shows them"
    depends = {dependency.name for dependency in package.exec_depends}
    name_of_ros = re.compile(
        r"\b(\w+_msgs|\w+_interfaces|std_srvs|rclpy|ament_index_python|launch\w*)(?:[./]|\s+import)"
    )
    files = [*ROOT.glob("wam_*/*.py"), *ROOT.glob("launch/*.py")]
    named = {
        name
        for path in files
        for line in path.read_text().splitlines()
        if line.lstrip().startswith(("from ", "import ")) or "/msg/" in line
        for name in name_of_ros.findall(line)
    }
    assert named <= depends


def reached(name: str, extras: frozenset[str], seen: set[tuple[str, frozenset[str]]]) -> Iterator[Requirement]:
    """Every requirement that a package with its extras leads to."""
    if (name, extras) in seen:
        return
    seen.add((name, extras))
    for line in importlib.metadata.requires(name) or []:
        requirement = Requirement(line)
        marker = requirement.marker
        if marker is None or any(marker.evaluate({"extra": extra}) for extra in ("", *extras)):
            yield requirement
            yield from reached(requirement.name, frozenset(requirement.extras), seen)


def test_constraints_pin_every_package_that_make_test_installs(prefix, monkeypatch):
    lines = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if not line.startswith("#")]
    assert [line for line in lines if not re.fullmatch(r"[a-z0-9.-]+==[0-9][0-9a-z.+]*", line)] == []
    pins = {canonicalize_name(name): version for name, version in (line.split("==") for line in lines)}
    assert len(pins) == len(lines)

    (site,) = prefix.glob("lib/python3*/site-packages")
    monkeypatch.syspath_prepend(str(site))
    needed = {canonicalize_name(one.name) for one in reached("wam_stack", frozenset({"ros", "test"}), set())}
    installed = {name: importlib.metadata.version(name) for name in needed}
    assert installed == {name: pins.get(name) for name in needed}
