"""The adapter that makes a ROS node from a declared one (`wam_description.wiring`)."""

import importlib
import re
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from itertools import pairwise, takewhile
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.timer import Timer
from std_srvs.srv import Trigger

from wam_description.agreement import live_facts
from wam_description.configuration import BASE, Configuration, packaged
from wam_description.event import RAISED, Event, Level, fault
from wam_description.event_text import sentence
from wam_description.interface import Feed, Interface, declared, is_packaged
from wam_description.parameters import ParameterError
from wam_description.signals import NodeStatus
from wam_description.synchroniser import Inputs, OutOfTime, Synchroniser
from wam_description.topics import STATUS
from wam_description.wiring import Call, Declaration, Followed, Outputs, SetParameters, mask, needed_arrays
from wam_ros.limits import NODE_LIMITS
from wam_ros.long_steps import STEPS
from wam_ros.messages import Refused
from wam_ros.network import take_place
from wam_ros.parameters import Follower, declare, follow_together
from wam_ros.ports import Ports, problem_of
from wam_ros.requests import refusal_of, service_request
from wam_ros.run import run
from wam_ros.tolerance import TolerantNode
from wam_ros.topics import SECOND

OUT_OF_TIME = "out of time"  # on a loaded machine all topics of other nodes are, at once


class AdaptedNode(TolerantNode):
    """A declared node on topics: it converts messages, calls the node, publishes with the input's stamp.

    Parameters
    ----------
    declaration : of the node.
    ros : context, namespace and so on, as rclpy's Node takes them.

    Attributes
    ----------
    node : the declared node itself.
    """

    def __init__(self, declaration: Declaration, **ros: Any) -> None:
        super().__init__(declaration.name, **ros)
        self._place = take_place(self, declaration.name)
        owned: str | None = getattr(declaration.node, "owns", None)
        shared, own = declare(self, declaration.parameter_class, f"{owned}." if owned else None)
        self.node = declaration.make(shared, own)
        self._worked = 0  # stamp of the last step, ns
        self._declaration, self._outputs = declaration, frozenset(declaration.outputs)
        self._is_realtime = shared.timing.mode == "realtime"
        live = [(own, tune, "")] if (tune := getattr(self.node, "tune", None)) else []
        if owned:
            live.append((getattr(shared, owned), self.node.retune, f"{owned}."))
        follow_together(self, live, self._report_live)
        followed: Followed | None = getattr(self.node, "follows", None)
        self._follower: Follower | None = None
        interface = Interface(shared, started_by_hand=declaration)
        self._checks = interface.checks(declaration)
        self._ports = ports = Ports(self, declaration, shared, interface)
        if owned:
            ports.live = live_facts(getattr(shared, owned), f"{owned}.")
        if followed:
            group = followed.group
            self._follower = follower = Follower(
                followed.node,
                group,
                getattr(shared, group),
                self.node.retune,
                lambda reason: ports.set_problem(f"parameters {group}", problem_of("parameters", reason)),
                self._report_change,
            )
            if followed.node in interface.declarations:  # it is not ready before it has those values
                ports.waits = lambda: not follower.has_heard
        self._waiting: deque[Callable[[], None]] = deque()  # what follows a request that is under way
        self._asking = False
        self._service_clients: dict[tuple[str, Any], Any] = {}  # by name and type
        self._refused: dict[str, int] = {}
        self._starts_with_all = getattr(self.node, "starts_with_all", False)
        # what the stack does not stream comes from, or follows from, a program of the user, who is notified
        self._commands = {
            item.topic for item in declaration.taken if item.age == "command" or not interface.is_streamed(item.topic)
        }
        self._interface, self._since, self._is_enabled = interface, 0, False
        self._synchronisers: set[Synchroniser] = set()
        self._failing: set[Callable[[Inputs], Outputs]] = set()  # steps that raised when they were last tried
        ports.watch_peers(self._take_status, followed.node if followed else "")
        for topic, feeds in interface.feeds(declaration, self.node).items():
            self._connect(topic, feeds)
        if self._is_realtime:
            STEPS.watch(declaration.name, ports.report_long_step)
        for name in getattr(self.node, "services", ()):
            self.create_service(Trigger, f"~/{name}", _answering(getattr(self.node, name)))

    @property
    def done(self) -> bool:
        """Whether the node has finished, with nothing left to publish."""
        return getattr(self.node, "done", False) and not self._asking and not self._waiting

    @property
    def is_failing(self) -> bool:
        """Whether a step raised when it was last tried."""
        return bool(self._failing)

    @property
    def failure(self) -> str:
        """Why the node failed, '' where it did not."""
        return getattr(self.node, "failure", "")

    def raise_priority(self) -> None:
        """Ask the system to prefer this process."""
        self._ports.raise_priority(getattr(self.node, "high_priority", False))

    def take_fault(self, reason: str) -> None:
        """Report what a callback raised."""
        self._ports.set_problem("exception", problem_of(RAISED, reason))

    def destroy_node(self) -> None:
        """End only when the others have what was published."""
        STEPS.forget(self._declaration.name)
        self._ports.wait_for_delivery()
        super().destroy_node()
        self._place.close()

    def _connect(self, topic: str, feeds: Sequence[Feed]) -> None:
        """Subscribe once; all reactions to a message work in the order of their declaration."""
        if not feeds:  # its publisher waits until all its listeners are there
            self._ports.listen(topic, lambda data: None, raw=True)
            return
        self._synchronisers.update(feed.synchroniser for feed in feeds)
        reactions = [(feed, mask(feed.arrays) if len(feeds) > 1 else None) for feed in feeds]

        def take(stamp: int, value: Any) -> None:
            for feed, masked in reactions:
                self._take(feed, topic, stamp, masked(value) if masked else value)

        def accepts(stamp: int) -> bool:
            return any(feed.synchroniser.accepts(topic, stamp) for feed in feeds)

        self._ports.feed(topic, take, needed_arrays([feed.arrays for feed in feeds]), accepts)

    def _take(self, feed: Feed, topic: str, stamp: int, value: Any) -> None:
        """Hand an input to a reaction; what does not fit the time is refused, or counted as a stray message."""
        synchroniser = feed.synchroniser
        strays = synchroniser.strays
        try:
            complete = synchroniser.put(topic, stamp, value)
        except OutOfTime as reason:
            raise Refused(str(reason), kind="" if topic in self._commands else OUT_OF_TIME) from None
        for inputs in complete:
            self._step(inputs, feed.work)
            if feed.essential and self._is_realtime:
                self._watch(synchroniser, feed.essential)
        if synchroniser.strays != strays:
            self._ports.claims.stray(topic)

    def _watch(self, synchroniser: Synchroniser, essential: frozenset[str]) -> None:
        """Let an enabled driver brake where an input has stopped to come without which the node cannot control."""
        needed = essential & getattr(self.node, "needs", essential)
        ages = {topic: age for topic, age in synchroniser.ages().items() if topic in needed}
        if not self._is_enabled or max(ages.values(), default=0.0) <= 1.0:
            self._ports.set_problem("inputs", None)
        elif (
            not (known := self._ports.problems.get("inputs"))
            or self._ports.counts["steps"] % NODE_LIMITS.loss_repeated == 0
        ):
            lost, stopped = self._interface.silent(ages)  # on a busy machine another node may just have been late
            topics = " and ".join(lost)
            problem = fault("stopped", nodes=", ".join(stopped), topics=topics)
            if step := self._ports.held_up(stopped):
                problem = fault("long_step", step=step, topics=topics)
            self._ports.set_problem("inputs", problem)
            if known:
                self._ports.repeat_status()

    def _take_status(self, status: NodeStatus) -> None:
        """Follow the driver: forget what came before its session, and commands from before the brakes were switched."""
        if status.node == "driver":
            self._is_enabled = status.mode == "enabled"
            if status.session and status.session != self._ports.session:
                for synchroniser in self._synchronisers:
                    synchroniser.follow(status.stamp)
                awaited = [one.awaited(status.stamp) for one in self._synchronisers]
                self._ports.follow(status.session, sorted({topic for topics in awaited for topic in topics}))
            if status.since != self._since:
                self._since = status.since
                for synchroniser in self._synchronisers:
                    synchroniser.discard_commands(status.since)
        if self._follower is not None:
            self._follower.hear(status)
        take_status = getattr(self.node, "take_status", None)
        if take_status and (outputs := take_status(status)):
            self._publish(status.stamp, outputs)
            if getattr(self.node, "done", False):  # nobody may be there to answer its requests
                self._waiting.clear()
                self._asking = False

    def end(self) -> None:
        """Report at once that this node ends, so that an enabled arm is braked before its commands cease."""
        if self._is_enabled:
            self._ports.set_problem("end", fault("ended", node=self.get_name()))

    def _step(self, inputs: Inputs, work: Callable[[Inputs], Outputs]) -> None:
        ports = self._ports
        if self._starts_with_all and self._is_realtime and ports.absent:
            return  # in lockstep the driver waits for all
        ports.counts["steps"] += 1
        try:
            self._work(inputs, work)
        except Exception:
            self._failing.add(work)
            raise
        self._failing.discard(work)

    def _work(self, inputs: Inputs, work: Callable[[Inputs], Outputs]) -> None:
        began = time.monotonic()
        self._worked = inputs.stamp
        STEPS.begin(self._declaration.name, began)
        try:
            outputs = work(inputs)
        finally:
            if STEPS.end(self._declaration.name, began):
                self._ports.repeat_status()
        if (taken := time.monotonic() - began) > NODE_LIMITS.slow_step:
            is_own = not is_packaged(self._declaration)
            self.get_logger().warning(
                f"node {self.get_name()}: a step took {taken:.1f} s; the other nodes wait for it, and an enabled arm "
                "brakes if they wait too long: "
                f"{'let its steps compute less' if is_own else 'the machine is busy, end what else runs on it'}",
                throttle_duration_sec=NODE_LIMITS.slow_step_reports,
            )
        self._report_refusals(inputs)
        requests: list[Call | SetParameters] = getattr(self.node, "requests", [])
        if requests or self._asking:
            self._waiting.extend([*map(self._making, requests), lambda: self._publish(inputs.stamp, outputs)])
            requests.clear()
            self._go_on()
        else:
            self._publish(inputs.stamp, outputs)

    def _publish(self, stamp: int, outputs: Outputs) -> None:
        for topic, value in outputs.items():
            if topic == STATUS:
                self._set_status(stamp, value)
            elif topic not in self._outputs:
                self._declaration.require_declared(outputs)
            else:
                check = self._checks.get(topic)
                self._ports.publish(topic, stamp, check(value) if check else value)
        if self._ports.report_due(stamp):
            if diagnostics := getattr(self.node, "diagnostics", None):
                self._ports.facts |= diagnostics()
            self._ports.report(stamp)

    def _set_status(self, stamp: int, status: NodeStatus) -> None:
        self._ports.set_status(status)
        if status.level is Level.ERROR:
            self.get_logger().error(status.message)
        elif status.level is Level.WARN:
            self.get_logger().warning(status.message)
        elif status.step:
            self.get_logger().info(f"{stamp / SECOND:6.2f} s  {status.step}")

    def _report_change(self, values: Mapping[str, Any]) -> None:
        self._ports.report_change(self._worked, values)

    def _report_live(self, values: Mapping[str, Any]) -> None:
        """Report live parameters that were set here; with them the node may accept what it follows."""
        self._report_change(values)
        if self._follower is not None:
            self._follower.settle()

    def _report_refusals(self, inputs: Inputs) -> None:
        """Report each refused message once."""
        refusals: dict[str, str | Event] = getattr(self.node, "refusals", {})
        for topic, why in refusals.items():
            stamp = inputs.stamp_of(topic)
            if self._refused.get(topic) != stamp:
                self._ports.refusals.add(topic, why if isinstance(why, str) else sentence(why))
            self._refused[topic] = stamp

    # requests to other nodes

    def _go_on(self) -> None:
        """Do what waits, up to the next request that has to be answered."""
        while self._waiting and not self._asking:
            self._waiting.popleft()()

    def _making(self, request: Call | SetParameters) -> Callable[[], None]:
        return lambda: self._make(request)

    def _make(self, request: Call | SetParameters) -> None:
        service, kind, message = service_request(request)
        client = self._service_clients.get((service, kind))
        if client is None:
            client = self._service_clients[service, kind] = self.create_client(kind, service)
        self._asking = True
        began, is_reported = time.monotonic(), False
        timer: Timer

        def ask_when_found() -> None:
            nonlocal is_reported
            if not is_reported and time.monotonic() - began > NODE_LIMITS.service_wait:
                is_reported = True
                self.get_logger().warning(
                    f"waiting for the service {client.srv_name}; start the node '{request.node}', or request another"
                )
            if client.service_is_ready():  # before, the request would be lost
                timer.cancel()
                self.destroy_timer(timer)
                client.call_async(message).add_done_callback(lambda future: self._answered(request, future.result()))

        timer = self.create_timer(0.005, ask_when_found, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _answered(self, request: Call | SetParameters, answer: Any) -> None:
        self._asking = False
        if refusal := refusal_of(request, answer):
            if isinstance(request, SetParameters):
                refusal = f"{request.node} refuses: {refusal}"
            self._waiting.clear()
            self.get_logger().error(refusal)
            if refused := getattr(self.node, "refused", None):
                self._publish(0, refused(refusal))
        self._go_on()


def _answering(method: Callable[[], Any]) -> Callable[[Any, Any], Any]:
    def serve(_: Any, response: Any) -> Any:
        response.success, response.message = method()
        return response

    return serve


def node_factory(entry: str) -> Callable[..., Node]:
    """What makes the ROS node of an entry of the parameter `nodes`, with all that it needs imported.

    Parameters
    ----------
    entry : name in the table of nodes, or 'module:Class' of a node of your own.
    """
    declaration = declared(entry)
    declaration.parameter_class  # noqa: B018 - imports it
    if not declaration.ros_node:
        return partial(AdaptedNode, declaration)
    module, _, name = declaration.ros_node.partition(":")
    node: Callable[..., Node] = getattr(importlib.import_module(module), name)
    return node


def make_node(entry: str, **ros: Any) -> Node:
    """The ROS node of an entry of the parameter `nodes`; `ros` is what rclpy's Node takes."""
    return node_factory(entry)(**ros)


def node_makers(entries: Iterable[str]) -> dict[str, Callable[..., Node]]:
    """What makes the node of each entry of the parameter `nodes`, by its name, as `wam_ros.run.run` takes it.

    Raises
    ------
    ParameterError
        where there is no such node.
    """
    return {declared(entry).name: partial(make_node, entry) for entry in entries}


def main() -> None:
    """Run the nodes that the name of this program, or its first arguments, name; for `wam_ros.program`."""
    entries = [Path(sys.argv[0]).name]
    if entries[0] in ("node", "program.py"):
        entries = list(takewhile(lambda word: not word.startswith("-"), sys.argv[1:]))
        if not entries:
            raise SystemExit("usage: python3 -m wam_ros.program NAME [NAME ...] [--ros-args ...]")
        del sys.argv[1 : len(entries) + 1]
    try:
        makers = node_makers(entries)
    except ParameterError as error:
        raise SystemExit(f"error: {error}") from None
    with ExitStack() as files:
        try:
            arguments = [named_file(given, before, files) for before, given in pairwise(["", *sys.argv])]
        except ParameterError as error:
            raise SystemExit(f"error: {error}") from None
        run(makers, arguments)


def named_file(given: str, before: str, files: ExitStack) -> str:
    """An argument of the command line; after --params-file a whole file for a configuration's name or an overlay."""
    if before != "--params-file":
        return given
    path = Path(given)
    if path.exists() or path.suffix in (".yaml", ".yml"):
        if not (
            path.is_file()
            and re.search(rf"^{BASE}\s*:", path.read_text(encoding="utf-8", errors="replace"), re.MULTILINE)
        ):
            return given  # what ROS can read, or complains about
    else:
        path = packaged(given)
    text = Configuration.load(path).text
    file = Path(files.enter_context(TemporaryDirectory(prefix="wam_stack_")), "parameters.yaml")
    file.write_text(text, encoding="utf-8")
    return str(file)
