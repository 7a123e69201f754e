"""The table of kinds of faults."""

from functools import partial
from pathlib import Path

from wam_studies.faults import bags, disks, losses, messages, parameter_sets, second_publishers
from wam_studies.faults.trials import FaultKind

REPLAYED = Path("bags/sample/wam-touch")  # of the repository; `--bag` names another one


def kinds(bag: Path = REPLAYED) -> dict[str, FaultKind]:
    """Every kind by name; `bag` is replayed, and the kind is left out where it is missing."""
    found = [
        FaultKind("messages", "broken messages, lockstep", "messages", 960, 6, partial(messages.play, "lockstep")),
        FaultKind("messages-realtime", "the same in realtime", "messages", 960, 6, partial(messages.play, "realtime")),
        FaultKind("parameters", "sets of live parameters", "sets", 2000, 20, parameter_sets.play),
        FaultKind("losses", "nodes killed and frozen, lockstep", "losses", 108, 0, partial(losses.play, "lockstep")),
        FaultKind("losses-realtime", "the same in realtime", "losses", 108, 0, partial(losses.play, "realtime")),
        FaultKind(
            "publishers",
            "second publishers, lockstep",
            "publishers",
            90,
            4,
            partial(second_publishers.play, "lockstep"),
        ),
        FaultKind(
            "publishers-realtime",
            "the same in realtime",
            "publishers",
            90,
            4,
            partial(second_publishers.play, "realtime"),
        ),
        FaultKind("disks", "full and removed disks", "disks", 12, 1, disks.play),
        FaultKind("bags", "broken bags read", "bags", 3000, 60, bags.play),
    ]
    if bag.exists():
        play = partial(second_publishers.replay, bag)
        found.append(FaultKind("replays", "old bags replayed", "replays", 60, 2, play))
    return {kind.name: kind for kind in found}
