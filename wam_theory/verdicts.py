"""What becomes of a step response: settled, limit cycle or diverged, and the largest step that does not diverge."""

import math
from collections.abc import Sequence
from enum import StrEnum
from itertools import pairwise
from typing import NamedTuple

from wam_theory.friction_model import ForceLoop, FrictionNode, require
from wam_theory.phases import Kind, Model, Phase, phases_of, prepared
from wam_theory.slip_arc import arc_from

_INF = math.inf


class Verdict(StrEnum):
    """What becomes of a step response."""

    SETTLED = "settled"
    LIMIT_CYCLE = "limit cycle"
    DIVERGED = "diverged"
    UNDECIDED = "undecided"


class Outcome(NamedTuple):
    """Verdict on a step response, and the settled cycle of F_c.

    `peak_to_peak` (N m) and `period` (s) are NaN unless it is a limit cycle; `time` is that of the
    last of the `events` looked at.
    """

    verdict: Verdict
    peak_to_peak: float
    period: float
    time: float
    events: int


def _runaway_size(model: Model) -> float:
    """Size of the growing pair of modes above which it outgrows every kick that friction can give it.

    Reversing friction by 2 F_dynamic kicks the real mode by `kick` and the pair by `kick_pair`; over
    a half cycle, while the real mode is a tenth of the pair never shorter than 2.8/w, the pair grows
    by more than that, sticks no more, and the real mode stays small.  Infinite where the law is not
    linear throughout or the loop is linearly stable.
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
    """Whether the phase, which begins with a reversal, is the beginning of the end."""
    _, _, _, i, rate, x, v, _, a = phase
    arc = arc_from(model.zones[i], rate, x, v, a)
    pair = math.hypot(arc.b, arc.c / arc.width)
    return pair > size and abs(arc.real) < 0.1 * pair


def assess(
    node: FrictionNode,
    loop: ForceLoop,
    force: float,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    tolerance: float = 1e-9,
    max_events: int = 200_000,
) -> Outcome:
    """What becomes of a step response.

    Settled: it rests or creeps to its target for ever; or, with Coulomb friction alone, a slip from
    stick to stick has reduced the error, after which the response only repeats itself smaller
    ((5.17): exact, because a slip from breakaway is proportional to its error); or eight standstills
    in a row stayed within 1e-7 of the step.  Limit cycle: twelve standstills or fewer repeat in place
    and time to `tolerance`.  Diverged: above 1e4 times the step and the friction, or, in a loop
    without limit, deadband or hold, once the growing modes outgrow whatever friction can take.

    Parameters
    ----------
    node, loop : what is simulated.
    force : F_des, N m.
    start : x, v, x_m at time 0.
    tolerance : relative, of the repetition.
    max_events : looked at; if nothing is clear by then and the standstills of the last quarter span
        what those of the quarter before did, to 2 %, it is a (not strictly periodic) limit cycle.
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
            if kind is Kind.STICK and error < slipping <= model.self_similar:
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
    """Verdict, peak to peak and period, if the last standstills repeat or have become one place."""
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
    """Verdict from the spans of the last two quarters of the standstills."""
    quarter = len(turns) // 4
    if quarter < 8:
        return Verdict.UNDECIDED, math.nan, math.nan
    before = [f for _, f in turns[-2 * quarter : -quarter]]
    late = [f for _, f in turns[-quarter:]]
    spans = max(before) - min(before), max(late) - min(late)
    if abs(spans[1] - spans[0]) > 0.02 * spans[1]:
        return Verdict.UNDECIDED, math.nan, math.nan
    passes = sum((f1 < force) != (f2 < force) for f1, f2 in pairwise(late))
    period = 2.0 * (turns[-1][0] - turns[-quarter][0]) / passes if passes else math.nan
    return Verdict.LIMIT_CYCLE, spans[1], period


def largest_stable_step(node: FrictionNode, loop: ForceLoop, rtol: float = 1e-6, largest: float = 1e4) -> float:
    """Largest step of F_des from unstressed rest that does not diverge (domain II of figure 5.8).

    Bisection, which supposes that every smaller step is stable too.

    Parameters
    ----------
    node, loop : what is simulated; the node has friction.
    rtol : relative, of the result.
    largest : steps above this many times F_static are not tried.

    Returns
    -------
    float
        N m; 0 where a step of 1e-3 F_static diverges (domain III), infinite where one of `largest` does not.

    Raises
    ------
    ValueError
        where there is no friction to compare with, or a response stays undecided.
    """
    require("static_friction", node.static_friction, above=0.0)

    def stable(step: float) -> bool:
        verdict = assess(node, loop, step).verdict
        if verdict is Verdict.UNDECIDED:
            raise ValueError(f"the response to a step of {step} stays undecided; move the gain, {loop.gain}, a little")
        return verdict is not Verdict.DIVERGED

    low, high = 1e-3 * node.static_friction, largest * node.static_friction
    if not stable(low):
        return 0.0
    if stable(high):
        return _INF
    while high > low * (1.0 + rtol):
        middle = math.sqrt(low * high)
        if stable(middle):
            low = middle
        else:
            high = middle
    return low
