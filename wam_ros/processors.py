"""Processors of the processes of one arm: what works in every inner period keeps to one of them.

A message between two processes wakes its reader.  The kernel starts that at once, on a processor that is idle: it has
to be woken itself and has nothing of the reader in its cache, and the writer is interrupted before it has sent its
message to the next reader.  In lockstep, where the nodes wait for each other anyway, most of a period went into that.
Here the inner loop has a processor, all others have the rest, and who reads waits until who writes has finished
(SCHED_BATCH, which needs no right).  benchmarks/README.md shows the gain; the bits are the same.

In realtime the driver works for most of a period.  Where three processors are permitted, its process has one to itself,
and all others the rest.  benchmarks/README.md shows it.
"""

import os
import random
import re
import time
from collections.abc import Collection, Mapping, MutableMapping
from contextlib import suppress
from pathlib import Path
from typing import Final

from wam_description.arm import Shared
from wam_description.interface import declared, process_groups
from wam_ros.limits import PROCESS_LIMITS
from wam_ros.priority import fifo_is_granted, for_all_threads

PROCESSORS: Final = "WAM_STACK_PROCESSORS"  # environment variable: those of a process by number, and a policy
WAITING: Final = "batch"  # policy SCHED_BATCH
# share the driver's processor in lockstep where each node has a process: most of the messages are theirs
CLOSEST: Final = {"transform", "velocity_loop", "gravity"}
TIMES: Final = Path("/proc/stat")
IDLE: Final = slice(3, 5)  # columns of a processor's times: idle, and waiting for a disk


def placed_groups(shared: Shared, processes: str) -> list[tuple[list[str], dict[str, str]]]:
    """Entries of the parameter `nodes` that share a process, and its environment, in which it finds its processors.

    In realtime that is empty where SCHED_FIFO is not granted, or fewer than three processors are permitted: then each
    process may be anywhere.

    Parameters
    ----------
    shared : shared parameters.
    processes : GROUPED or EACH, of `wam_description.nodes`.
    """
    groups = process_groups(shared.nodes, processes)
    permitted = os.sched_getaffinity(0)
    if len(groups) == 1:
        return [(groups[0], {})]
    if shared.timing.mode == "lockstep":
        closest, policy = CLOSEST, [WAITING]
    elif len(permitted) >= PROCESS_LIMITS.processors and fifo_is_granted(shared.timing.fifo_priority):
        closest, policy = set(), []
    else:
        return [(group, {}) for group in groups]
    idlest, rest = (" ".join([*map(str, part), *policy]) for part in divided(idle_parts(permitted)))
    names = ({declared(entry).name for entry in group} for group in groups)
    is_apart = ("driver" in group or group <= closest for group in names)
    return [(group, {PROCESSORS: idlest if one else rest}) for group, one in zip(groups, is_apart, strict=True)]


def divided(idle: Mapping[int, float]) -> tuple[set[int], set[int]]:
    """Processors of the inner loop and of all others.

    Parameters
    ----------
    idle : part of the time that each permitted processor has been idle, 0 to 1.

    Returns
    -------
    The idlest one for the inner loop, the others; both alike where only one is permitted.
    """
    inner = max(idle, key=lambda one: (round(PROCESS_LIMITS.load_steps * idle[one]), random.random()))
    return {inner}, set(idle) - {inner} or {inner}


def idle_parts(permitted: Collection[int]) -> dict[int, float]:
    """Part of the time that processors are idle, 0 to 1, measured for a moment; 0 where the system does not show it."""
    before = _times()
    time.sleep(PROCESS_LIMITS.load_look)
    after = _times()
    parts = {}
    for one in permitted:
        spent = [b - a for a, b in zip(before.get(one, []), after.get(one, []), strict=False)]
        parts[one] = sum(spent[IDLE]) / (sum(spent) or 1)
    return parts


def _times() -> dict[int, list[int]]:
    try:
        text = TIMES.read_text(encoding="ascii")
    except OSError:
        return {}
    lines = re.findall(r"^cpu(\d+) (.*)", text, re.MULTILINE)
    return {int(number): [int(time) for time in times.split()] for number, times in lines}


def keep_to_processors(environment: MutableMapping[str, str]) -> None:
    """Keep all threads of this process to the processors that bring-up has given it, if it has."""
    # where the system permits others by now, it shares them out itself
    with suppress(OSError, KeyError, ValueError, OverflowError):
        given = environment.pop(PROCESSORS).split()
        processors = [int(one) for one in given if one != WAITING]

        def keep(thread: int) -> None:
            os.sched_setaffinity(thread, processors)
            if WAITING in given:
                os.sched_setscheduler(thread, os.SCHED_BATCH, os.sched_param(0))

        for_all_threads(keep)
