"""Which node of a process is inside a long step: it holds up all nodes of the process, which are not the cause.

A node inside a step cannot report it itself, so that a thread does, in realtime.  In lockstep the arm waits.
"""

import threading
import time
from collections.abc import Callable
from typing import NamedTuple

from wam_ros.limits import NODE_LIMITS


class LongStep(NamedTuple):
    """A step that takes long, or took long."""

    node: str
    seconds: float

    def __str__(self) -> str:
        return f"{self.node} was in a step of {self.seconds:.2g} s"


class Steps:
    """The steps of the nodes of this process, one at a time."""

    def __init__(self) -> None:
        self._present: tuple[str, float] | None = None
        self._last: tuple[LongStep, float] = LongStep("", 0.0), 0.0
        self._reports: dict[str, Callable[[LongStep], None]] = {}
        self._reported = ""
        self._end = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def nodes(self) -> frozenset[str]:
        """Nodes that are watched."""
        return frozenset(self._reports)

    def watch(self, node: str, report: Callable[[LongStep], None]) -> None:
        """Let a thread report once that a node is inside a long step; `forget` ends that."""
        self._reports[node] = report
        if self._thread is None:
            self._end.clear()
            self._thread = threading.Thread(target=self._look, name="long steps", daemon=True)
            self._thread.start()

    def forget(self, node: str) -> None:
        """Report nothing about a node any more."""
        self._reports.pop(node, None)
        if self._thread is not None and not self._reports:
            self._end.set()
            self._thread.join()
            self._thread = None

    def begin(self, node: str, now: float) -> None:
        """A step begins, s on the monotonic clock."""
        self._present = node, now

    def end(self, node: str, began: float) -> bool:
        """A step has ended; whether it was reported meanwhile."""
        self._present = None
        now, last = time.monotonic(), self.recent()
        if now - began > max(NODE_LIMITS.long_step, last.seconds if last else 0.0):
            self._last = LongStep(node, now - began), now
        was_reported, self._reported = self._reported == node, ""
        return was_reported

    def recent(self) -> LongStep | None:
        """The longest step that has just ended, None where none was long."""
        step, ended = self._last
        return step if step.node and time.monotonic() - ended < NODE_LIMITS.long_step_recent else None

    def _look(self) -> None:
        while not self._end.wait(NODE_LIMITS.long_step_look):
            present = self._present
            if present is None or present[0] == self._reported:
                continue
            node, began = present
            taken = time.monotonic() - began
            report = self._reports.get(node)
            if report is not None and taken > NODE_LIMITS.long_step:
                self._reported = node
                report(LongStep(node, taken))


STEPS = Steps()
