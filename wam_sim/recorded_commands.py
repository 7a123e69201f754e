"""Commands of programs in a bag as the stack took them: with the stamps that it gave them, without those it refused."""

from collections import Counter
from typing import Any, NamedTuple

import numpy as np

from wam_bag.arrays import Mask
from wam_bag.bag import Bag, BagError, Columns, JointColumns, TableColumns, WrenchColumns
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
    if found is None:
        return ""
    topic, stamps = found[0], found[1].stamp_ns
    runs = np.split(stamps, np.flatnonzero(np.diff(stamps) < -RESET) + 1)
    if len(runs) > 1:
        times = ", ".join(f"{one[0] / 1e9:.3f} to {one[-1] / 1e9:.3f} s" for one in runs)
        return f"{len(runs)} runs are in this recording: the stamps of {topic} go back ({times})"
    unique, counts = np.unique(stamps, return_counts=True)
    again, most = unique[counts > 1] / 1e9, int(np.max(counts))
    if len(again) < FEWEST or np.any(np.diff(stamps) < 0):
        return ""
    times = f"from {again[0]:.3f} to {again[-1]:.3f} s come {most} times"
    return f"{most} runs are in this recording: the stamps of {topic} {times}"


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
    changed, refused = dict[str, Columns](), list[RefusedCommands]()
    for name in COMMANDS:
        topic = f"{namespace}/{name}"
        columns = bag.topics.get(topic)
        if not isinstance(columns, (WrenchColumns, TableColumns)):
            continue
        taken, frame = columns, np.array(columns.frames, object)
        defects = np.full(len(frame), "", object)
        for other in {*frame} - {*frames} if frames else ():
            defects[frame == other] = f"the frame '{other}', which is none of {', '.join(frames)}"
        if found is not None:
            last = int(np.max(found[1].stamp_ns)) + INPUTS.longest_jump
            is_ahead = (columns.stamp_ns > last) & (name == PUSH)
            taken = _stamped(columns, found[1], (columns.stamp_ns == 0) | is_ahead)
            defects[taken.stamp_ns > last] = AHEAD
        counts = Counter(defects.tolist())
        refused += [RefusedCommands(name, count, defect) for defect, count in sorted(counts.items()) if defect]
        taken = taken if counts.keys() <= {""} else _only(taken, defects == "")
        if taken is not columns:
            changed[topic] = taken
    if changed:
        bag = bag._replace(topics=type(bag.topics)({**bag.topics, **changed}))
    return bag, tuple(refused)


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
    own: dict[str, Any] = {}
    if isinstance(columns, TableColumns):
        rows = kept[columns.message]
        own["message"] = (np.cumsum(kept) - 1)[columns.message[rows]]
        own["columns"] = {name: value[rows] for name, value in columns.columns.items()}
    own |= {name: np.array(value)[kept] for name, value in columns._asdict().items() if name not in own}
    return columns._replace(**own)
