"""The command line: what it says to words it does not know, and how one number is changed."""

import importlib
from pathlib import Path
from typing import Any

import pytest

from wam_bag.bag import read
from wam_cli.main import ALIASES, COMMANDS, EXTRAS, main

ROOT = Path(__file__).parents[1]


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
    assert out.startswith("wam_stack ")


def test_a_misspelt_command_is_answered_with_the_one_that_was_meant(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = said(capsys, "anlyse")
    assert (code, out) == (2, "")
    assert "no command 'anlyse'; did you mean 'analyse'?" in err
    assert "choose from demo" in said(capsys, "xyzzy")[2]


def test_the_american_spelling_is_the_same_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert ALIASES == {"analyze": "analyse"}
    code, out, _ = said(capsys, "analyze", str(ROOT / "bags" / "sample" / "creep"), "--quiet")
    assert code == 0
    assert out.startswith("Verdict")


def test_one_number_is_changed_in_one_word(capsys: pytest.CaptureFixture[str]) -> None:
    before = said(capsys, "model", "urdf", "--config", "testbed")[1]
    code, changed, err = said(capsys, "model", "urdf", "--config", "testbed", "--set", "arm.links.mass=[2.5]")
    assert (code, err) == (0, "")
    assert changed != before
    assert 'value="2.5"' in changed


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("arm.links.mas=[2.5]", "has no parameter 'arm.links.mas'"),
        ("nothing", "write [node:]parameter=value"),
        ("timing.period=[", "is no value of YAML"),
        ("drivr:seed=1", "no section '/**/drivr'"),
    ],
)
def test_a_number_that_cannot_be_changed_is_named(
    setting: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = said(capsys, "model", "urdf", "--set", setting)
    assert (code, out) == (1, "")
    assert message in err
    assert err.count("\n") == 1


def test_a_scenario_that_does_not_exist_is_refused_before_any_node_starts(
    capsys: pytest.CaptureFixture[str],
) -> None:
    code, out, err = said(capsys, "up", "--scenario", "nosuch")
    assert code == 1
    assert "nosuch" in err
    assert "started" not in out


def test_an_extra_that_is_missing_is_named_in_one_sentence(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    load = importlib.import_module

    def without(name: str, package: str | None = None) -> Any:
        if name == "wam_cli.commands.call":
            raise ModuleNotFoundError("No module named 'rclpy'", name="rclpy")
        return load(name, package)

    monkeypatch.setattr(importlib, "import_module", without)
    code, out, err = said(capsys, "call", "enable")
    assert (code, out) == (1, "")
    assert err == "wam call: it needs 'rclpy', which is not installed; install it with: pip install 'wam_stack[ros]'\n"


def test_the_extras_are_those_of_the_package() -> None:
    declared = (ROOT / "setup.py").read_text(encoding="utf-8")
    assert all(f'"{extra}": [' in declared for extra in EXTRAS)


def test_a_bag_prints_what_it_holds_and_not_its_arrays() -> None:
    bag = read(ROOT / "bags" / "sample" / "creep")
    assert repr(bag).endswith("creep', 4 topics, 6284 messages)")
