"""Two bags against each other, field by field: what 'the same run' means."""

import array
import math
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from mcap.records import Channel, Message, Schema

from wam_analysis.bag_file import Decoders, Opened, channels, files


def compare(a: str | Path, b: str | Path, log_times: bool = False, without: tuple[str, ...] = ()) -> list[str]:
    """Differences of two bags, field by field and bit for bit; NaN equals NaN.

    Messages of a topic are compared in the order in which each publisher sent them; padding bytes
    do not count.  Topics of several publishers (status, diagnostics) are compared per node.

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
    decoders = Decoders()
    for name in left:
        if name in right:
            difference = _first_difference(left[name], right[name], log_times, decoders)
            if difference:
                differences.append(f"{name}: {difference}")
    return differences


class _Raw(NamedTuple):
    schema: Schema
    channel: Channel
    log_time: int
    sequence: int
    data: bytes


def _series(path: Path, without: tuple[str, ...]) -> dict[str, list[_Raw]]:
    series: dict[str, list[_Raw]] = {}
    decoders = Decoders()
    for file in files(path):
        with Opened(file) as reader:
            for channel in channels(reader, file):
                if channel.topic not in without:
                    series.setdefault(channel.topic, [])
            for schema, channel, message in reader.iter_messages(log_time_order=False):
                if schema is None or channel.topic in without:
                    continue
                key = channel.topic + _node(schema, channel, message, decoders)
                raw = _Raw(schema, channel, message.log_time, message.sequence, message.data)
                series.setdefault(key, []).append(raw)
    return series


def _node(schema: Schema, channel: Channel, message: Message, decoders: Decoders) -> str:
    if not schema.name.startswith("diagnostic_msgs/msg/Diagnostic"):
        return ""
    decoded = decoders(schema, channel, message.data)
    statuses = getattr(decoded, "status", [decoded])
    return f" from {statuses[0].name}" if statuses else ""


def _first_difference(left: list[_Raw], right: list[_Raw], log_times: bool, decoders: Decoders) -> str:
    for number, (a, b) in enumerate(zip(left, right, strict=False)):
        if a.schema.name != b.schema.name:
            return f"type {a.schema.name} and {b.schema.name}"
        if log_times and a.log_time != b.log_time:
            return f"message {number}: log time {a.log_time} and {b.log_time} ns"
        if a.data != b.data:  # may still be equal: padding is not initialised
            difference = next(
                _fields(decoders(a.schema, a.channel, a.data), decoders(b.schema, b.channel, b.data), ""), ""
            )
            if difference:
                return f"message {number}: {difference}"
    if len(left) != len(right):
        return f"{len(left)} and {len(right)} messages"
    return ""


def _fields(a: Any, b: Any, name: str) -> Iterator[str]:
    if isinstance(a, float) and isinstance(b, float):
        if struct.pack("d", a) != struct.pack("d", b) and not (math.isnan(a) and math.isnan(b)):
            yield f"{name} {a!r} and {b!r}"
    elif isinstance(a, (list, tuple, array.array)) and isinstance(b, (list, tuple, array.array)):
        if len(a) != len(b):
            yield f"{name} has {len(a)} and {len(b)} elements"
        for i, (x, y) in enumerate(zip(a, b, strict=False)):
            yield from _fields(x, y, f"{name}[{i}]")
    elif hasattr(a, "__slots__") or hasattr(a, "__dict__"):
        for field in getattr(a, "__slots__", None) or vars(a):
            yield from _fields(getattr(a, field), getattr(b, field), f"{name}.{field}" if name else field)
    elif a != b:
        yield f"{name} {a!r} and {b!r}"
