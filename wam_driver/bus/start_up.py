"""The start of the arm: find its controllers, wake them, check them, zero them, with what a person has to do.

The order is that of libbarrett (`product_manager.cpp`, `low_level_wam-inl.h`).
"""

import math
from collections.abc import Generator, Iterator, Sequence
from enum import Enum
from typing import NamedTuple

from wam_driver.bus import frames, properties
from wam_driver.bus.bus_fault import BusFault, Trouble
from wam_driver.bus.frames import Bit, BusGroup, BusNode
from wam_driver.bus.host import Host
from wam_driver.bus.safety_module import SafetyMode
from wam_driver.thresholds import BUS


class Wait(Enum):
    """What the start waits for, in words for the person."""

    POWER = "nothing answers on the bus: turn on the arm, connect the bus"
    IDLE = "release the E-stop and press Shift-Idle on the pendant"
    WAKE = "the motor controllers wake up"
    HOME = "put the arm at its home pose, hold it there and call confirm_home"
    ACTIVATE = "support the arm, press Shift-Activate on the pendant, then enable"
    NOTHING = ""


class Settings(NamedTuple):
    """What was read from the arm; (n,) each.

    Attributes
    ----------
    counts : per turn of a motor.
    gain : counts per N m.
    limit : largest torque, counts: the smallest of the controller's, the safety module's and the frame's.
    """

    counts: tuple[int, ...]
    gain: tuple[int, ...]
    limit: tuple[int, ...]


class StartUp:
    """One start of the arm.

    Parameters
    ----------
    host : on the bus.
    home : angles of the motors at the home pose, rad, (n,).

    Attributes
    ----------
    is_at_home : a person has confirmed the home pose.
    """

    def __init__(self, host: Host, home: Sequence[float]) -> None:
        self._host, self._home = host, home
        self._motors = range(1, len(home) + 1)
        self.is_at_home = False

    def steps(self) -> Generator[Wait, None, Settings]:
        """Go on after each step; yields what the start waits for, and returns what was read.

        Raises
        ------
        Trouble
            where something is wrong with the arm or its bus.
        """
        yield from self._await_idle()
        yield from self._find()
        self._restore_limits()
        yield from self._wake()
        settings = self._read()
        if self._host.demand(BusNode.SAFETY_MODULE, "ZERO") != 1:
            while not self.is_at_home:
                yield from self._pause(Wait.HOME, BUS.look)
            self._set_zero(settings)
        self._host.write(BusNode.SAFETY_MODULE, "IFAULT", BUS.ignored_velocities)
        return settings

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
                raise Trouble(BusFault.NO_SAFETY_MODULE, BusNode.SAFETY_MODULE)
            yield from self._pause(Wait.POWER, BUS.look)
        host.versions[BusNode.SAFETY_MODULE] = host.demand(BusNode.SAFETY_MODULE, "VERS")
        while host.demand(BusNode.SAFETY_MODULE, "MODE") != SafetyMode.IDLE:
            yield from self._pause(Wait.IDLE, BUS.look)

    def _find(self) -> Iterator[Wait]:
        """Who is on the bus, and whether that is this arm."""
        host = self._host
        yield Wait.WAKE
        found = [node for node in range(1, BUS.last_node + 1) if host.ask(node, "STAT", 1) is not None]
        if strange := [node for node in found if node <= 7 and node not in self._motors]:
            raise Trouble(BusFault.UNKNOWN_NODE, strange[0])
        for node in self._motors:
            host.versions[node] = host.demand(node, "VERS")
            role = host.demand(node, "ROLE") & 0x1F
            if role:
                raise Trouble(BusFault.NOT_MOTOR, node, role)
            for name in ("P", "T", "MODE"):
                if host.number(node, name) != host.number(1, name):
                    raise Trouble(BusFault.MIXED_FIRMWARE, node, name)

    def _restore_limits(self) -> None:
        """The limits that the safety module has stored."""
        for name in ("VL1", "VL2", "TL1", "TL2"):
            for what in ("DEF", "LOAD"):
                self._host.write(BusNode.SAFETY_MODULE, what, self._host.number(BusNode.SAFETY_MODULE, name))
                self._host.sleep(BUS.between_writes)

    def _wake(self) -> Iterator[Wait]:
        host = self._host
        asleep = [node for node in self._motors if host.demand(node, "STAT") != BUS.ready]
        for node in asleep:
            host.write(node, "STAT", BUS.ready)
            self._host.sleep(BUS.between_writes)
        if asleep:
            yield from self._pause(Wait.WAKE, BUS.silence)
        for node in asleep:
            status = host.ask(node, "STAT")
            if status != BUS.ready:
                raise Trouble(BusFault.NOT_AWAKE, node, "none" if status is None else status)
        host.send(frames.put(BusGroup.MOTORS, host.number(1, "MODE"), 0, Bit.GROUP))

    def _read(self) -> Settings:
        """Read and check what the driver relies on."""
        host = self._host
        has_poles = host.versions[self._motors[-1]] >= properties.MOTOR["POLES"][0][0]
        if 7 in self._motors and has_poles:
            poles = host.demand(7, "POLES")
            if poles != BUS.wrist_poles:
                raise Trouble(BusFault.WRIST, 7, poles)
        safe = host.demand(BusNode.SAFETY_MODULE, "TL1")
        rows = [self._read_motor(node) for node in self._motors]
        counts, gains, limits = zip(*rows, strict=True)
        limit = tuple(min(each, safe, BUS.largest_torque) for each in limits)
        return Settings(counts, gains, limit)

    def _read_motor(self, node: int) -> tuple[int, int, int]:
        demand = self._host.demand
        expected = [(node - 1) % 4 + 1, 0, BusGroup.ARM if node <= 4 else BusGroup.WRIST, BusGroup.MOTORS]
        found = [demand(node, name) for name in ("PIDX", "GRPA", "GRPB", "GRPC")]
        if found != expected:
            detail = f"index and groups {found}, expected {list(map(int, expected))}"
            raise Trouble(BusFault.INDEX, node, detail)
        counts, gain, limit = (demand(node, name) for name in ("CTS", "IPNM", "MT"))
        if counts not in BUS.encoders:
            raise Trouble(BusFault.COUNTS, node, counts)
        if not 1.0 / BUS.gain_ratio < gain / BUS.gain[node - 1] < BUS.gain_ratio:
            raise Trouble(BusFault.GAIN, node, gain)
        if limit <= 0:
            raise Trouble(BusFault.LIMIT, node, limit)
        return counts, gain, limit

    def _set_zero(self, settings: Settings) -> None:
        """Write the counts of the home pose, at which the arm is."""
        host = self._host
        host.write(BusNode.SAFETY_MODULE, "IFAULT", BUS.ignored_velocities)
        for node, angle, counts in zip(self._motors, self._home, settings.counts, strict=True):
            wanted = math.floor(angle / math.tau * counts)
            host.write(node, "P", wanted)
            away = host.demand(node, "P") - wanted
            if abs(away) > BUS.jump * counts:
                raise Trouble(BusFault.NOT_ZEROED, node, away)
        self._host.sleep(BUS.between_writes)
        host.write(BusNode.SAFETY_MODULE, "ZERO", 1)
        self._host.sleep(BUS.between_writes)
