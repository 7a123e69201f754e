"""`wam bag`: what is in a bag, and broken ones made whole."""

import argparse
from datetime import UTC, datetime
from pathlib import Path

from wam_analysis.bag_file import Contents, contents
from wam_ros.bag_repair import Repaired, repair


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("what", choices=("info", "repair"))
    parser.add_argument("bag", help="directory of the bag, or an .mcap file", type=Path)


def run(given: argparse.Namespace) -> int:
    """Print what is in a bag, or repair it."""
    if given.what == "info":
        print("\n".join(described(contents(given.bag))))
    else:
        print("\n".join(told(result) for result in repair(given.bag)))
    return 0


def described(found: Contents) -> list[str]:
    """Lines about a bag: files, time, what the recorder says, topics."""
    seconds = (found.last - found.first) / 1e9
    count = sum(topic.messages for topic in found.topics.values())
    lines = [f"{file}  {file.stat().st_size / 1e6:.1f} MB" for file in found.files]
    lines.append(f"from {_time(found.first)}, {seconds:.3f} s, {count} messages")
    if found.recording:
        dropped = {key.removesuffix(" dropped"): int(value) for key, value in found.recording.items()
                   if key.endswith(" dropped")}  # fmt: skip
        lost = ", ".join(f"{value} of {key.replace(' ', ' from ')}" for key, value in dropped.items() if value)
        lines.append(f"recorded in {found.recording.get('mode', 'unknown')} mode, lost: {lost or 'nothing'}")
    lines += [f"attachment {name}, {size} bytes" for name, size in found.attachments.items()]
    width = max(map(len, found.topics), default=0)
    for name, topic in found.topics.items():
        rate = f"{(topic.messages - 1) / seconds:9.1f} Hz" if topic.messages > 1 and seconds else " " * 12
        lines.append(f"{name:{width}}  {topic.messages:8d} {rate}  {topic.type}")
    return lines


def _time(stamp: int) -> str:
    if stamp < 10**18:  # not a time of day: lockstep, which begins at 0
        return f"{stamp / 1e9:.3f} s"
    return f"{datetime.fromtimestamp(stamp / 1e9, UTC):%Y-%m-%d %H:%M:%S} UTC"


def told(result: Repaired) -> str:
    """A line about a file."""
    if result.was_whole:
        return f"{result.name} is whole, {result.messages} messages"
    return f"{result.name} was repaired: {result.messages} messages, {result.lost} bytes could not be read"
