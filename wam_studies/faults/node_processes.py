"""Nodes as real processes that are killed, frozen and started again, watched over topics."""

import signal
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from std_srvs.srv import SetBool, Trigger

from wam_description.configuration import Configuration
from wam_description.interface import Interface
from wam_description.signals import NodeStatus, State, Wrench
from wam_ros.bring_up import NodeProcess
from wam_ros.messages import message_type, read_status
from wam_ros.requests import answer_of, switch_request
from wam_ros.run import Connection
from wam_ros.topics import NAMESPACE, qos
from wam_ros.wire import Decode, decoder, encoder, stamp_of
from wam_studies.faults.trials import FAULTS

ANSWERS: Final = {  # a topic that each node publishes in every outer period or more often
    "driver": "motor_states",
    "transform": "joint_states",
    "velocity_loop": "motor_current_command",
    "gravity": "gravity_effort",
    "force_loop": "joint_velocity_command",
    "contact_estimator": "external_joint_torques",
}
COMMANDS: Final = ("joint_posture_command", "force_command")


class NodeProcesses:
    """The chain as processes, and what is seen of it over topics.

    Parameters
    ----------
    configuration : of the nodes.

    Attributes
    ----------
    statuses : newest status of each node.
    stamps : newest stamp of the topic by which each node answers, ns.
    current_stamp : newest stamp of a motor current that is not zero, ns.
    q : true joint angles.
    reports : last texts of all nodes.
    """

    def __init__(self, configuration: Configuration) -> None:
        self.configuration = configuration
        self.names = [name for name in ANSWERS if name in configuration.shared.nodes]
        shared = configuration.shared
        interface = Interface(shared)
        self._connection = Connection()
        self.node = Node("watcher", context=self._connection.context, namespace=NAMESPACE)
        self._connection.add(self.node)
        self.statuses: dict[str, NodeStatus] = {}
        self.stamps = dict.fromkeys(self.names, 0)
        self.reports: deque[str] = deque(maxlen=200)
        self.current_stamp = 0
        self.q: list[float] = []
        self.force = 0.0
        self.hold: list[float] = []
        self._commands = {
            name: (
                self.node.create_publisher(message_type(interface.topics[name]), name, qos(interface.topics[name])),
                encoder(interface.topics[name], shared),
            )
            for name in COMMANDS
        }
        watched: dict[str, tuple[Decode, Callable[[int, Any], None]]] = {
            "motor_currents": (decoder(interface.topics["motor_currents"], shared, "effort"), self._take_currents),
            "sim/joint_states": (decoder(interface.topics["sim/joint_states"], shared, "position"), self._take_angles),
            "sim/contact/wrench": (decoder(interface.topics["sim/contact/wrench"], shared, ""), self._take_force),
        }
        for topic in {*watched, *(ANSWERS[name] for name in self.names)}:
            row = interface.topics[topic]
            take = self._taking(topic, *watched[topic]) if topic in watched else self._stamping(topic)
            self.node.create_subscription(message_type(row), topic, take, qos(row), raw=True)
        self.node.create_subscription(
            DiagnosticStatus, "status", self._take_status, qos(interface.topics["status"]), raw=True
        )
        self._clients = {
            "enable": self.node.create_client(SetBool, "driver/enable"),
            "reset_fault": self.node.create_client(Trigger, "driver/reset_fault"),
        }
        self._processes = {name: NodeProcess(configuration, name, NAMESPACE, "fatal") for name in self.names}

    def close(self) -> None:
        """End all nodes."""
        for name, process in self._processes.items():
            self.send(name, signal.SIGKILL)
            process.close()
        self._connection.close()

    # processes

    def start(self, name: str) -> None:
        """Start a node that has ended."""
        self._processes[name].start()

    def send(self, name: str, number: signal.Signals) -> None:
        """Send a signal to a node."""
        self._processes[name].send(number)

    def ended(self) -> list[str]:
        """Names of the nodes that do not run."""
        return [name for name, process in self._processes.items() if process.code is not None]

    # what is seen

    def _taking(self, topic: str, decode: Callable[[bytes], Any], take: Callable[[int, Any], None]) -> Any:
        answered = self._stamping(topic)

        def receive(data: bytes) -> None:
            answered(data)
            take(stamp_of(data), decode(data))

        return receive

    def _stamping(self, topic: str) -> Any:
        owners = [name for name in self.names if ANSWERS[name] == topic]

        def receive(data: bytes) -> None:
            for name in owners:
                self.stamps[name] = stamp_of(data)
            if topic == "joint_states" and self.hold:
                self._command(stamp_of(data))

        return receive

    def _command(self, stamp: int) -> None:
        values = {
            "joint_posture_command": State(self.hold, [], []),
            "force_command": Wrench("base", (0.0,) * 3, (0.0,) * 3),
        }
        for topic, value in values.items():
            publisher, encode = self._commands[topic]
            publisher.publish(encode(stamp, value))

    def _take_currents(self, stamp: int, value: State) -> None:
        if any(value.effort):
            self.current_stamp = stamp

    def _take_angles(self, stamp: int, value: State) -> None:
        self.q = value.position

    def _take_force(self, stamp: int, value: Wrench) -> None:
        self.force = max(self.force, sum(f * f for f in value.force) ** 0.5)

    def _take_status(self, data: bytes) -> None:
        status = read_status(deserialize_message(data, DiagnosticStatus))
        self.statuses[status.node] = status
        self.reports.append(f"{status.node}: {status.message} {status.fault}")

    @property
    def mode(self) -> str:
        """Mode of the driver, as it reports it."""
        found = self.statuses.get("driver")
        return found.mode if found else ""

    def wait(self, until: Callable[[], Any], patience: float) -> bool:
        """Spin until something is true; False where it is not within `patience`, s of wall time."""
        end = time.monotonic() + patience
        while not until():
            if time.monotonic() > end:
                return False
            self._connection.executor.spin_once(timeout_sec=0.01)
        return True

    def ask(self, service: str, switch: bool | None = None) -> str:
        """Call a service of the driver; returns its message."""
        client = self._clients[service]
        if not self.wait(client.service_is_ready, 5.0):
            return f"no service {service}"
        answer = answer_of(
            client,
            switch_request(switch)[1],
            FAULTS.attempts_of_processes,
            lambda future: self.wait(future.done, FAULTS.answered),
        )
        return "no answer" if answer is None else str(answer.message)

    def enabled(self, patience: float) -> str:
        """Do what an operator does; returns why the arm cannot be enabled, '' where it is and stays so."""
        end = time.monotonic() + patience
        reason = ""
        while time.monotonic() < end:
            self.hold = []
            self.ask("reset_fault")
            reason = self.ask("enable", True)
            silent = self._silent()
            if not silent:
                self.hold = list(self.q)
                self.wait(lambda: False, 0.1)
                if self.mode == "enabled":
                    return ""
            found = self.statuses.get("driver")
            reason += f"; silent: {', '.join(silent) or 'none'}; {found.message if found else 'no status'}"
        return f"the arm cannot be enabled within {patience:g} s: {reason}"

    def _silent(self) -> list[str]:
        """Nodes that do not answer within a second."""
        before = dict(self.stamps)

        def silent() -> list[str]:
            return [name for name in self.names if self.stamps[name] <= before[name]]

        self.wait(lambda: not silent(), 1.0)
        return silent()
