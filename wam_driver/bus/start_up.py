"""The start of the arm: find its controllers, wake them, check them, zero them, with what a person has to do.

The order is that of libbarrett (`product_manager.cpp`, `low_level_wam-inl.h`).
"""

import math
from collections.abc import Iterator, Sequence
from enum import Enum
from typing import NamedTuple

from wam_driver.bus import frames, properties
from wam_driver.bus.bus_fault import BusFault, StartError
from wam_driver.bus.frames import Bit, BusGroup, BusNode, Frame, Position, Value
from wam_driver.bus.line import Line, LineError
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
    versions : of the firmware, by node.
    counts : per turn of a motor.
    gain : counts per N m.
    limit : largest torque, counts: the smallest of the controller's, the safety module's and the frame's.
    """

    versions: dict[int, int]
    counts: tuple[int, ...]
    gain: tuple[int, ...]
    limit: tuple[int, ...]

    def number(self, node: int, name: str) -> int:
        """Number of a property of a node."""
        return properties.number(name, self.versions[node], node == BusNode.SAFETY_MODULE)


class Nodes:
    """Questions to single nodes and their answers.

    Attributes
    ----------
    versions : of the firmware, by node, of those that are known.
    """

    def __init__(self, line: Line) -> None:
        self._line = line
        self.versions: dict[int, int] = {}

    def number(self, node: int, name: str) -> int:
        """Number of a property of a node.

        Raises
        ------
        StartError
            where its firmware has none.
        """
        try:
            return properties.number(name, self.versions.get(node, 0), node == BusNode.SAFETY_MODULE)
        except KeyError as error:
            raise StartError(BusFault.FIRMWARE, node, error.args[0]) from error

    def ask(self, node: int, name: str, attempts: int = BUS.attempts) -> int | None:
        """A property of a node, of the position its counts; None where it does not answer."""
        number = self.number(node, name)
        for _ in range(attempts):
            self.send(frames.get(node, number))
            end = self._line.now() + BUS.reply
            while (left := end - self._line.now()) > 0.0 and (frame := self._next(left)) is not None:
                found = frames.read(frame)
                if isinstance(found, Position) and name == "P" and found.node == node:
                    return found.motor
                if isinstance(found, Value) and (found.node, found.number) == (node, number):
                    return found.value
        return None

    def _next(self, timeout: float) -> Frame | None:
        try:
            return self._line.receive(timeout)
        except LineError:
            return None

    def demand(self, node: int, name: str) -> int:
        """A property of a node that has to answer.

        Raises
        ------
        StartError
            where it does not.
        """
        found = self.ask(node, name)
        if found is None:
            raise StartError(BusFault.NO_SAFETY_MODULE if node == BusNode.SAFETY_MODULE else BusFault.MISSING, node)
        return found

    def write(self, node: int, name: str, value: int) -> None:
        """Write a property of a node."""
        self.send(frames.put(node, self.number(node, name), value))

    def send(self, frame: Frame) -> None:
        """Send a frame.

        Raises
        ------
        StartError
            where the adapter does not take it.
        """
        try:
            self._line.send(frame)
        except LineError as error:
            raise StartError(BusFault.NOT_SENT, 0, error) from error


class StartUp:
    """One start of the arm.

    Parameters
    ----------
    line : to the bus.
    home : angles of the motors at the home pose, rad, (n,).

    Attributes
    ----------
    is_at_home : a person has confirmed the home pose.
    settings : what was read, once the start has ended.
    """

    def __init__(self, line: Line, home: Sequence[float]) -> None:
        self._line, self._nodes, self._home = line, Nodes(line), home
        self._motors = range(1, len(home) + 1)
        self.is_at_home = False
        self.settings: Settings | None = None

    def steps(self) -> Iterator[Wait]:
        """Go on after each step; yields what the start waits for.

        Raises
        ------
        StartError
            where something is wrong with the arm or its bus.
        """
        yield from self._await_idle()
        yield from self._find()
        self._restore_limits()
        yield from self._wake()
        settings = self._read()
        if self._nodes.demand(BusNode.SAFETY_MODULE, "ZERO") != 1:
            while not self.is_at_home:
                yield from self._pause(Wait.HOME, BUS.look)
            self._set_zero(settings)
        self._nodes.write(BusNode.SAFETY_MODULE, "IFAULT", BUS.ignored_velocities)
        self.settings = settings

    def _pause(self, wait: Wait, seconds: float) -> Iterator[Wait]:
        """Let time pass in pieces, so that the caller may do other things."""
        end = self._line.now() + seconds
        while self._line.now() < end:
            yield wait
            self._line.sleep(BUS.between_writes)

    def _await_idle(self) -> Iterator[Wait]:
        """Until the safety module is idle: in E-stop no controller answers, active it needs the positions."""
        nodes = self._nodes
        while nodes.ask(BusNode.SAFETY_MODULE, "STAT") is None:
            if any(nodes.ask(node, "STAT", 1) is not None for node in self._motors):
                raise StartError(BusFault.NO_SAFETY_MODULE, BusNode.SAFETY_MODULE)
            yield from self._pause(Wait.POWER, BUS.look)
        nodes.versions[BusNode.SAFETY_MODULE] = nodes.demand(BusNode.SAFETY_MODULE, "VERS")
        while nodes.demand(BusNode.SAFETY_MODULE, "MODE") != SafetyMode.IDLE:
            yield from self._pause(Wait.IDLE, BUS.look)

    def _find(self) -> Iterator[Wait]:
        """Who is on the bus, and whether that is this arm."""
        nodes = self._nodes
        yield Wait.WAKE
        found = [node for node in range(1, BUS.last_node + 1) if nodes.ask(node, "STAT", 1) is not None]
        if strange := [node for node in found if node <= 7 and node not in self._motors]:
            raise StartError(BusFault.UNKNOWN_NODE, strange[0])
        for node in self._motors:
            nodes.versions[node] = nodes.demand(node, "VERS")
            role = nodes.demand(node, "ROLE") & 0x1F
            if role:
                raise StartError(BusFault.NOT_MOTOR, node, role)
            for name in ("P", "T", "MODE"):
                if nodes.number(node, name) != nodes.number(1, name):
                    raise StartError(BusFault.MIXED_FIRMWARE, node, name)

    def _restore_limits(self) -> None:
        """The limits that the safety module has stored."""
        for name in ("VL1", "VL2", "TL1", "TL2"):
            for what in ("DEF", "LOAD"):
                self._nodes.write(BusNode.SAFETY_MODULE, what, self._nodes.number(BusNode.SAFETY_MODULE, name))
                self._line.sleep(BUS.between_writes)

    def _wake(self) -> Iterator[Wait]:
        nodes = self._nodes
        asleep = [node for node in self._motors if nodes.demand(node, "STAT") != BUS.ready]
        for node in asleep:
            nodes.write(node, "STAT", BUS.ready)
            self._line.sleep(BUS.between_writes)
        if asleep:
            yield from self._pause(Wait.WAKE, BUS.silence)
        for node in asleep:
            status = nodes.ask(node, "STAT")
            if status != BUS.ready:
                raise StartError(BusFault.NOT_AWAKE, node, "none" if status is None else status)
        nodes.send(frames.put(BusGroup.MOTORS, nodes.number(1, "MODE"), 0, Bit.GROUP))

    def _read(self) -> Settings:
        """Read and check what the driver relies on."""
        nodes = self._nodes
        has_poles = nodes.versions[self._motors[-1]] >= properties.MOTOR["POLES"][0][0]
        if 7 in self._motors and has_poles:
            poles = nodes.demand(7, "POLES")
            if poles != BUS.wrist_poles:
                raise StartError(BusFault.WRIST, 7, poles)
        safe = nodes.demand(BusNode.SAFETY_MODULE, "TL1")
        rows = [self._read_motor(node) for node in self._motors]
        counts, gains, limits = zip(*rows, strict=True)
        limit = tuple(min(each, safe, BUS.largest_torque) for each in limits)
        return Settings(dict(nodes.versions), counts, gains, limit)

    def _read_motor(self, node: int) -> tuple[int, int, int]:
        demand = self._nodes.demand
        expected = [(node - 1) % 4 + 1, 0, BusGroup.ARM if node <= 4 else BusGroup.WRIST, BusGroup.MOTORS]
        found = [demand(node, name) for name in ("PIDX", "GRPA", "GRPB", "GRPC")]
        if found != expected:
            detail = f"index and groups {found}, expected {list(map(int, expected))}"
            raise StartError(BusFault.INDEX, node, detail)
        counts, gain, limit = (demand(node, name) for name in ("CTS", "IPNM", "MT"))
        if counts not in BUS.encoders:
            raise StartError(BusFault.COUNTS, node, counts)
        if not 1.0 / BUS.gain_ratio < gain / BUS.gain[node - 1] < BUS.gain_ratio:
            raise StartError(BusFault.GAIN, node, gain)
        if limit <= 0:
            raise StartError(BusFault.LIMIT, node, limit)
        return counts, gain, limit

    def _set_zero(self, settings: Settings) -> None:
        """Write the counts of the home pose, at which the arm is."""
        nodes = self._nodes
        nodes.write(BusNode.SAFETY_MODULE, "IFAULT", BUS.ignored_velocities)
        for node, angle, counts in zip(self._motors, self._home, settings.counts, strict=True):
            wanted = math.floor(angle / math.tau * counts)
            nodes.write(node, "P", wanted)
            away = nodes.demand(node, "P") - wanted
            if abs(away) > BUS.jump * counts:
                raise StartError(BusFault.NOT_ZEROED, node, away)
        self._line.sleep(BUS.between_writes)
        nodes.write(BusNode.SAFETY_MODULE, "ZERO", 1)
        self._line.sleep(BUS.between_writes)
