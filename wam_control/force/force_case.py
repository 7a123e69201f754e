"""A force as it is commanded, or might be: where it acts, how the arm moves along it, and how well it is known."""

import math
from typing import NamedTuple

from wam_control.force.contact_position import ForcePoint
from wam_control.force.force_axis import ForceAxis


class ForceCase(NamedTuple):
    """A force at a position in a pose.

    Attributes
    ----------
    axis : of the force.
    point : where it acts.
    desired : commanded force, N.
    signal : its torques per standard deviation of the estimated ones; infinite with sensors.
    elsewhere : the same if another link is touched.
    torque_error : standard deviation of the force by those of the estimated torques, N; 0 with sensors.
    unknown, meaning : force, N, of torques at rest before, which no touched surface gives, and what they mean.
    """

    axis: ForceAxis
    point: ForcePoint
    desired: float
    signal: float = math.inf
    elsewhere: float = math.inf
    torque_error: float = 0.0
    unknown: float = 0.0
    meaning: str = ""

    def worse(self, factor: float) -> "ForceCase":
        """The same, with all that is not known of it larger by a factor, and the arm as much slower."""
        axis = self.axis
        return self._replace(
            axis=axis._replace(force_sd=factor * axis.force_sd, speed_fraction=axis.speed_fraction / factor),
            signal=self.signal / factor,
            elsewhere=self.elsewhere / factor,
            torque_error=factor * self.torque_error,
            unknown=factor * self.unknown,
        )
