"""The driver of the arm on its bus, one call per period, without ROS; its clock is that of the line."""

from collections.abc import Iterator, Sequence

from wam_description.arm import Arm
from wam_description.transmission_map import TransmissionMap
from wam_driver.bus.bus_fault import BusFault, Trouble
from wam_driver.bus.cycle import Cycle
from wam_driver.bus.host import Host
from wam_driver.bus.line import Line
from wam_driver.bus.safety_module import SafetyMode
from wam_driver.bus.start_up import StartUp, Wait


class ArmBus:
    """Motors and safety module of an arm.

    Parameters
    ----------
    line : to the bus.
    arm : whose torque constants only define what an ampere is, and whose start is the home pose.
    period : s, between two calls of `exchange`.

    Attributes
    ----------
    position, velocity, current : of the motors, rad, rad/s, A; no current is measured: it is the commanded one.
    wait : what a person has to do, or what the start waits for.
    trouble : the first fault since `begin` or `clear`.
    counts : lost replies, frames that were not sent, and other things that are no fault if they are rare.
    """

    def __init__(self, line: Line, arm: Arm, period: float) -> None:
        self._host, self._constant, self._period = Host(line), arm.motors.torque_constant, period
        self._home = TransmissionMap.of(arm).motor_positions(arm.joints.start)
        self.position, self.velocity, self.current = ([0.0] * len(self._home) for _ in range(3))
        self.counts = self._host.counts
        self.begin()

    def begin(self) -> None:
        """Begin the start-up, also once more."""
        self.trouble: Trouble | None = None
        self._start = StartUp(self._host, self._home)
        self._steps: Iterator[Wait] = self._start.steps()
        self._cycle: Cycle | None = None
        self.wait = Wait.POWER

    def clear(self) -> None:
        """Forget a fault; the start-up is repeated where controllers or their zero may be lost."""
        if self._is_lost:
            self.begin()
        self.trouble = None
        if self._cycle is not None:
            self._cycle.trouble = None

    def confirm_home(self) -> bool:
        """A person states that the arm is at its home pose; whether that was requested."""
        self._start.is_at_home = self.wait is Wait.HOME
        return self._start.is_at_home

    @property
    def is_running(self) -> bool:
        """Whether the start-up has ended, so that positions are known."""
        return self._cycle is not None

    @property
    def _is_lost(self) -> bool:
        """Whether the start has to be repeated."""
        return self.trouble is not None and self.trouble.fault.loses_controllers

    def _go_on(self) -> None:
        """Take a step of the start-up."""
        try:
            self.wait = next(self._steps)
        except StopIteration as end:
            settings, self.wait = end.value, Wait.ACTIVATE
            self._cycle = Cycle(self._host, settings, self._constant, self._period)
        except Trouble as trouble:
            self.trouble = trouble
        if refused := self._host.refused:
            self.trouble = Trouble(BusFault.NOT_SENT, 0, f"{refused} frames")

    def release(self) -> None:
        """Let the motors follow their torques."""
        if self._cycle is not None:
            self._cycle.set_released(True)

    def brake(self) -> None:
        """Command zero torque and let the windings brake; this arm has no brakes, it sinks."""
        self.current = [0.0] * len(self._home)
        if self._cycle is not None:
            self._cycle.set_released(False)

    def stop(self) -> None:
        """Brake, and let the safety module go to idle where its firmware takes that from the host."""
        self.brake()
        if self._cycle is not None:
            self._cycle.stop()

    def command(self, currents: Sequence[float]) -> None:
        """Send torques at once, A each, clipped; nothing unless the motors are released."""
        if self._cycle is not None and self._cycle.is_released:
            self.current = self._cycle.command(currents)

    @property
    def advice(self) -> str:
        """What a person has to do, in words; '' where nothing."""
        return self.wait.value

    @property
    def fault(self) -> str:
        """The trouble, in words; '' where there is none."""
        return str(self.trouble) if self.trouble else ""

    def close(self) -> None:
        """Brake, and end the connection."""
        self.brake()
        self._host.line.close()

    def exchange(self, periods: int = 1) -> None:
        """Take the positions, some periods after the last time.

        Before `is_running` a step of the start-up, which may last some hundredths of a second.
        """
        cycle = self._cycle
        if cycle is None:
            if self.trouble is None:
                self._go_on()
            return
        self._host.line.let_pass(periods * self._period)
        if self._is_lost:
            cycle.set_released(False)  # until the start is repeated
            return
        cycle.exchange()
        self.position = [motor.position for motor in cycle.motors]
        self.velocity = [motor.velocity for motor in cycle.motors]
        self.wait = Wait.NOTHING if cycle.safety_mode is SafetyMode.ACTIVE else Wait.ACTIVATE
        if cycle.trouble is not None and self.trouble is None:
            self.trouble = cycle.trouble
            self.brake()
