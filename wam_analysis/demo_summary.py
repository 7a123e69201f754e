"""What a recording of the demonstration shows, in numbers; taken from the bag alone."""

from collections import Counter
from typing import NamedTuple

import numpy as np

from wam_analysis.bag import Bag, JointColumns
from wam_analysis.bag_file import mode_of
from wam_analysis.demo_traces import (
    NAN,
    RECORDED,
    Mask,
    Names,
    Numbers,
    Step,
    Traces,
    find_namespace,
    length,
    messages_of,
    node_of,
    steps_of,
    traces_of,
    values_of,
)
from wam_analysis.measures.runs import runs
from wam_ros.bag_losses import PARAMETERS, losses

NO_LINK = "none"
NOT_RECORDED = "not recorded"
STEADY = 1.0  # s at the end of a step that count as steady state
BOUNCE = 100_000_000  # ns without contact that do not end a contact


class Press(NamedTuple):
    """A pressing step in its steady state: means along the force asked for, N; NaN where unknown.

    `spread` is half of the range of the applied force.
    """

    step: str
    begin: int
    end: int
    asked: float
    applied: float
    spread: float
    measured: float
    felt: float

    def error(self, force: float) -> float:
        """Deviation from the force asked for, in per cent of it."""
        return 100.0 * (force - self.asked) / self.asked


class Touch(NamedTuple):
    """The contact in one step: links, medians of place (m) and force (N) while it lasted.

    Attributes
    ----------
    begin, end : of the step, ns.
    right : part of the contact's time in which the right link was felt.
    delay : s from the begin of the true contact to the first estimate, below zero where something
        was felt before; NaN where nothing was felt, None where the contact began in a step before.
    reason : why the estimator knows no place, in its own words; '' where it knows one.
    """

    step: str
    begin: int
    end: int
    link_true: str
    link_felt: str
    right: float
    place_true: float
    place_felt: float
    force_true: float
    force_felt: float
    delay: float | None
    reason: str


class Loop(NamedTuple):
    """The driver's clockwork; NaN where it was not recorded, as in lockstep.

    The driver reports latencies every second: p50 and p99 are medians of these, `worst` is the highest p99.
    """

    mode: str
    rate: float
    p50: float
    p99: float
    worst: float
    missed: int
    periods: int


class Moment(NamedTuple):
    """The instant that is drawn: joint names and angles (rad), contact true and felt (row of the traces)."""

    stamp: int
    row: int
    names: tuple[str, ...]
    q: Numbers


class DemoSummary(NamedTuple):
    """What the bag shows.

    Attributes
    ----------
    namespace : of the arm, '/wam'.
    period : time between two instants of the traces, s.
    outcome : 'done', why the scenario failed, or that the recording ended before it.
    false_contact, longest_false_contact, free : s felt without contact, the longest such time, s without contact.
    received, dropped : messages according to the recorder, -1 where it did not say.
    gone : messages that were recorded and are not in the bag, as far as is known.
    lost : sentences about what the bag lacks, none where nothing is known to be lost.
    notes : what is missing or not as it should be.
    """

    namespace: str
    period: float
    outcome: str
    steps: tuple[Step, ...]
    traces: Traces
    presses: tuple[Press, ...]
    touches: tuple[Touch, ...]
    false_contact: float
    longest_false_contact: float
    free: float
    loop: Loop
    received: int
    dropped: int
    gone: int
    lost: tuple[str, ...]
    moment: Moment | None
    notes: tuple[str, ...]


def summarize(bag: Bag) -> DemoSummary:
    """Everything that the report says about a bag, whatever part of the demonstration is in it."""
    namespace, notes = find_namespace(bag)
    steps, outcome = steps_of(bag, namespace)
    traces = traces_of(bag, namespace)
    if not steps:
        notes.append("no step of a scenario was recorded (status of node scenario)")
    missing = [name for name in RECORDED if not length(bag, namespace, name)]
    if missing:
        notes.append(f"not recorded: {', '.join(missing)}")
    presses = tuple(press for step in steps if (press := _press(traces, step)))
    known = traces.true.is_known & traces.felt.is_known
    false = known & ~traces.true.acts & traces.felt.acts
    period = float(np.median(np.diff(traces.stamp))) / 1e9 if len(traces.stamp) > 1 else 0.0
    received, dropped = _counts(bag.metadata.get("recording", {}))
    lost = losses(bag.path, bag.metadata, bag.attachments, bag.counts)
    return DemoSummary(
        namespace=namespace,
        period=period,
        outcome=outcome,
        steps=steps,
        traces=traces,
        presses=presses,
        touches=_touches(bag, namespace, traces, steps),
        false_contact=int(np.sum(false)) * period,
        longest_false_contact=max((end - begin for begin, end in runs(false).tolist()), default=0) * period,
        free=int(np.sum(known & ~traces.true.acts)) * period,
        loop=_loop(bag),
        received=received,
        dropped=dropped,
        gone=lost.gone,
        lost=tuple(lost.said(bag.first_ns)),
        moment=_moment(bag, namespace, traces, presses),
        notes=(*notes, *_faults(bag, namespace)),
    )


def _press(traces: Traces, step: Step) -> Press | None:
    whole = traces.during(step.begin, step.end) & traces.asked.acts
    if not np.any(whole):
        return None
    begin = max(step.end - round(STEADY * 1e9), (step.begin + step.end) // 2)
    steady = traces.during(begin, step.end) & traces.asked.acts
    if not np.any(steady):
        steady = whole
    applied = traces.along(traces.true, -1.0)[steady]
    return Press(
        step=step.name,
        begin=begin,
        end=step.end,
        asked=_mean(traces.asked.size[steady]),
        applied=_mean(applied),
        spread=float(np.ptp(applied)) / 2.0,
        measured=_mean(traces.along(traces.measured)[steady]),
        felt=_mean(traces.along(traces.felt, -1.0)[steady]),
    )


def _mean(values: Numbers) -> float:
    """Mean where at least half of the values are known, else NaN."""
    known = values[~np.isnan(values)]
    return float(np.mean(known)) if 2 * len(known) >= len(values) > 0 else NAN


def _median(values: Numbers) -> float:
    known = values[~np.isnan(values)]
    return float(np.median(known)) if len(known) else NAN


def _contacts(traces: Traces) -> list[tuple[int, int]]:
    """Rows [begin, end) of each true contact, bounces bridged."""
    contacts: list[tuple[int, int]] = []
    for begin, end in runs(traces.true.acts).tolist():
        if contacts and traces.stamp[begin] - traces.stamp[contacts[-1][1] - 1] <= BOUNCE:
            contacts[-1] = (contacts[-1][0], end)
        else:
            contacts.append((begin, end))
    return contacts


def _touches(bag: Bag, namespace: str, traces: Traces, steps: tuple[Step, ...]) -> tuple[Touch, ...]:
    touches = []
    told: set[int] = set()
    for step in steps:
        rows = traces.during(step.begin, step.end)
        if np.any(rows & (traces.push.acts | traces.asked.acts)):
            touches.append(_touch(traces, step, rows, told, _reasons(bag, namespace, step)))
    return tuple(touches)


def _touch(traces: Traces, step: Step, rows: Mask, told: set[int], reasons: Counter[tuple[str, str]]) -> Touch:
    true, felt = traces.true, traces.felt
    touching = rows & true.acts
    link_true = _most(true.frame[touching])
    if link_true == NO_LINK and not np.any(rows & true.is_known):
        link_true, touching = NOT_RECORDED, rows & felt.acts
    both = touching & felt.acts
    link_felt = _most(felt.frame[both]) if np.any(felt.is_known) else NOT_RECORDED
    right = both & (felt.frame == true.frame)
    place_felt = _median(felt.place[right])
    known = [reason for (link, reason), _ in reasons.most_common() if link == link_felt and reason]
    return Touch(
        step=step.name,
        begin=step.begin,
        end=step.end,
        link_true=link_true,
        link_felt=link_felt,
        right=float(np.mean(right[touching])) if np.any(touching & true.acts) else NAN,
        place_true=_median(true.place[touching & (true.frame == link_true)]),
        place_felt=place_felt,
        force_true=_median(true.size[touching & true.acts]),
        force_felt=_median(felt.size[both]),
        delay=_delay(traces, rows, told),
        reason=known[0] if known and np.isnan(place_felt) else "",
    )


def _most(names: Names) -> str:
    return Counter(names.tolist()).most_common(1)[0][0] if len(names) else NO_LINK


def _delay(traces: Traces, rows: Mask, told: set[int]) -> float | None:
    for begin, end in _contacts(traces):
        if not np.any(rows[begin:end]):
            continue
        if begin in told:
            return None
        told.add(begin)
        felt = traces.felt.acts
        if felt[begin]:
            before = np.flatnonzero(~felt[:begin])
            first = before[-1] + 1 if len(before) else 0
        else:
            after = np.flatnonzero(felt[begin:end])
            if not len(after):
                return NAN
            first = begin + after[0]
        return float(traces.stamp[first] - traces.stamp[begin]) / 1e9
    return NAN


def _reasons(bag: Bag, namespace: str, step: Step) -> Counter[tuple[str, str]]:
    """(link, reason) of the most probable hypothesis in each message of a step."""
    found: Counter[tuple[str, str]] = Counter()
    for array in messages_of(bag, f"{namespace}/contact/hypotheses"):
        stamp = array.header.stamp.sec * 1_000_000_000 + array.header.stamp.nanosec
        if array.status and step.begin <= stamp < step.end:
            found[str(array.status[0].name), str(array.status[0].message).split(";")[0]] += 1
    return found


def _loop(bag: Bag) -> Loop:
    reports = [
        values_of(status)
        for array in messages_of(bag, "/diagnostics")
        for status in array.status
        if node_of(status) == "driver"
    ]
    timed = [facts for facts in reports if "rate [Hz]" in facts]
    mode = mode_of(bag.metadata, bag.attachments.get(PARAMETERS))
    mode = "realtime" if mode == "unknown" and timed else mode
    if not timed:
        return Loop(mode, NAN, NAN, NAN, NAN, -1, -1)
    p50, p99 = (np.array([float(facts.get(f"latency {p} [us]", NAN)) for facts in timed]) for p in ("p50", "p99"))
    worst = float(np.nanmax(p99)) if not np.all(np.isnan(p99)) else NAN
    last = timed[-1]
    missed, periods = (int(last.get(key, -1)) for key in ("missed periods", "periods"))
    return Loop(mode, float(last["rate [Hz]"]), _median(p50), _median(p99), worst, missed, periods)


def _counts(recording: dict[str, str]) -> tuple[int, int]:
    if not any(key.endswith(" received") for key in recording):
        return -1, -1
    received, dropped = (
        sum(int(value) for key, value in recording.items() if key.endswith(ending))
        for ending in (" received", " dropped")
    )
    return received, dropped


def _faults(bag: Bag, namespace: str) -> list[str]:
    said = [
        f"driver fault at {int(values['stamp']) / 1e9:.2f} s: {values['fault']}"
        for status in messages_of(bag, f"{namespace}/status")
        if node_of(status) == "driver" and (values := values_of(status)).get("fault") and "stamp" in values
    ]
    return list(dict.fromkeys(said))


def _moment(bag: Bag, namespace: str, traces: Traces, presses: tuple[Press, ...]) -> Moment | None:
    """Middle of the steady state of the hardest press, else of the first contact, else the last pose."""
    joints = next(
        (
            columns
            for name in ("sim/joint_states", "joint_states")
            if isinstance(columns := bag.topics.get(f"{namespace}/{name}"), JointColumns)
            and len(columns.stamp_ns)
            and columns.position.size
        ),
        None,
    )
    if joints is None or not len(traces.stamp):
        return None
    contacts = _contacts(traces)
    stamp = int(traces.stamp[-1])
    if presses:
        hardest = max(presses, key=lambda press: press.asked)
        stamp = (hardest.begin + hardest.end) // 2
    elif contacts:
        stamp = int(traces.stamp[sum(contacts[0]) // 2])
    row = max(int(np.searchsorted(traces.stamp, stamp, side="right")) - 1, 0)
    at = max(int(np.searchsorted(joints.stamp_ns, stamp, side="right")) - 1, 0)
    return Moment(stamp, row, joints.names, joints.position[at])
