"""The pace of simulated time: never ahead of the wall clock times a factor, slower where the machine is slower."""

from collections.abc import Callable

from wam_description.arm import seconds
from wam_driver.thresholds import DRIVER


class Pacer:
    """Determines when a period is due, and measures how fast simulated time passes.

    Parameters
    ----------
    factor : simulated time per time of the wall clock; 0: every period is due at once.
    now : the wall clock, s; it must be steady.

    Attributes
    ----------
    slips : periods that were more than `slack` late, so that the excess was forgotten.
    passed : simulated time and time of the wall clock while it passed, s; pauses do not count.
    """

    def __init__(self, factor: float, now: Callable[[], float]) -> None:
        self._factor, self._now = factor, now
        self.slips = 0
        self._behind = 0.0
        self._origin = 0.0  # of the wall clock, when the stamp 0 would have been due
        self._last: tuple[float, int] | None = None  # wall clock and stamp of the last period since a restart
        self.passed = self._reported = (0.0, 0.0)

    def is_due(self, stamp: int) -> bool:
        """Whether the period that ends with the state of `stamp`, ns, may pass now; call it before each."""
        now = self._now()
        simulated = seconds(stamp)
        if self._last is None:
            self._last = now, stamp
            if self._factor:
                self._origin = now - simulated / self._factor
        elif self._factor:
            late = now - self._origin - simulated / self._factor
            if late < 0.0:
                return False
            self._behind = max(self._behind, late)
            if late > DRIVER.slack:
                self._origin += late - DRIVER.slack
                self.slips += 1
        before, then = self._last
        self.passed = self.passed[0] + seconds(stamp - then), self.passed[1] + (now - before)
        self._last = now, stamp
        return True

    def restart(self) -> None:
        """Time was stopped or stepped by hand: the next period is due at once, and what was missed is not made up."""
        self._last = None

    def report(self) -> tuple[float, float]:
        """Simulated time per time of the wall clock, and largest delay of a period, s, since the last report."""
        simulated, elapsed = (now - then for now, then in zip(self.passed, self._reported, strict=True))
        behind, self._reported, self._behind = self._behind, self.passed, 0.0
        return simulated / elapsed if elapsed > 0.0 else 0.0, behind
