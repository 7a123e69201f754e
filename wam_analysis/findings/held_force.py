"""Each commanded force: how it was reached and held, whether it settles, and what theory predicts for it."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from wam_analysis.contact_list import most
from wam_analysis.findings.prediction import Guarded, Predicted, PressedPoint, guarded, node_at, predict
from wam_analysis.held_messages import joint_angles, row_at
from wam_analysis.holds import Hold
from wam_analysis.measures.limit_cycle import NO_CYCLE, LimitCycle, limit_cycle
from wam_analysis.measures.response import StepResponse, force_response
from wam_analysis.measures.runs import median_step, noise
from wam_analysis.measures.swings import Swings, swings
from wam_analysis.recorded import PredictionParameters
from wam_analysis.thresholds import CYCLE, HOLD, SHAFT, TOUCH
from wam_analysis.traces import Traces
from wam_bag.arrays import Mask, Numbers
from wam_control.force.thresholds import FORCE
from wam_description.rigid_body import RigidBody
from wam_description.signals import BASE
from wam_sim.recorded_run import RecordedRun
from wam_theory.verdicts import Verdict


class ForceAccuracy(NamedTuple):
    """Deviation of a held force from the one commanded, N; NaN if it was not measured.

    Attributes
    ----------
    bias : mean deviation.
    ripple : half of the range of the force, from its 0.5th to its 99.5th percentile.
    """

    bias: float = math.nan
    ripple: float = math.nan

    @property
    def smallest(self) -> float:
        """Smallest controllable force: |bias| + ripple."""
        return abs(self.bias) + self.ripple


UNMEASURED = dict.fromkeys(("true", "measured", "estimated"), ForceAccuracy())


class Swinging(NamedTuple):
    """What swings during a hold: a motor or joint, '' for the force."""

    shaft: str
    swings: Swings


class HeldForce(NamedTuple):
    """A hold with its signals along the force, N, and their measures; without these where it was refused.

    Attributes
    ----------
    measured, true : (n,) and (m,), what was recorded of the measured and of the true force; empty if nothing was.
    response : of the measured force; None if there is no step.
    touched : start of the contact, s from the start, at most `fresh` before it; NaN if the contact began earlier or is
        not known.  If it is known, rise and overshoot are those of the impact, and settling is timed from there.
    before : force of the contact in which the hold began and of which the loop had no measurement yet, N, as where no
        force was commanded until then; 0 where there is none.  Rise and overshoot are those of the measurement.
    accuracy : in the steady part, of the force that is 'true', 'measured' or 'estimated'.
    cycle : apart from the dither, of the true force in its last 70 %, else of the measured one.
    cover, position : of the contact, by the simulator, else estimated, else as configured in the force loop; m.
    swinging : of the force, of a motor or joint where neither the measured nor the true one was recorded; None without.
    is_pushed : whether the scenario pushed the arm meanwhile.
    is_lower_bound : whether the estimated force is one in the steady part.
    """

    hold: Hold
    measured: Numbers
    true: Numbers
    response: StepResponse | None = None
    touched: float = math.nan
    before: float = 0.0
    accuracy: Mapping[str, ForceAccuracy] = UNMEASURED
    cycle: LimitCycle = NO_CYCLE
    cover: str = ""
    position: float = math.nan
    swinging: Swinging | None = None
    is_pushed: bool = False
    is_lower_bound: bool = False

    @property
    def best(self) -> ForceAccuracy:
        """Of the true force, or of the measured one if the true one was not recorded."""
        return self.accuracy["true" if len(self.true) else "measured"]

    @property
    def largest(self) -> float:
        """The largest magnitude of that force, N."""
        return float(np.nanmax(np.abs(self.true if len(self.true) else self.measured), initial=0.0))

    @property
    def is_touching(self) -> bool:
        """Whether something was touched."""
        return self.largest >= FORCE.touch * self.hold.commanded


def held_force(run: RecordedRun, traces: Traces, parameters: PredictionParameters, hold: Hold) -> HeldForce:
    """Evaluate a hold; of a force that was not controlled its signals are all there is."""
    time, measured = _measured(run, hold)
    during = traces.during(hold.begin, hold.end)
    rows = during & traces.commanded.acts & (hold.axis < 0)
    time_true = (traces.stamp[rows] - hold.begin) / 1e9
    true, estimated = (traces.along(signal)[rows] for signal in (traces.true, traces.estimated))
    duration = (hold.end - hold.begin) / 1e9
    signals = {"true": (time_true, true), "measured": (time, measured), "estimated": (time_true, estimated)}
    known = np.isfinite(true)
    cover, position = _touched(traces, parameters, during)
    pushed = bool(np.any(during & traces.push.acts))
    held = HeldForce(hold, measured, true[known], cover=cover, position=position, is_pushed=pushed)
    if hold.is_refused:
        return held
    touched, before, response = _touch_down(traces, parameters, hold), _before(traces, hold, measured), None
    at, force = (time, measured) if len(measured) else (time_true[known], true[known])
    if len(force):
        followed, of_force = force_response(at, force, float(force[0]), hold.commanded, hold.commanded)
        swinging = Swinging("", of_force) if held.is_touching else None
        if held.is_touching and len(measured) >= SHAFT.fewest_samples and not math.isnan(followed.settling):
            response = followed._replace(settling=max(followed.settling - np.fmax(touched, 0.0), 0.0))
            if before or not math.isnan(touched):  # they are those of the impact
                response = response._replace(rise=math.nan, overshoot=math.nan)
    else:
        swinging = _swinging_shaft(run, hold)
    steady, late = ((1.0 - part) * duration for part in (HOLD.steady, CYCLE.late_part))
    compared = (signals["estimated"][0] >= steady) & np.isfinite(estimated)  # on this link
    bound = traces.estimated.is_lower_bound[rows][compared]
    accuracy = {name: _accuracy(force[at >= steady] - hold.commanded) for name, (at, force) in signals.items()}
    timing = parameters.timing
    dither = timing.dither_cycle * timing.period if timing is not None else 0.0
    cycles = (_cycle(at[at >= late], force[at >= late], dither) for at, force in (signals["true"], signals["measured"]))
    return held._replace(
        response=response,
        touched=touched,
        before=before,
        accuracy=UNMEASURED if hold.is_short else accuracy,  # a short one has no steady part
        cycle=next(filter(None, cycles), NO_CYCLE),
        is_lower_bound=float(np.sum(bound)) > TOUCH.lasting * len(bound),
        swinging=swinging,
    )


def _measured(run: RecordedRun, hold: Hold) -> tuple[Numbers, Numbers]:
    """When a force along a hold was measured, s from its start, and this force, N, (n,) each."""
    stamps, along = np.empty(0, np.int64), np.empty(0)
    if hold.axis >= 0:
        axes = run.table("task_axes")
        if axes is not None and "measured" in axes.columns:
            place = np.arange(len(axes.message)) - np.searchsorted(axes.message, axes.message)  # within its message
            own = place == hold.axis
            stamps, along = axes.row_stamp_ns[own], axes.columns["measured"][own].astype(float)
    else:
        wrench = run.wrench("force_measured")
        if wrench is not None and np.any(wrench.force):  # an open loop measures none
            along = wrench.force @ (hold.force / hold.commanded)
            stamps, along = wrench.stamp_ns[np.isfinite(along)], along[np.isfinite(along)]
    during = (stamps >= hold.begin) & (stamps < hold.end)
    return (stamps[during] - hold.begin) / 1e9, along[during]


def _accuracy(error: Numbers) -> ForceAccuracy:
    """Of a force by its deviations, (n,), N, in the steady state; NaN where it is not known."""
    if not len(error := error[np.isfinite(error)]):
        return ForceAccuracy()
    low, high = np.percentile(error, [0.5, 99.5]).tolist()
    return ForceAccuracy(float(np.mean(error)), (high - low) / 2.0)


def _touch_down(traces: Traces, parameters: PredictionParameters, hold: Hold) -> float:
    """Start of the contact of a hold, by the simulator, else by the estimate; see `HeldForce`."""
    if parameters.world is not None and any(stiffness > 0.0 for stiffness in parameters.world.springs.stiffness):
        return math.nan  # a spring under the joint is always in contact
    first, last = (int(row) for row in np.searchsorted(traces.stamp, [hold.begin, hold.end]))
    for signal in (traces.true, traces.estimated):
        if first >= last or not np.any(signal.is_known[first:last]):
            continue
        cover = hold.cover or hold.frame
        acts = signal.acts & ((signal.frame == cover) | (cover not in signal.frame))
        free = np.flatnonzero(~acts[: first + int(np.argmax(acts[first:last]))])
        if not np.any(acts[first:last]) or not len(free) or not signal.is_known[free[-1]]:
            return math.nan
        begin = float(traces.stamp[free[-1] + 1] - hold.begin) / 1e9
        return begin if begin > -HOLD.fresh else math.nan
    return math.nan


def _before(traces: Traces, hold: Hold, measured: Numbers) -> float:
    """Force of the contact in which a hold began, by the simulator, else by the estimate; see `HeldForce`."""
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
    if np.count_nonzero(good) < SHAFT.fewest_samples or np.mean(good) <= 0.95:
        return None
    time, value = time[good], value[good]
    if dither and (width := round(dither / median_step(time))) > 1:
        value = np.convolve(value, np.full(width, 1.0 / width), "valid")
        time = time[: len(value)]
    return limit_cycle(time, value)


def _touched(traces: Traces, parameters: PredictionParameters, during: Mask) -> tuple[str, float]:
    """Cover and position of the contact, by the simulator, else estimated, else as configured in the force loop."""
    for signal in (traces.true, traces.estimated):
        if np.any(rows := during & signal.acts):
            cover = most(signal.frame[rows])
            positions = signal.position[rows & (signal.frame == cover)]
            if np.any(known := np.isfinite(positions)):
                return cover, float(np.median(positions[known]))
    loop = parameters.force_loop
    return (loop.contact_cover, loop.contact_position) if loop is not None else ("", math.nan)


def _swinging_shaft(run: RecordedRun, hold: Hold) -> Swinging | None:
    """The swings of the motor, or else the joint, that show most about a hold; None if nothing was recorded."""
    found: list[Swinging] = []
    for topic in ("motor_states", "joint_sensors", "joint_states"):
        if (columns := run.joints(topic)) is None or found:
            continue
        rows = slice(*np.searchsorted(columns.stamp_ns, [hold.begin, hold.end]))
        for name, value in zip(columns.names, columns.position[rows].T, strict=False):
            extent = float(np.ptp(late)) if len(late := value[int((1.0 - CYCLE.late_part) * len(value)) :]) else 0.0
            if len(value) >= SHAFT.fewest_samples and np.all(np.isfinite(value)) and extent >= CYCLE.still_shaft:
                least = max(CYCLE.least_swing * extent, CYCLE.loud_swing * noise(value))
                found.append(Swinging(name, swings((columns.stamp_ns[rows] - hold.begin) / 1e9, value, least)))
    order = (Verdict.DIVERGED, Verdict.LIMIT_CYCLE, Verdict.SETTLED, Verdict.UNDECIDED)
    return min(found, key=lambda one: (order.index(one.swings.verdict), -one.swings.number), default=None)


class Theory(NamedTuple):
    """What is predicted for a held force; None where the bag has too few parameters.

    Attributes
    ----------
    predicted : by chapter 5.
    guarded : by the stability guard.
    moved : size of the cycle of a motor as a motion of the contact along the force, m; NaN if it is not known.
    """

    predicted: Predicted = Predicted()
    guarded: Guarded | None = None
    moved: float = math.nan


def theory_of(run: RecordedRun, parameters: PredictionParameters, one: HeldForce) -> Theory:
    """What is predicted for a held force, in its pose in the middle."""
    hold, cover, position = one.hold, one.cover, one.position
    arm = parameters.arm
    poses = None if arm is None else joint_angles(run, arm)
    if arm is None or poses is None or cover not in arm.covers.names:
        return Theory()
    q = poses[1][row_at(poses[0], (hold.begin + hold.end) // 2)].tolist()
    link, body = hold.cover or (cover if hold.frame == BASE else hold.frame), RigidBody(arm)
    axis = hold.force / hold.commanded
    if hold.frame != BASE:
        axis = body.cover_pose(q, hold.frame).rotation @ axis
    press = PressedPoint(body, q, link, position, axis)
    node = node_at(parameters, press) if link == cover else None
    if node is None:
        return Theory()
    loop, predicted = parameters.force_loop, Predicted()
    if loop is not None and loop.mode == "hybrid":
        share = (hold.force / float(np.linalg.norm(hold.force))) ** 2  # of each axis
        gains = (loop.force_gain, loop.force_proportional_gain)  # of each, or one for all
        gain, proportional = (float(np.broadcast_to(each, 3) @ share) for each in gains)
        predicted = predict(node, gain, proportional)
    found = guarded(parameters, press, node.contact_stiffness)
    moved, seen = math.nan, one.swinging
    if seen is not None and seen.swings.verdict is Verdict.LIMIT_CYCLE:
        turned = arm.transmission.motor_from_joint @ node.joint_per_metre
        ratio = abs(dict(zip(arm.motors.names, turned.tolist(), strict=True)).get(seen.shaft, 0.0))
        moved = seen.swings.peak_to_peak / ratio if ratio else math.nan
    return Theory(predicted, found, moved)
