"""A sampled velocity servo on motors behind elastic cables, as one linear map from period to period.

The motors see the torque tau = K_p e + K_i sum(e) T of a sampled velocity error e = -thetad, held for a period T and
used with a delay of some periods.  Between samples the mechanism is carried in closed form.  An encoder gives no
velocity but the difference of two angles over a period, which is half a period old.
"""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from wam_theory.arguments import Array
from wam_theory.thresholds import SEARCH
from wam_theory.zero_order_hold import zero_order_hold


def locked_rotors(
    inertia: Sequence[float], damping: Sequence[float], stiffness: Sequence[float], friction: Sequence[float]
) -> Array:
    """Rate of the states theta, thetad, (2n, 2n), of rotors on cables whose far ends are held.

    Parameters
    ----------
    inertia : of each rotor, kg m^2.
    damping, stiffness : of each cable at its motor, N m s/rad and N m/rad.
    friction : viscous friction of each rotor, N m s/rad.
    """
    n = len(inertia)
    pull, drag = np.diag(np.divide(stiffness, inertia)), np.diag(np.divide(np.add(damping, friction), inertia))
    return np.block([[np.zeros((n, n)), np.eye(n)], [-pull, -drag]])


def servo_period(
    rate: Array,
    inlet: Array,
    proportional_gain: ArrayLike,
    integral_gain: ArrayLike,
    period: float,
    delay: int,
    by_difference: bool,
) -> Array:
    """The map of one period of the mechanism and its servo.

    Parameters
    ----------
    rate : of the mechanism's states, which begin with the n motor angles and the n motor velocities, (m, m).
    inlet : rate of the states per torque of each motor, (m, n).
    proportional_gain, integral_gain : of each motor, (n,), N m s/rad and N m/rad.
    period : s.
    delay : periods from a sample to the use of its torque; 0 if it is used at once.
    by_difference : whether the velocity is the difference of two angles over a period, else the velocity itself.

    Returns
    -------
    (k, k) array
        states: those of the mechanism, integrals, angles of the period before, torques still to be used.
    """
    m, n = inlet.shape
    drift, drive = zero_order_hold(rate, inlet, period)
    begins = np.cumsum([0, m, n, n, *[n] * delay]).tolist()
    state = np.eye(begins[-1])
    x, integral, before, *earlier = (state[a:b] for a, b in pairwise(begins))
    velocity = (x[:n] - before) / period if by_difference else x[n : 2 * n]
    integral = integral - period * np.array(integral_gain)[:, None] * velocity
    torques = [*earlier, integral - np.array(proportional_gain)[:, None] * velocity]
    return np.vstack([drift @ x + drive @ torques[0], integral, x[:n], *torques[1:]])


def is_stable(period_map: Array) -> bool:
    """Whether no mode grows from period to period.

    Parameters
    ----------
    period_map : (m, m), state after a period from the state before it.
    """
    return bool(np.abs(np.linalg.eigvals(period_map)).max() <= 1.0 + SEARCH.mode_growth)


def least_damping(period_map: Array, slow: float) -> float:
    """Smallest damping ratio of the slow modes; 1 where there is none.

    Parameters
    ----------
    period_map : (m, m), state after a period from the state before it.
    slow : largest size of a mode that counts, rad per period.
    """
    values = np.linalg.eigvals(period_map).astype(np.complex128)
    rates = np.log(values[np.abs(values) > SEARCH.mode_memory])
    size = np.abs(rates)
    used = (np.abs(rates.imag) > 0.0) & (size > SEARCH.mode_growth) & (size < slow)  # slower: a constant, rounded
    return float(min(-rates.real[used] / size[used], default=1.0))


def largest_scale(is_stable_at: Callable[[float], bool], top: float) -> float:
    """Largest scale up to `top` at which something is stable, within 0.1 %.

    Parameters
    ----------
    is_stable_at : whether it is, at a scale.
    top : where the search begins; it goes down step by step.

    Returns
    -------
    float
        `top` if it is stable there, 0 if it is not even at `SEARCH.smallest_scale` of it.
    """
    if is_stable_at(top):
        return top
    above = top
    while not is_stable_at(below := above * SEARCH.scale_step):
        above = below
        if below < SEARCH.smallest_scale * top:
            return 0.0
    while above > 1.001 * below:
        middle = math.sqrt(below * above)
        below, above = (middle, above) if is_stable_at(middle) else (below, middle)
    return below
