"""Each commanded force: how it was reached and held, and its predictions."""

import math
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.demo_traces import ForceSignal
from wam_analysis.findings.analysed_run import AnalysedRun, Hold, by_names
from wam_analysis.findings.guarded import Guarded, guarded
from wam_analysis.findings.prediction import LargestForce, Node, Predicted, largest_force, node_at, predict
from wam_analysis.findings.swinging import Swinging, at_the_contact, swinging
from wam_analysis.measures.force_accuracy import ForceAccuracy, force_accuracy
from wam_analysis.measures.limit_cycle import NO_CYCLE, LimitCycle, limit_cycle
from wam_analysis.measures.response import StepResponse, step_response
from wam_analysis.measures.runs import noise
from wam_analysis.measures.stability import Stability, stability
from wam_analysis.task_forces import measured_force
from wam_analysis.thresholds import CYCLE, HOLD, SHAFT
from wam_description.rigid_body import RigidBody
from wam_description.signals import BASE
from wam_description.transmission_map import TransmissionMap
from wam_theory.verdicts import Verdict

Numbers = NDArray[np.float64]

UNMEASURED = force_accuracy(np.empty(0), np.empty(0))
UNDECIDED = Stability(Verdict.UNDECIDED, math.nan, 0.0, np.empty(0))


class HeldForce(NamedTuple):
    """A hold with its signals along the force, N, their measures and predictions; without these where it was refused.

    Attributes
    ----------
    time, measured : (n,), s from the start, and the force that the loop measured.
    time_true, true : (m,), the same of the true force; empty if it was not recorded.
    response : of the measured force; None if there is no step.
    touched : start of the contact, s from the start, at most `fresh` before it; NaN if the contact began earlier or is
        not known.  If it is known, rise and overshoot are those of the impact, and settling is timed from there.
    before : force of the contact in which the hold began and of which the loop had no measurement yet, N, as where no
        force was commanded until then; 0 where there is none.  Rise and overshoot are those of the measurement.
    measured_accuracy, true_accuracy : in the steady part.
    cycle : apart from the dither, of the true force in its last 70 %, else of the measured one.
    stability : of the error.
    node, predicted, largest : by theory; None if the bag has too few parameters.
    guarded : by the stability guard; None likewise.
    position : of the contact, m.
    swinging : of a motor or joint, where neither the measured nor the true force was recorded; None otherwise.
    moved_at_contact : size of its cycle as a motion of the contact along the force, m; NaN if it is not known.
    """

    hold: Hold
    time: Numbers
    measured: Numbers
    time_true: Numbers
    true: Numbers
    response: StepResponse | None = None
    touched: float = math.nan
    before: float = 0.0
    measured_accuracy: ForceAccuracy = UNMEASURED
    true_accuracy: ForceAccuracy = UNMEASURED
    cycle: LimitCycle = NO_CYCLE
    stability: Stability = UNDECIDED
    node: Node | None = None
    predicted: Predicted | None = None
    largest: LargestForce | None = None
    guarded: Guarded | None = None
    position: float = math.nan
    swinging: Swinging | None = None
    moved_at_contact: float = math.nan

    @property
    def is_recorded(self) -> bool:
        """Whether a force was recorded."""
        return bool(len(self.measured) or len(self.true))


def held_forces(recording: AnalysedRun) -> tuple[HeldForce, ...]:
    """Evaluate every hold of a recording; of a force that was not controlled its signals are all there is."""
    return tuple(
        _refused(_held(recording, hold)) if hold.is_refused else _held(recording, hold) for hold in recording.holds
    )


def _refused(held: HeldForce) -> HeldForce:
    return HeldForce(*held[:5], position=held.position)


def _held(recording: AnalysedRun, hold: Hold) -> HeldForce:
    time, measured = _measured(recording, hold)
    traces = recording.summary.traces
    rows = traces.during(hold.begin, hold.end) & traces.commanded.acts & (hold.axis < 0)
    time_true = (traces.stamp[rows] - hold.begin) / 1e9
    true = traces.along(traces.true, -1.0)[rows]
    if not np.any(np.isfinite(true)):
        time_true, true = np.empty(0), np.empty(0)
    duration = (hold.end - hold.begin) / 1e9
    late, late_true = time >= (1.0 - HOLD.steady) * duration, time_true >= (1.0 - HOLD.steady) * duration
    swings, swings_true = time >= (1.0 - CYCLE.late_part) * duration, time_true >= (1.0 - CYCLE.late_part) * duration
    cover, position = _touched(recording, hold)
    touched = _touch_down(recording, hold)
    response = _response(hold, time, measured, HOLD.steady * duration)
    if response is not None and touched > 0.0:
        response = response._replace(settling=max(response.settling - touched, 0.0))
    theory = _theory(recording, hold, cover, position)
    timing = recording.parameters.timing
    dither = timing.dither_cycle * timing.period if timing is not None else 0.0
    swung = None if len(measured) or len(true) else swinging(recording, hold)
    return HeldForce(
        hold=hold,
        time=time,
        measured=measured,
        time_true=time_true,
        true=true,
        response=response,
        touched=touched,
        before=_before(recording, hold, measured),
        measured_accuracy=_accuracy(hold, measured[late]),
        true_accuracy=_accuracy(hold, true[late_true]),
        cycle=_cycle(time_true[swings_true], true[swings_true], dither)
        or _cycle(time[swings], measured[swings], dither)
        or NO_CYCLE,
        stability=_stability(hold, measured),
        node=theory.node,
        predicted=theory.predicted,
        largest=theory.largest,
        guarded=theory.guarded,
        position=position,
        swinging=swung,
        moved_at_contact=_moved(recording, theory.node, swung),
    )


def _accuracy(hold: Hold, force: Numbers) -> ForceAccuracy:
    """Of the force in the steady part, which a short hold lacks."""
    return UNMEASURED if hold.is_short else force_accuracy(np.full(len(force), hold.commanded), force)


def _moved(recording: AnalysedRun, node: Node | None, found: Swinging | None) -> float:
    arm = recording.parameters.arm
    if arm is None or node is None or found is None or found.swings.verdict is not Verdict.LIMIT_CYCLE:
        return math.nan
    return at_the_contact(found, arm.motors.names, TransmissionMap.of(arm).motor_from_joint @ node.joint_per_metre)


def _measured(recording: AnalysedRun, hold: Hold) -> tuple[Numbers, Numbers]:
    if hold.axis >= 0:
        stamps, value = measured_force(recording.run, hold.axis, hold.begin, hold.end)
        return (stamps - hold.begin) / 1e9, value
    columns = recording.run.wrench("force_measured")
    if columns is None:
        return np.empty(0), np.empty(0)
    a, b = np.searchsorted(columns.stamp_ns, [hold.begin, hold.end])
    along: Numbers = columns.force[a:b] @ (hold.force / hold.commanded)
    good = np.isfinite(along)
    return (columns.stamp_ns[a:b][good] - hold.begin) / 1e9, along[good]


def _response(hold: Hold, time: Numbers, measured: Numbers, steady: float) -> StepResponse | None:
    if len(time) < SHAFT.fewest_samples:
        return None
    begin = float(measured[0])
    if abs(hold.commanded - begin) < max(4.0 * noise(measured), HOLD.least_step * hold.commanded):
        return None
    try:
        return step_response(time, measured, begin, steady, HOLD.band)
    except ValueError:
        return None


def _touch_down(recording: AnalysedRun, hold: Hold) -> float:
    """Start of the contact of a hold, by the simulator, else by the estimate; see `HeldForce`."""
    traces = recording.summary.traces
    if any(stiffness > 0.0 for stiffness in recording.parameters.springs.stiffness):
        return math.nan  # a spring under the joint is always in contact
    first, last = (int(row) for row in np.searchsorted(traces.stamp, [hold.begin, hold.end]))
    for signal in (traces.true, traces.estimated):
        if first >= last or not np.any(signal.is_known[first:last]):
            continue
        cover = hold.cover or hold.frame
        acts = signal.acts & ((signal.frame == cover) | (cover not in signal.frame))
        free = np.flatnonzero(~acts[:first]) if acts[first] else np.array([first + int(np.argmax(acts[first:])) - 1])
        if not np.any(acts[first:last]) or not len(free) or not signal.is_known[free[-1]]:
            return math.nan
        begin = float(traces.stamp[free[-1] + 1] - hold.begin) / 1e9
        return begin if begin > -HOLD.fresh else math.nan
    return math.nan


def _before(recording: AnalysedRun, hold: Hold, measured: Numbers) -> float:
    """Force of the contact in which a hold began, by the simulator, else by the estimate; see `HeldForce`."""
    traces = recording.summary.traces
    row = int(np.searchsorted(traces.stamp, hold.begin)) - 1
    for signal in (traces.true, traces.estimated):
        if row >= 0 and len(measured) and signal.is_known[row]:
            is_there = signal.acts[row] and signal.frame[row] in (hold.cover or hold.frame, BASE)
            force = float(signal.size[row]) if is_there or hold.frame == BASE else 0.0
            known = float(traces.measured.size[row] if traces.measured.is_known[row] else abs(measured[0]))
            return force if force - known > HOLD.far * max(force, hold.commanded) else 0.0
    return 0.0


def _cycle(time: Numbers, value: Numbers, dither: float) -> LimitCycle | None:
    """What repeats in a force, apart from the dither of a period, s, which a mean over it takes out; 0 for none."""
    good = np.isfinite(value)
    if int(np.sum(good)) < SHAFT.fewest_samples or np.mean(good) <= 0.95:
        return None
    time, value = time[good], value[good]
    if dither and (width := round(dither / float(np.median(np.diff(time))))) > 1:
        value = np.convolve(value, np.full(width, 1.0 / width), "valid")
        time = time[: len(value)]
    return limit_cycle(time, value)


def _stability(hold: Hold, measured: Numbers) -> Stability:
    if len(measured) < SHAFT.fewest_samples:
        return UNDECIDED
    return stability(hold.commanded - measured, max(HOLD.loud * hold.commanded, 4.0 * noise(measured)))


def _touched(recording: AnalysedRun, hold: Hold) -> tuple[str, float]:
    """Cover and position of the contact, by the simulator, else estimated, else as configured in the force loop."""
    traces, loop = recording.summary.traces, recording.parameters.force_loop
    rows = traces.during(hold.begin, hold.end)
    for signal in (traces.true, traces.estimated):
        found = _median_position(signal, rows & signal.acts)
        if found[0]:
            return found
    return (loop.contact_cover, loop.contact_position) if loop is not None else ("", math.nan)


def _median_position(signal: ForceSignal, rows: NDArray[np.bool_]) -> tuple[str, float]:
    if not np.any(rows):
        return "", math.nan
    cover = Counter(signal.frame[rows].tolist()).most_common(1)[0][0]
    positions = signal.position[rows & (signal.frame == cover)]
    positions = positions[np.isfinite(positions)]
    return (str(cover), float(np.median(positions))) if len(positions) else ("", math.nan)


class _Theory(NamedTuple):
    node: Node | None = None
    predicted: Predicted | None = None
    largest: LargestForce | None = None
    guarded: Guarded | None = None


NO_THEORY = _Theory(None, None, None, None)


def _theory(recording: AnalysedRun, hold: Hold, cover: str, position: float) -> _Theory:
    parameters = recording.parameters
    arm = parameters.arm
    if arm is None or cover not in arm.covers.names:
        return NO_THEORY
    joints = recording.run.joints("sim/joint_states") or recording.run.joints("joint_states")
    positions = None if joints is None else by_names(joints, "position", arm.joints.names)
    if joints is None or positions is None:
        return NO_THEORY
    middle = (hold.begin + hold.end) // 2
    row = max(int(np.searchsorted(joints.stamp_ns, middle, side="right")) - 1, 0)
    q = positions[row].tolist()
    if not np.all(np.isfinite(q)):
        return NO_THEORY
    link, direction = hold.cover or (cover if hold.frame == BASE else hold.frame), hold.force
    if hold.frame != link:
        body = RigidBody(arm)
        rotation = np.eye(3) if hold.frame == BASE else body.cover_pose(q, hold.frame).rotation
        direction = body.cover_pose(q, link).rotation.T @ rotation @ direction
    node = node_at(parameters, arm, q, link, position, direction) if link == cover else None
    largest = largest_force(arm, q, link, position, direction)
    loop, timing = parameters.force_loop, parameters.timing
    predicted = None
    if node is not None and loop is not None and timing is not None and loop.mode == "hybrid":
        delay = math.ceil(timing.outer_delay / timing.outer_divisor)
        gain, proportional = (_along(g, hold.force) for g in (loop.force_gain, loop.force_proportional_gain))
        predicted = predict(node, gain, proportional, timing.outer_period_ns / 1e9, delay)
    found = None if node is None else guarded(parameters, q, cover, position, direction, node.contact_stiffness)
    return _Theory(node, predicted, largest, found)


def _along(gains: Sequence[float], force: Numbers) -> float:
    """Gain of the axes x y z, or one for all, in the direction of a force."""
    share = (force / float(np.linalg.norm(force))) ** 2
    return float(np.broadcast_to(gains, 3) @ share)
