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

    In a jump the motor stands still and F_c moves by Omega dF k_c/(k_tr + k_c); the node then sticks
    until (5.3) has passed.  From unstressed rest.  The cycle keeps the asymmetry with which it
    begins; only the motor's motion during a slip makes it symmetric.

    Parameters
    ----------
    node : with F_static above F_dynamic; inertia and damping count through zeta (5.12) alone.
    gain : G_I.
    force : F_des, N m.
    jumps : how many; fewer are returned where F_c meets F_des exactly.

    Raises
    ------
    ValueError
        with Coulomb friction, where nothing jumps: the response is (5.2) after the delay (5.3).
    """
    require("gain", gain, above=0.0)
    difference = node.static_friction - node.dynamic_friction
    if not difference > 0.0:
        raise ValueError(
            f"static_friction is {node.static_friction}, not above dynamic_friction: nothing jumps; "
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
