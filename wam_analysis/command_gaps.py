"""Times in which a command was not recorded while other topics were: what was commanded then is not known."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wam_analysis.held_messages import held_for, rows_before_gaps
from wam_bag.arrays import Mask, Times
from wam_bag.bag import TableColumns, WrenchColumns
from wam_sim.recorded_run import RecordedRun, RecordedStep

COMMANDS = ("force_command", "task_command", "sim/disturbance")


class CommandGap(NamedTuple):
    """A topic of a command and when none of its messages was recorded, ns."""

    topic: str
    begin: int
    end: int

    def sentence(self, zero: int) -> str:
        """What is not known, and when, counted from `zero`, ns."""
        begin, end = ((stamp - zero) / 1e9 for stamp in (self.begin, self.end))
        return f"{self.topic} was not recorded from {begin:.2f} to {end:.2f} s: what was commanded then is not known."

    def covers(self, stamps: Times, after: int = 0) -> Mask:
        """Which stamps are in it, or up to `after` ns behind it."""
        return (stamps > self.begin) & (stamps < self.end + after)


def command_gaps(run: RecordedRun, recorded: Times, steps: Sequence[RecordedStep]) -> tuple[CommandGap, ...]:
    """The gaps of commands, by topic.

    Commands are streamed.  Where a stream pauses because a program ended it, nothing is commanded; that is so where
    the recorder has every message, or where the last one commanded nothing and no scenario, which always streams, runs.

    Parameters
    ----------
    run : the run.
    recorded : stamps of what else was recorded, ns; a gap in all topics is none of a command.
    steps : of the scenario.
    """
    found, complete = list[CommandGap](), run.bag.losses.complete
    for topic in COMMANDS:
        name = f"{run.namespace}/{topic}"
        columns = run.bag.topics.get(name)
        if not isinstance(columns, (WrenchColumns, TableColumns)) or name in complete:
            continue
        stamps, commands = columns.stamp_ns, _commands(columns)
        gaps = [(stamps[row], stamps[row + 1], commands[row]) for row in rows_before_gaps(stamps)]
        held = held_for(stamps)
        if steps and len(stamps):
            gaps = [(steps[0].begin, stamps[0], True), *gaps, (stamps[-1], steps[-1].end, True)]
        for begin, end, last in gaps:
            is_played = any(step.begin <= begin < step.end for step in steps)
            is_recorded = np.sum((recorded > begin + held) & (recorded < end)) > 1
            if end - begin > held and is_recorded and (last or is_played):
                found.append(CommandGap(topic, int(begin), int(end)))
    return tuple(found)


def _commands(columns: WrenchColumns | TableColumns) -> Mask:
    """Whether each message commands anything, (k,)."""
    if isinstance(columns, WrenchColumns):
        return np.any(columns.force != 0.0, axis=1)
    return np.isin(np.arange(len(columns.stamp_ns)), columns.message)
