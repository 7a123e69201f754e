"""Node `driver` of a real arm: the contract of docs/driver.md around a motor bus."""

import time
from typing import Any

from wam_description.arm import Shared
from wam_description.event import fault
from wam_description.interface import declared
from wam_description.parameters import ParameterError
from wam_description.signals import Answer, State
from wam_driver.arm_driver_node import ArmDriver
from wam_driver.bus.arm_bus import ArmBus
from wam_driver.bus.bus_parameters import SIMULATED
from wam_driver.bus.line import line_of
from wam_driver.limit_watch import LimitWatch, excess
from wam_driver.safety import Mode, Safety


class BusDriver(ArmDriver):
    """Publishes the state of the hardware in every period and sends it each command, while that is safe.

    A driver of your own replaces `entry`, its declaration, and `make_hardware`; its hardware is used as `ArmBus` is.
    """

    entry = "wam_driver.bus.interface:BusInterface"

    def __init__(self, **ros: Any) -> None:
        super().__init__(declared(self.entry), **ros)
        if self.shared.timing.mode != "realtime":
            raise ParameterError("timing.mode is lockstep, which is for simulated arms; set it to realtime")
        self._watchdog = self.own.watchdog
        self._limits = LimitWatch(self.shared.arm, self.own.cover_speed_limit, self.own.tip_speed_limit)
        self._near: tuple[str, ...] = ()
        self.hardware: ArmBus = self.make_hardware(self.shared, self.own)
        held = "only the windings of the motors brake, and the arm sinks"
        self.safety = Safety(self._release, lambda: self.hardware.brake(True), held)
        self._tick, self._begin = 1, time.perf_counter()
        self._command_stamp, self._came = 0, -1.0  # before the first: too old
        self.serve("confirm_home", self._confirm_home)
        self.create_timer(self.shared.timing.period, self._run)

    def make_hardware(self, shared: Shared, own: Any) -> Any:
        """The motors: those of the production WAM on its bus."""
        if own.interface != SIMULATED:
            self.get_logger().warning("this driver was tested on a simulated bus only, never on a real arm")
        return ArmBus(line_of(shared, own, time), shared.arm, shared.timing.period, own.home)

    @property
    def stamp(self) -> int:
        """Time of the present state, ns: periods counted from 1, times the period."""
        return self._tick * self.shared.timing.period_ns

    def is_waiting(self) -> bool:
        """Whether a person has not activated the arm yet: a scenario waits for that."""
        return bool(self.advice)

    def _run(self) -> None:
        hardware, timing = self.hardware, self.shared.timing
        due = int((time.perf_counter() - self._begin) / timing.period) + 1 - self._tick
        if due < 1:
            return
        self._tick += due
        self.health.counts["late periods"] += due - 1
        age = max((self.stamp - self._command_stamp) * 1e-9, time.perf_counter() - self._came)
        if self.safety.mode is Mode.ENABLED and age >= self._watchdog:
            cure = f"{due - 1} periods missed; check that velocity_loop runs"
            self.trip(fault("command_stale", age_ms=age * 1e3, allowed_ms=self._watchdog * 1e3, cure=cure))
        was_running = hardware.is_running
        hardware.exchange(due)
        if hardware.is_running:
            self._publish(due if was_running else 1)  # before, there was no state
        if hardware.trouble:
            self.trip(hardware.trouble)
        self.announce()

    @property
    def advice(self) -> str:
        """What a person has to do."""
        return self.hardware.advice

    unready = advice

    @property
    def warnings(self) -> tuple[str, ...]:
        """The same, where there is something to do; else what is near a limit."""
        return (self.advice,) if self.advice else self._near

    def _publish(self, due: int) -> None:
        """The state; where periods were left out, also the outer ones among them."""
        hardware, timing, publish = self.hardware, self.shared.timing, self.outlets.publish
        state = hardware.state
        self._watch(state)
        position, velocity, current = state
        torque = [i * k for i, k in zip(current, self.shared.arm.motors.torque_constant, strict=True)]
        for stamp in range(self.stamp - (due - 1) * timing.period_ns, self.stamp + 1, timing.period_ns):
            is_outer = timing.is_outer(stamp)
            if stamp == self.stamp or is_outer:
                publish("motor_states", stamp, State(position, velocity, torque))
            if is_outer:
                publish("/clock", stamp, None)
                publish("motor_currents", stamp, State([], [], current))
        self.health.counts["steps"] += 1
        self.health.counts |= hardware.counts
        self.health.report(self.stamp)

    def _watch(self, state: State) -> None:
        """Trip a released arm on the first quantity above its limit; warn of those near it.

        No tension of a cable is known.
        """
        is_released = self.safety.mode is Mode.ENABLED
        watched = self._limits.watched(*state, [0.0] * len(state.effort)) if is_released else []
        self._near = tuple(limit.warning for limit in watched)
        if event := excess(watched, "limit", push="", ago=0.0):
            self.trip(event)

    def command(self, stamp: int, currents: list[float]) -> None:
        """Send currents, A, that answer the state of a stamp, ns."""
        self._came = time.perf_counter()
        if stamp >= max(self._command_stamp, self.session.since):
            self._command_stamp = stamp
            if self.safety.mode is Mode.ENABLED:
                self.hardware.command(currents)

    def obstacle(self) -> str:
        """Whether no commands come, or the arm cannot be where its driver believes it to be."""
        if time.perf_counter() - self._came >= self._watchdog:
            return "no motor_current_command arrives; start velocity_loop, then enable"
        return self._limits.obstacle(self.hardware.state.position)

    def _release(self) -> None:
        self._command_stamp = self.stamp
        self._limits.begin(self.hardware.state.position)
        self.hardware.brake(False)

    def reset_fault(self) -> Answer:
        """Clear a latched fault; the motors stay braked."""
        self.hardware.clear()
        return super().reset_fault()

    def estop(self) -> Answer:
        """Stop as safely as the hardware can, and latch a fault."""
        self.hardware.stop()
        return super().estop()

    def _confirm_home(self) -> Answer:
        if self.hardware.confirm_home():
            return Answer(True, "the zero is set")
        return Answer(False, f"refused: the driver does not wait for the home pose; {self.advice}".removesuffix("; "))

    def destroy_node(self) -> None:
        """Brake, report it, and end when the others have the last messages."""
        super().destroy_node()
        self.hardware.close()
