"""The driver of a real arm on a simulated bus: its start, torques and positions, and injected faults by name."""

import math
import os
import random
import time
from collections.abc import Callable
from functools import cache

import can
import pytest

from wam_description.arm import Shared
from wam_description.configuration import Configuration, packaged
from wam_description.event_text import sentence
from wam_driver.bus import frames
from wam_driver.bus.arm_bus import ArmBus
from wam_driver.bus.bus_fault import BusFault
from wam_driver.bus.frames import BusGroup, Frame
from wam_driver.bus.line import CanLine, Line, answer
from wam_driver.bus.motor import Motor
from wam_driver.bus.safety_module import SafetyMode
from wam_driver.bus.simulator import SimulatedBus, SimulatedController
from wam_driver.bus.start_up import Wait
from wam_driver.driver import DriverParameters
from wam_driver.plant import Plant
from wam_driver.thresholds import BUS

PERIOD = 0.002
STOP = 0.050  # s of bus time, from a fault to zero torque
NEW, OLD, OLDEST = 200, 60, 40


@cache
def loaded(name: str) -> tuple[Shared, DriverParameters, Plant]:
    configuration = Configuration.load(packaged(name)).with_values({"timing.period": PERIOD, "timing.substeps": 4})
    shared, own = configuration.shared, configuration.node("driver", DriverParameters)
    return shared, own, Plant(shared.arm, own.world, own.effects, shared.timing.substep, own.friction)


class Served(CanLine):
    """A line of python-can, with the arm at its other end; both are in bus time."""

    def __init__(self, bus: SimulatedBus, interface: str, channel: str) -> None:
        is_multicast = interface == "udp_multicast"
        place = {"port": 20000 + os.getpid() % 10000} if is_multicast else {}  # that no other run on this computer uses
        own, other = (can.Bus(interface=interface, channel=channel, **place) for _ in range(2))
        super().__init__(own, time, 0.1 * is_multicast)
        self.now, self.sleep, self.let_pass = bus.now, bus.sleep, bus.let_pass
        self._bus_of_arm, self._end = bus, CanLine(other, time)

    def send(self, frame: Frame) -> bool:
        is_taken = super().send(frame)
        answer(self._end, self._bus_of_arm, 0.1)
        return is_taken

    def receive(self, timeout: float) -> Frame | None:
        if (frame := super().receive(0.2 if timeout else 0.01)) is None:  # by the kernel
            self.sleep(timeout)
        return frame


class Rig:
    """An arm, its simulated bus and the driver; the arm is carried by the torques of its links."""

    def __init__(
        self, name: str = "barrett-wam4", version: int = NEW, via: Callable[[SimulatedBus], Line] = lambda bus: bus
    ) -> None:
        self.shared, own, self.plant = loaded(name)
        self.plant.reset()
        arm = self.shared.arm
        self.bus = SimulatedBus(self.shared, own, version, self.plant)
        self.arm = ArmBus(via(self.bus), arm, PERIOD, arm.joints.start)
        self.currents = [0.1 + 0.05 * at for at in range(arm.n)]

    def start(self, most: float = 5.0) -> list[Wait]:
        """Until it runs or there is a fault; what was waited for."""
        waits, end = [], self.bus.now() + most
        while not self.arm.is_running and self.arm.trouble is None and self.bus.now() < end:
            self.arm.exchange()
            if self.arm.wait not in waits[-1:]:
                waits.append(self.arm.wait)
        return waits

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / PERIOD)):
            self.step()

    def step(self) -> None:
        self.arm.exchange()
        self.arm.command(self.currents)

    def enable(self) -> None:
        self.start()
        assert self.arm.trouble is None
        self.run(0.5)
        assert self.arm.wait is Wait.NOTHING
        self.arm.brake(False)


@pytest.mark.parametrize("version", [OLDEST, OLD, NEW])
@pytest.mark.parametrize("name", ["barrett-wam4", "barrett-wam7"])
def test_the_arm_starts_and_follows_torques_with_any_firmware(name: str, version: int) -> None:
    rig = Rig(name, version)
    assert rig.start() == [Wait.WAKE, Wait.ACTIVATE]
    assert rig.arm.state.position == pytest.approx(rig.plant.theta, abs=0.05)
    rig.run(0.1)
    assert not any(rig.bus.commanded)
    rig.run(0.4)
    assert (rig.arm.wait, rig.arm.trouble) == (Wait.NOTHING, None)
    assert not any(rig.bus.commanded), "active, not released"
    rig.arm.brake(False)
    rig.run(0.02)
    motors = rig.shared.arm.motors
    torque = [i * k for i, k in zip(rig.currents, motors.torque_constant, strict=True)]
    assert rig.bus.torque == pytest.approx(torque, abs=1.0 / 2700)
    assert rig.arm.state.effort == pytest.approx(rig.currents, abs=1.0 / 1000)
    rig.arm.brake(True)
    assert not any(rig.bus.commanded)
    rig.run(0.1)
    assert rig.arm.state.position == pytest.approx(rig.plant.theta, abs=0.05)
    assert not any(rig.arm.state.effort)


@pytest.mark.parametrize(
    ("interface", "channel"), [("virtual", "served"), ("udp_multicast", "239.74.163.47")], ids=["virtual", "multicast"]
)
def test_the_arm_is_reached_over_a_bus_of_python_can(interface: str, channel: str) -> None:
    rig = Rig(via=lambda bus: Served(bus, interface, channel))
    rig.enable()
    rig.run(0.05)
    # before the end: the idle arm moves on until its thread ends
    assert rig.arm.state.position == pytest.approx(rig.plant.theta, abs=0.2)
    rig.arm.close()
    assert rig.arm.trouble is None
    assert rig.arm.counts["lost replies"] == rig.arm.counts["other frames"] == 0


def test_velocities_are_those_of_the_motors() -> None:
    rig = Rig()
    rig.enable()
    rig.run(0.1)
    assert max(map(abs, rig.plant.thetad)) > 2.0
    assert rig.arm.state.velocity == pytest.approx(rig.plant.thetad, abs=0.2 * max(map(abs, rig.plant.thetad)))


def test_a_late_period_is_no_jump_of_a_motor_that_moves() -> None:
    motor = Motor(1, 4096, 1.0, 1)
    assert [motor.take(count, time) for count, time in ((0, 0.0), (1400, 0.1), (2800, 0.102))] == [True, True, False]
    assert motor.velocity == pytest.approx(math.tau * 1400 / 4096 / 0.1)


def test_in_estop_the_start_waits_for_shift_idle_and_for_a_person_at_home() -> None:
    rig = Rig()
    rig.bus.is_attended = False
    rig.bus.switch(SafetyMode.ESTOP)
    rig.plant.brake(True)  # the person holds it
    assert rig.start(1.0) == [Wait.IDLE]
    rig.bus.switch(SafetyMode.IDLE)
    assert rig.start(3.0)[-1] is Wait.HOME
    assert not rig.arm.is_running
    assert rig.arm.confirm_home()
    assert rig.start()[-1] is Wait.ACTIVATE
    rig.run(0.1)
    assert rig.arm.state.position == pytest.approx(rig.plant.theta, abs=0.05)
    assert not rig.arm.confirm_home()


@pytest.mark.parametrize("version", [OLDEST, OLD, NEW])
def test_the_zero_is_lost_with_the_counts_of_one_controller(version: int) -> None:
    rig = Rig(version=version)
    rig.bus.is_attended = False
    rig.plant.brake(True)  # the person holds it
    assert rig.start()[-1] is Wait.ACTIVATE
    rig.bus.controllers[3].values.update(STAT=0, P=3000)
    rig.arm.begin()
    assert rig.start(2.0)[-1] is Wait.HOME
    assert rig.arm.advice.endswith("lost their position: 3")
    rig.arm.begin()  # it is awake now, and still without its counts
    assert rig.start(2.0)[-1] is Wait.HOME
    rig.bus.switch(SafetyMode.ACTIVE)
    rig.arm.brake(False)
    rig.step()
    assert not any(rig.bus.commanded)
    rig.bus.switch(SafetyMode.IDLE)
    rig.arm.confirm_home()
    assert rig.start()[-1] is Wait.ACTIVATE
    rig.run(0.1)
    assert rig.arm.state.position == pytest.approx(rig.plant.theta, abs=0.05)


def test_torques_are_clipped_where_the_arm_and_its_safety_module_clip_them() -> None:
    rig = Rig("barrett-wam7")
    rig.enable()
    rig.currents = [1e3, -1e3] * 3 + [1e3]
    rig.step()
    sent = [rig.bus.controllers[node].values["T"] for node in range(1, 8)]
    assert sent == [4731, -4731, 4731, -4320, 3900, -3900, 1600]


def test_idle_motors_let_the_arm_sink_slowly_and_are_released_at_any_time() -> None:
    rig = Rig()
    rig.enable()
    rig.arm.brake(True)
    rig.run(1.0)
    assert 0.01 < max(map(abs, rig.plant.qd)) < 0.6
    for at in range(16):  # what answers a request from before the change is no fault
        rig.arm.brake(at % 2 == 1)
        rig.run((1 + at) * PERIOD)
    assert rig.arm.trouble is None


def test_lost_and_late_frames_are_no_fault_while_they_are_rare_nor_taken_for_others() -> None:
    rig, draw = Rig(), random.Random(47)
    rig.enable()
    for share, seconds in ((0.02, 0.15), (1.0, PERIOD), (0.0, 0.0)):
        rig.bus.on_line = lambda frame, share=share: [] if draw.random() < share and frame.sender else [frame]
        rig.run(seconds)
    assert rig.arm.counts["lost replies"] > 0
    each = enumerate(rig.plant.theta, 1)
    rig.bus._queue.extend(frames.position(at, round(angle / math.tau * 4096)) for at, angle in each)
    rig.run(0.03)
    assert rig.arm.trouble is None
    assert rig.arm.state.position == pytest.approx(rig.plant.theta, abs=1e-3 * max(map(abs, rig.plant.thetad)))


Inject = Callable[[Rig, random.Random], None]


def motor(rig: Rig, draw: random.Random) -> int:
    return draw.randint(1, len(rig.currents))


def setting(value: int, *names: str, node: int = 0) -> Inject:
    """Properties of a node, or of a motor controller that is drawn, have another value."""

    def inject(rig: Rig, draw: random.Random) -> None:
        rig.bus.controllers[node or motor(rig, draw)].values.update(dict.fromkeys(names, value))

    return inject


def on_line(change: Callable[[Rig, int], Callable[[Frame], list[Frame]]]) -> Inject:
    def inject(rig: Rig, draw: random.Random) -> None:
        rig.bus.on_line = change(rig, motor(rig, draw))

    return inject


def silence(nodes: Callable[[int], bool]) -> Inject:
    """Frames of some of the nodes are lost."""
    return on_line(lambda rig, chosen: lambda frame: [] if frame.sender and nodes(frame.sender) else [frame])


def silent_motor(rig: Rig, chosen: int) -> Callable[[Frame], list[Frame]]:
    return lambda frame: [] if frame.sender == chosen else [frame]


def doubled(rig: Rig, chosen: int) -> Callable[[Frame], list[Frame]]:
    return lambda frame: [frame] * (1 + (frame.sender == chosen))


def jumping(rig: Rig, chosen: int) -> Callable[[Frame], list[Frame]]:
    def pass_on(frame: Frame) -> list[Frame]:
        found = frames.read(frame)
        if found and found.number is None and found.node == chosen:
            return [frames.position(chosen, found.value + 5000)]
        return [frame]

    return pass_on


def stuck_asleep(rig: Rig, chosen: int) -> Callable[[Frame], list[Frame]]:
    rig.bus.controllers[chosen].values["STAT"] = 0
    return lambda frame: [] if frame.identifier == chosen and len(frame.data) == 6 else [frame]


def second_host(rig: Rig, chosen: int) -> Callable[[Frame], list[Frame]]:
    """It asks for positions, too: all are answered twice."""
    request = frames.get(BusGroup.MOTORS, 48)
    return lambda frame: [request] * (frame.sender == 1) + [frame] * (1 + (frame.receiver == BusGroup.POSITIONS))


def cut_short(rig: Rig, chosen: int) -> Callable[[Frame], list[Frame]]:
    return lambda frame: [Frame(frame.identifier, frame.data[: 2 if frame.sender == chosen else 8])]


def refused(seconds: float) -> Inject:
    """The adapter takes no frames for a time."""

    def inject(rig: Rig, draw: random.Random) -> None:
        end = rig.bus.now() + seconds

        def refuse(frame: Frame) -> list[Frame] | None:
            return None if not frame.sender and rig.bus.now() < end else [frame]

        rig.bus.on_line = refuse

    return inject


def estop_as_it_starts(rig: Rig, draw: random.Random) -> None:
    def press_it(frame: Frame) -> list[Frame]:
        if frame == frames.get(1, 0):
            press(SafetyMode.ESTOP)(rig, draw)
        return [frame]

    rig.bus.on_line = press_it


def power_off(rig: Rig, draw: random.Random) -> None:
    rig.bus.switch(SafetyMode.ESTOP)
    rig.bus.is_attended = False
    rig.bus.on_line = lambda frame: [] if frame.sender else [frame]


def extra_motor(rig: Rig, draw: random.Random) -> None:
    rig.bus.controllers[5] = SimulatedController(5, NEW)


def press(button: SafetyMode, *faulty: str) -> Inject:
    def inject(rig: Rig, draw: random.Random) -> None:
        rig.bus.is_attended = False
        rig.bus.switch(button, *faulty)

    return inject


def remove(choose: Callable[[Rig, random.Random], int]) -> Inject:
    return lambda rig, draw: rig.bus.controllers.pop(choose(rig, draw)) and None


def firmware(version: int) -> Inject:
    def inject(rig: Rig, draw: random.Random) -> None:
        at = draw.randint(2, len(rig.currents))
        rig.bus.controllers[at] = SimulatedController(at, version)

    return inject


SEEDS = [*range(2), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 5))]
AT_START: dict[str, tuple[Inject, BusFault]] = {
    "no safety module": (remove(lambda rig, draw: 10), BusFault.NO_SAFETY_MODULE),
    "missing controller": (remove(motor), BusFault.MISSING),
    "one controller too many": (extra_motor, BusFault.UNKNOWN_NODE),
    "another kind of node": (setting(5, "ROLE"), BusFault.NOT_MOTOR),
    "firmware that is too old": (firmware(20), BusFault.FIRMWARE),
    "two firmwares": (firmware(55), BusFault.MIXED_FIRMWARE),
    "stays asleep": (on_line(stuck_asleep), BusFault.NOT_AWAKE),
    "wrong counts": (setting(1024, "CTS"), BusFault.COUNTS),
    "wrong gain": (setting(500, "IPNM"), BusFault.GAIN),
    "no torque": (setting(0, "MT"), BusFault.LIMIT),
    "no torque by the safety module": (setting(0, "TL1", node=10), BusFault.LIMIT),
    "wrong index": (setting(9, "PIDX"), BusFault.INDEX),
    "wrong group": (setting(5, "GRPC"), BusFault.INDEX),
    "E-stop as it starts": (estop_as_it_starts, BusFault.ESTOP),
    "full queue at the start": (refused(math.inf), BusFault.NOT_SENT),
}  # fmt: skip
RUNNING: dict[str, tuple[Inject, BusFault]] = {
    "silent controller": (on_line(silent_motor), BusFault.NO_REPLY),
    "reset controller": (setting(0, "STAT", "MODE", "T"), BusFault.RESET),
    "cut bus": (silence(lambda node: node <= 7), BusFault.ALL_SILENT),
    "power loss": (power_off, BusFault.NO_POWER),
    "E-stop": (press(SafetyMode.ESTOP), BusFault.ESTOP),
    "idle by the person": (press(SafetyMode.IDLE), BusFault.SAFETY_IDLE),
    "torque limit": (setting(1, "TL2", node=10), BusFault.SAFETY_IDLE),
    "velocity limit": (setting(1, "VL2", node=10), BusFault.SAFETY_IDLE),
    "silent safety module": (silence(lambda node: node == 10), BusFault.SAFETY_SILENT),
    "idle controller": (setting(0, "MODE"), BusFault.CONTROLLER_IDLE),
    "doubled node": (on_line(doubled), BusFault.DOUBLED),
    "jumping encoder": (on_line(jumping), BusFault.JUMP),
    "second host": (on_line(second_host), BusFault.FOREIGN),
    "positions cut short": (on_line(cut_short), BusFault.NO_REPLY),
    "full queue": (refused(0.03), BusFault.NOT_SENT),
}


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", AT_START)
def test_an_arm_that_is_not_right_is_refused_by_name(kind: str, seed: int) -> None:
    inject, fault = AT_START[kind]
    rig = Rig()
    inject(rig, random.Random(seed))
    rig.start()
    assert rig.arm.trouble is not None
    assert rig.arm.trouble.cause == fault
    rig.arm.brake(False)
    rig.step()
    assert not any(rig.bus.commanded)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", RUNNING)
def test_a_fault_of_the_bus_is_named_and_ends_the_torque(kind: str, seed: int) -> None:
    inject, fault = RUNNING[kind]
    rig, draw = Rig(), random.Random(seed)
    rig.enable()
    rig.run(0.02 + 0.03 * draw.random())
    assert all(rig.bus.commanded)
    inject(rig, draw)
    begun = last = rig.bus.now()
    while rig.bus.now() < begun + 0.15:
        before = rig.bus.now()
        rig.step()
        assert rig.bus.now() - before < BUS.silent, "another request to the node waits no longer"
        last = rig.bus.now() if any(rig.bus.commanded) else last
    assert rig.arm.trouble is not None
    assert rig.arm.trouble.cause == fault
    assert last - begun <= STOP
    assert not any(rig.arm.state.effort)
    if "limit" in kind:
        assert f"fault of the {kind.split()[0]}" in sentence(rig.arm.trouble)


def test_an_adapter_that_takes_nothing_more_is_stopped_by_the_heartbeat() -> None:
    rig = Rig()
    rig.enable()
    rig.run(0.02)
    refused(math.inf)(rig, random.Random(0))
    begun = last = rig.bus.now()
    while rig.bus.now() < begun + 0.3:
        rig.step()
        last = rig.bus.now() if any(rig.bus.commanded) else last
    assert rig.arm.trouble is not None
    assert rig.arm.trouble.cause == BusFault.NOT_SENT
    assert last - begun <= 0.11


@pytest.mark.parametrize("periods", [3, 6, 9])
def test_an_estop_is_explained_at_any_time(periods: int) -> None:
    rig = Rig()
    rig.enable()
    rig.run(periods * PERIOD)
    press(SafetyMode.ESTOP, "heartbeat")(rig, random.Random(0))
    rig.run(0.03)
    assert rig.arm.trouble is not None
    assert "a fault of the heartbeat" in sentence(rig.arm.trouble)


def test_the_torque_ends_before_the_driver_asks_why() -> None:
    rig, sent = Rig(), list[Frame]()
    rig.enable()
    rig.bus.on_line = lambda frame: [] if frame.sender == 2 else [*(sent.append(frame) or (frame,))]
    rig.run(0.02)
    why = sent.index(frames.get(2, 5))
    assert frames.put(BusGroup.MOTORS, 8, BUS.idle_mode) in sent[:why]


def test_a_controller_that_no_longer_states_its_mode_is_a_fault() -> None:
    rig = Rig()
    rig.enable()
    rig.bus.controllers[2].values["MODE"] = BUS.idle_mode
    rig.bus.on_line = lambda frame: [] if (frame.sender, frame.receiver) == (2, BusGroup.VALUES) else [frame]
    rig.run((BUS.attempts + 1) * BUS.poll + 2 * PERIOD)
    assert rig.arm.trouble is not None
    assert rig.arm.trouble.cause == BusFault.NO_MODE


def test_a_lost_wake_up_is_repeated() -> None:
    rig, lost = Rig(), list[Frame]()
    rig.bus.controllers[2].values["STAT"] = 0
    rig.bus.on_line = lambda frame: (
        [frame] if lost or frame != frames.put(2, 5, BUS.ready) else lost.append(frame) or []
    )
    assert rig.start()[-1] is Wait.HOME


@pytest.mark.parametrize(("is_idle", "seconds"), [(False, 0.05), (True, 0.5)])
def test_a_zero_that_a_jump_has_lost_is_set_again_also_by_the_next_driver(is_idle: bool, seconds: float) -> None:
    rig = Rig()
    rig.enable()
    rig.bus.switch(SafetyMode.IDLE if is_idle else SafetyMode.ACTIVE)
    rig.run(0.06)
    rig.bus.controllers[1].values["P"] += 2 * 4096
    rig.run(seconds)
    rig.arm.clear()
    for _ in range(2):
        assert rig.start(2.0)[-1] is Wait.HOME
        rig.arm.begin()


def test_at_its_end_the_driver_leaves_no_active_arm_without_a_heartbeat() -> None:
    rig = Rig()
    rig.enable()
    rig.bus.is_attended = False
    rig.arm.close()
    rig.bus.sleep(0.5)
    assert [rig.bus.controllers[10].values[name] for name in ("MODE", "ZERO")] == [SafetyMode.IDLE, 1]


def test_after_a_lost_controller_the_start_is_repeated() -> None:
    rig = Rig()
    rig.enable()
    on_line(silent_motor)(rig, random.Random(1))
    rig.run(0.02)
    assert rig.arm.trouble is not None
    rig.bus.on_line = lambda frame: [frame]
    rig.arm.clear()
    assert not rig.arm.is_running
    rig.enable()
    rig.run(0.02)
    assert all(rig.bus.commanded)
