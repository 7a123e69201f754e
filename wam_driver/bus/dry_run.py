"""A dry run: what is on the bus, without a frame of ours, and what the driver would send."""

from collections.abc import Iterator

from wam_description.arm import Shared
from wam_description.transmission_map import TransmissionMap
from wam_driver.bus import frames, properties
from wam_driver.bus.arm_bus import ArmBus
from wam_driver.bus.frames import Bit, BusGroup, BusNode, Frame, Position, Value
from wam_driver.bus.interface import BusParameters
from wam_driver.bus.line import Line, LineError
from wam_driver.bus.lines import simulated_line
from wam_driver.bus.start_up import Wait
from wam_driver.thresholds import BUS


def heard(line: Line, seconds: float) -> Iterator[str]:
    """What comes on a bus within a time, s, kind by kind: how often, and the newest of each; nothing is sent."""
    counts: dict[tuple[int, int], int] = {}
    newest: dict[tuple[int, int], Frame] = {}
    errors = 0
    end = line.now() + seconds
    while (left := end - line.now()) > 0.0:
        try:
            frame = line.receive(left)
        except LineError:
            errors += 1
            continue
        if frame is not None:
            kind = frame.identifier, frame.data[0] if frame.data else -1
            counts[kind], newest[kind] = counts.get(kind, 0) + 1, frame
    for kind, frame in sorted(newest.items()):
        yield f"{counts[kind]:6d}  {in_words(frame, BUS.described_firmware)}"
    if errors:
        yield f"{errors:6d}  error frames: check bit rate, termination and ground"
    if not newest and not errors:
        yield "  nothing: the bus is silent while no driver asks; that is as it should be"


def sent(shared: Shared, own: BusParameters, version: int) -> Iterator[str]:
    """What the driver sends to an arm with firmware of a version, from the first frame to the first cycle.

    It is played against the simulated arm, whose zero is not known yet, with a person who obeys.
    """
    line = _Overheard(simulated_line(shared, own, version, is_homed=False), version)
    arm = shared.arm
    bus = ArmBus(
        line,
        arm.motors.torque_constant,
        TransmissionMap.of(arm).motor_positions(arm.joints.start),
        shared.timing.period,
    )
    wait = Wait.NOTHING
    while not bus.is_running and not bus.fault:
        bus.go_on()
        bus.confirm_home()
        if bus.wait is not wait and bus.wait.value:
            wait = bus.wait
            line.texts.append(f"-- {wait.value}")
    line.texts.append("-- each period, torques only where the arm is enabled")
    bus.exchange()
    bus.release()
    bus.command([0.0] * len(bus.position))
    bus.close()
    yield from _counted(line.texts)


class _Overheard:
    """A line whose sent frames are noted."""

    def __init__(self, line: Line, version: int) -> None:
        self._line, self._version, self.texts = line, version, list[str]()
        self.now, self.sleep, self.let_pass = line.now, line.sleep, line.let_pass
        self.receive, self.close = line.receive, line.close

    def send(self, frame: Frame) -> None:
        """Send and note a frame."""
        self.texts.append(in_words(frame, self._version))
        self._line.send(frame)


def _counted(texts: list[str]) -> Iterator[str]:
    """Each text where it comes first, with how often it comes until the next remark."""
    counts: dict[str, int] = {}
    for text in [*texts, "--"]:
        if text.startswith("--"):
            yield from (f"{count:6d}  {one}" for one, count in counts.items())
            counts.clear()
            if text != "--":
                yield text
        else:
            counts[text] = counts.get(text, 0) + 1


def in_words(frame: Frame, version: int) -> str:
    """A frame: who sends it to whom, and what; the names of properties are those of a version of the firmware."""
    start = f"{frame.identifier:03x} {frame.data.hex(' '):24}{_node(frame.sender)}"
    found = frames.read(frame)
    if isinstance(found, Position):
        return f"{start} is at {found.motor} counts"
    if isinstance(found, Value):
        return f"{start} has {_name(found.number, version, found.node)} = {found.value}"
    if not frame.data:
        return f"{start}: no data"
    to = f"group {frame.receiver}" if frame.is_to_group else _node(frame.receiver)
    number, is_written = frame.data[0] & ~Bit.WRITE, bool(frame.data[0] & Bit.WRITE)
    name = _name(number, version, frame.receiver)
    if not is_written:
        return f"{start} to {to}: get {name}"
    if frame.is_to_group and frame.receiver in (BusGroup.ARM, BusGroup.WRIST) and name == "T":
        return f"{start} to {to}: torques {frames.read_torques(frame)} counts"
    return f"{start} to {to}: set {name} to {int.from_bytes(frame.data[2:], 'little', signed=True)}"


def _node(number: int) -> str:
    known = {BusNode.HOST: "host", BusNode.SAFETY_MODULE: "safety module"}
    return known.get(BusNode(number), "") if number in tuple(BusNode) else f"controller {number}"


def _name(number: int, version: int, node: int) -> str:
    return properties.names(version, node == BusNode.SAFETY_MODULE).get(number, f"property {number}")
