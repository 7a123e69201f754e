"""Asymmetric start of the stiction limit cycle, and how its period converges (section 5.4; not in print).

At a standstill F_c is an error e below F_des; the next slip moves it by D of (5.8), and the following one back.
Half way between is the symmetric cycle; u = e - D/2 is the asymmetry.  Without motion of the motor during the
slip every e below D repeats indefinitely; with it each slip takes the part `kappa` of u away.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from wam_theory.arguments import Array, above_zero, below_one
from wam_theory.stiction import slip_overshoot


def asymmetry_decay(number: ArrayLike, zeta: ArrayLike) -> Array:
    """Part of the asymmetry that one slip takes away, kappa: lambda (pi/sqrt(1 - zeta^2) - 2 zeta Omega).

    lambda is the left side of (5.4).  The motor runs on at G_I e during the slip, on average at G_I u; the node
    swings on with the integral of its step response.  First order in lambda; the cycle then is symmetric after
    some 1/kappa slips.

    Parameters
    ----------
    number : lambda, `stiction.inertia_number`, above zero.
    zeta : (5.12), above zero, below one: only then does a slip overshoot.
    """
    (lam,), (z,) = above_zero(number=number), below_one(zeta=zeta)
    return lam * (math.pi / np.sqrt(1.0 - z**2) - 2.0 * z * slip_overshoot(z))


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
