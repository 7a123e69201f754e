"""What the documentation says is what the code does: pages are current, commands run, names exist."""

import ast
import difflib
import importlib.util
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import pytest
import yaml
from conftest import LONG

from wam_description.configuration import Configuration, packaged
from wam_description.topics import BY_NAME

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
HANDBOOK = {
    path.name: path.read_text(encoding="utf-8")
    for path in [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *ROOT.glob("docs/*.md")]
}
FENCE = re.compile(r"^```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)
MARKED = re.compile(r"<!-- ([^\n]*?) -->\n+```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)
MARKS = ("run", "start: ", "run with the stack", "not run here: ", "generated: ")


class Block(NamedTuple):
    """A block of code in the README and what its mark asks the tests to do with it."""

    mark: str
    language: str
    code: str


BLOCKS = [Block(*found) for found in MARKED.findall(README)]


def marked(mark: str, language: str = "sh") -> list[Block]:
    return [block for block in BLOCKS if block.mark.startswith(mark) and block.language == language]


def load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


# generated pages


@pytest.fixture(scope="module")
def generate() -> Any:
    return load(ROOT / "docs" / "generate.py")


@pytest.mark.slow
def test_generated_pages_are_current(generate: Any) -> None:
    stale = [path.name for path, text in generate.pages().items() if path.read_text(encoding="utf-8") != text]
    assert stale == [], "these pages are not what the code says; run 'make docs' and commit them"
    assert {path.name for path in generate.pages()} >= {"README.md", "topics.md", "parameters.md", "constants.md"}


def test_a_changed_block_is_noticed_and_a_changed_sentence_is_kept(generate: Any) -> None:
    text = HANDBOOK["topics.md"]
    assert generate.filled(text.replace("| `motor_states`", "| `motor_status`")) == text
    own = text.replace("# Topics\n", "# Our topics\n")
    assert generate.filled(own) == own


# commands and examples


class Shell:
    """A new user's shell: `wam` and `python3` on PATH, in an empty directory."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        programs = directory / "bin"
        programs.mkdir()
        for name, command in (("wam", "-m wam_cli.main"), ("python3", "")):
            program = programs / name
            program.write_text(f'#!/bin/sh\nexec "{sys.executable}" {command} "$@"\n')
            program.chmod(0o755)
        (directory / "examples").symlink_to(ROOT / "examples")
        path = f"{programs}{os.pathsep}{os.environ['PATH']}"
        self.environment = {**os.environ, "PATH": path, "PYTHONPATH": str(ROOT)}

    def start(self, command: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            ["sh", "-c", f"exec {command}"],
            cwd=self.directory,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def run(self, *command: str) -> str:
        done = subprocess.run(
            command, cwd=self.directory, env=self.environment, capture_output=True, text=True, timeout=LONG, check=False
        )
        assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
        return done.stdout


@pytest.fixture
def shell(tmp_path: Path, domain_id: int) -> Shell:
    return Shell(tmp_path)


@pytest.fixture
def started(ros: Any, shell: Shell) -> Iterator[Any]:
    """Start commands, wait until their nodes are there; interrupted at the end, they must end well."""
    onlooker = ros.node("onlooker")
    processes: list[subprocess.Popen[str]] = []

    def start(commands: list[str], nodes: list[str]) -> None:
        processes.extend(shell.start(command) for command in commands)
        for node in nodes:
            assert onlooker.wait_for_node(f"/wam/{node}", timeout=LONG), f"{commands}: no node /wam/{node}"

    def kill() -> None:
        for process in processes:
            if process.poll() is None:
                process.kill()

    with ExitStack() as stack:
        stack.callback(kill)
        yield start
        for process in processes:
            assert process.poll() is None, f"{process.args!r} ended by itself:\n{process.communicate()[0]}"
            process.send_signal(signal.SIGINT)
        for process in processes:
            said, _ = process.communicate(timeout=LONG)
            assert process.returncode == 0, said
            assert "Traceback" not in said, said


def record_first_bag(shell: Shell, domain_id: int) -> None:
    """Record `bags/first` with a scenario shorter than the demonstration."""
    from wam_ros.bring_up import Composition

    script = shell.directory / "short.yaml"
    press = {"frame": "outer_link", "newtons": [0.0, -1.0, 0.0]}
    script.write_text(yaml.safe_dump({"steps": [{"name": "press", "seconds": 0.05, "force": press}]}))
    base = Configuration.load(packaged("wam"))
    configuration = base.with_values(
        {
            "nodes": [*base.shared.nodes, "scenario", "recorder"],
            "timing.real_time_factor": 0.0,
            "scenario:script": str(script),
            "recorder:directory": str(shell.directory / "bags"),
            "recorder:name": "first",
        }
    )
    with Composition(configuration, domain_id=domain_id) as composition:
        scenario: Any = composition.nodes["scenario"]
        composition.spin(lambda: scenario.done)


def test_every_block_of_the_readme_says_whether_it_is_run() -> None:
    assert len(BLOCKS) == len(FENCE.findall(README))
    assert [block.mark for block in BLOCKS if not block.mark.startswith(MARKS)] == []


@pytest.mark.parametrize("block", [block for block in marked("run") if block.mark == "run"])
def test_commands_of_the_readme_run(block: Block, shell: Shell) -> None:
    shell.run("sh", "-e", "-c", block.code)


@pytest.mark.parametrize("block", marked("start: "))
def test_nodes_started_as_the_readme_says_are_there_and_stop(block: Block, started: Any) -> None:
    started(block.code.splitlines(), block.mark.removeprefix("start: ").split())


def test_python_of_the_readme_reads_a_bag(shell: Shell, domain_id: int) -> None:
    blocks = marked("run", "python")
    assert len(blocks) == 2
    record_first_bag(shell, domain_id)
    for block in blocks:
        assert shell.run("python3", "-c", block.code) != ""


def test_example_of_a_client_presses_with_the_commanded_force(shell: Shell, started: Any) -> None:
    (block,) = marked("run with the stack")
    started(["wam up"], ["driver", "contact_estimator"])
    said = shell.run("sh", "-e", "-c", block.code)
    pressed = [tuple(map(float, found)) for found in re.findall(r"commanded +(\S+) N, measured +(\S+) N", said)]
    assert [commanded for commanded, _ in pressed] == [5.0, 10.0]
    for commanded, measured in pressed:
        assert measured == pytest.approx(commanded, rel=0.2)


def test_example_without_ros_says_how_the_force_was_held(shell: Shell) -> None:
    said = shell.run("python3", "examples/direct_run.py")
    assert len(re.findall(r"commanded .* N  measured .* N", said)) >= 6


# names


def test_topics_and_services_named_in_the_handbook_exist(domain_id: int) -> None:
    from wam_description.nodes import NODES
    from wam_ros.bring_up import Composition

    nodes = [name for name in NODES if name != "recorder"]
    configuration = Configuration.load(packaged("wam")).with_values({"nodes": nodes, "timing.real_time_factor": 0.0})
    with Composition(configuration, domain_id=domain_id) as composition:
        services = {service.service_name for node in composition.nodes.values() for service in node.services}
    topics = {name if name.startswith("/") else f"/wam/{name}" for name in BY_NAME}
    for page, text in HANDBOOK.items():
        named = set(re.findall(r"/wam/[a-z_/]*[a-z]", text))
        assert named <= topics | services | {f"/wam/{node}" for node in NODES}, page


def test_topics_in_backticks_exist() -> None:
    looks_like_a_topic = re.compile(r"(sim|contact)/\w+|\w+_(command|states|sensors|effort|currents|torques)")
    for page, text in HANDBOOK.items():
        if page == "parameters.md":
            continue
        for name in set(re.findall(r"`([\w/]+)`", text)) - BY_NAME.keys() - {"use_joint_sensors"}:
            meant = difflib.get_close_matches(name, BY_NAME, cutoff=0.85)
            assert not meant, f"{page}: `{name}`, is {meant[0]} meant?"
            assert not looks_like_a_topic.fullmatch(name), f"{page}: there is no topic `{name}`"


def test_files_that_the_handbook_links_to_exist() -> None:
    for page, text in HANDBOOK.items():
        folder = ROOT if page in ("README.md", "CONTRIBUTING.md") else ROOT / "docs"
        for target in re.findall(r"\]\(([^)#:]+)\)", text):
            assert (folder / target).is_file(), f"{page}: {target}"


def spoken(path: Path) -> Iterator[str]:
    """Every text in a module; what an f-string fills in becomes <>."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.JoinedStr):
            yield "".join(str(part.value) if isinstance(part, ast.Constant) else "<>" for part in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


@pytest.mark.slow
def test_refusals_in_the_handbook_are_those_of_the_code() -> None:
    table = HANDBOOK["safety.md"].partition("<!-- messages:")[2]
    messages = re.findall(r"^\|[^|]+\| `(.+)` \|$", table, re.MULTILINE)
    assert len(messages) >= 19
    texts = [text for path in ROOT.glob("wam_*/*.py") for text in spoken(path)]
    for message in messages:
        whole = message.removeprefix("refused: ")  # the driver puts it before an obstacle
        pattern = re.compile(".*?".join(re.escape(part) for part in re.split(r"<\w+>", whole)))
        assert any(pattern.search(text) for text in texts), message
