"""Power, speed and angle of pulleys driven by an elastic cable (chapter 6).

A cable of stiffness per length EA enters and leaves each pulley at one radius, sticks where it
enters and slips before it leaves.  T1, V1 belong to the loose strand, T2, V2 to the tight one.
Arguments broadcast, results have the shape they broadcast to; SI with radians, or any consistent
units.  Cables as springs, and the relative loss of a stage: `cable`.
"""

import numpy as np
from numpy.typing import ArrayLike

from wam_theory.arguments import Array, above_zero, finite, zero_or_more


def strain(tension: ArrayLike, ea: ArrayLike) -> Array:
    """Strain of a strand, (6.1) and (6.2): T/EA.  Linearly elastic.

    Parameters
    ----------
    tension : N, zero or more.
    ea : E A, N, above zero.
    """
    (t,) = zero_or_more(tension=tension)
    (k,) = above_zero(ea=ea)
    return t / k


def speed_ratio(loose: ArrayLike, tight: ArrayLike, ea: ArrayLike) -> Array:
    """V2/V1, speed of the tight over that of the loose strand, (6.3): (1 + T2/EA)/(1 + T1/EA).

    Exact by conservation of mass; 1 + (T2 - T1)/EA of (6.4) is its first order, `cable.stage_loss`.
    Its inverse is the exact efficiency, with (6.14) as its first order.

    Parameters
    ----------
    loose, tight : T1, T2, N, zero or more, T2 at least T1.
    ea : E A, N, above zero.
    """
    t1, t2 = _strands(loose, tight)
    return (1.0 + strain(t2, ea)) / (1.0 + strain(t1, ea))


def control_volume_loss(
    shaft_power: ArrayLike,
    loose: ArrayLike,
    tight: ArrayLike,
    loose_speed: ArrayLike,
    tight_speed: ArrayLike,
    ea: ArrayLike,
    line_density: ArrayLike,
    rise: ArrayLike,
    gravity: ArrayLike,
) -> Array:
    """Heat that leaves a control volume around the driven pulley, W, (6.5).

    Power of the strands minus that of the shaft and minus strain, kinetic and gravity energy carried
    away.  Steady state; as printed it is right to the first order of the strain, because the strain
    energy is counted per stretched length.

    Parameters
    ----------
    shaft_power : tau_b theta_b' of the load, W.
    loose, tight : T1 of the entering, T2 of the leaving strand, N, zero or more.
    loose_speed, tight_speed : V1, V2, m/s.
    ea : E A, N, above zero.
    line_density : rho A, kg/m, zero or more.
    rise : z2 - z1, leaving minus entering strand, m.
    gravity : g, m/s^2, zero or more.
    """
    t1, t2 = _strands(loose, tight)
    (k,) = above_zero(ea=ea)
    density, g = zero_or_more(line_density=line_density, gravity=gravity)
    shaft, v1, v2, z = finite(shaft_power=shaft_power, loose_speed=loose_speed, tight_speed=tight_speed, rise=rise)
    strands = v2 * t2 - v1 * t1
    strain_energy = (t1 * t1 * v1 - t2 * t2 * v2) / (2.0 * k)
    return strands - shaft + strain_energy + density * v2 * (0.5 * (v1 * v1 - v2 * v2) - g * z)


def kinetic_number(line_density: ArrayLike, speed: ArrayLike, difference: ArrayLike) -> Array:
    """Left side of (6.6), rho A V^2/(T2 - T1): far below 1 the cable's kinetic energy is negligible.

    Twice this number is the kinetic term of (6.5) over the loss (6.11).

    Parameters
    ----------
    line_density : rho A, kg/m, zero or more.
    speed : V, m/s.
    difference : T2 - T1, N, above zero.
    """
    (density,) = zero_or_more(line_density=line_density)
    (v,) = finite(speed=speed)
    (dt,) = above_zero(difference=difference)
    return density * v * v / dt


def gravity_number(
    line_density: ArrayLike, gravity: ArrayLike, ea: ArrayLike, radius: ArrayLike, difference: ArrayLike
) -> Array:
    """Left side of (6.7), 4 rho A g EA r_b/(T2 - T1)^2: far below 1 the cable's weight is negligible.

    The print's "EA^2" means E A^2, one A of which belongs to rho.  The number is the gravity term of
    (6.5) for the height 2 r_b over the loss (6.11).

    Parameters
    ----------
    line_density : rho A, kg/m, zero or more.
    gravity : g, m/s^2, zero or more.
    ea : E A, N, above zero.
    radius : r_b, m, above zero.
    difference : T2 - T1, N, above zero.
    """
    density, g = zero_or_more(line_density=line_density, gravity=gravity)
    k, r, dt = above_zero(ea=ea, radius=radius, difference=difference)
    return 4.0 * density * g * k * r / (dt * dt)


def driven_pulley_speed(loose_speed: ArrayLike, radius: ArrayLike) -> Array:
    """Speed of the driven pulley, rad/s, (6.8): V1/r_b, that of the entering strand.

    The drive pulley turns at V2/r_a, which enters there.  (6.9), V2/r_b for the driven pulley, would
    mean that heat flows in, `loss_by_sticking_point`.

    Parameters
    ----------
    loose_speed : V1, m/s.
    radius : r_b, m, above zero.
    """
    (v,) = finite(loose_speed=loose_speed)
    (r,) = above_zero(radius=radius)
    return v / r


def loss_by_sticking_point(
    speed: ArrayLike, loose: ArrayLike, tight: ArrayLike, ea: ArrayLike, sticks_at_entry: bool
) -> Array:
    """Loss at the driven pulley, W, if the cable sticks where it enters, (6.10.a), (6.8), or leaves, (6.10.b), (6.9).

    V (T2 - T1)/EA times T - (T1 + T2)/2 - T^2/(2 EA), T the tension of the other end.  The second is
    negative for every load, contrary to the second law: the cable sticks at its entry.  The last term
    is an artefact of (6.5), second order; without it the first is (6.11), with it negative for T2 - T1
    below T2^2/EA.

    Parameters
    ----------
    speed : theta_b' r_b, m/s, zero or more.
    loose, tight : T1, T2, N, zero or more, T2 at least T1.
    ea : E A, N, above zero.
    sticks_at_entry : which of the two.
    """
    t1, t2 = _strands(loose, tight)
    (v,) = zero_or_more(speed=speed)
    (k,) = above_zero(ea=ea)
    slips_at = t2 if sticks_at_entry else t1
    return v * (t2 - t1) / k * (slips_at - (t1 + t2) / 2.0 - slips_at * slips_at / (2.0 * k))


def pulley_loss(shaft_power: ArrayLike, difference: ArrayLike, ea: ArrayLike) -> Array:
    """Power lost at the driven, (6.11), or at the drive pulley, (6.12), W: P (T2 - T1)/(2 EA).

    First order of the strain.  Exact: V (T2 - T1)^2/(2 EA) for each pulley, V the speed of the unstretched
    cable.

    Parameters
    ----------
    shaft_power : tau theta' of that pulley, W.
    difference : T2 - T1, N, zero or more.
    ea : E A, N, above zero.
    """
    (power,) = finite(shaft_power=shaft_power)
    (dt,) = zero_or_more(difference=difference)
    (k,) = above_zero(ea=ea)
    return np.abs(power) * dt / (2.0 * k)


def output_power(input_power: ArrayLike, difference: ArrayLike, ea: ArrayLike) -> Array:
    """Greatest output power of a stage, W, (6.13): P_in (1 - (T2 - T1)/EA).  First order of the strain.

    Parameters
    ----------
    input_power : P_in, W.
    difference : T2 - T1, N, zero or more, below E A.
    ea : E A, N, above zero.
    """
    (power,) = finite(input_power=input_power)
    return power * equal_stages_efficiency(difference, ea, 1)


def equal_stages_efficiency(difference: ArrayLike, ea: ArrayLike, stages: ArrayLike) -> Array:
    """Upper bound of the efficiency of n stages of equal stress, (6.15), and of one, (6.14): (1 - (T2 - T1)/EA)^n.

    Stages of different stress: `cable.efficiency`.

    Parameters
    ----------
    difference : T2 - T1 of any of them, N, zero or more, below its E A.
    ea : its E A, N, above zero.
    stages : n, zero or more.
    """
    dt, n = zero_or_more(difference=difference, stages=stages)
    (k,) = above_zero(ea=ea)
    if not np.all(dt < k):
        raise ValueError(f"difference is {difference!r} N; it must be below ea, {ea!r} N")
    return (1.0 - dt / k) ** n


def slip_arc(loose: ArrayLike, tight: ArrayLike, friction_coefficient: ArrayLike) -> Array:
    """Arc of slip before the cable leaves a pulley, beta, rad, (6.16): ln(T2/T1)/mu.

    Coulomb friction, speed low enough for no centrifugal force.  If it exceeds the arc of contact,
    the whole cable slips.

    Parameters
    ----------
    loose, tight : T1, T2, N, above zero, T2 at least T1.
    friction_coefficient : mu, above zero.
    """
    (mu,) = above_zero(friction_coefficient=friction_coefficient)
    above_zero(loose=loose)
    t1, t2 = _strands(loose, tight)
    return np.log(t2 / t1) / mu


def driven_angle(
    drive_angle: ArrayLike, drive_radius: ArrayLike, driven_radius: ArrayLike, creep: ArrayLike = 0.0
) -> Array:
    """Angle of the driven pulley, rad, (6.17), with its creep (6.18): r_a/r_b theta_a + theta_b,error.

    Parameters
    ----------
    drive_angle : theta_a, rad.
    drive_radius, driven_radius : r_a, r_b, m, above zero.
    creep : theta_b,error of `cable.creep`, rad; zero for a rigid cable.
    """
    ra, rb = above_zero(drive_radius=drive_radius, driven_radius=driven_radius)
    angle, error = finite(drive_angle=drive_angle, creep=creep)
    return ra / rb * angle + error


def coulomb_like_torque(torque: ArrayLike, radius: ArrayLike, ea: ArrayLike) -> Array:
    """Friction torque equivalent to the loss (6.12) of ONE pulley, N m, (6.22): tau_a^2/(2 r_a EA).

    Drive and driven pulley together, referred to the motor, have twice that.  It is half of the loss that
    creep (6.19) dissipates: a model with creep must not have this friction in addition.

    Parameters
    ----------
    torque : tau_a, N m.
    radius : r_a, m, above zero.
    ea : E A, N, above zero.
    """
    (tau,) = finite(torque=torque)
    r, k = above_zero(radius=radius, ea=ea)
    return tau * tau / (2.0 * r * k)


def _strands(loose: ArrayLike, tight: ArrayLike) -> tuple[Array, Array]:
    t1, t2 = zero_or_more(loose=loose, tight=tight)
    if not np.all(t2 >= t1):
        raise ValueError(f"tight is {tight!r} N; it must be at least loose, {loose!r} N")
    return t1, t2
