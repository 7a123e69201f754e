"""Growth of a step by scipy's solve_ivp with events: slow, and without a formula of ours.

The node of figure 5.4 as it stands, (x, x', x_m) with friction of a given sign, each slip ended by an
event at x' = 0; breakaway after a stick as in (5.3).  What a response becomes is assessed as early as
`wam_theory.stability_map` assesses it, so that the comparison is one of integrators.
"""

import math
from itertools import pairwise
from typing import NamedTuple

from scipy.integrate import solve_ivp


class Tolerances(NamedTuple):
    """Method and tolerances of solve_ivp."""

    method: str
    rtol: float
    atol: float  # of the step


class Node(NamedTuple):
    """J = 1 and F_dynamic = 1; k_tr, k_c, b, G_I and F_static follow from the map's coordinates."""

    ktr: float
    kc: float
    b: float
    gain: float
    static: float

    @classmethod
    def of(cls, gamma: float, zeta: float, stiffness_ratio: float = 1.0, stiction: float = 1.0) -> "Node":
        ktr, kc = stiffness_ratio, 1.0
        b = 2.0 * zeta * math.sqrt(ktr + kc)
        return cls(ktr, kc, b, gamma * b * (1.0 / ktr + 1.0 / kc), stiction)


def _standstill(t, s, *_):
    return s[1]


_standstill.terminal = True


def grows(node: Node, step: float, how: Tolerances) -> bool:
    """Whether the response to a step grows: its next stick is at a greater error, or there is none."""
    ktr, kc, b, gain, static = node
    end = 100.0 / math.sqrt(ktr + kc)
    s = [0.0, 0.0, static / ktr]  # at breakaway
    sign, peaks = 1.0, [step]
    while True:

        def flow(t, s, sign=sign):
            x, v, m = s
            return v, ktr * (m - x) - kc * x - b * v - sign, gain * (step - kc * x)

        _standstill.direction = -sign
        atol = how.atol * step
        done = solve_ivp(flow, (0.0, end), s, how.method, events=_standstill, rtol=how.rtol, atol=atol)
        if done.status != 1:
            raise RuntimeError(f"{node}, step {step}: a slip has no end, {done.message}")
        x, _, m = done.y[:, -1]
        net = ktr * (m - x) - kc * x
        peaks.append(abs(step - kc * x))
        if abs(net) <= static:
            return bool(peaks[-1] > step)
        last, rise = (after - before for before, after in pairwise([math.nan, *peaks][-3:]))
        if peaks[-1] > 20.0 * step or 0.0 < last <= rise:
            return True
        if 0.0 > last >= rise:
            return False
        sign = math.copysign(1.0, net)
        s = [x, 0.0, m]
