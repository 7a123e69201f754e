"""Each benchmark runs and prints its ratios; how fast is for people to assess."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import LONG

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "benchmarks"))
import bench  # noqa: E402

# a loaded machine may keep no period of real time
MAY_BE_ZERO = ("periods kept", "late cycles", "braked")
RATIO = re.compile(r"(\d\S*) \(\d\S*?\.\.\d\S*\)")


@pytest.mark.parametrize("name", bench.BENCHMARKS)
def test_benchmark_prints_a_ratio_in_every_row(name: str, domain_id: int) -> None:
    results = bench.RESULTS / f"{name}.jsonl"
    before = results.read_bytes() if results.exists() else None
    done = subprocess.run(
        [sys.executable, ROOT / "benchmarks" / "bench.py", name, "--quick"],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=LONG,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    if "left out: " in done.stdout:
        pytest.skip(done.stdout)
    shown = done.stdout.partition(f"== {name}\n")[2]  # a live page says where it is before
    _, _, *rows = shown.splitlines()
    assert [re.split(r"\s{2,}", row)[0] for row in rows] == [row.name for row in bench.load(name).rows]
    for row in rows:
        found = RATIO.search(row)
        assert found, row
        assert float(found[1]) > 0.0 or row.startswith(MAY_BE_ZERO), row
    assert (results.read_bytes() if results.exists() else None) == before, "a quick run must not be kept"


def test_smaller_is_better_where_the_aim_is_below_what_must_be() -> None:
    marks = [bench.mark(value, bench.Row("", "", *limits)) for limits in ((14, 20), (1.5, 1.3)) for value in (1.4, 15)]
    assert marks == ["below [14, 20]", "must [14, 20]", "must [1.5, 1.3]", "below [1.5, 1.3]"]
