"""Stability map of figure 5.8: the largest stable step of many force loops at once, by exact events.

The motion after a stick depends on its error only, so a response is a sequence of maps from the error at
one breakaway to that at the next, with one slip between them or, if friction cannot hold the node, several
reversals.  The boundary is the unstable fixed point of that map, or the error from which the node never
sticks again.  The exact slips are those of `many_slips`.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wam_theory.arguments import Array, above_zero
from wam_theory.many_slips import Modes, modes, slip
from wam_theory.thresholds import SEARCH


def largest_stable_steps(
    gamma: ArrayLike, zeta: ArrayLike, stiffness_ratio: ArrayLike = 1.0, stiction: ArrayLike = 1.0, rtol: float = 1e-4
) -> Array:
    """F_error/F_dynamic of the largest step from unstressed rest that does not diverge (figure 5.8).

    The ordinate of the figure, for k_tr = k_c, is its inverse.  Up to the Routh limit it is infinite:
    friction is bounded, and a bounded input cannot make a stable loop diverge.  With stiction the steps
    below it end in a limit cycle (section 5.5.4).  By bisection for all nodes at once, on
    the assumption that every smaller step is stable, too.

    Parameters
    ----------
    gamma : J_l G_I K/b of (5.15), above zero.
    zeta : (5.12), above zero.
    stiffness_ratio : k_tr/k_c, above zero; the result is proportional to k_c/(k_tr + k_c).
    stiction : F_static/F_dynamic, at least 1, which is Coulomb friction.
    rtol : relative, of the result.

    Returns
    -------
    Array
        of the shape the arguments broadcast to; 0 if every step diverges (domain III).

    Raises
    ------
    ValueError
        if an argument is out of its range.
    """
    above_zero(rtol=rtol)
    g, z, ratio, s = np.broadcast_arrays(
        *above_zero(gamma=gamma, zeta=zeta, stiffness_ratio=stiffness_ratio, stiction=stiction)
    )
    if not np.all(s >= 1.0):
        raise ValueError(f"stiction is {stiction!r}, F_static over F_dynamic; it must be at least 1")
    steps = np.full(g.size, math.inf)
    beyond = np.flatnonzero(g.ravel() > 1.0)
    steps[beyond] = _boundaries(_Nodes.of(g.ravel()[beyond], z.ravel()[beyond], s.ravel()[beyond]), rtol)
    return steps.reshape(g.shape) / (1.0 + ratio)


class _Nodes(NamedTuple):
    """Nodes beyond the Routh limit, arrays (n,); forces in the units of `many_slips`."""

    modes: Modes
    stiction: Array
    runaway: Array  # size of the growing mode above which friction cannot stop its growth
    guess: Array  # largest stable step by the describing function (5.16)

    @classmethod
    def of(cls, gamma: Array, zeta: Array, stiction: Array) -> "_Nodes":
        """Nodes with their thresholds; `runaway` as in `verdicts`."""
        m = modes(gamma, zeta)
        kick = 2.0 / m.apart
        kick_pair = kick * np.hypot(1.0, (m.alpha - m.real) / m.width)
        real = -10.0 * kick / np.expm1(2.8 * m.real / m.width)
        runaway = np.maximum(kick_pair / np.expm1(2.8 * m.alpha / m.width), real)
        share = m.square / m.apart  # of a step that goes into the real mode
        pair = np.hypot(1.0 - share, (m.real * share + m.alpha * (1.0 - share)) / m.width)
        sine = 2.0 / (math.pi * zeta * (gamma - 1.0))
        return cls(m, stiction, np.maximum(runaway, 3.0 * stiction / m.square), sine / pair)

    def take(self, which: NDArray[np.generic]) -> "_Nodes":
        """A selection of the nodes."""
        return _Nodes(self.modes.of(which), self.stiction[which], self.runaway[which], self.guess[which])


def _next_errors(nodes: _Nodes, errors: Array) -> Array:
    """Error at the next stick after a breakaway with this one, (n,); infinite where the response diverges.

    It diverges once friction cannot stop the growing mode, or if the growth of the mode increases over two
    slips; if its decrease increases over two slips, or its size stays the same, the error is 0.  Reason: near
    a cycle of reversals the changes of its size are a mu^n + b nu^n with mu > 1 > |nu|, nu from the real mode;
    two of the same sign, the later one greater, have the sign of a.
    """
    found = np.full(errors.size, math.inf)
    index = np.arange(errors.size)
    xi, acceleration = -errors, nodes.stiction - 1.0
    before = rise_before = np.full(errors.size, math.nan)
    while index.size:
        end = slip(nodes.modes, xi, acceleration)
        rise = end.pair - before
        lost = (end.pair > nodes.runaway) & (np.abs(end.real) < 0.1 * end.pair)
        lost |= (rise_before > 0.0) & (rise >= rise_before)
        sticks = ~lost & (end.acceleration + 1.0 >= -nodes.stiction)
        falls = ~lost & ~sticks & (rise_before <= 0.0) & (rise <= rise_before)
        found[index[sticks]] = np.abs(end.error[sticks])
        found[index[falls]] = 0.0
        on = np.flatnonzero(~(lost | sticks | falls))
        index, nodes, before, rise_before = index[on], nodes.take(on), end.pair[on], rise[on]
        xi, acceleration = -end.error[on], -end.acceleration[on] - 2.0
    return found


def _boundaries(nodes: _Nodes, rtol: float) -> Array:
    """Largest stable step of each node, (n,)."""
    steps = _stable_steps(nodes)
    some = np.flatnonzero(steps > 0.0)
    nodes, low = nodes.take(some), steps[some]
    high = np.maximum(1.2 * low, nodes.guess)
    rising = np.arange(some.size)
    while rising.size:
        rising = rising[_next_errors(nodes.take(rising), high[rising]) <= high[rising]]
        low[rising] = high[rising]
        high[rising] *= 1.5
    while (apart := np.flatnonzero(high > low * (1.0 + rtol))).size:
        middle = np.sqrt(low[apart] * high[apart])
        stable = _next_errors(nodes.take(apart), middle) <= middle
        low[apart[stable]], high[apart[~stable]] = middle[stable], middle[~stable]
    steps[some] = np.sqrt(low * high)
    return steps


def _sticking_edge(nodes: _Nodes) -> Array:
    """Approximately the greatest error, (n,), from which the node sticks again before the response diverges."""
    unit = slip(nodes.modes, -np.ones(nodes.stiction.size), np.zeros(nodes.stiction.size))
    low = np.full(nodes.stiction.size, SEARCH.first_step)
    high = 2.0 * np.maximum(nodes.guess, (1.0 + nodes.stiction) / np.abs(unit.acceleration))
    for _ in range(14):
        middle = np.sqrt(low * high)
        sticks = np.isfinite(_next_errors(nodes, middle))
        low, high = np.where(sticks, middle, low), np.where(sticks, high, middle)
    return low


def _stable_steps(nodes: _Nodes) -> Array:
    """A step of each node that is not followed by a greater error, (n,); 0 without one.

    With Coulomb friction the smallest step decides, because the map is linear while the node sticks.  With
    stiction small errors grow to those of the limit cycle, and the step must exceed them: first some steps
    below the greatest that still sticks are tried, then the limit of the growing errors is extrapolated.
    """
    first = np.full(nodes.stiction.size, SEARCH.first_step)
    steps = np.where(_next_errors(nodes, first) <= first, first, 0.0)
    left = np.flatnonzero((steps == 0.0) & (nodes.stiction > 1.0))
    edge = _sticking_edge(nodes.take(left))
    for fraction in (0.9999, 0.98, 0.93, 0.8, 0.6, 0.3, 0.1):
        tried = fraction * edge
        held = _next_errors(nodes.take(left), tried) <= tried
        steps[left[held]] = tried[held]
        left, edge = left[~held], edge[~held]
    index = np.flatnonzero((steps == 0.0) & (nodes.stiction > 1.0))
    nodes = nodes.take(index)
    errors, rises = np.full(index.size, SEARCH.first_step), np.full(index.size, math.nan)
    for _ in range(SEARCH.slips):
        after = _next_errors(nodes, errors)
        rise = after - errors
        with np.errstate(invalid="ignore", divide="ignore"):
            limit = 1.001 * (after + rise * rise / (rises - rise))
        limit = np.where(rise <= 0.0, errors, np.where(rise < rises, limit, math.nan))
        candidates = np.flatnonzero(np.isfinite(limit))
        settles = candidates[_next_errors(nodes.take(candidates), limit[candidates]) <= limit[candidates]]
        steps[index[settles]] = limit[settles]
        on = np.flatnonzero((steps[index] == 0.0) & np.isfinite(after))
        if not on.size:
            break
        index, nodes, errors, rises = index[on], nodes.take(on), after[on], rise[on]
    return steps
