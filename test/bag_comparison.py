"""Two bags against each other, field by field: what 'the same run' means."""

import math
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from bag_samples import Sample, messages_of

from wam_bag.bag import read
from wam_bag.cdr import CDR, MessageType
from wam_bag.definitions import schema
from wam_bag.message_text import definitions
from wam_description.status import BEHIND, REAL_TIME_FACTOR, SLIPS
from wam_ros.health import WRITTEN


def compare(a: str | Path, b: str | Path, log_times: bool = False, without: tuple[str, ...] = ()) -> list[str]:
    """Differences of two bags, field by field and bit for bit; NaN equals NaN.

    Messages of a topic are compared in the order in which each publisher sent them; padding bytes
    do not count.  Topics of several publishers (status, diagnostics) are compared per node, without the facts
    that tell how fast time passed on the wall clock, or how many messages other processes took.

    Parameters
    ----------
    a, b : bag directories or .mcap files.
    log_times : whether log times must be equal too, as they are in lockstep bags.
    without : topics that are left out.

    Returns
    -------
    list
        a line for each topic that differs, with its first difference; empty where the bags are equal.
    """
    left, right = (_series(Path(path), without) for path in (a, b))
    differences = [f"{name}: only in {a}" for name in left if name not in right]
    differences += [f"{name}: only in {b}" for name in right if name not in left]
    for name in left:
        if name in right:
            difference = _first_difference(left[name], right[name], log_times)
            if difference:
                differences.append(f"{name}: {difference}")
    return differences


def _series(path: Path, without: tuple[str, ...]) -> dict[str, list[Sample]]:
    """Messages by topic, those of several publishers by topic and node."""
    found: dict[str, list[Sample]] = {topic: [] for topic in read(path, ()).types if topic not in without}
    for one in messages_of(path):
        if one.topic not in without:
            found.setdefault(one.topic + _node(one), []).append(one)
    return {name: _from_start(messages) if " from " in name else messages for name, messages in found.items()}


def _decoded(one: Sample) -> Any:
    return MessageType(one.type, CDR, definitions(one.type, schema(one.type))).decode(one.data)


def _from_start(messages: list[Sample]) -> list[Sample]:
    """Without what a node said before time began and said otherwise later: a recorder may come too late for it."""
    at_begin = sum(message.time == messages[0].time for message in messages)
    return messages[at_begin - 1 :]


def _node(one: Sample) -> str:
    if not one.type.startswith("diagnostic_msgs/msg/Diagnostic"):
        return ""
    decoded = _decoded(one)
    statuses = getattr(decoded, "status", [decoded])
    return f" from {statuses[0].name}" if statuses else ""


def _first_difference(left: list[Sample], right: list[Sample], log_times: bool) -> str:
    for number, (a, b) in enumerate(zip(left, right, strict=False)):
        if a.type != b.type:
            return f"type {a.type} and {b.type}"
        if log_times and a.time != b.time:
            return f"message {number}: log time {a.time} and {b.time} ns"
        if a.data != b.data:  # may still be equal: padding is not initialised
            difference = next(_fields(_decoded(a), _decoded(b), ""), "")
            if difference:
                return f"message {number}: {difference}"
    if len(left) != len(right):
        return f"{len(left)} and {len(right)} messages"
    return ""


def _fields(a: Any, b: Any, name: str) -> Iterator[str]:
    if isinstance(a, float) and isinstance(b, float):
        if struct.pack("d", a) != struct.pack("d", b) and not (math.isnan(a) and math.isnan(b)):
            yield f"{name} {a!r} and {b!r}"
    elif getattr(a, "key", "").startswith((BEHIND, REAL_TIME_FACTOR, SLIPS, WRITTEN)) and a.key == getattr(b, "key", 0):
        return
    elif hasattr(a, "_fields"):
        for field in a._fields:
            yield from _fields(getattr(a, field), getattr(b, field), f"{name}.{field}" if name else field)
    elif isinstance(a, list | np.ndarray):
        if len(a) != len(b):
            yield f"{name} has {len(a)} and {len(b)} elements"
        for i, (x, y) in enumerate(zip(_plain(a), _plain(b), strict=False)):
            yield from _fields(x, y, f"{name}[{i}]")
    elif a != b:
        yield f"{name} {a!r} and {b!r}"


def _plain(values: Any) -> list[Any]:
    return values.tolist() if isinstance(values, np.ndarray) else list(values)
