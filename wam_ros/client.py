"""A running stack as a program next to it sees it: requests, parameters, statuses, topics."""

import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache, partial
from pkgutil import resolve_name
from typing import Any, Final

from rcl_interfaces.srv import DescribeParameters
from rclpy.node import NodeNameNonExistentError
from rclpy.qos import QoSProfile, ReliabilityPolicy

from wam_description.arm import Shared
from wam_description.interface import Interface
from wam_description.message_bus import Take
from wam_description.nodes import NODES
from wam_description.parameters import build_part
from wam_description.signals import Answer, NodeStatus
from wam_description.topics import BY_NAME, STATUS
from wam_description.wiring import Call, SetParameters
from wam_ros.limits import CALL_LIMITS
from wam_ros.messages import Refused, message_type
from wam_ros.process_signals import held_back
from wam_ros.remote_parameters import RemoteParameters
from wam_ros.requests import Request, answer_of, service_request
from wam_ros.ros_topics import NAMESPACE, listening, qos
from wam_ros.run import Closing, Connection
from wam_ros.tolerance import LeavingNode
from wam_ros.wire import decoder, encoder, stamp_in, status_of

MODE: Final = "timing.mode"  # a shared parameter, which every node of the stack has


class NoAnswerError(OSError):
    """A node, service or topic that is not there; the text states what to do."""


class StackClient(Closing):
    """Client of the nodes of one arm; leaving the context disconnects it.

    Parameters
    ----------
    namespace : of the arm.
    name : of the node that asks.
    connection : whose executor spins it, as a Connection or a Composition; None: one of its own.
    shared : shared parameters of the stack, for `listen` and `send`.

    Attributes
    ----------
    node : that asks, in the namespace of the arm.
    client : the client of a service by its type and name.
    publisher : the publisher of a topic of the table by its name.
    statuses : newest of each node by its name, after `follow_statuses` and while anything is awaited.
    """

    def __init__(
        self, namespace: str = NAMESPACE, name: str = "wam_call", connection: Any = None, shared: Shared | None = None
    ) -> None:
        self.connection = connection or Connection()
        self._is_own = connection is None
        self.node = self.connection.add(LeavingNode(name, context=self.connection.context, namespace=namespace))
        self.statuses: dict[str, NodeStatus] = {}
        self.shared: Any = shared
        self.topics = Interface(shared).topics if shared else BY_NAME
        self.client = cache(self.node.create_client)
        self.publisher = cache(
            lambda topic: self.node.create_publisher(message_type(self.topics[topic]), topic, qos(self.topics[topic]))
        )
        self._encoder = cache(lambda topic: encoder(self.topics[topic], self.shared))

    def close(self) -> None:
        """Leave the network, where the connection is its own."""
        if self._is_own:
            self.connection.close()

    # waiting

    def spin_once(self, seconds: float = 0.01) -> None:
        """Handle what comes first within this time."""
        with held_back():
            self.connection.executor.spin_once(timeout_sec=seconds)

    def wait(self, until: Callable[[], Any], seconds: float = CALL_LIMITS.answer) -> bool:
        """Spin until something is true; False where it is not within this time."""
        end = time.monotonic() + seconds
        while not (found := until()) and time.monotonic() < end:
            self.spin_once()
        return bool(found)

    # requests

    def service(self, request: Request) -> tuple[Any, Any]:
        """The client of a request, and the message that it sends."""
        service, kind, message = service_request(request)
        return self.client(kind, service), message

    def request(self, request: Call | SetParameters, seconds: float = CALL_LIMITS.answer) -> Answer:
        """Ask a node and wait for its answer, for this time."""
        client, message = self.service(request)
        name = self.node.resolve_service_name(client.srv_name)
        others = partial(self._others, request.node)
        try:
            self._require(client.service_is_ready, f"no service {name}", others, seconds=seconds)
        except NoAnswerError as error:
            return Answer(False, str(error))
        attempt = CALL_LIMITS.set_attempt if isinstance(request, SetParameters) else CALL_LIMITS.attempt
        if (answer := self.answer(client, message, seconds, attempt)) is None:
            return Answer(False, f"no answer from {name} within {seconds:g} s; its node is busy or has ended")
        return answer_of(request, answer)

    def answer(self, client: Any, message: Any, seconds: float, attempt: float = CALL_LIMITS.attempt) -> Any:
        """The answer of a service, None where there is none, or no service.

        An answer can be lost while the service still discovers who asks; asking twice does no harm.

        Parameters
        ----------
        client : of the service.
        message : the request.
        seconds : for the service, then for the answer.
        attempt : s, after which the request is sent again.
        """
        futures: list[Any] = []

        def found() -> list[Any]:  # an earlier one may be answered meanwhile
            return [future for future in futures if future.done()]

        if not self.wait(client.service_is_ready, seconds):
            return None
        for _ in range(max(1, round(seconds / attempt))):
            futures.append(client.call_async(message))
            if self.wait(found, attempt):
                return found()[0].result()
        return None

    # parameters

    def parameters(self, node: str) -> dict[str, Any]:
        """Every parameter of a node by its dotted name.

        Raises
        ------
        NoAnswerError
            where it does not answer, or there is no such node.
        """
        if not node.isidentifier():
            raise NoAnswerError(
                f"'{node}' is no name of a node; name a parameter with its node, as force_loop:force_gain"
            )
        requested = RemoteParameters(self.node, [node])
        self._require(requested.complete, f"no node '{node}' answers", lambda: self._nodes_without(node))
        return requested.found[node]

    def read_shared(self) -> Shared:
        """The shared parameters of the stack, as the first node has them that answers; all have the same.

        Raises
        ------
        NoAnswerError
            where no node answers that has them.
        ParameterError
            where they are those of another version.
        """
        requested = RemoteParameters(self.node, NODES)

        def found() -> list[dict[str, Any]]:
            requested.complete()
            return [values for values in requested.found.values() if MODE in values]

        self._require(found, f"no node of a stack in {self.node.get_namespace()} answers")
        return build_part(Shared, found()[0])

    def await_driver(self, until: Callable[[], bool], others: Iterable[str] = ()) -> Mapping[str, Mapping[str, Any]]:
        """Parameters by node of a driver that may start later, and of other nodes that are there.

        Parameters
        ----------
        until : ends the waiting; there are none then.
        others : names of these nodes.
        """
        requested = RemoteParameters(self.node, ["driver", *others])
        begin = time.monotonic()
        while not until():
            is_late = time.monotonic() - begin > CALL_LIMITS.discovery
            if requested.complete() or (is_late and "driver" in requested.found):
                return requested.found
            self.spin_once(0.05)
        return {}

    @property
    def advice(self) -> str:
        """Where there are arms, or how to start one."""
        arms = {where for name, where in self.node.get_node_names_and_namespaces() if name == "driver"}
        return f"there is an arm in {' and '.join(sorted(arms))}" if arms else "start the stack with 'wam up'"

    def _nodes_without(self, node: str) -> list[str]:
        """The nodes of the stack, none where this one is among them."""
        own = self.node.get_namespace()
        found = {name for name, where in self.node.get_node_names_and_namespaces() if where == own}
        return [] if node in found else sorted(found - {self.node.get_name()})

    def _others(self, node: str) -> list[str]:
        """The services of a node that are called without values or with a switch; the nodes where it is not there."""
        with suppress(NodeNameNonExistentError):
            found = self.node.get_service_names_and_types_by_node(node, self.node.get_namespace())
            return sorted(name for name, (kind, *_) in found if kind.startswith("std_srvs/"))
        return self._nodes_without(node)

    def live(self, node: str, names: Collection[str]) -> list[str]:
        """Those of the parameters of a node that a request may change while it runs.

        Raises
        ------
        NoAnswerError
            where it does not answer.
        """
        client = self.client(DescribeParameters, f"{node}/describe_parameters")
        answer = self.answer(client, DescribeParameters.Request(names=list(names)), CALL_LIMITS.answer)
        if answer is None:
            raise NoAnswerError(f"node '{node}' does not answer with its parameters; {self.advice}")
        return [found.name for found in answer.descriptors if not found.read_only]

    # statuses and topics

    def follow_statuses(self) -> None:
        """Take the statuses from now on; in lockstep the nodes wait until this program has them."""
        row = BY_NAME[STATUS]
        self.node.create_subscription(message_type(row), STATUS, self._hear, listening(row), raw=True)

    def _hear(self, data: bytes) -> None:
        try:
            status = status_of(data)
        except Refused:
            return
        self.statuses[status.node] = status
        self.take_status(status)

    def take_status(self, status: NodeStatus) -> None:
        """Called with each status that comes."""

    @property
    def mode(self) -> str:
        """Mode of the driver, as it reports it; '' before that."""
        return self.statuses["driver"].mode if "driver" in self.statuses else ""

    def require_driver(self) -> None:
        """Follow the statuses, and wait for that of the driver.

        Raises
        ------
        NoAnswerError
            where it sends none.
        """
        self.follow_statuses()
        self._require(lambda: "driver" in self.statuses, "no status of the driver")

    def listen(
        self,
        topic: str,
        take: Take,
        arrays: str = "",
        refuse: Callable[[str], None] = lambda reason: None,
    ) -> None:
        """Let `take` be called with stamp, ns, and value of each good message of a topic; `arrays` as for `decoder`.

        Of each other message, `refuse` is called with the reason.
        """
        row = self.topics[topic]
        decode = decoder(row, self.shared, arrays)

        def receive(data: bytes) -> None:
            try:
                take(stamp_in(data), decode(data))
            except Refused as reason:
                refuse(str(reason))

        self.node.create_subscription(message_type(row), topic, receive, listening(row), raw=True)

    def send(self, topic: str, stamp: int, value: Any) -> None:
        """Publish a value on a topic of the table, as the answer to a state, ns."""
        self.publisher(topic).publish(self._encoder(topic)(stamp, value))

    def messages(self, topic: str, check: Callable[[float], object] = lambda silent: None) -> Iterator[Any]:
        """Messages of a topic as they come, without end; a run is not delayed by it.

        Parameters
        ----------
        topic : name in the namespace of the arm, or a full one.
        check : called with the time without a message, s, also while there is no such topic; it may raise what is to
            end the waiting.

        Raises
        ------
        NoAnswerError
            where there is no such topic.
        """
        name, own = self.node.resolve_topic_name(topic), f"{self.node.get_namespace()}/"

        def kinds() -> list[str]:
            return dict(self.node.get_topic_names_and_types()).get(name, [])

        def topics() -> list[str]:
            found = (name for name, _ in self.node.get_topic_names_and_types() if name.startswith(own))
            # this program has one itself, others are hidden
            return [name.removeprefix(own) for name in found if self.is_published(name) and "/_" not in name]

        last = time.monotonic()
        self._require(kinds, f"no topic {name}", topics, lambda: check(time.monotonic() - last))
        kind = resolve_name(kinds()[0].replace("/", "."))
        row = BY_NAME.get(topic)
        newest = QoSProfile(depth=CALL_LIMITS.waiting, reliability=ReliabilityPolicy.BEST_EFFORT)
        profile = listening(row) if row is not None and row.latched else newest
        taken: list[Any] = []
        subscription = self.node.create_subscription(kind, name, taken.append, profile)
        try:
            while True:
                self.spin_once(0.1)
                if taken:
                    yield from taken
                    taken.clear()
                    last = time.monotonic()
                else:
                    check(time.monotonic() - last)
        finally:
            self.node.destroy_subscription(subscription)

    def is_published(self, topic: str) -> bool:
        """Whether a node publishes a topic, named as for `messages`, at present."""
        return self.node.count_publishers(topic) > 0

    def _require(
        self,
        condition: Callable[[], Any],
        failure: str,
        others: Callable[[], Sequence[str]] = tuple,
        check: Callable[[], object] = lambda: None,
        seconds: float | None = None,
    ) -> None:
        """Wait for a condition, unless a check raises; not as long where others are there instead, and no more come."""
        limit = CALL_LIMITS.answer if seconds is None else seconds
        begin = since = time.monotonic()
        there: Sequence[str] = ()
        while not condition():
            now, before, there = time.monotonic(), there, others()
            since = now if there != before else since
            if there and now - since > CALL_LIMITS.discovery:
                raise NoAnswerError(f"{failure}; there are {', '.join(there)}")
            if now - begin > limit:
                raise NoAnswerError(f"{failure} within {limit:g} s; {self.advice}")
            check()
            self.spin_once(0.05)
