"""Velocities of shafts fitted to their angles, over as few samples as the steps of the encoder allow."""

import math
from collections import deque

import numpy as np

from wam_control.contact.thresholds import CONTACT
from wam_description.signals import State

THIRD = 1.25 / math.sqrt(20.0)  # sd of an angle per mean size of its third difference, of variance 1 + 9 + 9 + 1


class VelocityFit:
    """Least-squares slope of the angle over the samples of a window, which ends with the newest sample.

    A velocity that is the difference of two counts has the error of both; that of a rotor that swings on its cables is
    not that of the link.  Both show in the third difference of the angle, which smooth motion hardly changes.  The
    window is the shortest that makes the velocity certain enough and never becomes shorter.  A window of one sample
    passes states as they are.

    Attributes
    ----------
    delay : s, of the fitted state.
    """

    def __init__(self, n: int, rest_velocity: float) -> None:
        self._third, self._rest = [0.0] * n, rest_velocity
        self._choice = 0
        self.reset()

    def reset(self) -> None:
        """Forget the samples, not the error of the angles."""
        self._samples: deque[tuple[float, State]] = deque(maxlen=2 * CONTACT.half_windows[-1] + 1)
        self._time, self._middle = 0.0, math.nan
        self._period, self.delay = math.inf, 0.0

    @property
    def sd(self) -> list[float]:
        """Standard deviation of the velocity of each shaft, rad/s."""
        half = CONTACT.half_windows[self._choice]
        # half a window and more: sum of the squared distances from the middle; none: a difference of two
        squares = half * (half + 1) * (2 * half + 1) / 3.0 if half else 0.5
        per_mean = THIRD / (math.sqrt(squares) * self._period)
        return [per_mean * mean for mean in self._third]

    def take(self, state: State, dt: float) -> tuple[State, float] | None:
        """Take a sample `dt` seconds after the last; None while the window fills or grows.

        Returns the state in the middle of the window, and by how many seconds the state before it is older.
        """
        samples = self._samples
        self._time += dt
        samples.append((self._time, state))
        self._follow(dt)
        half = CONTACT.half_windows[self._choice]
        if half == 0:
            return state, dt
        if len(samples) <= 2 * half:
            return None
        window = list(samples)[-2 * half - 1 :]
        times, angles = np.array([time for time, _ in window]), np.array([each.position for _, each in window])
        middle, before = float(times.mean()), self._middle
        if middle - before < 0.5 * dt:  # none since the window has grown
            return None
        self._middle, self.delay = middle, self._time - middle
        times -= middle
        velocity = times @ (angles - angles[half]) / (times @ times)  # of a shaft at rest exactly zero
        fitted = State(angles.mean(axis=0).tolist(), velocity.tolist(), window[half][1].effort)
        return fitted, dt if math.isnan(before) else middle - before

    def _follow(self, dt: float) -> None:
        """Follow the error of the angles, and take a longer window where it calls for one."""
        samples = self._samples
        if len(samples) > 3 and abs(self._time - samples[-4][0] - 3.0 * dt) < CONTACT.uniform * dt:
            least, third = 3.0 * dt * self._rest, self._third
            positions = [samples[i][1].position for i in (-4, -3, -2, -1)]
            for i, (a, b, c, d) in enumerate(zip(*positions, strict=True)):
                moved = d - a
                if moved > least or moved < -least:
                    size, mean = abs(moved + 3.0 * (b - c)), third[i]
                    if not size < CONTACT.largest_step:
                        continue
                    third[i] = mean + (CONTACT.follow_up if size > mean else CONTACT.follow_down) * (size - mean)
        self._period, longer = dt, self._choice + 1
        if (
            longer < len(CONTACT.half_windows)
            and 2 * CONTACT.half_windows[longer] * dt < CONTACT.longest_window
            and max(self.sd) > CONTACT.velocity_sd
        ):
            if self._choice == 0:
                self._middle = self._time
            self._choice = longer
