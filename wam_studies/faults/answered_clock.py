"""A clock for realtime on a machine of any speed: a period passes when the arm's last state has been answered."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

LONGEST: Final = 0.01  # s of wall time, after which a period passes without an answer


class AnsweredClock:
    """Counts periods: one passes with each answer, or after `LONGEST` without any.

    So nodes in realtime are neither late because of a busy machine, nor does the loss of an answer stop their time.

    Parameters
    ----------
    period : s.
    """

    def __init__(self, period: float) -> None:
        self._period, self._now = period, 0.0
        self._steady: Callable[[], float] = time.perf_counter
        self._last = self._steady()

    def __call__(self) -> float:
        """Time, s."""
        if self._steady() - self._last > LONGEST:
            self.advance()
        return self._now

    def advance(self) -> None:
        """Let one period pass."""
        self._now += self._period
        self._last = self._steady()

    @contextmanager
    def of_new_nodes(self, mode: str) -> Iterator[None]:
        """Nodes that are made in this context keep this clock as their steady clock, where `mode` is realtime."""
        if mode == "realtime":
            time.perf_counter = self
        try:
            yield
        finally:
            time.perf_counter = self._steady
