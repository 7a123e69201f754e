"""Step response of a node without inertia, the limit of (5.11)."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_theory.friction_model import FrictionNode, require
from wam_theory.linear_loop import damping_ratio
from wam_theory.stiction import slip_overshoot


class Staircase(NamedTuple):
    """Jumps of an inertialess node: times (n,) s, contact force after each (n,) N m, and its spring force (n,) N m."""

    times: NDArray[np.float64]
    contact_forces: NDArray[np.float64]
    spring_forces: NDArray[np.float64]


def inertialess_staircase(node: FrictionNode, gain: float, force: float, jumps: int) -> Staircase:
    """Response of a node whose slip is a jump, the limit of (5.11): a staircase, then the cycle of (5.8), (5.9).

    During a jump the motor is at rest and F_c changes by Omega dF k_c/(k_tr + k_c); the node then sticks
    for (5.3).  From unstressed rest.  The cycle keeps its initial asymmetry; only motion of the motor
    during a slip makes it symmetric.

    Parameters
    ----------
    node : with F_static above F_dynamic; inertia and damping enter through zeta (5.12) only.
    gain : G_I.
    force : F_des, N m.
    jumps : number; fewer are returned if F_c meets F_des exactly.

    Raises
    ------
    ValueError
        with Coulomb friction, which has no jumps: the response is (5.2) after the delay (5.3).
    """
    require("gain", gain, above=0.0)
    difference = node.static_friction - node.dynamic_friction
    if not difference > 0.0:
        raise ValueError(
            f"static_friction is {node.static_friction}, not above dynamic_friction: there are no jumps; "
            "the response is (5.2) after the delay (5.3)"
        )
    ks = node.transmission_stiffness + node.contact_stiffness
    zeta = damping_ratio(node.inertia, node.damping, node.transmission_stiffness, node.contact_stiffness)
    omega = float(slip_overshoot(zeta))
    t, contact, spring = 0.0, 0.0, 0.0
    rows = []
    for _ in range(jumps):
        error = force - contact
        if error == 0.0:
            break
        sign = math.copysign(1.0, error)
        t += (node.static_friction - sign * spring) / (gain * node.transmission_stiffness * abs(error))
        contact += sign * omega * difference * node.contact_stiffness / ks
        spring = sign * (node.static_friction - omega * difference)
        rows.append((t, contact, spring))
    times, contacts, springs = np.array(rows, dtype=float).reshape(-1, 3).T
    return Staircase(times, contacts, springs)
