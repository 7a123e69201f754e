"""A node in the place of the velocity loop that answers a driver as the test asks, and keeps what the driver sends."""

import time
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from wam_description.agreement import DIGESTS
from wam_description.arm import Shared
from wam_description.driver_contract import REPLY, SERVICES
from wam_description.event import Level
from wam_description.rigid_body import RigidBody
from wam_description.signals import NodeStatus, State
from wam_description.topics import BY_NAME
from wam_description.transmission_map import TransmissionMap
from wam_ros.health import READY
from wam_ros.limits import CONFORMANCE_LIMITS
from wam_ros.messages import diagnostic_status, joint_state, message_type, read_status
from wam_ros.topics import qos, stamp_of, topic_name

Spin = Callable[[float], None]


class Arrived(NamedTuple):
    """A message and when it came, s of the steady clock."""

    when: float
    stamp: int
    message: Any


class DriverProbe(Node):
    """Answers each state with currents that carry the links, with a small one more on the first motor.

    Parameters
    ----------
    shared : configuration of the arm.
    current : added to the first motor, A, with a changing sign.
    spin : handles what has arrived, for at most this many seconds.
    ros : as rclpy's Node takes them.

    Attributes
    ----------
    arrived : what came by topic.
    statuses : the driver's, newest last.
    commanded : the currents of the last command, A, in the order of the motors.
    answered : stamp of the newest state that was answered, ns.
    is_answering : whether states are answered.
    after : messages that are sent after the next answers, made from the stamp of the state.
    carrying : currents that hold the arm up, A.
    wanted : makes the answer from stamp and currents; None for the proper one.
    longest_pause : s, in which this node itself did not run.
    """

    def __init__(self, shared: Shared, current: float, spin: Spin, **ros: Any) -> None:
        super().__init__("velocity_loop", **ros)
        self._shared, self._current, self._spin = shared, current, spin
        self._motors = list(shared.arm.motors.names)
        self._body, self._map = RigidBody(shared.arm), TransmissionMap.of(shared.arm)
        self.carrying = [0.0] * len(self._motors)
        self.arrived: dict[str, deque[Arrived]] = {}
        self.statuses: deque[tuple[float, NodeStatus]] = deque(maxlen=CONFORMANCE_LIMITS.kept)
        self.diagnostics: set[str] = set()
        self.commanded = list(self.carrying)
        self.answered = 0
        self.longest_pause = 0.0
        self.is_answering = True
        self.after: list[Callable[[int], Any]] = []
        self.wanted: Callable[[int, list[float]], Any] | None = None
        self._command = self.create_publisher(JointState, "motor_current_command", self._qos("motor_current_command"))
        self._status = self.create_publisher(DiagnosticStatus, "status", self._qos("status"))
        self._session = -1
        for topic, kind in {
            "motor_states": JointState,
            "motor_currents": JointState,
            "/clock": Clock,
            "robot_description": String,
        }.items():
            self.arrived[topic] = deque(maxlen=CONFORMANCE_LIMITS.kept)
            name = topic_name(self, BY_NAME[topic])
            self.create_subscription(kind, name, self._keeping(topic), self._qos(topic))
        latched = self._qos("status")
        latched.depth = 100
        self.create_subscription(DiagnosticStatus, "status", self._take_status, latched)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._take_report, self._qos("/diagnostics"))
        self._requests = {
            name: self.create_client(SetBool if is_switch else Trigger, f"driver/{name}")
            for name, is_switch in SERVICES.items()
        }
        self.report()

    def _qos(self, topic: str) -> Any:
        return qos(BY_NAME[topic])

    def _keeping(self, topic: str) -> Callable[[Any], None]:
        kept = self.arrived[topic]

        def keep(message: Any) -> None:
            stamp = 0
            if topic == "/clock":
                stamp = message.clock.sec * 1_000_000_000 + message.clock.nanosec
            elif topic != "robot_description":
                stamp = stamp_of(message)
            kept.append(Arrived(time.monotonic(), stamp, message))
            if topic == "motor_states":
                self._answer(stamp, message)

        return keep

    def _answer(self, stamp: int, state: Any) -> None:
        if not self.is_answering:
            return
        tick = stamp // self._shared.timing.period_ns
        if tick % self._shared.timing.outer_divisor == 0 and len(state.position) == len(self._motors):
            q = self._map.joint_positions(list(state.position))
            torque = self._map.motor_torques(self._body.gravity_torque(q).tolist())
            constant = self._shared.arm.motors.torque_constant
            self.carrying = [t / k for t, k in zip(torque, constant, strict=True)]
        self.commanded = list(self.carrying)
        self.commanded[0] += self._current if tick // CONFORMANCE_LIMITS.swing % 2 else -self._current
        self.send(self.wanted(stamp, self.commanded) if self.wanted else self.command(stamp, self.commanded))
        self.answered = stamp
        if self.after:
            self.send(self.after.pop(0)(stamp))

    def command(self, stamp: int, currents: list[float]) -> Any:
        """A proper command."""
        return joint_state(stamp, self._motors, State([], [], currents))

    def send(self, message: Any) -> None:
        """Publish a command."""
        self._command.publish(message)

    def _take_status(self, message: Any) -> None:
        status = read_status(message)
        if status.node == "driver":
            self.statuses.append((time.monotonic(), status))
            if status.session != self._session:
                self._session = status.session
                self.report()

    def _take_report(self, message: Any) -> None:
        self.diagnostics |= {status.name for status in message.status}

    def report(self, fault: str = "", node: str = "velocity_loop", started_with: str = "") -> None:
        """Publish a status of this node, or of another one: ready, or with a fault.

        Parameters
        ----------
        started_with : digests of its shared parameters (`wam_description.agreement`).
        """
        facts = {DIGESTS: started_with} if started_with else {}
        status = READY._replace(node=node, session=max(self._session, 0), fault=fault, facts=facts)
        if fault:
            status = status._replace(level=Level.ERROR, message=fault)
        self._status.publish(diagnostic_status(status, self._shared.arm.name))

    def be_proper(self) -> None:
        """Answer again as a velocity loop that is right."""
        self.is_answering, self.wanted, self.after = True, None, []
        self.report()

    # looking

    @property
    def status(self) -> NodeStatus:
        """The driver's newest status."""
        return self.statuses[-1][1] if self.statuses else NodeStatus(Level.STALE, "none has come")

    def forget(self) -> None:
        """Drop what has come so far."""
        for kept in self.arrived.values():
            kept.clear()

    def wait(self, until: Callable[[], Any], seconds: float = REPLY) -> bool:
        """Whether something becomes true within some seconds."""
        now = time.monotonic()
        end = now + seconds
        while not (found := until()) and now < end:
            self._spin(CONFORMANCE_LIMITS.spin)
            before, now = now, time.monotonic()
            self.longest_pause = max(self.longest_pause, now - before)
        return bool(found)

    def watch(self, seconds: float) -> None:
        """Let time pass."""
        self.wait(lambda: False, seconds)

    def ask(self, service: str, switch: bool | None = None) -> tuple[bool, str]:
        """The answer of a service; (False, '') where there is none."""
        client = self._requests[service]
        if not self.wait(client.service_is_ready, CONFORMANCE_LIMITS.service_wait):
            return False, ""
        request = client.srv_type.Request(**({} if switch is None else {"data": switch}))
        future = client.call_async(request)
        if not self.wait(future.done, CONFORMANCE_LIMITS.service_wait):
            return False, ""
        return bool(future.result().success), str(future.result().message)

    def lacking(self, sent: tuple[str, ...], taken: tuple[str, ...]) -> list[str]:
        """What the driver does not connect to, of the topics that it sends and takes and of its services."""
        names = {topic: topic_name(self, BY_NAME[topic]) for topic in (*sent, *taken)}
        lacking = [topic for topic in sent if not self.count_publishers(names[topic])]
        lacking += [topic for topic in taken if not self._command.get_subscription_count()]
        lacking += [f"driver/{name}" for name, client in self._requests.items() if not client.service_is_ready()]
        return lacking + ([] if self.statuses else ["status"])

    def second_publisher(self) -> Any:
        """Another publisher of the command, of a node of its own, and what ends it."""
        other = Node("second_velocity_loop", namespace=self.get_namespace(), context=self.context)
        kind = message_type(BY_NAME["motor_current_command"])
        other.create_publisher(kind, "motor_current_command", self._qos("motor_current_command"))
        return other
