"""A line of theory and points of the plant, and the distance of the points from the line."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]


class Series(NamedTuple):
    """A line, arrays (n,), and the points of the plant that should lie on it, (m,)."""

    x: Numbers
    y: Numbers
    plant_x: Numbers
    plant_y: Numbers

    @property
    def distance(self) -> float:
        """Greatest distance of a point from the line, relative to the line's extent in x and y.

        Normal to the line, because on a steep part a small error in x would be a large one in y.
        """
        spans = np.array([np.ptp(self.x), np.ptp(self.y)])
        line = np.transpose([self.x, self.y]) / spans
        return float(max(_distance(line, point) for point in np.transpose([self.plant_x, self.plant_y]) / spans))

    @property
    def relative_distance(self) -> float:
        """Greatest relative difference of a point from the line at its x; for logarithmic axes."""
        line = np.exp(np.interp(np.log(self.plant_x), np.log(self.x), np.log(self.y)))
        return float(np.abs(self.plant_y / line - 1.0).max())


def _distance(line: Numbers, point: Numbers) -> float:
    """Of a point from a polyline with corners (n, 2)."""
    begin, along = line[:-1], np.diff(line, axis=0)
    lengths = np.maximum(np.sum(along**2, axis=1), 1e-300)
    fraction = np.clip(np.sum((point - begin) * along, axis=1) / lengths, 0.0, 1.0)
    return float(np.min(np.linalg.norm(begin + fraction[:, np.newaxis] * along - point, axis=1)))
