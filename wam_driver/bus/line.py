"""The line to the bus: one of python-can and a clock, or the simulated one."""

from collections import Counter
from collections.abc import Callable
from typing import Any

from wam_description.arm import Shared
from wam_description.parameters import ParameterError
from wam_driver.bus.frames import BusNode, Frame
from wam_driver.bus.parameters import SIMULATED, BusParameters
from wam_driver.bus.simulator import SimulatedBus
from wam_driver.thresholds import BUS


class CanLine:
    """A bus of python-can.

    Parameters
    ----------
    bus : `can.Bus` of any interface.
    now, sleep : the steady clock, s.
    slack : s, by which answers may be late; above 0 for a simulated arm in another process, whose bus gives own frames
        back.

    Attributes
    ----------
    counts : of errors.
    """

    def __init__(self, bus: Any, now: Callable[[], float], sleep: Callable[[float], None], slack: float = 0.0) -> None:
        import can

        self._bus, self._errors, self.slack = bus, (can.CanError, OSError), slack
        self._message: Any = can.Message(is_extended_id=False)  # to be sent, again and again
        self.now, self.sleep, self.close = now, sleep, bus.shutdown
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
        """The next frame; None where none comes in time, s, or at an error of the bus."""
        try:
            message = self._bus.recv(timeout)
        except self._errors:
            self.counts["bus errors"] += 1
            return None
        if message is None:
            return None
        if message.is_error_frame:
            self.counts["bus errors"] += 1
            return None
        return Frame(message.arbitration_id, bytes(message.data))


Line = CanLine | SimulatedBus


def line_of(shared: Shared, own: BusParameters, now: Callable[[], float], sleep: Callable[[float], None]) -> Line:
    """The line to the bus of a driver; a real one uses the clock, s, and waits.

    Raises
    ------
    ParameterError
        where python-can is not installed, or cannot open the bus.
    """
    if own.interface == SIMULATED:
        return SimulatedBus(shared, own, int(own.channel))
    try:
        import can

        bus = can.Bus(interface=own.interface, channel=own.channel or None)
    except ImportError as error:
        raise ParameterError("python-can is not installed: pip install 'wam_stack[bus]'") from error
    except (can.CanError, OSError, ValueError) as error:
        raise ParameterError(f"bus {own.interface} {own.channel}: {error}; check adapter and 'ip link'") from error
    return CanLine(bus, now, sleep, BUS.slack if own.interface == "udp_multicast" else 0.0)


class ServedArm:
    """A simulated arm on a line such as `virtual` or `udp_multicast`, in the line's time.

    Time in which nothing comes from the host is no silence to it, since a computer may hold up the host.
    """

    def __init__(self, line: Line, arm: SimulatedBus) -> None:
        self._line, self._arm, self._passed = line, arm, line.now()

    def answer(self, timeout: float) -> None:
        """Answer the next frame, if one comes in time, s."""
        while (frame := self._line.receive(timeout)) is not None and frame.sender != BusNode.HOST:
            pass  # an echo
        if frame is not None:
            self._arm.send(frame)
        while (found := self._arm.receive(0.0)) is not None:
            self._line.send(found)
        now = self._line.now()
        late = min(now - self._passed, 2.0 * timeout)  # on a slow computer the arm is slow, not late
        self._arm.let_pass(late, BUS.silent if frame else 0.0)
        self._passed = now
