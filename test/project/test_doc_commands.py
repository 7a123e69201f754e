"""Every command and every block of code in the documentation is run, or says why not.

A comment before a block says what happens to it.  The blocks of a page are played in order, in one directory:

`run`                  the commands end with 0
`file: NAME`           the block is this file
`refused: WORDS`       the commands fail and print these words
`printed`              the lines are among those that the block before printed; `...` stands for any text
`start: NODE ...`      the commands run until the next `start` or the end of the page; then they end with 0
`generated: NAME`      written by docs/generate.py
`not run here: WHY`
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, NamedTuple

import pytest
from conftest import LONG

from wam_ros.testing import RunningArm, locked_domain

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "bags/README.md", "benchmarks/README.md")),
    *sorted((ROOT / "docs").glob("*.md")),
]
FENCE = re.compile(r"(?:<!-- ([^\n]*?) -->\n+)?^```(\w*)\n(.*?)^```", re.DOTALL | re.MULTILINE)
PLAYED = ("run", "file: ", "refused: ", "printed", "start: ")
MARKS = (*PLAYED, "not run here: ", "generated: ")
CODE = ("sh", "bash", "console", "python", "yaml")
NODES = re.compile(r"^wam (demo|up|node|call|bag record)\b", re.MULTILINE)
COMMAND = re.compile(r"^(\$ |wam |make |python3? |pip |ros2 |docker )", re.MULTILINE)


class Block(NamedTuple):
    """A block of a page and what its mark requests."""

    mark: str
    language: str
    code: str
    where: str = ""  # page and line

    @property
    def is_played(self) -> bool:
        """Whether something is done with it here."""
        return self.mark.startswith(PLAYED)

    @property
    def needs_ros(self) -> bool:
        """Whether it starts nodes or talks to them."""
        return self.is_played and bool(self.mark.startswith("start: ") or NODES.search(self.code))


def blocks_of(page: Path) -> list[Block]:
    text = page.read_text(encoding="utf-8")
    name = page.relative_to(ROOT)
    return [
        Block(found[1] or "", found[2], found[3], f"{name}:{text.count(chr(10), 0, found.start(3))}")
        for found in FENCE.finditer(text)
    ]


def unmarked(blocks: list[Block]) -> list[str]:
    """Blocks that nothing says about whether they are run."""
    return [
        block.code
        for block in blocks
        if not block.mark.startswith(MARKS) and (block.language in CODE or COMMAND.search(block.code))
    ]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_block_says_whether_it_is_run(page: Path) -> None:
    assert unmarked(blocks_of(page)) == []


@pytest.mark.slow
def test_code_in_the_pages_is_as_the_project_writes_it() -> None:
    for block in [block for page in PAGES for block in blocks_of(page) if block.language == "python"]:
        file = block.mark.partition(": ")[2] if block.mark.startswith("file: ") else "docs/block.py"
        command = [sys.executable, "-P", "-m", "ruff", "check", "--quiet", "--stdin-filename", file, "-"]
        done = subprocess.run(command, input=block.code, capture_output=True, text=True, cwd=ROOT, check=False)
        assert done.returncode == 0, f"{block.where}\n{done.stdout}{done.stderr}"


def test_a_block_without_a_mark_is_noticed() -> None:
    assert unmarked(
        [Block("", "sh", "wam demo\n"), Block("", "", "wam up\n"), Block("not run here: why", "sh", "x\n")]
    ) == ["wam demo\n", "wam up\n"]
    assert unmarked([Block("", "text", "  driver\n")]) == []


# pages, played


class Shell:
    """A new user's shell: `wam` and `python3` on PATH, in a directory with the examples and the samples."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        programs = directory / "bin"
        programs.mkdir()
        for name, command in (("wam", "-m wam_cli.main"), ("python3", "")):
            program = programs / name
            program.write_text(f'#!/bin/sh\nexec "{sys.executable}" {command} "$@"\n')
            program.chmod(0o755)
        (directory / "examples").symlink_to(ROOT / "examples")
        (directory / "bags").mkdir()
        (directory / "bags" / "sample").symlink_to(ROOT / "bags" / "sample")
        path = f"{programs}{os.pathsep}{os.environ['PATH']}"
        self.environment = {**os.environ, "PATH": path, "PYTHONPATH": f"{ROOT}{os.pathsep}{directory}"}

    def start(self, command: list[str], output: IO[str]) -> subprocess.Popen[str]:
        """Start in a session of its own, so that what it starts can be ended with it."""
        return subprocess.Popen(
            command,
            cwd=self.directory,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )

    def run(self, block: Block, limit: float = LONG) -> tuple[int, str]:
        """Exit code and output of a block; one that does not end within `limit` seconds is ended, and fails."""
        command = ["python3", "-c", block.code] if block.language == "python" else ["sh", "-e", "-c", block.code]
        with tempfile.TemporaryFile("w+", encoding="utf-8") as output:
            process = self.start(command, output)
            try:
                process.wait(limit)
            except subprocess.TimeoutExpired:
                pytest.fail(f"{block.where}: not ended within {limit:g} s:\n{block.code}\n{read_back(output)}")
            finally:
                end(process)
            return process.returncode, read_back(output)


def end(process: subprocess.Popen[str]) -> None:
    """End a process and everything that it started."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def read_back(output: IO[str]) -> str:
    output.seek(0)
    return output.read()


class Reader:
    """Somebody who does what a page says."""

    def __init__(self, shell: Shell, ros: Any = None) -> None:
        self.shell = shell
        self.printed = ""
        self._onlooker = ros and ros.node("onlooker")
        self._running: list[tuple[Block, subprocess.Popen[str], IO[str]]] = []

    def play(self, block: Block) -> None:
        kind, _, words = block.mark.partition(": ")
        if kind == "start":
            self.start(block, words.split())
        elif kind == "file":
            (self.shell.directory / words).parent.mkdir(parents=True, exist_ok=True)
            (self.shell.directory / words).write_text(block.code, encoding="utf-8")
        elif kind == "printed":
            missing = [line for line in block.code.splitlines() if not is_among(line, self.printed)]
            assert not missing, f"{block.where}: not printed: {missing}, but:\n{self.printed}"
        else:
            code, self.printed = self.shell.run(block)
            shown = f"{block.where}: ends with {code}:\n{block.code}\n{self.printed}"
            assert "Traceback" not in self.printed, shown
            assert bool(code) == (kind == "refused"), shown
            assert words in self.printed, shown

    def start(self, block: Block, nodes: list[str]) -> None:
        """Start the commands of a block, and wait for their nodes."""
        self.stop()
        for command in block.code.splitlines():
            output = tempfile.TemporaryFile("w+", encoding="utf-8")  # noqa: SIM115 - closed in `kill`
            self._running.append((block, self.shell.start(["sh", "-c", f"exec {command}"], output), output))
        for node in nodes:
            name = node if node.startswith("/") else f"/wam/{node}"
            assert self._onlooker.wait_for_node(name, timeout=LONG), f"{block.where}: no node {name}"

    def stop(self) -> None:
        """Interrupt what runs; it must not have ended by itself, and must end well."""
        for block, process, output in self._running:
            assert process.poll() is None, f"{block.where}: ended by itself:\n{read_back(output)}"
            process.send_signal(signal.SIGINT)
        for block, process, output in self._running:
            try:
                process.wait(LONG)
            except subprocess.TimeoutExpired:
                pytest.fail(f"{block.where}: Ctrl-C did not end it within {LONG:g} s:\n{read_back(output)}")
            printed = read_back(output)
            assert process.returncode == 0, f"{block.where}: {printed}"
            assert "Traceback" not in printed, f"{block.where}: {printed}"
        self.kill()

    def kill(self) -> None:
        """End what a failed test has left."""
        for _, process, output in self._running:
            end(process)
            output.close()
        self._running = []


def is_among(line: str, printed: str) -> bool:
    """Whether a line was printed, apart from white space; `...` is any text."""
    pattern = ".*".join(re.escape(" ".join(part.split())) for part in line.split("..."))
    return any(re.search(pattern, " ".join(given.split())) for given in printed.splitlines())


@pytest.fixture(scope="module")
def first_bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`bags/first`: a scenario shorter than the demonstration."""
    press = {"frame": "outer_link", "newtons": [0.0, -1.0, 0.0]}
    steps = [{"name": "press", "seconds": 0.05, "force": press, "request": "enable"}]
    with locked_domain() as number:
        arm = RunningArm(number, tmp_path_factory.mktemp("first"))
        return arm.play(steps, recorder={"name": "first"}).path


@contextmanager
def reading(reader: Reader) -> Iterator[Reader]:
    try:
        yield reader
        reader.stop()
    finally:
        reader.kill()


def played(page: Path) -> list[Block]:
    return [block for block in blocks_of(page) if block.is_played]


OWN_NODE = ROOT / "docs" / "own-node.md"
PLAYED_PAGES = [page for page in PAGES if played(page) and page != OWN_NODE]
WITH_ROS = [page for page in PLAYED_PAGES if any(block.needs_ros for block in blocks_of(page))]
WITHOUT_ROS = [page for page in PLAYED_PAGES if page not in WITH_ROS]


def shell_for(page: Path, folder: Path, request: pytest.FixtureRequest) -> Shell:
    """A shell, with the recording `bags/first` where the page needs one."""
    shell = Shell(folder)
    if any("bags/first" in block.code for block in played(page)):
        shutil.copytree(request.getfixturevalue("first_bag"), folder / "bags" / "first")
    return shell


@pytest.mark.slow
@pytest.mark.parametrize("page", WITH_ROS, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_a_reader_can_do_what_a_page_about_nodes_says(
    page: Path, tmp_path: Path, ros: Any, request: pytest.FixtureRequest
) -> None:
    with reading(Reader(shell_for(page, tmp_path, request), ros)) as reader:
        for block in played(page):
            reader.play(block)


@pytest.mark.slow
@pytest.mark.parametrize("page", WITHOUT_ROS, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_a_reader_can_do_what_a_page_says(page: Path, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    with reading(Reader(shell_for(page, tmp_path, request))) as reader:
        for block in played(page):
            reader.play(block)


@pytest.mark.slow
def test_the_client_of_the_documentation_presses_with_the_commanded_force(tmp_path: Path, ros: Any) -> None:
    with reading(Reader(Shell(tmp_path), ros)) as reader:
        for block in played(OWN_NODE):
            reader.play(block)
            if "force_step.py" in block.code:
                pressed = presses(reader.printed)
                reader.stop()  # what follows needs no stack
    assert [commanded for commanded, _ in pressed] == [5.0, 10.0]
    for commanded, measured in pressed:
        # lockstep does not wait for a client: on a busy machine its commands come late
        assert measured == pytest.approx(commanded, rel=0.2)


def presses(printed: str) -> list[tuple[float, float]]:
    """Commanded and measured force of each line that the client prints, N."""
    lines = re.findall(r"commanded +(\S+) N, measured +(\S+) N", printed)
    return [(float(commanded), float(measured)) for commanded, measured in lines]


def test_what_was_not_printed_is_noticed() -> None:
    assert is_among("force   within 10 %  YES (...)", "  force within 10 %     YES (3.5 %)\n")
    assert not is_among("force within 10 %  NO", "  force within 10 %     YES (3.5 %)\n")
