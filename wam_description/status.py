"""The status of a node as key-value pairs and back: the one place that knows the keys."""

import json
from collections.abc import Iterable, Mapping
from typing import Any

from wam_description.event import Code, Event, Level, Value, refused
from wam_description.signals import NodeStatus

REAL_TIME_FACTOR, BEHIND, SLIPS = "real-time factor", "behind [ms]", "slips"
AWAITED = "waits for"  # fact: topics that a node lacks for its next step, separated by blanks
BUSY = "busy"  # fact: a step that takes long, in words
HELD_UP = "held up"  # fact: the nodes of its process, separated by blanks
PAUSED = "time"  # fact of the driver while the arm's time is stopped: "paused"
CHANGES = "parameter changes"  # fact: that the status has the live parameters that were taken after a step
ENABLED = "enabled"  # mode of the driver in which no brake holds
REFUSED = str(Code.REFUSED)  # fact: topics whose present message a node does not take, separated by ', '
EVENT = "event"  # beginning of the keys of an event: event.1, event.1.severity, event.1.values of its own

_CONNECTED = ("waiting", "connected")
_TEXTS, _NUMBERS = ("mode", "fault", "step"), ("session", "since", "stamp")  # fields


def pairs(status: NodeStatus) -> list[tuple[str, str]]:
    """The fields of a status that are not empty, then its facts, as (key, value) in text."""
    found = [("peers", _CONNECTED[status.connected])]
    found += [(key, str(value)) for key in (*_TEXTS, *_NUMBERS) if (value := getattr(status, key))]
    found += [(key, str(value)) for key, value in status.facts.items()]
    for number, event in enumerate(status.events, start=1):
        found += [(f"{EVENT}.{number}", event.code), (f"{EVENT}.{number}.severity", event.severity.name)]
        found += [(f"{EVENT}.{number}.{name}", json.dumps(value)) for name, value in event.values.items()]
    return found


def _events(facts: dict[str, str]) -> tuple[Event, ...]:
    """Take the events out of the pairs of a status, those of codes that are known."""
    found: list[Event] = []
    number = 1
    while (code := facts.pop(f"{EVENT}.{number}", None)) is not None:
        start = f"{EVENT}.{number}."
        own = {key.removeprefix(start): facts.pop(key) for key in [*facts] if key.startswith(start)}
        severity = own.pop("severity", "")
        if code in Code._value2member_map_ and severity in Level.__members__:
            found.append(Event(Code(code), Level[severity], {name: _value(text) for name, text in own.items()}))
        number += 1
    return tuple(found)


def _value(text: str) -> Value:
    """A value of an event; what is neither a number nor a name in JSON stays as it is written."""
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        return text
    return value if isinstance(value, str | float | int) else text


def with_refused(status: NodeStatus, refusals: Mapping[str, str], code: Code = Code.REFUSED) -> NodeStatus:
    """A status with what is wrong with messages before the node has them: why, by topic; none leaves it as it is.

    Parameters
    ----------
    code : REFUSED, or that of messages that the node has nevertheless; a fact of this name lists the topics.
    """
    if not refusals:
        return status
    reasons = "; ".join(dict.fromkeys(refusals.values()))
    message = reasons if status.level is Level.OK else f"{status.message}; {reasons}"
    before = [topic for topic in status.facts.get(code, "").split(", ") if topic]
    facts = {**status.facts, str(code): ", ".join(dict.fromkeys([*before, *refusals]))}
    events = (*status.events, *(refused(topic, reason, code) for topic, reason in refusals.items()))
    return status._replace(level=max(status.level, Level.WARN), message=message, facts=facts, events=events)


def diagnosed_name(namespace: str, node: str) -> str:
    """The name of a node in /diagnostics, which the nodes of all arms share: 'wam: driver'."""
    return f"{namespace.strip('/')}: {node}"


def guidance(
    mode: str,
    before: str,
    wait: str,
    namespace: str,
    is_played: bool,
    held: str,
) -> str:
    """What the console shows of the driver's state, and what to call next.

    Parameters
    ----------
    mode, before : the driver's state, and that before it, '' at the start.
    wait : what a braked driver waits for, '' for nothing.
    namespace : of the arm.
    is_played : whether a scenario makes the calls.
    held : what holds an arm that is not enabled.
    """
    if mode == "braked" and wait:
        return f"braked; {wait}"
    if mode == ENABLED:
        return "enabled: the motors follow the commands"
    if is_played or (mode == "braked" and before == ENABLED):
        return f"{mode}: {held}"
    if mode == "braked":
        call = _call(namespace, "enable", "SetBool '{data: true}'")
        return f"braked, all nodes are connected; to enable the arm: {call}"
    return f"fault, {held}; when its cause is gone: {_call(namespace, 'reset_fault', 'Trigger')}, then enable"


def _call(namespace: str, service: str, request: str) -> str:
    name = namespace.strip("/")
    where = "" if name == "wam" else f" --namespace {name}"
    return f"wam call {service}{where} (or: ros2 service call /{name}/driver/{service} std_srvs/srv/{request})"


def parse(node: str, level: int, message: str, given: Iterable[tuple[str, str]]) -> NodeStatus:
    """The status that these pairs describe; unknown keys become facts, an unknown level the highest."""
    facts = dict(given)
    events = _events(facts)
    own: dict[str, Any] = {key: facts.pop(key, "") for key in _TEXTS}
    own |= {key: _number(facts.pop(key, "")) for key in _NUMBERS}
    return NodeStatus(
        level=Level(level) if level in Level._value2member_map_ else Level.ERROR,
        message=message,
        node=node,
        connected=facts.pop("peers", "") == _CONNECTED[True],
        facts=facts,
        events=events,
        **own,
    )


def _number(text: str) -> int:
    """A number that is not negative, 0 for any other text."""
    return int(text) if text.isascii() and text.isdigit() and len(text) < 20 else 0
