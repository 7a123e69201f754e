"""One slip with Coulomb friction, from breakaway to standstill, from which psi (5.18) follows."""

import math
from typing import NamedTuple

from wam_theory.friction_model import require
from wam_theory.slip_arc import Zone, arc_from, cubic_roots, first_stop, state_after

_INF = math.inf


class HalfCycle(NamedTuple):
    """One slip from breakaway to the next standstill, error 1 at breakaway, time in sqrt(J/(k_tr + k_c)).

    If the node only creeps towards F_des, `duration` is infinite and the other values are 0.
    """

    error: float
    acceleration: float
    duration: float


def half_cycle(gamma: float, zeta: float) -> HalfCycle:
    """One slip from a Coulomb breakaway, in the units of (5.14): error 1, time sqrt(J/(k_tr + k_c)).

    xi''' + 2 zeta xi'' + xi' + 2 zeta gamma xi = 0 from xi = 1, xi' = xi'' = 0 to the first xi' = 0.

    Parameters
    ----------
    gamma : J_l G_I K/b of (5.15), above zero.
    zeta : (5.12), above zero.
    """
    require("gamma", gamma, above=0.0)
    require("zeta", zeta, above=0.0)
    zone = Zone(cubic_roots(2.0 * zeta, 1.0, 2.0 * zeta * gamma), True, 0.0, 0.0, 1.0, 1.0)
    arc = arc_from(zone, 0.0, 1.0, 0.0, 0.0)
    duration = first_stop(arc, -1, True)
    if duration == _INF:
        return HalfCycle(0.0, 0.0, _INF)
    error, _, acceleration = state_after(arc, duration)
    return HalfCycle(error, acceleration, duration)
