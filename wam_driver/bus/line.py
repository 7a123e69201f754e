"""The line to the bus: one of python-can and a clock, or the simulated one."""

from collections import Counter
from collections.abc import Iterator
from typing import Any

from wam_description.arm import Shared
from wam_description.parameters import ParameterError, require
from wam_driver.bus.bus_parameters import SIMULATED, BusParameters
from wam_driver.bus.frames import HOST, Frame
from wam_driver.bus.simulator import SimulatedBus
from wam_driver.thresholds import BUS


class CanLine:
    """A bus of python-can.

    Parameters
    ----------
    bus : `can.Bus` of any interface.
    clock : of the computer, the module `time`.
    slack : s, by which answers may be late; above 0 for a simulated arm in another process, whose bus gives own frames
        back.

    Attributes
    ----------
    counts : of errors.
    """

    def __init__(self, bus: Any, clock: Any, slack: float = 0.0) -> None:
        import can

        self._bus, self._errors, self.slack = bus, (can.CanError, OSError), slack
        self._message: Any = can.Message(is_extended_id=False)  # to be sent, again and again
        self.now, self.sleep, self.close = clock.perf_counter, clock.sleep, bus.shutdown
        self.counts: Counter[str] = Counter()

    def let_pass(self, seconds: float) -> None:
        """A period of the host has passed, s: real time passes by itself."""

    def send(self, frame: Frame) -> bool:
        """Send a frame without waiting for a place in the queue; whether the adapter took it."""
        message = self._message
        message.arbitration_id, message.data = frame
        message.dlc = len(frame.data)
        try:
            self._bus.send(message, 0.0)
        except self._errors:
            return False
        return True

    def receive(self, timeout: float) -> Frame | None:
        """The next frame of data; None where none comes in time, s, or the bus fails."""
        end = self.now() + timeout
        try:
            while message := self._bus.recv(max(0.0, end - self.now())):
                if message.is_error_frame:
                    self.counts["bus errors"] += 1
                elif not (message.is_extended_id or message.is_remote_frame):  # those are none of this arm
                    return Frame(message.arbitration_id, bytes(message.data))
        except self._errors:
            self.counts["bus errors"] += 1
        return None


Line = CanLine | SimulatedBus


def incoming(line: Line, seconds: float) -> Iterator[Frame]:
    """Frames that come within a time, s."""
    end = line.now() + seconds
    while (left := end - line.now()) > 0.0:
        if frame := line.receive(left):
            yield frame


def line_of(shared: Shared, own: BusParameters, clock: Any) -> Line:
    """The line to the bus of a driver, with the clock of a real one, the module `time`.

    Raises
    ------
    ParameterError
        where python-can is not installed, or cannot open the bus.
    """
    if own.interface == SIMULATED:
        require(
            own.channel.isdigit(),
            f"channel of a simulated bus is '{own.channel}'; give the firmware of its controllers, for example '200'",
        )
        return SimulatedBus(shared, own, int(own.channel))
    try:
        import can

        bus = can.Bus(interface=own.interface, channel=own.channel or None)
    except ImportError as error:
        raise ParameterError("python-can is not installed: pip install 'wam_stack[bus]'") from error
    except (can.CanError, OSError, ValueError) as error:
        raise ParameterError(f"bus {own.interface} {own.channel}: {error}; check adapter and 'ip link'") from error
    return CanLine(bus, clock, BUS.slack if own.interface == "udp_multicast" else 0.0)


def answer(line: Line, arm: SimulatedBus, timeout: float) -> None:
    """Let a simulated arm answer the next frame on a line, as `virtual` or `udp_multicast`, if one comes in time, s.

    If nothing comes, the arm does not fault for silence, since a busy computer may hold up the host.
    """
    begin = line.now()
    frame = next((frame for frame in incoming(line, timeout) if frame.sender == HOST), None)  # others: an echo
    if frame is not None:
        arm.send(frame)
    while (found := arm.receive(0.0)) is not None:
        line.send(found)
    late = min(line.now() - begin, 2.0 * timeout)  # on a slow computer the arm is slow, not late
    arm.let_pass(late, BUS.silent if frame else 0.0)
