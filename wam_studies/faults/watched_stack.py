"""The nodes in this process, watched independently of what they report: true motion, true force, every output."""

import math
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message

from wam_description.configuration import Configuration
from wam_description.event import CAUSE, RAISED
from wam_description.interface import Interface
from wam_description.signals import ZERO, NodeStatus, State, Wrench
from wam_description.wiring import Call
from wam_driver.safety import Mode
from wam_ros.bring_up import Composition
from wam_ros.client import StackClient
from wam_ros.messages import message_type
from wam_ros.ros_topics import NAMESPACE, SECOND, listening, qos
from wam_ros.wire import stamp_in
from wam_studies.faults.answered_clock import AnsweredClock
from wam_studies.faults.message_faults import leaves
from wam_studies.faults.trials import FAULTS, KEPT, FaultCase, FaultTrial

UNKNOWN: Final = ("contact/point", "contact/hypotheses", "sim/contact/point", "contact/markers")  # may hold NaN
COMMANDS: Final = {"joint_posture_command", "force_command", "joint_torque_command", "sim/disturbance"}


def worked() -> float:
    """A clock that runs with the work of this process, so that a starved one has time, and slowly while it waits, s."""
    return time.process_time() + FAULTS.idle * time.monotonic()


class NodeEndedError(RuntimeError):
    """A node raised an exception, which would have ended its process."""


class WatchedStack(StackClient):
    """Nodes in this process around the simulated arm, a commander that holds the arm, and what is watched.

    Parameters
    ----------
    configuration : of the nodes.
    domain_id : ROS domain, the one of the environment where None.

    Attributes
    ----------
    nodes : the nodes by name.
    driver : the simulated arm, for the truth.
    commander : a node of its own, which commands the arm.
    cover : link that is pressed.
    interface : of the nodes.
    escapes : what has gone wrong since `begin`.
    motion, force : largest of a joint, rad, and on the world, N, since `begin`.
    delay : s of the arm's time until an emergency stop was answered, NaN where none was requested.
    allowed_motion, allowed_force : above which they are an escape.
    """

    _anchor: list[float]
    _held: list[float]
    escapes: list[str]
    motion: float
    force: float
    delay: float
    allowed_motion: float
    allowed_force: float

    def __init__(self, configuration: Configuration, domain_id: int | None = None) -> None:
        shared = configuration.shared
        self.cover, self.interface = shared.arm.covers.names[-1], Interface(shared)
        configuration = configuration.with_values({"timing.timeout": 2.0, "timing.real_time_factor": 0.0})
        self._clock = AnsweredClock(shared.timing.period)
        with self._clock.of_new_nodes(shared.timing.mode):
            self._composition = Composition(configuration, domain_id=domain_id, is_split=True)
        self.nodes: dict[str, Any] = dict(self._composition.nodes)
        self.driver = self.nodes["driver"].driver
        motors = shared.arm.motors
        self._peak = [t / k for t, k in zip(motors.peak_torque, motors.torque_constant, strict=True)]
        self._newest: dict[str, bytes] = {}
        self._injected: set[bytes] = set()
        self._start_trial()
        super().__init__(NAMESPACE, "watcher", self._composition, shared)
        self.follow_statuses()
        self.commander = StackClient(NAMESPACE, "commander", self._composition, shared)
        for name in COMMANDS & self.topics.keys():
            if not self.interface.publishers(name):
                self.commander.publisher(name)
        for name, row in self.topics.items():
            take = self._watching(name, message_type(row))
            self.node.create_subscription(message_type(row), name, take, listening(row), raw=True)
        if not self.wait(lambda: self.driver.stamp > 20 * shared.timing.outer_period_ns, FAULTS.longest_start):
            self.close()
            raise TimeoutError(f"the arm's time does not start within {FAULTS.longest_start:g} s")

    def close(self) -> None:
        """Destroy all nodes."""
        self._composition.close()

    # what is watched

    def _watching(self, topic: str, kind: Any) -> Callable[[bytes], None]:
        is_wrong = np.isinf if topic in UNKNOWN else _is_not_finite
        is_bounded = topic in ("motor_current_command", "motor_currents")

        def take(data: bytes) -> None:
            if data in self._injected:
                return
            try:
                message = deserialize_message(data, kind)
            except Exception:
                return
            self._newest[topic] = data
            if topic == "motor_current_command" and stamp_in(data) >= self.driver.stamp:
                self._clock.advance()
            if topic == "joint_states":
                self._command(stamp_in(data))
            bad = [leaf.name for leaf in leaves(message) if leaf.is_real and np.any(is_wrong(leaf.value))]
            if bad:
                self._escape(f"{topic} has {bad[0]} not finite")
            if is_bounded and any(
                abs(i) > peak * 1.000001 for i, peak in zip(message.effort, self._peak, strict=False)
            ):
                self._escape(f"{topic} is above the peak current: {list(message.effort)} A")

        return take

    def _hear(self, data: bytes) -> None:
        if data not in self._injected:
            super()._hear(data)

    def take_status(self, status: NodeStatus) -> None:
        """Take a status; one that reports an exception in a node is an escape."""
        if any(event.values.get(CAUSE) == RAISED for event in status.events):
            self._escape(f"{status.node}: {status.message[:200]}")

    def _command(self, stamp: int) -> None:
        """Hold the arm where it is, press and push nothing."""
        self.commander.send("joint_posture_command", stamp, State(self._held, [], []))
        self.commander.send("force_command", stamp, Wrench(self.cover, ZERO, ZERO))

    def _escape(self, reason: str) -> None:
        if reason not in self.escapes and len(self.escapes) < 10:
            self.escapes.append(reason)

    def _look(self) -> None:
        """The truth, from the plant itself."""
        plant = self.driver.plant
        motion = max(abs(a - b) for a, b in zip(plant.q, self._anchor, strict=True))
        if not math.isfinite(motion):
            self._escape("the plant is not finite")
        force = max((math.hypot(*load.force) for load in plant.loads()), default=0.0)
        self.motion, self.force = max(self.motion, motion), max(self.force, force)
        if motion > self.allowed_motion:
            self._escape("the arm moved without a command")
            self._held = list(plant.q)  # do not pull it back
        if force > self.allowed_force:
            self._escape("the arm pressed without a command")

    # time

    def spin_once(self, seconds: float = 0.01) -> None:
        """Run one callback; a node that raises is an escape of its own."""
        try:
            super().spin_once(seconds)
        except Exception as error:
            *_, frame = traceback.extract_tb(error.__traceback__)
            where = f"{Path(frame.filename).name}:{frame.lineno}"
            raise NodeEndedError(f"a node ended: {type(error).__name__}: {str(error)[:150]} ({where})") from error

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

    # states

    def _start_trial(self) -> None:
        self._anchor = self._held = list(self.driver.plant.q)
        self.escapes = []
        self.motion = self.force = 0.0
        self.delay = math.nan
        self.allowed_force, self.allowed_motion = FAULTS.force, FAULTS.motion

    def begin(self) -> str:
        """Start a trial with an enabled arm at rest; returns why that is not possible, '' where it is."""
        self._injected.clear()
        self.driver.plant.release()
        if reason := self.recover():
            return reason
        if max(abs(v) for v in self.driver.plant.qd) > 1e-3:
            self.run(0.3)
        self._start_trial()
        return ""

    def recover(self) -> str:
        """Do what an operator does after a fault; returns why the arm cannot be enabled, '' where it can."""
        end = worked() + FAULTS.patience
        message = ""
        while worked() < end:
            if self.driver.safety.mode is Mode.ENABLED and self._goes_on():
                return ""
            self.request(Call("driver", "reset_fault"))
            message = self.request(Call("driver", "enable", True)).message
            self.wait(lambda: self.driver.safety.mode is Mode.ENABLED, 0.2)
        why = message or self.driver.safety.fault
        return f"the arm cannot be enabled again within {FAULTS.patience:g} s of work: {why}"

    def _goes_on(self) -> bool:
        end = self.driver.stamp + self.shared.timing.outer_period_ns
        return self.wait(lambda: self.driver.stamp > end, 3.0) and self.driver.safety.mode is Mode.ENABLED

    # faults

    def type_of(self, topic: str) -> Any:
        """Message class of a topic."""
        return message_type(self.topics[topic])

    def own_publisher(self, topic: str, chance: Any) -> Publisher | None:
        """A publisher that belongs to the stack: that of the node which publishes the topic, or of the commander."""
        full = self.node.resolve_topic_name(topic)
        nodes = [*self.nodes.values(), self.commander.node]
        found = [one for node in nodes for one in node.publishers if node.resolve_topic_name(one.topic) == full]
        return chance.choice(found) if found else None

    def foreign_publisher(self, topic: str) -> Publisher:
        """A second publisher, matched; destroy it with `node.destroy_publisher`."""
        publisher = self.node.create_publisher(self.type_of(topic), topic, qos(self.topics[topic]))
        wanted = 1 + len(self.interface.subscribers(topic))
        self.wait(lambda: publisher.get_subscription_count() >= wanted, 1.0)
        return publisher

    def newest(self, topic: str) -> Any:
        """A new message object like the last one on a topic, an empty one where there was none."""
        data = self._newest.get(topic)
        return self.type_of(topic)() if data is None else deserialize_message(data, self.type_of(topic))

    def inject(self, publisher: Publisher, data: bytes) -> None:
        """Publish bytes that are not watched."""
        self._injected.add(data)
        publisher.publish(data)


def _is_not_finite(values: ArrayLike) -> NDArray[np.bool_]:
    return ~np.isfinite(values)


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
    return FaultTrial(case.kind, name, size, tuple(escapes), stack.motion, stack.force, stack.delay)
