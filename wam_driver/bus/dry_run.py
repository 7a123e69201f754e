"""A dry run: what is on the bus, without a frame of ours, and what the driver would send."""

from collections import Counter
from collections.abc import Iterable, Iterator

from wam_description.arm import Shared
from wam_driver.bus import frames, properties
from wam_driver.bus.arm_bus import ArmBus
from wam_driver.bus.frames import Bit, BusNode, Frame
from wam_driver.bus.host import Host
from wam_driver.bus.interface import BusParameters
from wam_driver.bus.line import Line
from wam_driver.bus.simulator import SimulatedBus
from wam_driver.thresholds import BUS


def heard(line: Line, seconds: float) -> Iterator[str]:
    """What comes on a bus within a time, s; nothing is sent."""
    host = Host(line)
    texts = list(_listed(_received(host, host.now() + seconds), BUS.described_firmware))
    if errors := host.counts["bus errors"]:
        texts.append(f"{errors:6d}  error frames: check bit rate, termination and ground")
    yield from texts or ["  nothing: the bus is silent while no driver asks; that is as it should be"]


def _received(host: Host, end: float) -> Iterator[Frame]:
    while (left := end - host.now()) > 0.0:
        if frame := host.receive(left):
            yield frame


def sent(shared: Shared, own: BusParameters, version: int) -> Iterator[str]:
    """What the driver sends to an arm with firmware of a version, from the first frame to the first cycle.

    It is played against the simulated arm, whose zero is not known yet, with a person who obeys.
    """
    bus = SimulatedBus.of(shared, own, version, is_homed=False)
    parts: list[tuple[str, list[Frame]]] = [("the driver starts", [])]

    def overhear(frame: Frame) -> list[Frame]:
        if frame.sender == BusNode.HOST:
            parts[-1][1].append(frame)
        return [frame]

    bus.on_line = overhear
    arm = ArmBus(bus, shared.arm, shared.timing.period)
    while not arm.is_running and not arm.fault:
        arm.exchange()
        arm.confirm_home()
        if arm.advice != parts[-1][0]:
            parts.append((arm.advice, []))
    parts.append(("each period, torques only where the arm is enabled", []))
    arm.exchange()
    arm.release()
    arm.command([0.0] * len(arm.position))
    arm.close()
    for remark, found in parts:
        yield f"-- {remark}"
        yield from _listed(found, version)


def _listed(found: Iterable[Frame], version: int) -> Iterator[str]:
    """Each kind of frame, how often it comes, and the newest of it."""
    counts, newest = Counter[tuple[int, bytes]](), dict[tuple[int, bytes], Frame]()
    for frame in found:
        kind = frame.identifier, frame.data[:1] if frame.sender else frame.data
        counts[kind] += 1
        newest[kind] = frame
    return (f"{counts[kind]:6d}  {in_words(frame, version)}" for kind, frame in newest.items())


def in_words(frame: Frame, version: int) -> str:
    """A frame: who sends it to whom, and what; the names of properties are those of a version of the firmware."""
    start = f"{frame.identifier:03x} {frame.data.hex(' '):24}{_node(frame.sender)}"
    found = frames.read(frame)
    if found and found.number is None:
        return f"{start} is at {found.value} counts"
    if found and found.number is not None:
        return f"{start} has {_name(found.number, version, found.node)} = {found.value}"
    if not frame.data:
        return f"{start}: no data"
    start += f" to {f'group {frame.receiver}' if frame.is_to_group else _node(frame.receiver)}: "
    name = _name(frame.data[0] & ~Bit.WRITE, version, frame.receiver)
    if not frame.data[0] & Bit.WRITE:
        return f"{start}get {name}"
    if frame.is_to_group and name == "T":
        return f"{start}torques {frames.read_torques(frame)} counts"
    return f"{start}set {name} to {frames.written(frame)}"


def _node(number: int) -> str:
    known: dict[int, str] = {BusNode.HOST: "host", BusNode.SAFETY_MODULE: "safety module"}
    return known.get(number, f"controller {number}")


def _name(number: int, version: int, node: int) -> str:
    return properties.names(version, node == BusNode.SAFETY_MODULE).get(number, f"property {number}")
