"""The start of the arm: find its controllers, wake them, check them, zero them, with what a person has to do.

The order is that of libbarrett (`product_manager.cpp`, `low_level_wam-inl.h`).
"""

from collections.abc import Generator, Iterator, Sequence
from enum import Enum

from wam_driver.bus import properties
from wam_driver.bus.bus_fault import BusFault, Trouble
from wam_driver.bus.frames import BusGroup, BusNode
from wam_driver.bus.host import Host
from wam_driver.bus.motor import Motor
from wam_driver.bus.safety_module import SafetyMode
from wam_driver.thresholds import BUS


class Wait(Enum):
    """What the start waits for, as a text for the person at the arm."""

    POWER = "nothing answers on the bus: turn on the arm, connect the bus"
    IDLE = "release the E-stop and press Shift-Idle on the pendant"
    WAKE = "the motor controllers wake up"
    HOME = "put the arm at its home pose, hold it there and call confirm_home"
    ACTIVATE = "support the arm, press Shift-Activate on the pendant, then enable"
    NOTHING = ""


class StartUp:
    """One start of the arm.

    Parameters
    ----------
    host : on the bus.
    home : angles of the motors at the home pose, rad, (n,).
    torque_constant : N m/A, (n,).

    Attributes
    ----------
    is_at_home : a person has confirmed the home pose.
    woken : controllers that this start has woken.
    """

    def __init__(self, host: Host, home: Sequence[float], torque_constant: Sequence[float]) -> None:
        self._host, self._home, self._constant = host, home, torque_constant
        self._motors = range(1, len(home) + 1)
        self.is_at_home, self.woken = False, list[int]()

    def steps(self) -> Generator[Wait, None, list[Motor]]:
        """Go on after each step; yields what the start waits for, and returns the motors as they were read.

        Raises
        ------
        Trouble
            where something is wrong with the arm or its bus.
        """
        yield from self._await_idle()
        yield Wait.WAKE
        self._find()
        self._restore_limits()
        yield from self._wake()
        limit = min(self._host.demand(BusNode.SAFETY_MODULE, "TL1"), BUS.largest_torque)
        motors = [self._read(node, limit) for node in self._motors]
        if self.woken or self._host.demand(BusNode.SAFETY_MODULE, "ZERO") != 1:
            while not self.is_at_home:
                yield from self._pause(Wait.HOME, BUS.look)
            self._set_zero(motors)
        self._host.write(BusNode.SAFETY_MODULE, "IFAULT", BUS.ignored_velocities)
        return motors

    def _pause(self, wait: Wait, seconds: float) -> Iterator[Wait]:
        """Let time pass in pieces, so that the caller may do other things."""
        end = self._host.now() + seconds
        while self._host.now() < end:
            yield wait
            self._host.sleep(BUS.between_writes)

    def _await_idle(self) -> Iterator[Wait]:
        """Until the safety module is idle: in E-stop no controller answers, active it needs the positions."""
        host = self._host
        while host.ask(BusNode.SAFETY_MODULE, "STAT") is None:
            if any(host.ask(node, "STAT", 1) is not None for node in self._motors):
                host.demand(BusNode.SAFETY_MODULE, "STAT")  # once more, as the power may have come in between
            yield from self._pause(Wait.POWER, BUS.look)
        host.versions[BusNode.SAFETY_MODULE] = host.demand(BusNode.SAFETY_MODULE, "VERS")
        while host.demand(BusNode.SAFETY_MODULE, "MODE") != SafetyMode.IDLE:
            yield from self._pause(Wait.IDLE, BUS.look)

    def _find(self) -> None:
        """Whether the motors on the bus are those of this arm, and of one firmware."""
        host = self._host
        for node in range(len(self._motors) + 1, BUS.motors + 1):
            if host.ask(node, "STAT", 1) is not None:
                raise Trouble(BusFault.UNKNOWN_NODE, node)
        for node in self._motors:
            host.versions[node] = host.demand(node, "VERS")
            host.demand(node, "ROLE", BUS.motor_roles, BusFault.NOT_MOTOR)
            for name in ("P", "T", "MODE"):
                if host.number(node, name) != host.number(1, name):
                    raise Trouble(BusFault.MIXED_FIRMWARE, node, name)
        host.versions[BusGroup.MOTORS] = host.versions[1]

    def _restore_limits(self) -> None:
        """The limits that the safety module has stored."""
        for name in ("VL1", "VL2", "TL1", "TL2"):
            for what in ("DEF", "LOAD"):
                self._host.write(BusNode.SAFETY_MODULE, what, self._host.number(BusNode.SAFETY_MODULE, name))
                self._host.sleep(BUS.between_writes)

    def _wake(self) -> Iterator[Wait]:
        """Wake those that sleep; as they have lost their counts, the zero is unknown, also in later starts."""
        host = self._host
        self.woken = [node for node in self._motors if host.demand(node, "STAT") != BUS.ready]
        for node in self.woken:
            host.write(BusNode.SAFETY_MODULE, "ZERO", 0)
            host.write(node, "STAT", BUS.ready)
            host.sleep(BUS.between_writes)
        if self.woken:
            yield from self._pause(Wait.WAKE, BUS.silence)
        for node in self.woken:
            host.demand(node, "STAT", [BUS.ready], BusFault.NOT_AWAKE)
        host.write(BusGroup.MOTORS, "MODE", BUS.idle_mode)

    def _read(self, node: int, limit: int) -> Motor:
        """Read and check what the driver relies on, with a limit of the torque by the safety module, counts."""
        demand, maker = self._host.demand, properties.ARM[node]
        if node == BUS.motors and "POLES" in properties.numbers(self._host.versions[node]):
            demand(node, "POLES", [maker["POLES"]], BusFault.WRIST)
        for name in ("PIDX", "GRPA", "GRPB", "GRPC"):
            demand(node, name, [maker[name]], BusFault.INDEX)
        turn = demand(node, "CTS", BUS.encoders, BusFault.COUNTS)
        gain = demand(node, "IPNM")
        if not 1.0 / BUS.gain_ratio < gain / maker["IPNM"] < BUS.gain_ratio:
            raise Trouble(BusFault.GAIN, node, gain)
        most = demand(node, "MT", range(1, 1 << 31), BusFault.LIMIT)
        return Motor(node, turn, gain * self._constant[node - 1], min(most, limit))

    def _set_zero(self, motors: Sequence[Motor]) -> None:
        """Write the counts of the home pose, at which the arm is."""
        host = self._host
        host.write(BusNode.SAFETY_MODULE, "IFAULT", BUS.ignored_velocities)
        for motor, angle in zip(motors, self._home, strict=True):
            host.write(motor.node, "P", motor.count_at(angle))
            near = range(motor.count_at(angle - BUS.jump), motor.count_at(angle + BUS.jump))
            host.demand(motor.node, "P", near, BusFault.NOT_ZEROED)
        host.sleep(BUS.between_writes)
        host.write(BusNode.SAFETY_MODULE, "ZERO", 1)
        host.sleep(BUS.between_writes)
