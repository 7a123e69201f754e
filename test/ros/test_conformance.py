"""Drivers tested against the contract: the simulated one and the skeleton keep it, a broken one fails row by row."""

import math
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial, partialmethod
from pathlib import Path
from typing import Any

import pytest
from conftest import LONG
from ros_network import Network
from sensor_msgs.msg import JointState

from wam_cli.commands.conform import driver_alone, on_bus
from wam_cli.main import main
from wam_description.configuration import Configuration, packaged
from wam_description.driver_contract import REQUIREMENTS
from wam_description.event import Event, Level
from wam_description.signals import Answer, State
from wam_driver.bus.safety_module import SafetyMode
from wam_ros import conformance
from wam_ros.conformance import NOT_TESTED, OK, WRONG, conformance_row, conformance_rows
from wam_ros.driver_bench import DriverBench
from wam_ros.limits import CONFORMANCE_LIMITS
from wam_ros.node import make_node

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
SHARE = 0.05  # of the periods in which a state comes, on a machine as busy as may be
PATIENT = 20


class Bench:
    """A driver and the probe in one process."""

    def __init__(self, ros: Network, folder: Path, configuration: Configuration, make: Any = None) -> None:
        self.ros, self._make = ros, make or partial(make_node, configuration.shared.nodes[0])
        file = folder / "parameters.yaml"
        file.write_text(configuration.text)
        self._arguments = ["--ros-args", "--params-file", str(file)]
        self.probe = DriverBench(configuration.shared, SHARE, 0.4, connection=ros)
        self.probe.end, self.probe.restart = lambda: ros.remove(self.driver), self.start
        self.start()

    def start(self) -> None:
        self.driver = self.ros.add(
            self._make(context=self.ros.context, namespace="/wam", cli_args=self._arguments, use_global_arguments=False)
        )


def simulated() -> Configuration:
    return driver_alone(Configuration.load(packaged("wam")))


def skeleton(monkeypatch: pytest.MonkeyPatch) -> Configuration:
    monkeypatch.syspath_prepend(str(EXAMPLES))
    return driver_alone(Configuration.load(EXAMPLES / "bus_driver.yaml"))


def wrong(bench: Bench, attempts: int = PATIENT) -> list[str]:
    return [row.text for row in conformance_rows(bench.probe, attempts) if row.verdict != OK]


ON_SOCKETS = ["--config", "barrett-wam4-bus", "--bus", "udp_multicast:239.74.163.46", "--arm", "200"]


@pytest.mark.slow
@pytest.mark.parametrize("driver", [[], ON_SOCKETS], ids=["simulated", "arm in another process"])
def test_a_driver_keeps_the_contract_as_a_process_of_its_own(domain_id: int, driver: list[str]) -> None:
    command = [sys.executable, "-P", "-m", "wam_cli.main", "conform", "--share", str(SHARE), "--attempts", str(PATIENT)]
    command += driver
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=10 * LONG)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{len(REQUIREMENTS)} ok, 0 WRONG, 0 not tested" in done.stdout


class Heldup:
    """A probe that pauses, or not."""

    longest_pause = 0.0

    def be_proper(self) -> None:
        """Nothing to end."""


@pytest.mark.parametrize(("pause", "tries", "verdict"), [(0.001, 2, WRONG), (1.0, 6, NOT_TESTED)])
def test_an_attempt_that_the_computer_held_up_does_not_count(
    pause: float, tries: int, verdict: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    probe: Any = Heldup()
    made = []

    def check() -> str:
        made.append(pause)
        probe.longest_pause = pause
        return "it is wrong"

    monkeypatch.setitem(conformance.CHECKS, "rate", lambda bench: check())
    row = conformance_row(probe, "rate", 2)
    assert (row.verdict, len(made)) == (verdict, tries)
    assert ("delayed the test" in row.found) == (verdict == NOT_TESTED)


@pytest.mark.slow
def test_the_current_that_holds_a_heavy_arm_up_is_not_taken_for_one_that_was_refused(
    ros: Network, tmp_path: Path
) -> None:
    configuration = driver_alone(Configuration.load(packaged("barrett-wam7")))
    bench = Bench(ros, tmp_path, configuration)
    ros.wait(lambda: max(map(abs, bench.probe.carrying)) > 0.6, what="A, in motor 4 at the start")
    found = [conformance_row(bench.probe, key, PATIENT) for key in ("refusals", "answers")]
    assert [row.text for row in found if row.verdict != OK] == []


@pytest.mark.slow
def test_the_driver_of_a_real_arm_with_seven_joints_keeps_the_contract(ros: Network, tmp_path: Path) -> None:
    loaded = on_bus(Configuration.load(packaged("barrett-wam7-bus")), "simulated:60")
    assert wrong(Bench(ros, tmp_path, driver_alone(loaded))) == []


def test_the_driver_of_a_real_arm_states_what_a_person_has_to_do_and_which_fault_there_is(
    ros: Network, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    loaded = on_bus(Configuration.load(packaged("barrett-wam4-bus")), "simulated:200")
    driver = Bench(ros, tmp_path, driver_alone(loaded)).driver
    bus = driver.hardware._line
    bus.is_attended = False

    def wait_for(text: str, level: Level) -> None:
        ros.wait(lambda: text in driver.health.status.message and driver.health.status.level is level, what=text)

    bus.switch(SafetyMode.ESTOP)
    wait_for("press Shift-Idle", Level.WARN)
    assert not driver.hardware.confirm_home()
    bus.switch(SafetyMode.IDLE)
    wait_for("call confirm_home", Level.WARN)
    assert "put the arm at its home pose, 0, -2, 0, 3.13 rad, hold" in driver.enable().message
    exchange, publish, published = driver.hardware.exchange, driver._publish, list[int]()
    driver.hardware.exchange = lambda periods: time.sleep(0.01) or exchange(periods)  # as the start of a real arm
    driver._publish = lambda periods: published.append(periods) or publish(periods)
    assert driver.hardware.confirm_home()
    wait_for("press Shift-Activate", Level.WARN)
    ros.wait(lambda: driver.hardware.is_running)
    assert not driver.health.is_ready, "a scenario waits"
    ros.wait(lambda: published)
    assert published[0] == 1, "nothing before the first state"
    driver.hardware.exchange = exchange
    bus.switch(SafetyMode.ACTIVE)
    ros.wait(lambda: not driver.unready and driver.health.is_ready)
    bus.on_line = lambda frame: [] if frame.sender == 2 else [frame]
    wait_for("motor controller 2 sends no position", Level.ERROR)
    console = capfd.readouterr().err
    assert "fault, only the windings of the motors brake, and the arm sinks; when its cause is gone: wam" in console
    assert "brakes" not in console + driver.disable().message + driver.estop().message
    assert console.rindex("Shift-Activate") < console.rindex("sends no position"), "not while a fault is latched"


@pytest.mark.parametrize(("name", "limit", "quantity"), [
    ("driver:tip_speed_limit", 0.02, "speed of the tip"),
    ("arm.joints.speed_limit", [0.02, 1.0, 1.0, 1.0], "speed of joint1"),
    ("arm.joints.lower", [-0.02, -2.0, -2.8, -0.9], "travel of joint1"),
])  # fmt: skip
def test_a_real_arm_stops_above_a_limit(ros: Network, tmp_path: Path, name: str, limit: Any, quantity: str) -> None:
    loaded = on_bus(Configuration.load(packaged("barrett-wam4-bus")), "simulated:200")
    driver = Bench(ros, tmp_path, driver_alone(loaded.with_values({name: limit}))).driver

    def has_stopped() -> bool:
        driver.command(driver.stamp, [0.5, 0.0, 0.0, 0.0])
        stopped = any(str(event.values.get("quantity", "")).startswith(quantity) for event in driver.safety.events)
        if not (stopped or driver.unready):
            driver.reset_fault()  # where a busy computer was late
            driver.enable()
        return stopped

    ros.wait(has_stopped)
    assert not driver.hardware._cycle.is_released


@pytest.mark.slow
def test_the_skeleton_keeps_the_contract(ros: Network, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert wrong(Bench(ros, tmp_path, skeleton(monkeypatch))) == []


def test_commanded_torques_are_currents_of_an_arm_with_a_torque_constant_of_one() -> None:
    motors = simulated().with_values({"arm.motors.torque_constant": [1.0] * 4}).shared.arm.motors
    assert motors.peak_current == motors.peak_torque


def test_without_a_driver_no_row_but_the_interface_is_tested(
    ros: Network, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    short = replace(CONFORMANCE_LIMITS, start=0.05, look=0.05, service_wait=0.05)
    for module in ("driver_bench", "conformance"):
        monkeypatch.setattr(f"wam_ros.{module}.CONFORMANCE_LIMITS", short)
    bench = Bench(ros, tmp_path, simulated(), lambda **given: ros.node("nobody"))
    rows = list(conformance_rows(bench.probe, 1))
    assert [row.key for row in rows] == list(REQUIREMENTS)
    assert {row.verdict for row in rows[1:]} == {NOT_TESTED}
    assert rows[0].verdict == WRONG
    assert "motor_states" in rows[0].found


def test_without_a_driver_that_runs_the_command_says_how_to_start_one(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], domain_id: int
) -> None:
    monkeypatch.setattr(DriverBench, "wait", partialmethod(DriverBench.wait, seconds=0.1))
    with pytest.raises(SystemExit):
        main(["conform", "--running", "--config", "barrett-wam4-bus", "--namespace", "left"])
    text = "no driver publishes /left/motor_states; start the driver alone: wam node driver --config barrett-wam4-bus"
    assert text in capfd.readouterr().err


def test_a_driver_that_ends_ends_the_test(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], domain_id: int
) -> None:
    monkeypatch.setattr("wam_cli.commands.conform.set_priority", lambda *wanted: "")
    with pytest.raises(SystemExit):
        main(["conform", "--config", "barrett-wam4-bus", "--bus", "nowhere:can0"])
    assert "the driver has ended, with exit code 1" in capfd.readouterr().err


class Broken:
    """Defects of the skeleton, one of which can be chosen while it runs."""

    defect = ""

    def __init__(self, **ros: Any) -> None:
        super().__init__(**ros)
        self.create_subscription(JointState, "motor_current_command", self._take_anything, 10)
        self._whole_publish, self._whole_status = self.outlets.publish, self.health.publish
        self.outlets.publish, self.health.publish = self._send, self._send_status

    def _send(self, topic: str, stamp: int, value: Any) -> None:
        change = {
            ("arrays", "motor_states"): lambda state: state._replace(velocity=[]),
            ("velocity", "motor_states"): lambda state: state._replace(velocity=[*map(math.degrees, state.velocity)]),
            ("current", "motor_currents"): lambda state: State([], [], [1e3 * current for current in state.effort]),
        }.get((self.defect, topic), lambda state: state)
        if (self.defect, topic) != ("outer", "/clock"):
            self._whole_publish(topic, stamp, change(value))

    def _send_status(self, status: Any) -> None:
        self._whole_status(status._replace(session=0) if self.defect == "status" else status)

    @property
    def stamp(self) -> int:
        return super().stamp + (self.defect == "stamps")

    def _take_anything(self, message: Any) -> None:
        if self.defect in ("names", "refusals", "answers", "repetition"):
            self.hardware.command([*message.effort, *[0.0] * 4][:4])
            self._command_stamp, self._came = self.stamp, time.perf_counter()
        if self.defect == "braked":
            self.hardware.current = list(message.effort)

    def _take_currents(self, stamp: int, command: State) -> None:
        if self.defect not in ("names", "answers"):
            super()._take_currents(stamp, command)

    def _publish(self, due: int) -> None:
        if self.defect != "rate" or self._tick % 40 == 0:
            super()._publish(due)

    def _run(self) -> None:
        # no other defect needs a watchdog, which a busy machine would trip; that of repetition is one by arrival alone
        self._watchdog = 0.5 if self.defect == "repetition" else 1e9
        super()._run()

    def enable(self) -> Answer:
        if self.defect == "fault":
            self.safety.reset_fault()
        if self.defect == "silence":
            return self.safety.enable("")
        answer = super().enable()
        if self.defect == "discard":
            self.hardware.command([1.0] * 4)
        return answer

    def disable(self) -> Answer:
        return Answer(True, "braked") if self.defect == "disable" else super().disable()

    def estop(self) -> Answer:
        return Answer(True, "fault") if self.defect == "estop" else super().estop()

    def take_problem(self, problem: Event | None) -> None:
        if self.defect not in ("claims", "agreement"):
            super().take_problem(problem)

    def take_status(self, status: Any) -> None:
        if self.defect != "peers":
            super().take_status(status)


def broken_driver(**ros: Any) -> Any:
    from bus_driver import OwnDriver

    return type("BrokenDriver", (Broken, OwnDriver), {})(**ros)


@pytest.mark.slow
def test_a_broken_driver_fails_row_by_row(ros: Network, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(ros, tmp_path, skeleton(monkeypatch), broken_driver)
    driver = bench.driver

    def reborn() -> None:
        driver.session.number -= 1

    bench.probe.end, bench.probe.restart = lambda: None, reborn
    assert conformance_row(bench.probe, "interface", 1).verdict == OK
    verdicts = {}
    for key in list(REQUIREMENTS)[1:]:
        driver.defect = key
        driver.health.publish_again()  # a status is sent as it is until the next one
        for _ in range(PATIENT):
            verdicts[key] = conformance_row(bench.probe, key, 1).verdict
            was_held_up = bench.probe.longest_pause > CONFORMANCE_LIMITS.pause  # which brakes any driver
            if verdicts[key] == WRONG or (verdicts[key] == OK and not was_held_up):
                break
        driver.defect = ""
        driver.health.publish_again()
        driver.hardware = driver.make_hardware(driver.shared, None)  # a NaN stays in it
    assert verdicts == dict.fromkeys(verdicts, WRONG)
