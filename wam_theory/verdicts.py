"""Whether a step response settles, ends in a limit cycle or diverges."""

import math
from collections.abc import Sequence
from enum import StrEnum
from itertools import pairwise
from typing import NamedTuple

from wam_theory.friction_model import FrictionNode, IntegralLoop
from wam_theory.phases import Kind, Model, Phase, phases_of, prepared
from wam_theory.slip_arc import arc_from

_INF = math.inf


class Verdict(StrEnum):
    """Long-term behaviour of a step response."""

    SETTLED = "settled"
    LIMIT_CYCLE = "limit cycle"
    DIVERGED = "diverged"
    UNDECIDED = "undecided"


class Outcome(NamedTuple):
    """Verdict on a step response, and the settled cycle of F_c.

    `peak_to_peak` (N m) and `period` (s) are NaN without a limit cycle; `time` is that of the last of the
    `events` that were needed.
    """

    verdict: Verdict
    peak_to_peak: float
    period: float
    time: float
    events: int


def _runaway_size(model: Model) -> float:
    """Size of the growing pair of modes above which friction can no longer stop its growth.

    A reversal changes friction by 2 F_dynamic, the real mode by `kick` and the pair by `kick_pair`.  A half
    cycle lasts at least 2.8/w as long as the real mode is below a tenth of the pair; above this size the
    pair grows by more than `kick_pair` in it, the node no longer sticks, and the real mode stays small.
    Infinite if the law is not linear throughout or the loop is linearly stable.
    """
    lam, alpha, square, width, apart = model.zones[0].roots
    if len(model.zones) > 1 or not model.zones[0].linear or alpha <= 0.0 or square >= 0.0:
        return _INF
    node = model.node
    kick = 2.0 * node.dynamic_friction / (node.inertia * apart)
    kick_pair = kick * math.hypot(1.0, (alpha - lam) / width)
    sticks = 3.0 * node.static_friction / (node.inertia * (alpha * alpha - square))
    real = 10.0 * kick / -math.expm1(2.8 * lam / width)
    return max(kick_pair / math.expm1(2.8 * alpha / width), real, sticks)


def _runs_away(model: Model, phase: Phase, size: float) -> bool:
    """Whether the response diverges from this phase on, which starts with a reversal."""
    _, _, _, i, rate, x, v, _, a = phase
    arc = arc_from(model.zones[i], rate, x, v, a)
    pair = math.hypot(arc.b, arc.c / arc.width)
    return pair > size and abs(arc.real) < 0.1 * pair


def assess(
    node: FrictionNode,
    loop: IntegralLoop,
    force: float,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    tolerance: float = 1e-9,
    max_events: int = 200_000,
) -> Outcome:
    """Verdict on a step response.

    Settled: the node rests or creeps to its target; or, with Coulomb friction only, a slip from stick to stick
    reduced the error, after which the response repeats on a smaller scale ((5.17): exact, because a slip from
    breakaway is proportional to its error); or it sticks within 1e-9 of the step and the friction from its target,
    from where the next slip is so late that its samples are lost in rounding; or eight successive standstills lie
    within 1e-7 of the step. Limit cycle: up to twelve standstills repeat in force and time to `tolerance`.
    Diverged: above 1e4 times the step and the friction, or, in a loop without limit, deadband or hold, once
    friction can no longer stop the growing modes.

    Parameters
    ----------
    node, loop : to simulate.
    force : F_des, N m.
    start : x, v, x_m at time 0.
    tolerance : relative, of the repetition.
    max_events : at most; without another verdict by then, it is a limit cycle (not strictly periodic) if the
        standstills of the last two quarters lie between the same two forces, to 2 % of their span, else undecided:
        a force that still rises in even steps has the same span, too.
    """
    model = prepared(node, loop, force)
    stiffness = node.contact_stiffness
    force = model.force
    scale = max(abs(force - model.contact_force(float(start[0]))), node.static_friction, 1e-300)
    runaway = _runaway_size(model)
    turns: list[tuple[float, float]] = []  # time and F_c of each standstill
    slipping: float = math.nan  # error at breakaway of the slip under way
    count, t = 0, 0.0
    creeping, crept_from = 0, math.nan  # samples since the last standstill, F_c then or 64 samples ago
    for phase in phases_of(model, start):
        count += 1
        t, kind, x = phase[0], phase[1], phase[5]
        error = abs(force - stiffness * x)
        if error > 1e4 * scale or count > max_events:
            break
        if kind is Kind.SLIP:
            slipping = error
        elif kind is Kind.SAMPLE:
            creeping += 1
            if creeping % 64 == 0:
                if abs(stiffness * x - crept_from) < 1e-9 * scale:
                    return Outcome(Verdict.SETTLED, math.nan, math.nan, t, count)
                crept_from = stiffness * x
        elif kind is Kind.STICK or kind is Kind.REVERSE:
            creeping, crept_from = 0, math.nan
            turns.append((t, model.contact_force(x)))
            if kind is Kind.STICK and (error < slipping <= model.self_similar or error < 1e-9 * scale):
                return Outcome(Verdict.SETTLED, math.nan, math.nan, t, count)
            if kind is Kind.REVERSE and runaway < _INF and _runs_away(model, phase, runaway):
                return Outcome(Verdict.DIVERGED, math.nan, math.nan, t, count)
            slipping = math.nan
            if len(turns) % 8 == 0 and (found := _cycle(turns, tolerance, scale)):
                return Outcome(*found, t, count)
    else:
        return Outcome(Verdict.SETTLED, math.nan, math.nan, t, count)
    if count <= max_events:
        return Outcome(Verdict.DIVERGED, math.nan, math.nan, t, count)
    return Outcome(*_irregular_cycle(turns, model.force), t, count)


def _cycle(turns: Sequence[tuple[float, float]], tolerance: float, scale: float) -> tuple[Verdict, float, float] | None:
    """Verdict, peak to peak and period, if the last standstills repeat or coincide."""
    last = [force for _, force in turns[-8:]]
    if max(last) - min(last) < 1e-7 * scale:
        return Verdict.SETTLED, math.nan, math.nan
    for n in range(2, 13):
        if len(turns) < 2 * n + 1:
            return None
        recent = turns[-2 * n - 1 :]
        forces = [force for _, force in recent[n:]]
        span = max(forces) - min(forces)
        period = recent[2 * n][0] - recent[n][0]
        if (
            all(abs(recent[k][1] - recent[k + n][1]) <= tolerance * span for k in range(n, -1, -1))
            and abs(period - (recent[n][0] - recent[0][0])) <= tolerance * period
        ):
            return Verdict.LIMIT_CYCLE, span, period
    return None


def _irregular_cycle(turns: Sequence[tuple[float, float]], force: float) -> tuple[Verdict, float, float]:
    """Verdict from the largest and smallest forces of the last two quarters of the standstills."""
    quarter = len(turns) // 4
    if quarter < 8:
        return Verdict.UNDECIDED, math.nan, math.nan
    before = [f for _, f in turns[-2 * quarter : -quarter]]
    late = [f for _, f in turns[-quarter:]]
    span = max(late) - min(late)
    if abs(min(late) - min(before)) + abs(max(late) - max(before)) > 0.02 * span:
        return Verdict.UNDECIDED, math.nan, math.nan
    passes = sum((f1 < force) != (f2 < force) for f1, f2 in pairwise(late))
    period = 2.0 * (turns[-1][0] - turns[-quarter][0]) / passes if passes else math.nan
    return Verdict.LIMIT_CYCLE, span, period
