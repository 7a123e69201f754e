"""A friction node with little inertia: delay, steps and limit cycle (section 5.4).

Symbols, shapes and units as in `linear_loop`.  The node is stuck, or jumps while the motor is at rest,
which holds if (5.4), with stiction (5.11), is far below 1.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from wam_theory.arguments import Array, above_zero, finite, quotient, zero_or_more
from wam_theory.linear_loop import damping_ratio, series_stiffness


def breakaway_delay(
    gain: ArrayLike,
    transmission_stiffness: ArrayLike,
    static_friction: ArrayLike,
    error: ArrayLike,
    spring_force: ArrayLike = 0.0,
) -> Array:
    """Time until a stuck node slips, s, (5.3) in general: (F_s - sgn(e) f)/(G_I k_tr |e|).

    The print has f = 0, the first breakaway of an unstressed node.  Exact; infinite without error.

    Parameters
    ----------
    gain : G_I, rad/s/(N m), above zero.
    transmission_stiffness : k_tr, N m/rad, above zero.
    static_friction : F_static, N m, zero or more.
    error : e = F_des - F_c, N m, constant while stuck.
    spring_force : f = k_tr (x_m - x) - F_c when it stuck, N m, within +-F_static.
    """
    g, ktr = above_zero(gain=gain, transmission_stiffness=transmission_stiffness)
    (fs,) = zero_or_more(static_friction=static_friction)
    e, f = finite(error=error, spring_force=spring_force)
    if not np.all(np.abs(f) <= fs * (1.0 + 1e-12)):
        raise ValueError(f"spring_force is {spring_force!r}; a stuck node holds at most {static_friction!r}")
    return quotient(fs - np.sign(e) * f, g * ktr * np.abs(e))


def stuck_motor_speed(gain: ArrayLike, error: ArrayLike) -> Array:
    """Speed of the motor while the node is stuck, rad/s, (5.5): G_I F_error.

    F_c and the error are constant; the spring force grows by k_tr times this speed until the node slips,
    `breakaway_delay`.

    Parameters
    ----------
    gain : G_I, rad/s/(N m), above zero.
    error : F_error, N m.
    """
    (g,) = above_zero(gain=gain)
    (e,) = finite(error=error)
    return g * e


def friction_drop(static_friction: ArrayLike, dynamic_friction: ArrayLike) -> Array:
    """Static minus dynamic friction, dF of (5.7), N m; zero for Coulomb friction.

    Parameters
    ----------
    static_friction, dynamic_friction : N m, zero or more, static at least dynamic.
    """
    fs, fd = zero_or_more(static_friction=static_friction, dynamic_friction=dynamic_friction)
    if not np.all(fs >= fd):
        raise ValueError(f"static_friction is {static_friction!r}; it must be at least {dynamic_friction!r}, dynamic")
    return fs - fd


def slip_force(
    time: ArrayLike,
    inertia: ArrayLike,
    damping: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
    drop: ArrayLike,
) -> Array:
    """Change of F_c since a breakaway, N m, (5.6) with damping: dF k_c/ks times a damped swing from 0 to Omega.

    The print has b = 0: dF k_c/ks (1 - cos(sqrt(ks/J_l) t)).  The motor is at rest, (5.11) far below 1.
    After the standstill at pi sqrt(J_l/ks)/sqrt(1 - zeta^2) the node sticks, and the result is constant.

    Parameters
    ----------
    time : s since the breakaway, zero or more.
    inertia : J_l, kg m^2, above zero.
    damping : b, N m s/rad, zero or more, zeta below 1.
    transmission_stiffness, contact_stiffness : N m/rad, above zero.
    drop : dF of (5.7) with the sign of the motion, N m.
    """
    (t,) = zero_or_more(time=time)
    (force,) = finite(drop=drop)
    zeta = damping_ratio(inertia, damping, transmission_stiffness, contact_stiffness)
    if not np.all(zeta < 1.0):
        raise ValueError(f"damping is {damping!r}; zeta is {zeta.tolist()}; it must be below 1 for an oscillating slip")
    ktr, kc = np.asarray(transmission_stiffness, dtype=float), np.asarray(contact_stiffness, dtype=float)
    below = np.sqrt(1.0 - zeta * zeta)
    angle = np.minimum(below * np.sqrt((ktr + kc) / np.asarray(inertia, dtype=float)) * t, math.pi)
    swing = np.exp(-zeta / below * angle) * (np.cos(angle) + zeta / below * np.sin(angle))
    return force * kc / (ktr + kc) * (1.0 - swing)


def inertia_number(
    gain: ArrayLike, inertia: ArrayLike, transmission_stiffness: ArrayLike, contact_stiffness: ArrayLike
) -> Array:
    """Left side of (5.4), G_I K sqrt(J_l/ks): speed of the actuator over that of the node.

    If it is far below 1, the node is nearly inertialess and (5.2), (5.3) describe Coulomb friction.

    Parameters
    ----------
    gain : G_I, rad/s/(N m), above zero.
    inertia : J_l, kg m^2, above zero.
    transmission_stiffness, contact_stiffness : N m/rad, above zero.
    """
    g, j = above_zero(gain=gain, inertia=inertia)
    k = series_stiffness(transmission_stiffness, contact_stiffness)
    return g * k * np.sqrt(j / (np.asarray(transmission_stiffness) + np.asarray(contact_stiffness)))


def stiction_cycle_number(
    gain: ArrayLike,
    inertia: ArrayLike,
    damping: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
) -> Array:
    """Left side of (5.11): `inertia_number` over sqrt(1 - zeta^2), infinite from zeta = 1 on.

    Far below 1 the cycle of (5.8), (5.9) occurs with their size.  Its period converges within about 0.2 over
    this number of cycles.

    Parameters
    ----------
    gain, inertia, damping, transmission_stiffness, contact_stiffness : as in `inertia_number`, `damping_ratio`.
    """
    zeta = damping_ratio(inertia, damping, transmission_stiffness, contact_stiffness)
    number = inertia_number(gain, inertia, transmission_stiffness, contact_stiffness)
    return quotient(number, np.sqrt(np.maximum(1.0 - zeta * zeta, 0.0)))


def slip_overshoot(zeta: ArrayLike) -> Array:
    """Omega of (5.10), 1 + exp(-pi zeta/sqrt(1 - zeta^2)): 2 without damping, 1 from zeta = 1 on.

    Not in print: travel of a slip with the motor at rest over that to its equilibrium.

    Parameters
    ----------
    zeta : (5.12), zero or more.
    """
    (z,) = zero_or_more(zeta=zeta)
    return 1.0 + np.exp(quotient(-math.pi * z, np.sqrt(np.maximum(1.0 - z * z, 0.0)), -math.inf))


def stiction_cycle_force(
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
    static_friction: ArrayLike,
    dynamic_friction: ArrayLike,
    zeta: ArrayLike,
) -> Array:
    """Stiction limit cycle of F_c, PEAK TO PEAK, N m, (5.8): Omega dF k_c/(k_tr + k_c).

    The print calls it amplitude.  For (5.11) far below 1.

    Parameters
    ----------
    transmission_stiffness, contact_stiffness : N m/rad, above zero.
    static_friction, dynamic_friction : N m, zero or more, static at least dynamic.
    zeta : (5.12), zero or more.
    """
    ktr, kc = above_zero(transmission_stiffness=transmission_stiffness, contact_stiffness=contact_stiffness)
    return slip_overshoot(zeta) * friction_drop(static_friction, dynamic_friction) * kc / (ktr + kc)


def stiction_cycle_period(
    gain: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
    static_friction: ArrayLike,
    dynamic_friction: ArrayLike,
    zeta: ArrayLike,
) -> Array:
    """Period of the stiction limit cycle, s, (5.9) corrected: 4/(G_I k_tr) ks/k_c (2 F_s/(Omega dF) - 1).

    The print has Omega in front and none inside, which is right for Omega = 1 only.  For (5.11)
    far below 1, once the cycle is symmetric.  Infinite with Coulomb friction.

    Parameters
    ----------
    gain : G_I, rad/s/(N m), above zero.
    transmission_stiffness, contact_stiffness, static_friction, dynamic_friction, zeta : as in
        `stiction_cycle_force`.
    """
    g, ktr, kc = above_zero(
        gain=gain, transmission_stiffness=transmission_stiffness, contact_stiffness=contact_stiffness
    )
    jump = slip_overshoot(zeta) * friction_drop(static_friction, dynamic_friction)
    (fs,) = zero_or_more(static_friction=static_friction)
    return 4.0 / (g * ktr) * (ktr + kc) / kc * (quotient(2.0 * fs, jump) - 1.0)


def staircase_number(
    gain: ArrayLike,
    error: ArrayLike,
    inertia: ArrayLike,
    damping: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
    drop: ArrayLike,
) -> Array:
    """Left side of (5.13), pi G_I |F_error| sqrt(ks J_l)/(dF sqrt(1 - zeta^2)): motor travel over that of a slip.

    Far below 1, and with an error above the size of (5.8), F_c approaches F_des in steps of that size whose
    envelope is (5.2).  Infinite from zeta = 1 on, and with Coulomb friction.

    Parameters
    ----------
    gain : G_I, rad/s/(N m), above zero.
    error : F_error, N m.
    inertia, damping, transmission_stiffness, contact_stiffness : as in `slip_force`.
    drop : dF of (5.7), N m, zero or more.
    """
    (g,) = above_zero(gain=gain)
    (e,) = finite(error=error)
    (df,) = zero_or_more(drop=drop)
    zeta = damping_ratio(inertia, damping, transmission_stiffness, contact_stiffness)
    ks = np.asarray(transmission_stiffness, dtype=float) + np.asarray(contact_stiffness, dtype=float)
    moved = math.pi * g * np.abs(e) * np.sqrt(ks * np.asarray(inertia, dtype=float))
    return quotient(moved, df * np.sqrt(np.maximum(1.0 - zeta * zeta, 0.0)))


def play(desired: ArrayLike, friction: ArrayLike) -> Array:
    """Contact force of open-loop force control along a path of F_des, N: friction as a deadband, section 5.2.

    |F_c - F_des| stays within the friction, and F_c changes only where it would not.  From rest F_c is zero up to
    F_des = friction, which is the deadband of 5.2; on the way back F_c is kept over twice the friction.  A contact
    that cannot pull; slow motion.

    Parameters
    ----------
    desired : (n,), F_des along the path, N, from rest at zero.
    friction : Coulomb friction in the units of F_des, zero or more; a number.
    """
    (wanted,) = finite(desired=desired)
    (most,) = zero_or_more(friction=friction)
    force, found = 0.0, np.empty_like(wanted)
    for i, value in enumerate(wanted.tolist()):
        force = found[i] = max(min(max(force, value - float(most)), value + float(most)), 0.0)
    return found
