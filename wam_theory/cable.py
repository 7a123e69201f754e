"""Cable stages: stiffness, slack, tension, loss and creep (4.1, chapter 6).

A circuit has two strands under a pretension T0; torque tightens one and loosens the other.
"""

import numpy as np
from numpy.typing import ArrayLike

from wam_theory.arguments import Array, above_zero, finite, zero_or_more


def stage_compliance(
    ea: ArrayLike, length: ArrayLike, radius: ArrayLike, circuits: ArrayLike, ratio: ArrayLike
) -> Array:
    """Compliance of one pretensioned stage, seen at the motor, rad/(N m).

    1/k = n^2 L/(2 EA r^2 c): both strands carry load, so that the stiffness at the stage's own shaft is
    2 (EA/L) r^2 for each of c parallel circuits, and the motor turns n times per turn of it (section 4.3.2).

    Parameters
    ----------
    ea : E A of one cable, N.
    length : free length of a strand, m; zero for a rigid stage.
    radius : of the stage's driving pulley, m.
    circuits : parallel circuits.
    ratio : motor turns per turn of the driving pulley.
    """
    ea, radius, circuits, ratio = above_zero(ea=ea, radius=radius, circuits=circuits, ratio=ratio)
    (length,) = zero_or_more(length=length)
    return length * ratio**2 / (2.0 * ea * radius**2 * circuits)


def stiffness_with_reducer(ea: ArrayLike, length: ArrayLike, ratio: ArrayLike, distance: ArrayLike) -> Array:
    """Stiffness at the joint of a line of constant stress with its reducer part of the way, (4.1).

    k_eff = N^2 EA/(N L + C (1 - N)), for a pulley of unit radius; greatest for C = L, the reducer at the joint.

    Parameters
    ----------
    ea : E A of the part between motor and reducer, N.
    length : L, m.
    ratio : N.
    distance : C, of the reducer from the motor, m, 0 to L.
    """
    ea, length, ratio = above_zero(ea=ea, length=length, ratio=ratio)
    (distance,) = zero_or_more(distance=distance)
    if np.any(distance > length):
        raise ValueError(f"distance is {distance.tolist()!r} m; it must not be above length, {length.tolist()!r} m")
    return ratio**2 * ea / (ratio * length + distance * (1.0 - ratio))


def circuit_torque(stretch: ArrayLike, stiffness: ArrayLike, pretension: ArrayLike, radius: ArrayLike) -> Array:
    """Torque of a circuit at its motor, N m, with the loose strand going slack.

    Each strand is a spring of k/2 that cannot push, pre-stretched by x0 = T0 r/(k/2): the
    torque is k x up to |x| = x0 and (k/2)(|x| + x0) beyond.

    Parameters
    ----------
    stretch : theta_m minus the joints' angle at the motor, rad.
    stiffness : k, both strands, N m/rad.
    pretension : T0, N.
    radius : of the pinion, m.
    """
    (x,) = finite(stretch=stretch)
    stiffness, radius = above_zero(stiffness=stiffness, radius=radius)
    (pretension,) = zero_or_more(pretension=pretension)
    half = stiffness / 2.0
    offset = slack_stretch(stiffness, pretension, radius)
    return half * (np.maximum(x + offset, 0.0) - np.maximum(offset - x, 0.0))


def slack_stretch(stiffness: ArrayLike, pretension: ArrayLike, radius: ArrayLike) -> Array:
    """Stretch at which the loose strand goes slack, x0 = 2 T0 r/k, rad.

    Parameters
    ----------
    stiffness : k of the circuit at its motor, N m/rad.
    pretension : T0 of a strand, N.
    radius : r of the pinion, m.
    """
    stiffness, radius = above_zero(stiffness=stiffness, radius=radius)
    (pretension,) = zero_or_more(pretension=pretension)
    return 2.0 * pretension * radius / stiffness


def tensions(torque: ArrayLike, pretension: ArrayLike, radius: ArrayLike) -> tuple[Array, Array]:
    """Tension of the tight and of the loose strand, N, under a torque at the pinion, N m.

    T0 +- tau/(2 r), and tau/r and zero once the loose strand is slack (section 6.5: no strand goes
    slack if T0 is half of the full-torque tension).

    Parameters
    ----------
    torque : at the pinion, N m.
    pretension : T0, N, zero or more.
    radius : of the pinion, m, above zero.
    """
    (radius,) = above_zero(radius=radius)
    (pretension,) = zero_or_more(pretension=pretension)
    (torque,) = finite(torque=torque)
    difference = np.abs(torque) / radius
    slack = difference > 2.0 * pretension
    return (
        np.where(slack, difference, pretension + difference / 2.0),
        np.where(slack, 0.0, pretension - difference / 2.0),
    )


def stage_loss(torque: ArrayLike, radius: ArrayLike, ea: ArrayLike, circuits: ArrayLike, ratio: ArrayLike) -> Array:
    """Relative loss of speed and of power of a stage, (T2 - T1)/EA of (6.4) and (6.14), for strain far below 1.

    Parameters
    ----------
    torque : at the motor, N m; at the stage's own driving shaft it is `ratio` times as much.
    radius, ea, circuits, ratio : of the stage as in `stage_compliance`.
    """
    radius, ea, circuits, ratio = above_zero(radius=radius, ea=ea, circuits=circuits, ratio=ratio)
    (torque,) = finite(torque=torque)
    return np.abs(torque) * ratio / (radius * ea * circuits)


def efficiency(losses: ArrayLike) -> float:
    """Upper bound of the efficiency of stages in series, the product of 1 - loss, (6.15).

    Parameters
    ----------
    losses : (stages,), `stage_loss` of each.
    """
    loss = np.asarray(losses, dtype=float)
    if not np.all((loss >= 0.0) & (loss < 1.0)):
        raise ValueError(f"losses are {loss.tolist()!r}; each must be at least 0 and below 1")
    return float(np.prod(1.0 - loss))


def creep(travel: ArrayLike, torque: ArrayLike, radius: ArrayLike, ea: ArrayLike) -> Array:
    """Creep of the driven pulley under a torque, seen at the motor, rad, (6.19) corrected; never undone, (6.20).

    The integral of (T2 - T1)/EA over the absolute travel of the driving pulley: travel out and back under
    the same torque adds up.

    Parameters
    ----------
    travel : absolute travel of the driving pulley, rad.
    torque : of the load on it, N m, with its sign.
    radius : of the driving pulley, m.
    ea : E A, N.
    """
    radius, ea = above_zero(radius=radius, ea=ea)
    (travel,) = zero_or_more(travel=travel)
    (torque,) = finite(torque=torque)
    return travel * torque / (radius * ea)


def eccentric_ripple(eccentricity: ArrayLike, pretension: ArrayLike, angle: ArrayLike) -> Array:
    """Torque of an eccentric pulley, 2 epsilon T sin theta, N m, (6.23): 2 epsilon T is its amplitude.

    Parameters
    ----------
    eccentricity : epsilon, m.
    pretension : T, N.
    angle : theta of the pulley, rad.
    """
    eccentricity, pretension = zero_or_more(eccentricity=eccentricity, pretension=pretension)
    (angle,) = finite(angle=angle)
    return 2.0 * eccentricity * pretension * np.sin(angle)
