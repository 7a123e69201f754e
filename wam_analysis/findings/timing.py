"""Section about the timing of the loop, and the provenance of the recording."""

import math
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from wam_analysis.contact_list import median
from wam_analysis.findings.finding import Finding, Section, counted, shown
from wam_analysis.foreign.source import Source
from wam_analysis.measures.runs import missed, usual_steps
from wam_analysis.recording import RATE, STAMPED, AnalysedRecording
from wam_analysis.thresholds import SHAFT, STREAM
from wam_bag.arrays import Times
from wam_bag.losses import RECORDING

TIMED = ("motor_states", "motor_current_command", "joint_states", "force_measured", "contact/wrench")


# name, stamps and receptions, ns, period by the parameters, s, whether it should last for the whole recording
_Stream = tuple[str, Times, Times | None, float, bool]


def _own_streams(recording: AnalysedRecording) -> Iterator[_Stream]:
    timing = recording.parameters.timing
    for name in TIMED:
        columns = recording.bag.topics.get(f"{recording.namespace}/{name}")
        if isinstance(columns, STAMPED) and len(columns.stamp_ns) >= STREAM.fewest:
            expected = math.nan
            if timing is not None:
                expected = timing.period if name.startswith("motor_") else timing.outer_period_ns / 1e9
            received = columns.log_time_ns if recording.mode == "realtime" else None
            yield name, columns.stamp_ns, received, expected, False


def _foreign_streams(recording: AnalysedRecording) -> Iterator[_Stream]:
    """Those of each sender by itself."""
    senders: dict[tuple[str, bytes], list[Source]] = {}
    for one in recording.analysed:
        if len(one.time) >= SHAFT.fewest_samples:
            senders.setdefault((one.topic, one.sent.tobytes()), []).append(one)
    topics = [topic for topic, _ in senders]
    for (topic, _), those in senders.items():
        first, name = those[0], topic
        if topics.count(topic) > 1:
            name += f" of {', '.join(one.name or one.frame for one in those)}"
        stamp, received = ((1e9 * times).round().astype(np.int64) for times in (first.sent, first.received))
        columns: Any = recording.bag.topics[topic]
        if first.sends_changes or len(columns.stamp_ns) > recording.bag.counts.get(topic, math.inf):
            continue  # of a path of trajectories there are more
        is_table = np.array_equal(columns.stamp_ns, columns.log_time_ns)  # or messages without stamps
        yield name, stamp, None if is_table else received, math.nan, not first.is_command


def timing_section(recording: AnalysedRecording) -> Section:
    """Periods, jitter, latency and missed periods, from stamps and reception times."""
    findings, wrong = [], []
    streams = list(_foreign_streams(recording) if recording.is_foreign else _own_streams(recording))
    first, last = (f((at for _, stamp, *_ in streams for at in stamp[[0, -1]].tolist()), default=0) for f in (min, max))
    for name, stamp, received, expected, should_last in streams:
        times, rows = np.unique(stamp, return_index=True)
        steps = np.diff(times).astype(np.float64)
        periods = usual_steps(steps) if len(steps) else np.full(1, math.nan)
        period, slowest = median(periods) / 1e9, float(np.max(periods)) / 1e9
        lost, waits = missed(times, periods), np.diff(stamp)
        longest, backwards = int(np.argmax(waits)), np.sum(waits <= 0)
        gap, begin = float(waits[longest]) / 1e9, (stamp[longest] - first) / 1e9
        findings += [
            Finding(f"{name}: period", "ms", 1e3 * period, 1e3 * expected),
            Finding(f"{name}: missed periods", "", lost),
            Finding(f"{name}: longest gap between stamps", "s", gap),
        ]
        findings += [Finding(f"{name}: stamps that do not increase", "", float(backwards))] * bool(backwards)
        if received is not None and np.ptp(received) > STREAM.live * np.ptp(stamp):  # of no file that was converted
            receptions = np.diff(np.sort(received)) / 1e9
            usual = np.diff(received[rows])[steps <= STREAM.changes * periods] / 1e9  # with no message missing
            findings += [
                Finding(f"{name}: period of the receptions", "ms", 1e3 * float(np.mean(receptions))),
                Finding(f"{name}: reception jitter", "ms", 1e3 * float(np.std(usual)), note="standard deviation"),
                Finding(f"{name}: longest gap between receptions", "s", float(np.max(receptions))),
            ]
            late = float(np.median(received - stamp))
            if abs(late) < STREAM.reset:  # else they are of two clocks
                findings.append(Finding(f"{name}: delay of the receptions", "ms", late / 1e6))
            at, passed = (
                [np.mean(part) for part in np.array_split(np.sort(each - each[0]), STREAM.parts)]
                for each in (received, stamp)
            )
            (speed, _), ((variance, _), _) = np.polyfit(at, passed, 1, cov=True)  # delays that change are on no line
            if abs(speed - 1.0) > max(STREAM.drift, SHAFT.noisy * math.sqrt(variance)):
                what = f"the clock of the stamps runs at {100.0 * speed:.4g} % of that of the receptions"
                wrong.append(f"{name}: {what}; a clock is fast or slow, or time was simulated.")
        if slowest > STREAM.changes * period:
            wrong.append(f"{name}: the period changes between {shown(period, 's')} and {shown(slowest, 's')}.")
        if lost:
            what = "irregular stamps, missing messages are not known"
            if lost > 0.0:
                what = f"{counted(int(lost), 'message')} missing"
            wrong.append(f"{name}: {what}; longest gap: {shown(gap, 's')} from {begin:.2f} s.")
        if should_last and lost >= 0.0:
            least = max(STREAM.reset / 1e9, STREAM.filled * period)
            wrong += [
                f"{name}: no message in the {part} {shown(of, 's')} of the recording."
                for part, of in (("first", (stamp[0] - first) / 1e9), ("last", (last - stamp[-1]) / 1e9))
                if of > least
            ]
    silent = "No message is missing." if findings else "No stamped topic has a period."
    sentences = wrong or [silent] * (recording.is_foreign or not findings)  # ours lists what is lost
    if timed := [facts for facts in recording.loop if RATE in facts]:
        last = timed[-1]
        findings.append(Finding("driver: rate", "Hz", float(last[RATE])))
        for p in ("p50", "p99"):  # of every second
            values = np.array([float(facts.get(f"latency {p} [us]", math.nan)) for facts in timed])
            findings.append(Finding(f"driver: latency {p}", "us", median(values)))
        note = f"of {last.get('periods', '-')}"
        findings.append(Finding("driver: missed periods", "", float(last.get("missed periods", math.nan)), note=note))
    if recording.mode == "lockstep":
        waited = "Recorded in lockstep: the driver waited for every command, so reception times have no meaning."
        sentences = [*sentences, waited]
    return Section("timing", "Timing", sentences, findings, wrong=wrong)


def provenance(recording: AnalysedRecording) -> dict[str, str]:
    """Origin of the recording and of its numbers."""
    bag = recording.bag
    metadata, parameters = bag.metadata.get(RECORDING, {}), recording.run.parameters
    counts = {name: len(columns.log_time_ns) for name, columns in bag.topics.items()}
    whole = bag.counts or counts
    read = [min(counts.get(name, 0), number) for name, number in whole.items()]  # a trajectory has many rows
    try:
        here = version("wam_stack")
    except PackageNotFoundError:
        here = "not installed"
    facts = {
        "bag": str(bag.path),
        **({} if recording.is_foreign else {"arm": recording.namespace or "/"}),
        "mode": recording.mode,
        "messages": f"{sum(read)} of {sum(whole.values())} needed and read",
        "lost": " ".join(recording.lost) or "none known",
        "parameters, SHA-256": parameters.sha256 or "not in the bag",
        **({"parameters, notes": "; ".join(parameters.notes)} if parameters.notes else {}),
        "analysed with": f"wam_stack {here}",
    }
    recorder = {
        f"recorded: {key}": value for key, value in metadata.items() if not key.startswith("/") and key != "mode"
    }
    return facts | recorder
