"""Commands of programs in a bag as the stack took them: with the stamps that it gave them, without those it refused."""

from collections import Counter
from typing import Any, NamedTuple

import numpy as np

from wam_bag.arrays import Mask
from wam_bag.bag import Bag, BagError, JointColumns, TableColumns, WrenchColumns
from wam_description.arm import Arm
from wam_description.signals import BASE
from wam_description.thresholds import INPUTS
from wam_sim.recorded_parameters import RecordedParameters

Commands = WrenchColumns | TableColumns

PUSH = "sim/disturbance"  # whose stamp the driver does not use
COMMANDS = ("force_command", "task_command", PUSH)
STATES = ("motor_states", "joint_sensors", "joint_states", "sim/joint_states")  # the clock, the finest first
RESET = 1_000_000_000  # ns by which stamps go back where the stack was started again, rather than a clock set
FEWEST = 10  # stamps that come again where the times of two runs overlap
AHEAD = "a stamp far ahead of every state (the wall clock?)"


class RefusedCommands(NamedTuple):
    """Messages of a topic that the stack refused for one reason: how many, and what is wrong with them."""

    topic: str
    number: int
    defect: str

    @property
    def sentence(self) -> str:
        """Without the full stop."""
        many = "1 message" if self.number == 1 else f"{self.number} messages"
        return f"{many} of {self.topic} with {self.defect}: the stack refused them, they are left out"


def states_of(bag: Bag, namespace: str) -> tuple[str, JointColumns] | None:
    """The topic whose stamps are the arm's clock and its messages, None if no state was recorded."""
    for name in STATES:
        columns = bag.topics.get(f"{namespace}/{name}")
        if isinstance(columns, JointColumns) and len(columns.stamp_ns):
            return name, columns
    return None


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


def taken_commands(bag: Bag, namespace: str, parameters: RecordedParameters) -> tuple[Bag, tuple[RefusedCommands, ...]]:
    """A bag with the commands that the stack took, and those that it refused.

    A command without a stamp has that of the newest state that was logged before it, as has a push by the wall clock.
    Commands are left out which are far ahead of every state of the recording, or in a frame that the arm does not have.

    Parameters
    ----------
    bag : any.
    namespace : of the arm.
    parameters : of its nodes; without them every frame is taken.
    """
    found, frames = states_of(bag, namespace), _frames(parameters)
    topics, refused = dict(bag.topics), list[RefusedCommands]()
    for name in COMMANDS:
        topic = f"{namespace}/{name}"
        columns = topics.get(topic)
        if not isinstance(columns, (WrenchColumns, TableColumns)) or not len(columns.stamp_ns):
            continue
        kept = np.ones(len(columns.stamp_ns), bool)
        if found is not None:
            last = int(np.max(found[1].stamp_ns)) + INPUTS.longest_jump
            is_ahead = columns.stamp_ns > last
            columns = _stamped(columns, found[1], (columns.stamp_ns == 0) | (is_ahead if name == PUSH else False))
            kept = columns.stamp_ns <= last
            refused.append(RefusedCommands(name, int(np.sum(~kept)), AHEAD))
        if frames:
            unknown = kept & ~np.isin(np.array(columns.frames, np.str_), frames)
            for frame, count in sorted(Counter(np.array(columns.frames, np.str_)[unknown].tolist()).items()):
                defect = f"the frame '{frame}', which is none of {', '.join(frames)}"
                refused.append(RefusedCommands(name, count, defect))
            kept &= ~unknown
        topics[topic] = columns if np.all(kept) else _only(columns, kept)
    changed = any(columns is not bag.topics[topic] for topic, columns in topics.items())
    taken = bag._replace(topics=type(bag.topics)(topics)) if changed else bag
    return taken, tuple(one for one in refused if one.number)


def _frames(parameters: RecordedParameters) -> tuple[str, ...]:
    """The frames that a command may have, none if the arm is not known."""
    try:
        return BASE, *parameters.part("driver", Arm, "arm.").covers.names
    except BagError:
        return ()


def _stamped(columns: Commands, states: JointColumns, missing: Mask) -> Commands:
    """The same with the stamps that are missing, (k,), as far as there is a state before."""
    if not np.any(missing):
        return columns
    rows = np.searchsorted(states.log_time_ns, columns.log_time_ns, side="right")
    newest = np.concatenate([[0], np.maximum.accumulate(states.stamp_ns)])
    return columns._replace(stamp_ns=np.where(missing, newest[rows], columns.stamp_ns))


def _only(columns: Commands, kept: Mask) -> Commands:
    """Some of the messages, (k,)."""
    named: tuple[str, ...] = columns._fields
    if isinstance(columns, TableColumns):
        rows, named = kept[columns.message], ("log_time_ns", "stamp_ns", "frames")
        values = {name: value[rows] for name, value in columns.columns.items()}
        columns = columns._replace(message=(np.cumsum(kept) - 1)[columns.message[rows]], columns=values)
    sliced: dict[str, Any] = {name: np.array(getattr(columns, name))[kept] for name in named}
    return columns._replace(**sliced)
