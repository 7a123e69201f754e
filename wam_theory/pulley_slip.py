"""Slip on a pulley over the torque, toothed elements, and idlers instead of stages (6.2.5, 6.3.2, 6.4.2)."""

import numpy as np
from numpy.typing import ArrayLike

from wam_theory.arguments import Array, above_zero, zero_or_more
from wam_theory.tension_element import equal_stages_efficiency, slip_arc, speed_ratio


def slip_arc_under_torque(
    torque: ArrayLike, pretension: ArrayLike, radius: ArrayLike, friction_coefficient: ArrayLike
) -> Array:
    """Arc of slip over the torque, rad, (6.16) with T0 +- tau/(2 r): 2 artanh(tau/(2 r T0))/mu; grows with the torque.

    The rubber band of 6.2.5.  The pretension is that of both strands at rest.

    Parameters
    ----------
    torque : tau of the pulley, N m, zero or more, below 2 r T0 (then a strand is slack).
    pretension : T0, N, above zero.
    radius : r, m, above zero.
    friction_coefficient : mu, above zero.
    """
    (tau,) = zero_or_more(torque=torque)
    t0, r = above_zero(pretension=pretension, radius=radius)
    half = tau / (2.0 * r)
    if not np.all(half < t0):
        raise ValueError(f"torque is {torque!r}; from 2 r T0 = {2.0 * r * t0!r} on a strand is slack")
    return slip_arc(t0 - half, t0 + half, friction_coefficient)


def torque_of_full_slip(
    wrap: ArrayLike, pretension: ArrayLike, radius: ArrayLike, friction_coefficient: ArrayLike
) -> Array:
    """Torque at which the whole arc of contact slips, N m: 2 r T0 tanh(mu wrap/2), where the arc of slip is the wrap.

    Parameters
    ----------
    wrap : arc of contact, rad, above zero.
    pretension, radius, friction_coefficient : as in `slip_arc_under_torque`.
    """
    w, t0, r, mu = above_zero(
        wrap=wrap, pretension=pretension, radius=radius, friction_coefficient=friction_coefficient
    )
    return np.asarray(2.0 * r * t0 * np.tanh(0.5 * mu * w))


def toothed_radius_ratio(loose: ArrayLike, tight: ArrayLike, ea: ArrayLike) -> Array:
    """Radius of a sprocket at its tight over that at its loose end, without slip: the ratio of the speeds V2/V1.

    Teeth keep the speeds of both shafts in their ratio, so that the element must run at V2/omega at one end and
    at V1/omega at the other: it climbs the teeth (figure 6.2).  Then no power is lost, and the paradox is none.

    Parameters
    ----------
    loose, tight, ea : as in `tension_element.speed_ratio`.
    """
    return speed_ratio(loose, tight, ea)


def idler_advantage(difference: ArrayLike, ea: ArrayLike, stages: ArrayLike) -> Array:
    """Efficiency of one stage over idlers over that of n stages, at least 1: no torque at an idler, so no slip.

    Friction of the idlers' bearings is extra.

    Parameters
    ----------
    difference, ea, stages : as in `tension_element.equal_stages_efficiency`.
    """
    return np.asarray(equal_stages_efficiency(difference, ea, 1.0) / equal_stages_efficiency(difference, ea, stages))
