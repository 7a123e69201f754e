"""What an axis of the force loop makes of its error: saturation, dead zone, G_I and G_P (5.5), (5.7), (5.23).

The order is that of `wam_theory.stick_slip.ForceLoop`: the error is saturated first, and at the
input of G_I a dead zone takes its width from what is left, so that the velocity is continuous in
the error.  G_P acts on velocity level as the rate of the saturated error for one and the same set
point: a step of the set point moves the arm through G_I alone, without a jerk.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from wam_description.parameters import require


@dataclass(frozen=True)
class ForceLaw:
    """The law of every axis; the axes run over `names`.

    Parameters
    ----------
    group : beginning of the parameters' names, 'force' or 'torque', for messages.
    names : of the axes: x y z of the force's frame, or the joints.
    gain : G_I, velocity per error.
    proportional_gain : G_P, displacement per error.
    error_limit : saturation of the error.
    deadband : width that is taken from the error at the input of G_I.

    Each is one value for every axis or a single one for all; SI, N and m or N m and rad.

    Raises
    ------
    ParameterError
        where a list has another length, or a saturation is not above its dead zone.
    """

    group: str
    names: tuple[str, ...]
    gain: tuple[float, ...]
    proportional_gain: tuple[float, ...]
    error_limit: tuple[float, ...]
    deadband: tuple[float, ...]

    def __post_init__(self) -> None:
        for field in ("gain", "proportional_gain", "error_limit", "deadband"):
            object.__setattr__(self, field, per_axis(f"{self.group}_{field}", getattr(self, field), self.names))
        for name, limit, deadband in zip(self.names, self.error_limit, self.deadband, strict=True):
            require(
                limit > deadband,
                f"{self.group}_error_limit of {name} is {limit:g}; it must be above {self.group}_deadband, "
                f"{deadband:g}: raise the one or lower the other",
            )

    def limited(self, axis: int, error: float) -> float:
        """Error after saturation."""
        limit = self.error_limit[axis]
        return min(max(error, -limit), limit)

    def effective(self, axis: int, error: float) -> float:
        """Error that G_I sees, after saturation and dead zone."""
        return math.copysign(max(min(abs(error), self.error_limit[axis]) - self.deadband[axis], 0.0), error)

    def velocity(self, axis: int, error: float, before: float, dt: float) -> float:
        """Velocity of one axis.

        Parameters
        ----------
        axis : which, counted from 0.
        error : set point less what is measured.
        before : the same set point less what was measured one period before.
        dt : period, s.
        """
        velocity = self.gain[axis] * self.effective(axis, error)
        proportional = self.proportional_gain[axis]
        if proportional:
            velocity += proportional * (self.limited(axis, error) - self.limited(axis, before)) / dt
        return velocity


def per_axis(field: str, given: Sequence[float], names: Sequence[str]) -> tuple[float, ...]:
    """One value for every axis, from as many or from a single one.

    Raises
    ------
    ParameterError
        where there is another number of values.
    """
    values = tuple(given)
    require(
        len(values) in (1, len(names)),
        f"parameter '{field}' has {len(values)} values; give {len(names)}, one for each of {', '.join(names)}, "
        "or one for all",
    )
    return values * len(names) if len(values) == 1 else values
