"""Priority of a process that must not be late, as far as the system grants it.

On Linux priority belongs to the thread, and the middleware has threads of its own.  The niceness of threads counts only
within their session where the kernel shares processors between sessions first (autogroup), and bring-up gives each
process a session of its own: there the session needs the niceness, too.

One thread of the middleware is left as it is: the one that sends later, `dds.asyn`, asks again and again for what
another thread holds.  Ahead of all others, on the one processor that a container may have, it would never let that
thread go on.
"""

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from wam_ros.limits import PROCESS_LIMITS

SESSION: Final = Path("/proc/self/autogroup")
SENDS_LATER: Final = "dds.asyn"  # how the name of that thread begins
PRIORITY: Final = "priority"  # key of what was granted, in the diagnostics
USUAL: Final = "usual"


class Priority:
    """That of this process: it has one only as long as it leaves the processor to other programs now and then.

    A process that is too slow for realtime would never do so, and no program of the operator could begin, not even one
    that calls the e-stop.

    Attributes
    ----------
    granted : for people.
    """

    granted = USUAL
    _then = 0.0, 0.0  # as `spent`

    def ask(self, fifo: int, niceness: int) -> None:
        """As `set_priority`."""
        self.granted, self._then = set_priority(fifo, niceness), spent()

    def look(self) -> bool:
        """Give the priority back, where the process took too much of a processor; whether this happened now."""
        (then, used), now = self._then, spent()
        if self.granted == USUAL or now[0] - then < PROCESS_LIMITS.share_look:
            return False
        self._then, share = now, (now[1] - used) / (now[0] - then)
        if share <= PROCESS_LIMITS.share:
            return False
        for_all_threads(_as_usual)
        _session_granted(0)
        self.granted = USUAL
        return True


OWN: Final = Priority()


def spent() -> tuple[float, float]:
    """The time, and the processor time of this process, s."""
    return time.monotonic(), time.process_time()


def _as_usual(thread: int) -> None:
    os.sched_setscheduler(thread, os.SCHED_OTHER, os.sched_param(0))
    os.setpriority(os.PRIO_PROCESS, thread, max(0, os.getpriority(os.PRIO_PROCESS, thread)))


def set_priority(fifo: int, niceness: int) -> str:
    """Ask the system to prefer this process: ahead of all usual ones, or else with another part of their time.

    Parameters
    ----------
    fifo : of SCHED_FIFO; 0: not requested.
    niceness : where that is not granted; 0: not requested; above 0 others are preferred.

    Returns
    -------
    What was granted, for people.
    """
    level = os.sched_param(fifo)  # inherited by threads that begin later: the executor has one for its timers
    if fifo and for_all_threads(lambda thread: os.sched_setscheduler(thread, os.SCHED_FIFO, level), SENDS_LATER):
        return f"SCHED_FIFO {fifo}"
    if niceness and for_all_threads(lambda thread: os.setpriority(os.PRIO_PROCESS, thread, niceness)):
        return f"nice {niceness}{' with its session' if _session_granted(niceness) else ''}"
    return USUAL


def for_all_threads(ask: Callable[[int], None], but: str = " ") -> bool:
    """Ask for something for all threads of this process; whether it was granted to each that has not ended meanwhile.

    Parameters
    ----------
    ask : makes the request for a thread.
    but : how the names of threads begin for which it is not made.
    """
    for thread in Path("/proc/self/task").iterdir():
        try:
            if not (thread / "comm").read_text(encoding="utf-8").startswith(but):
                ask(int(thread.name))
        except PermissionError:
            return False
        except (ProcessLookupError, FileNotFoundError):
            pass
    return True


def _session_granted(niceness: int) -> bool:
    try:
        SESSION.write_text(str(niceness), encoding="ascii")
    except OSError:  # a kernel without it, or which answers 'try again' to a second request within 0.1 s
        return False
    return True
