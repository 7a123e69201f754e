"""What a recording of the demonstration shows, in numbers; taken from the bag alone."""

from collections import Counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.bag import Bag, JointColumns, Messages, PointColumns, WrenchColumns
from wam_ros.topics import TOPICS

Numbers = NDArray[np.float64]
Names = NDArray[np.str_]
Times = NDArray[np.int64]
Mask = NDArray[np.bool_]

NAN = float("nan")
NO_LINK = "none"
NOT_RECORDED = "not recorded"
STEADY = 1.0  # s at the end of a step that count as steady state
HELD = 100_000_000  # ns that a message stands for; older, the signal counts as unknown
BOUNCE = 100_000_000  # ns without contact that do not end a contact

TOPICS_READ = (
    "status", "force_command", "force_measured", "contact/wrench", "contact/point", "contact/hypotheses",
    "sim/contact/wrench", "sim/contact/point", "sim/disturbance", "sim/joint_states", "joint_states", "/diagnostics",
)  # fmt: skip


class Step(NamedTuple):
    """A step of the scenario and when it was played, ns of the arm's time."""

    name: str
    begin: int
    end: int


class Signal(NamedTuple):
    """Forces over the k instants of a time base; NaN where nothing was recorded.

    Attributes
    ----------
    frame : (k,), frame of each force.
    force : (k, 3), N.
    place : (k,), distance along the frame's x, m; NaN also where it is not known.
    """

    frame: Names
    force: Numbers
    place: Numbers

    @property
    def size(self) -> Numbers:
        """Magnitude of each force, (k,), N."""
        return np.linalg.norm(self.force, axis=1)

    @property
    def acts(self) -> Mask:
        """Where there is a force, (k,)."""
        return self.size > 0.0

    @property
    def is_known(self) -> Mask:
        """Where it was recorded, (k,)."""
        return ~np.isnan(self.size)


class Traces(NamedTuple):
    """The demonstration over time: k instants, ns of the arm's time.

    Attributes
    ----------
    asked, measured : force of the arm on the world.
    true, felt : contact according to the simulator and to the estimator, force of the world on the arm.
    push : push that the scenario asked of the simulator.
    """

    stamp: Times
    asked: Signal
    measured: Signal
    true: Signal
    felt: Signal
    push: Signal

    def along(self, signal: Signal, sign: float = 1.0) -> Numbers:
        """Component along the force asked for, (k,), N; NaN where none is asked or on another link.

        Parameters
        ----------
        signal : one of these traces.
        sign : -1 turns a force of the world on the arm into one of the arm on the world.
        """
        size = self.asked.size
        direction = self.asked.force / np.where(size > 0.0, size, NAN)[:, np.newaxis]
        component: Numbers = sign * np.sum(signal.force * direction, axis=1)
        component[signal.acts & (signal.frame != self.asked.frame)] = NAN
        return component

    def during(self, begin: int, end: int) -> Mask:
        """The instants from begin up to end, ns."""
        return (self.stamp >= begin) & (self.stamp < end)


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
    right : part of the contact's time in which the right link was felt.
    delay : s from the begin of the true contact to the first estimate, below zero where something
        was felt before; NaN where nothing was felt, None where the contact began in a step before.
    reason : why the estimator knows no place, in its own words; '' where it knows one.
    """

    step: str
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
    outcome : 'done', why the scenario failed, or that the recording ended before it.
    false_contact, longest_false_contact, free : s felt without contact, the longest such time, s without contact.
    received, dropped : messages according to the recorder, -1 where it did not say.
    notes : what is missing or not as it should be.
    """

    namespace: str
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
    moment: Moment | None
    notes: tuple[str, ...]


def summarize(bag: Bag) -> DemoSummary:
    """Everything that the report says about a bag, whatever part of the demonstration is in it."""
    namespace, notes = _namespace(bag)
    steps, outcome = _steps(bag, namespace)
    traces = _traces(bag, namespace)
    if not steps:
        notes.append("no step of a scenario was recorded (status of node scenario)")
    missing = [name for name in TOPICS_READ[1:9] if not _length(bag, namespace, name)]
    if missing:
        notes.append(f"not recorded: {', '.join(missing)}")
    presses = tuple(press for step in steps if (press := _press(traces, step)))
    known = traces.true.is_known & traces.felt.is_known
    false = known & ~traces.true.acts & traces.felt.acts
    period = float(np.median(np.diff(traces.stamp))) / 1e9 if len(traces.stamp) > 1 else 0.0
    received, dropped = _counts(bag.metadata.get("recording", {}))
    return DemoSummary(
        namespace=namespace,
        outcome=outcome,
        steps=steps,
        traces=traces,
        presses=presses,
        touches=_touches(bag, namespace, traces, steps),
        false_contact=np.count_nonzero(false) * period,
        longest_false_contact=max((end - begin for begin, end in _runs(false)), default=0) * period,
        free=np.count_nonzero(known & ~traces.true.acts) * period,
        loop=_loop(bag),
        received=received,
        dropped=dropped,
        moment=_moment(bag, namespace, traces, presses),
        notes=(*notes, *_faults(bag, namespace)),
    )


def _namespace(bag: Bag) -> tuple[str, list[str]]:
    counts: Counter[str] = Counter()
    for topic in TOPICS:
        if not topic.name.startswith("/"):
            ending = f"/{topic.name}"
            counts.update(name.removesuffix(ending) for name in sorted(bag.topics) if name.endswith(ending))
    arms = [name for name in sorted(counts) if f"{name}/status" in bag.topics]
    found = counts.most_common(1)[0][0] if counts else ""
    return found, [f"arms in this bag: {', '.join(arms)}; this is {found}"] if len(arms) > 1 else []


def _length(bag: Bag, namespace: str, name: str) -> int:
    columns = bag.topics.get(f"{namespace}/{name}")
    return 0 if columns is None else len(columns.log_time_ns)


def _messages(bag: Bag, topic: str) -> tuple[Any, ...]:
    columns = bag.topics.get(topic)
    return columns.messages if isinstance(columns, Messages) else ()


def _values(status: Any) -> dict[str, str]:
    return {item.key: item.value for item in status.values}


def _node(status: Any) -> str:
    return str(status.name).rsplit("/", 1)[-1]


def _steps(bag: Bag, namespace: str) -> tuple[tuple[Step, ...], str]:
    said = [
        (int(_values(status)["stamp"]), str(status.message), int(status.level))
        for status in _messages(bag, f"{namespace}/status")
        if _node(status) == "scenario" and "stamp" in _values(status)
    ]
    ends = [i for i, (_, message, level) in enumerate(said) if message == "done" or level]
    outcome = said[ends[0]][1] if ends else "not finished: the recording ends before the scenario does"
    commands = bag.topics.get(f"{namespace}/force_command")
    last = int(commands.stamp_ns[-1]) if isinstance(commands, WrenchColumns) and len(commands.stamp_ns) else 0
    if not ends and said:
        said.append((max(last, said[-1][0]), "", 0))
    elif ends:
        said = said[: ends[0] + 1]
    steps = [Step(now[1], now[0], then[0]) for now, then in zip(said, said[1:], strict=False)]
    return tuple(steps), outcome


def _traces(bag: Bag, namespace: str) -> Traces:
    def signal(wrench: str, point: str = "") -> Signal:
        forces, points = (bag.topics.get(f"{namespace}/{name}") for name in (wrench, point))
        if not isinstance(forces, WrenchColumns) or not len(forces.stamp_ns):
            return Signal(np.full(len(base), ""), np.full((len(base), 3), NAN), np.full(len(base), NAN))
        row, known = _held(forces.stamp_ns, base)
        force = np.where(known[:, np.newaxis], forces.force[row], NAN)
        place = np.full(len(base), NAN)
        if isinstance(points, PointColumns) and len(points.stamp_ns):
            at, is_there = _held(points.stamp_ns, base)
            same = is_there & known & (points.stamp_ns[at] == forces.stamp_ns[row])
            place[same] = points.point[at[same], 0]
        return Signal(np.array(forces.frames)[row], force, place)

    base = np.empty(0, np.int64)
    for name in ("sim/contact/wrench", "force_command", "contact/wrench"):
        columns = bag.topics.get(f"{namespace}/{name}")
        if isinstance(columns, WrenchColumns) and len(columns.stamp_ns):
            base = columns.stamp_ns
            break
    return Traces(
        stamp=base,
        asked=signal("force_command"),
        measured=signal("force_measured"),
        true=signal("sim/contact/wrench", "sim/contact/point"),
        felt=signal("contact/wrench", "contact/point"),
        push=signal("sim/disturbance"),
    )


def _held(stamps: Times, base: Times) -> tuple[NDArray[np.intp], Mask]:
    """Row of the last message at or before each instant, and whether there is one that is not too old."""
    row = np.searchsorted(stamps, base, side="right") - 1
    known = row >= 0
    row = np.maximum(row, 0)
    return row, known & (base - stamps[row] <= HELD)


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


def _runs(mask: Mask) -> list[tuple[int, int]]:
    """Rows [begin, end) of each stretch that is true."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _contacts(traces: Traces) -> list[tuple[int, int]]:
    """Rows [begin, end) of each true contact, bounces bridged."""
    contacts: list[tuple[int, int]] = []
    for begin, end in _runs(traces.true.acts):
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
        link_true=link_true,
        link_felt=link_felt,
        right=np.count_nonzero(right) / np.count_nonzero(touching) if np.any(touching & true.acts) else NAN,
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
    for array in _messages(bag, f"{namespace}/contact/hypotheses"):
        stamp = array.header.stamp.sec * 1_000_000_000 + array.header.stamp.nanosec
        if array.status and step.begin <= stamp < step.end:
            found[str(array.status[0].name), str(array.status[0].message).split(";")[0]] += 1
    return found


def _loop(bag: Bag) -> Loop:
    reports = [
        _values(status)
        for array in _messages(bag, "/diagnostics")
        for status in array.status
        if _node(status) == "driver"
    ]
    timed = [facts for facts in reports if "rate [Hz]" in facts]
    mode = bag.metadata.get("recording", {}).get("mode", "realtime" if timed else "unknown")
    if not timed:
        return Loop(mode, NAN, NAN, NAN, NAN, -1, -1)
    p50 = np.array([float(facts["latency p50 [us]"]) for facts in timed])
    p99 = np.array([float(facts["latency p99 [us]"]) for facts in timed])
    worst = float(np.nanmax(p99)) if not np.all(np.isnan(p99)) else NAN
    last = timed[-1]
    missed, periods = int(last["missed periods"]), int(last["periods"])
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
        for status in _messages(bag, f"{namespace}/status")
        if _node(status) == "driver" and (values := _values(status)).get("fault") and "stamp" in values
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
