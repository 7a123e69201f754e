"""What a node refuses to take: unusable messages, counted and reported, and a second publisher of a topic."""

import time
from collections import Counter

from rclpy.node import Node
from rclpy.subscription import Subscription

from wam_bag.printable import printable
from wam_description.event import Event, fault
from wam_ros.limits import NODE_LIMITS

UNKNOWN = "_NODE_NAME_UNKNOWN_"  # of a publisher whose node the graph does not show yet


class Claims:
    """The publishers of the topics that a node takes.

    Two publishers of different nodes are rivals at once.  Two of one node name may be a node that was killed and
    its successor: ROS forgets the first one only after a while.  They are rivals where both send, so that
    messages come out of order.

    Parameters
    ----------
    node : that takes the topics.

    Attributes
    ----------
    subscriptions : of these topics, by name.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self.subscriptions: dict[str, Subscription] = {}
        self._names: dict[str, tuple[int, list[str]]] = {}
        self._strays: Counter[str] = Counter()

    def restart(self) -> None:
        """Forget what came out of order: another session of the driver has begun."""
        self._strays.clear()

    def stray(self, topic: str) -> None:
        """Count a message that does not go on from those before."""
        if self.subscriptions[topic].get_publisher_count() > 1:
            self._strays[topic] += 1

    def rivals(self, topic: str) -> Event | None:
        """Which nodes publish a topic that one alone may publish; None where it is one."""
        count = self.subscriptions[topic].get_publisher_count()
        if count < 2:
            self._names.pop(topic, None)
            self._strays.pop(topic, None)
            return None
        names = self._publishers(topic, count)
        if len(names) == 1 and self._strays[topic] < NODE_LIMITS.strays:
            return None
        who = " and ".join(names) if len(names) > 1 else f"{count} nodes named {names[0]}"
        return fault("claimed", nodes=who, topic=topic)

    def _publishers(self, topic: str, count: int) -> list[str]:
        """Full names of the nodes that publish a topic, each once."""
        known = self._names.get(topic)
        if known is not None and known[0] == count:
            return known[1]
        found = self._node.get_publishers_info_by_topic(self.subscriptions[topic].topic_name)
        names = sorted({f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in found}) or [UNKNOWN]
        if len(found) == count and not any(UNKNOWN in name for name in names):
            self._names[topic] = (count, names)
        return [name if UNKNOWN not in name else "a node without a name" for name in names]


class Refusals:
    """The messages that a node has refused.

    Parameters
    ----------
    node : that refuses them, and has the log.

    Attributes
    ----------
    counts : by topic.
    unusable : why messages of a topic are refused, as the status has it.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self.counts: Counter[str] = Counter()
        self.unusable: dict[str, str] = {}
        self._since: dict[str, str] = {}  # the same, since the last report
        self._reported = 0
        self._by_kind: Counter[str] = Counter()
        self._logged: dict[str, tuple[float, int]] = {}  # by kind: when, and how many had been refused by then

    def add(self, topic: str, reason: str, kind: str = "") -> None:
        """Count a refused message; one a second of each kind, or of each topic without one, is logged."""
        self.counts[topic] += 1
        kind = kind or topic
        self._by_kind[kind] += 1
        now = time.monotonic()
        since, count = self._logged.get(kind, (-NODE_LIMITS.log_period, 0))
        if now - since >= NODE_LIMITS.log_period:
            others = self._by_kind[kind] - count - 1
            more = f" ({others} more were refused before)" if others else ""
            self._logged[kind] = now, self._by_kind[kind]
            self._node.get_logger().warning(f"{topic}: refused: {printable(reason, NODE_LIMITS.reason_length)}{more}")

    def show(self, topic: str, reason: str) -> bool:
        """Whether the status has to state now that messages of a topic are refused; it does up to a report without."""
        self._since[topic] = reason
        is_new = topic not in self.unusable
        if is_new:
            self.unusable[topic] = reason
        return is_new

    def look_again(self) -> bool:
        """Once a second: leave out what has not been refused since the last time; whether there was anything."""
        if not self.unusable:
            return False
        self.unusable, self._since = self._since, {}
        return True

    def have_grown(self) -> bool:
        """Whether messages were refused since the last call."""
        before, self._reported = self._reported, sum(self.counts.values())
        return self._reported > before
