"""Each benchmark runs and prints its ratios; how fast is for people to assess."""

import importlib
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import LONG

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = sorted(path.name for path in ROOT.glob("benchmarks/*.py"))
LEFT_OVER = "bus, synchronisers, scheduling"
MAY_BE_ZERO = (LEFT_OVER, "periods kept")
ROWS = {
    "growth.py": [
        "joints: 4",
        "joints: 14",
        "contacts: 1",
        "contacts: 2",
        "minutes read: 1",
        "minutes read: 2",
        "minutes analysed: 1",
        "minutes analysed: 2",
        "points of a map: 100",
        "points of a map: 400",
        "workers: 1",
        "workers: 2",
    ],
    "demo_under_load.py": ["0 busy loops", "2 busy loops"],
    "live_page.py": [
        "real-time factor with the page, paced",
        "real-time factor with the page, as fast as it can",
        "memory of the page over 0.05 min [MB]",
    ],
    "long_bag.py": ["reading", "analysis", "page"],
    "bag_reading.py": [
        "everything against rosbags",
        "columns against rosbags",
        "everything against mcap-ros2-support",
        "columns against mcap-ros2-support",
    ],
    "compiled.py": [
        "direct run, times real time",
        "substep over mj_step, arm free, moving",
        "substep over mj_step, arm free, pushed",
        "substep over mj_step, in contact",
        "substep over mj_step, testbed, moving",
    ],
    "contact.py": ["observe", "infer", "estimate", "update"],
    "messages.py": ["taken by all", "taken by nobody"],
    "small_matrices.py": ["without the checks", "numpy.linalg"],
    "parts.py": [
        "whole",
        "driver",
        "driver: substeps",
        "driver: measuring",
        "driver: limits",
        "driver: amplifier",
        "contact_estimator",
        "contact_estimator: observe",
        "contact_estimator: estimate",
        "force_loop",
        "velocity_loop",
        "transform",
        "gravity",
        "scenario",
        "true state, published",
        LEFT_OVER,
    ],
    "plant.py": ["arm free, moving", "arm free, pushed", "arm, every effect on", "in contact", "testbed, moving"],
    "real_time.py": [
        "periods kept, no other load [%]",
        "periods kept, 4 busy loops [%]",
        "wam demo to first motion [s]",
    ],
    "recording.py": ["messages in the bag", "writing a message [us]"],
    "round_trip.py": ["one process, p50", "one process, p99", "two processes, p50", "two processes, p99"],
    "speed.py": [
        "direct run",
        "lockstep",
        "lockstep, recorded",
        "grouped, recorded",
        "one process per node, recorded",
    ],
    "stability_map.py": [
        "map, against solve_ivp",
        "the same points only, against solve_ivp",
        "map, against the scalar bisection",
    ],
}
RATIO = re.compile(r"(\d\S*) \(\d\S*?\.\.\d\S*\)")


def test_every_benchmark_is_looked_at() -> None:
    assert sorted(ROWS) == SCRIPTS


@pytest.mark.parametrize("script", SCRIPTS)
def test_benchmark_prints_a_ratio_in_every_row(script: str, domain_id: int) -> None:
    results = ROOT / "benchmarks" / "results" / script.replace(".py", ".jsonl")
    before = results.read_bytes() if results.exists() else None
    done = subprocess.run(
        [sys.executable, ROOT / "benchmarks" / script, "--quick"],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=LONG,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    if done.stdout.startswith("left out: "):
        pytest.skip(done.stdout.removeprefix("left out: "))
    machine, table = done.stdout.index(" cores, "), done.stdout  # a live page says where it is before
    _, _, *rows = table[machine:].splitlines()
    assert [re.split(r"\s{2,}", row)[0] for row in rows] == ROWS[script]
    for row in rows:
        found = RATIO.search(row)
        assert found, row
        # a loaded machine may be slower in the parts than in the whole, and keep no period of real time
        assert float(found[1]) > 0.0 or row.startswith(MAY_BE_ZERO), row
    assert (results.read_bytes() if results.exists() else None) == before, "a quick run must not be kept"


SCRIPT = """
import json, pathlib, sys
assert sys.argv[1:] == ["--rounds", "1"]
results = pathlib.Path(__file__).parent / "results"
results.mkdir()
rows = {"time": "now", "rounds": 1, "free": {"ratio": [1.25, 1.0, 2.0], "times": [7.0] * 3}, "map": [3.0, 2.0, 4.0]}
(results / "subject.jsonl").write_text("{}\\n" + json.dumps(rows))
"""


def test_rows_of_another_checkout_are_those_of_its_own_script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    editions = importlib.import_module("comparing.editions")
    for folder in (".venv/bin", "benchmarks"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / ".venv/bin/python").symlink_to(sys.executable)
    (tmp_path / "benchmarks/subject.py").write_text(SCRIPT, encoding="utf-8")
    assert editions.measured(tmp_path, "subject") == {"free: ratio": 1.25, "free: times": 7.0, "map": 3.0}
    with pytest.raises(SystemExit, match=r"nothing\.py --rounds 1 ended with 2:\n.*No such file"):
        editions.measured(tmp_path, "nothing")
