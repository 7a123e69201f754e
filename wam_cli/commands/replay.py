"""`wam replay`: a node run again on its recorded inputs."""

import argparse

from wam_cli.options import configuration_of, take_arm, take_configuration
from wam_description.configuration import option_values
from wam_sim.replay import REPLAYED, Compared, Replay, replay

ENDS = (
    "Without --config the values are those in the bag. "
    "Exit code: 0 if every topic is the same bit for bit, 1 if one is not, 2 if the bag cannot be used."
)
LISTED = 8  # values that are named one by one


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `wam replay` to its parser."""
    parser.epilog = ENDS
    parser.add_argument("bag", help="directory of the bag, or an .mcap file")
    parser.add_argument("node", help=f"{', '.join(REPLAYED)}, or my_package.module:Class")
    take_arm(parser)
    take_configuration(parser, default=None)


def run(given: argparse.Namespace) -> int:
    """Replay and print the comparison of each topic; 0 if all are the same bit for bit, else 1."""
    configuration = configuration_of(given) if given.config else None
    values = {} if given.config else option_values(given.values)
    done = replay(given.bag, given.node, configuration, values, given.namespace or "")
    for line in (
        *([done.others] * bool(done.others)),
        *(f"INCOMPLETE: {line}" for line in done.lost),
        *other_values(done),
        *map(stated, done.topics),
        *reasons(done),
        *without_effect(given.values, done),
    ):
        print(line)
    return 0 if done.is_same else 1


def other_values(done: Replay) -> list[str]:
    """A line which names the parameters that differ between --config and the recording; they may be unintended."""
    named = [one.name + f"={_brief(one.used)}" * (not isinstance(one.used, tuple)) for one in done.changed]
    if not named:
        return []
    scalar = next((one for one in done.changed if not isinstance(one.recorded, tuple)), None)
    keep = f"; to keep a recorded value: --set {scalar.name}={_brief(scalar.recorded)}" if scalar else ""
    more = f" and {len(named) - LISTED} more" if len(named) > LISTED else ""
    return [f"--config differs from the recording in {', '.join(named[:LISTED])}{more}{keep}"]


def _brief(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else f"{value}"


def without_effect(values: list[str], done: Replay) -> list[str]:
    """A line which states that new values changed nothing, so that nobody takes this for a result."""
    if not values or not done.is_same:
        return []
    why = f"either the recording had these values, or they have no effect on {done.node} with its other parameters"
    return [
        f"nothing changed with {', '.join(values)}: {why}. For example, friction has no effect with use_joint_sensors"
    ]


def reasons(done: Replay) -> list[str]:
    """Why replayed and recorded topics differ, as far as the recording shows."""
    if done.is_same:
        return []
    lines = []
    if done.lost:
        lines.append(
            f"where an input was lost, {done.node} has no output, in lockstep perhaps until the end of the bag; after "
            "the gap its state differs from the recorded run"
        )
    different, compared = (sum(getattr(topic, name) for topic in done.topics) for name in ("different", "compared"))
    if done.mode == "realtime" and different:
        lines.append(
            f"recorded in realtime: {different} of {compared} messages ({100.0 * different / compared:.1f} %) differ: "
            f"{done.node} used the newest inputs, but the bag has only the order in which the recorder received them. "
            "Only a lockstep recording can be the same bit for bit"
        )
    return lines


def stated(topic: Compared) -> str:
    """A line about a topic, a second one about its first difference."""
    line = f"{topic.topic}: {topic.compared} messages"
    if topic.different:
        share = 100.0 * topic.different / topic.compared
        line += f", {topic.different} differ ({share:.1f} %)"
        line += f", at most by {topic.largest:.6g} {topic.unit}".rstrip() if topic.largest else ""
    else:
        line += ", the same bit for bit" if topic.compared else " both recorded and replayed"
    if topic.only_recorded or topic.only_replayed:
        line += f"; {topic.only_recorded} only recorded, {topic.only_replayed} only replayed"
    if topic.alone is not None:
        line += f"\n    first message that was only recorded: at {topic.alone / 1e9:.9f} s"
    if topic.first:
        stamp, field, recorded, replayed = topic.first
        line += f"\n    first difference at {stamp / 1e9:.9f} s: {field} {recorded!r} recorded, {replayed!r} replayed"
    return line
