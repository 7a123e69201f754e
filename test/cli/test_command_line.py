"""The command line: what it says to words it does not know, and how one number is changed."""

import argparse
import importlib
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wam_bag.bag import BagError, JointColumns, read
from wam_cli.main import COMMANDS, EXTRAS, main

ROOT = Path(__file__).parents[2]


def said(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    """Exit code, output and errors of a command."""
    with pytest.raises(SystemExit) as ended:
        main(words)
    out, err = capsys.readouterr()
    return int(ended.value.code or 0), out, err


def test_without_a_command_the_help_is_printed_and_that_is_no_error(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = said(capsys)
    assert (code, err) == (0, "")
    assert all(name in out for name in COMMANDS)


def test_the_version_is_that_of_the_package(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = said(capsys, "--version")
    assert code == 0
    assert re.fullmatch(r"wam_stack .+, inner loop: (compiled|plain Python)\n", out)


@pytest.mark.parametrize(("words", "reason"), [
    ("anlyse", "there is no 'anlyse'; did you mean 'analyse'?"),
    ("xyzzy", "invalid choice: 'xyzzy' (choose from 'demo', 'up', "),
    ("call enabel", "there is no 'enabel'; did you mean 'enable'?"),
    ("evaluate contct", "there is no 'contct'; did you mean 'contact'?"),
    ("demo --task creep", "no task is named 'creep'; choose from follow-surface"),
    ("up --name left", "wam up: error: unrecognized arguments: --name left"),  # no abbreviation of --namespace
])  # fmt: skip
def test_a_word_that_does_not_exist_is_answered_with_the_one_that_was_meant(
    words: str, reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = said(capsys, *words.split())
    assert (code, out) == (2, "")
    assert reason in err


def test_one_number_is_changed_in_one_word(capsys: pytest.CaptureFixture[str]) -> None:
    before = said(capsys, "model", "urdf", "--config", "testbed")[1]
    code, changed, err = said(capsys, "model", "urdf", "--config", "testbed", "--set", "arm.links.mass=[2.5]")
    assert (code, err) == (0, "")
    assert changed != before
    assert 'value="2.5"' in changed


@pytest.mark.parametrize(("setting", "message"), [
    ("arm.links.mas=[2.5]", "to set to [2.5]; did you mean 'arm.links.mass'?"),
    ("force_gain=[0.01]", "did you mean 'force_loop:force_gain'?"),
    ("foo=1", "it has: ages.*, arm.*, "),
    ("nothing", "write [node:]parameter=value"),
    ("drivr:seed=1", "no section '/**/drivr'"),
    ("force_loop:timing.period=0.01", "did you mean 'timing.period' of section '/**'?"),
    ("arm.payload=20", "arm.joints.length and offset, and arm.payload, 20 kg"),
])  # fmt: skip
def test_a_number_that_cannot_be_changed_is_named(
    setting: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = said(capsys, "model", "urdf", "--set", setting)
    assert (code, out) == (1, "")
    assert message in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    "words", ["demo --scenario", "demo --task", "demo --name", "up --scenario", "sweep t.csv --vary seed=1 --scenario"]
)
def test_an_empty_name_is_refused_and_not_taken_for_the_usual_one(
    words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = said(capsys, *words.split(), "")
    assert (code, out) == (2, "")
    assert "it is empty; give a name or a file, or leave the option out" in err


@pytest.mark.parametrize(("module", "way"), [
    ("rclpy", "pip install 'wam_stack[ros]'"),
    ("quadprog", "pip install quadprog"),
    ("pinocchio.visualize", "pip install pin"),
    ("control_msgs", "apt install ros-jazzy-control-msgs"),
])  # fmt: skip
def test_a_package_that_is_missing_is_named_in_one_sentence(
    module: str, way: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    load = importlib.import_module

    def without(name: str, package: str | None = None) -> Any:
        if name == "wam_cli.commands.call":
            raise ModuleNotFoundError(f"No module named '{module}'", name=module)
        return load(name, package)

    monkeypatch.setattr(importlib, "import_module", without)
    code, out, err = said(capsys, "call", "enable")
    assert (code, out) == (1, "")
    assert err == f"wam call: it needs '{module.partition('.')[0]}', which is not installed; install it with: {way}\n"


def test_the_extras_are_those_of_the_package() -> None:
    declared = (ROOT / "setup.py").read_text(encoding="utf-8")
    assert all(f'"{extra}": [' in declared for extra in EXTRAS)


def test_a_topic_becomes_series_of_equal_length() -> None:
    bag = read(ROOT / "bags" / "sample" / "wam-touch")
    joints = bag.series("joint_states")
    assert list(joints)[:3] == ["time", "position.joint1", "position.joint2"]
    columns = bag.topics["/wam/joint_states"]
    assert isinstance(columns, JointColumns)
    np.testing.assert_array_equal(joints["position.joint4"], columns.position[:, 3])
    assert joints["time"][1] - joints["time"][0] == pytest.approx(0.005)
    for topic in bag.topics:
        assert len({len(values) for values in bag.series(topic).values()}) == 1, topic
    assert bag.series("sim/contact/wrench")["force.y"].max() == pytest.approx(12.0)
    with pytest.raises(BagError, match="no topics are named 'joint_state'; choose one of"):
        bag.series("joint_state")


def test_without_pandas_a_data_frame_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    bag = read(ROOT / "bags" / "sample" / "wam-touch", ["joint_states"])
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ModuleNotFoundError, match="pip install pandas"):
        bag.to_pandas("joint_states")


def test_with_pandas_a_topic_is_a_data_frame() -> None:
    pandas = pytest.importorskip("pandas")
    frame = read(ROOT / "bags" / "sample" / "wam-touch").to_pandas("joint_states")
    assert isinstance(frame, pandas.DataFrame)
    assert (frame.index.name, len(frame)) == ("time", 461)


# completion


def completed(line: str, folder: Path) -> list[str]:
    """The words that a shell would offer."""
    answer = folder / "answer"
    asked = {"_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "\n", "COMP_LINE": line, "COMP_POINT": str(len(line))}
    subprocess.run(
        [sys.executable, "-P", "-m", "wam_cli.program"],
        env={**os.environ, **asked, "_ARGCOMPLETE_STDOUT_FILENAME": str(answer)},
        check=False,
    )
    return answer.read_text().split()


@pytest.mark.slow
def test_commands_options_and_requests_are_completed(tmp_path: Path) -> None:
    pytest.importorskip("argcomplete")
    assert completed("wam ana", tmp_path) == ["analyse"]
    assert completed("wam demo --no", tmp_path) == ["--no-live"]
    assert {"reset", "resume", "reset_fault"} == set(completed("wam call re", tmp_path))
    assert f"{ROOT}/README.md" in completed(f"wam live {ROOT}/READ", tmp_path)


def requests_of(parser: argparse.ArgumentParser, *before: str) -> Iterator[tuple[str, ...]]:
    """The words of every command below a parser."""
    for action in parser._actions:
        for name, below in action.choices.items() if isinstance(action, argparse._SubParsersAction) else ():
            yield (*before, name)
            yield from requests_of(below, *before, name)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_and_each_of_its_requests_has_a_help(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    module = importlib.import_module(f"wam_cli.commands.{command}")
    module.arguments(parser := argparse.ArgumentParser())
    for words in [(command,), *requests_of(parser, command)]:
        code, out, err = said(capsys, *words, "--help")
        assert (code, err, out.startswith(f"usage: wam {' '.join(words)} ")) == (0, "", True), words


def test_the_help_is_one_screen_and_fits_a_narrow_one(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert len(COMMANDS) == 15
    assert said(capsys, "--help")[1].count("\n") <= 30
    monkeypatch.setenv("COLUMNS", "60")
    for words in [[], *([name] for name in COMMANDS)]:
        out = said(capsys, *words, "--help")[1]
        assert max(map(len, out.splitlines())) <= 60, words


def test_values_are_those_of_the_usual_configuration_where_none_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    values = ("--set", "force_loop:force_gain=[0.5]")
    found = said(capsys, "guard", *values)
    assert found == said(capsys, "guard", "--config", "wam", *values)
    notes = [
        "the packaged velocity_loop" in out for out in (said(capsys, "guard", "--config", "position-loop")[1], found[1])
    ]
    assert notes == [True, False]
    assert found[0] == 1
    code, _, err = said(capsys, "guard", *values, "--gain", "1.0")
    assert (code, "leave out --config and --set" in err) == (1, True)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("error", [ImportError("initialization failed"), ValueError("half imported"), None])
def test_a_signal_ends_a_command_with_its_code_whatever_an_interrupted_import_raises(
    number: int, error: Exception | None, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(_: argparse.Namespace) -> int:
        try:
            signal.raise_signal(number)
        except BaseException:
            if error is None:
                raise
            raise error from None  # as the module of MuJoCo in C
        return 0

    monkeypatch.setattr(importlib.import_module("wam_cli.commands.model"), "run", interrupted)
    assert said(capsys, "model", "scorecard") == (128 + number, "", "")
