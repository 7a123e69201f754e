"""What every node of the stack is on ROS: a place, parameters, inlets, outlets, health, and the other nodes."""

from collections.abc import Callable, Collection, Iterable
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from wam_description.event import RAISED, Event
from wam_description.interface import Interface
from wam_description.signals import Answer, NodeStatus
from wam_description.status import BUSY, HELD_UP
from wam_description.topics import STATUS
from wam_description.wiring import Declaration
from wam_ros.health import Health, problem_of
from wam_ros.inlets import Inlets
from wam_ros.limits import PROCESS_LIMITS
from wam_ros.long_steps import STEPS
from wam_ros.messages import Refused
from wam_ros.network import Place
from wam_ros.outlets import Outlets
from wam_ros.priority import OWN, PRIORITY
from wam_ros.ros_parameters import declare, refusal
from wam_ros.tolerance import TolerantNode
from wam_ros.wire import status_of


class Peers:
    """The other nodes of a bring-up, as their statuses report them.

    Parameters
    ----------
    names : of these nodes.

    Attributes
    ----------
    statuses : newest of each that has reported.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self._absent = set(names)
        self.names = frozenset(self._absent)
        self.statuses: dict[str, NodeStatus] = {}

    @property
    def absent(self) -> list[str]:
        """Nodes that have not reported that they are connected."""
        return sorted(self._absent)

    def hear(self, status: NodeStatus) -> None:
        """Take the status of one of them."""
        self.statuses[status.node] = status
        if status.connected:
            self._absent.discard(status.node)

    @property
    def faults(self) -> str:
        """Present faults in words, '' for none."""
        return "; ".join(f"{node}: {status.fault}" for node, status in sorted(self.statuses.items()) if status.fault)

    def held_up(self, nodes: Collection[str]) -> str:
        """The long step of another node, or of one of this process, that holds up these nodes, '' for none."""
        for facts in (status.facts for status in self.statuses.values() if BUSY in status.facts):
            if not set(nodes).isdisjoint(facts.get(HELD_UP, "").split()):
                return facts[BUSY]
        step = STEPS.recent()
        return str(step) if step and not STEPS.nodes.isdisjoint(nodes) else ""


class StackNode(TolerantNode):
    """A node on topics; `AdaptedNode` or a driver defines what it does with them.

    Parameters
    ----------
    declaration : of the node.
    ros : context, namespace and so on, as rclpy's Node takes them.

    Attributes
    ----------
    shared, own : parameters.
    interface : of the bring-up; names which peers to expect.
    is_first : whether it works in each inner period, and is to be ahead of the other nodes.
    is_alone : whether no other node of its name may run in its namespace.
    """

    is_first = False
    is_alone = True

    def __init__(self, declaration: Declaration, **ros: Any) -> None:
        super().__init__(declaration.name, **ros)
        self.shared, self.own = declare(self, declaration.parameter_class)
        if self.is_alone:
            self.place = Place(self.context.get_domain_id(), self.get_namespace(), declaration.name)
        self.interface = Interface(self.shared, started_by_hand=declaration)
        topics = self.interface.topics
        rows = [topics[topic] for topic in declaration.outputs if topic in topics]
        self.outlets = Outlets(self, rows)
        self.health = Health(self)
        self.inlets = Inlets(self)
        self.peers = Peers(set(self.interface.names) - {declaration.name})
        self.inlets.listen(STATUS, self._hear)
        self._readiness = self.create_timer(0.02, self._look_for_peers)

    def raise_priority(self) -> None:
        """In realtime: ask the system to prefer this process, and report what was granted."""
        timing = self.shared.timing
        if timing.mode == "realtime":
            OWN.ask(max(timing.fifo_priority - (not self.is_first), 0), timing.niceness)
            self.health.facts[PRIORITY] = OWN.granted
            if self.is_first:
                self.get_logger().info(f"{PRIORITY}: {OWN.granted}")
            self.create_timer(PROCESS_LIMITS.share_look, self._look_at_share)

    def _look_at_share(self) -> None:
        if OWN.look():
            self.get_logger().warning(
                f"this process needs more than {PROCESS_LIMITS.share:.0%} of a processor and gave its realtime "
                "priority back, so that other programs can run; use lockstep, a faster computer or fewer nodes"
            )
        self.health.facts[PRIORITY] = OWN.granted

    def take_status(self, status: NodeStatus) -> None:
        """Take the status of another node of the stack."""

    def take_problem(self, problem: Event | None) -> None:
        """A problem of this node is new, or one is over where it is None: let the driver see it."""
        self.health.publish_again()

    def take_fault(self, reason: str) -> None:
        """Report what a callback raised."""
        self.health.set_problem("exception", problem_of(RAISED, reason))

    def announce(self) -> None:
        """A service has answered, which may change the status."""

    def serve(self, name: str, answer: Callable[..., Answer], kind: Any = Trigger) -> None:
        """Offer a service; the answer to a SetBool takes its value."""

        def served(request: Any, response: Any) -> Any:
            response.success, response.message = answer() if kind is Trigger else answer(request.data)
            self.announce()
            return response

        self.create_service(kind, f"~/{name}", served)

    def is_waiting(self) -> bool:
        """Whether the node waits for something else than its peers before it is ready."""
        return False

    def _hear(self, data: bytes) -> None:
        try:
            status = status_of(data)
        except Refused as reason:
            self.health.refuse(STATUS, str(reason))
            return
        if status.node in self.peers.names:
            self.peers.hear(status)
        if status.node != self.get_name():
            self.take_status(status)

    def _look_for_peers(self) -> None:
        publishers, subscribers = self.interface.publishers, self.interface.subscribers
        found = self.inlets.subscriptions.items()
        is_lacking = any(one.get_publisher_count() < len(publishers(name)) for name, one in found) or any(
            count < len(subscribers(name)) for name, count in self.outlets.subscriptions().items()
        )
        if not is_lacking and not self.is_waiting():
            self._readiness.cancel()
            self.health.is_ready = True
            self.report_ready()

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """As that of rclpy; what is not allowed is named, with what is."""
        if reason := refusal(self, self.own, parameter_list):
            return SetParametersResult(successful=False, reason=reason)
        return super().set_parameters_atomically(parameter_list)

    def report_ready(self) -> None:
        """All peers are connected."""
        self.health.publish_again()

    def destroy_node(self) -> None:
        """End only when the others have what was published."""
        self.health.report_end()
        self.outlets.wait_for_delivery()
        self.inlets.close()
        super().destroy_node()
