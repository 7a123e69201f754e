"""Headers of messages: stamps in nanoseconds and frames."""

from typing import Any

from builtin_interfaces.msg import Time
from std_msgs.msg import Header


def header(stamp: int, frame: str = "") -> Header:
    """Header with a stamp in nanoseconds."""
    return Header(stamp=Time(sec=stamp // 1_000_000_000, nanosec=stamp % 1_000_000_000), frame_id=frame)


def stamp_of(message: Any) -> int:
    """Stamp of a message with a header, ns."""
    time = message.header.stamp
    return int(time.sec * 1_000_000_000 + time.nanosec)
