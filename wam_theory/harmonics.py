"""What the linear block of figure 5.6 leaves of the harmonics of dry friction (section 5.5.1)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wam_theory.arguments import Array, above_zero
from wam_theory.describing_function import friction_to_velocity


def harmonic_share(order: ArrayLike, frequency: ArrayLike, *loop: ArrayLike) -> Array:
    """Harmonic of the velocity over its fundamental, |G(j n omega)|/(n |G(j omega)|), with a square wave of friction.

    The describing function neglects it.  G falls only as 1/s: far above the resonances the share is 1/n^2 times
    a constant, 1/9 for the third one.

    Parameters
    ----------
    order : n, odd; a square wave has no even harmonics.
    frequency : omega of the fundamental, rad/s, above zero.
    *loop : G_I, J_l, b, k_tr, k_c, the arguments of `describing_function.friction_to_velocity` after s.
    """
    n, omega = above_zero(order=order, frequency=frequency)
    if not np.all(n % 2.0 == 1.0):
        raise ValueError(f"order is {order!r}; a square wave has odd harmonics only")

    def magnitude(w: NDArray[np.float64]) -> Array:
        return np.abs(friction_to_velocity(1j * w, *loop))

    return np.asarray(magnitude(n * omega) / (n * magnitude(omega)))
