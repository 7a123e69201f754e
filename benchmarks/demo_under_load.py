"""The demonstration with busy loops next to it: whether it passes, how fast it is, and whether its bits are the same.

Each run is `wam demo` as a user starts it, paced by the wall clock; the reference is the wall clock.
"""

import hashlib
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from comparing import arguments, machine, quartiles, save, table

from wam_analysis.demo_summary import summarize
from wam_bag.bag import raw, read
from wam_description.status import WALL_CLOCK
from wam_description.topics import JOINT_STATE, POINT, WRENCH

LOOPS, QUICK_LOOPS = (0, 4, 8, 16), (0, 2)
LONGEST = 1200.0  # s, for one demonstration
WITHOUT_PADDING = (JOINT_STATE, WRENCH, POINT)  # the stack writes their bytes itself: wam_ros.wire
SHORT = [
    {"name": "release", "seconds": 0.5, "request": "enable"},
    {"name": "move", "seconds": 1.5, "posture": [0.0, -0.8, 0.0, 0.3]},
    {"name": "brake", "seconds": 0.5, "request": "disable"},
]


class Run(NamedTuple):
    """One demonstration: when it began, s since 1970, whether it passed and printed its result, its bag."""

    begin: float
    passed: bool
    bag: Path

    @property
    def factor(self) -> float:
        """Real-time factor; 0 of one that failed."""
        return summarize(read(self.bag)).loop.factor if self.passed else 0.0


@contextmanager
def busy_loops(count: int) -> Iterator[None]:
    """That many processes that never rest, in the same session: the kernel groups what it is fair to by session."""
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def demonstration(folder: Path, name: str, options: list[str]) -> Run:
    """Run `wam demo` in a process of its own."""
    begin = time.time()
    done = subprocess.run(
        [sys.executable, "-P", "-m", "wam_cli.main", "demo", "--name", name, *options],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=LONGEST,
        check=False,
    )
    passed = "Result, worst case in brackets" in done.stdout and "the demonstration failed" not in done.stdout
    if not passed:  # a force that is off by more than a tenth is no failure here, but has an exit code, too
        print(done.stdout, done.stderr, sep="\n", file=sys.stderr)
    return Run(begin, passed, folder / "bags" / name)


def short_form(folder: Path) -> list[str]:
    """Options of a demonstration of some seconds."""
    (folder / "short.yaml").write_text(yaml.safe_dump({"steps": SHORT}), encoding="utf-8")
    section = {"ros__parameters": {"script": str(folder / "short.yaml")}}
    (folder / "quick.yaml").write_text(yaml.safe_dump({"base": "wam", "/**/scenario": section}), encoding="utf-8")
    return ["--config", "quick.yaml"]


def digest(bag: Path) -> str:
    """Hash of all messages by topic, without what depends on how fast time passed on the wall clock."""
    found = hashlib.sha256()
    for topic, series in sorted(raw(bag).items()):
        found.update(topic.encode())
        if series.type in WITHOUT_PADDING:
            found.update(b"".join(series.data))
        else:
            found.update("\n".join(sorted(map(written_out, map(series.decode, series.data)))).encode())
    return found.hexdigest()


def written_out(message: Any) -> str:
    """A message as text; those of several nodes on a topic come in no order among each other."""
    if not (statuses := getattr(message, "status", [message] if hasattr(message, "hardware_id") else [])):
        return repr(message)
    facts = [[pair for pair in status.values if pair.key not in WALL_CLOCK] for status in statuses]
    return repr([(*status[:-1], *rest) for status, rest in zip(statuses, facts, strict=True)])


def main() -> None:
    """Measure, print the table; fails where a demonstration fails or differs."""
    given = arguments(__doc__, rounds=10, quick_rounds=1)
    rows, measured, digests, failed = [], dict[str, Any](), set[str](), 0
    with tempfile.TemporaryDirectory(prefix="wam_bench_") as name:
        folder = Path(name)
        options = short_form(folder) if given.quick else []
        for count in QUICK_LOOPS if given.quick else LOOPS:
            with busy_loops(count):
                runs = [demonstration(folder, f"{count}_{i}", options) for i in range(given.rounds)]
            passed = sum(run.passed for run in runs)
            equal = {digest(run.bag) for run in runs if run.passed}
            digests |= equal
            failed += given.rounds - passed
            factor = quartiles([run.factor for run in runs])
            rows.append([f"{count} busy loops", f"{passed} of {given.rounds}", f"{factor:.2f}", str(len(equal))])
            measured[f"{count} loops"] = {"passed": passed, "real_time_ratio": factor, "results": len(equal)}
    print(machine())
    print(table(["demonstration", "passed", "real-time factor (middle half)", "different results"], rows))
    save("demo_under_load", given, measured)
    if failed or len(digests) != 1:
        raise SystemExit(f"{failed} failed; {len(digests)} different results, 1 is expected")


if __name__ == "__main__":
    main()
