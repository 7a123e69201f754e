"""What a recording says of forces: how they were reached and held, cycles and stability, contacts."""

import math
from collections.abc import Sequence

import numpy as np

from wam_analysis.demo_summary import NO_LINK, NOT_RECORDED
from wam_analysis.findings.finding import Finding, Section, shown, times
from wam_analysis.findings.guarded import Guarded
from wam_analysis.findings.guarded import sentence as guard_sentence
from wam_analysis.findings.held_force import CYCLING, HeldForce
from wam_analysis.findings.prediction import LargestForce
from wam_analysis.findings.recording import Recording
from wam_analysis.measures.force_accuracy import ForceAccuracy, dynamic_range
from wam_analysis.measures.limit_cycle import FEWEST
from wam_analysis.measures.runs import runs
from wam_analysis.measures.stability import Verdict
from wam_control.stability_guard import LARGEST

SURE = 0.8  # confidence from which a limit cycle is said to be one
SEEN = 0.02  # of the force: a cycle smaller than that is not worth a sentence


def force_section(recording: Recording, held: Sequence[HeldForce]) -> Section:
    """Forces asked for: reached, held, and the dynamic range (3.2.1)."""
    lacking = recording.lacking("force_command", "force_measured", "sim/contact/wrench")
    said, findings = [], []
    for one in held:
        said.append(_press_sentence(one))
        findings += _press_findings(one)
    if not held:
        said.append("No constant force was asked for.")
    range_said, range_findings = _dynamic_range(held)
    return Section("force", "Force", (*said, *range_said), (*findings, *range_findings), lacking)


def _dynamic_range(held: Sequence[HeldForce]) -> tuple[list[str], list[Finding]]:
    """Dynamic range (3.2.1): what was shown, and what the arm's limits promise."""
    known = [(one, accuracy) for one in held if math.isfinite((accuracy := _accuracy(one)).smallest)]
    if not known:
        return [], []
    limits = [one.largest for one in held if one.largest is not None and math.isfinite(one.largest.force)]
    least = min(limits, key=lambda limit: limit.force, default=LargestForce(math.nan, ""))
    promised = dynamic_range(least.force, least.limited_by, [accuracy for _, accuracy in known])
    held_most = max(one.hold.asked + accuracy.bias for one, accuracy in known)
    ratio = held_most / promised.smallest if promised.smallest > 0.0 else math.nan
    whose = "applied" if any(len(one.applied) for one, _ in known) else "measured"
    text = (
        f"Dynamic range of force control (3.2.1): {shown(ratio)} was shown, from {shown(promised.smallest, 'N')} that "
        f"the {whose} force was off at most to {shown(held_most, 'N')}, the largest that was held"
    )
    if limits:
        text += (
            f"; {shown(promised.ratio)} is predicted, to {shown(promised.largest, 'N')}, where the "
            f"{promised.limited_by} ends it, if the error stays what it is"
        )
    note = "the error that was measured below the largest force that was held, or that the limits allow"
    by = f"largest that was held; predicted by {promised.limited_by}" if limits else "largest that was held"
    return [f"{text}."], [
        Finding("smallest controllable force", "N", promised.smallest, note="bias and ripple of the worst force"),
        Finding("largest controllable force", "N", held_most, promised.largest, by),
        Finding("dynamic range", "", ratio, promised.ratio, note),
    ]


def _accuracy(one: HeldForce) -> ForceAccuracy:
    """Of the applied force, of the measured one where that was not recorded."""
    return one.applied_accuracy if len(one.applied) else one.measured_accuracy


def _press_sentence(one: HeldForce) -> str:
    hold, response = one.hold, one.response
    accuracy = _accuracy(one)
    whose = "applied" if len(one.applied) else "measured"
    text = f"{hold.name}: {shown(hold.asked, 'N')} asked on {hold.frame}"
    if math.isnan(accuracy.bias):
        return f"{text}; what came of it was not recorded."
    text += f", {shown(hold.asked + accuracy.bias, 'N')} {whose} in the end"
    text += f" ({100.0 * accuracy.bias / hold.asked:+.1f} %, ripple {shown(accuracy.ripple, 'N')})"
    if response is not None and math.isfinite(response.rise):
        said = [f"settled to 5 % after {shown(response.settling, 's')}"]
        if not math.isfinite(response.settling):
            said = ["did not settle to 5 %"]
        if math.isfinite(one.touched):
            said[0] += " from there" if one.touched > 0.0 and math.isfinite(response.settling) else ""
            said.insert(0, f"{_touched(one)}, so that rise and overshoot are those of the impact and are left out")
        else:
            said.insert(0, f"rose in {shown(response.rise, 's')}")
            said += [f"overshot by {100.0 * response.overshoot:.0f} %"] if response.overshoot > 0.01 else []
        text += f"; it {', '.join(said)}"
    return text + ("; it was pushed meanwhile." if hold.disturbed else ".")


def _touched(one: HeldForce) -> str:
    """When a press touched down, and how hard."""
    peak = float(np.nanmax(one.applied if len(one.applied) else one.measured))
    text = f"touched down {shown(abs(one.touched), 's')} {'into' if one.touched > 0.0 else 'before'} the step"
    return f"{text if one.touched else 'touched down as the step began'} (up to {shown(peak, 'N')})"


def _press_findings(one: HeldForce) -> list[Finding]:
    name, response = one.hold.name, one.response
    found = []
    if one.predicted is not None:
        rise = math.log(9.0) * one.predicted.time_constant
        note = "predicted without friction, inertia and feed-forward, (5.2)"
    else:
        rise, note = math.nan, ""
    if response is not None:
        rose, over, why = response.rise, 100.0 * response.overshoot, ""
        if math.isfinite(one.touched):
            rose = over = math.nan
            why = f"not measured: it {_touched(one)}"
        since = "from the touch-down" if one.touched > 0.0 else ""
        found += [
            Finding(f"{name}: rise time 10-90 %", "s", rose, rise, "; ".join(filter(None, (why, note)))),
            Finding(f"{name}: settling time to 5 %", "s", response.settling, note=since),
            Finding(f"{name}: overshoot", "%", over, note=why),
        ]
    for whose, accuracy, there in (
        ("applied", one.applied_accuracy, len(one.applied)),
        ("measured", one.measured_accuracy, len(one.measured)),
    ):
        if there:
            found += [
                Finding(f"{name}: bias of the {whose} force", "N", accuracy.bias, 0.0, "integral control"),
                Finding(f"{name}: ripple of the {whose} force", "N", accuracy.ripple),
            ]
    return found


def cycle_section(recording: Recording, held: Sequence[HeldForce]) -> Section:
    """Limit cycles and stability of the force loop beside chapter 5."""
    said: list[str] = []
    findings: list[Finding] = []
    told: set[str] = set()
    for one in held:
        said += [sentence for sentence in _cycle_sentences(one) if sentence not in said]
        findings += [*_cycle_findings(one), *_theory_findings(one, told)]
    if not held:
        said.append("No constant force was asked for, so that there is nothing to judge.")
    return Section("stability", "Stability and limit cycles", tuple(said), tuple(findings))


def _cycle_sentences(one: HeldForce) -> list[str]:
    name, cycle, predicted, verdict = one.hold.name, one.cycle, one.predicted, one.stability
    words = {
        Verdict.SETTLES: "settles",
        Verdict.CYCLES: "keeps swinging at constant size",
        Verdict.DIVERGES: f"DIVERGES, by {shown(100.0 * (verdict.growth - 1.0))} % a half cycle",
        Verdict.UNDECIDED: "is too short to be judged",
    }
    text = f"{name}: the force {words[verdict.verdict]}"
    if cycle.confidence >= SURE and cycle.peak_to_peak > SEEN * one.hold.asked:
        if verdict.verdict is not Verdict.DIVERGES:
            text = f"{name}: the force keeps swinging"
        text += (
            f"; a limit cycle of {shown(cycle.peak_to_peak, 'N')} peak to peak, every {shown(cycle.period, 's')} "
            f"(confidence {cycle.confidence:.2f})"
        )
    else:
        text += ", no limit cycle is seen in it"
    said = [text + "."]
    if one.guarded is not None:
        said.append(guard_sentence(one.guarded))
    if predicted is not None and math.isfinite(predicted.gamma):
        text = (
            f"Chapter 5, for an ideal velocity source: gamma {shown(predicted.gamma)}, zeta {shown(predicted.zeta)}: "
            f"{predicted.regime}"
        )
        if math.isfinite(predicted.period):
            text += (
                f"; a stiction cycle would have {shown(predicted.force_peak_to_peak, 'N')} and "
                f"{shown(predicted.period, 's')}"
            )
            if math.isfinite(predicted.driven_period):
                size, period = shown(predicted.driven_peak_to_peak, "N"), shown(predicted.driven_period, "s")
                text += f" ({size} and {period} with what the speed loops give way)"
            text += "" if predicted.is_certain else " if the node had less inertia, (5.11)"
            if predicted.period * FEWEST > CYCLING * (one.hold.end - one.hold.begin) / 1e9:
                text += ", too long for this recording to show it"
        said.append(text + ".")
    return said


def _cycle_findings(one: HeldForce) -> list[Finding]:
    name, cycle, predicted = one.hold.name, one.cycle, one.predicted
    seen = cycle.confidence >= SURE
    force = period = soft_force = soft_period = math.nan
    note = ""
    if predicted is not None:
        force, period = predicted.force_peak_to_peak, predicted.period
        soft_force, soft_period = predicted.driven_peak_to_peak, predicted.driven_period
        note = "(5.8), (5.9) corrected" + ("" if predicted.is_certain else "; (5.11) is not small, they need not hold")
    soft = f"with the speed loops in series, {shown(soft_force, 'N')}; " if math.isfinite(soft_force) else ""
    slow = f"with the speed loops in series, {shown(soft_period, 's')}" if math.isfinite(soft_period) else ""
    size, time = (cycle.peak_to_peak, cycle.period) if seen else (0.0, math.nan)
    return [
        Finding(f"{name}: limit cycle, peak to peak", "N", size, force, soft + note),
        Finding(f"{name}: period of the limit cycle", "s", time, period, slow),
        Finding(f"{name}: confidence of the limit cycle", "", cycle.confidence),
        Finding(f"{name}: growth per half cycle", "", one.stability.growth, note=str(one.stability.verdict)),
    ]


def _theory_findings(one: HeldForce, told: set[str]) -> list[Finding]:
    """What the theory says of the loop itself, once where several forces meet the same."""
    name, predicted = one.hold.name, one.predicted
    margin = one.guarded.judgement.scale if one.guarded is not None else math.nan
    key = f"{shown(predicted.gamma) if predicted is not None else ''} {shown(margin)}"
    if key in told:
        return []
    told.add(key)
    found = _margin_findings(name, one.guarded)
    if predicted is None:
        return found
    actuator = 1e3 * predicted.actuator_peak_to_peak
    ideal = "for an ideal velocity source, without friction"
    return [
        *found,
        Finding(f"{name}: actuator cycle at the contact, peak to peak", "mm", math.nan, actuator, "(5.20)"),
        Finding(f"{name}: gamma", "", math.nan, predicted.gamma, f"(5.15), {ideal}"),
        Finding(
            f"{name}: largest stable gain, continuous", "m/s/N", math.nan, predicted.routh_gain, f"(5.15), {ideal}"
        ),
        Finding(
            f"{name}: largest stable gain, as sampled",
            "m/s/N",
            math.nan,
            predicted.sampled_gain,
            f"no friction, {ideal}",
        ),
    ]


def _margin_findings(name: str, found: Guarded | None) -> list[Finding]:
    """Margin of the loop as it is, by the stability guard."""
    if found is None:
        return []
    scale = found.judgement.scale
    note = f"domain {found.judgement.domain}; stability guard, against {shown(found.surface, 'N/m')}"
    said = [Finding(f"{name}: margin of the gains, looked for up to {LARGEST:g} times", "", math.nan, scale, note)]
    if scale < LARGEST:
        label = f"{name}: largest stable gain, with the speed loops"
        said.append(Finding(label, "m/s/N", math.nan, scale * found.gain, "sampled; no friction"))
    return said


def contact_section(recording: Recording) -> Section:
    """What was felt against what touched."""
    summary = recording.summary
    traces = summary.traces
    lacking = recording.lacking("contact/wrench", "contact/point", "sim/contact/wrench", "sim/contact/point")
    said, findings = [], []
    for touch in summary.touches:
        if NOT_RECORDED in (touch.link_true, touch.link_felt):
            continue
        felt = "nothing" if touch.link_felt in ("base", NO_LINK, "") else touch.link_felt
        text = f"{touch.step}: {touch.link_true} was touched with {shown(touch.force_true, 'N')}, felt {felt}"
        if math.isfinite(touch.force_felt):
            text += f" with {shown(touch.force_felt, 'N')}"
        if touch.reason:
            text += f" ({touch.reason})"
        elif math.isfinite(touch.place_felt):
            text += f", {100.0 * abs(touch.place_felt - touch.place_true):.1f} cm off"
        said.append(text + ".")
    true, sensed = traces.true, traces.felt
    known = true.is_known & sensed.is_known
    touching = known & true.acts
    if np.any(touching):
        both = touching & sensed.acts & (sensed.frame == true.frame)
        place = np.abs(sensed.place - true.place)[both]
        place = place[np.isfinite(place)]
        force = np.linalg.norm(sensed.force - true.force, axis=1)[both]
        findings += [
            Finding("contact felt on the right link", "%", 100.0 * float(np.mean(both[touching])), 100.0),
            Finding("place, median error", "cm", 100.0 * float(np.median(place)) if len(place) else math.nan, 0.0),
            Finding("force, median error", "N", float(np.median(force)) if len(force) else math.nan, 0.0),
        ]
    if np.any(known):
        false = known & sensed.acts & ~true.acts
        count = len(runs(false))
        seconds = float(np.sum(false)) * summary.period
        findings.append(Finding("felt without a contact", "s", seconds, 0.0, times(count)))
        if count:
            said.append(f"Contact was felt {times(count)}, {shown(seconds, 's')} in all, where nothing touched.")
    elif np.any(sensed.is_known):
        said.append(f"Contact was felt {times(len(runs(sensed.acts)))}; the truth is not in this bag.")
    if not said:
        said.append("No contact was recorded.")
    return Section("contact", "Contact", tuple(said), tuple(findings), lacking)
