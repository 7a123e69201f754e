"""Integral force control on a force that is read in steps (3.2.1): what is left as the smallest controllable force.

The loop drives F_c to the border between the two steps next to F_des, because on either side of it the error has
another sign.  Without friction F_c hunts about it; with Coulomb friction the actuator limit cycle of (5.20) does not
slow down, because the error does not fall below what is left of a step.
"""

import numpy as np
from numpy.typing import ArrayLike

from wam_theory.arguments import Array, above_zero, finite


def threshold(desired: ArrayLike, step: ArrayLike) -> Array:
    """Force at which F_c settles, (floor(F_des/step) + 1/2) step, at most half a step from F_des.

    Parameters
    ----------
    desired : F_des.
    step : of the measured force, in the same unit, above zero.
    """
    (step,) = above_zero(step=step)
    (wanted,) = finite(desired=desired)
    return np.asarray((np.floor(wanted / step) + 0.5) * step)


def hunting(step: ArrayLike, gamma: ArrayLike, desired: ArrayLike) -> Array:
    """Peak to peak of F_c without friction, at the frequency sqrt(ks/J_l) of the node, by describing function.

    The steps act as a relay between both errors, which has the first harmonic 2/pi step sin(pi D), D = F_des/step
    modulo 1; there the loop multiplies it by gamma of (5.15): 4/pi gamma step sin(pi D).

    Parameters
    ----------
    step : of the measured force, above zero.
    gamma : of (5.15); from 1 on the result is infinite.
    desired : F_des, in the unit of step.
    """
    step, gamma = above_zero(step=step, gamma=gamma)
    (wanted,) = finite(desired=desired)
    return np.where(gamma < 1.0, 4.0 / np.pi * gamma * step * np.sin(np.pi * np.mod(wanted / step, 1.0)), np.inf)


def quantised_cycle_period(
    gain: ArrayLike, transmission_stiffness: ArrayLike, friction: ArrayLike, desired: ArrayLike, step: ArrayLike
) -> Array:
    """Period of the actuator cycle with Coulomb friction, s: 2 F/(G_I k_tr) (1/e_below + 1/e_above), by (5.3).

    Parameters
    ----------
    gain : G_I, rad/s/(N m).
    transmission_stiffness : k_tr, N m/rad.
    friction : F_friction, N m.
    desired : F_des, N m, on no step.
    step : of the measured force, N m.
    """
    g, k, friction, step = above_zero(
        gain=gain, transmission_stiffness=transmission_stiffness, friction=friction, step=step
    )
    (wanted,) = finite(desired=desired)
    below = np.mod(wanted, step)
    if np.any(below == 0.0):
        raise ValueError(f"desired is a multiple of step, {step.tolist()!r}: there the loop is at rest")
    return np.asarray(2.0 * friction / (g * k) * (1.0 / below + 1.0 / (step - below)))
