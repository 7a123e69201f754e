"""The driver of the arm on its bus, one call per period, without ROS; its clock is that of the line."""

import math
from collections.abc import Sequence

from wam_description.arm import Arm
from wam_description.event import Event
from wam_description.signals import State
from wam_driver.bus.bus_fault import BusFault, Trouble
from wam_driver.bus.cycle import Cycle
from wam_driver.bus.line import Line
from wam_driver.bus.safety_module import SafetyMode
from wam_driver.bus.start_up import StartUp, Wait
from wam_driver.thresholds import BUS


class ArmBus:
    """Motors and safety module of an arm.

    Parameters
    ----------
    line : to the bus.
    arm : its torque constants convert amperes to torques.
    period : s, between two calls of `exchange`.
    home : angles of the joints at the home pose, rad.

    Attributes
    ----------
    wait : what a person has to do, or what the start waits for.
    counts : lost replies, frames that were not sent, and other things that are no fault if they are rare.
    """

    def __init__(self, line: Line, arm: Arm, period: float, home: Sequence[float]) -> None:
        self._line, self._arm, self._period, self._home = line, arm, period, home
        self.counts = line.counts
        self._cycle: Cycle | None = None
        self._is_zero_lost = False  # by what the last cycle has seen
        self.begin()

    def begin(self) -> None:
        """Begin the start-up, also once more."""
        if self._cycle:
            self._is_zero_lost = self._cycle.is_zero_lost
        self._host = StartUp(self._line, self._arm, self._home, self._is_zero_lost)
        self._steps = self._host.steps()
        self._cycle = None
        self.wait = Wait.POWER

    def clear(self) -> None:
        """Forget a fault; the start-up is repeated where controllers or their zero may be lost."""
        is_zero_lost = self._cycle is not None and self._cycle.is_zero_lost
        if is_zero_lost or (self.trouble and BusFault(str(self.trouble.cause)).loses_controllers):
            self.begin()
        self._host.trouble = None

    def confirm_home(self) -> bool:
        """A person states that the arm is at its home pose; whether that was requested."""
        self._host.is_at_home = self.wait is Wait.HOME
        return self._host.is_at_home

    @property
    def is_running(self) -> bool:
        """Whether the start-up has ended, and all positions are known."""
        return self._cycle is not None and not any(map(math.isnan, self.state.position))

    @property
    def state(self) -> State:
        """Of the motors, rad, rad/s, and A; no current is measured: it is the commanded one."""
        motors = self._cycle.motors if self._cycle else ()
        return State(
            [motor.position for motor in motors],
            [motor.velocity for motor in motors],
            [motor.current for motor in motors],
        )

    @property
    def trouble(self) -> Event | None:
        """The first fault since `begin` or `clear`."""
        return self._host.trouble

    @property
    def advice(self) -> str:
        """What a person has to do, in words; '' where nothing."""
        woken, text = self._host.woken, self.wait.value.format(home=", ".join(f"{angle:g}" for angle in self._home))
        if woken and self.wait is Wait.HOME:
            return f"{text}; motor controllers that lost their position: {', '.join(map(str, woken))}"
        return text

    def brake(self, on: bool) -> None:
        """Command zero torque and let the windings brake, or not; this arm has no brakes, it sinks."""
        if self._cycle:
            self._cycle.brake(on)

    def stop(self) -> None:
        """Brake, and let the safety module go to idle where its firmware takes that from the host."""
        if self._cycle:
            self._cycle.stop()
            self.wait = Wait.ACTIVATE  # until the safety module answers

    def command(self, currents: Sequence[float]) -> None:
        """Send torques at once, A each, clipped; nothing unless the motors are released."""
        if self._cycle and self._cycle.is_released:
            self._cycle.command(currents)

    def close(self) -> None:
        """Stop, as an active arm without a driver would end in E-stop and lose its zero, and end the connection."""
        self.stop()
        self._line.sleep(BUS.between_writes)  # an adapter may drop what it has not sent
        self._line.close()

    def exchange(self, periods: int = 1) -> None:
        """Take the positions, some periods after the last time.

        Before `is_running` a step of the start-up, which may last some hundredths of a second.
        """
        if self._cycle:
            self._line.let_pass(periods * self._period)
            self._cycle.exchange()
            self.wait = Wait.NOTHING if self._cycle.safety_mode == SafetyMode.ACTIVE else Wait.ACTIVATE
            return
        if self.trouble:
            return
        self._line.sleep(BUS.look)
        try:
            self.wait = next(self._steps)
        except StopIteration as end:
            self._cycle, self.wait = Cycle(self._host, end.value, self._period), Wait.ACTIVATE
        except Trouble as trouble:
            self._host.trouble = trouble.event
        if self._host.refused:
            self._host.trouble = BusFault.NOT_SENT.event(0, self._host.refused)
