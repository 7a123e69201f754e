"""Copies of topics for a viewer: few a second, so that it does not slow down the run.

A run that is as fast as it can be sends ten thousand messages a second, and sending one to another process takes the
sender 10 us.  A viewer needs no more of them than it draws pictures.
"""

import time
from typing import Any, Final

from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

from wam_description.topics import Topic
from wam_ros.messages import message_type

PERIOD: Final = 1.0 / 30.0  # s of the wall clock, between copies
NEWEST: Final = QoSProfile(reliability=ReliabilityPolicy.BEST_EFFORT, history=HistoryPolicy.KEEP_LAST, depth=1)
COPIED: Final = frozenset(
    (
        "joint_states",
        "sim/joint_states",
        "sim/contact/wrench",
        "sim/contact/point",
        "sim/objects",
        "contact/hypotheses",
        "force_measured",
    )
)


def copy_name(topic: str) -> str:
    """Name of the copies of a topic, which `ros2 topic list` does not show."""
    return f"_display/{topic}"


class DisplayCopy:
    """Publishes some of the messages of a topic once more.

    Parameters
    ----------
    node : that publishes.
    row : of the topic.
    """

    def __init__(self, node: Node, row: Topic) -> None:
        self._publisher = node.create_publisher(message_type(row), copy_name(row.name), NEWEST)
        self._next = 0.0

    def send(self, message: Any) -> None:
        """Publish a message, or its bytes, where the last copy is old enough."""
        now = time.monotonic()
        if now >= self._next:
            self._next = now + PERIOD
            self._publisher.publish(message)
