"""Processors in realtime: the driver works for most of a period, and has one to itself where three are permitted."""

import os
import random
from collections.abc import MutableMapping
from contextlib import suppress
from typing import Final

from wam_description.arm import Shared
from wam_description.interface import declared, process_groups
from wam_ros.limits import PROCESS_LIMITS
from wam_ros.priority import fifo_is_granted, for_all_threads

PROCESSORS: Final = "WAM_STACK_PROCESSORS"  # environment variable: those of a process by number


def placed_groups(shared: Shared, processes: str) -> list[tuple[list[str], dict[str, str]]]:
    """Entries of the parameter `nodes` that share a process, and its environment, in which it finds its processors.

    That is empty in lockstep, where SCHED_FIFO is not granted, and where fewer than three processors are permitted:
    then each process may be anywhere.

    Parameters
    ----------
    shared : shared parameters.
    processes : GROUPED or EACH, of `wam_description.nodes`.
    """
    groups = process_groups(shared.nodes, processes)
    permitted, timing = set(os.sched_getaffinity(0)), shared.timing
    is_few = timing.mode == "lockstep" or len(permitted) < PROCESS_LIMITS.processors
    if is_few or not fifo_is_granted(timing.fifo_priority):
        return [(group, {}) for group in groups]
    own = random.choice(sorted(permitted))  # another arm may run here
    places = {True: str(own), False: " ".join(map(str, permitted - {own}))}
    return [(group, {PROCESSORS: places["driver" in {declared(one).name for one in group}]}) for group in groups]


def keep_to_processors(environment: MutableMapping[str, str]) -> None:
    """Keep all threads of this process to the processors that bring-up has given it, if it has."""
    # where the system permits others by now, it shares them out itself
    with suppress(OSError, KeyError, ValueError, OverflowError):
        processors = [int(one) for one in environment.pop(PROCESSORS).split()]
        for_all_threads(lambda thread: os.sched_setaffinity(thread, processors))
