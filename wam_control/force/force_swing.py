"""Swings: limit cycles of the measured force, and of the position under a dither."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from wam_control.force.thresholds import FORCE

Array = NDArray[np.float64]


class Reversals:
    """Finds a cycle in a signal: it turns back again and again, by more than noise does."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget all values."""
        self._time, self._sense = 0.0, 0
        self._extreme = self._before = self.peak_to_peak = 0.0
        self._turns: deque[tuple[float, float]] = deque()

    def step(self, value: float, least: float, window: float, dt: float) -> bool:
        """Whether the signal has turned back by at least `least` for `swing_cycles` cycles within `window`, s.

        Afterwards `peak_to_peak` and `period` are the means of these cycles.
        """
        self._time += dt
        if not self._sense:
            self._sense, self._extreme, self._before = 1, value, value
        if self._sense * (value - self._extreme) >= 0.0:
            self._extreme = value
        elif abs(value - self._extreme) >= least:
            self._turns.append((self._time, abs(self._extreme - self._before)))
            self._before, self._extreme, self._sense = self._extreme, value, -self._sense
        while self._turns and self._turns[0][0] < self._time - window:
            self._turns.popleft()
        return len(self._turns) > 2 * FORCE.swing_cycles

    @property
    def count(self) -> int:
        """Number of turns within the window."""
        return len(self._turns)

    @property
    def cycle(self) -> tuple[float, float]:
        """Mean peak to peak, in the unit of the signal, and period, s; zeros before two turns."""
        if len(self._turns) < 2:
            return 0.0, 0.0
        (first, _), (last, _) = self._turns[0], self._turns[-1]
        swings = [size for _, size in list(self._turns)[1:]]
        return sum(swings) / len(swings), 2.0 * (last - first) / len(swings)


class Shake:
    """Motion of the joints about its own course, over a window of whole cycles of a dither, of so many samples."""

    def __init__(self, samples: int) -> None:
        self.samples = samples
        self._poses: deque[Array] = deque(maxlen=samples + 1)

    def reset(self) -> None:
        """Forget all motion."""
        self._poses.clear()

    def step(self, moved: Array) -> None:
        """Take the motion in a period (n,), rad."""
        self._poses.append(self._poses[-1] + moved if self._poses else moved)

    def along(self, lever: Array) -> float:
        """Peak to peak of a way, m, per angle (n,), m, less its straight course; 0 until the window is full."""
        if len(self._poses) < (self._poses.maxlen or 0):
            return 0.0
        way = np.array(self._poses) @ lever
        rest = way - np.linspace(way[0], way[-1], len(way))
        return float(rest.max() - rest.min())
