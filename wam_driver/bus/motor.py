"""One motor, by what its controller sends and takes."""

import math

from wam_driver.thresholds import BUS


class Motor:
    """Angle, velocity and commanded current of one motor.

    Parameters
    ----------
    node : its controller.
    turn : counts per turn.
    gain : counts of torque per ampere.
    limit : largest torque, counts.

    Attributes
    ----------
    position, velocity : rad, rad/s; a position that is not known yet is NaN.
    current : that was sent, A.
    missed : periods since the last position, as the cycle counts them.
    owed : answers to requests of a position that have not come.
    has_jumped : whether one was dropped since then.
    """

    def __init__(self, node: int, turn: int, gain: float, limit: int) -> None:
        self.node, self._step, self._gain, self._limit = node, math.tau / turn, gain, limit
        self.position, self.velocity, self.current = math.nan, 0.0, 0.0
        self.missed, self.owed, self.has_jumped = 0, 0, False
        self._time = math.nan  # s, of the last position

    def count_at(self, angle: float) -> int:
        """Counts at an angle, rad."""
        return math.floor(angle / self._step)

    def torque(self, current: float) -> int:
        """Counts of torque for a current, A, clipped."""
        count = max(-self._limit, min(self._limit, round(current * self._gain)))
        self.current = count / self._gain
        return count

    def take(self, count: int, time: float) -> bool:
        """Take the position, counts, that its controller answers at a time, s, unless the motor cannot be there."""
        position = count * self._step
        moved, dt = position - self.position, time - self._time
        if dt > 0.0:
            if abs(moved) > BUS.jump * max(1.0, dt / BUS.silent):
                self.has_jumped = True
                return False
            self.velocity = moved / dt
        self.position, self._time = position, time
        self.missed, self.has_jumped = 0, False
        return True
