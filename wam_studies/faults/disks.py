"""Disks: full, gone, or not writable, while the recorder or the driver writes."""

import resource
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from wam_bag.bag import BagError, read
from wam_description.event import CAUSE, Level
from wam_studies.faults.trials import FAULTS, KEPT, FaultCase, FaultTrial
from wam_studies.faults.watched_stack import WatchedStack, recorded_into, watched_trial

Work = Callable[[WatchedStack, Path, Random], None]


def play(case: FaultCase) -> FaultTrial:
    """A trial on a stack of its own with a recorder, whose end is part of it."""
    ways: dict[str, Work] = {
        "full disk": _fill,
        "directory removed": _remove,
        "no place for the samples of a fault": _fault,
    }
    name = list(ways)[case.number % len(ways)]
    chance = Random(f"disks {case.seed} {case.number}")
    KEPT.discard()
    with TemporaryDirectory(prefix="wam_faults_") as folder:

        def work(stack: WatchedStack) -> int:
            stack.run(chance.uniform(0.05, 0.3))
            ways[name](stack, Path(folder, "bag"), chance)
            return 1

        own = {
            **recorded_into(case.configuration, folder),
            "driver:post_mortem_directory": "/proc/none" if ways[name] is _fault else "",
        }
        trial = watched_trial(case._replace(configuration=case.configuration.with_values(own)), name, work)
        try:
            KEPT.discard()
        except Exception as error:
            ended = f"the end of a node: {type(error).__name__}: {error}"
            trial = trial._replace(escapes=(*trial.escapes, ended))
    return trial


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
        return "recorder" in stack.statuses and stack.statuses["recorder"].level is Level.ERROR

    if not stack.wait(reported, FAULTS.reported):
        stack.escapes.append(f"the recorder reported nothing within {FAULTS.reported:g} s")


def _fault(stack: WatchedStack, bag: Path, chance: Random) -> None:
    stack.ask("estop")
    stack.run(0.05)
    if not any(event.values[CAUSE] == "emergency_stop" for event in stack.driver.safety.events):
        stack.escapes.append("no emergency stop")
