"""Friction node and force loop: the parameters of chapter 5's models (figures 5.2 and 5.4).

    J x'' = k_tr (x_m - x) - F_c - b x' - friction,    F_c = k_c x,    x_m' = G_I F_error

Units are free but consistent (N, m, s or N m, rad, s).
"""

import math
from dataclasses import dataclass

_INF = math.inf


@dataclass(frozen=True, slots=True)
class FrictionNode:
    """Inertia with dry friction between transmission and contact (figure 5.4).

    Parameters
    ----------
    inertia : J_l, kg m^2 (or kg), above zero.
    damping : b, N m s/rad, zero or more.
    transmission_stiffness : k_tr at the node, N m/rad, above zero.
    contact_stiffness : k_c at the node, N m/rad, above zero.
    dynamic_friction : F_dynamic, N m, zero or more.
    static_friction : F_static, N m, at least F_dynamic; Coulomb friction if both are equal.
    unilateral : whether the contact only pushes, F_c = k_c max(x, 0).

    Raises
    ------
    ValueError
        if a value is out of its range.
    """

    inertia: float
    damping: float
    transmission_stiffness: float
    contact_stiffness: float
    dynamic_friction: float
    static_friction: float
    unilateral: bool = False

    def __post_init__(self) -> None:
        """Refuse values out of range; store the others as Python floats, which are faster than numpy's."""
        _as_floats(self, "inertia", "damping", "transmission_stiffness", "contact_stiffness")
        _as_floats(self, "dynamic_friction", "static_friction")
        for name in ("inertia", "transmission_stiffness", "contact_stiffness"):
            require(name, getattr(self, name), above=0.0)
        for name in ("damping", "dynamic_friction"):
            require(name, getattr(self, name), at_least=0.0)
        require("static_friction", self.static_friction, at_least=self.dynamic_friction)

    @property
    def natural_frequency(self) -> float:
        """Without damping, between transmission and contact, rad/s."""
        return math.sqrt((self.transmission_stiffness + self.contact_stiffness) / self.inertia)


@dataclass(frozen=True, slots=True)
class IntegralLoop:
    """Integral force control through a velocity-controlled motor (5.5).

    F_error is saturated at `error_limit`; the deadband at the input of G_I then reduces its magnitude by
    `deadband` (5.7), so that the motor's speed is continuous in the error.

    Parameters
    ----------
    gain : G_I, rad/s of x_m for one N m of error, above zero.
    error_limit : N m, above the deadband; infinite for none.
    deadband : N m, zero or more.
    sample_period : s, of the zero-order hold; zero for a continuous loop.
    delay_samples : whole periods between a sample and its command; with zero the command follows in the same period.

    Raises
    ------
    ValueError
        if a value is out of its range.
    """

    gain: float
    error_limit: float = _INF
    deadband: float = 0.0
    sample_period: float = 0.0
    delay_samples: int = 0

    def __post_init__(self) -> None:
        """Refuse values out of range; store the others as Python floats, which are faster than numpy's."""
        _as_floats(self, "gain", "error_limit", "deadband", "sample_period")
        require("gain", self.gain, above=0.0)
        require("deadband", self.deadband, at_least=0.0)
        if not self.error_limit > self.deadband:
            raise ValueError(f"error_limit is {self.error_limit}; it must be above the deadband, {self.deadband}")
        require("sample_period", self.sample_period, at_least=0.0)
        require_whole("delay_samples", self.delay_samples)
        if self.delay_samples and not self.sample_period:
            raise ValueError(f"delay_samples is {self.delay_samples}; without a sample_period it must be zero")

    def effective_error(self, error: float) -> float:
        """Error that G_I sees, N m, after saturation and deadband."""
        return math.copysign(max(min(abs(error), self.error_limit) - self.deadband, 0.0), error)


def _as_floats(instance: object, *names: str) -> None:
    """Convert fields of a frozen instance to floats."""
    for name in names:
        object.__setattr__(instance, name, float(getattr(instance, name)))


def require(name: str, value: float, above: float | None = None, at_least: float | None = None) -> None:
    """Refuse a value that is not finite or not in its range.

    Parameters
    ----------
    name, value : of the argument.
    above, at_least : the bound, one of the two.
    """
    if above is not None and not above < value < _INF:
        raise ValueError(f"{name} is {value}; it must be finite and above {above:g}")
    if at_least is not None and not at_least <= value < _INF:
        raise ValueError(f"{name} is {value}; it must be finite and at least {at_least:g}")


def require_whole(name: str, value: float) -> None:
    """Refuse a value that is not a whole number, zero or more.

    Parameters
    ----------
    name, value : of the argument.
    """
    if not value >= 0 or value % 1:
        raise ValueError(f"{name} is {value}; it must be a whole number, zero or more")
