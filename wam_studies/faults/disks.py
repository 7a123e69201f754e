"""Disks: full, gone, or not writable, while the recorder or the driver writes."""

import resource
import shutil
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Final

from wam_bag.bag import BagError, read
from wam_description.configuration import Configuration
from wam_description.event import CAUSE
from wam_studies.faults.trials import FAULTS, FaultTrial
from wam_studies.faults.watched_stack import NodeEndedError, WatchedStack

Work = Callable[[WatchedStack, Path, Random], None]
ERROR: Final = b"\x02"


def play(configuration: Configuration, seed: int, first: int, count: int) -> Iterator[FaultTrial]:
    """Trials `first` to `first + count`, a stack and a bag each."""
    ways = {"full disk": _fill, "directory removed": _remove, "no place for the samples of a fault": _fault}
    for index in range(first, first + count):
        chance = Random(f"disks {seed} {index}")
        name = list(ways)[index % len(ways)]
        with TemporaryDirectory(prefix="wam_faults_") as folder:
            values = {
                "nodes": [*configuration.shared.nodes, "recorder"],
                "timing.mode": "lockstep",
                "recorder:directory": folder,
                "recorder:name": "bag",
                "driver:post_mortem_directory": "/proc/none" if ways[name] is _fault else "",
            }
            yield _trial(configuration.with_values(values), index, name, Path(folder, "bag"), ways[name], chance)


def _trial(configuration: Configuration, index: int, name: str, bag: Path, work: Work, chance: Random) -> FaultTrial:
    """One trial; the end of the recorder is part of it."""
    stack = WatchedStack(configuration)
    reason = stack.begin()
    try:
        if not reason:
            stack.run(chance.uniform(0.05, 0.3))
            work(stack, bag, chance)
            reason = stack.recover()
    except NodeEndedError as error:
        reason = str(error)
    try:
        stack.close()
    except Exception as error:
        stack.escapes.append(f"the end of a node: {type(error).__name__}: {error}")
    escapes = (*stack.escapes, *filter(None, [reason]))
    return FaultTrial(index, name, escapes=escapes, motion=stack.motion, force=stack.force)


def _fill(stack: WatchedStack, bag: Path, chance: Random) -> None:
    """No file of this process may grow any more, as on a full disk; what was written must stay readable."""
    size = max(file.stat().st_size for file in bag.glob("*.mcap"))
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size + chance.choice(FAULTS.room), before[1]))
    try:
        _is_reported(stack)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    with suppress(BagError):  # a refusal with advice is an answer, too
        read(bag)


def _remove(stack: WatchedStack, bag: Path, chance: Random) -> None:
    shutil.rmtree(bag)
    _is_reported(stack)


def _is_reported(stack: WatchedStack) -> None:
    def reported() -> bool:
        stack.run(0.01)
        return "recorder" in stack.statuses and stack.statuses["recorder"].level == ERROR

    if not stack.wait(reported, FAULTS.reported):
        stack.escapes.append(f"the recorder reported nothing within {FAULTS.reported:g} s")


def _fault(stack: WatchedStack, bag: Path, chance: Random) -> None:
    stack.ask("estop")
    stack.run(0.05)
    if not any(event.values[CAUSE] == "emergency_stop" for event in stack.driver.safety.events):
        stack.escapes.append("no emergency stop")
