"""One motor, by the counts that its controller sends."""

import math

from wam_driver.bus.frames import counts
from wam_driver.thresholds import BUS


class MotorTrack:
    """Its angle and velocity.

    Parameters
    ----------
    node : its controller.
    turn : counts per turn.

    Attributes
    ----------
    position, velocity : rad, rad/s.
    missed : periods since the last position, as the cycle counts them.
    has_jumped : whether one was dropped since then.
    """

    def __init__(self, node: int, turn: int) -> None:
        self.node, self._step = node, math.tau / turn
        self.position = self.velocity = 0.0
        self.missed, self.has_jumped = 0, False
        self._jump = BUS.jump * math.tau
        self._time = math.nan  # s, of the last position

    def take(self, answer: bytes, time: float) -> bool:
        """Take the answer of the controller at a time, s, unless the motor cannot be there."""
        position = counts(answer) * self._step
        moved, dt = position - self.position, time - self._time
        if dt > 0.0:
            if abs(moved) > self._jump and abs(moved) > self._jump * dt / BUS.silent:
                self.has_jumped = True
                return False
            self.velocity = moved / dt
        self.position, self._time = position, time
        self.missed, self.has_jumped = 0, False
        return True
