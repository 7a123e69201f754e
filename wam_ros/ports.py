"""A node's connections, made from the interface table: typed, counted, and ready when all are matched."""

import importlib
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription

from wam_description.arm import Shared
from wam_description.signals import State
from wam_ros.lockstep import Gate
from wam_ros.messages import Refused, header, joint_state, stamp_of
from wam_ros.qos import DEPTH, qos
from wam_ros.topics import BY_NAME, TOPICS, Topic

READY, WAITING = "ready", "waiting for its peers"
CONNECTED = KeyValue(key="peers", value="connected")  # in the status of a node that has more to say than 'ready'
LOG_PERIOD, MOST_REASONS = 1.0, 20  # s, a reason is logged at most so often; reasons kept in mind
NEWEST = 2  # messages; one alone would be lost when the next comes just as it is taken
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class Ports:
    """Publishers and subscriptions of one node.

    Parameters
    ----------
    node : the node; its name is looked up in the interface table.
    shared : the shared configuration; `nodes` says which peers to expect.
    """

    def __init__(self, node: Node, shared: Shared) -> None:
        self.node, self.shared = node, shared
        self.counts: Counter[str] = Counter()
        self.refusals: Counter[str] = Counter()
        self.facts: dict[str, str] = {}
        self.faults: dict[str, str] = {}
        self._name = node.get_name()
        self._publishers: dict[str, Publisher] = {}
        self._subscriptions: dict[str, Subscription] = {}
        self._status = DiagnosticStatus(name=self._name, level=WARN, message=WAITING)
        self._next_report = 0
        self._absent: set[str] = set()
        self._logged: dict[tuple[str, str], float] = {}
        for topic in TOPICS:
            if self._name in topic.publisher:
                self._publishers[topic.name] = node.create_publisher(message_type(topic), topic.name, qos(topic))
        self._readiness = node.create_timer(0.02, self._look_for_peers, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def publish(self, topic: str, message: Any) -> None:
        """Publish a message on a topic of the table."""
        self._publishers[topic].publish(message)

    def publish_joints(self, topic: str, stamp: int, state: State) -> None:
        """Publish a JointState about the joints."""
        self._publishers[topic].publish(joint_state(stamp, self.shared.arm.joints.names, state))

    def publish_motors(self, topic: str, stamp: int, state: State) -> None:
        """Publish a JointState about the motors."""
        self._publishers[topic].publish(joint_state(stamp, self.shared.arm.motors.names, state))

    def streamed(self, *chain: str) -> bool:
        """Whether all nodes of a chain belong to this bring-up, so that what comes out can be waited for."""
        return set(chain) <= set(self.shared.nodes)

    def listen(self, topic: str, take: Callable[[Any], None]) -> None:
        """Subscribe; a message that `take` refuses is counted and reported, and the last good one stands."""

        def receive(message: Any) -> None:
            try:
                take(message)
            except Refused as reason:
                self.refuse(topic, str(reason))

        row = BY_NAME[topic]
        profile = qos(row)
        if row.latched:
            profile.depth = DEPTH  # it may have many publishers, each with a message of its own
        elif self.shared.timing.mode == "realtime":
            profile.depth = NEWEST  # who is late works on what is true now, not on what was
        self._subscriptions[topic] = self.node.create_subscription(message_type(row), topic, receive, profile)

    def publisher_count(self, topic: str) -> int:
        """How many publishers feed a topic that this node listens to."""
        return int(self._subscriptions[topic].get_publisher_count())

    def feed(
        self, gate: Gate, topic: str, read: Callable[[Any], Any], work: Callable[[int, dict[str, Any]], None]
    ) -> None:
        """Subscribe, put what comes into a gate, and work on each step that is complete."""

        def take(message: Any) -> None:
            for stamp, inputs in gate.put(topic, stamp_of(message), read(message)):
                self.counts["steps"] += 1
                work(stamp, inputs)

        self.listen(topic, take)

    def refuse(self, topic: str, reason: str) -> None:
        """Count and report a message that was not let in."""
        self.refusals[topic] += 1
        now = time.monotonic()
        if now - self._logged.get((topic, reason), -LOG_PERIOD) >= LOG_PERIOD:
            if len(self._logged) > MOST_REASONS:  # a reason may carry a number that never comes again
                self._logged.clear()
            self._logged[topic, reason] = now
            self.node.get_logger().warning(f"{topic}: refused: {reason}")

    def set_status(self, level: bytes, message: str, **details: str) -> None:
        """Publish the state of the node, latched; once the node is ready."""
        status = DiagnosticStatus(
            name=self._name,
            level=level,
            message=message,
            hardware_id=self.shared.arm.name,
            values=[KeyValue(key=key, value=value) for key, value in details.items()],
        )
        if status != self._status:
            self._status = status
            self._publishers["status"].publish(status)

    def watch_peers(self) -> None:
        """Listen to the status of the other nodes, for `absent` and `faults`."""
        self._absent = set(self.shared.nodes) - {self._name}
        self.listen("status", self._peer_said)

    @property
    def absent(self) -> list[str]:
        """Nodes of the bring-up that have not said that they are connected."""
        return sorted(self._absent)

    def _peer_said(self, status: DiagnosticStatus) -> None:
        if status.message == READY or CONNECTED in status.values:
            self._absent.discard(status.name)
        self.faults[status.name] = next((item.value for item in status.values if item.key == "fault"), "")

    @property
    def ready(self) -> bool:
        """Whether every expected peer is connected."""
        return self._readiness.is_canceled()

    def _look_for_peers(self) -> None:
        nodes = self.shared.nodes
        for name, subscription in self._subscriptions.items():
            if subscription.get_publisher_count() < sum(peer in nodes for peer in BY_NAME[name].publisher):
                return
        for name, publisher in self._publishers.items():
            expected = sum(peer in nodes for peer in BY_NAME[name].subscribers) + ("recorder" in nodes)
            if publisher.get_subscription_count() < expected:
                return
        self._readiness.cancel()
        if self._status.message == WAITING:
            self.set_status(OK, READY)

    def report_due(self, stamp: int) -> bool:
        """Whether the next report will be published."""
        return stamp >= self._next_report

    def report(self, stamp: int) -> None:
        """Publish the diagnostics once a second of the arm's time."""
        if not self.report_due(stamp):
            return
        self._next_report = stamp - stamp % 1_000_000_000 + 1_000_000_000
        refused = {f"refused on {topic}": str(count) for topic, count in sorted(self.refusals.items())}
        facts = {**{key: str(count) for key, count in sorted(self.counts.items())}, **refused, **self.facts}
        status = DiagnosticStatus(
            name=self._name,
            level=WARN if refused else OK,
            message=self._status.message,
            hardware_id=self.shared.arm.name,
            values=[KeyValue(key=key, value=value) for key, value in facts.items()],
        )
        self.publish("/diagnostics", DiagnosticArray(header=header(stamp), status=[status]))


def message_type(topic: Topic) -> Any:
    """Message class of a row of the interface table."""
    package, _, name = topic.type.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), name)
