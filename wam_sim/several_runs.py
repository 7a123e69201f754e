"""Whether a bag has several runs: a recorder that goes on while the stack is started again mixes them."""

import numpy as np

from wam_bag.bag import Bag
from wam_sim.recorded_commands import states_of

RESET = 1_000_000_000  # ns by which stamps go back where the stack was started again, rather than a clock set
FEWEST = 10  # stamps that come again where the times of two runs overlap


def several_runs(bag: Bag, namespace: str) -> str:
    """How many runs an arm has in a bag and what shows it, '' where it has one.

    Stamps of states go back, or come again where a lockstep recording has the messages of all runs in the order of
    the arm's time.

    Parameters
    ----------
    bag : any.
    namespace : of the arm.
    """
    found = states_of(bag, namespace)
    if found is not None:
        topic, stamps = found[0], found[1].stamp_ns
        ends = [*np.flatnonzero(np.diff(stamps) < -RESET).tolist(), len(stamps) - 1]
        if len(ends) > 1:
            begins = [0, *(end + 1 for end in ends[:-1])]
            spans = zip(stamps[begins].tolist(), stamps[ends].tolist(), strict=True)
            times = ", ".join(f"{begin / 1e9:.3f} to {end / 1e9:.3f} s" for begin, end in spans)
            return f"{len(ends)} runs are in this recording: the stamps of {topic} go back ({times})"
        unique, counts = np.unique(stamps, return_counts=True)
        again = counts > 1
        if np.sum(again) >= FEWEST and np.all(np.diff(stamps) >= 0):
            first, last = unique[again][[0, -1]] / 1e9
            return (
                f"{int(np.max(counts))} runs are in this recording: the stamps of {topic} from {first:.3f} to "
                f"{last:.3f} s come {int(np.max(counts))} times"
            )
    return ""
