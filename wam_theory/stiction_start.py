"""Asymmetric start of the stiction limit cycle, and how its period converges (section 5.4; not in print).

At a standstill F_c is an error e below F_des; the next slip moves it by D of (5.8), and the following one back.
Half way between is the symmetric cycle; u = e - D/2 is the asymmetry.  Without motion of the motor during the
slip every e below D repeats indefinitely; with it each slip takes the part `kappa` of u away.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from wam_theory.arguments import Array, above_zero
from wam_theory.linear_loop import damping_ratio
from wam_theory.stiction import inertia_number, slip_overshoot


def asymmetry_decay(
    gain: ArrayLike,
    inertia: ArrayLike,
    damping: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
) -> Array:
    """Part of the asymmetry that one slip takes away, kappa: lambda (pi/sqrt(1 - zeta^2) - 2 zeta Omega).

    lambda is the left side of (5.4).  The motor runs on at G_I e during the slip, on average at G_I u; the node
    swings on with the integral of its step response.  First order in lambda; the cycle then is symmetric after
    some 1/kappa slips.

    Parameters
    ----------
    gain, inertia, transmission_stiffness, contact_stiffness : as in `stiction.inertia_number`.
    damping : b, N m s/rad, above zero, below critical.
    """
    number = inertia_number(gain, inertia, transmission_stiffness, contact_stiffness)
    zeta = damping_ratio(inertia, damping, transmission_stiffness, contact_stiffness)
    if not np.all(zeta < 1.0):
        raise ValueError(f"damping is {damping!r}: zeta is {zeta!r}; a slip overshoots below 1 only")
    return np.asarray(number * (math.pi / np.sqrt(1.0 - zeta**2) - 2.0 * zeta * slip_overshoot(zeta)))


def asymmetric_period_ratio(error: ArrayLike, jump: ArrayLike) -> Array:
    """Period of the asymmetric cycle over that of the symmetric one, D^2/(4 e (D - e)): 1 at e = D/2, else above.

    The spring must change by the same force in both halves, at a rate proportional to e in one and to D - e in
    the other: the smaller error takes long.

    Parameters
    ----------
    error : e at a standstill, N m, above zero, below D.
    jump : D of (5.8), N m.
    """
    e, d = above_zero(error=error, jump=jump)
    if not np.all(e < d):
        raise ValueError(f"error is {error!r}; it must be below the jump, {jump!r}: above it is a staircase")
    return np.asarray(d * d / (4.0 * e * (d - e)))
