"""Broken bags: a recording of the nodes, changed at random, and read."""

import signal
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from wam_bag.bag import read
from wam_description.configuration import Configuration
from wam_studies.faults.bag_faults import PATIENCE, limits, mutated, values, verdict
from wam_studies.faults.trials import KEPT, FaultCase, FaultTrial
from wam_studies.faults.watched_stack import WatchedStack, recorded_into

ALLOWED = ("same", "refused", "metadata")  # MCAP has no checksum of metadata records


class ShortRecording:
    """A short recording of the nodes of a configuration: its bytes, and what they hold."""

    def __init__(self, configuration: Configuration) -> None:
        self._folder = TemporaryDirectory(prefix="wam_faults_")
        self.file = Path(self._folder.name, "broken.mcap")
        with WatchedStack(configuration.with_values(recorded_into(configuration, self._folder.name))) as stack:
            stack.begin()
            stack.run(0.1)
        self.whole = next(Path(self._folder.name, "bag").glob("*.mcap")).read_bytes()
        self.file.write_bytes(self.whole)
        self.truth = values(read(self.file))

    def close(self) -> None:
        """Remove it."""
        self._folder.cleanup()


def play(case: FaultCase) -> FaultTrial:
    """A trial of one broken file."""
    recorded: ShortRecording = KEPT.ready(ShortRecording, case.configuration)
    kind, data = mutated(recorded.whole, Random(f"bags {case.seed} {case.number}"))
    recorded.file.write_bytes(data)
    with limits():
        signal.alarm(PATIENCE)
        try:
            found = verdict(recorded.file, recorded.truth, lambda path: values(read(path)))
        except Exception as error:
            found = f"{type(error).__name__}: {error}"
        signal.alarm(0)
    escapes = () if found in ALLOWED else (f"{found} differs unseen",)
    return FaultTrial(case.kind, f"bag, {kind}", 1, escapes)
