"""Sections about force: how it was reached and held, stability and limit cycles."""

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence

from wam_analysis.findings.finding import Finding, Section, shown
from wam_analysis.findings.held_force import HeldForce, Theory
from wam_analysis.held_messages import step_at
from wam_analysis.measures.response import StepResponse
from wam_analysis.measures.swings import Swings
from wam_analysis.recording import AnalysedRecording
from wam_analysis.thresholds import CYCLE, HOLD
from wam_control.force.guard import margin_text
from wam_control.force.thresholds import GUARD
from wam_description.number_text import apart
from wam_description.signals import BASE
from wam_sim.reactions import STEADY, RecordedReaction, duration, in_words, of_force_loop, within
from wam_theory.verdicts import Verdict

STEADY_PART = f"mean of the last {100.0 * HOLD.steady:.0f} % of the time in which it was commanded"
WHOSE = "Each force is the part along the command. The force loop measures; the contact estimator estimates."
STICTION = (
    "(5.8), (5.9) corrected, with the velocity loops in series with the cables; measured over three cycles or more"
)
SWINGS_ON = (Verdict.LIMIT_CYCLE, Verdict.DIVERGED)
NO_FORCE = f"No commanded force was constant for {HOLD.shortest:g} s or longer"


def force_section(recording: AnalysedRecording) -> Section:
    """Each commanded force, how it was reached and held, and the dynamic range (3.2.1)."""
    held = recording.held
    reactions = [*((one.hold.name, one.hold.reactions) for one in held), *_other_reactions(recording).items()]
    reported = [pair for name, found in reactions for pair in in_words(name, found, recording.traces.zero)]
    sentences = [*map(_press_sentence, held), *([] if held else [f"{NO_FORCE}."])]
    sentences += [f"{what}: {why}." for what, why in reported]
    sentences += [WHOSE] * any(not one.hold.is_refused for one in held)
    known = [one for one in held if math.isfinite(one.best.smallest)]
    findings = [finding for one in held for finding in press_findings(one)] + _dynamic_range(known)
    wrong = [f"{what}." for what, _ in reported]
    wrong += [_press_sentence(one) for one in held if one.hold.is_short and not one.hold.is_refused]
    return Section("force", "Force", sentences, findings, _forces_verdict(held, known), wrong)


def _other_reactions(recording: AnalysedRecording) -> dict[str, tuple[RecordedReaction, ...]]:
    """What was not simply obeyed besides constant forces, by step of the scenario, by force without one."""
    reactions, holds = of_force_loop(recording.reactions), recording.holds
    rest = [one for one in reactions if not any(within([one], hold.begin, hold.end) for hold in holds)]
    steps = defaultdict[str, tuple[RecordedReaction, ...]](tuple)
    for step in recording.steps:  # several may have one name
        steps[step.name] += within(rest, step.begin, step.end)
    for one in rest * (not recording.steps):
        steps[step_at(holds, one.begin) or "force loop"] += (one,)
    return {name: found for name, found in steps.items() if found}


def _forces_verdict(held: Sequence[HeldForce], known: Sequence[HeldForce]) -> tuple[str, ...]:
    """How far the held forces were from the commanded ones, of which that is known, in a sentence."""
    if not known:
        return ()
    controlled = [one for one in known if one.is_touching]
    errors = [100.0 * one.best.smallest / one.hold.commanded for one in controlled]
    reached = sum(error <= HOLD.force_tolerance for error in errors)
    text = f"Forces: {reached} of {sum(not one.hold.is_short for one in held)} within {HOLD.force_tolerance:g} %"
    if errors:
        whose = "" if all(len(one.true) for one in controlled) else "measured "
        text += f", largest {whose}error with ripple {apart(max(errors), HOLD.force_tolerance)} %"
    free = ", ".join(one.hold.name for one in known if not one.is_touching)
    return (f"{text}; nothing was touched: {free}." if free else f"{text}.",)


def _dynamic_range(known: Sequence[HeldForce]) -> list[Finding]:
    """Dynamic range (3.2.1) of some forces."""
    if not known:
        return []
    smallest = max(one.best.smallest for one in known) or math.nan
    largest = max(0.0, *(one.hold.commanded + one.best.bias for one in known))
    return [
        Finding("largest error, bias plus ripple", "N", smallest),
        Finding("largest held force", "N", largest),
        Finding("dynamic range", "", largest / smallest, note="largest held force over the largest error"),
    ]


def _press_sentence(one: HeldForce) -> str:
    """What the numbers of a commanded force do not show."""
    hold, response = one.hold, one.response
    where = hold.cover or hold.frame
    text = (
        f"{hold.name}: {shown(hold.commanded, 'N')} commanded {'in the base frame' if where == BASE else f'on {where}'}"
    )
    if hold.is_refused:
        return f"{text}, but not controlled, so it is not evaluated."
    if hold.is_short:
        return f"{text} for less than {STEADY:g} s, so it has no steady state."
    if math.isnan(one.best.bias):
        return f"{text}; the resulting force was not recorded."
    remarks = [text]
    if response is not None:
        if why := _impact(one):
            remarks.append(f"{why}, so rise time and overshoot are not evaluated")
        remarks += ["it did not stay within 5 % of the step"] * math.isinf(response.settling)
    remarks += ["the arm was pushed meanwhile"] * one.is_pushed
    return f"{'; '.join(remarks)}."


def _impact(one: HeldForce) -> str:
    """Why rise and overshoot of a press are not those of the control, '' where they are."""
    if one.before:
        return f"it began while {shown(one.before, 'N')} acted already"
    if math.isnan(one.touched):
        return ""
    when = f"{shown(abs(one.touched), 's')} {'after' if one.touched > 0.0 else 'before'} it began"
    return f"the surface was touched {when}"


def press_findings(one: HeldForce) -> list[Finding]:
    """A commanded force in numbers: how it was held, and how it was reached."""
    name, response = one.hold.name, one.response
    seconds = duration(reaction for reaction in one.hold.reactions if reaction.holds)
    found = [Finding(f"{name}: commanded force", "N", one.hold.commanded)]
    found += [Finding(f"{name}: refused for", "s", seconds)] if seconds else []
    if one.hold.is_refused:
        return found
    for whose, accuracy in one.accuracy.items():
        is_bound = whose == "estimated" and one.is_lower_bound
        force = one.hold.commanded + accuracy.bias
        error = math.nan if is_bound else 100.0 * accuracy.bias / one.hold.commanded
        found += [
            Finding(f"{name}: {whose} force", "N", force, note=STEADY_PART, is_lower_bound=is_bound),
            Finding(f"{name}: error of the {whose} force", "%", error),
            Finding(f"{name}: ripple of the {whose} force", "N", accuracy.ripple),
        ]
    found += [Finding(f"{name}: largest force", "N", one.largest)] * bool(len(one.true) or len(one.measured))
    if response is not None:
        found += response_findings(name, response, "from the touch-down" * (one.touched > 0.0))
    return found


def response_findings(name: str, response: StepResponse, since: str = "") -> list[Finding]:
    """How a force followed a step of its command; since when it settles, where not since the step."""
    return [
        Finding(f"{name}: rise time 10-90 %", "s", response.rise),
        Finding(f"{name}: settling time to 5 %", "s", response.settling, note=since),
        Finding(f"{name}: overshoot", "%", 100.0 * response.overshoot),
    ]


def cycle_section(recording: AnalysedRecording) -> Section:
    """Stability and limit cycles of the force loop, compared with chapter 5."""
    sentences: list[str] = []
    findings: list[Finding] = []
    wrong: list[str] = []
    held = recording.held
    for one in held:
        theory = recording.theories[one.hold.name]
        text, swings_on = _fate(one)
        found = [text, *(guard.sentence for guard in [theory.guarded] if guard)]
        sentences += [sentence for sentence in found if sentence not in sentences]
        wrong += [text] * swings_on
        if not one.hold.is_refused:
            findings += _cycle_findings(one, theory)
    if not held:
        sentences.append(f"{NO_FORCE}, so stability cannot be evaluated.")
    elif lowered := recording.admitted[1]:
        sentences.append(f"At the start, the guard lowered parameters to stable values: {lowered}.")
    settled = sum(one.swinging is not None and one.swinging.swings.verdict is Verdict.SETTLED for one in held)
    margins = [one.guarded.assessment.scale for one in recording.theories.values() if one.guarded is not None]
    least = margin_text(min(margins, default=math.nan), digits=3)
    margin = f"; predicted stable up to {least} times the gains at the start" * bool(margins)
    count = "all" if settled == len(held) else f"{settled} of {len(held)}"
    shows = [f"Stability: {count} forces settled{margin}."] * bool(settled and not wrong)
    return Section("stability", "Stability and limit cycles", sentences, findings, shows, wrong)


def _fate(one: HeldForce) -> tuple[str, bool]:
    """A sentence on whether the force settles, and whether it, or a shaft, swings on."""
    if one.swinging is None:
        silent = (
            "nothing was touched"
            if len(one.true) or len(one.measured)
            else "neither the force nor a motor or joint was recorded"
        )
        why = "it was not controlled" if one.hold.is_refused else silent
        return f"{one.hold.name}: {why}; its stability is not known.", False
    (shaft, seen), cycle = one.swinging, one.cycle
    if (is_cycle := _is_cycle(one)) and seen.verdict is not Verdict.DIVERGED:
        seen = seen._replace(verdict=Verdict.LIMIT_CYCLE)
    text = f"{one.hold.name}: {f'no force was recorded; {shaft}' if shaft else 'the force'} {fate_words(seen)}"
    if seen.verdict not in SWINGS_ON:
        return f"{text}; no limit cycle detected.", False
    swing, what = cycle if is_cycle else seen, "last" if seen.verdict is Verdict.DIVERGED else "limit cycle of"
    size = shown(swing.peak_to_peak, "rad" if shaft else "N")
    return f"{text}; {what} {size} peak to peak, period {shown(swing.period, 's')}.", True


def _is_cycle(one: HeldForce) -> bool:
    return one.cycle.confidence >= CYCLE.sure and one.cycle.peak_to_peak > CYCLE.seen * one.hold.commanded


def fate_words(seen: Swings) -> str:
    """Whether a force settles, in words."""
    return {
        Verdict.SETTLED: "settles",
        Verdict.LIMIT_CYCLE: "oscillates with constant amplitude",
        Verdict.DIVERGED: f"DIVERGES, by {shown(100.0 * (seen.growth - 1.0))} % per half cycle",
        Verdict.UNDECIDED: "swings too seldom to decide on its stability",
    }[seen.verdict]


def _cycle_findings(one: HeldForce, theory: Theory) -> Iterator[Finding]:
    name, cycle, seen, predicted = one.hold.name, one.cycle, one.swinging, theory.predicted
    size, time, sure = cycle.peak_to_peak, cycle.period, cycle.confidence
    if not _is_cycle(one):
        size = time = sure = math.nan
    force = predicted.force_peak_to_peak
    yield Finding(f"{name}: limit cycle, peak to peak", "N", size, force, STICTION * math.isfinite(force))
    yield Finding(f"{name}: period of the limit cycle", "s", time, predicted.period)
    yield Finding(f"{name}: confidence of the limit cycle", "", sure)
    if seen is not None and seen.shaft and seen.swings.verdict in SWINGS_ON:
        yield Finding(f"{name}: swing of {seen.shaft}, peak to peak", "rad", seen.swings.peak_to_peak)
        yield Finding(f"{name}: period of the swing", "s", seen.swings.period)
    if theory.guarded is not None:
        guard, surface = theory.guarded.assessment, shown(theory.guarded.surface, "N/m")
        note = f"domain {guard.domain}; stability guard, contact of {surface}"
        yield Finding(f"{name}: gain margin (up to {GUARD.largest_scale:g})", "", math.nan, guard.scale, note)
    if 0.0 < (size := predicted.actuator_peak_to_peak) < math.inf:
        label = f"{name}: cycle of the motors due to Coulomb friction, at the contact, peak to peak"
        yield Finding(label, "mm", 1e3 * theory.moved, 1e3 * size, "(5.20)")
