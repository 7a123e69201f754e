"""The nodes in this process, watched independently of what they report: true motion, true force, every output."""

import math
import time
from collections.abc import Callable, Collection
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message, serialize_message
from std_srvs.srv import SetBool, Trigger

from wam_bag.value_messages import Encode
from wam_description.configuration import Configuration
from wam_description.event import CAUSE, RAISED
from wam_description.interface import Interface
from wam_description.signals import State, Wrench
from wam_driver.safety import Mode
from wam_ros.bring_up import Composition
from wam_ros.messages import message_type, read_status
from wam_ros.requests import answer_of, switch_request
from wam_ros.topics import NAMESPACE, listening, qos
from wam_ros.wire import encoder, stamp_of
from wam_studies.faults.answered_clock import AnsweredClock
from wam_studies.faults.message_faults import leaves
from wam_studies.faults.trials import FAULTS, KEPT, FaultCase, FaultTrial

UNKNOWN: Final = ("contact/point", "contact/hypotheses", "sim/contact/point", "contact/markers")  # may hold NaN
SECOND: Final = 1_000_000_000


def worked() -> float:
    """A clock that runs with the work of this process, so that a starved one has time, and slowly while it waits, s."""
    return time.process_time() + FAULTS.idle * time.monotonic()


class NodeEndedError(RuntimeError):
    """A node raised an exception, which would have ended its process."""


class WatchedStack:
    """Nodes in this process around the simulated arm, a commander that holds the arm, and what is watched.

    Parameters
    ----------
    configuration : of the nodes.
    domain_id : ROS domain, the one of the environment where None.

    Attributes
    ----------
    nodes : the nodes by name.
    driver : the simulated arm, for the truth.
    escapes : what has gone wrong since `begin`.
    statuses : newest status of each node, by its name.
    """

    def __init__(self, configuration: Configuration, domain_id: int | None = None) -> None:
        shared = configuration.shared
        self.configuration, self.cover = configuration, shared.arm.covers.names[-1]
        paced = {"timing.real_time_factor": 0.0} if hasattr(shared.timing, "real_time_factor") else {}
        configuration = configuration.with_values({"timing.timeout": 2.0, **paced})
        self._clock = AnsweredClock(shared.timing.period)
        with self._clock.of_new_nodes(configuration.shared.timing.mode):
            self._composition = Composition(configuration, domain_id=domain_id)
        self.nodes = self._composition.nodes
        self.executor, self.context = self._composition.executor, self._composition.context
        self.driver: Any = self._named("driver").driver
        self.interface = Interface(shared)
        self.statuses: dict[str, Any] = {}
        self.escapes: list[str] = []
        self.motion = self.force = 0.0
        self.allowed_force, self.allowed_motion = FAULTS.force, FAULTS.motion
        self._peak = [
            t / k for t, k in zip(shared.arm.motors.peak_torque, shared.arm.motors.torque_constant, strict=True)
        ]
        self._anchor = self._held = list(self.driver.plant.q)
        self._newest: dict[str, bytes] = {}
        self._injected: set[bytes] = set()
        self.node = Node("watcher", context=self.context, namespace=NAMESPACE)
        self.commander = Node("commander", context=self.context, namespace=NAMESPACE)
        for node in (self.node, self.commander):
            self.executor.add_node(node)
        self._commands: dict[str, tuple[Publisher, Encode]] = {
            name: (self.commander.create_publisher(self.type_of(name), name, qos(self.interface.topics[name])), encode)
            for name in ("joint_posture_command", "force_command", "joint_torque_command", "sim/disturbance")
            if name in self.interface.topics and not self.interface.publishers(name)
            for encode in [encoder(self.interface.topics[name], shared)]
        }
        self.commanded_force = (0.0, 0.0, 0.0)
        self.is_commanding = True
        for name, row in self.interface.topics.items():
            watch = self._watching(name, message_type(row))
            self.node.create_subscription(message_type(row), name, watch, listening(row), raw=True)
        self._clients = {
            "enable": self.node.create_client(SetBool, "driver/enable"),
            **{name: self.node.create_client(Trigger, f"driver/{name}") for name in ("reset_fault", "reset", "estop")},
        }
        self._start(lambda: all(client.service_is_ready() for client in self._clients.values()), "services")
        self._start(lambda: self.driver.stamp > 20 * shared.timing.outer_period_ns, "the start of the arm's time")

    def _named(self, name: str) -> Any:
        return self._composition.nodes[name]

    def close(self) -> None:
        """Destroy all nodes."""
        for node in (self.node, self.commander):
            self.executor.remove_node(node)
            node.destroy_node()
        self._composition.close()

    def __enter__(self) -> "WatchedStack":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # what is watched

    def _watching(self, topic: str, kind: Any) -> Callable[[bytes], None]:
        is_bounded = topic in ("motor_current_command", "motor_currents")

        def take(data: bytes) -> None:
            if data in self._injected:
                return
            try:
                message = deserialize_message(data, kind)
            except Exception:
                return
            self._newest[topic] = data
            if topic == "motor_current_command" and stamp_of(data) >= self.driver.stamp:
                self._clock.advance()
            if topic == "joint_states" and self.is_commanding:
                self._command(stamp_of(data))
            if topic == "status":
                self._take_status(message)
            bad = [leaf.name for leaf in leaves(message) if _is_wrong(leaf.value, topic in UNKNOWN)]
            if bad:
                self._escape(f"{topic} has {bad[0]} not finite")
            if is_bounded and any(
                abs(i) > peak * 1.000001 for i, peak in zip(message.effort, self._peak, strict=False)
            ):
                self._escape(f"{topic} is above the peak current: {list(message.effort)} A")

        return take

    def _take_status(self, message: DiagnosticStatus) -> None:
        self.statuses[message.name] = message
        status = read_status(message)
        if any(event.values.get(CAUSE) == RAISED for event in status.events):
            self._escape(f"{status.node}: {status.message[:200]}")

    def _command(self, stamp: int) -> None:
        """Hold the arm where it is, press as commanded, push nothing."""
        values = {
            "joint_posture_command": State(self._held, [], []),
            "force_command": Wrench(self.cover, self.commanded_force, (0.0, 0.0, 0.0)),
        }
        for topic, value in values.items():
            publisher, encode = self._commands[topic]
            publisher.publish(encode(stamp, value))

    def _escape(self, reason: str) -> None:
        if reason not in self.escapes and len(self.escapes) < 10:
            self.escapes.append(reason)

    def _look(self) -> None:
        """The truth, from the plant itself."""
        plant = self.driver.plant
        motion = max(abs(a - b) for a, b in zip(plant.q, self._anchor, strict=True))
        if not math.isfinite(motion):
            self._escape("the plant is not finite")
        self.motion = max(self.motion, motion)
        force = max((math.hypot(*load.force) for load in plant.loads()), default=0.0)
        self.force = max(self.force, force)
        if motion > self.allowed_motion:
            self._escape("the arm moved without a command")
            self._held = list(plant.q)  # do not pull it back
        if force > self.allowed_force:
            self._escape("the arm pressed without a command")

    # time

    def spin_once(self) -> None:
        """One callback; a node that raises is an escape of its own."""
        try:
            self.executor.spin_once(timeout_sec=0.01)
        except Exception as error:
            where = error.__traceback__
            names = []
            while where is not None:
                names.append(f"{where.tb_frame.f_code.co_filename.rpartition('/')[2]}:{where.tb_lineno}")
                where = where.tb_next
            raise NodeEndedError(f"a node ended: {type(error).__name__}: {str(error)[:150]} ({names[-1]})") from error

    def _start(self, until: Callable[[], Any], what: str) -> None:
        if not self.wait(until, FAULTS.longest_start):
            self.close()
            raise TimeoutError(f"no {what} within {FAULTS.longest_start:g} s")

    def wait(self, until: Callable[[], Any], patience: float = FAULTS.patience) -> bool:
        """Spin until something is true; False where it is not within `patience`, s of work."""
        end = worked() + patience
        while not until():
            if worked() > end:
                return False
            self.spin_once()
        return True

    def run(self, seconds: float) -> None:
        """Let the arm's time go on; time at rest without a fault is an escape."""
        end, last = self.driver.stamp + int(seconds * SECOND), 0
        while self.driver.stamp < end:
            if self.driver.stamp != last:
                last, since = self.driver.stamp, worked()
            self.spin_once()
            self._look()
            rest = worked() - since
            if rest > FAULTS.rest and self.driver.safety.mode is Mode.FAULT:
                return
            if rest > FAULTS.patience:
                self._escape(f"the arm's time is at rest for {FAULTS.patience:g} s of work without a fault")
                return

    def stamp(self) -> int:
        """Time of the present state, ns."""
        return int(self.driver.stamp)

    # states

    def begin(self) -> str:
        """Start a trial with an enabled arm at rest; returns why that is not possible, '' where it is."""
        self._injected.clear()
        self.allowed_force, self.allowed_motion = FAULTS.force, FAULTS.motion
        self.driver.plant.release()
        if reason := self.recover():
            return reason
        if max(abs(v) for v in self.driver.plant.qd) > 1e-3:
            self.run(0.3)
        self._anchor = self._held = list(self.driver.plant.q)
        self.escapes = []
        self.motion = self.force = 0.0
        return ""

    def recover(self) -> str:
        """Do what an operator does after a fault; returns why the arm cannot be enabled, '' where it can."""
        end = worked() + FAULTS.patience
        message = ""
        while worked() < end:
            if self.driver.safety.mode is Mode.ENABLED and self._goes_on():
                return ""
            self.ask("reset_fault")
            message = self.ask("enable", True)
            self.wait(lambda: self.driver.safety.mode is Mode.ENABLED, 0.2)
        why = message or self.driver.safety.fault
        return f"the arm cannot be enabled again within {FAULTS.patience:g} s of work: {why}"

    def _goes_on(self) -> bool:
        before = self.driver.stamp
        went_on = self.wait(lambda: self.driver.stamp > before + self.configuration.shared.timing.outer_period_ns, 3.0)
        return went_on and self.driver.safety.mode is Mode.ENABLED

    def ask(self, service: str, switch: bool | None = None) -> str:
        """Call a service of the driver; returns its message."""
        client = self._clients[service]
        answer = answer_of(
            client, switch_request(switch)[1], FAULTS.attempts, lambda future: self.wait(future.done, FAULTS.answered)
        )
        return "no answer" if answer is None else str(answer.message)

    # faults

    def type_of(self, topic: str) -> Any:
        """Message class of a topic."""
        return message_type(self.interface.topics[topic])

    def qos_of(self, topic: str) -> Any:
        """Quality of service of a topic."""
        return qos(self.interface.topics[topic])

    def taken_topics(self) -> list[str]:
        """Topics that a node takes."""
        return [name for name in self.interface.topics if self.interface.subscribers(name)]

    def own_publisher(self, topic: str, chance: Any) -> Publisher | None:
        """A publisher that belongs to the stack: that of the node which publishes the topic, or of the commander."""
        full = self.node.resolve_topic_name(topic)
        nodes = [*self.nodes.values(), self.commander]
        found = [one for node in nodes for one in node.publishers if node.resolve_topic_name(one.topic) == full]
        return chance.choice(found) if found else None

    def foreign_publisher(self, topic: str) -> Publisher:
        """A second publisher, matched; `remove` destroys it."""
        publisher = self.node.create_publisher(self.type_of(topic), topic, self.qos_of(topic))
        wanted = 1 + len(self.interface.subscribers(topic))
        self.wait(lambda: publisher.get_subscription_count() >= wanted, 1.0)
        return publisher

    def remove(self, publisher: Publisher) -> None:
        """Destroy a foreign publisher."""
        self.node.destroy_publisher(publisher)

    def newest(self, topic: str) -> Any:
        """A new message object like the last one on a topic, an empty one where there was none."""
        data = self._newest.get(topic)
        return self.type_of(topic)() if data is None else deserialize_message(data, self.type_of(topic))

    def inject(self, publisher: Publisher, data: bytes) -> None:
        """Publish bytes that are not watched."""
        self._injected.add(data)
        publisher.publish(data)

    def serialize(self, message: Any) -> bytes:
        """CDR of a message."""
        return bytes(serialize_message(message))


def _is_wrong(value: Any, may_be_unknown: bool) -> bool:
    numbers = [value] if isinstance(value, float) else value if hasattr(value, "typecode") else ()
    if isinstance(numbers, Collection) and getattr(numbers, "typecode", "d") not in ("d", "f"):
        return False
    if may_be_unknown:
        return any(math.isinf(number) for number in numbers)
    return not math.isfinite(math.fsum(numbers)) if numbers else False


def recorded_into(configuration: Configuration, folder: str) -> dict[str, Any]:
    """Values that add a recorder, which writes into `folder`/bag."""
    nodes = [*configuration.shared.nodes, "recorder"]
    return {"nodes": nodes, "recorder:directory": folder, "recorder:name": "bag"}


def watched_trial(case: FaultCase, name: str, work: Callable[[WatchedStack], int]) -> FaultTrial:
    """A trial on an enabled arm, which an operator must be able to enable afterwards.

    Parameters
    ----------
    case : whose nodes are watched.
    name : of what is tried.
    work : does it; returns how much of it there was.
    """
    stack: WatchedStack = KEPT.ready(WatchedStack, case.configuration)
    size, escapes = 1, []
    reason = stack.begin()
    try:
        if not reason:
            size = work(stack)
            escapes = list(stack.escapes)
            reason = stack.recover()
    except NodeEndedError as error:
        escapes, reason = list(stack.escapes), str(error)
    if reason:
        KEPT.discard()
        escapes.append(reason)
    return FaultTrial(case.kind, name, size, tuple(escapes), stack.motion, stack.force)
