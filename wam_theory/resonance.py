"""Open-loop bandwidth of position and force of a transmission, and the best stiffness for it (chapter 4).

Motor J_m, cable k_tr seen at the motor, reducer N at the joint, link J_l, contact k_c at the joint; no
damping.  All arguments broadcast, results have the shape they broadcast to; SI with radians, or any
consistent units.  N_m = sqrt(J_l/J_m).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wam_theory.arguments import Array, above_zero

Complex = NDArray[np.complex128]


class Resonances(NamedTuple):
    """The two resonances of (4.4), rad/s, omega_1 below omega_2."""

    lower: Array
    upper: Array


class SmallRatioResonances(NamedTuple):
    """Resonances for a vanishing ratio, rad/s: the link on its contact, the rotor on its cable."""

    link_on_contact: Array
    rotor_on_cable: Array


# -------------------------------------------------------------------------------- position (4.2)
def position_transfer(
    s: ArrayLike, link_inertia: ArrayLike, transmission_stiffness: ArrayLike, ratio: ArrayLike
) -> Complex:
    """Transfer function x_l/x_m of a position-controlled motor, (4.2), and for N = 1 the second (4.1).

    N k_tr/(J_l s^2 + N^2 k_tr), 1/N for slow motion; the print has N^2 k_tr in the numerator, which is x_l N/x_m.

    Parameters
    ----------
    s : complex frequency, rad/s; j omega for a frequency response.
    link_inertia : J_l, kg m^2, above zero.
    transmission_stiffness : k_tr, of a line between motor and reducer at the joint, N m/rad, above zero.
    ratio : N, motor turns per joint turn, above zero.
    """
    jl, ktr, n = above_zero(link_inertia=link_inertia, transmission_stiffness=transmission_stiffness, ratio=ratio)
    frequency = np.asarray(s, dtype=complex)
    return n * ktr / (jl * frequency * frequency + n * n * ktr)


def position_bandwidth(link_inertia: ArrayLike, transmission_stiffness: ArrayLike, ratio: ArrayLike) -> Array:
    """Resonance of (4.2), rad/s: N sqrt(k_tr/J_l); with the reducer at the motor it is that of N = 1.

    A reducer at the joint gives N times the bandwidth for equal k_tr; for equal stress in the lines the factor
    is the square root of the stiffnesses of `cable.stiffness_with_reducer`, sqrt(N).

    Parameters
    ----------
    link_inertia, transmission_stiffness, ratio : as in `position_transfer`.
    """
    jl, ktr, n = above_zero(link_inertia=link_inertia, transmission_stiffness=transmission_stiffness, ratio=ratio)
    return n * np.sqrt(ktr / jl)


# ----------------------------------------------------------------------------------- force (4.3)
def force_transfer(
    s: ArrayLike,
    motor_inertia: ArrayLike,
    link_inertia: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
    ratio: ArrayLike,
) -> Complex:
    """Transfer function F_c/F_m from motor torque to contact force, (4.3).

    N k_tr k_c/(J_m J_l s^4 + (J_m k_c + J_l k_tr + N^2 J_m k_tr) s^2 + k_tr k_c); the print has no N
    in the numerator, which is the torque amplification at rest.

    Parameters
    ----------
    s : complex frequency, rad/s; j omega for a frequency response.
    motor_inertia, link_inertia, transmission_stiffness, contact_stiffness, ratio : as in `force_resonances`.
    """
    jm, jl, ktr, kc, n = _parts(motor_inertia, link_inertia, transmission_stiffness, contact_stiffness, ratio)
    square = np.asarray(s, dtype=complex) ** 2
    return n * ktr * kc / ((jm * jl * square + jm * kc + jl * ktr + n * n * jm * ktr) * square + ktr * kc)


def force_resonances(
    motor_inertia: ArrayLike,
    link_inertia: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
    ratio: ArrayLike,
) -> Resonances:
    """Resonances of motor, cable, link and contact, undamped, (4.4).

    Roots of the denominator of `force_transfer`.  The lower root is computed as 2c/(B + sqrt(B^2 - 4c)),
    without the cancellation of the printed form, and B^2 - 4c as a sum of squares, which is never below zero.

    Parameters
    ----------
    motor_inertia : J_m, at the motor, kg m^2, above zero.
    link_inertia : J_l, at the joint, kg m^2, above zero.
    transmission_stiffness : k_tr, at the motor, N m/rad, above zero.
    contact_stiffness : k_c, at the joint, N m/rad, above zero.
    ratio : N, motor turns per joint turn, above zero.

    Raises
    ------
    ValueError
        if an argument is not above zero.
    """
    jm, jl, ktr, kc, n = _parts(motor_inertia, link_inertia, transmission_stiffness, contact_stiffness, ratio)
    link, rotor, coupled = kc / jl, ktr / jm, n * n * ktr / jl
    twice = link + rotor + coupled + np.hypot(link + coupled - rotor, 2.0 * np.sqrt(coupled * rotor))
    return Resonances(np.sqrt(2.0 * link * rotor / twice), np.sqrt(twice / 2.0))


def soft_contact_bandwidth(
    motor_inertia: ArrayLike, link_inertia: ArrayLike, contact_stiffness: ArrayLike, ratio: ArrayLike
) -> Array:
    """Lower resonance for a soft contact, rad/s, (4.5): sqrt(k_c/(J_l + N^2 J_m)), which goes to 0.

    Link and reflected rotor on the contact, which is also the limit of a stiff transmission and an upper
    bound of omega_1 for every k_tr.  The print has the limit 0 only.

    Parameters
    ----------
    motor_inertia, link_inertia, contact_stiffness, ratio : as in `force_resonances`.
    """
    jm, jl, kc, n = above_zero(
        motor_inertia=motor_inertia, link_inertia=link_inertia, contact_stiffness=contact_stiffness, ratio=ratio
    )
    return np.sqrt(kc / (jl + n * n * jm))


def hard_contact_bandwidth(motor_inertia: ArrayLike, transmission_stiffness: ArrayLike) -> Array:
    """Lower resonance for a hard contact, rad/s, (4.6): sqrt(k_tr/J_m), the rotor on its cable.

    Upper bound of omega_1 for every k_c and N; the asymptote of section 4.4, where J_t is printed for J_m.

    Parameters
    ----------
    motor_inertia, transmission_stiffness : as in `force_resonances`.
    """
    jm, ktr = above_zero(motor_inertia=motor_inertia, transmission_stiffness=transmission_stiffness)
    return np.sqrt(ktr / jm)


def small_ratio_resonances(
    motor_inertia: ArrayLike,
    link_inertia: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
) -> SmallRatioResonances:
    """Resonances for small N, rad/s, (4.7), the curves of figure 4.9.b; omega_1 is the lower of the two.

    The print has their squares.  N far below N_m.

    Parameters
    ----------
    motor_inertia, link_inertia, transmission_stiffness, contact_stiffness : as in `force_resonances`.
    """
    jm, jl, ktr, kc = above_zero(
        motor_inertia=motor_inertia,
        link_inertia=link_inertia,
        transmission_stiffness=transmission_stiffness,
        contact_stiffness=contact_stiffness,
    )
    link, rotor = np.broadcast_arrays(np.sqrt(kc / jl), np.sqrt(ktr / jm))
    return SmallRatioResonances(link, rotor)


def large_ratio_bandwidth(motor_inertia: ArrayLike, contact_stiffness: ArrayLike, ratio: ArrayLike) -> Array:
    """Lower resonance for large N, rad/s, (4.8): sqrt(k_c/J_m)/N, which goes to 0.  N far above N_m.

    The print has the limit 0 only.

    Parameters
    ----------
    motor_inertia, contact_stiffness, ratio : as in `force_resonances`.
    """
    jm, kc, n = above_zero(motor_inertia=motor_inertia, contact_stiffness=contact_stiffness, ratio=ratio)
    return np.sqrt(kc / jm) / n


# ------------------------------------------------------------------- best stiffness (4.3.2, 4.4)
def matched_ratio(motor_inertia: ArrayLike, link_inertia: ArrayLike) -> Array:
    """N_m = sqrt(J_l/J_m), the ratio that matches reflected rotor and link (section 4.1.2).

    Parameters
    ----------
    motor_inertia, link_inertia : as in `force_resonances`.
    """
    jm, jl = above_zero(motor_inertia=motor_inertia, link_inertia=link_inertia)
    return np.sqrt(jl / jm)


def best_contact_stiffness(
    motor_inertia: ArrayLike, link_inertia: ArrayLike, transmission_stiffness: ArrayLike
) -> Array:
    """Contact stiffness where the curves of (4.7) cross, N m/rad, (4.9): k_tr J_l/J_m.  N far below N_m.

    Parameters
    ----------
    motor_inertia, link_inertia, transmission_stiffness : as in `force_resonances`.
    """
    (ktr,) = above_zero(transmission_stiffness=transmission_stiffness)
    return ktr * matched_ratio(motor_inertia, link_inertia) ** 2


def best_transmission_stiffness(
    motor_inertia: ArrayLike, link_inertia: ArrayLike, contact_stiffness: ArrayLike
) -> Array:
    """Transmission stiffness at the motor for a given contact, N m/rad, (4.10): k_c J_m/J_l.  N far below N_m.

    The print has J_t for J_l.

    Parameters
    ----------
    motor_inertia, link_inertia, contact_stiffness : as in `force_resonances`.
    """
    (kc,) = above_zero(contact_stiffness=contact_stiffness)
    return kc / matched_ratio(motor_inertia, link_inertia) ** 2


def _parts(
    motor_inertia: ArrayLike,
    link_inertia: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
    ratio: ArrayLike,
) -> list[Array]:
    return above_zero(
        motor_inertia=motor_inertia,
        link_inertia=link_inertia,
        transmission_stiffness=transmission_stiffness,
        contact_stiffness=contact_stiffness,
        ratio=ratio,
    )
