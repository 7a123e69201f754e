"""Each benchmark runs and prints its ratios; how fast is for people to assess."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import LONG

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "benchmarks"))
import bench  # noqa: E402
import simulation  # noqa: E402

# a loaded machine may keep no period of real time
MAY_BE_ZERO = ("periods kept", "late cycles", "braked")


INSTALLED = simulation.installed()
AS_PROGRAM = {"round_trip": INSTALLED or ROOT, "real_time": ROOT}  # and the packages that it imports


@pytest.mark.parametrize("name", bench.BENCHMARKS)
def test_benchmark_has_a_ratio_in_every_row(name: str, domain_id: int) -> None:
    ratios = bench.load(name).ratios
    if name in AS_PROGRAM:
        done = subprocess.run(
            [sys.executable, ROOT / "benchmarks" / "bench.py", "--benchmarks", name, "--quick", "--fresh"],
            env={**os.environ, "PYTHONPATH": str(AS_PROGRAM[name])},
            capture_output=True,
            text=True,
            timeout=LONG,
            check=False,
        )
        assert done.returncode in (0, 1), done.stderr  # 1: slower than required
        rows = [line.split(" | ") for line in done.stdout.splitlines() if line.startswith(f"| {name}: ")]
        found = {cells[0].removeprefix(f"| {name}: "): float(cells[4]) for cells in rows if cells[4] != "–"}
    else:
        values = bench.load(name).measure(True)
        found = {ratio.name: ratio.ratios([values])[0] for ratio in ratios if ratio.name in values}
    expected = [ratio.name for ratio in ratios]
    if name == "compiled" and INSTALLED is None:
        expected = [row for row in expected if row.endswith("plain Python")]
    for row in expected:
        assert found.pop(row) > 0.0 or row.startswith(MAY_BE_ZERO)
    assert found == {}


def test_smaller_is_better_where_the_aim_is_below_what_must_be() -> None:
    rows = [
        bench.Ratio("of", "to", *limits).row("speed", [{"of": 2.0 * value, "to": 2.0}])
        for limits in ((14.0, 20.0), (1.5, 1.3))
        for value in (1.4, 15.0)
    ]
    assert [row.is_missed for row in rows] == [True, False, False, True]
