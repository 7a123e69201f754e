"""What a node takes: subscriptions, each decoded and from one publisher; a message that is refused is reported."""

from collections import Counter
from collections.abc import Callable
from typing import Any

from rclpy.qos import QoSCompatibility, qos_check_compatible
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

from wam_description.event import Event, fault
from wam_description.event_text import sentence
from wam_description.message_bus import Take
from wam_ros.limits import NODE_LIMITS
from wam_ros.messages import Refused, message_type
from wam_ros.ros_topics import listening, topic_name, waiting
from wam_ros.tolerance import TolerantNode
from wam_ros.wire import decoder, requirement, stamp_in

UNKNOWN = "_NODE_NAME_UNKNOWN_"  # of a publisher whose node the graph does not show yet
UNNAMED = "a node whose name is not known yet"


def full_name(info: TopicEndpointInfo) -> str:
    """Of the node of a publisher."""
    return UNNAMED if info.node_name == UNKNOWN else f"{info.node_namespace.rstrip('/')}/{info.node_name}"


class PublisherClaim:
    """The publishers of one topic that a node takes.

    Two publishers of different nodes are rivals at once.  Two of one node name may be a node that was killed and
    its successor: ROS forgets the first one only after a while.  They are rivals where both send, so that
    messages come out of order.

    Parameters
    ----------
    node : that takes the topic.
    topic : name in the table of topics.
    subscription : of the topic.

    Attributes
    ----------
    strays : messages that did not go on from those before, while there were two publishers.
    """

    def __init__(self, node: TolerantNode, topic: str, subscription: Subscription) -> None:
        self._node, self._topic, self._subscription = node, topic, subscription
        self._named: tuple[int, list[str]] = (0, [])  # publishers, and names of their nodes
        self.strays = 0

    @property
    def count(self) -> int:
        """Publishers of the topic."""
        return int(self._subscription.get_publisher_count())

    def stray(self) -> None:
        """Count a message that does not go on from those before."""
        self.strays += self.count > 1

    def rivals(self) -> Event | None:
        """Which nodes publish the topic, which one alone may publish; None where it is one."""
        count = self.count
        if count < 2:
            self._named, self.strays = (0, []), 0
            return None
        names = self._names(count)
        if len(names) == 1 and self.strays < NODE_LIMITS.strays:
            return None
        who = " and ".join(names) if len(names) > 1 else f"{count} nodes named {names[0]}"
        return fault("claimed", nodes=who, topic=self._topic)

    def unheard(self) -> str:
        """Which node publishes with a quality of service by which nothing comes, and why; '' where none does."""
        name = self._subscription.topic_name
        if self._node.count_publishers(name) > self.count:  # also for a moment, of a new one
            for info in self._node.get_publishers_info_by_topic(name):
                verdict, reason = qos_check_compatible(info.qos_profile, self._subscription.qos_profile)
                if verdict == QoSCompatibility.ERROR:
                    why = reason.removeprefix("ERROR: ").strip("; ")
                    return f"nothing of {full_name(info)} comes: {why}; publish it with the QoS of docs/topics.md"
        return ""

    def _names(self, count: int) -> list[str]:
        """Full names of the nodes that publish the topic, each once."""
        if self._named[0] == count:
            return self._named[1]
        found = self._node.get_publishers_info_by_topic(self._subscription.topic_name)
        names = sorted(set(map(full_name, found))) or [UNNAMED]
        if len(found) == count and UNNAMED not in names:
            self._named = count, names
        return names


class Inlets:
    """Subscriptions of one node.

    Parameters
    ----------
    node : a `wam_ros.connections.StackNode`, whose health reports what is refused.

    Attributes
    ----------
    subscriptions : by topic.
    claims : who publishes each topic that is fed, by topic.
    """

    def __init__(self, node: Any) -> None:
        self._node = node
        self.subscriptions: dict[str, Subscription] = {}
        self.claims: dict[str, PublisherClaim] = {}
        self._unserved = Counter[str]()
        node.create_timer(NODE_LIMITS.claim_period, self._look_at_all)

    def feed(
        self,
        topic: str,
        take: Take,
        arrays: str = "",
        accepts: Callable[[int], bool] = lambda stamp: True,
    ) -> None:
        """Subscribe to values.

        Parameters
        ----------
        topic : name in the table of topics.
        take : called with the stamp, ns, and the value; it may raise Refused.
        arrays : of a JointState, the arrays that must be filled; one with a '?' may be empty.
        accepts : whether a message of a stamp is of interest; others are not decoded.
        """
        node, health = self._node, self._node.health
        row = node.interface.topics[topic]
        decode, require_usable = decoder(row, node.shared, arrays), requirement(row, node.shared, arrays)

        def receive(stamp: int, given: Any, value_of: Callable[[Any], Any]) -> None:
            try:
                # what a second publisher sends does not come by the bus
                if (topic in health.problems or (not is_local and claim.count > 1)) and (rivals := self._look(topic)):
                    raise Refused(sentence(rivals))
                if accepts(stamp):
                    take(stamp, value_of(given))
            except Refused as reason:
                health.refuse(topic, str(reason), reason.is_late)

        is_local = self.listen(
            topic,
            lambda data: receive(stamp_in(data), data, decode),
            lambda stamp, sent: receive(stamp, sent.value, require_usable),
        )
        self.claims[topic] = claim = PublisherClaim(node, topic, self.subscriptions[topic])

    def listen(self, topic: str, receive: Callable[[bytes], None], take: Take = lambda stamp, sent: None) -> bool:
        """Subscribe to the bytes of messages, or to the values that only nodes of this process publish.

        To fetch bytes from the middleware, once for each listener, took most of the time of several nodes in one
        process.  The subscription stays, unserved: the graph shows it, and it reveals a second publisher.

        Parameters
        ----------
        topic : name in the table of topics.
        receive : called with them, where they come from the middleware.
        take : called with the stamp, ns, and the message, where it comes without it.

        Returns
        -------
        whether messages come without the middleware.
        """
        node, bus = self._node, self._node.outlets.bus
        row = node.interface.topics[topic]
        profile, name = listening(row), topic_name(node, row)
        if not row.latched:
            profile.depth = waiting(node.shared.timing)
        is_local = bus is not None and not row.latched and node.context.carries(node.interface.publishers(topic))
        if is_local:
            bus.listen(node.resolve_topic_name(name), node.bearing(take, f"a message on {topic}"))
            profile.depth = 1
        elif bus:
            receive = bus.answered(receive)
        subscription = node.create_subscription(message_type(row), name, receive, profile, raw=True)
        if is_local:
            self.leave_unserved(subscription)
        self.subscriptions[topic] = subscription
        return is_local

    def leave_unserved(self, subscription: Subscription) -> None:
        """Let no executor fetch the messages of a subscription, and what this process publishes not go there alone."""
        self._node.leave_unserved(subscription)
        if bus := self._node.outlets.bus:
            self._unserved[subscription.topic_name] += 1
            bus.unserved[subscription.topic_name] += 1

    def close(self) -> None:
        """The subscriptions are about to end."""
        if bus := self._node.outlets.bus:
            bus.unserved -= self._unserved

    def _look(self, topic: str) -> Event | None:
        rivals = self.claims[topic].rivals()
        self._node.health.set_problem(topic, rivals)
        return rivals

    def _look_at_all(self) -> None:
        for topic, claim in self.claims.items():
            self._look(topic)
            if why := claim.unheard():
                self._node.health.refuse(topic, why)

    def restart(self) -> None:
        """Forget what came out of order: another session of the driver has begun."""
        for claim in self.claims.values():
            claim.strays = 0
