"""A node in the place of the velocity loop that answers a driver under test, and looks at its currents and mode."""

import math
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from rclpy.node import Node

from wam_description.agreement import DIGESTS, digests
from wam_description.arm import Shared
from wam_description.driver_contract import REPLY, SENT, SERVICES, TAKEN
from wam_description.event import Level
from wam_description.rigid_body import RigidBody
from wam_description.signals import NodeStatus, State
from wam_description.topics import BY_NAME, STATUS
from wam_description.wiring import Call
from wam_ros.client import StackClient
from wam_ros.health import READY
from wam_ros.limits import CONFORMANCE_LIMITS
from wam_ros.messages import diagnostic_status, joint_state, message_type
from wam_ros.ros_topics import CLOCK, NAMESPACE, qos, topic_name
from wam_ros.wire import stamp_in

KEPT = {"motor_states": " ".join(State._fields), "motor_currents": "effort"}  # arrays that must be filled
COMMAND = "motor_current_command"
Restart = Callable[[], object]


class Untested(Exception):
    """A row cannot be tested; the text states why."""


class Wrong(Exception):
    """A row is wrong; the text states how."""


class Arrived(NamedTuple):
    """A message, in the order of the motors, and when it came, s of the steady clock."""

    when: float
    stamp: int
    value: Any


class DriverBench(StackClient):
    """Answers each state with currents that carry the links, plus a small one on the first motor.

    Parameters
    ----------
    shared : configuration of the arm.
    share : of the periods in which a state has to come.
    current : added to the first motor, A, with a changing sign.
    namespace, connection : as for `StackClient`.

    Attributes
    ----------
    arrived : what came by topic.
    reported : the driver's statuses and when they came, newest last.
    commanded : the currents of the last command, A, in the order of the motors.
    carrying : currents that hold the arm up, A.
    answered : stamp of the newest state that was answered, ns.
    is_answering : whether states are answered.
    after : messages that are sent after the next answers, made from the stamp of the state.
    wanted : makes the answer from stamp and currents; None for the proper one.
    motors : of the arm; the torque constant is 1 N m/A on one that is commanded torques.
    least_share : as `share`.
    longest_pause : s, in which this node itself did not run.
    end, restart : end the driver as SIGTERM does and start it again; None where it is not ours to end.
    look_after : called again and again; it may raise what ends the test.
    """

    end: Restart | None = None
    restart: Restart | None = None
    look_after: Restart = staticmethod(lambda: None)

    def __init__(
        self, shared: Shared, share: float, current: float, namespace: str = NAMESPACE, connection: Any = None
    ) -> None:
        super().__init__(namespace, "velocity_loop", connection, shared)
        self.motors, self.least_share = shared.arm.motors, share
        self._current = current
        self.digests = digests(shared)
        self._body, self._map = RigidBody(shared.arm), shared.arm.transmission
        self.carrying = [0.0] * len(self.motors.names)
        self.commanded = list(self.carrying)
        self.arrived = {topic: deque[Arrived](maxlen=CONFORMANCE_LIMITS.kept) for topic in (*KEPT, CLOCK)}
        self.reported: deque[tuple[float, NodeStatus]] = deque(maxlen=CONFORMANCE_LIMITS.kept)
        self.answered = 0
        self.longest_pause = 0.0
        self._spun = math.inf
        for topic, arrays in KEPT.items():
            self.listen(topic, partial(self._keep, topic), arrays, partial(self._refuse, topic))
        row, keep = BY_NAME[CLOCK], lambda data: self._keep(CLOCK, stamp_in(data), None)
        self.node.create_subscription(message_type(row), topic_name(self.node, row), keep, qos(row), raw=True)
        self.follow_statuses()
        self.lacking()  # of a service is there once there is a client
        self.be_proper()

    def _keep(self, topic: str, stamp: int, value: Any) -> None:
        self.arrived[topic].append(Arrived(time.monotonic(), stamp, value))
        if topic == "motor_states" and self.is_answering:
            self._answer(stamp, value)

    def _refuse(self, topic: str, reason: str) -> None:
        self._refused = f"{topic}: {reason}"

    def _answer(self, stamp: int, state: State) -> None:
        tick = stamp // self.shared.timing.period_ns
        if tick % self.shared.timing.outer_divisor == 0:
            q = self._map.joint_motion(state.position)
            torque = self._map.motor_torques(self._body.gravity_torque(q).tolist())
            self.carrying = [t / k for t, k in zip(torque, self.motors.torque_constant, strict=True)]
        self.commanded = list(self.carrying)
        self.commanded[0] += self._current if tick // CONFORMANCE_LIMITS.swing % 2 else -self._current
        make, publisher = self.wanted or self.command, self.publisher(COMMAND)
        publisher.publish(make(stamp, self.commanded))
        self.answered = stamp
        if self.after:
            publisher.publish(self.after.pop(0)(stamp))

    def command(self, stamp: int, currents: list[float]) -> Any:
        """A proper command."""
        return joint_state(stamp, self.motors.names, State([], [], currents))

    def take_status(self, status: NodeStatus) -> None:
        """Keep a status of the driver, and follow its session."""
        if status.node == "driver":
            before = self.status.session
            self.reported.append((time.monotonic(), status))
            if status.session != before:
                self.report()

    def report(self, fault: str = "", node: str = "velocity_loop", started_with: str = "") -> None:
        """Publish a status of this node, or of another one: ready, or with a fault.

        Parameters
        ----------
        started_with : digests of its shared parameters (`wam_description.agreement`).
        """
        facts = {DIGESTS: started_with} if started_with else {}
        status = READY._replace(node=node, session=self.status.session, fault=fault, facts=facts)
        if fault:
            status = status._replace(level=Level.ERROR, message=fault)
        self.publisher(STATUS).publish(diagnostic_status(status, self.shared.arm.name))

    def be_proper(self) -> None:
        """Answer as a velocity loop that is right."""
        self._refused = ""
        self.is_answering = True
        self.after: list[Callable[[int], Any]] = []
        self.wanted: Callable[[int, list[float]], Any] | None = None
        self.report()

    # looking

    @property
    def status(self) -> NodeStatus:
        """The driver's newest status."""
        return self.reported[-1][1] if self.reported else NodeStatus(Level.STALE, "none has come")

    def forget(self) -> None:
        """Drop what has come so far."""
        self._refused = ""
        for kept in self.arrived.values():
            kept.clear()

    def spin_once(self, seconds: float = CONFORMANCE_LIMITS.spin) -> None:
        """As that of the client; a long time between the ends of two is a pause."""
        super().spin_once(seconds)
        self.look_after()
        before, self._spun = self._spun, time.monotonic()
        self.longest_pause = max(self.longest_pause, self._spun - before)

    def watch(self, seconds: float = CONFORMANCE_LIMITS.settle) -> None:
        """Let time pass, by default that in which a command acts."""
        self.wait(lambda: False, seconds)

    def ask(self, service: str, switch: bool | None = None) -> tuple[bool, str]:
        """The answer of a service; (False, '') where there is none."""
        client, message = self.service(_call(service, switch))
        limit = CONFORMANCE_LIMITS.service_wait
        answer = self.answer(client, message, limit, limit)
        return (bool(answer.success), str(answer.message)) if answer else (False, "")

    def lacking(self) -> list[str]:
        """What the driver does not connect to, of the topics that it sends and takes and of its services."""
        node = self.node
        lacking = [topic for topic in SENT if not node.count_publishers(topic_name(node, BY_NAME[topic]))]
        lacking += [topic for topic in TAKEN if not self.publisher(topic).get_subscription_count()]
        lacking += [f"driver/{name}" for name in SERVICES if not self.service(_call(name))[0].service_is_ready()]
        return lacking + [STATUS] * (not self.reported)

    def second_publisher(self) -> Any:
        """Another publisher of the command, of a node of its own, and what ends it."""
        other = Node("second_velocity_loop", namespace=self.node.get_namespace(), context=self.node.context)
        other.create_publisher(message_type(BY_NAME[COMMAND]), COMMAND, qos(BY_NAME[COMMAND]))
        return other

    # the driver in a state, and its currents

    def brake(self) -> None:
        """To braked, from any state."""
        self.ask("enable", False)
        self.ask("reset_fault")

    def enable(self) -> None:
        """From any state to enabled, with commands that come, when a person has done what the driver waits for."""
        answer = (False, "")

        def is_taken() -> bool:
            nonlocal answer
            answer = self.ask("enable", True)
            return answer[0]

        for _ in range(CONFORMANCE_LIMITS.enable_attempts):
            self.brake()
            self.is_answering = True
            self.watch()
            self.await_person(is_taken)
            if answer[0] and self.wait(lambda: self.status.mode == "enabled", REPLY):
                self.forget()
                self.watch()
                if self.status.mode == "enabled":
                    return
        raise Untested(f"the driver cannot be enabled: {answer[1] or self.status.message or 'no answer'}")

    def await_person(self, is_done: Callable[[], object]) -> None:
        """Wait until something is done, no longer than the driver warns, and print what it warns of."""
        warning, end = "", time.monotonic() + CONFORMANCE_LIMITS.person
        while not is_done() and self.status.level is Level.WARN and time.monotonic() < end:
            if self.status.message != warning:
                warning = self.status.message
                self.node.get_logger().warning(f"the driver waits; {warning}")
            self.watch()

    def states(self) -> list[Arrived]:
        """The states that came.

        Raises
        ------
        Wrong
            where one of them cannot be read.
        Untested
            where too few came.
        """
        if self._refused:
            raise Wrong(self._refused)
        states = list(self.arrived["motor_states"])
        if len(states) < 10:
            raise Untested(f"{len(states)} motor_states came")
        return states

    def flow(self, state: Arrived) -> list[float]:
        """Currents by the effort of a state, A."""
        return [t / k for t, k in zip(state.value.effort, self.motors.torque_constant, strict=True)]

    @staticmethod
    def tolerance(current: float, peak: float) -> float:
        """Largest difference of a current from the commanded one, A."""
        return 0.1 * abs(current) + 0.005 * peak

    def last_flow(self) -> int:
        """Stamp of the newest state with a current, ns, 0 where there is none."""
        stamps = (
            state.stamp
            for state in self.states()
            for flow, peak in zip(self.flow(state), self.motors.peak_current, strict=True)
            if abs(flow) > self.tolerance(0.0, peak)
        )
        return max(stamps, default=0)

    def stops(self, after: int, limit: float) -> str:
        """What is wrong with how the current stops, counted from a stamp, ns, that was the last good one."""
        self.watch(REPLY)
        late = (self.last_flow() - after) * 1e-9
        if late > limit + 1e-9 * self.shared.timing.outer_period_ns:
            return f"current still flows {late * 1e3:.0f} ms later; allowed: {limit * 1e3:.0f} ms"
        return ""

    def in_mode(self, mode: str) -> str:
        """'' where the mode is this one; raises Wrong where it is not."""
        if not self.wait(lambda: self.status.mode == mode, REPLY):
            raise Wrong(f"status.mode is '{self.status.mode}'; it has to be '{mode}'")
        return ""

    def compare(self) -> str:
        """What is wrong with the currents that flow, against those commanded."""
        motors, looks = self.motors, 20
        self.enable()
        wrong = [0] * len(motors.names)  # looks at each motor
        for _ in range(looks):
            self.watch(0.01)
            if not (self.arrived["motor_states"] and self.arrived["motor_currents"]):
                return "no currents come"
            flow = self.flow(self.arrived["motor_states"][-1])
            sent = self.arrived["motor_currents"][-1].value.effort
            for i, wanted in enumerate(self.commanded):
                worst = max(abs(flow[i] - wanted), abs(sent[i] - wanted))
                wrong[i] += worst > self.tolerance(wanted, motors.peak_current[i])
        if self.status.mode != "enabled":
            return f"it does not stay enabled: {self.status.message}"
        if 2 * max(wrong) < looks:
            return ""
        i = wrong.index(max(wrong))
        return (
            f"{motors.names[i]}: commanded {self.commanded[i]:.3g} A, motor_currents has {sent[i]:.3g}, "
            f"effort of motor_states is {flow[i] * motors.torque_constant[i]:.3g} N m"
        )

    def bad(self) -> list[float]:
        """Currents that may not flow, A: of the other sign than those that hold the arm up, so that the two differ."""
        pairs = zip(self.motors.peak_current, self.carrying, strict=True)
        return [-math.copysign(CONFORMANCE_LIMITS.bad_current * peak, carrying) for peak, carrying in pairs]

    def bears(self, messages: dict[str, Callable[[int], object]]) -> str:
        """What is wrong with how bad commands after good ones are taken."""
        bad = self.bad()
        for what, make in messages.items():
            self.enable()
            self.after = [make] * 5
            self.wait(lambda: not self.after, REPLY)
            self.watch()
            for state in self.states():
                for i, flow in enumerate(self.flow(state)):
                    if flow * bad[i] > 0.7 * bad[i] ** 2:
                        return f"{what}: its {flow:.3g} A reached {self.motors.names[i]}"
            if self.status.mode != "enabled":
                return f"{what}: the driver does not stay enabled: {self.status.message}"
        return ""


def _call(service: str, switch: bool | None = None) -> Call:
    """A request to the driver; of a switch the value counts."""
    return Call("driver", service, bool(switch) if SERVICES[service] else None)
