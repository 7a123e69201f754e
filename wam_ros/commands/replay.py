"""`wam replay`: recorded inputs of a node through the same machine again."""

import argparse

from wam_analysis.replay import Compared, replay
from wam_analysis.replay_wirings import WIRINGS
from wam_ros.commands import configuration_of


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("bag", help="directory of the bag, or an .mcap file")
    parser.add_argument("node", choices=tuple(WIRINGS))
    parser.add_argument("--config", help="values to use instead of those in the bag: a YAML file, or an installed name")


def run(given: argparse.Namespace) -> int:
    """Replay, print how each topic came out; 0 where all are the same bit for bit."""
    done = replay(given.bag, given.node, configuration_of(given) if given.config else None)
    for topic in done.topics:
        print(told(topic))
    if not done.is_same and done.mode == "realtime":
        print("recorded in realtime: which input was the newest is known only roughly, so small differences are normal")
    return 0 if done.is_same else 1


def told(topic: Compared) -> str:
    """A line about a topic, a second one about its first difference."""
    line = f"{topic.topic}: {topic.compared} messages, "
    line += f"{topic.different} differ, at most by {topic.largest:.6g}" if topic.different else "the same bit for bit"
    if topic.only_recorded or topic.only_replayed:
        line += f"; {topic.only_recorded} only recorded, {topic.only_replayed} only replayed"
    if topic.first:
        stamp, field, recorded, replayed = topic.first
        line += f"\n    first at {stamp / 1e9:.9f} s: {field} {recorded!r} recorded, {replayed!r} replayed"
    return line
