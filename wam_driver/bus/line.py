"""The line to the bus: what the driver needs of python-can, or of the simulated bus, and of a clock."""

from collections.abc import Callable
from typing import Any, Protocol

from wam_driver.bus.frames import Frame


class LineError(Exception):
    """A frame was not sent, or the adapter reports an error of the bus."""


class Line(Protocol):
    """A bus and its clock."""

    def now(self) -> float:
        """Steady time, s."""

    def sleep(self, seconds: float) -> None:
        """Wait."""

    def let_pass(self, seconds: float, late: float) -> None:
        """A period of the host has passed, s: a simulated bus goes on to its end, and forgives the late part."""

    def send(self, frame: Frame) -> None:
        """Send a frame; LineError where it was not."""

    def receive(self, timeout: float) -> Frame | None:
        """The next frame of another node, None where none comes in time; LineError at an error of the bus."""

    def close(self) -> None:
        """End the connection."""


class CanLine:
    """A bus of python-can.

    Parameters
    ----------
    bus : `can.Bus` of any interface.
    now, sleep : the steady clock, s.
    """

    def __init__(self, bus: Any, now: Callable[[], float], sleep: Callable[[float], None]) -> None:
        import can

        self._bus, self._message, self._error = bus, can.Message, can.CanError
        self.now, self.sleep = now, sleep

    def let_pass(self, seconds: float, late: float) -> None:
        """Nothing: real time passes by itself."""

    def send(self, frame: Frame) -> None:
        """Send a frame without waiting for a place in the queue."""
        try:
            self._bus.send(self._message(arbitration_id=frame.identifier, data=frame.data, is_extended_id=False), 0.0)
        except (self._error, OSError) as error:
            raise LineError(str(error)) from error

    def receive(self, timeout: float) -> Frame | None:
        """The next frame."""
        try:
            message = self._bus.recv(timeout)
        except (self._error, OSError) as error:
            raise LineError(str(error)) from error
        if message is None:
            return None
        if message.is_error_frame:
            raise LineError("error frame")
        return Frame(message.arbitration_id, bytes(message.data))

    def close(self) -> None:
        """End the connection."""
        self._bus.shutdown()
