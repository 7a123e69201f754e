"""How the driver's time passes, without ROS and on a false clock: paced, waiting, paused, late."""

from collections.abc import Callable
from dataclasses import replace

import pytest
from arms import CONFIGURATION

from wam_description.event import Level
from wam_description.interface import Interface
from wam_description.signals import NodeStatus
from wam_driver.driver import Driver, DriverParameters
from wam_driver.lockstep import Lockstep
from wam_driver.pacer import Pacer
from wam_driver.realtime import Realtime
from wam_driver.safety import Mode
from wam_driver.session import Session
from wam_driver.thresholds import DRIVER

MS = 1_000_000
HOLDING = [0.0] * 4
PARAMETERS = CONFIGURATION.node("driver", DriverParameters)


class FalseClock:
    """A clock that a test sets."""

    def __init__(self) -> None:
        self.time = 100.0

    def __call__(self) -> float:
        return self.time


def run(pacer: Pacer, clock: FalseClock, seconds: float, cost: Callable[[float], float]) -> int:
    """Periods that pass where each costs some time of the wall clock, and nothing is done while none is due."""
    end, count = clock.time + seconds, 0
    while clock.time < end:
        if pacer.is_due((count + 1) * MS):
            count += 1
            clock.time += cost(clock.time)
        else:
            clock.time += 1e-4
    return count


@pytest.mark.parametrize("factor", [0.25, 1.0, 3.0])
def test_simulated_time_is_never_ahead_of_the_wall_clock_times_the_factor(factor: float) -> None:
    clock = FalseClock()
    pacer = Pacer(factor, clock)
    begin = clock.time
    for stamp in range(MS, 500 * MS, MS):
        while not pacer.is_due(stamp):
            clock.time += 3.7e-5
        assert (stamp - MS) / 1e9 <= factor * (clock.time - begin) + 1e-9
    assert pacer.report()[0] == pytest.approx(factor, rel=1e-3)
    assert pacer.slips == 0


def test_without_a_pace_every_period_is_due_at_once() -> None:
    pacer = Pacer(0.0, FalseClock())
    assert all(pacer.is_due(stamp) for stamp in range(MS, 1000 * MS, MS))


def test_a_slow_machine_slows_the_arm() -> None:
    clock = FalseClock()
    pacer = Pacer(1.0, clock)
    count = run(pacer, clock, 2.0, lambda _: 0.002)
    assert count == pytest.approx(1000, abs=2)
    factor, behind = pacer.report()
    assert factor == pytest.approx(0.5, rel=0.01)
    assert behind <= DRIVER.slack + 0.0021
    assert pacer.slips > 900


def test_a_short_delay_is_made_up_for_and_of_a_long_one_no_more_than_the_slack() -> None:
    for delay, lost in ((0.9 * DRIVER.slack, 0.0), (10.0, 10.0 - DRIVER.slack)):
        clock = FalseClock()
        pacer = Pacer(1.0, clock)
        waits = iter([delay])
        count = run(pacer, clock, 1.0 + lost, lambda now, waits=waits: next(waits, 1e-4) if now > 100.5 else 1e-4)
        assert count == pytest.approx(1000, abs=3)
        assert (pacer.slips > 0) == (lost > 0.0)


def test_a_pause_is_not_made_up_for_and_does_not_count() -> None:
    clock = FalseClock()
    pacer = Pacer(1.0, clock)
    run(pacer, clock, 0.1, lambda _: 1e-4)
    clock.time += 60.0
    pacer.restart()
    assert pacer.is_due(101 * MS)
    assert not pacer.is_due(102 * MS)
    assert pacer.slips == 0
    assert pacer.passed[1] == pytest.approx(0.1, abs=0.002)


class Bench:
    """A driver in lockstep or realtime on a false clock; a list of the states that it published."""

    def __init__(self, mode: str, factor: float = 1.0, timeout: float = 1.5) -> None:
        timing = replace(CONFIGURATION.shared.timing, mode=mode, real_time_factor=factor, timeout=timeout)
        self.driver = Driver(replace(CONFIGURATION.shared, timing=timing), PARAMETERS)
        self.clock = FalseClock()
        self.sent: list[int] = []
        self.faults = ""  # of other nodes
        self.session, self.running = Session(["gravity", "velocity_loop"]), ["gravity", "velocity_loop"]

    def call_the_roll(self) -> None:
        for node in self.running:
            self.session.hear(NodeStatus(Level.OK, "running", node, session=self.session.number))

    def publish(self) -> None:
        self.sent.append(self.driver.stamp)

    def lockstep(self) -> Lockstep:
        found = Lockstep(
            self.driver,
            Interface(CONFIGURATION.shared),
            self.session,
            self.publish,
            self.call_the_roll,
            self.driver.safety.trip,
            self.clock,
            lambda: self.faults,
        )
        found.start()
        return found

    def realtime(self, late_periods: float = 0.05) -> Realtime:
        self.driver.parameters = replace(PARAMETERS, late_periods=late_periods)
        found = Realtime(self.driver, self.publish, self.clock)
        found.start()
        return found


def test_a_period_passes_when_the_state_is_answered_and_the_next_is_due() -> None:
    bench = Bench("lockstep")
    lockstep = bench.lockstep()
    lockstep.take_currents(1 * MS, HOLDING)
    assert bench.sent == [1 * MS, 2 * MS], "the first is due at once"
    lockstep.take_currents(2 * MS, HOLDING)
    assert bench.sent == [1 * MS, 2 * MS], "it is not due"
    bench.clock.time += 0.0011
    lockstep.go_on()
    assert bench.sent == [1 * MS, 2 * MS, 3 * MS]
    bench.clock.time += 0.0011
    lockstep.go_on()
    assert bench.sent == [1 * MS, 2 * MS, 3 * MS], "it is not answered"


STOPPED = [
    (["gravity", "velocity_loop"], "check that velocity_loop runs"),
    (["velocity_loop"], "gravity has stopped or is very slow; if it has stopped, start it, or 'wam up', again"),
    ([], "gravity, velocity_loop has stopped or is very slow; if it has stopped, start it, or 'wam up', again"),
    (["gravity"], FAULT := "gravity: it reports a fault"),
]


@pytest.mark.parametrize(("running", "advice"), STOPPED)
@pytest.mark.parametrize("is_enabled", [True, False], ids=["enabled", "braked"])
def test_an_answer_that_does_not_come_is_a_fault_by_name(is_enabled: bool, running: list[str], advice: str) -> None:
    bench = Bench("lockstep")
    bench.running, bench.faults = running, FAULT * (advice == FAULT)
    lockstep = bench.lockstep()
    if is_enabled:
        bench.driver.safety.enable("")
    begin = bench.clock.time
    while not bench.driver.safety.fault:
        bench.clock.time += DRIVER.watch
        lockstep.watch()
        assert bench.clock.time - begin < 2.0
    late = "lockstep: no motor_current_command for the state at 1000000 ns within 1.5 s"
    assert bench.driver.safety.fault == f"{late}; {advice}"
    assert bench.driver.currents == [0.0] * 4
    sent = len(bench.sent)
    bench.clock.time += DRIVER.watch
    lockstep.watch()
    assert len(bench.sent) == sent + 1, "time creeps, so that a node that was restarted is sent states"
    assert lockstep.obstacle() == f"no motor_current_command arrives; {advice}; then enable"
    lockstep.take_currents(bench.driver.stamp, HOLDING)
    assert lockstep.obstacle() == ""


def test_a_process_that_was_frozen_has_not_waited() -> None:
    bench = Bench("lockstep")
    lockstep = bench.lockstep()
    bench.clock.time += 60.0
    lockstep.watch()
    assert bench.driver.safety.fault == ""
    lockstep.take_currents(1 * MS, HOLDING)
    assert bench.sent == [1 * MS, 2 * MS]


def test_a_pause_is_no_missing_answer_and_a_step_is_one_period() -> None:
    bench = Bench("lockstep")
    lockstep = bench.lockstep()
    lockstep.pause(True)
    for _ in range(200):
        bench.clock.time += DRIVER.watch
        lockstep.watch()
    assert bench.driver.safety.fault == ""
    assert lockstep.step() == "still waiting for motor_current_command"
    lockstep.take_currents(1 * MS, HOLDING)
    assert bench.sent == [1 * MS]
    assert not lockstep.step()
    lockstep.take_currents(2 * MS, HOLDING)
    assert bench.sent == [1 * MS, 2 * MS]
    lockstep.pause(False)
    assert bench.sent == [1 * MS, 2 * MS, 3 * MS]
    assert lockstep.pacer.slips == 0


@pytest.mark.slow
def test_of_a_computer_that_is_too_slow_for_realtime_the_late_periods_are_named_until_they_are_rare() -> None:
    bench = Bench("realtime")
    realtime = bench.realtime()

    def play(ticks: int, every: int) -> None:
        for i in range(ticks):
            bench.clock.time += 0.002 if i % every == 0 else 0.001
            realtime.tick()

    assert realtime.lateness == ""
    play(2000, every=20)  # 100 of 2100
    assert realtime.lateness == ""
    play(1500, every=2)
    assert realtime.lateness.startswith("33.3 % of the newest periods were late; allowed: 5 %; ")
    play(2000, every=20)
    assert realtime.lateness == ""


def on_time(bench: Bench, realtime: Realtime, ticks: int, period: float = 1e-3) -> None:
    for _ in range(ticks):
        bench.clock.time += period
        realtime.tick()
        realtime.take_currents(bench.driver.stamp, HOLDING)


def test_periods_that_were_late_before_all_nodes_were_connected_keep_no_brakes_on() -> None:
    bench = Bench("realtime")
    realtime = bench.realtime()
    on_time(bench, realtime, 500, period=3e-3)
    assert realtime.obstacle() == "", "what is late at the start says nothing"
    assert realtime.settles()
    on_time(bench, realtime, 998)
    assert realtime.settles()
    on_time(bench, realtime, 2)
    assert not realtime.settles()
    assert realtime.obstacle() == ""


@pytest.mark.parametrize("is_enabled", [True, False], ids=["enabled", "braked"])
def test_a_driver_that_was_frozen_in_realtime_brakes_and_does_not_catch_up(is_enabled: bool) -> None:
    bench = Bench("realtime")
    realtime = bench.realtime()
    bench.clock.time += 0.001
    realtime.tick()
    realtime.take_currents(bench.driver.stamp, HOLDING)
    if is_enabled:
        bench.driver.safety.enable(realtime.obstacle())
    stamp = bench.driver.stamp
    bench.clock.time += 60.0
    realtime.take_currents(stamp, HOLDING)  # what came meanwhile may be taken first
    realtime.tick()
    assert bench.driver.stamp - stamp <= round(PARAMETERS.watchdog * 1e9)
    if is_enabled:
        assert bench.driver.safety.mode is Mode.FAULT
        assert "the driver itself did not run for 60.00 s; allowed: 0.045 s" in bench.driver.safety.fault
    stamp = bench.driver.stamp
    bench.clock.time += 0.001
    realtime.tick()
    assert bench.driver.stamp == stamp + MS
    assert int(realtime.facts()["missed periods"]) == pytest.approx(60_000, abs=1)
    assert bench.driver.currents == [0.0] * 4
