"""The start of the arm: find its controllers, wake them, check them, zero them, with what a person has to do.

The order is that of libbarrett (`product_manager.cpp`, `low_level_wam-inl.h`).
"""

from collections.abc import Generator, Iterator, Sequence
from enum import Enum

from wam_description.arm import Arm
from wam_driver.bus import properties
from wam_driver.bus.bus_fault import BusFault, Trouble
from wam_driver.bus.frames import SAFETY, BusGroup
from wam_driver.bus.host import Host
from wam_driver.bus.line import Line
from wam_driver.bus.motor import Motor
from wam_driver.bus.safety_module import SafetyMode
from wam_driver.thresholds import BUS

TORQUES = range(1, 1 << 31)  # counts, that a limit of the torque may be


class Wait(Enum):
    """What the start waits for, as a text for the person at the arm."""

    POWER = "nothing answers on the bus: turn on the arm, connect the bus"
    IDLE = "release the E-stop and press Shift-Idle on the pendant"
    WAKE = "the motor controllers wake up"
    HOME = "put the arm at its home pose, {home} rad, hold it there and call confirm_home"
    ACTIVATE = "support the arm, press Shift-Activate on the pendant, then enable"
    NOTHING = ""


class StartUp(Host):
    """The computer on the bus as it starts the arm once.

    Parameters
    ----------
    line, arm, home : as those of `ArmBus`.
    is_zero_lost : a position has jumped, so that the zero is unknown, also in later starts.

    Attributes
    ----------
    is_at_home : a person has confirmed the home pose.
    woken : controllers that this start has woken.
    """

    def __init__(self, line: Line, arm: Arm, home: Sequence[float], is_zero_lost: bool) -> None:
        super().__init__(line)
        self._home, self._is_zero_lost = arm.transmission.motor_motion(home), is_zero_lost
        self._constant = arm.motors.torque_constant
        self._motors = range(1, len(self._home) + 1)
        self.is_at_home, self.woken = False, list[int]()

    def steps(self) -> Generator[Wait, None, list[Motor]]:
        """Go on after some time; yields what the start waits for, and returns the motors as they were read.

        Raises
        ------
        Trouble
            where something is wrong with the arm or its bus.
        """
        yield from self._await_idle()
        yield Wait.WAKE
        if self._is_zero_lost:
            self.write(SAFETY, "ZERO", 0)
        self._find()
        for name in ("VL1", "VL2", "TL1", "TL2"):  # as the safety module has stored them
            for what in ("DEF", "LOAD"):
                self.write(SAFETY, what, self.number(SAFETY, name))
        yield from self._wake()
        limit = min(self.demand(SAFETY, "TL1", TORQUES, BusFault.LIMIT), BUS.largest_torque)
        motors = [self._read(node, limit) for node in self._motors]
        if self.woken or self._is_zero_lost or self.demand(SAFETY, "ZERO") != 1:
            while not self.is_at_home:
                yield Wait.HOME
            self._set_zero(motors)
        self.write(SAFETY, "IFAULT", BUS.ignored_velocities)
        return motors

    def _await_idle(self) -> Iterator[Wait]:
        """Until the safety module is idle: in E-stop no controller answers, active it needs the positions."""
        while self.ask(SAFETY, "STAT") is None:
            if any(self.ask(node, "STAT", 1) is not None for node in self._motors):
                self.demand(SAFETY, "STAT")  # once more, as the power may have come in between
            yield Wait.POWER
        self.versions[SAFETY] = self.demand(SAFETY, "VERS")
        while self.demand(SAFETY, "MODE") != SafetyMode.IDLE:
            yield Wait.IDLE

    def _find(self) -> None:
        """Whether the motors on the bus are those of this arm, and of one firmware."""
        for node in range(len(self._motors) + 1, BUS.motors + 1):
            if self.ask(node, "STAT", 1) is not None:
                raise Trouble(BusFault.UNKNOWN_NODE, node)
        for node in self._motors:
            self.versions[node] = self.demand(node, "VERS")
            self.demand(node, "ROLE", BUS.motor_roles, BusFault.NOT_MOTOR)
            for name in ("P", "T"):  # MODE is the same in all
                if self.number(node, name) != self.number(1, name):
                    raise Trouble(BusFault.MIXED_FIRMWARE, node, name)
        self.versions[BusGroup.MOTORS] = self.versions[1]

    def _wake(self) -> Iterator[Wait]:
        """Wake those that sleep; as they have lost their counts, the zero is unknown, also in later starts."""
        asleep = self.woken = [node for node in self._motors if self.demand(node, "STAT") != BUS.ready]
        for _ in range(BUS.attempts):
            for node in asleep:
                self.write(SAFETY, "ZERO", 0)
                self.write(node, "STAT", BUS.ready)
            end = self.now() + BUS.silence
            while asleep and self.now() < end:
                yield Wait.WAKE
            asleep = [node for node in asleep if self.ask(node, "STAT") != BUS.ready]
        for node in self.woken:
            self.demand(node, "STAT", [BUS.ready], BusFault.NOT_AWAKE)
        self.write(BusGroup.MOTORS, "MODE", BUS.idle_mode)

    def _read(self, node: int, limit: int) -> Motor:
        """Read and check what the driver relies on, with a limit of the torque by the safety module, counts."""
        demand, maker = self.demand, properties.ARM[node]
        if node == BUS.motors and "POLES" in properties.numbers(self.versions[node]):
            demand(node, "POLES", [maker["POLES"]], BusFault.WRIST)
        for name in ("PIDX", "GRPA", "GRPB", "GRPC"):
            if (found := demand(node, name)) != maker[name]:
                raise Trouble(BusFault.INDEX, node, f"{name}, which is {found}, to {maker[name]}")
        turn = demand(node, "CTS", BUS.encoders, BusFault.COUNTS)
        usual = range(int(maker["IPNM"] / BUS.gain_ratio), int(maker["IPNM"] * BUS.gain_ratio))
        if (gain := demand(node, "IPNM")) not in usual:
            raise Trouble(BusFault.GAIN, node, f"{gain} counts per N m; allowed: {usual[0]} to {usual[-1]}")
        most = demand(node, "MT", TORQUES, BusFault.LIMIT)
        return Motor(node, turn, gain * self._constant[node - 1], min(most, limit))

    def _set_zero(self, motors: Sequence[Motor]) -> None:
        """Write the counts of the home pose, at which the arm is."""
        self.write(SAFETY, "IFAULT", BUS.ignored_velocities)
        for motor, angle in zip(motors, self._home, strict=True):
            self.write(motor.node, "P", motor.count_at(angle))
            near = range(motor.count_at(angle - BUS.jump), motor.count_at(angle + BUS.jump))
            self.demand(motor.node, "P", near, BusFault.NOT_ZEROED)
        self.write(SAFETY, "ZERO", 1)
