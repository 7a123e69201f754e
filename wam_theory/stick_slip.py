"""Exact motion of the friction node between transmission and contact (figures 5.2 and 5.4).

    J x'' = k_tr (x_m - x) - F_c - b x' - friction,    F_c = k_c x,    x_m' = G_I F_error

Parameters are in `friction_model`, closed forms in `slip_arc`, events in `phases`, verdicts in
`verdicts`, many steps at once in `stability_map`; the functions for one response are imported from here.
Units are free but consistent (N, m, s or N m, rad, s).
"""

import math
from bisect import bisect_right
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wam_theory.arguments import Array
from wam_theory.friction_model import FrictionNode, IntegralLoop, require
from wam_theory.half_cycle import HalfCycle, half_cycle
from wam_theory.phases import Kind, Model, Phase, phases_of, prepared
from wam_theory.slip_arc import arc_from, state_after
from wam_theory.thresholds import SEARCH
from wam_theory.verdicts import Outcome, Verdict, assess

__all__ = [
    "FrictionNode",
    "HalfCycle",
    "IntegralLoop",
    "Kind",
    "Motion",
    "Outcome",
    "PhaseEvent",
    "Trajectory",
    "Verdict",
    "assess",
    "half_cycle",
    "simulate",
]


class PhaseEvent(NamedTuple):
    """State at the start of a phase.

    `sign` is the direction of motion in the phase, 0 while stuck; `contact_force` is F_c, N m.
    """

    time: float
    kind: Kind
    sign: int
    x: float
    v: float
    x_m: float
    contact_force: float


class Motion(NamedTuple):
    """Sampled trajectory: arrays of the shape of the times."""

    x: Array
    v: Array
    x_m: Array
    contact_force: Array


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Exact trajectory up to a time: events, and the state at any time in between."""

    until: float
    ended: bool
    _model: Model = field(repr=False)
    _phases: tuple[Phase, ...] = field(repr=False)

    @property
    def events(self) -> list[PhaseEvent]:
        """Events in order of time; the first is the start."""
        return [
            PhaseEvent(t, kind, sign, x, v, m, self._model.contact_force(x))
            for t, kind, sign, _, _, x, v, m, _ in self._phases
        ]

    def at(self, times: ArrayLike) -> Motion:
        """Motion at these times.

        Parameters
        ----------
        times : (...) s, from 0 to `until`.

        Raises
        ------
        ValueError
            if a time is outside.
        """
        wanted = np.asarray(times, dtype=float)
        if not np.all((wanted >= 0.0) & (wanted <= self.until)):
            raise ValueError(f"times go from {wanted.min()} to {wanted.max()}; they must lie in 0 to {self.until}")
        starts = [phase[0] for phase in self._phases]
        states = [self._at(bisect_right(starts, t) - 1, t) for t in wanted.ravel().tolist()]
        x, v, m, force = np.array(states, dtype=float).reshape(-1, 4).T
        shape = wanted.shape
        return Motion(x.reshape(shape), v.reshape(shape), m.reshape(shape), force.reshape(shape))

    def _at(self, index: int, time: float) -> tuple[float, float, float, float]:
        start, _, sign, i, rate, x, v, m, a = self._phases[index]
        zone, dt = self._model.zones[i], time - start
        m += rate * dt
        if sign:
            x, v, a = state_after(arc_from(zone, rate, x, v, a), dt)
            if zone.linear:
                m = self._model.motor(zone, sign, (x, v, a))
        return x, v, m, self._model.contact_force(x)


def simulate(
    node: FrictionNode,
    loop: IntegralLoop,
    force: float,
    until: float,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    max_events: int = 1_000_000,
) -> Trajectory:
    """Exact response to a step of the desired force at time 0.

    Parameters
    ----------
    node, loop : to simulate.
    force : F_des, N m.
    until : s, above zero.
    start : x, v, x_m at time 0; by default at rest with unstressed springs.
    max_events : after this number, or once x is beyond 1e100, the trajectory ends early, at its `until`.

    Returns
    -------
    Trajectory
        `ended` : whether the last phase lasts indefinitely (the node rests, or creeps to its target).

    Raises
    ------
    ValueError
        if `until`, `start` or `force` is out of range.
    """
    require("until", until, above=0.0)
    if not all(map(math.isfinite, start)):
        raise ValueError(f"start is {start}; it must be finite")
    model = prepared(node, loop, force)
    seen: list[Phase] = []
    for phase in phases_of(model, start):
        if phase[0] > until:
            return Trajectory(until, False, model, tuple(seen))
        seen.append(phase)
        if len(seen) >= max_events or not abs(phase[5]) < SEARCH.diverged:
            return Trajectory(phase[0], False, model, tuple(seen))
    return Trajectory(until, True, model, tuple(seen))
