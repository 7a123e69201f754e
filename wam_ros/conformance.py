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


class Conformance:
    """The rows of the contract, tested one after the other.

    Parameters
    ----------
    bench : in the place of the velocity loop.
    attempts : at each row, as a computer that is busy delays a driver that is right; one in which the test itself was
        held up does not count, and proves nothing.
    """

    def __init__(self, bench: DriverBench, attempts: int) -> None:
        self._bench, self._attempts = bench, attempts

    def rows(self) -> Iterator[ConformanceRow]:
        """Test every row, each until it is right or there are no more attempts."""
        blocked = ""
        for key in REQUIREMENTS:
            row = ConformanceRow(key, NOT_TESTED, blocked) if blocked else self.row(key)
            if key == "interface" and row.verdict == WRONG:
                blocked = "the interface is missing"
            yield row
        self._bench.brake()

    def row(self, key: str) -> ConformanceRow:
        """Test one row."""
        bench = self._bench
        row = ConformanceRow(key, NOT_TESTED)
        left, held_up, pause = self._attempts, CONFORMANCE_LIMITS.held_up * self._attempts, 0.0
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
