"""One motor, by the counts that its controller sends."""

import math

from wam_driver.thresholds import BUS


class MotorTrack:
    """Its angle and velocity.

    Parameters
    ----------
    counts : per turn.

    Attributes
    ----------
    position, velocity : rad, rad/s.
    missed : periods since the last position, as the cycle counts them.
    has_jumped : whether one was dropped since then.
    """

    def __init__(self, counts: int) -> None:
        self.position = self.velocity = 0.0
        self.missed, self.has_jumped = 0, False
        self._step = math.tau / counts
        self._time = math.nan  # s, of the last position

    def take(self, count: int, time: float) -> bool:
        """Take a position of a time, s, unless the motor cannot be there."""
        position = count * self._step
        moved, dt = position - self.position, time - self._time
        if dt > 0.0:
            if abs(moved) > BUS.jump * math.tau * max(1.0, dt / BUS.silent):
                self.has_jumped = True
                return False
            self.velocity = moved / dt
        self.position, self._time = position, time
        self.missed, self.has_jumped = 0, False
        return True
