"""Node `recorder`: writes every topic of the interface table to a bag, with the parameters of all nodes."""

import time
from collections.abc import Mapping
from operator import itemgetter
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray

from wam_bag.bag_name import dated
from wam_bag.bag_writer import BagWriter, RecordingError, Split
from wam_description.agreement import OF_ONE_PROCESS
from wam_description.event import RAISED, Level
from wam_description.interface import declared
from wam_description.parameters import ParameterError, values
from wam_description.signals import NodeStatus
from wam_description.topics import DEPTH, STATUS, Topic
from wam_description.yaml_text import parameter_text
from wam_ros.connections import StackNode
from wam_ros.health import ENDED, NODE, WRITTEN, problem_of
from wam_ros.limits import RECORDER_LIMITS
from wam_ros.messages import Refused, message_type, read_status
from wam_ros.recorder import Recorder
from wam_ros.recorder_interface import EVERY, RecorderInterface
from wam_ros.remote_parameters import RemoteParameters
from wam_ros.ros_topics import DIAGNOSTICS, listening, topic_name
from wam_ros.wire import deserialized

RECORDER = RecorderInterface.name


class RecorderNode(StackNode):
    """Records from construction to `destroy_node`, which closes the bag."""

    is_alone = False

    def __init__(self, **ros: Any) -> None:
        super().__init__(declared(RECORDER), **ros)
        shared, own, interface = self.shared, self.own, self.interface
        self.health.digests = ""  # no arm brakes for how it is recorded
        name = own.name or dated(shared.arm.name)
        try:
            self.bag = BagWriter(Path(own.directory) / name, Split(own.split_size, own.split_time))
        except RecordingError as error:
            raise ParameterError(f"node '{RECORDER}': {error} (parameters 'directory' and 'name')") from None
        topics = {self.resolve_topic_name(topic_name(self, topic)): topic for topic in interface.topics.values()}
        chosen = {name: topic for name, topic in topics.items() if {topic.name, EVERY} & set(own.topics)}
        self._ends_last = RECORDER in interface.names  # one that was started by hand may end before the others
        mode, namespace = shared.timing.mode, self.get_namespace()
        self.recorder = Recorder(self.bag, chosen, mode, self._writers, namespace, not self._ends_last)
        # it subscribes to all topics, recorded or not: every publisher waits for its subscription;
        # those without a stamp are drained first: what a node sent before them is there by then and gives the time
        stampless_first = sorted(topics.items(), key=lambda item: not item[1].latched)
        self._drained = {name: self._listen(name, topic) for name, topic in stampless_first}
        self._arrived: list[tuple[int, str, bytes, int, int]] = []  # sent, topic, message, received, number
        self._tapes = self.outlets.bus.tapes if self.outlets.bus else []
        self._tapes.append(self._keep)
        self._unfinished = set(self.peers.names) if self._ends_last else set()  # nodes without a final count
        self.stack = RecordedStack(self)
        self._attached = ""
        self.create_timer(RECORDER_LIMITS.drain_period, self._drain)
        self.create_timer(0.1, self.attend)
        if shared.timing.mode == "realtime":  # in lockstep nothing is published by the wall clock
            self.create_timer(1.0, lambda: self.health.report(time.monotonic_ns(), self._facts))
        self.get_logger().info(f"recording to {self.bag.path}")

    def destroy_node(self) -> None:
        """Record the messages that have arrived, write parameters and counts, close the bag."""
        self._drain()
        end = time.monotonic() + RECORDER_LIMITS.announced
        while self.recorder.total("lost_at_end") and time.monotonic() < end:  # it may still be on the way
            time.sleep(0.02)
            self._drain()
        self._tapes.remove(self._keep)
        self.inlets.close()
        self._attach_parameters()
        unfinished = sorted(self._unfinished)
        self.recorder.finish(unfinished)
        counts = self.recorder.summary(unfinished)
        if self.recorder.failure:
            lost = f"{self.recorder.lost_at_disk} of the received messages are not in the bag"
            self.get_logger().error(f"{self.recorder.failure}; {lost}; received: {counts} on the way")
        elif self.recorder.total("lost_at_end") or unfinished:
            self.get_logger().warning(f"{self.bag.path}: {counts}")
        else:
            self.get_logger().info(f"{self.bag.path}: {counts}")
        super(StackNode, self).destroy_node()  # nobody waits for its last report

    @property
    def failure(self) -> str:
        """Why the bag is incomplete or has wrong times, '' if neither."""
        failure = self.recorder.failure or self.stack.failure
        if failure or self._ends_last or any(count.publisher != RECORDER for count in self.recorder.counts()):
            return failure
        return f"{self.bag.path} is empty: no message came; start the stack with 'wam up' before the recorder"

    def raise_priority(self) -> None:
        """It has time."""

    def is_waiting(self) -> bool:
        """Whether it lacks the parameters of a node, or cannot write."""
        return bool(self.recorder.failure or self.stack.parameters.missing)

    def report_ready(self) -> None:
        """All nodes are there: attach their parameters now, so that a killed recorder leaves them."""
        self._attach_parameters()
        super().report_ready()

    def _listen(self, name: str, topic: Topic) -> Any:
        """Subscribe to what `_drain` fetches."""
        found = self.inlets.subscriptions
        if topic.name not in found:
            found[topic.name] = self.create_subscription(
                message_type(topic), name, lambda data: None, listening(topic), raw=True
            )
        self.inlets.leave_unserved(found[topic.name])
        return found[topic.name]

    def _keep(self, name: str, data: bytes) -> None:
        """Take what a node of this process has published and not written to the middleware."""
        now = time.time_ns()
        self._arrived.append((now, name, data, now, 0))

    def _take_totals(self, data: bytes) -> None:
        """Take what the nodes report about the messages that they have written."""
        try:
            message = deserialized(data, DiagnosticArray, DIAGNOSTICS)
        except Refused:
            return
        for facts in (read_status(status).facts for status in message.status[: RECORDER_LIMITS.statuses]):
            namespace, _, node = facts.get(NODE, "").rpartition("/")
            if node not in self.peers.names or namespace != self.get_namespace().rstrip("/"):
                continue  # a node of another arm
            for key, value in facts.items():
                topic = key.removeprefix(WRITTEN)
                if topic != key and value.isdecimal() and len(value) < RECORDER_LIMITS.count_length:
                    self.recorder.announce(node, topic, int(value))
            if ENDED in facts:
                self._unfinished.discard(node)
            elif self._ends_last:
                self._unfinished.add(node)

    def _writers(self, name: str) -> dict[str, str]:
        """The present publishers of a topic: the node of each, with its namespace if it has another, by identity."""
        own = self.get_namespace().rstrip("/") + "/"
        return {
            bytes(info.endpoint_gid).hex(): f"{info.node_namespace.rstrip('/')}/{info.node_name}".removeprefix(own)
            for info in self.get_publishers_info_by_topic(name)
        }

    def attend(self) -> None:
        """Ten times a second: flush, warn, request parameters."""
        self.recorder.flush()
        self.stack.attend(self._writers(STATUS))
        if failure := self.recorder.failure:
            if self.own.required:
                self.health.set_problem("bag", problem_of(RAISED, failure))
            else:
                self.get_logger().error(failure, once=True)
                self.health.publish(NodeStatus(Level.ERROR, failure))
        if self.recorder.total("dropped"):
            self.get_logger().warning(
                "the recorder is too slow and loses messages; it counts them when it ends", once=True
            )

    def _facts(self) -> dict[str, str]:
        recorder = self.recorder
        totals = {name: str(recorder.total(name)) for name in ("received", "dropped")}
        return {"bag": str(self.bag.path), **totals, "lost_at_disk": str(recorder.lost_at_disk)}

    def _drain(self) -> None:
        """Record what has arrived, in the order in which it was sent: the time of a message may be that before it."""
        arrived, self._arrived = self._arrived, []
        for name, subscription in self._drained.items():
            handle = subscription.handle
            with handle:
                for _ in range(DEPTH):
                    taken = handle.take_message(subscription.msg_type, True)
                    if taken is None:
                        break
                    data, info = taken
                    received = info["received_timestamp"] or time.time_ns()
                    number = info["publication_sequence_number"] or 0
                    arrived.append((info["source_timestamp"], name, data, received, number))
        arrived.sort(key=itemgetter(0))
        for sent, name, data, received, number in arrived:
            self.recorder.receive(name, data, received, sent, number)
            if name == self.outlets.full[DIAGNOSTICS]:
                self._take_totals(data)

    def _attach_parameters(self) -> None:
        """Attach the known parameters, if these are more than were attached before."""
        found = self.stack.parameters.found
        parameters = {self.resolve_service_name(node): given for node, given in found.items()}
        parameters[self.get_fully_qualified_name()] = {**values(self.shared), **values(self.own)}
        text = parameter_text(parameters)
        if text != self._attached and self.recorder.attach("parameters.yaml", "application/yaml", text.encode()):
            self._attached = text


class RecordedStack:
    """The nodes that a recorder records: their parameters, and whether one differs or was started again.

    A bag has one run.

    Parameters
    ----------
    recorder : which asks.

    Attributes
    ----------
    failure : how a node runs otherwise than the recorder takes it to, or that there are two runs; '' where neither.
    parameters : of the nodes.
    restarted : nodes that were started again and whose parameters have been requested.
    """

    def __init__(self, recorder: "RecorderNode") -> None:
        self._recorder = recorder
        self.parameters = RemoteParameters(recorder, recorder.peers.names)
        self.restarted: dict[str, RemoteParameters] = {}
        self.failure = ""
        self._compared: set[str] = set()  # nodes
        self._lives: dict[str, str] = {}  # the node of each writer of a status that was seen

    def attend(self, writers: Mapping[str, str]) -> None:
        """Ask for parameters and look at those that came; `writers` are the nodes of the statuses by identity."""
        self.parameters.complete()
        for node in self.parameters.found.keys() - self._compared:
            self._compared.add(node)
            self._note(self._difference(node))
        for writer, node in writers.items():
            if writer not in self._lives and node in self._lives.values() and node in self.parameters.found:
                self.restarted[node] = RemoteParameters(self._recorder, [node])
            self._lives[writer] = node
        for node, again in list(self.restarted.items()):
            if again.complete():
                del self.restarted[node]
                self._note(self._change(node, again.found[node]))

    def _note(self, failure: str) -> None:
        if failure and not self.failure:
            self.failure = failure
            self._recorder.get_logger().error(failure)

    def _difference(self, node: str) -> str:
        """How a node has another mode or list of nodes than the recorder was given."""
        given, shared = self.parameters.found[node], self._recorder.shared
        own, mode = shared.timing.mode, given.get("timing.mode", shared.timing.mode)
        others = set(shared.nodes).symmetric_difference(given.get("nodes", shared.nodes)) - {RECORDER}
        found = [f"node {node} runs in {mode}, and this recorder in {own}"] * (mode != own)
        if others:
            found.append(f"only one of node {node} and this recorder has {', '.join(sorted(others))} in 'nodes'")
        advice = "start the recorder with 'wam bag record', which takes both from the running stack"
        return "; ".join([*found, advice]) if found else ""

    def _change(self, node: str, after: Mapping[str, object]) -> str:
        """That a node was started again with other parameters than those in the bag, '' where it was not."""
        before = self.parameters.found[node]
        others = [name for name in before.keys() - OF_ONE_PROCESS if str(before[name]) != str(after.get(name))]
        if not others:
            return ""
        bag = self._recorder.bag.path
        return (
            f"node {node} was started again, with another {', '.join(sorted(others))}, and {bag} has both runs; record "
            "each with a recorder of its own"
        )
