"""`wam bag`: record a running stack; the contents of a bag; repair of a broken one."""

import argparse
from datetime import UTC, datetime
from pathlib import Path

from wam_bag.bag import Bag, read
from wam_bag.bag_file import files
from wam_bag.losses import PARAMETERS, RECORDING, Losses
from wam_bag.repair import Repaired, repair
from wam_cli.options import configuration_of, recording_folder, take_configuration, take_stack
from wam_description.configuration import option_values
from wam_description.interface import Interface
from wam_description.parameters import values

RECORDER = "recorder"
OF_RECORDER = (
    "Time, nodes and arm are those of the running stack. --config and --set change only the parameters of the node "
    "recorder."
)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `wam bag` to its parser."""
    requests = parser.add_subparsers(dest="request", required=True, metavar="REQUEST")
    for name, text in (("info", "print what is in a bag"), ("repair", "repair a broken bag in its place")):
        requests.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.").add_argument(
            "bag", help="directory of the bag, or an .mcap file", type=Path
        )
    text = "record every topic of a running stack until Ctrl-C"
    record = requests.add_parser("record", help=text, description=text, epilog=OF_RECORDER)
    record.add_argument("--name", default="", help="name of the bag; default: name of the arm, date and time")
    take_stack(record)
    take_configuration(record)


def run(given: argparse.Namespace) -> int:
    """Record until Ctrl-C, print what is in a bag, or repair it."""
    if given.request == "record":
        _record(given)
    elif given.request == "info":
        print("\n".join(described(read(given.bag, ()))))
    else:
        print("\n".join(stated(result) for result in repair(given.bag)))
    return 0


def _record(given: argparse.Namespace) -> None:
    """Record until Ctrl-C."""
    for name in option_values(given.values):
        if not name.startswith(f"{RECORDER}:"):
            raise ValueError(
                f"--set {name} has no effect here: the running stack has its own; "
                f"set only parameters of the recorder, for example --set {RECORDER}:directory=bags"
            )
    configuration = configuration_of(given).with_values({f"{RECORDER}:name": given.name})
    recording_folder(configuration, given.name)
    from wam_ros.bring_up import run_together  # the other requests need no ROS
    from wam_ros.client import StackClient

    with StackClient(given.namespace) as stack:
        shared = stack.read_shared()
    nodes = [name for name in Interface(shared).names if name != RECORDER]
    print(f"the stack in /{given.namespace} runs in {shared.timing.mode}: {', '.join(nodes)}", flush=True)
    others = [entry for entry in shared.nodes if entry != RECORDER]  # this recorder is no part of the stack
    configuration = configuration.with_values({**values(shared), "nodes": others})
    if failure := run_together(configuration, [RECORDER], given.namespace):
        raise SystemExit(f"error: {failure}")


def described(found: Bag) -> list[str]:
    """Lines about a bag: files, time, what the recorder reports, topics."""
    seconds = (found.last - found.first) / 1e9
    lost = found.losses
    lines = [f"INCOMPLETE: {line}" for line in lost.sentences(found.first)]
    every = [one for file in files(found.path) for one in sorted(file.glob("*")) or [file]]  # it may be a directory
    lines += [f"{file}  {file.stat().st_size / 1e6:.1f} MB" for file in every]
    lines.append(f"from {_time(found.first)}, {seconds:.3f} s, {sum(found.counts.values())} messages")
    if RECORDING in found.metadata or PARAMETERS in found.attachments:
        lines.append(f"recorded in {found.mode} mode, lost: {_lost(found, lost)}")
    lines += [f"attachment {name}, {len(data)} bytes" for name, data in found.attachments.items()]
    width = max(map(len, found.types), default=0)
    for name, kind in found.types.items():
        count = found.counts[name]
        rate = f"{(count - 1) / seconds:9.1f} Hz" if count > 1 and seconds else " " * 12
        gone = f"  {lost.by_topic[name]} are gone" if name in lost.by_topic else ""
        lines.append(f"{name:{width}}  {count:8d} {rate}  {kind}{gone}")
    return lines


def _lost(found: Bag, lost: Losses) -> str:
    printed = [f"{count} of {where}" for where, count in lost.dropped.items()]
    printed += [f"{lost.gone} of those that were recorded"] if lost.gone else []
    if lost.uncounted:
        printed.append("unknown, see above")
    if not printed:
        repaired = ", though it had to be repaired" * bool(lost.repaired)
        printed.append("see above" if lost.sentences(found.first) else f"nothing{repaired}")
    return ", ".join(printed)


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
