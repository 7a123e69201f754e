"""Behaviour of an inertial node with Coulomb friction under integral force control, by gamma and zeta (section 5.5).

Symbols, shapes and units as in `linear_loop`.  With integral control alone, a bilateral contact and
a continuous loop the behaviour after a slip from stick depends on gamma and zeta only:

| gamma | Psi | behaviour |
|---|---|---|
| below gamma_a | 0 | the slip creeps to F_des and never stops; no cycle of x_m |
| gamma_a to gamma_b | below 0 | stairs from one side, equal times, geometric heights; no cycle of x_m |
| gamma_b to gamma_III | 0 to 1 | overshoots, each half cycle Psi times the last; x_m cycles (5.20) |
| above gamma_III | above 1 | every step diverges (domain III) |

Independently of that, the linear loop is stable below gamma = 1 (domain I: every step is stable), and
between 1 and gamma_III (domain II) a step is stable only if it is small.  The order
gamma_a < gamma_b < 1 < gamma_III holds for zeta above 0.1372 only: for a less damped node gamma_b
lies in domain II (zeta = 0.05: gamma_b = 2.51, gamma_III = 7.85), and the whole of domain I has no
cycle of x_m.  From zeta = sqrt(3)/2 on gamma_b is gamma_a.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from wam_theory.arguments import Array, above_zero, finite, quotient, zero_or_more
from wam_theory.half_cycle import half_cycle


def psi(gamma: ArrayLike, zeta: ArrayLike) -> Array:
    """Psi of (5.18), the LATER half-cycle amplitude over the EARLIER one, exactly; below 1 is stable, (5.17).

    Negative ratio of the errors of F_c at the standstill after a slip and at its breakaway: below 0 if the
    slip stops short of F_des, 0 if it creeps there without end (below gamma_a).  Holds with Coulomb friction
    for every slip from stick and every error.  The print has the inverse ratio.

    Parameters
    ----------
    gamma : (5.15), above zero.
    zeta : (5.12), above zero.
    """
    g, z = np.broadcast_arrays(*above_zero(gamma=gamma, zeta=zeta))
    flat = [0.0 - half_cycle(a, b).error for a, b in zip(g.ravel().tolist(), z.ravel().tolist(), strict=True)]
    return np.array(flat, dtype=float).reshape(g.shape)


def gamma_a(zeta: ArrayLike) -> Array:
    """Value of gamma below which a slip creeps to F_des and never stops; not in print.

    Exact for every zeta: 1/3 - 8 zeta^2/27, where the real mode of (5.14) is as fast as the pair; above
    zeta = sqrt(3)/2, where the pair is real at first, r (1 - zeta r)/(3 zeta), r the rate of two equal modes.

    Parameters
    ----------
    zeta : (5.12), above zero.
    """
    (z,) = above_zero(zeta=zeta)
    rate = 1.0 / (2.0 * z + np.sqrt(np.maximum(4.0 * z * z - 3.0, 0.0)))
    return np.where(z < math.sqrt(0.75), 1.0 / 3.0 - 8.0 * z * z / 27.0, rate * (1.0 - z * rate) / (3.0 * z))


def gamma_b(zeta: ArrayLike) -> Array:
    """Value of gamma where Psi = 0: above it a slip overshoots F_des, and x_m cycles; not in print.

    From zeta = sqrt(3)/2 on that is gamma_a.  Below zeta = 0.1372 it lies above the Routh limit, so that
    a lightly damped node (zeta = 0.05: 2.51) has no cycle of x_m in domain I.

    Parameters
    ----------
    zeta : (5.12), above zero.
    """
    (z,) = above_zero(zeta=zeta)
    return np.where(z < math.sqrt(0.75), _gamma_at(0.0, np.minimum(z, math.sqrt(0.75))), gamma_a(z))


def gamma_3(zeta: ArrayLike) -> Array:
    """Value gamma_III of gamma where Psi = 1: from it on every step diverges (domain III of figure 5.8); not in print.

    Above 1 for every zeta; it grows without bound as the damping vanishes (zeta = 0.05: 7.85).

    Parameters
    ----------
    zeta : (5.12), above zero.
    """
    return _gamma_at(1.0, zeta)


def _gamma_at(ratio: float, zeta: ArrayLike) -> Array:
    """Value of gamma at which Psi is `ratio`; Psi rises with gamma above gamma_a."""
    (z,) = above_zero(zeta=zeta)
    starts = gamma_a(z)
    found = [_root(ratio, a, b) for a, b in zip(starts.ravel().tolist(), z.ravel().tolist(), strict=True)]
    return np.array(found, dtype=float).reshape(z.shape)


def _root(ratio: float, start: float, zeta: float) -> float:
    """Bisect between gamma_a, where the slip creeps, and a gamma where Psi is above the ratio."""

    def excess(gamma: float) -> float:
        slip = half_cycle(gamma, zeta)
        return -1.0 if slip.duration == math.inf else -slip.error - ratio

    low, high = start, 2.0 * start
    while excess(high) <= 0.0:
        low, high = high, 2.0 * high
    while high - low > 4e-16 * high:
        middle = (low + high) / 2.0
        if not low < middle < high:
            break
        if excess(middle) > 0.0:
            high = middle
        else:
            low = middle
    return (low + high) / 2.0


def friction_dominated(
    gamma: ArrayLike, zeta: ArrayLike, transmission_stiffness: ArrayLike = 1.0, contact_stiffness: ArrayLike = 1.0
) -> Array:
    """F_friction/F_error above which the first slip of a step ends in stick: the dotted line of figure 5.8.

    J_l |x''| = 2 F_friction at its end.  Not in print; proportional to (k_tr + k_c)/(2 k_c).

    Parameters
    ----------
    gamma, zeta : of the loop, above zero.
    transmission_stiffness, contact_stiffness : N m/rad, above zero; only their ratio matters.
    """
    ktr, kc = above_zero(transmission_stiffness=transmission_stiffness, contact_stiffness=contact_stiffness)
    g, z, share = np.broadcast_arrays(np.asarray(gamma, dtype=float), zeta, (ktr + kc) / (2.0 * kc))
    level = [abs(half_cycle(one, damped).acceleration) for one, damped in zip(g.ravel(), z.ravel(), strict=True)]
    return np.array(level, dtype=float).reshape(g.shape) * share


def point_b(zeta: ArrayLike, transmission_stiffness: ArrayLike = 1.0, contact_stiffness: ArrayLike = 1.0) -> Array:
    """F_friction/F_error of point B of figure 5.8: where `friction_dominated` reaches gamma_III.

    1.356 for zeta = 0.25 and equal stiffnesses.

    Parameters
    ----------
    zeta : (5.12), above zero.
    transmission_stiffness, contact_stiffness : N m/rad, above zero; only their ratio matters.
    """
    return friction_dominated(gamma_3(zeta), zeta, transmission_stiffness, contact_stiffness)


def spin_up_time(
    gain: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
    friction: ArrayLike,
    error: ArrayLike,
    gamma: ArrayLike,
    zeta: ArrayLike,
) -> Array:
    """Time for which the node sticks after a slip, tau_spinup, s: its limit for small errors is (5.19).

    (5.3) from the spring force at the end of the slip.  For Psi above 0 that is
    (2 F - u |e|)/(G_I k_tr Psi |e|), u the deceleration at the end of the slip, in units of the error,
    times ks/k_c: it grows as 1/|e| without bound, as in (5.19).  For Psi below 0, which the print does not
    treat, it is u/(G_I k_tr |Psi|), the same for every step of the stairs.  Coulomb friction;
    exact.  Zero if the node does not stick, |e| u above 2 F; infinite if the slip creeps without end.

    Parameters
    ----------
    gain : G_I, rad/s/(N m), above zero.
    transmission_stiffness, contact_stiffness : N m/rad, above zero.
    friction : F_friction, N m, above zero.
    error : F_error at the start of the slip, N m, not zero.
    gamma, zeta : (5.15), (5.12), above zero.
    """
    g, ktr, kc, f = above_zero(
        gain=gain,
        transmission_stiffness=transmission_stiffness,
        contact_stiffness=contact_stiffness,
        friction=friction,
    )
    (e,) = above_zero(error=np.abs(error))
    a, z = np.broadcast_arrays(*above_zero(gamma=gamma, zeta=zeta))
    slips = [half_cycle(gamma_, zeta_) for gamma_, zeta_ in zip(a.ravel().tolist(), z.ravel().tolist(), strict=True)]
    ratio = np.array([-slip.error for slip in slips], dtype=float).reshape(a.shape)
    relief = np.array([slip.acceleration for slip in slips], dtype=float).reshape(a.shape) * (ktr + kc) / kc * e
    distance = np.where(ratio > 0.0, 2.0 * f - relief, relief)
    return quotient(np.where(relief > 2.0 * f, 0.0, distance), g * ktr * np.abs(ratio) * e)


def actuator_cycle(friction: ArrayLike, transmission_stiffness: ArrayLike, gamma: ArrayLike, zeta: ArrayLike) -> Array:
    """Limit cycle of x_m, PEAK TO PEAK, rad, (5.20): 2 F_friction/k_tr, once F_c has settled.

    Coulomb friction.  The print calls it amplitude and gives no range: it exists if a slip overshoots with a
    smaller error, 0 < Psi < 1, gamma_b to gamma_III (above gamma = 1 only for stable steps).  Below this
    range the result is 0 (one-sided, no cycle), above it infinite (diverges).

    Parameters
    ----------
    friction : F_friction, N m, zero or more.
    transmission_stiffness : k_tr, N m/rad, above zero.
    gamma, zeta : (5.15), (5.12), above zero.
    """
    (f,) = zero_or_more(friction=friction)
    (ktr,) = above_zero(transmission_stiffness=transmission_stiffness)
    ratio = psi(gamma, zeta)
    return np.where(ratio <= 0.0, 0.0, np.where(ratio < 1.0, 2.0 * f / ktr, math.inf))


def actuator_cycle_work(friction: ArrayLike, transmission_stiffness: ArrayLike) -> Array:
    """Work that the actuator cycle dissipates per half cycle, N m, (5.21) corrected: F^2/(2 k_tr).

    The energy of the spring at breakaway; the print has twice that, which contradicts (5.22).

    Parameters
    ----------
    friction : F_friction, N m, zero or more.
    transmission_stiffness : k_tr, N m/rad, above zero.
    """
    (f,) = zero_or_more(friction=friction)
    (ktr,) = above_zero(transmission_stiffness=transmission_stiffness)
    return f * f / (2.0 * ktr)


def actuator_cycle_power(gain: ArrayLike, error: ArrayLike, friction: ArrayLike) -> Array:
    """Power of the actuator cycle averaged over a half cycle, W, (5.22): G_I |e| F_friction/4.

    Work (5.21) over the time 2 F_friction/(G_I k_tr |e|) from one breakaway to the other; the time
    of the slip itself is neglected, which holds for small e.

    Parameters
    ----------
    gain : G_I, rad/s/(N m), above zero.
    error : e while stuck, N m.
    friction : F_friction, N m, zero or more.
    """
    (g,) = above_zero(gain=gain)
    (f,) = zero_or_more(friction=friction)
    (e,) = finite(error=error)
    return g * np.abs(e) * f / 4.0
