"""`wam call`: one request to a running stack: a service, a parameter, a topic, a push."""

import argparse
import math
import re
import sys
from collections.abc import Mapping, Sequence
from itertools import islice
from typing import Any, Final

import yaml

from wam_cli.options import COUNT, bounded, namespace, take_stack
from wam_control.task.scenario import Push
from wam_description.arm import Shared
from wam_description.configuration import option_values
from wam_description.parameters import build_part, fields, meant
from wam_description.signals import Answer, Wrench
from wam_description.status import PAUSED
from wam_description.topics import BY_NAME
from wam_description.wiring import SetParameters
from wam_live.push import push
from wam_live.services import SERVICES
from wam_ros.client import StackClient
from wam_ros.limits import CALL_LIMITS
from wam_ros.messages import plain

KINDS: Final[dict[type, str]] = {float: "a number", int: "a whole number", bool: "true or false", str: "a text"}
EXAMPLE: Final = "force_loop:force_gain=0.01"
NEGATIVE: Final = re.compile(r"-(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$|-(inf|infinity|nan)$", re.IGNORECASE)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `wam call` to its parser."""
    where = argparse.ArgumentParser(add_help=False)
    where.add_argument(
        "--namespace", type=namespace, default=argparse.SUPPRESS, help="namespace of the arm; default: wam"
    )
    take_stack(parser)
    requests = parser.add_subparsers(dest="request", required=True, metavar="REQUEST")
    for name, (text, _) in SERVICES.items():
        requests.add_parser(name, parents=[where], help=text, description=f"{text[0].upper()}{text[1:]}.")
    found = requests.add_parser("get", parents=[where], help="print parameters of a node")
    found.add_argument("name", metavar="NODE[:PARAMETER]", help="force_loop, or force_loop:force_gain")
    found.add_argument("--all", action="store_true", help="also print the parameters that all nodes share")
    new = requests.add_parser("set", parents=[where], help="change a live parameter")
    new.add_argument("value", metavar="NODE:PARAMETER=VALUE", help=f"for example {EXAMPLE}")
    heard = requests.add_parser("echo", parents=[where], help="print messages of a topic")
    heard.add_argument("topic", help="as in docs/topics.md, for example force_measured")
    heard.add_argument("--count", type=COUNT, metavar="N", help="end after N messages; default: at Ctrl-C")
    heard.add_argument(
        "--timeout",
        type=bounded(float, unit="s"),
        metavar="S",
        help="end with exit code 1 if no message comes for S seconds; default: wait",
    )
    pushed = requests.add_parser("push", parents=[where], help="push the simulated arm, as by hand")
    pushed._negative_number_matcher = NEGATIVE  # that of argparse takes -1e1 and -inf for options, up to Python 3.13
    pushed.add_argument("cover", help="link that is pushed, for example outer_link")
    pushed.add_argument(
        "force",
        type=bounded(float, -math.inf, unit="N"),
        nargs=3,
        metavar="N",
        help="force: x, y and z in N, in the frame of the link",
    )
    pushed.add_argument("--at", type=float, metavar="M", help="position along the link in m; default: its middle")
    pushed.add_argument(
        "--seconds",
        type=bounded(float, unit="s"),
        default=1.0,
        help="duration of the push, in the arm's time; default: %(default)g",
    )


def run(given: argparse.Namespace) -> int:
    """Make the request and print its answer."""
    others = {"get": _get, "set": _set, "echo": _echo, "push": _push}
    failure = ""
    with StackClient(given.namespace) as stack:
        stack.connection.context.failure = lambda: failure
        try:
            if given.request in others:
                return others[given.request](given, stack)
            code = _stated(list(map(stack.request, SERVICES[given.request][1])))
            if code and given.request in ("disable", "estop"):
                print("The arm may still move: press its emergency stop button.", file=sys.stderr)
            return code
        except Exception as error:
            failure = str(error)
            raise


def _stated(replies: Sequence[Answer]) -> int:
    """Print the last answer, or the first refusal."""
    reply = next((reply for reply in replies if not reply.success), replies[-1])
    print(reply.message, file=sys.stdout if reply.success else sys.stderr)
    return 0 if reply.success else 1


def _get(given: argparse.Namespace, stack: StackClient) -> int:
    node, _, name = given.name.partition(":")
    values = stack.parameters(node)
    wanted = {key: value for key, value in values.items() if not name or key == name or key.startswith(f"{name}.")}
    if not wanted:
        raise ValueError(_unknown(node, name, values))
    if name:
        for key, value in sorted(wanted.items()):
            print(value if key == name else f"{node}:{key}={value}")
        return 0
    live = set(stack.live(node, values))
    shared = {field.name for field in fields(Shared)} - live
    own = values.keys() - live - shared
    hidden = 0 if given.all else len(shared & values.keys())
    for what, keys in (
        ("live, changed by wam call set", live),
        ("of this node, chosen at its start", own),
        ("of all nodes, chosen at the start", set() if hidden else shared & values.keys()),
    ):
        if keys:
            print(f"# {what}", *(f"{node}:{key}={values[key]}" for key in sorted(keys)), sep="\n")
    if hidden:
        print(f"# {hidden} more are shared by all nodes; to see them: wam call get {node} --all")
    return 0


def _set(given: argparse.Namespace, stack: StackClient) -> int:
    if ":" not in given.value.partition("=")[0]:
        raise ValueError(f"'{given.value}' has no node; write NODE:PARAMETER=VALUE, for example {EXAMPLE}")
    ((key, value),) = option_values([given.value], "wam call set").items()
    node, _, name = key.partition(":")
    values = stack.parameters(node)
    if name not in values:
        raise ValueError(_unknown(node, name, values))
    like = values[name]
    if hasattr(like, "__len__") and not isinstance(like, str):
        value = [value] * len(like) if not isinstance(value, list) else value
        new: Any = [_like(one, like[0], key) if len(like) else one for one in value]
    else:
        new = _like(value, like, key)
    reply = stack.request(SetParameters(node, {name: new}))
    if reply.success:
        reply = reply._replace(message="; ".join(filter(None, (f"{key}={value}", reply.message))))
    return _stated([reply])


def _like(value: Any, like: Any, name: str) -> Any:
    """A value of the kind that a parameter has; a whole number where that has none is one with a point."""
    if isinstance(like, float) and type(value) is int:
        return float(value)
    if type(value) is not type(like):
        raise ValueError(f"{name} is '{value}'; it must be {KINDS[type(like)]}")
    return value


def _unknown(node: str, name: str, values: Mapping[str, Any]) -> str:
    cure = meant(name, values).rstrip() or f"'wam call get {node}' lists them"
    return f"node '{node}' has no parameter '{name}'; {cure}"


def _echo(given: argparse.Namespace, stack: StackClient) -> int:
    """Print messages; report once that none comes and why, and end after a silence that is too long."""
    stack.follow_statuses()
    taken, is_reported = 0, False

    def check(silent: float) -> None:
        nonlocal is_reported
        of = f" of {given.count}" if given.count is not None else ""
        waits = f"waiting for message {taken + 1}{of} on {given.topic}"
        if given.timeout is not None and silent > given.timeout:
            silence = f"no message came on {given.topic} for {given.timeout:g} s (--timeout)"
            before = f"; {taken}{of} came before" * bool(taken)
            raise TimeoutError(f"{silence}{before}{_hint(given.topic, stack)}")
        if not is_reported and silent > CALL_LIMITS.silence:
            is_reported = True
            row = BY_NAME.get(given.topic)
            seldom = ", which is published when it changes" * bool(row and row.latched)
            ends = "Ctrl-C ends this" + "; --timeout S ends it after S seconds" * (given.timeout is None)
            print(f"{waits}{seldom}{_hint(given.topic, stack)}; {ends}", file=sys.stderr, flush=True)

    try:
        for message in islice(stack.messages(given.topic, check=check), given.count):
            taken, is_reported = taken + 1, False
            fields = plain(message, given.topic)
            print(yaml.safe_dump(fields, sort_keys=False, default_flow_style=None, width=math.inf), end="---\n")
            sys.stdout.flush()
    except TimeoutError as error:
        print(f"wam call: {error}", file=sys.stderr)
        return 1
    return 0


def _hint(topic: str, stack: StackClient) -> str:
    """Why no message of a topic may come, '' where that is not known."""
    if "driver" not in stack.statuses:
        return f"; no driver was found: {stack.advice}"
    if PAUSED in stack.statuses["driver"].facts:
        return "; the arm is paused, and continues after 'wam call resume'"
    return "" if stack.is_published(topic) else "; no node publishes it now"


def _push(given: argparse.Namespace, stack: StackClient) -> int:
    wrench, at, shared = _wrench(given, stack.parameters("driver"))
    seconds = push(stack, shared, wrench, given.seconds)
    print(f"pushed {given.cover} with {math.hypot(*wrench.force):g} N at {at:.2f} m for {seconds:.2f} s")
    return 0


def _wrench(given: argparse.Namespace, driver: Mapping[str, Any]) -> tuple[Wrench, float, Shared]:
    """What is to be sent, the contact position, m, and the shared parameters among those of the driver."""
    shared = build_part(Shared, driver)
    covers = shared.arm.covers
    if given.cover not in covers.names:
        raise ValueError(f"no link '{given.cover}'; this arm has {', '.join(covers.names)}")
    i = 3 * covers.names.index(given.cover)
    low, high = covers.start[i], covers.end[i]
    at = 0.5 * (low + high) if given.at is None else given.at
    if not low <= at <= high:
        raise ValueError(f"--at is {at:g} m; {given.cover} is from {low:g} to {high:g} m")
    x, y, z = given.force
    push = Push(given.cover, at, (x, y, z), 0.0, given.seconds)
    wrench = Wrench(given.cover, push.force, push.torque(covers))
    if excess := shared.push_excess(wrench.force, wrench.torque):
        raise ValueError(excess)
    return wrench, at, shared
