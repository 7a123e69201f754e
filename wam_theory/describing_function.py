"""The unstable limit cycle of domain II, by describing function (section 5.5.1).

Above the Routh limit a small motion decays, because friction dissipates more than the loop adds, and a
large one grows; in between lies an unstable periodic motion.  Symbols, shapes
and units as in `linear_loop`; Coulomb friction, integral control, a continuous loop.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wam_theory.arguments import Array, above_zero, quotient
from wam_theory.linear_loop import characteristic_polynomial, gain_ratio, polynomial_at


class UnstableCycle(NamedTuple):
    """An unstable periodic motion about F_des.

    Attributes
    ----------
    force : (...), amplitude (half of the peak to peak) of F_c, N m.
    frequency : (...), rad/s.
    """

    force: Array
    frequency: Array


def friction_to_velocity(
    s: ArrayLike,
    gain: ArrayLike,
    inertia: ArrayLike,
    damping: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
) -> NDArray[np.complex128]:
    """G(s) of figure 5.6 and (5.16), from the friction force, against the motion, to the velocity of the node.

    s^2 over the denominator of (5.14), rad/s/(N m); figure 5.7 shows its intersection with -1/N(A).

    Parameters
    ----------
    s : complex frequency, rad/s.
    gain, inertia, damping, transmission_stiffness, contact_stiffness : as in
        `linear_loop.characteristic_polynomial`.
    """
    coefficients = characteristic_polynomial(gain, inertia, damping, transmission_stiffness, contact_stiffness)
    frequency, below = polynomial_at(coefficients, s)
    return frequency * frequency / below


def coulomb_describing_function(friction: ArrayLike, amplitude: ArrayLike) -> Array:
    """N(A) of (5.16) for Coulomb friction, N m s/rad: 4 F_friction/(pi A), the fundamental of a square wave.

    Parameters
    ----------
    friction : F_friction, N m, above zero.
    amplitude : A, of the node's velocity, rad/s, above zero.
    """
    f, a = above_zero(friction=friction, amplitude=amplitude)
    return 4.0 * f / (math.pi * a)


def predicted_unstable_cycle(
    gain: ArrayLike,
    inertia: ArrayLike,
    damping: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
    friction: ArrayLike,
) -> UnstableCycle:
    """Solution of 1 + G(j omega) N(A) = 0, (5.16), as motion of F_c.

    N(A) replaces the missing damping: b + N(A) = gamma b at omega = sqrt(ks/J_l), so that
    A = 4 F_friction/(pi b (gamma - 1)).  Compared with exact motion, for zeta = 0.25, the force is 0.7 %
    too large at gamma = 1.1, 5 % at 1.5, 18 % at 2.0 and 46 % at gamma_III = 2.19, and the frequency 0.03 %,
    1 %, 5 % and 13 %; in domain III a cycle is predicted where none exists.

    Parameters
    ----------
    gain : G_I, rad/s/(N m), above zero.
    inertia, damping : J_l, kg m^2, b, N m s/rad, above zero.
    transmission_stiffness, contact_stiffness : N m/rad, above zero.
    friction : F_friction, N m, above zero.

    Returns
    -------
    UnstableCycle
        force infinite and frequency NaN for gamma of at most 1, where no cycle is predicted.
    """
    (f,) = above_zero(friction=friction)
    gamma = gain_ratio(gain, inertia, damping, transmission_stiffness, contact_stiffness)
    j, b, ktr, kc = (np.asarray(a, dtype=float) for a in (inertia, damping, transmission_stiffness, contact_stiffness))
    gamma, natural, size = np.broadcast_arrays(gamma, np.sqrt((ktr + kc) / j), 4.0 * f * kc / (math.pi * b))
    return UnstableCycle(quotient(size, natural * (gamma - 1.0)), np.where(gamma > 1.0, natural, math.nan))
