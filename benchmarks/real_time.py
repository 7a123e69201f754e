"""Periods that the driver keeps in realtime, without and with busy loops next to it, and the start of `wam demo`.

The reference is the wall clock.  What the system grants the driver is in its `/diagnostics`, `priority`.
"""

import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from comparing import arguments, machine, mark, quartiles, save, table
from comparing.clock import watched_clock
from demo_under_load import Run, busy_loops, demonstration, short_form

from wam_analysis.demo_summary import summarize
from wam_bag.bag import read
from wam_bag.columns import JointColumns

MOVED = 1e-3  # rad, of a joint since the first message
ROWS = {  # must, aim
    "periods kept, no other load [%]": (99.0, 99.7),
    "periods kept, 4 busy loops [%]": (98.0, 99.7),
    "wam demo to first motion [s]": (2.0, 1.5),
}


def kept(run: Run) -> float:
    """Periods in time of a demonstration in realtime, per cent; also of one that a late node has ended."""
    loop = summarize(read(run.bag)).loop
    return 100.0 * (1.0 - loop.missed / loop.periods) if loop.periods else 0.0


def first_motion(folder: Path, name: str, options: list[str]) -> float:
    """Time from the start of `wam demo` until the arm's clock, seen from outside, is where a joint has moved, s."""
    with ThreadPoolExecutor(1) as pool, watched_clock() as (executor, seen):
        playing = pool.submit(demonstration, folder, name, options)
        while not playing.done():
            executor.spin_once(timeout_sec=0.05)
    run = playing.result()
    states = read(run.bag, topics=["/wam/joint_states"]).topics["/wam/joint_states"]
    assert isinstance(states, JointColumns)
    moved = np.abs(states.position - states.position[0]).max(axis=1) > MOVED
    stamp = int(states.stamp_ns[int(np.argmax(moved))])
    return next(at for at, shown in seen if shown >= stamp) - run.begin


def main() -> None:
    """Measure in turns, print the table."""
    given = arguments(__doc__, rounds=5, quick_rounds=1)
    found: dict[str, list[float]] = {row: [] for row in ROWS}
    ends: dict[int, list[bool]] = {}
    with tempfile.TemporaryDirectory(prefix="wam_bench_") as name:
        folder = Path(name)
        short = short_form(folder)
        for i in range(given.rounds):
            for row, loops in zip(ROWS, (0, 1 if given.quick else 4), strict=False):
                with busy_loops(loops):
                    run = demonstration(folder, f"{loops}_{i}", [*(short if given.quick else []), "--realtime"])
                found[row].append(kept(run))
                ends.setdefault(loops, []).append(run.passed)
            found["wam demo to first motion [s]"].append(first_motion(folder, f"start_{i}", short))
    rows, measured = [], dict[str, Any]()
    for name, values in found.items():
        measured[name] = quartiles(values)
        rows.append([name, f"{quartiles(values):.2f}", mark(quartiles(values).median, *ROWS[name])])
    for loops, passed in ends.items():  # the periods of one that a late node has braked count, too
        print(f"demonstrations that were not braked, {loops} busy loops: {sum(passed)} of {len(passed)}")
        measured[f"not braked, {loops} busy loops"] = [sum(passed), len(passed)]
    print(machine())
    print(table(["in real time", "(middle half)", "[must, aim]"], rows))
    save("real_time", given, measured)


if __name__ == "__main__":
    main()
