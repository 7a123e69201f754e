"""The demonstration in numbers, from its bag alone: presses, contacts, loop timing and losses."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wam_analysis.command_gaps import command_gaps
from wam_analysis.contact_list import (
    ListedContact,
    TouchedLink,
    certainty_of,
    contact_rows,
    listed_contacts,
    median,
    true_contacts,
)
from wam_analysis.demo_traces import NAN, Mask, Numbers, Traces, traces_of
from wam_analysis.holds import Hold, holds_of
from wam_analysis.task_forces import task_forces, tasks_of
from wam_analysis.unplanned_contact import UnplannedContacts, unplanned_contacts
from wam_bag.bag import Bag, BagError
from wam_bag.losses import CUT, RECORDING, losses
from wam_control.task.scenario import FORCE_LOOP
from wam_description.event import Code
from wam_description.status import BEHIND, ENABLED, REAL_TIME_FACTOR, SLIPS, diagnosed_name
from wam_sim.reactions import SETTLING_TIME, RecordedReaction, steady_begin, watched_times
from wam_sim.recording import RecordedRun, RecordedStep, messages_of, recorded_run, status_of

UNFINISHED = "not finished: the recording ends before the scenario does"


class LoopReport(NamedTuple):
    """Timing of the driver's loop; NaN if it was not recorded, as latencies in lockstep.

    The driver reports latencies every second: p50 and p99 are medians of these.  In paced lockstep it reports every
    second how fast simulated time passed: `factor` is that of the whole run, `behind` the largest delay of a period, s,
    `slips` the periods that were too late to be made up for.
    """

    mode: str
    rate: float
    p50: float
    p99: float
    missed: int
    periods: int
    factor: float = NAN
    behind: float = NAN
    slips: int = -1


class Moment(NamedTuple):
    """The instant that is drawn: its row of the traces, joint names and angles (rad)."""

    stamp: int
    row: int
    names: tuple[str, ...]
    q: Numbers


class DemoSummary(NamedTuple):
    """The demonstration in numbers.

    Attributes
    ----------
    namespace : of the arm, '/wam'.
    torques : begin and end of each time in which a task commands the same joint torques and motions, ns.
    settling_times : of the force loop, s, and since when it had each, ns; NaN where it was not recorded.
    holds : the constant forces that were commanded.
    contacts : all that were estimated.
    touched : the true contacts, estimated or not.
    unplanned : contacts without a command of a force, harder than allowed.
    reactions : of the force loop to what was commanded, and faults of the driver.
    outcome : DONE, why the scenario failed, or that the recording ended before.
    false_contact : time of false detections, s.
    free : time without contact, s.
    received, dropped : messages counted by the recorder, -1 if it wrote no counts.
    lost : sentences about what the bag lacks, none if no loss is known.
    is_blind : whether contacts were under the brakes, where the motors, which alone are observed, sense none.
    """

    namespace: str
    outcome: str
    steps: tuple[RecordedStep, ...]
    traces: Traces
    torques: tuple[tuple[int, int], ...]
    settling_times: tuple[tuple[int, float], ...]
    holds: tuple[Hold, ...]
    contacts: tuple[ListedContact, ...]
    touched: tuple[TouchedLink, ...]
    unplanned: UnplannedContacts
    reactions: tuple[RecordedReaction, ...]
    false_contact: float
    free: float
    loop: LoopReport
    received: int
    dropped: int
    lost: tuple[str, ...]
    moment: Moment | None
    is_blind: bool

    @property
    def missed(self) -> tuple[TouchedLink, ...]:
        """True contacts that were not estimated."""
        return tuple(one for one in self.touched if one.is_missed)


def summarize(bag: Bag) -> DemoSummary:
    """Everything that the report needs, from a bag that may hold any part of the demonstration."""
    return summary_of(recorded_run(bag))


def failure_of(run: RecordedRun) -> str:
    """Why a run failed or that it was cut off; '' where it did not, or had neither a scenario nor a fault.

    A part that was cut out of a recording is none.
    """
    if run.outcome or CUT in run.bag.metadata:
        return "" if run.outcome in ("", Code.DONE) else run.outcome
    return run.faults[-1].reason if run.faults else UNFINISHED * bool(run.steps)


def summary_of(run: RecordedRun) -> DemoSummary:
    """Everything that the report needs, from a run."""
    bag = run.bag
    steps = run.steps if run.unfinished is None else (*run.steps, run.unfinished)
    tasks = task_forces(run)
    traces = traces_of(run, tasks)
    reactions = tuple(_with_forces(one, traces) for one in run.reactions(_end(traces, steps)))
    holds = holds_of(run, steps, tasks, traces, reactions)
    certainty = certainty_of(run, traces)
    blind = _blind(run, traces)
    seen = traces._replace(true=traces.true.unknown(blind), push=traces.push.unknown(blind))
    known = traces.true.is_known & traces.estimated.is_known
    false = known & ~traces.true.acts & traces.estimated.acts
    received, dropped = _counts(bag.metadata.get(RECORDING, {}))
    lost = losses(bag.path, bag.metadata, bag.attachments, bag.counts)
    gaps = command_gaps(run, traces.stamp, lost, steps)
    return DemoSummary(
        namespace=run.namespace,
        outcome=run.outcome or UNFINISHED,
        steps=steps,
        traces=traces,
        torques=tuple(watched_times(tasks_of(run), without_forces=True)),
        settling_times=_settling_times(run),
        holds=holds,
        contacts=listed_contacts(traces, certainty, steps),
        touched=true_contacts(seen, steps),
        unplanned=unplanned_contacts(run, traces, steps, gaps),
        reactions=reactions,
        false_contact=int(np.sum(false)) * traces.period,
        free=int(np.sum(known & ~traces.true.acts)) * traces.period,
        loop=_loop(run),
        received=received,
        dropped=dropped,
        lost=(*lost.sentences(bag.first_ns), *(gap.sentence(traces.zero) for gap in gaps)),
        moment=_moment(run, traces, holds),
        is_blind=bool(np.any(blind & traces.true.acts)),
    )


def _blind(run: RecordedRun, traces: Traces) -> Mask:
    """Whether nothing can be estimated at each instant, (k,): under the brakes, where the motors alone are observed."""
    blind = np.zeros(len(traces.stamp), dtype=bool)
    try:
        if run.parameters.node("contact_estimator").get("use_joint_sensors", True):
            return blind
    except BagError:
        return blind
    for stamp, status in run.stamped_statuses():
        if status.node == "driver" and status.mode:
            blind[traces.stamp >= stamp] = status.mode != ENABLED
    return blind


def _settling_times(run: RecordedRun) -> tuple[tuple[int, float], ...]:
    """Those of the force loop, s, and since when it had each, ns: of its parameters, and changed while it ran."""
    key = f"{FORCE_LOOP}:{SETTLING_TIME}"
    try:
        first = run.parameters.node(FORCE_LOOP).get(SETTLING_TIME, NAN)
    except BagError:
        first = NAN
    changes = [(since, values[key]) for since, values in run.live_values(FORCE_LOOP) if key in values]
    known = (int, float)
    return tuple((since, float(value) if isinstance(value, known) else NAN) for since, value in [(0, first), *changes])


def _with_forces(reaction: RecordedReaction, traces: Traces) -> RecordedReaction:
    """A reaction to what pushes, with how hard it did at most and in the end: its reason is that of its first moment.

    It ends where the loop no longer knows of more than is allowed; a push that its estimate does not show may go on.
    """
    rows = np.flatnonzero(traces.during(reaction.begin, reaction.end))
    sizes = {name: signal.size for name, signal in (("true", traces.true), ("estimated", traces.estimated))}
    known = {name: size for name, size in sizes.items() if np.any(size[rows] > 0.0)}
    if reaction.name is not Code.PUSHED or not known:
        return reaction
    hardest = {name: rows[np.nanargmax(size[rows])] for name, size in known.items()}
    largest = [
        f"{known[name][row]:.3g} N ({name}, at {(traces.stamp[row] - traces.zero) / 1e9:.2f} s)"
        for name, row in hardest.items()
    ]
    left = [f"{size[rows[-1]]:.3g} N ({name})" for name, size in known.items() if size[rows[-1]] > 0.0]
    remark = f"; the largest force until its end: {', '.join(largest)}; at its end: {', '.join(left) or 'none'}"
    return reaction._replace(remark=remark)


def _end(traces: Traces, steps: Sequence[RecordedStep]) -> int:
    """When the recording ends, ns."""
    return max([int(stamp) for stamp in traces.stamp[-1:]] + [step.end for step in steps[-1:]], default=0)


def _loop(run: RecordedRun) -> LoopReport:
    reports = [
        status.facts
        for array in messages_of(run.bag, "/diagnostics")
        for status in map(status_of, array.status)
        if status.node == diagnosed_name(run.namespace, "driver")
    ]
    timed = [facts for facts in reports if "rate [Hz]" in facts]
    mode = "realtime" if run.mode == "unknown" and timed else run.mode
    if paced := [facts for facts in reports if REAL_TIME_FACTOR in facts][1:]:  # the first is of no time
        factors = np.array([float(facts[REAL_TIME_FACTOR]) for facts in paced])
        behind = max(float(facts.get(BEHIND, NAN)) for facts in paced) / 1e3
        factor = 1.0 / float(np.mean(1.0 / np.maximum(factors, 1e-3)))  # each is of a second of the arm
        return LoopReport(mode, NAN, NAN, NAN, -1, -1, factor, behind, int(paced[-1].get(SLIPS, -1)))
    if not timed:
        return LoopReport(mode, NAN, NAN, NAN, -1, -1)
    p50, p99 = (np.array([float(facts.get(f"latency {p} [us]", NAN)) for facts in timed]) for p in ("p50", "p99"))
    last = timed[-1]
    missed, periods = (int(last.get(key, -1)) for key in ("missed periods", "periods"))
    return LoopReport(mode, float(last["rate [Hz]"]), median(p50), median(p99), missed, periods)


def _counts(recording: dict[str, str]) -> tuple[int, int]:
    if not any(key.endswith(" received") for key in recording):
        return -1, -1
    received, dropped = (
        sum(int(value) for key, value in recording.items() if key.endswith(ending))
        for ending in (" received", " dropped")
    )
    return received, dropped


def driver_faults(run: RecordedRun, zero: int) -> list[str]:
    """What the driver stopped for, a sentence each; times from `zero` on, ns."""
    texts = [f"driver fault at {(fault.stamp - zero) / 1e9:.2f} s: {fault.reason}" for fault in run.faults]
    return list(dict.fromkeys(texts))


def _moment(run: RecordedRun, traces: Traces, holds: tuple[Hold, ...]) -> Moment | None:
    """Middle of the steady state of the hardest press, else of the first contact, else the last pose."""
    found = [columns for name in ("sim/joint_states", "joint_states") if (columns := run.joints(name)) is not None]
    joints = next((columns for columns in found if columns.position.size), None)
    if joints is None or not len(traces.stamp):
        return None
    contacts = contact_rows(traces.stamp, traces.true.acts) or contact_rows(traces.stamp, traces.estimated.acts)
    stamp = int(traces.stamp[-1])
    if holds:
        hardest = max(holds, key=lambda hold: hold.commanded)
        stamp = (steady_begin(hardest) + hardest.end) // 2
    elif contacts:
        stamp = int(traces.stamp[sum(contacts[0]) // 2])
    row = max(int(np.searchsorted(traces.stamp, stamp, side="right")) - 1, 0)
    at = max(int(np.searchsorted(joints.stamp_ns, stamp, side="right")) - 1, 0)
    return Moment(stamp, row, joints.names, joints.position[at])
