"""`wam bag`: the contents of a bag; repair of a broken one."""

import argparse
from datetime import UTC, datetime
from pathlib import Path

from wam_bag.contents import Contents, contents
from wam_bag.losses import PARAMETERS, RECORDING, Losses, losses
from wam_bag.repair import Repaired, repair


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("what", choices=("info", "repair"))
    parser.add_argument("bag", help="directory of the bag, or an .mcap file", type=Path)


def run(given: argparse.Namespace) -> int:
    """Print what is in a bag, or repair it."""
    if given.what == "info":
        print("\n".join(described(contents(given.bag))))
    else:
        print("\n".join(stated(result) for result in repair(given.bag)))
    return 0


def described(found: Contents) -> list[str]:
    """Lines about a bag: files, time, what the recorder reports, topics."""
    seconds = (found.last - found.first) / 1e9
    count = sum(topic.messages for topic in found.topics.values())
    counts = {name: topic.messages for name, topic in found.topics.items()}
    lost = losses(found.path, found.metadata, found.attachments, counts)
    lines = [f"INCOMPLETE: {line}" for line in lost.sentences(found.first)]
    lines += [f"{file}  {file.stat().st_size / 1e6:.1f} MB" for file in found.files]
    lines.append(f"from {_time(found.first)}, {seconds:.3f} s, {count} messages")
    if RECORDING in found.metadata or PARAMETERS in found.attachments:
        lines.append(f"recorded in {found.mode} mode, lost: {_lost(found, lost)}")
    lines += [f"attachment {name}, {size} bytes" for name, size in found.attachments.items()]
    width = max(map(len, found.topics), default=0)
    for name, topic in found.topics.items():
        rate = f"{(topic.messages - 1) / seconds:9.1f} Hz" if topic.messages > 1 and seconds else " " * 12
        gone = f"  {lost.by_topic[name]} are gone" if name in lost.by_topic else ""
        lines.append(f"{name:{width}}  {topic.messages:8d} {rate}  {topic.type}{gone}")
    return lines


def _lost(found: Contents, lost: Losses) -> str:
    printed = [f"{count} of {where}" for where, count in lost.dropped.items()]
    printed += [f"{lost.gone} of those that were recorded"] if lost.gone else []
    if lost.uncounted:
        printed.append("unknown, see above")
    if printed:
        return ", ".join(printed)
    return (
        "see above"
        if lost.sentences(found.first)
        else f"nothing{', though it had to be repaired' if lost.repaired else ''}"
    )


def _time(stamp: int) -> str:
    if stamp < 10**18:  # not a time of day: lockstep, which begins at 0
        return f"{stamp / 1e9:.3f} s"
    return f"{datetime.fromtimestamp(stamp / 1e9, UTC):%Y-%m-%d %H:%M:%S} UTC"


def stated(result: Repaired) -> str:
    """What became of a file; where something was lost, a line about that."""
    if result.losses is None:
        return f"{result.name} is whole, {result.messages} messages"
    lost = Losses({result.name: result.losses}, {}, {}, False).sentences(result.first)
    return "\n".join([f"{result.name} was repaired: {result.messages} messages are in it", *lost])
