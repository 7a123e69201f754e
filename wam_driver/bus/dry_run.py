"""A dry run: what is on the bus, without a frame of ours, and what the driver would send."""

from collections import defaultdict
from collections.abc import Iterable, Iterator

from wam_description.arm import Shared
from wam_driver.bus import frames, properties
from wam_driver.bus.arm_bus import ArmBus
from wam_driver.bus.bus_parameters import BusParameters
from wam_driver.bus.frames import HOST, SAFETY, BusGroup, Frame
from wam_driver.bus.line import Line, incoming
from wam_driver.bus.safety_module import SafetyMode
from wam_driver.bus.simulator import SimulatedBus
from wam_driver.thresholds import BUS


def heard(line: Line, seconds: float) -> Iterator[str]:
    """What comes on a bus within a time, s; nothing is sent."""
    texts = list(_listed(incoming(line, seconds), BUS.described_firmware))
    if errors := line.counts["bus errors"]:
        texts.append(f"{errors:6d}  error frames: check bit rate, termination and ground")
    yield from texts or ["  nothing: the bus is silent while no driver asks; that is as it should be"]


def sent(shared: Shared, own: BusParameters, version: int) -> Iterator[str]:
    """What the driver sends to an arm with firmware of a version, from the first frame to the last.

    It is played against the simulated arm, whose zero is lost by an E-stop, with a person who obeys.
    """
    bus = SimulatedBus(shared, own, version)
    bus.switch(SafetyMode.ESTOP)
    arm = ArmBus(bus, shared.arm, shared.timing.period, own.home)
    parts, remark = defaultdict[str, list[Frame]](list), ""

    def overhear(frame: Frame) -> list[Frame]:
        if frame.sender == HOST:
            parts[remark or arm.advice].append(frame)
        return [frame]

    bus.on_line = overhear
    while arm.advice and not arm.trouble:
        arm.exchange()
        arm.confirm_home()
    poll = round(BUS.poll / shared.timing.period)
    remark = f"in every {poll} periods"
    for _ in range(poll):
        arm.exchange()
    remark = "at enable"
    arm.brake(False)
    remark = "in each period while the arm is enabled"
    arm.command(arm.state.effort)
    remark = "at disable"
    arm.brake(True)
    remark = "at estop, at a fault of the bus, and at the end"
    arm.close()
    for when, found in parts.items():
        yield f"-- {when}"
        yield from _listed(found, version)


def _listed(found: Iterable[Frame], version: int) -> Iterator[str]:
    """Each kind of frame, how often it comes, and the newest of it."""
    kinds = defaultdict[tuple[int, bytes], list[Frame]](list)
    for frame in found:
        kinds[frame.identifier, frame.data[:1] if frame.sender else frame.data].append(frame)
    return (f"{len(kind):6d}  {in_words(kind[-1], version)}" for kind in kinds.values())


def in_words(frame: Frame, version: int) -> str:
    """A frame: who sends it to whom, and what; the names of properties are those of a version of the firmware."""
    start = f"{frame.identifier:03x} {frame.data.hex(' '):24}{_node(frame.sender)}"
    if found := frames.read(frame):
        name = "P" if found.number is None else _name(found.number, version, found.node)
        return f"{start} has {name} = {found.value}"
    if not frame.data:
        return f"{start}: no data"
    is_to_group = frame.receiver >= BusGroup.ANY
    start += f" to {f'group {frame.receiver - BusGroup.ANY}' if is_to_group else _node(frame.receiver)}: "
    name = _name(frame.data[0] & ~frames.WRITE, version, frame.receiver)
    if not frame.data[0] & frames.WRITE:
        return f"{start}get {name}"
    if is_to_group and name == "T":
        return f"{start}torques {frames.read_torques(frame)} counts"
    return f"{start}set {name} to {frames.written(frame)}"


def _node(number: int) -> str:
    return {HOST: "host", SAFETY: "safety module"}.get(number, f"controller {number}")


def _name(number: int, version: int, node: int) -> str:
    return properties.names(version, node == SAFETY).get(number, f"property {number}")
