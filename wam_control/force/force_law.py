"""The law of one axis of the force loop: saturation, deadband, G_I and G_P (5.5), (5.7), (5.23).

The order is that of `wam_theory.stick_slip.IntegralLoop`: the error is saturated first, and the
deadband at the input of G_I is subtracted from the rest, so that the velocity is continuous in the
error.  G_P acts as a velocity proportional to the rate of the saturated error at constant set
point: a step of the set point moves the arm through G_I alone, without a jerk.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from wam_control.force.thresholds import FORCE
from wam_description.parameters import each, require


@dataclass(frozen=True)
class ForceLaw:
    """The law of every axis; the axes run over `names`.

    Parameters
    ----------
    group : prefix of the parameters' names, 'force' or 'torque', for messages.
    names : of the axes: x y z of the force's frame, or the joints.
    gain : G_I, velocity per error.
    proportional_gain : G_P, displacement per error.
    error_limit : saturation of the error.
    deadband : subtracted from the size of the error at the input of G_I.

    Each has one value per axis or one for all; SI, N and m or N m and rad.

    Raises
    ------
    ParameterError
        where a list has another length, or a saturation is not above its deadband.
    """

    group: str
    names: tuple[str, ...]
    gain: tuple[float, ...]
    proportional_gain: tuple[float, ...]
    error_limit: tuple[float, ...]
    deadband: tuple[float, ...]

    def __post_init__(self) -> None:
        for field in ("gain", "proportional_gain", "error_limit", "deadband"):
            values, names = tuple(getattr(self, field)), self.names
            require(
                len(values) in (1, len(names)),
                f"parameter '{self.group}_{field}' has {len(values)} values; give {len(names)}, one for each of "
                f"{', '.join(names)}, or one for all",
            )
            object.__setattr__(self, field, each(values, len(names)))
        for name, limit, deadband in zip(self.names, self.error_limit, self.deadband, strict=True):
            require(
                limit > deadband,
                f"{self.group}_error_limit of {name} is {limit:g}; it must be above {self.group}_deadband, "
                f"{deadband:g}: raise the first or lower the second",
            )

    def limited(self, axis: int, error: float) -> float:
        """Error after saturation."""
        limit = self.error_limit[axis]
        return min(max(error, -limit), limit)

    def velocity(self, axis: int, error: float, before: float, dt: float) -> float:
        """Velocity of one axis.

        Parameters
        ----------
        axis : index of the axis.
        error : set point minus measurement.
        before : the same set point minus the measurement of the period before.
        dt : period, s.
        """
        effective = max(min(abs(error), self.error_limit[axis]) - self.deadband[axis], 0.0)
        velocity = self.gain[axis] * math.copysign(effective, error)
        proportional = self.proportional_gain[axis]
        if proportional:
            velocity += proportional * (self.limited(axis, error) - self.limited(axis, before)) / dt
        return velocity

    def along(self, axis: Sequence[float]) -> "ForceLaw":
        """The law of the error along one unit vector of the frame: its saturation and deadband are ellipsoids.

        Saturated axis by axis, an error along a diagonal could be sqrt(3) times as large.
        """
        return _along(self, tuple(axis))


@lru_cache  # the same in every period of a command
def _along(law: ForceLaw, axis: tuple[float, ...]) -> ForceLaw:
    squares = [part * part for part in axis]

    def mean(values: Sequence[float]) -> float:
        return sum(a * b for a, b in zip(squares, values, strict=True))

    def radius(values: Sequence[float]) -> float:
        used = [(part, value) for part, value in zip(axis, values, strict=True) if part * part > FORCE.negligible]
        if not all(value for _, value in used):
            return 0.0
        first = used[0][1]
        if all(value == first for _, value in used):
            return first
        return math.hypot(*(part for part, _ in used)) / math.hypot(*(part / value for part, value in used))

    return ForceLaw(
        law.group,
        ("along",),
        (mean(law.gain),),
        (mean(law.proportional_gain),),
        (radius(law.error_limit),),
        (radius(law.deadband),),
    )
