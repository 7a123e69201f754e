"""A topic that the page publishes while somebody holds on, and never together with another program."""

from typing import Any, Final

from rclpy.duration import Duration
from rclpy.node import Node

from wam_description.arm import Shared
from wam_description.signals import Wrench
from wam_description.topics import BY_NAME
from wam_live.thresholds import LIVE
from wam_ros.messages import message_type
from wam_ros.ros_topics import qos
from wam_ros.wire import encoder

KEYS: Final = {"sim/disturbance": "push", "force_command": "force"}  # of a step of a scenario


class HeldTopic:
    """A publisher that exists only while it is used.

    The nodes take a topic from one program alone, and an enabled arm brakes where there are two.

    Parameters
    ----------
    node : that publishes.
    topic : row of the table.
    shared : shared parameters of the driver.
    """

    def __init__(self, node: Node, topic: str, shared: Shared) -> None:
        self._node, self._topic = node, topic
        self._is_taken = shared.is_simulated or not topic.startswith("sim/")
        self._encode = encoder(BY_NAME[topic], shared)
        self._publisher: Any = None

    @property
    def is_on(self) -> bool:
        """Whether there is a publisher."""
        return self._publisher is not None

    def send(self, stamp: int, value: Wrench) -> str:
        """Publish a value as the answer to a state, ns; returns why that is not possible, '' where it is."""
        if not self._is_taken:
            return (
                f"the driver of this arm does not take {self._topic}; a real arm is pushed by hand, that of a "
                "simulated bus cannot be pushed"
            )
        others = self._node.count_publishers(self._topic) - self.is_on
        if others > 0:
            self.end()
            key = KEYS[self._topic]
            return (
                f"another program publishes {self._topic}, and the arm takes it from one program alone; a scenario "
                f"publishes it from its start to its end: write the {key} into one of its steps (key {key}), or start "
                "the stack without a scenario: wam up"
            )
        if self._publisher is None:
            row = BY_NAME[self._topic]
            self._publisher = self._node.create_publisher(message_type(row), self._topic, qos(row))
        self._publisher.publish(self._encode(stamp, value))
        return ""

    def end(self) -> None:
        """Leave the topic to others, once what was sent has arrived."""
        if self._publisher is not None:
            self._publisher.wait_for_all_acked(Duration(seconds=LIVE.delivery))
            self._node.destroy_publisher(self._publisher)
            self._publisher = None
