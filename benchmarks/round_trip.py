"""Latency from motor state to motor current, driver to velocity_loop and back, relative to a bare relay of two hops.

Both send a JointState of four motors every millisecond, on the same executor, and measure the time until the
response with the same stamp arrives.  Two processes have a processor each: where the kernel moves them from one to the
other, a round of either lasts 120 to 270 us as it happens.  A third process listens to what the driver reports of the
stack; the relay has none.
"""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from comparing import Quartiles, arguments, machine, mark, quartiles, ratios, save, table
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.node import Node
from sensor_msgs.msg import JointState

from wam_description.configuration import Configuration, packaged
from wam_description.signals import State
from wam_description.topics import BY_NAME
from wam_ros.bring_up import Composition, Processes
from wam_ros.messages import joint_state
from wam_ros.run import Connection, spin
from wam_ros.topics import qos, stamp_of

PERIOD = 0.001  # s
PROCESSORS = os.sched_getaffinity(0)
NAMES = ["motor1", "motor2", "motor3", "motor4"]
NUMBERS = [0.1, 0.2, 0.3, 0.4]
QOS = qos(BY_NAME["motor_states"])
SETTLE = 1.0  # s at the start that are ignored
WAYS = {"one process": (1.3, 0.9), "two processes": (1.1, 0.9)}  # ratio of the p50: must, aim


class Sender(Node):
    """Sends a state every period and measures the latency of the response."""

    def __init__(self, context: Context) -> None:
        super().__init__("sender", context=context)
        self.latencies: list[float] = []
        self._sent: dict[int, float] = {}
        self._count = 0
        self._publisher = self.create_publisher(JointState, "state", QOS)
        self.create_subscription(JointState, "answer", self._take, QOS)
        self._begin = time.perf_counter()
        self.create_timer(PERIOD, self._send, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _send(self) -> None:
        self._count += 1
        stamp = self._count * 1_000_000
        message = joint_state(stamp, NAMES, State(NUMBERS, NUMBERS, NUMBERS))
        self._sent[stamp] = time.perf_counter()
        self._publisher.publish(message)

    def _take(self, message: JointState) -> None:
        now = time.perf_counter()
        sent = self._sent.pop(stamp_of(message), None)
        if sent is not None and now - self._begin > SETTLE:
            self.latencies.append(now - sent)


class Relay(Node):
    """Sends back a message with four numbers for every state, and does nothing else."""

    def __init__(self, context: Context) -> None:
        super().__init__("relay", context=context)
        self._publisher = self.create_publisher(JointState, "answer", QOS)
        self.create_subscription(JointState, "state", self._take, QOS)

    def _take(self, message: JointState) -> None:
        self._publisher.publish(JointState(header=message.header, name=message.name, effort=message.effort))


def keep_apart(processes: Sequence[int]) -> None:
    """Give each of two processes a processor, from the present thread of each on; 0 is this process."""
    permitted = sorted(PROCESSORS)
    for process, processor in zip(processes, (permitted[0], permitted[-1]), strict=True):
        os.sched_setaffinity(process, {processor})


def children() -> list[int]:
    """The processes that this one has started, oldest first."""
    threads = Path("/proc/self/task").iterdir()
    return sorted(int(one) for thread in threads for one in (thread / "children").read_text(encoding="ascii").split())


def relay_alone() -> None:
    """The relay as a process of its own, until its standard input is closed."""
    connection = Connection()
    connection.add(Relay(connection.context))
    reader = threading.Thread(target=sys.stdin.buffer.read)
    reader.start()
    spin(connection.executor, lambda: not reader.is_alive())
    connection.close()


def measure_relay(way: str, seconds: float) -> Any:
    """p50 and p99 of the bare relay, s."""
    with ExitStack() as stack:
        if way == "two processes":
            child = subprocess.Popen([sys.executable, __file__, "--relay"], stdin=subprocess.PIPE)
            stack.callback(child.wait)
            stack.callback(child.stdin.close)  # type: ignore[union-attr]
            stack.callback(os.sched_setaffinity, 0, PROCESSORS)
            keep_apart([0, child.pid])  # before there are further threads
        connection = Connection()
        stack.callback(connection.close)
        if way == "one process":
            connection.add(Relay(connection.context))
        sender = Sender(connection.context)
        connection.add(sender)
        need = 0.5 * seconds / PERIOD
        end = time.perf_counter() + SETTLE + seconds
        spin(connection.executor, lambda: time.perf_counter() > end and len(sender.latencies) > need)
        latencies = sorted(sender.latencies)
    return latencies[len(latencies) // 2], latencies[int(0.99 * len(latencies))]


def measure_stack(way: str, seconds: float) -> Any:
    """p50 and p99 that the driver reports, s: medians over the seconds, the first left out."""
    configuration = Configuration.load(packaged("wam")).with_values(
        {
            "nodes": ["driver", "velocity_loop"],
            "timing.mode": "realtime",
            "timing.period": PERIOD,
            "timing.fifo_priority": 0,
            "timing.niceness": 0,  # the relay has no priority either
        }
    )
    reports: list[tuple[float, float]] = []

    def take(message: DiagnosticArray) -> None:
        facts = {pair.key: pair.value for pair in message.status[0].values}
        if "latency p50 [us]" in facts and message.header.stamp.sec > SETTLE:
            reports.append((float(facts["latency p50 [us]"]), float(facts["latency p99 [us]"])))

    with ExitStack() as stack:
        if way == "one process":
            composition = stack.enter_context(Composition(configuration))
            context, executor = composition.context, composition.executor
        else:
            stack.enter_context(Processes(configuration))
            keep_apart(children())
            connection = Connection()
            stack.callback(connection.close)
            context, executor = connection.context, connection.executor
        listener = Node("listener", context=context)
        stack.callback(listener.destroy_node)
        stack.callback(executor.remove_node, listener)
        listener.create_subscription(DiagnosticArray, "/diagnostics", take, qos(BY_NAME["/diagnostics"]))
        executor.add_node(listener)
        spin(executor, lambda: len(reports) >= max(1, round(seconds)))
    return tuple(1e-6 * quartiles([report[i] for report in reports]).median for i in (0, 1))


def main() -> None:
    """Measure in turns, print the table."""
    given = arguments(__doc__, rounds=11, quick_rounds=1)
    seconds = 1.0 if given.quick else 2.0
    taken: dict[str, tuple[list[Any], list[Any]]] = {way: ([], []) for way in WAYS}
    for _ in range(given.rounds):
        for way in WAYS:
            taken[way][0].append(measure_relay(way, seconds))
            taken[way][1].append(measure_stack(way, seconds))
    rows, measured = [], dict[str, Any]()
    for way, (relay, stack) in taken.items():
        for i, name in enumerate(("p50", "p99")):
            ours, bare = [one[i] for one in stack], [one[i] for one in relay]
            ratio = ratios(ours, bare)
            reached = mark(ratio.median, *WAYS[way]) if name == "p50" else ""
            micro = [Quartiles(*(1e6 * value for value in quartiles(part))) for part in (ours, bare)]
            rows.append([f"{way}, {name}", *(f"{part.median:.0f}" for part in micro), f"{ratio:#.3g}", reached])
            measured[f"{way}, {name}"] = {"ratio": ratio, "stack_us": micro[0], "relay_us": micro[1]}
    print(machine())
    print(
        table(
            [
                "state to current at 1 kHz over a relay of message objects",
                "stack [us]",
                "relay [us]",
                "ratio (middle half)",
                "[must, aim]",
            ],
            rows,
        )
    )
    save("round_trip", given, measured)


if __name__ == "__main__":
    if sys.argv[1:] == ["--relay"]:
        relay_alone()
    else:
        main()
