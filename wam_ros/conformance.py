"""Tests a running driver against its contract (`wam_description.driver_contract`), row by row, over topics."""

from collections.abc import Iterator
from typing import NamedTuple

from wam_description.driver_contract import REQUIREMENTS
from wam_ros.driver_bench import DriverBench, Untested
from wam_ros.driver_checks import CHECKS
from wam_ros.limits import CONFORMANCE_LIMITS

OK, WRONG, NOT_TESTED = "ok", "WRONG", "not tested"
ONCE = ("interface", "end", "session")  # a second attempt finds another driver, or none


class ConformanceRow(NamedTuple):
    """Result of one row of the contract: ok, WRONG or not tested, and what is wrong."""

    key: str
    verdict: str
    found: str = ""

    @property
    def text(self) -> str:
        """For people: the verdict, the row and, where it is wrong, what to do."""
        requirement = REQUIREMENTS[self.key]
        lines = [f"{self.verdict:<10}  {self.key:<10}  {requirement.text}"]
        if self.found:
            lines.append(f"{'':24}{self.found}")
        if self.verdict == WRONG:
            lines.append(f"{'':24}-> {requirement.advice}")
        return "\n".join(lines)


def conformance_rows(bench: DriverBench, attempts: int) -> Iterator[ConformanceRow]:
    """Test every row of the contract, each until it is right or there are no more attempts.

    Parameters
    ----------
    bench : in the place of the velocity loop.
    attempts : at each row, see `conformance_row`.
    """
    blocked = ""
    for key in REQUIREMENTS:
        row = ConformanceRow(key, NOT_TESTED, blocked) if blocked else conformance_row(bench, key, attempts)
        if key == "interface" and row.verdict == WRONG:
            blocked = "the interface is missing"
        yield row
    bench.brake()


def conformance_row(bench: DriverBench, key: str, attempts: int) -> ConformanceRow:
    """Test one row, with several attempts, as a computer that is busy delays a driver that is right.

    One in which the test itself was held up does not count, and proves nothing.
    """
    row = ConformanceRow(key, NOT_TESTED)
    left, held_up, pause = attempts, CONFORMANCE_LIMITS.held_up * attempts, 0.0
    while left and held_up:
        bench.longest_pause = 0.0
        try:
            found = CHECKS[key](bench)
            row = ConformanceRow(key, WRONG if found else OK, found)
        except Untested as reason:
            row = ConformanceRow(key, NOT_TESTED, str(reason))
        finally:
            bench.be_proper()
        if row.verdict == OK or key in ONCE:
            break
        pause = bench.longest_pause
        left, held_up = (left, held_up - 1) if pause > CONFORMANCE_LIMITS.pause else (left - 1, held_up)
    if row.verdict != OK and not held_up:
        late = f"this computer delayed the test itself, last by {1e3 * pause:.0f} ms"
        row = ConformanceRow(key, NOT_TESTED, f"{row.found} ({late})")
    return row
