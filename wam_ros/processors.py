"""Processors of the processes of one arm: what works in every inner period keeps to one of them.

A message between two processes wakes its reader.  The kernel starts that at once, on a processor that is idle: it has
to be woken itself and has nothing of the reader in its cache, and the writer is interrupted before it has sent its
message to the next reader.  In lockstep, where the nodes wait for each other anyway, most of a period went into that.
Here the inner loop has a processor, all others have the rest, and who reads waits until who writes has finished
(SCHED_BATCH, which needs no right).  benchmarks/README.md shows the gain; the bits are the same.
"""

import os
import time
from collections.abc import MutableMapping
from contextlib import suppress
from pathlib import Path
from statistics import mode
from typing import Final

from wam_description.arm import Shared
from wam_description.interface import declared, process_groups
from wam_ros.limits import PROCESS_LIMITS
from wam_ros.priority import for_all_threads

PROCESSORS: Final = "WAM_STACK_PROCESSORS"  # environment variable: those of a process by number
# share the driver's processor in lockstep where each node has a process: most of the messages are theirs
CLOSEST: Final = {"transform", "velocity_loop", "gravity"}
STATE: Final = Path("/proc/thread-self/stat")
PROCESSOR: Final = 36  # word of it behind the name of the thread


def placed_groups(shared: Shared, processes: str) -> list[tuple[list[str], dict[str, str]]]:
    """Entries of the parameter `nodes` that share a process, and its environment, in which it finds its processors.

    That is empty in realtime, and for a process alone: it may be anywhere.

    Parameters
    ----------
    shared : shared parameters.
    processes : ONE, GROUPED or EACH, of `wam_description.nodes`.
    """
    groups = process_groups(shared.nodes, processes)
    if shared.timing.mode == "realtime" or len(groups) == 1:
        return [(group, {}) for group in groups]
    permitted, inner = os.sched_getaffinity(0), {idle_processor()}
    idle, rest = (" ".join(map(str, part)) for part in (inner, permitted - inner or inner))
    names = ({declared(entry).name for entry in group} for group in groups)
    is_inner = ("driver" in group or group <= CLOSEST for group in names)
    return [(group, {PROCESSORS: idle if one else rest}) for group, one in zip(groups, is_inner, strict=True)]


def idle_processor() -> int:
    """The processor on which the system wakes this thread most often: an idle one, where there is any."""
    woken = []
    for _ in range(PROCESS_LIMITS.looks):
        time.sleep(PROCESS_LIMITS.look)
        woken.append(int(STATE.read_text(encoding="ascii").rpartition(")")[2].split()[PROCESSOR]))
    return mode(woken)


def keep_to_processors(environment: MutableMapping[str, str]) -> None:
    """Keep all threads of this process to the processors that bring-up has given it, if it has."""
    # where the system permits others by now, it shares them out itself
    with suppress(OSError, KeyError, ValueError, OverflowError):
        processors = [int(one) for one in environment.pop(PROCESSORS).split()]

        def keep(thread: int) -> None:
            os.sched_setaffinity(thread, processors)
            os.sched_setscheduler(thread, os.SCHED_BATCH, os.sched_param(0))

        for_all_threads(keep)
