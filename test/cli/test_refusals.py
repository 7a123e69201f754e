"""What the commands refuse before they begin: values that are not allowed, and files that cannot be written."""

import os
from pathlib import Path

import pytest

from wam_cli.main import main

SAMPLES = Path(__file__).resolve().parents[2] / "bags" / "sample"
OWN = "steps:\n  - {name: release, seconds: 0.1, request: enable}\n"

# words and reason; own.yaml is a file of the user, `file` one in the way, `none` does not exist
REFUSED = [
    ("guard --contact 0", "argument --contact: '0' is not allowed; give a number of at least 1e-12"),
    ("conform --config barrett-wam4-bus --current 50", "--current is 50 A; allowed: 0 to 3.26 A, the rated current of"),
    (f"experiment wam-press --evaluate {SAMPLES}/wam-slide", "wam-slide is no recording of run 'press' of wam-press"),
    (f"experiment wam-touch --evaluate {SAMPLES}/actuator-limit-cycle", "its scenario is bags/recorded/actuator-lim"),
    (f"experiment quantised-force --evaluate {SAMPLES}/stiction-limit-cycle", ", different: "),
    ("evaluate guard --cases -3", "argument --cases: '-3' is not allowed; give a whole number of at least 1"),
    ("evaluate contact --jobs 0", "argument --jobs: '0' is not allowed; give a whole number from 1 to 1024"),
    ("evaluate contact --free nan", "argument --free: 'nan' is not allowed; give a number from 0 to 1e+09"),
    ("identify --excite e.yaml --seconds inf", "'inf' is not allowed; give a number from 10 to 3600, in s"),
    ("identify bag --seed 0", "--seed has no effect without --excite; leave it out, or give --excite"),
    ("sweep t.csv --vary seed=1 --seed 0", "--seed has no effect without --random"),
    ("sweep t.csv --vary seed=1 --random 999999999", "argument --random: '999999999' is not allowed"),
    ("demo --port 0", "argument --port: '0' is not allowed; give a whole number from 1 to 65535"),
    ("call push outer_link nan 0 0", "argument N: 'nan' is not allowed; give a finite number, in N"),
    ("analyse bag --html none/x.html", "argument --html: cannot write none/x.html: none is no directory"),
    ("analyse bag --html .", "argument --html: cannot write .: it is a directory; give another file"),
    ("sweep t.csv --vary seed=1 --picture x.foo", "argument --picture: x.foo cannot be a picture"),
    ("evaluate figures --results file/in/x", "cannot write into file/in: file is no directory; give another"),
    ("evaluate figures --to file", "argument --to: cannot write into file: file is no directory"),
    ("sweep own.yaml --vary arm.payload=0,0.5", "ends in .csv, .tsv, .txt, .dat"),
    ("sweep file --vary arm.payload=0,0.5", "file exists, and this command did not write it; give a new file"),
    ("analyse bag --json own.yaml", "own.yaml cannot be JSON; give a file that ends in .json, .txt"),
    ("identify bag --write own.yaml", "own.yaml exists, and this command did not write it; give a new file"),
    ("identify --excite own.yaml", "own.yaml exists, and this command did not write it; give a new file"),
    ("identify --excite e.txt", "e.txt cannot be a scenario; give a file that ends in .yaml, .yml"),
    ("up --config nope", "no configuration 'nope' comes with wam_stack; there are: "),
    ("model urdf --config /nope/x.yaml", "configuration /nope/x.yaml is not a file; give the path"),
    ("node elbow", "no node is named 'elbow'; nodes: driver, transform, velocity_loop"),
    ("demo --no-live --name here", "bag bags/here exists already; give another name with --name, or move that"),
    ("bag record --name here", "bag bags/here exists already; give another name with --name, or move that bag away"),
    ("up --scenario nosuch", "no scenario 'nosuch'"),
    ("up --config barrett-wam4-bus --scenario barrett-wam4_scenario", "has a push, but the driver of this arm"),
    ("demo --no-live --name ../x", "'name' is '../x'; allowed: a name without directories"),
    ("demo --set arm.payload=.nan", "parameter 'arm.payload' is nan kg; allowed: 0 to 50"),
    ("demo --set force_loop:force_gain=[-1.0]", "parameter 'force_gain' is -1.0 m/s/N; allowed: 0 to 100"),
    ("guard --set force_loop:force_gain=[1,2]", "that you set, section '/**/force_loop': parameter 'force_gain' has 2"),
    ("up --set driver:effects.tension_friction=[1] --set velocity_loop:dither.phase=[]", "it needs 4; also: "),
    *(
        (f"{words} --set arm.payload=0.5 --set arm.payload=1", "--set has arm.payload twice, with two values")
        for words in ("model urdf", "demo --no-live", "up", "sweep t.csv --vary seed=1")
    ),
    ("sweep t.csv --vary seed=010,020", "'seed=010,020' is no NAME=VALUES: 010 is 8 in YAML; write that number"),
    ('sweep t.csv --vary seed={"a":1,"a":2}', "'a' is given twice"),
    ("sweep t.csv --vary seed=0.01:inf:3", "'0.01:inf:3' is no LOW:HIGH:N with 0 < LOW < HIGH"),
    (f"sweep t.csv --vary seed=0x{'f' * 5000}", "beyond every float"),
    ("sweep t.csv --vary seed=", "write for example force_loop:force_gain=0.01,0.02"),
    ("sweep t.csv --vary seed=1:2:1000000000", "'1:2:1000000000' has 1000000000 values; at most 100000 sets"),
    ("sweep t.csv --vary seed=1 --vary seed=2", "--vary has seed 2 times"),
    ("sweep t.csv --vary scenario:script=a,b", "give the scenario with --scenario"),
    ("sweep t.csv --vary timing.mode=lockstep", "--vary timing.mode has no effect in runs without ROS"),
    ("sweep t.csv --vary seed=1 --set timing.niceness=2", "--set timing.niceness has no effect in runs without ROS"),
    ("sweep t.csv --vary arm.payload=0 --set arm.payload=3", "--set arm.payload has no effect here: --vary sets it"),
    ("sweep t.csv --vary seed=1:2:999 --vary arm.payload=1:2:999", "998001 sets in all, seed: 999, arm.payload: 999"),
]  # fmt: skip


def refused(words: str, capfd: pytest.CaptureFixture[str]) -> str:
    """The reason that a command ends with, in the last line."""
    with pytest.raises(SystemExit) as ended:
        main(words.split())
    assert ended.value.code in (1, 2)
    printed = capfd.readouterr()
    assert printed.out == ""
    return printed.err.splitlines()[-1]


@pytest.mark.parametrize(("words", "reason"), REFUSED, ids=[words[:60] for words, _ in REFUSED])
def test_it_is_refused_with_the_reason_and_nothing_is_written(
    words: str, reason: str, tmp_path: Path, request: pytest.FixtureRequest, capfd: pytest.CaptureFixture[str]
) -> None:
    if words.startswith("up"):
        request.getfixturevalue("domain_id")
    request.getfixturevalue("monkeypatch").chdir(tmp_path)
    (tmp_path / "bags" / "here").mkdir(parents=True)
    (tmp_path / "file").write_text("in the way")
    (tmp_path / "own.yaml").write_text(OWN)
    assert reason in refused(words, capfd)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["bags", "file", "here", "own.yaml"]
    assert (tmp_path / "own.yaml").read_text() == OWN


@pytest.mark.parametrize("words", [
    "experiment creep --directory CLOSED/bags",
    "bag record --set recorder:directory=CLOSED/bags",
    "evaluate figures --results CLOSED/x",
    "analyse bag --html CLOSED/x.html",
])  # fmt: skip
def test_a_directory_without_permission_is_named(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "closed").mkdir(mode=0o500)
    closed = [path for path in (tmp_path / "closed", Path("/proc/self")) if not os.access(path, os.W_OK)]
    if not closed:
        pytest.skip("this user may write everywhere")
    monkeypatch.chdir(tmp_path)
    reason = refused(words.replace("CLOSED", str(closed[0])), capfd)
    assert f"no permission to write into {closed[0]}; give another" in reason
