"""Section 5.7 and the last claim of 5.5.2 as formulas: gain for a frequency, deadband, kept contact (not in print)."""

import numpy as np
from numpy.typing import ArrayLike

from wam_theory.arguments import Array, above_zero, below_one
from wam_theory.regimes import psi
from wam_theory.stiction import stiction_cycle_period


def gain_for_cycle_frequency(frequency: ArrayLike, *node: ArrayLike) -> Array:
    """G_I at which the stiction cycle has this frequency, away from a resonance: the inverse of (5.9) corrected.

    Parameters
    ----------
    frequency : of the cycle, Hz, above zero.
    *node : k_tr, k_c, F_static, F_dynamic, zeta, the arguments of `stiction.stiction_cycle_period` after the gain.
    """
    (f,) = above_zero(frequency=frequency)
    return np.asarray(f * stiction_cycle_period(1.0, *node))


def half_cycles_to_deadband(deadband_share: ArrayLike, ratio: ArrayLike) -> Array:
    """Half cycles until a deadband ends the actuator cycle: the errors fall as Psi^n, so every deadband ends it.

    Parameters
    ----------
    deadband_share : deadband over the step, above zero, below one.
    ratio : Psi of (5.18), above zero, below one.
    """
    share, psi_ = below_one(deadband_share=deadband_share, ratio=ratio)
    return np.ceil(np.log(share) / np.log(psi_))


def kept_contact_ratio(gamma: ArrayLike, zeta: ArrayLike) -> Array:
    """Largest F_c before a step DOWN over F_des after it with contact kept, 1 + 1/Psi; infinite without overshoot.

    Friction-dominated.  A step from F_0 to F_des overshoots to F_des - Psi (F_0 - F_des).  The thesis states that a
    stable loop never loses contact (5.5.2): true for a step up from zero, which ends between (1 - Psi^2) F_des
    and (1 + Psi) F_des, and not for a step down beyond this ratio.

    Parameters
    ----------
    gamma : (5.15), above zero.
    zeta : (5.12), above zero.
    """
    ratio = psi(gamma, zeta)
    with np.errstate(divide="ignore"):
        return np.where(ratio > 0.0, 1.0 + 1.0 / np.maximum(ratio, 0.0), np.inf)
