"""A long run of the nodes in one process with a moving arm and the recorder: memory and losses."""

import resource
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import cycle, islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple

import numpy as np
import yaml

from wam_bag.bag import read
from wam_description.arm import Arm
from wam_description.configuration import Configuration
from wam_description.parameters import parameter
from wam_ros.bring_up import Composition
from wam_studies.contact.moves import MoveGenerator
from wam_studies.faults.trials import FAULTS
from wam_studies.harness import Study
from wam_studies.scores import ANY, NONE_AT_ALL, Row, Scores, exact

PUSH: Final = {"newtons": [0.0, 8.0, 0.0], "begin": 0.5, "end": 1.0}


class SoakCase(NamedTuple):
    """Nodes, mode and recorder as configured, for some seconds of the arm's time."""

    configuration: Configuration
    seed: int
    seconds: float


class SoakRecord(NamedTuple):
    """What a long run has shown.

    Attributes
    ----------
    seconds : of the arm's time.
    factor : the arm's time by the wall clock's.
    early, late : MB of resident memory after a tenth of the run, and at its end.
    messages : in the bag.
    losses : what the bag lacks, in words.
    failure : why the scenario stopped, '' where it did not.
    """

    seconds: float
    factor: float
    early: float
    late: float
    messages: int
    losses: tuple[str, ...]
    failure: str


def soak(case: SoakCase) -> SoakRecord:
    """Run the configured nodes, in the configured mode."""
    configuration = case.configuration
    with TemporaryDirectory(prefix="wam_soak_") as folder:
        script = Path(folder, "scenario.yaml")
        script.write_text(yaml.safe_dump({"steps": _steps(configuration.shared.arm, case)}), encoding="utf-8")
        nodes = [*configuration.shared.nodes, "scenario", "recorder"]
        own = {"scenario:script": str(script), "recorder:directory": folder, "recorder:name": "soak", "nodes": nodes}
        with Composition(configuration.with_values(own)) as composition:
            samples: list[_MemorySample] = []
            failure = composition.play(partial(_sample, samples))
        found = read(Path(folder, "soak"), ())
    first, last, early = samples[0], samples[-1], samples[len(samples) // 10].memory
    factor = (last.seconds - first.seconds) / max(last.wall - first.wall, 1e-9)
    count = sum(found.counts.values())
    return SoakRecord(
        last.seconds, factor, early, last.memory, count, tuple(found.losses.sentences(found.first)), failure
    )


@dataclass(frozen=True)
class SoakStudy(Study[SoakCase, SoakRecord]):
    """One run of each seed, which draws the postures."""

    title = "a long run: memory and lost messages"
    page = "docs/safety.md"
    seeds = (1,)
    over_topics = True

    seconds: float = parameter("duration in the arm's time", "s", low=2.0, default=600.0)

    run = staticmethod(soak)

    def cases(self, seed: int) -> Iterator[SoakCase]:
        """The one run of a seed."""
        yield SoakCase(self.configuration, seed, self.seconds)

    def failure(self, record: SoakRecord) -> str:
        """Why the run stopped, and what its bag lacks; '' where all is well."""
        return "; ".join(filter(None, [record.failure, *record.losses]))

    def score(self, records: Sequence[SoakRecord]) -> Scores:
        """Growth of the memory, lost messages and ends before the time; the longest run."""
        longest = max(records, key=lambda one: one.seconds)
        growth = max(one.late - one.early for one in records)
        counts = {
            "memory, growth after a tenth of the run [MB]": (growth, (-np.inf, FAULTS.growth)),
            "topics with lost messages": (sum(len(one.losses) for one in records), NONE_AT_ALL),
            "runs that stopped": (sum(bool(one.failure) for one in records), NONE_AT_ALL),
            "time of the arm [s]": (longest.seconds, ANY),
            "real-time factor": (longest.factor, ANY),
            "memory at the end [MB]": (longest.late, ANY),
            "recorded messages": (longest.messages, ANY),
        }
        return Scores([Row(name, exact(v, len(records)), required=bound) for name, (v, bound) in counts.items()])


def _steps(arm: Arm, case: SoakCase) -> list[dict[str, Any]]:
    drawn = MoveGenerator(arm).moves(np.random.default_rng(case.seed), arm.joints.start, FAULTS.postures)
    push = {"cover": arm.covers.names[-1], "contact_position": FAULTS.along * arm.covers.length[-1], **PUSH}
    moves = [
        {"name": f"move {i}", "seconds": FAULTS.move, "posture": list(move.posture), "push": push}
        for i, move in enumerate(islice(cycle(drawn), max(1, int(case.seconds / FAULTS.move))))
    ]
    return [
        {"name": "release", "seconds": 0.5, "request": "enable"},
        *moves,
        {"name": "brake", "seconds": 0.5, "request": "disable"},
    ]


class _MemorySample(NamedTuple):
    """Wall time and the arm's time, s, and resident memory, MB."""

    wall: float
    seconds: float
    memory: float


def _sample(samples: list[_MemorySample], seconds: float) -> bool:
    """Take a sample once in a second of wall time; False, as the run does not end."""
    now = time.monotonic()
    if not samples or now >= samples[-1].wall + 1.0:
        pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1])
        samples.append(_MemorySample(now, seconds, pages * resource.getpagesize() / 1e6))
    return False
