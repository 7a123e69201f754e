"""The adapter that makes a ROS node from a declared one (`wam_description.wiring`)."""

import math
import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from wam_description.configuration import Configuration
from wam_description.event import Code, Event, Level, fault
from wam_description.event_text import news, sentence
from wam_description.interface import Feed, declared
from wam_description.signals import NodeStatus, mask
from wam_description.synchroniser import CURE, OutOfTime, Synchroniser
from wam_description.topics import STATUS
from wam_description.wiring import Declaration, Inputs, Outputs, needed_arrays
from wam_ros.connections import StackNode
from wam_ros.health import WAITING
from wam_ros.limits import NODE_LIMITS
from wam_ros.long_steps import STEPS
from wam_ros.messages import Refused
from wam_ros.requests import Request, RequestQueue
from wam_ros.ros_parameters import follow
from wam_ros.ros_topics import SECOND

UNDATED = f"without a stamp it counts as an answer to the newest state, however late it is; {CURE}"


class AdaptedNode(StackNode):
    """A declared node on topics: it converts messages, calls the node, publishes with the input's stamp.

    Parameters
    ----------
    declaration, ros : as for `StackNode`.

    Attributes
    ----------
    node : the declared node itself.
    """

    def __init__(self, declaration: Declaration, **ros: Any) -> None:
        super().__init__(declaration, **ros)
        shared = self.shared
        self.node = node = declaration.make(shared, self.own)
        self.is_first = getattr(node, "high_priority", False)
        self._declaration, self._checks = declaration, self.interface.checks(declaration)
        self._is_realtime = shared.timing.mode == "realtime"
        self._worked, self._began = 0, math.inf  # the last step: its stamp, ns, and begin, s on the steady clock
        self._pause = (0.0, -math.inf)  # s without a step, longer than inputs stay valid, and its end
        self._failing: set[Callable[[Inputs], Outputs]] = set()  # steps that raised when they were last tried
        self._since, self._is_enabled = 0, False
        self._requests = RequestQueue(self, self._take_refusal)
        if tune := getattr(node, "tune", None):
            follow(self, self.own, tune, lambda values: self.health.report_change(self._worked, values))
        self._synchronisers: set[Synchroniser] = set()
        for topic, feeds in self.interface.feeds(declaration, node).items():
            self._connect(topic, feeds)
        if self._is_realtime:
            STEPS.watch(declaration.name, self.health.report_long_step)
        for name in getattr(node, "services", ()):
            self.serve(name, getattr(node, name))

    @property
    def done(self) -> bool:
        """Whether the node has finished, with nothing left to publish."""
        return getattr(self.node, "done", False) and self._requests.is_idle

    @property
    def is_failing(self) -> bool:
        """Whether a step raised when it was last tried."""
        return bool(self._failing)

    @property
    def failure(self) -> str:
        """Why the node failed, '' where it did not."""
        return getattr(self.node, "failure", "")

    def destroy_node(self) -> None:
        """End only when the others have what was published."""
        STEPS.forget(self._declaration.name)
        super().destroy_node()

    def end(self) -> None:
        """Report at once that this node ends, so that an enabled arm is braked before its commands cease."""
        if self._is_enabled:
            self.health.set_problem("end", fault("ended", node=self.get_name()))

    # from a message to the step

    def _connect(self, topic: str, feeds: Sequence[Feed]) -> None:
        """Subscribe once; all reactions to a message work in the order of their declaration."""
        if not feeds:  # its publisher waits until all its listeners are there
            self.inlets.listen(topic, lambda data: None)
            return
        self._synchronisers.update(feed.synchroniser for feed in feeds)
        puts = [(feed, feed.synchroniser.inlets[topic], mask(feed.arrays) if feeds[1:] else None) for feed in feeds]
        # what the stack does not stream comes from, or follows from, a program of the user, whom the status informs
        is_dated = self.interface.is_streamed(topic)
        of_user = not is_dated or any(item.age == "command" for item in self._declaration.taken if item.topic == topic)

        def take(stamp: int, value: Any) -> None:
            for feed, put, masked in puts:
                strays = feed.synchroniser.strays
                try:
                    complete = put(stamp, masked(value) if masked else value)
                except OutOfTime as reason:
                    # on a loaded machine all topics of other nodes are, at once
                    raise Refused(str(reason), is_late=not of_user) from None
                for inputs in complete:
                    self._step(inputs, feed)
                if feed.synchroniser.strays != strays:
                    self.inlets.claims[topic].stray()
            if not (stamp or is_dated):
                self.health.refuse(topic, UNDATED, code=Code.UNSTAMPED)

        accepts = [partial(feed.synchroniser.accepts, topic) for feed in feeds]
        is_taken = accepts[0] if len(accepts) == 1 else lambda stamp: any(each(stamp) for each in accepts)
        self.inlets.feed(topic, take, needed_arrays([feed.arrays for feed in feeds]), is_taken)

    def _step(self, inputs: Inputs, feed: Feed) -> None:
        """Let the node work, and publish what it returns."""
        if self._is_realtime and self.peers.absent and getattr(self.node, "starts_with_all", False):
            return  # in lockstep the driver waits for all
        self.health.counts["steps"] += 1
        self._worked = inputs.stamp
        try:
            self._finish(inputs, self._timed(inputs, feed) if self._is_realtime else feed.work(inputs))
        except Exception:
            self._failing.add(feed.work)
            raise
        self._failing.discard(feed.work)
        if feed.essential and self._is_realtime:
            self._watch(feed)

    def _timed(self, inputs: Inputs, feed: Feed) -> Outputs:
        """What the node returns; a step that takes long, and a pause before it, are noted."""
        name, began = self._declaration.name, time.monotonic()
        if (pause := began - self._began) > self.shared.ages.feedback:
            self._pause = pause, began
        self._began = began
        STEPS.begin(name, began)
        try:
            return feed.work(inputs)
        finally:
            if STEPS.end(name, began):
                self.health.repeat()

    def _finish(self, inputs: Inputs, outputs: Outputs) -> None:
        """Make the requests of the step, then publish what it returned; report what it has refused."""
        requests: list[Request] = getattr(self.node, "requests", [])
        if requests or not self._requests.is_idle:
            self._requests.add([*requests], lambda: self._publish(inputs.stamp, outputs))
            requests.clear()
        else:
            self._publish(inputs.stamp, outputs)
        refusals: dict[str, str | Event] = getattr(self.node, "refusals", {})
        for topic, why in refusals.items():
            reason = why if isinstance(why, str) else sentence(why)
            self.health.refuse(topic, reason, stamp=inputs.stamp_of(topic))

    def _publish(self, stamp: int, outputs: Outputs) -> None:
        for topic, value in outputs.items():
            if topic == STATUS:
                self._set_status(stamp, value)
            elif topic not in self.outlets.written:
                self._declaration.require_declared(outputs)
            else:
                check = self._checks.get(topic)
                self.outlets.publish(topic, stamp, check(value) if check else value)
        self.health.report(stamp, getattr(self.node, "diagnostics", dict))

    def _set_status(self, stamp: int, status: NodeStatus) -> None:
        before = self.health.plain
        self.health.publish(status)
        if status.level is Level.ERROR:
            self.get_logger().error(status.message)
        elif status.level is Level.WARN:
            if before is WAITING or not status.subjects <= before.subjects:
                self.get_logger().warning(news(status, before.subjects))
        elif status.step:
            self.get_logger().info(f"{stamp / SECOND:6.2f} s  {status.step}")

    def _watch(self, feed: Feed) -> None:
        """Let an enabled driver brake where an input has stopped to come without which the node cannot control.

        What a node lacks just after it did not run itself is the consequence of that.
        """
        health, needed = self.health, feed.essential & getattr(self.node, "needs", feed.essential)
        ages = {topic: age for topic, age in feed.synchroniser.ages().items() if topic in needed}
        if max(ages.values(), default=0.0) <= 1.0:
            health.set_problem("inputs", None)
        elif self._is_enabled and "inputs" not in health.problems:
            lost, stopped, others = self.interface.silent(ages)  # a node may just have been late, on a busy machine
            topics = " and ".join(lost)
            problem = fault("stopped", nodes=", ".join(stopped), others=" and ".join(others), topics=topics)
            pause, ended = self._pause
            if step := self.peers.held_up({*stopped, self.get_name()}):
                problem = fault("long_step", step=step, topics=topics)
            elif self._began - ended < NODE_LIMITS.long_step_recent:
                cure, allowed = "end other programs if the computer is busy", self.shared.ages.feedback
                problem = fault("node_late", what="node", time=pause, allowed=allowed, cure=cure)
            health.set_problem("inputs", problem)

    # what the other nodes report, live parameters, requests

    def take_status(self, status: NodeStatus) -> None:
        """Follow the driver, and hand the node the status of a peer."""
        if status.node not in self.peers.names:
            return
        if status.node == "driver":
            self._follow(status)
        take_status = getattr(self.node, "take_status", None)
        if take_status and (outputs := take_status(status)):
            self._publish(status.stamp, outputs)
            if getattr(self.node, "done", False):  # nobody may be there to answer its requests
                self._requests.clear()

    def _follow(self, driver: NodeStatus) -> None:
        """Forget what came before the driver's session, and commands from before the brakes were switched."""
        self._is_enabled = driver.mode == "enabled"
        if driver.session and driver.session != self.health.session:
            for synchroniser in self._synchronisers:
                synchroniser.follow(driver.stamp)
            self.inlets.restart()
            awaited = {topic for one in self._synchronisers for topic in one.awaited(driver.stamp)}
            is_new = not self._worked and driver.stamp > self.shared.timing.period_ns  # it lacks what came before
            self.health.follow(driver.session, None if is_new else sorted(awaited))
        if driver.since != self._since:
            self._since = driver.since
            for synchroniser in self._synchronisers:
                synchroniser.discard_commands(driver.since)

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """As that of rclpy; the reason of a success states what applies where the node has lowered something."""
        result = super().set_parameters_atomically(parameter_list)
        if result.successful and (lowered := getattr(self.node, "lowered", "")):
            result.reason = f"lowered by the guard to be stable: {lowered}"
        return result

    def _take_refusal(self, refusal: str) -> None:
        """A request was refused."""
        self.get_logger().error(refusal)
        if refused := getattr(self.node, "refused", None):
            self._publish(0, refused(refusal))


def make_node(entry: str, **ros: Any) -> Node:
    """The ROS node of an entry of the parameter `nodes`.

    Parameters
    ----------
    entry : name in the table of nodes, or 'module:Class' of a node of your own.
    ros : what rclpy's Node takes.
    """
    declaration = declared(entry)
    if not declaration.ros_node:
        return AdaptedNode(declaration, **ros)
    node: Node = resolve_name(declaration.ros_node)(**ros)
    return node


def node_makers(entries: Iterable[str], **ros: Any) -> dict[str, Callable[..., Node]]:
    """What makes the node of each entry of the parameter `nodes`, by its name, as `wam_ros.run.run` takes it.

    Parameters
    ----------
    entries : of the parameter `nodes`.
    ros : what rclpy's Node takes, for all of them.

    Raises
    ------
    ParameterError
        where there is no such node.
    """
    return {declared(entry).name: partial(make_node, entry, **ros) for entry in entries}


@contextmanager
def parameter_file(configuration: Configuration) -> Iterator[Path]:
    """The values of a configuration as a file that ROS reads, as long as the context lasts.

    It is in memory, so that nothing is left of a process that is killed.
    """
    with os.fdopen(os.memfd_create("parameters"), "w", encoding="utf-8") as file:
        file.write(configuration.text)
        file.flush()
        yield Path(f"/proc/{os.getpid()}/fd/{file.fileno()}")
