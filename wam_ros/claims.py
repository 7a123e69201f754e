"""Claims: a topic that a node works on has one publisher; a second one is named."""

from collections import Counter

from rclpy.node import Node
from rclpy.subscription import Subscription

UNKNOWN = "_NODE_NAME_UNKNOWN_"  # of a publisher whose node the graph does not show yet
PROOF = 5  # messages out of order after which two publishers of one node name both count as alive


class Claims:
    """The publishers of the topics that a node takes.

    Two publishers of different nodes are rivals at once.  Two of one node name may be a node that was killed and
    its successor: ROS forgets the first one only after a while.  They are rivals where both send, so that
    messages come out of order.

    Parameters
    ----------
    node : that takes the topics.
    subscriptions : of these topics, by name.
    """

    def __init__(self, node: Node, subscriptions: dict[str, Subscription]) -> None:
        self._node, self._subscriptions = node, subscriptions
        self._names: dict[str, tuple[int, list[str]]] = {}
        self._strays: Counter[str] = Counter()

    def restart(self) -> None:
        """Forget what came out of order: another session of the driver has begun."""
        self._strays.clear()

    def stray(self, topic: str) -> None:
        """Count a message that does not go on from those before."""
        if self._subscriptions[topic].get_publisher_count() > 1:
            self._strays[topic] += 1

    def rivals(self, topic: str) -> str:
        """Which nodes publish a topic that one alone may publish, and what to do; '' where it is one."""
        count = self._subscriptions[topic].get_publisher_count()
        if count < 2:
            self._names.pop(topic, None)
            self._strays.pop(topic, None)
            return ""
        names = self._publishers(topic, count)
        if len(names) == 1 and self._strays[topic] < PROOF:
            return ""
        who = " and ".join(names) if len(names) > 1 else f"{count} nodes named {names[0]}"
        return f"{who} publish {topic}, which one node alone may; stop all others, then reset_fault"

    def _publishers(self, topic: str, count: int) -> list[str]:
        """Full names of the nodes that publish a topic, each once."""
        known = self._names.get(topic)
        if known is not None and known[0] == count:
            return known[1]
        found = self._node.get_publishers_info_by_topic(self._subscriptions[topic].topic_name)
        names = sorted({f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in found}) or [UNKNOWN]
        if len(found) == count and not any(UNKNOWN in name for name in names):
            self._names[topic] = (count, names)
        return [name if UNKNOWN not in name else "a node without a name" for name in names]
