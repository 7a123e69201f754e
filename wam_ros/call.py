"""A running stack as a shell sees it, without the `ros2` command: requests, parameters, messages."""

import importlib
import math
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from functools import partial
from types import TracebackType
from typing import Any, Final, NamedTuple, Self

from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.srv import DescribeParameters
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from wam_description.arm import Shared
from wam_description.nodes import NODES
from wam_description.parameters import build_part
from wam_description.signals import NodeStatus
from wam_description.topics import BY_NAME, STATUS
from wam_description.wiring import Call, SetParameters
from wam_ros.limits import CALL_LIMITS
from wam_ros.messages import read_status
from wam_ros.remote_parameters import RemoteParameters
from wam_ros.requests import answer_of, refusal_of, service_request
from wam_ros.run import Connection
from wam_ros.topics import qos

MODE: Final = "timing.mode"  # a shared parameter, which every node of the stack has
START: Final = "start the stack with 'wam up'"


class Reply(NamedTuple):
    """The answer to a request."""

    success: bool
    message: str


class NoAnswerError(OSError):
    """A node, service or topic that is not there; the text states what to do."""


class CalledStack:
    """The nodes of one arm; leaving the context leaves the network.

    Parameters
    ----------
    namespace : of the arm.

    Attributes
    ----------
    node : that asks, in the namespace of the arm.
    """

    def __init__(self, namespace: str) -> None:
        self._connection = Connection()
        self.node = Node("wam_call", context=self._connection.context, namespace=namespace)
        self._connection.add(self.node)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: object, trace: TracebackType | None) -> None:
        self._connection.close()

    def request(self, request: Call | SetParameters) -> Reply:
        """Ask a node and wait for its answer."""
        service, kind, message = service_request(request)
        client = self.node.create_client(kind, service)
        name = self.node.resolve_service_name(service)
        if not client.wait_for_service(CALL_LIMITS.answer):
            there = self._nodes_without(request.node)
            advice = f"there are {', '.join(there)}" if there else START
            return Reply(False, f"no service {name} within {CALL_LIMITS.answer:g} s; {advice}")
        attempts = CALL_LIMITS.set_attempts if isinstance(request, SetParameters) else CALL_LIMITS.attempts
        wait = partial(self._connection.executor.spin_until_future_complete, timeout_sec=CALL_LIMITS.answer / attempts)
        answer = answer_of(client, message, attempts, wait)
        if answer is None:
            return Reply(False, f"no answer from {name} within {CALL_LIMITS.answer:g} s")
        refusal = refusal_of(request, answer)
        return Reply(not refusal, refusal or getattr(answer, "message", ""))

    def parameters(self, node: str) -> dict[str, Any]:
        """Every parameter of a node by its dotted name.

        Raises
        ------
        NoAnswerError
            where it does not answer, or there is no such node.
        """
        requested = RemoteParameters(self.node, [node])

        def is_answered() -> bool:
            requested.ask()
            return not requested.missing

        self._wait(is_answered, f"no node '{node}' answers", partial(self._nodes_without, node))
        return requested.found[node]

    def shared(self) -> Shared:
        """The shared parameters of the stack, as its driver has them; of another node next to a driver without them.

        Raises
        ------
        NoAnswerError
            where no node answers that has them.
        ParameterError
            where they are those of another version.
        """
        requested = RemoteParameters(self.node, NODES)
        first = math.inf

        def found() -> list[dict[str, Any]]:
            return [requested.found[name] for name in NODES if MODE in requested.found.get(name, {})]

        def is_answered() -> bool:
            nonlocal first
            requested.ask()
            if found():
                first = min(first, time.monotonic())
            return MODE in requested.found.get("driver", {}) or time.monotonic() - first > CALL_LIMITS.discovery

        self._wait(is_answered, f"no node of a stack in {self.node.get_namespace()} answers")
        return build_part(Shared, found()[0])

    def _nodes_without(self, node: str) -> list[str]:
        """The nodes of the stack, none where this one is among them."""
        own = self.node.get_namespace()
        found = {name for name, where in self.node.get_node_names_and_namespaces() if where == own}
        return [] if node in found else sorted(found - {self.node.get_name()})

    def live(self, node: str, names: Collection[str]) -> list[str]:
        """Those of the parameters of a node that a request may change while it runs.

        Raises
        ------
        NoAnswerError
            where it does not answer.
        """
        client = self.node.create_client(DescribeParameters, f"{node}/describe_parameters")
        wait = partial(
            self._connection.executor.spin_until_future_complete, timeout_sec=CALL_LIMITS.answer / CALL_LIMITS.attempts
        )
        question = DescribeParameters.Request(names=list(names))
        answer = (
            answer_of(client, question, CALL_LIMITS.attempts, wait)
            if client.wait_for_service(CALL_LIMITS.answer)
            else None
        )
        if answer is None:
            raise NoAnswerError(
                f"node '{node}' does not describe its parameters within {CALL_LIMITS.answer:g} s; {START}"
            )
        return [found.name for found in answer.descriptors if not found.read_only]

    def statuses(self) -> dict[str, NodeStatus]:
        """The newest status of each node by its name, as `heard_statuses`.

        Raises
        ------
        NoAnswerError
            where the driver sends none.
        """
        found = self.heard_statuses()
        self._wait(lambda: "driver" in found, "no status of the driver")
        return found

    def heard_statuses(self) -> dict[str, NodeStatus]:
        """The newest status of each node by its name, empty at first; kept up to date while messages are awaited."""
        found: dict[str, NodeStatus] = {}

        def take(message: DiagnosticStatus) -> None:
            status = read_status(message)
            found[status.node] = status

        profile = qos(BY_NAME[STATUS])
        profile.depth = CALL_LIMITS.waiting
        self.node.create_subscription(DiagnosticStatus, STATUS, take, profile)
        return found

    def messages(
        self, topic: str, silence: float = math.inf, check: Callable[[], object] = lambda: None
    ) -> Iterator[Any]:
        """Messages of a topic as they come, without end; a run is not delayed by it.

        Parameters
        ----------
        topic : name in the namespace of the arm, or a full one.
        silence : s, in which a message must come.
        check : called while none comes, and while there is no such topic; it may raise what is to end the waiting.

        Raises
        ------
        NoAnswerError
            where there is no such topic.
        TimeoutError
            where no message came for so long.
        """
        name, own = self.node.resolve_topic_name(topic), f"{self.node.get_namespace()}/"

        def kinds() -> list[str]:
            return dict(self.node.get_topic_names_and_types()).get(name, []) if self._is_of_others(name) else []

        def topics() -> list[str]:
            found = (name for name, _ in self.node.get_topic_names_and_types() if name.startswith(own))
            visible = (name for name in found if "/_" not in name)  # others are hidden
            return [name.removeprefix(own) for name in visible if self._is_of_others(name)]

        self._wait(kinds, f"no topic {name}", topics, check)
        package, _, kind = kinds()[0].split("/")
        row = BY_NAME.get(topic)
        profile = QoSProfile(depth=CALL_LIMITS.waiting, reliability=ReliabilityPolicy.BEST_EFFORT)
        if row is not None and row.latched:
            profile = qos(row)
            profile.depth = CALL_LIMITS.waiting  # many nodes may have one each
        elif row is None:
            profile.durability = DurabilityPolicy.VOLATILE
        taken: list[Any] = []
        subscription = self.node.create_subscription(
            getattr(importlib.import_module(f"{package}.msg"), kind), name, taken.append, profile
        )
        last = time.monotonic()
        try:
            while True:
                self._connection.executor.spin_once(timeout_sec=0.1)
                if taken:
                    yield from taken
                    taken.clear()
                    last = time.monotonic()
                elif time.monotonic() - last > silence:
                    raise TimeoutError(f"no {topic} for {silence:g} s")
                else:
                    check()
        finally:
            self.node.destroy_subscription(subscription)

    def is_published(self, topic: str) -> bool:
        """Whether a node publishes a topic, named as for `messages`, at present."""
        return self.node.count_publishers(topic) > 0

    def _is_of_others(self, topic: str) -> bool:
        """Whether a node has a topic other than one that calls, as this one, which subscribes to the status."""
        ends = (*self.node.get_publishers_info_by_topic(topic), *self.node.get_subscriptions_info_by_topic(topic))
        return any(end.node_name != self.node.get_name() for end in ends)

    def _wait(
        self,
        condition: Callable[[], Any],
        failure: str,
        others: Callable[[], Sequence[str]] = tuple,
        check: Callable[[], object] = lambda: None,
    ) -> None:
        """Wait for a condition, unless a check raises; not as long where others are there instead, and no more come."""
        begin = since = time.monotonic()
        there: Sequence[str] = ()
        while not condition():
            now, before, there = time.monotonic(), there, others()
            since = now if there != before else since
            if there and now - since > CALL_LIMITS.discovery:
                raise NoAnswerError(f"{failure}; there are {', '.join(there)}")
            if now - begin > CALL_LIMITS.answer:
                raise NoAnswerError(f"{failure} within {CALL_LIMITS.answer:g} s; {START}")
            check()
            self._connection.executor.spin_once(timeout_sec=0.05)
