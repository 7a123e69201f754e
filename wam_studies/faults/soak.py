"""A long run of the nodes in this process with a moving arm and the recorder: memory and losses."""

import resource
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple

import numpy as np
import yaml

from wam_bag.contents import Contents, contents
from wam_bag.losses import losses
from wam_description.arm import Arm
from wam_description.configuration import Configuration
from wam_ros.bring_up import Composition
from wam_studies.contact.moves import MoveGenerator
from wam_studies.faults.trials import FAULTS

PUSH: Final = {"newtons": [0.0, 8.0, 0.0], "begin": 0.5, "end": 1.0}


class Soak(NamedTuple):
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

    @property
    def missed(self) -> list[str]:
        """What does not hold."""
        found = [self.failure] if self.failure else []
        if self.late - self.early > FAULTS.growth:
            found.append(f"memory grew by {self.late - self.early:.1f} MB; allowed: {FAULTS.growth:g} MB")
        return [*found, *self.losses]

    def section(self, command: str) -> str:
        """The section of docs/safety.md."""
        growth = f"{self.early:.0f} MB after a tenth of the run, {self.late:.0f} MB at its end"
        lost = " ".join(self.losses) or "none"
        return (
            f"Written by `{command}`.\n\n"
            f"| quantity | value |\n| --- | --- |\n| time of the arm | {self.seconds:.0f} s |\n"
            f"| real-time factor | {self.factor:.3f} |\n| memory | {growth} |\n"
            f"| recorded messages | {self.messages} |\n| lost messages | {lost} |\n"
            f"| faults | {self.failure or 'none'} |"
        )


def soak(configuration: Configuration, seconds: float, report: Callable[[int, int], None]) -> Soak:
    """Run the configured nodes for `seconds` of the arm's time, in the configured mode."""
    with TemporaryDirectory(prefix="wam_soak_") as folder:
        script = Path(folder, "scenario.yaml")
        script.write_text(yaml.safe_dump({"steps": _steps(configuration.shared.arm, seconds)}), encoding="utf-8")
        nodes = [*configuration.shared.nodes, "scenario", "recorder"]
        own = {"scenario:script": str(script), "recorder:directory": folder, "recorder:name": "soak", "nodes": nodes}
        memory: list[float] = []
        with Composition(configuration.with_values(own)) as composition:
            clock = _Sampler(memory, seconds, report)
            failure = composition.play(clock).failure
        found = contents(Path(folder, "soak"))
    early, late = memory[len(memory) // 10], memory[-1]
    count = sum(topic.messages for topic in found.topics.values())
    return Soak(clock.seconds, clock.factor, early, late, count, tuple(lost_in(found)), failure)


def lost_in(found: Contents) -> list[str]:
    """What a bag lacks, in words."""
    counts = {name: topic.messages for name, topic in found.topics.items()}
    return losses(found.path, found.metadata, found.attachments, counts).sentences(found.first)


def _steps(arm: Arm, seconds: float) -> list[dict[str, Any]]:
    drawn = MoveGenerator(arm).moves(np.random.default_rng(FAULTS.seed), arm.joints.start, FAULTS.postures)
    postures = [list(move.posture) for move in drawn]
    push = {"cover": arm.covers.names[-1], "contact_position": FAULTS.along * arm.covers.length[-1], **PUSH}
    moves = [
        {"name": f"move {i}", "seconds": FAULTS.move, "posture": postures[i % FAULTS.postures], "push": push}
        for i in range(max(1, int(seconds / FAULTS.move)))
    ]
    return [
        {"name": "release", "seconds": 0.5, "request": "enable"},
        *moves,
        {"name": "brake", "seconds": 0.5, "request": "disable"},
    ]


class _Sampler:
    """Samples memory once in a second of wall time, and the real-time factor; never ends the run."""

    def __init__(self, memory: list[float], seconds: float, report: Callable[[int, int], None]) -> None:
        self._memory, self._seconds, self._report = memory, seconds, report
        self._next = self._begin = time.monotonic()
        self._first: float | None = None
        self.seconds = self.factor = 0.0

    def __call__(self, seconds: float) -> bool:
        """False, at an arm's time, s."""
        now = time.monotonic()
        self._first = seconds if self._first is None else self._first
        if now >= self._next:
            self._next = now + 1.0
            pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1])
            self._memory.append(pages * resource.getpagesize() / 1e6)
            self.seconds = seconds
            self.factor = (self.seconds - self._first) / max(now - self._begin, 1e-9)
            self._report(min(int(self.seconds), int(self._seconds)), int(self._seconds))
        return False
