"""What a node publishes: encoded, counted, and handed to the nodes of its process."""

import time
from collections.abc import Sequence
from typing import Any, NamedTuple

from rclpy.duration import Duration
from rclpy.publisher import Publisher

from wam_description.message_bus import QueuedBus
from wam_description.topics import BY_NAME, EVERY_NODE, Topic
from wam_ros.messages import message_type
from wam_ros.ros_topics import qos, topic_name, waiting
from wam_ros.run import end_of_delivery
from wam_ros.wire import encoder


class Sent(NamedTuple):
    """What listeners of the same process get: the value, and the same as bytes."""

    value: Any
    data: bytes


class Outlets:
    """Publishers of one node.

    Parameters
    ----------
    node : a `wam_ros.connections.StackNode`.
    rows : topics of the table that the node publishes as values.

    Attributes
    ----------
    bus : that carries messages within the process; None where there is none.
    written : messages so far for other processes, by topic: as many as the middleware numbers.
    full : full name of each topic.
    """

    def __init__(self, node: Any, rows: Sequence[Topic]) -> None:
        self._node = node
        self.bus: QueuedBus | None = getattr(node.context, "bus", None)
        every = [*rows, *(BY_NAME[name] for name in EVERY_NODE)]  # on these each node publishes messages
        self._publishers: dict[str, Publisher] = {
            row.name: node.create_publisher(message_type(row), topic_name(node, row), qos(row)) for row in every
        }
        self._encoders = {row.name: encoder(row, node.shared) for row in rows}
        handles = {row.name: self._publishers[row.name].handle for row in rows}
        self._write = {name: handle.publish_raw for name, handle in handles.items()}
        # a latched message waits for those that come later
        self._listeners = {row.name: handles[row.name].get_subscription_count for row in rows if not row.latched}
        self.written = dict.fromkeys(self._publishers, 0)
        self.full = {row.name: node.resolve_topic_name(topic_name(node, row)) for row in every}
        bus, most = self.bus, waiting(node.shared.timing)
        self._here = {row.name: bus.publisher(self.full[row.name], most) for row in rows} if bus else {}

    def publish(self, topic: str, stamp: int, value: Any) -> None:
        """Publish a value on a topic of the table, with the stamp of the state that caused it, ns."""
        data, listeners = self._encoders[topic](stamp, value), self._listeners.get(topic)
        # as rclcpp does: the middleware gets what somebody takes from it
        if listeners is None or listeners() > (self.bus.unserved[self.full[topic]] if self.bus else 0):
            self.written[topic] += 1
            self._write[topic](data)  # of rclpy, without asking which type each message has
        elif self.bus:
            for tape in self.bus.tapes:
                tape(self.full[topic], data)
        if here := self._here.get(topic):
            here(stamp, Sent(value, data))

    def send(self, topic: str, message: Any) -> None:
        """Publish a message on a topic of every node."""
        self.written[topic] += 1
        self._publishers[topic].publish(message)

    def is_taken(self, topic: str, within: float = 0.0) -> bool:
        """Whether all listeners have taken what was published on a topic, waiting for that so long, s."""
        return bool(self._publishers[topic].wait_for_all_acked(Duration(seconds=within)))

    def subscriptions(self) -> dict[str, int]:
        """How many listen to each topic."""
        return {topic: publisher.get_subscription_count() for topic, publisher in self._publishers.items()}

    def wait_for_delivery(self) -> None:
        """Wait until the recorder and all others have the last messages, to `wam_ros.run.end_of_delivery` at most.

        What a process leaves behind unacknowledged ends with it: on a loaded machine that was the last second of a bag.
        """
        end = end_of_delivery(self._node.context)
        late = [topic for topic in self._publishers if not self.is_taken(topic, max(0.0, end - time.monotonic()))]
        if late:
            self._node.get_logger().warning(
                f"ends before all listeners took the last messages of {', '.join(late)}: one is very slow, or gone"
            )
