"""What a recording says of the clockwork, and where it comes from."""

import math
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from wam_analysis.bag import Columns, JointColumns, PointColumns, WrenchColumns
from wam_analysis.findings.finding import Finding, Section, shown
from wam_analysis.findings.recording import Recording
from wam_analysis.measures.loop_timing import latency, stamp_timing

STAMPED = (JointColumns, WrenchColumns, PointColumns)
TIMED = ("motor_states", "motor_current_command", "joint_states", "force_measured", "contact/wrench")


def timing_section(recording: Recording) -> Section:
    """Periods, jitter, latency and what was missed, from stamps and times of reception."""
    said, findings = [], []
    real = recording.mode == "realtime"
    timing = recording.parameters.timing
    for name in TIMED:
        columns = recording.bag.topics.get(f"{recording.namespace}/{name}")
        if not isinstance(columns, STAMPED) or len(columns.stamp_ns) < 3:
            continue
        found = stamp_timing(columns.stamp_ns, columns.log_time_ns if real else None)
        expected = math.nan
        if timing is not None:
            expected = timing.period if name.startswith("motor_") else timing.outer_period_ns / 1e9
        findings += [
            Finding(f"{name}: period", "ms", 1e3 * found.period, 1e3 * expected),
            Finding(f"{name}: missed periods", "", float(found.missed), 0.0),
        ]
        if found.backwards:
            findings.append(Finding(f"{name}: stamps that do not rise", "", float(found.backwards), 0.0))
        if real:
            findings += [
                Finding(f"{name}: jitter of the reception", "ms", 1e3 * found.jitter, note="standard deviation"),
                Finding(f"{name}: longest wait", "ms", 1e3 * found.worst),
            ]
        if found.missed:
            said.append(
                f"{name}: {found.missed} periods without a message, the longest gap {shown(found.longest_gap, 's')}."
            )
    states, answers = recording.joints("motor_states"), recording.joints("motor_current_command")
    if real and states is not None and answers is not None:
        answer = latency(states.stamp_ns, states.log_time_ns, answers.stamp_ns, answers.log_time_ns)
        findings += [
            Finding("latency, state to current at the recorder: median", "us", 1e6 * answer.p50),
            Finding("latency, state to current at the recorder: 99 %", "us", 1e6 * answer.p99),
            Finding("latency, state to current at the recorder: worst", "us", 1e6 * answer.worst),
            Finding("states that were not answered", "", float(answer.unanswered), 0.0),
        ]
        said.append(
            f"A state was answered after {shown(1e6 * answer.p50, 'us')} in the median and "
            f"{shown(1e6 * answer.worst, 'us')} at worst, as the recorder saw it; "
            f"{answer.unanswered} of {answer.answered + answer.unanswered} were not."
        )
    loop = recording.summary.loop
    if not math.isnan(loop.rate):
        findings += [
            Finding("driver: rate", "Hz", loop.rate),
            Finding("driver: latency p50", "us", loop.p50),
            Finding("driver: latency p99", "us", loop.p99),
            Finding("driver: missed periods", "", float(loop.missed), 0.0, f"of {loop.periods}"),
        ]
    if recording.mode == "lockstep":
        said.append("Recorded in lockstep: the arm waited for every answer, so that times of reception say nothing.")
    if not findings:
        said.append("No stamped topic was recorded that shows the loop.")
    return Section("timing", "Timing of the loop", tuple(said), tuple(findings), recording.lacking(*TIMED[:2]))


def provenance(recording: Recording) -> dict[str, str]:
    """Where the recording and its numbers come from."""
    bag, summary = recording.bag, recording.summary
    said = dict(bag.metadata.get("recording", {}))
    counts = {name: len(columns.log_time_ns) for name, columns in bag.topics.items()}
    whole = bag.counts or counts
    try:
        here = version("wam_stack")
    except PackageNotFoundError:
        here = "not installed"
    facts = {
        "bag": str(bag.path),
        "arm": recording.namespace or "/",
        "mode": recording.mode,
        "topics": _part_of(sum(count > 0 for count in counts.values()), sum(count > 0 for count in whole.values())),
        "messages": _part_of(sum(counts.values()), sum(whole.values())),
        "received": "not said" if summary.received < 0 else str(summary.received),
        "dropped": "not said" if summary.dropped < 0 else str(summary.dropped),
        "lost": " ".join(summary.lost) or "nothing that is known of",
        "parameters, SHA-256": recording.parameters.hash or "not in the bag",
        "analysed with": f"wam_stack {here}",
    }
    told = {key: value for key, value in said.items() if not key.startswith("/") and key != "mode"}
    return {**facts, **{f"recorded: {key}": value for key, value in told.items()}}


def _part_of(read: int, all_of_them: int) -> str:
    if read == all_of_them:
        return str(read)
    return f"{read} of {all_of_them}; in the others is nothing that is analysed, so they are not read"


def extent(columns: Mapping[str, Columns]) -> float:
    """Length of a recording, s: from the first to the last log time of its topics."""
    times = [topic.log_time_ns for topic in columns.values() if len(topic.log_time_ns)]
    if not times:
        return 0.0
    stamped = [topic.stamp_ns for topic in columns.values() if isinstance(topic, STAMPED) and len(topic.stamp_ns)]
    chosen = stamped or times
    first, last = min(int(np.min(t)) for t in chosen), max(int(np.max(t)) for t in chosen)
    return (last - first) / 1e9
