"""The status of a node as key-value pairs and back: the one place that knows the keys."""

from collections.abc import Iterable

from wam_description.signals import Level, NodeStatus

REAL_TIME_FACTOR, BEHIND, SLIPS = "real-time factor", "behind [ms]", "slips"
WALL_CLOCK = frozenset({REAL_TIME_FACTOR, BEHIND, SLIPS})  # facts that differ between two equal runs in lockstep

_CONNECTED = ("waiting", "connected")


def pairs(status: NodeStatus) -> list[tuple[str, str]]:
    """The fields of a status that are not empty, then its facts, as (key, value)."""
    own = {"peers": _CONNECTED[status.connected], "mode": status.mode, "fault": status.fault, "step": status.step}
    found = [(key, value) for key, value in own.items() if value]
    numbers = {"session": status.session, "since": status.since, "stamp": status.stamp}
    found += [(key, str(value)) for key, value in numbers.items() if value]
    return [*found, *status.facts.items()]


def parse(node: str, level: int, message: str, given: Iterable[tuple[str, str]]) -> NodeStatus:
    """The status that these pairs describe; unknown keys become facts, an unknown level the highest."""
    facts = dict(given)
    session, since, stamp = (_number(facts.pop(key, "")) for key in ("session", "since", "stamp"))
    return NodeStatus(
        level=Level(level) if level in Level._value2member_map_ else Level.ERROR,
        message=message,
        node=node,
        connected=facts.pop("peers", "") == _CONNECTED[True],
        mode=facts.pop("mode", ""),
        fault=facts.pop("fault", ""),
        step=facts.pop("step", ""),
        session=session,
        since=since,
        stamp=stamp,
        facts=facts,
    )


def _number(text: str) -> int:
    """A number that is not negative, 0 for any other text."""
    return int(text) if text.isascii() and text.isdigit() and len(text) < 20 else 0
