"""`wam replay`: recorded inputs of a node through the same machine again."""

import argparse

from wam_analysis.replay import Compared, Replay, replay
from wam_analysis.replay_wirings import WIRINGS
from wam_ros.commands import configuration_of

EXIT_CODES = "Ends with 0 where every topic is the same bit for bit, with 1 where one is not or the bag cannot be used."
_MOST_GAPS = 5  # named one by one


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.epilog = EXIT_CODES
    parser.add_argument("bag", help="directory of the bag, or an .mcap file")
    parser.add_argument("node", choices=tuple(WIRINGS))
    parser.add_argument("--config", help="values to use instead of those in the bag: a YAML file, or an installed name")


def run(given: argparse.Namespace) -> int:
    """Replay, print how each topic came out; 0 where all are the same bit for bit, else 1."""
    done = replay(given.bag, given.node, configuration_of(given) if given.config else None)
    for line in (*(f"INCOMPLETE: {line}" for line in done.lost), *map(told, done.topics), *reasons(done)):
        print(line)
    return 0 if done.is_same else 1


def reasons(done: Replay) -> list[str]:
    """Why topics are not the same, as far as the recording tells."""
    if done.is_same:
        return []
    lines = []
    alone = [topic.alone for topic in done.topics if topic.alone is not None]
    if alone and done.gaps:
        lines.append(
            f"only recorded from {min(alone) / 1e9:.3f} s on: inputs are missing in the bag, and {done.node} works "
            "only when it has all of a period, as it did while they were recorded"
        )
    if done.gaps:
        lines += [
            f"    {gap.topic}: {gap.missing} missing between {gap.begin / 1e9:.3f} s and {gap.end / 1e9:.3f} s"
            for gap in done.gaps[:_MOST_GAPS]
        ]
        if len(done.gaps) > _MOST_GAPS:
            lines.append(f"    and {len(done.gaps) - _MOST_GAPS} more gaps")
    different, compared = (sum(getattr(topic, name) for topic in done.topics) for name in ("different", "compared"))
    if done.mode == "realtime" and different:
        lines.append(
            f"recorded in realtime: {different} of {compared} messages ({100.0 * different / compared:.1f} %) differ: "
            f"{done.node} took what was newest when it "
            "worked, and the bag knows the order of arrival only roughly, from when the recorder received it. Only a "
            "lockstep recording can be the same bit for bit"
        )
    return lines


def told(topic: Compared) -> str:
    """A line about a topic, a second one about its first difference."""
    line = f"{topic.topic}: {topic.compared} messages, "
    if topic.different:
        share = 100.0 * topic.different / topic.compared
        line += f"{topic.different} differ ({share:.1f} %), at most by {topic.largest:.6g} {topic.unit}".rstrip()
    else:
        line += "the same bit for bit"
    if topic.only_recorded or topic.only_replayed:
        line += f"; {topic.only_recorded} only recorded, {topic.only_replayed} only replayed"
    if topic.first:
        stamp, field, recorded, replayed = topic.first
        line += f"\n    first at {stamp / 1e9:.9f} s: {field} {recorded!r} recorded, {replayed!r} replayed"
    return line
