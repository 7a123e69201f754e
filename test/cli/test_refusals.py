"""What the commands refuse before they begin: values that say nothing, and places that cannot be written."""

import os
from pathlib import Path

import pytest

from wam_cli.main import main


def refused(capfd: pytest.CaptureFixture[str], *words: str) -> str:
    """The one line that a command ends with, code 1."""
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 1
    said = capfd.readouterr()
    assert said.out == ""
    (line,) = said.err.splitlines()
    return line


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("guard --sets -3", "wam guard: --sets is -3; it must be at least 1"),
        ("guard --testbed 0", "wam guard: --testbed is 0; it must be at least 1"),
        ("guard --seed -1", "wam guard: --seed is -1; it must be at least 0"),
        ("evaluate contact --contacts 0", "wam evaluate: --contacts is 0; it must be at least 1"),
        ("evaluate contact --jobs 0", "wam evaluate: --jobs is 0; it must be at least 1"),
        ("evaluate contact --free nan", "wam evaluate: --free is nan; it must be at least 0"),
        ("evaluate contact --seeds 1 -1", "wam evaluate: --seeds is -1; it must be at least 0"),
        ("evaluate figures --jobs 0", "wam evaluate: --jobs is 0; it must be at least 1"),
        ("evaluate force --jobs 99999", "wam evaluate: --jobs is 99999; it must be at most 1024"),
        (
            "identify --excite e.yaml --only-write --seconds inf",
            "wam identify: --seconds is inf; it must be at most 3600",
        ),
        (
            "identify --excite e.yaml --only-write --seconds 1e6",
            "wam identify: --seconds is 1e+06; it must be at most 3600",
        ),
    ],
)
def test_a_count_or_a_range_that_says_nothing_is_named(
    words: str, line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert refused(capfd, *words.split()) == line
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (
            "analyse bag --html none/x.html",
            "cannot write none/x.html: none is no directory; give another file as --html",
        ),
        (
            "analyse bag --json none/x.json",
            "cannot write none/x.json: none is no directory; give another file as --json",
        ),
        ("analyse bag --html .", "cannot write .: it is a directory; give another file as --html"),
        (
            "evaluate figures --results file/in/x",
            "cannot write into file/in: file is no directory; give another directory as --results",
        ),
        ("evaluate figures --to file", "cannot write into file: file is no directory; give another directory as --to"),
        ("experiment creep --directory file/in", "cannot write into file/in: file is no directory; give another"),
        ("evaluate contact --write none/x.md", "cannot write none/x.md: none is no directory; give another file as"),
    ],
)
def test_what_cannot_be_written_is_said_before_the_work(
    words: str, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("in the way")
    assert reason in refused(capfd, *words.split())
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (
            "sweep own.yaml --vary arm.payload=0,0.5",
            "a file that ends in .csv, .tsv, .txt, .dat; give the scenario with --scenario",
        ),
        ("sweep own.yaml --experiment creep --vary seed=1,2", "FILE own.yaml would be a table; give a file that ends"),
        ("analyse bag --json own.yaml", "--json own.yaml would be JSON; give a file that ends in .json, .txt"),
        (
            "analyse bag --html own.yaml",
            "--html own.yaml would be a page of HTML; give a file that ends in .html, .htm",
        ),
        ("evaluate soak --write own.yaml", "--write own.yaml would be a page of the documentation; give a file that"),
        (
            "experiment creep --write own.yaml",
            "--write own.yaml would be a page of the documentation; give a file that",
        ),
        (
            "identify bag --write own.yaml",
            "--write own.yaml exists, and this command did not write it; give a new file",
        ),
        ("identify --excite own.yaml", "--excite own.yaml exists, and this command did not write it; give a new file"),
        ("identify --excite e.txt", "--excite e.txt would be a scenario; give a file that ends in .yaml, .yml"),
        ("identify bag --write e", "--write e would be a configuration; give a file that ends in .yaml, .yml"),
    ],
)
def test_a_file_of_another_kind_is_not_written_over(
    words: str, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    own = "steps:\n  - {name: release, seconds: 0.1, request: enable}\n"
    (tmp_path / "own.yaml").write_text(own)
    assert reason in refused(capfd, *words.split())
    assert {entry.name: entry.read_text() for entry in tmp_path.iterdir()} == {"own.yaml": own}


@pytest.mark.parametrize("command", ["demo --no-live", "bag record"])
def test_a_bag_that_exists_is_named_before_the_work(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bags" / "here").mkdir(parents=True)
    said = refused(capfd, *command.split(), "--name", "here")
    assert "bag bags/here exists already; give another name as --name, or move it away" in said


def test_a_directory_without_permission_is_named_with_the_option(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "closed").mkdir(mode=0o500)
    closed = [path for path in (tmp_path / "closed", Path("/proc/self")) if not os.access(path, os.W_OK)]
    if not closed:
        pytest.skip("this user may write everywhere")
    monkeypatch.chdir(tmp_path)
    for words, option in (
        (f"experiment creep --directory {closed[0]}/bags", "give another directory as --directory"),
        (f"bag record --directory {closed[0]}/bags", "give another directory as --directory"),
        (f"evaluate figures --results {closed[0]}/.cache", "give another directory as --results"),
        (f"analyse bag --html {closed[0]}/x.html", "give another file as --html"),
    ):
        said = refused(capfd, *words.split())
        assert f"no permission to write into {closed[0]}; {option}" in said
