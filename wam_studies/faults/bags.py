"""Broken bags: a recording of the nodes, changed at random, and read."""

import signal
from collections.abc import Iterator
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from wam_bag.bag import read
from wam_description.configuration import Configuration
from wam_studies.faults.bag_faults import PATIENCE, limits, mutated, values, verdict
from wam_studies.faults.trials import FaultTrial
from wam_studies.faults.watched_stack import WatchedStack

ALLOWED = ("same", "refused", "metadata")  # MCAP has no checksum of metadata records


def play(configuration: Configuration, seed: int, first: int, count: int) -> Iterator[FaultTrial]:
    """Trials `first` to `first + count`, a broken file each."""
    with TemporaryDirectory(prefix="wam_faults_") as folder:
        whole = _record(configuration, Path(folder)).read_bytes()
        file = Path(folder, "broken.mcap")
        file.write_bytes(whole)
        truth = values(read(file))
        with limits():
            for index in range(first, first + count):
                kind, data = mutated(whole, Random(f"bags {seed} {index}"))
                file.write_bytes(data)
                signal.alarm(PATIENCE)
                try:
                    found = verdict(file, truth, lambda path: values(read(path)))
                except (MemoryError, TimeoutError) as error:
                    found = f"{type(error).__name__} {error}"
                except Exception as error:
                    found = f"{type(error).__name__}: {error}"
                signal.alarm(0)
                yield FaultTrial(index, f"bag, {kind}", 1, () if found in ALLOWED else (f"{found} differs unseen",))


def _record(configuration: Configuration, folder: Path) -> Path:
    """The file of a short recording."""
    own = {"nodes": [*configuration.shared.nodes, "recorder"], "timing.mode": "lockstep"}
    own |= {"recorder:directory": str(folder), "recorder:name": "bag"}
    with WatchedStack(configuration.with_values(own)) as stack:
        stack.begin()
        stack.run(0.1)
    return next(Path(folder, "bag").glob("*.mcap"))
