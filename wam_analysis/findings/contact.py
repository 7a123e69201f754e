"""Section about the estimated contacts, compared with the true ones."""

import math
from collections.abc import Iterator

import numpy as np

from wam_analysis.demo_summary import NO_LINK, NOT_RECORDED
from wam_analysis.findings.analysed_run import AnalysedRun
from wam_analysis.findings.finding import Finding, Section, shown, times
from wam_analysis.measures.runs import runs
from wam_analysis.task_forces import arm_of
from wam_bag.bag import TableColumns
from wam_description.topics import FRICTION_COLUMNS


def contact_section(recording: AnalysedRun) -> Section:
    """Estimated contacts, compared with the true ones."""
    summary = recording.summary
    traces = summary.traces
    lacking = recording.lacking("contact/wrench", "contact/point", "sim/contact/wrench", "sim/contact/point")
    sentences, findings, verdict = [], [], []
    for touch in summary.touches:
        if NOT_RECORDED in (touch.link_true, touch.link_estimated):
            continue
        missed = touch.link_estimated in ("base", NO_LINK, "")
        text = f"{touch.step}: contact of {touch.link_true} with {shown(touch.force_true, 'N')}"
        verdict += [f"{touch.step}: the contact of {touch.link_true} was MISSED."] * missed
        text += ", missed" if missed else f"; estimated on {touch.link_estimated}"
        if math.isfinite(touch.force_estimated):
            text += f" with {shown(touch.force_estimated, 'N')}"
        if touch.reason:
            text += f" ({touch.reason})"
        elif math.isfinite(touch.position_estimated):
            text += f", position error {100.0 * abs(touch.position_estimated - touch.position_true):.1f} cm"
        sentences.append(text + ".")
    true, sensed = traces.true, traces.estimated
    known = true.is_known & sensed.is_known
    touching = known & true.acts
    if np.any(touching):
        both = touching & sensed.acts & (sensed.frame == true.frame)
        position = np.abs(sensed.position - true.position)[both]
        position = position[np.isfinite(position)]
        force = np.linalg.norm(sensed.force - true.force, axis=1)[both]
        right = 100.0 * float(np.mean(both[touching]))
        away = 100.0 * float(np.median(position)) if len(position) else math.nan
        off = float(np.median(force)) if len(force) else math.nan
        findings += [
            Finding("contact on the right link", "%", right),
            Finding("position error, median", "cm", away, note="along the link, without its sign"),
            Finding(
                "size of the force error, median", "N", off, note="of the vector: the norm of its three components"
            ),
        ]
        verdict.append(f"Contact: on the right link {right:.0f} % of the time{_errors(away, off)}.")
    if np.any(known):
        false = known & sensed.acts & ~true.acts
        count = len(runs(false))
        seconds = float(np.sum(false)) * summary.period
        findings.append(Finding("false detections", "s", seconds, note=times(count)))
        if count:
            sentences.append(f"False detections: {count}, {shown(seconds, 's')} in all.")
            verdict.insert(0, sentences[-1])
    elif np.any(sensed.is_known):
        sentences.append(f"Contact was detected {times(len(runs(sensed.acts)))}; the true contact is not in this bag.")
    if not sentences:
        sentences.append("No contact was recorded.")
    findings += _tracked_friction(recording)
    return Section("contact", "Contact", tuple(sentences), tuple(findings), lacking, tuple(verdict))


def _tracked_friction(recording: AnalysedRun) -> Iterator[Finding]:
    """Friction of motors and joints as the estimator followed it, at the end of the recording."""
    run, arm = recording.run, arm_of(recording.run)
    columns = run.bag.topics.get(f"{run.namespace}/contact/tracked_friction")
    if not isinstance(columns, TableColumns) or not len(columns.stamp_ns) or arm is None:
        return
    names = (*arm.motors.names, *arm.joints.names)
    for way in FRICTION_COLUMNS[:2]:
        values, sds = columns.columns[way], columns.columns[f"{way}_sd"]
        for i, name in enumerate(names, start=-len(names)):
            first, last = values[i % len(names)], float(values[i])
            if last:
                note = f"tracked between contacts, {100.0 * (last / first - 1.0):+.1f} % since the start"
                yield Finding(f"{name}: friction in {way} motion", "N m", last, note=note, error=float(sds[i]))


def _errors(away: float, off: float) -> str:
    named = ((away, "cm", "of the position"), (off, "N", "of the force vector, its size"))
    known = [f"{shown(value, unit)} {what}" for value, unit, what in named if math.isfinite(value)]
    return f"; median errors {' and '.join(known)}" if known else ""
