"""Open-loop force bandwidth of a transmission (chapter 4)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Resonances(NamedTuple):
    """The two resonances of (4.4), rad/s, omega_1 below omega_2."""

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]


def force_resonances(
    motor_inertia: ArrayLike,
    link_inertia: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
    ratio: ArrayLike,
) -> Resonances:
    """Resonances of motor, cable, link and contact, undamped, (4.4).

    Roots of J_m J_l w^4 - (J_m k_c + J_l k_tr + N^2 J_m k_tr) w^2 + k_tr k_c = 0, all arguments
    broadcast.  The lower root is taken as 2c/(B + sqrt(B^2 - 4c)): the printed form loses its digits
    to cancellation.

    Parameters
    ----------
    motor_inertia : J_m, at the motor, kg m^2.
    link_inertia : J_l, at the joint, kg m^2.
    transmission_stiffness : k_tr, at the motor, N m/rad.
    contact_stiffness : k_c, at the joint, N m/rad.
    ratio : N, motor turns per joint turn.

    Raises
    ------
    ValueError
        where an argument is not above zero.
    """
    arguments = {
        "motor_inertia": motor_inertia,
        "link_inertia": link_inertia,
        "transmission_stiffness": transmission_stiffness,
        "contact_stiffness": contact_stiffness,
        "ratio": ratio,
    }
    for name, value in arguments.items():
        if not np.all(np.asarray(value) > 0.0):
            raise ValueError(f"{name} is {value!r}; it must be above zero")
    jm, jl, ktr, kc, n = (np.asarray(value, dtype=float) for value in arguments.values())
    b = kc / jl + ktr / jm + n * n * ktr / jl
    c = ktr * kc / (jm * jl)
    root = np.sqrt(b * b - 4.0 * c)
    return Resonances(np.sqrt(2.0 * c / (b + root)), np.sqrt((b + root) / 2.0))
