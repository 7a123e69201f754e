"""The stack over topics: speed, latency, real time."""

import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from typing import Any

import mujoco
import numpy as np
import yaml
from bench import Benchmark, Ratio, Values
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState
from simulation import scenario, scenario_steps, seconds

from wam_analysis.recording import AnalysedRecording
from wam_bag.bag import read
from wam_bag.columns import JointColumns
from wam_description.configuration import Configuration, packaged
from wam_description.mjcf import mjcf
from wam_description.nodes import EACH, GROUPED
from wam_description.rigid_body import RigidBody
from wam_description.signals import State
from wam_description.topics import BY_NAME
from wam_driver.driver import DriverParameters
from wam_ros.bring_up import Composition, Processes
from wam_ros.messages import joint_state
from wam_ros.ros_topics import qos, stamp_of
from wam_ros.run import Connection
from wam_ros.wire import stamp_in
from wam_sim.simulation import Simulation

Readings = list[tuple[float, int]]  # wall clock in s, the arm's time in ns


@contextmanager
def watched_clock() -> Iterator[tuple[Executor, Readings]]:
    """An executor to spin, and the arm's clock as a reader of /clock has seen it since then, by `time.time`."""
    seen: Readings = []
    connection = Connection()
    watch = Node("stopwatch", context=connection.context)
    connection.add(watch)

    def take(data: bytes) -> None:
        seen.append((time.time(), stamp_in(data)))

    watch.create_subscription(ClockMessage, "/clock", take, qos_profile_sensor_data, raw=True)
    try:
        yield connection.executor, seen
    finally:
        connection.close()


BARE = 94.0  # times real time of the bare plant on the computer of the requirements
FASTER = "this computer over that of the requirements"


def bare(configuration: Configuration, length: float) -> float:
    """Times real time of MuJoCo's steps alone, of the arm that its motors hold at its start."""
    shared, driver = configuration.shared, configuration.node("driver", DriverParameters)
    arm, step = shared.arm, shared.timing.substep
    model = mujoco.MjModel.from_xml_string(mjcf(arm, step, driver.world, driver.effects))
    data = mujoco.MjData(model)
    n, transmission = arm.n, arm.transmission
    data.qpos[n : 2 * n] = arm.joints.start
    data.qpos[:n] = transmission.motor_from_joint @ arm.joints.start
    data.ctrl[:] = transmission.motor_torques(RigidBody(arm).gravity_torque(arm.joints.start).tolist())
    return length / seconds(lambda: [mujoco.mj_step(model, data) for _ in range(round(length / step))])


def direct(configuration: Configuration, length: float) -> float:
    """Simulated seconds per second of the wall clock, without ROS."""
    run = Simulation(configuration, scenario_steps(length, configuration.shared))
    failures: list[str] = []
    taken = seconds(lambda: failures.append(run.play()))
    if failures != [""]:
        raise RuntimeError(failures[0])
    return run.driver.stamp / 1e9 / taken


def lockstep(configuration: Configuration, *recorder: str) -> float:
    """The same over topics in one process, without the start of the nodes."""
    nodes = {"nodes": [*configuration.shared.nodes, "scenario", *recorder]}
    seen: Readings = []
    with Composition(configuration.with_values(nodes)) as composition:
        driver: Any = composition.nodes["driver"]
        player: Any = composition.nodes["scenario"]

        def ended() -> bool:
            seen.append((time.perf_counter(), driver.driver.stamp))
            return player.done

        composition.spin(ended)
        if player.failure:
            raise RuntimeError(player.failure)
    return seen_speed(seen)


def in_processes(configuration: Configuration, how: str) -> float:
    """The same in processes, with the recorder, seen from outside."""
    nodes = {"nodes": [*configuration.shared.nodes, "scenario", "recorder"]}
    with (
        watched_clock() as (executor, seen),
        Processes(configuration.with_values(nodes), log_level="warn", processes=how) as stack,
    ):
        while not stack.ended():
            executor.spin_once(timeout_sec=0.1)
        if stack.failures:
            raise RuntimeError(stack.failures[0])
    if stack.bag_failure:
        raise RuntimeError(stack.bag_failure)
    return seen_speed(seen)


def seen_speed(seen: Readings) -> float:
    """Times real time, from the first to the last reading of an arm that was in motion."""
    first, last = seen[0][1], seen[-1][1]
    running = [(at, stamp) for at, stamp in seen if first < stamp < last]
    (begin, start), (end, stop) = running[0], running[-1]
    return (stop - start) / 1e9 / (end - begin)


def speed(quick: bool) -> Values:
    """Times real time of a short form of the demonstration: without ROS, over topics in one process, in several.

    What is required is of a computer on which the bare plant, MuJoCo's step of the same arm, makes `BARE` times real
    time; each is divided by what the bare plant makes here.
    """
    length = 1.0 if quick else 5.0
    with tempfile.TemporaryDirectory(prefix="wam_bench_") as folder:
        script = Path(folder) / "script.yaml"
        script.write_text(yaml.safe_dump(scenario(length)), encoding="utf-8")
        values = {"timing.mode": "lockstep", "timing.real_time_factor": 0.0, "scenario:script": str(script)}
        base = Configuration.load(packaged("wam")).with_values({**values, "recorder:directory": folder})
        named = [base.with_values({"recorder:name": how}) for how in ("one", GROUPED, EACH)]
        found = {
            "bare plant": bare(base, 1.0 if quick else 20.0),
            "run without ROS": direct(base, length),
            "lockstep": lockstep(base),
            "lockstep, recorded": lockstep(named[0], "recorder"),
            "grouped, recorded": in_processes(named[1], GROUPED),
            "one process per node, recorded": in_processes(named[2], EACH),
        }
    return {**found, FASTER: found["bare plant"] / BARE}


SPEED = Benchmark(
    speed,
    "times real time",
    (
        Ratio("run without ROS", FASTER, 20.0, 26.0),
        Ratio("lockstep", FASTER, 7.0, 10.0),
        Ratio("lockstep, recorded", FASTER, 5.5, 8.0),
        Ratio("grouped, recorded", FASTER, 1.8, 3.0),
        Ratio("one process per node, recorded", FASTER, 2.0, 2.5),
    ),
    rounds=5,
)


PERIOD = 0.001  # s
PROCESSORS = os.sched_getaffinity(0)
NAMES = ["motor1", "motor2", "motor3", "motor4"]
NUMBERS = [0.1, 0.2, 0.3, 0.4]
QOS = qos(BY_NAME["motor_states"])
SETTLE = 1.0  # s at the start that are ignored
WAYS = ("one process", "two processes")


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
    connection.spin(lambda: not reader.is_alive())
    connection.close()


def measure_relay(way: str, length: float) -> tuple[float, float]:
    """p50 and p99 of the bare relay, s."""
    with ExitStack() as stack:
        if way == "two processes":
            child = subprocess.Popen([sys.executable, __file__], stdin=subprocess.PIPE)
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
        need = 0.5 * length / PERIOD
        end = time.perf_counter() + SETTLE + length
        connection.spin(lambda: time.perf_counter() > end and len(sender.latencies) > need)
        latencies = sorted(sender.latencies)
    return latencies[len(latencies) // 2], latencies[int(0.99 * len(latencies))]


def measure_stack(way: str, length: float) -> tuple[float, float]:
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
            connection: Connection = stack.enter_context(Composition(configuration))
        else:
            stack.enter_context(Processes(configuration))
            keep_apart(children())
            connection = stack.enter_context(Connection())
        listener = connection.add(Node("listener", context=connection.context))
        listener.create_subscription(DiagnosticArray, "/diagnostics", take, qos(BY_NAME["/diagnostics"]))
        connection.spin(lambda: len(reports) >= max(1, round(length)))
    return tuple(1e-6 * median(report[i] for report in reports) for i in (0, 1))


def round_trip(quick: bool) -> Values:
    """From a motor state to the motor current, driver to velocity_loop and back, and a bare relay of two hops.

    Both send a JointState of four motors every millisecond, on the same executor.  Two processes have a processor
    each: where the kernel moves them from one to the other, a round of either lasts 120 to 270 us as it happens.
    """
    length = 0.5 if quick else 2.0
    found = {}
    for way in WAYS:
        both = {RELAY: measure_relay(way, length), "": measure_stack(way, length)}
        for kind, latencies in both.items():
            found |= {f"{kind}{way}, {name}": 1e6 * one for name, one in zip(("p50", "p99"), latencies, strict=True)}
    return found


RELAY = "relay, "
ROUND_TRIP = Benchmark(
    round_trip,
    "state to current at 1 kHz [us]",
    (
        Ratio("one process, p50", RELAY + "one process, p50", 1.15, 0.9),
        Ratio("one process, p99", RELAY + "one process, p99"),
        Ratio("two processes, p50", RELAY + "two processes, p50", 1.05, 0.9),
        Ratio("two processes, p99", RELAY + "two processes, p99"),
    ),
    rounds=11,
)


LONGEST = 1200.0  # s, for one demonstration
SHORT = 3.0  # s, of another one


@contextmanager
def busy_loops(count: int) -> Iterator[None]:
    """That many processes that never rest, in the same session: the kernel groups what it is fair to by session."""
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def demonstration(folder: Path, name: str, options: list[str]) -> tuple[float, bool]:
    """Run `wam demo` in a process of its own: when it began, s since 1970, whether it passed and printed its result."""
    begin = time.time()
    done = subprocess.run(
        [sys.executable, "-P", "-m", "wam_cli.main", "demo", "--name", name, *options],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=LONGEST,
        check=False,
    )
    passed = "Result of the steps" in done.stdout and "the demonstration failed" not in done.stdout
    if not passed:  # a force that is off by more than a tenth is no failure here, but has an exit code, too
        print(done.stdout, done.stderr, sep="\n", file=sys.stderr)
    return begin, passed


def short_form(folder: Path) -> list[str]:
    """Options of a demonstration of some seconds, without a page in the browser, and polite to other programs."""
    (folder / "short.yaml").write_text(yaml.safe_dump(scenario(SHORT)), encoding="utf-8")
    polite, script = {"fifo_priority": 0, "niceness": 0}, str(folder / "short.yaml")
    values = {"/**": {"timing": polite}, "/**/scenario": {"script": script}}
    sections = {name: {"ros__parameters": value} for name, value in values.items()}
    (folder / "quick.yaml").write_text(yaml.safe_dump({"base": "wam", **sections}), encoding="utf-8")
    return ["--config", "quick.yaml", "--no-live"]


MOVED = 1e-3  # rad, of a joint since the first message


def kept(bag: Path) -> float:
    """Periods in time of a demonstration in realtime, per cent; also of one that a late node has braked or ended."""
    last = AnalysedRecording(read(bag)).loop[-1]
    missed, periods = (float(last.get(name, 0)) for name in ("missed periods", "periods"))
    return 100.0 * (1.0 - missed / periods) if periods else 0.0


def first_motion(folder: Path, name: str, options: list[str]) -> float:
    """Time from the start of `wam demo` until the arm's clock, seen from outside, is where a joint has moved, s."""
    with ThreadPoolExecutor(1) as pool, watched_clock() as (executor, seen):
        playing = pool.submit(demonstration, folder, name, options)
        while not playing.done():
            executor.spin_once(timeout_sec=0.05)
    begin, _ = playing.result()
    states = read(folder / "bags" / name, topics=["/wam/joint_states"]).topics["/wam/joint_states"]
    assert isinstance(states, JointColumns)
    moved = np.abs(states.position - states.position[0]).max(axis=1) > MOVED
    stamp = int(states.stamp_ns[int(np.argmax(moved))])
    return next(at for at, shown in seen if shown >= stamp) - begin


KEPT, KEPT_LOADED = "periods kept, no other load [%]", "periods kept, 4 busy loops [%]"
START = "wam demo to first motion [s]"
BRAKED = "braked next to busy loops"


def real_time(quick: bool) -> Values:
    """Periods kept in realtime, without and with busy loops, if quick only with, and the start of `wam demo`."""
    with tempfile.TemporaryDirectory(prefix="wam_bench_") as name:
        folder = Path(name)
        short, found = short_form(folder), {}
        for row, loops in [(KEPT_LOADED, 1)] if quick else [(KEPT, 0), (KEPT_LOADED, 4)]:
            with busy_loops(loops):
                _, passed = demonstration(folder, f"beside_{loops}", [*(short if quick else []), "--realtime"])
            found[row] = kept(folder / "bags" / f"beside_{loops}")
        return {KEPT: found[row], **found, BRAKED: float(not passed), START: first_motion(folder, "start", short)}


REAL_TIME = Benchmark(
    real_time,
    "in real time",
    (Ratio(KEPT, "", 99.0, 99.7), Ratio(KEPT_LOADED, "", 98.0, 99.7), Ratio(BRAKED), Ratio(START, "", 2.0, 1.5)),
    rounds=5,
)


if __name__ == "__main__":
    relay_alone()
