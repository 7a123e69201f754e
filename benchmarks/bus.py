"""The driver of a real arm on its bus: its cost next to python-can alone, and its late cycles."""

import math
import time
from itertools import count
from statistics import median
from typing import Any

import can
from bench import Benchmark, Ratio, Values
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from wam_cli.commands.conform import driver_alone, on_bus
from wam_description.configuration import Configuration, packaged
from wam_driver.bus import frames, properties
from wam_driver.bus.arm_bus import ArmBus
from wam_driver.bus.bus_parameters import BusParameters
from wam_driver.bus.frames import SAFETY, BusGroup, Frame
from wam_driver.bus.line import CanLine
from wam_driver.bus.safety_module import SafetyMode
from wam_driver.bus.simulator import SimulatedBus
from wam_ros.bring_up import NodeProcess
from wam_ros.run import Connection

CONFIGURATION = on_bus(Configuration.load(packaged("barrett-wam4-bus")), "simulated:200")
FIRMWARE, PERIOD, POLL = 200, CONFIGURATION.shared.timing.period, 10  # of these periods one requests the modes
SENDER = 0x3E0  # of an identifier; 0 is the host
QUEUE, BARE_QUEUE = "driver on virtual", "python-can on virtual"
SOCKETS, BARE_SOCKETS = "driver on udp_multicast", "python-can on udp_multicast"
LATE = "late cycles at 500 Hz [%]"


def message(frame: Frame) -> can.Message:
    """As python-can has it."""
    return can.Message(arbitration_id=frame.identifier, data=frame.data, is_extended_id=False)


def drain(bus: can.BusABC) -> None:
    """Drop what a bus has received."""
    while bus.recv(0.0):
        pass


def cost(chunks: int, interface: str, channel: str) -> tuple[float, float]:
    """Processor time of a cycle of four controllers, us, and of the bare loop, without that of their answers."""
    host, arm = list[Any](can.Bus(interface=interface, channel=channel) for _ in range(2))
    begin, send = 0, host.send
    arm_of_start = SimulatedBus(CONFIGURATION.shared, CONFIGURATION.node("driver", BusParameters), FIRMWARE)
    driver = ArmBus(arm_of_start, CONFIGURATION.shared.arm, PERIOD, CONFIGURATION.shared.arm.joints.start)
    while not driver.is_running:
        driver.exchange()
    numbers, of_safety = properties.numbers(FIRMWARE), properties.numbers(FIRMWARE, True)
    counts = enumerate((round(angle / math.tau * 4096) for angle in driver.state.position), 1)
    answers: dict[tuple[int, bytes], list[Frame]] = {
        frames.get(SAFETY, of_safety["PEN"]): [frames.reply(SAFETY, of_safety["PEN"], 3 << 26)],
        frames.get(SAFETY, numbers["MODE"]): [frames.reply(SAFETY, numbers["MODE"], SafetyMode.ACTIVE)],
        frames.get(BusGroup.MOTORS, numbers["MODE"]): [frames.reply(at, numbers["MODE"], 2) for at in range(1, 5)],
        frames.get(BusGroup.MOTORS, numbers["P"]): [frames.position(at, count) for at, count in counts],
    }
    questions = [Frame(*question) for question in answers]
    torques = frames.torques(BusGroup.ARM, numbers["T"], [100, -100, 100, -100])

    def answered(question: can.Message, timeout: float) -> None:
        nonlocal begin
        send(question, timeout)
        before = time.thread_time_ns()
        for answer in answers.get((question.arbitration_id, bytes(question.data)), ()):
            arm.send(message(answer))
        begin += time.thread_time_ns() - before

    def bare(tick: int) -> None:
        missing = 0
        for frame in questions[0 if tick % POLL == 0 else -1 :]:
            host.send(message(frame), 0.0)
            missing += len(answers[frame])
        while missing:
            found = host.recv(0.01)
            missing -= bool(found and found.arbitration_id & SENDER)  # not an echo
        host.send(message(torques), 0.0)

    clock = count(arm_of_start.now() + PERIOD, PERIOD)
    at = [next(clock)]
    line = CanLine(host, time, 0.1 * (interface == "udp_multicast"))
    own = driver._host
    driver._line = own.line = line
    host.send, own.now = answered, lambda: at[0]

    def driven(tick: int) -> None:
        driver.exchange()
        driver.command([0.1, -0.1, 0.1, -0.1])

    loops = driven, bare
    spent: tuple[list[int], list[int]] = ([], [])
    driver.brake(False)
    # the modes are requested at the first tick of a chunk: what is left after the last one is lost
    driver._cycle._poll_at, driver._cycle._is_answered = 0.0, True
    for _ in range(chunks):
        for loop, times in zip(loops, spent, strict=True):
            times.append(0)
            for tick in range(POLL):
                at[0] = next(clock)
                begin = time.thread_time_ns()
                loop(tick)
                times[-1] += time.thread_time_ns() - begin
                drain(arm)
            drain(host if loop is bare else arm)  # of the echo of the last torques
    if driver.trouble:
        raise RuntimeError(driver.trouble)
    host.shutdown()
    arm.shutdown()
    return median(spent[0]) / POLL / 1e3, median(spent[1]) / POLL / 1e3


def late(seconds: float) -> float:
    """Periods of 2 ms that the node of the driver leaves out, in percent, with the simulated arm in its process."""
    configuration = driver_alone(CONFIGURATION)
    reports: list[tuple[float, float]] = []

    def take(report: DiagnosticArray) -> None:
        facts = {pair.key: pair.value for pair in report.status[0].values}
        if "late periods" in facts and "steps" in facts:
            reports.append((float(facts["late periods"]), float(facts["steps"])))

    connection = Connection()
    listener = Node("listener", context=connection.context)
    connection.add(listener)
    listener.create_subscription(DiagnosticArray, "/diagnostics", take, 10)
    driver = NodeProcess(configuration, configuration.shared.nodes[:1], "wam")
    try:
        while len(reports) < seconds + 2.0:  # the first two are those of the start
            connection.executor.spin_once(timeout_sec=0.1)
    finally:
        driver.close()
        connection.close()
    (missed, steps), (all_missed, all_steps) = reports[1], reports[-1]
    return 100.0 * (all_missed - missed) / (all_missed - missed + all_steps - steps)


def bus(quick: bool) -> Values:
    """A cycle of the driver and the bare loop, on a queue and on sockets; and the late cycles of its node."""
    chunks = 20 if quick else 200
    queue, sockets = cost(chunks, "virtual", "cost"), cost(chunks, "udp_multicast", "239.74.163.48")
    found = dict(zip((QUEUE, BARE_QUEUE, SOCKETS, BARE_SOCKETS), (*queue, *sockets), strict=True))
    return {**found, LATE: late(2.0 if quick else 10.0)}


BUS = Benchmark(
    bus,
    "a cycle of a real arm's driver [us]",
    (Ratio(QUEUE, BARE_QUEUE, 2.0, 1.5), Ratio(SOCKETS, BARE_SOCKETS, 2.0, 1.5), Ratio(LATE, "", 1.0, 0.3)),
    rounds=5,
)
