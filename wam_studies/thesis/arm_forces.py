"""The arm on foam: commanded, true and estimated force; pressing, sliding, and a push."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.recording import AnalysedRecording
from wam_bag.bag import BagError, TableColumns
from wam_studies.figures.panels import Numbers, Panel, line_only, measured
from wam_studies.thesis.bounds import BOUNDS
from wam_studies.thesis.recording import Forces, Recording, Runs, Step
from wam_studies.thesis.rows import Comparison, Result, below, near


class Along(NamedTuple):
    """Components of the arm's forces on the world along the commanded force, N, at the times of the true one, s."""

    time: Numbers
    commanded: Numbers
    true: Numbers
    estimated: Numbers


def pressing(runs: Runs) -> Result:
    """The experiments `wam-press`, `wam-slide` and `wam-along-link`: forces at rest, and while the link slides."""
    rows: list[Comparison] = []
    panels = []
    for name, run in runs.items():
        found, control = along(run), run.parameters.node("force_loop")
        place, is_pinned = float(control["contact_position"]), control["contact_source"] == "pinned"
        steps = [step for step in run.steps if step.name.startswith(("press", "slide"))]
        for step in steps:
            label = f"{name}, {step.name} at {place:.2f} m" if is_pinned else step.name
            rows += _moving(found, step) if step.name.startswith("slide") else _at_rest(found, step, label, is_pinned)
            if is_pinned:
                rows.append(_outside(run, step, label, place))
        if not is_pinned:
            rows.append(_position(run, steps))
        end = max(step.end for step in run.steps if step in steps or step.name == "rest")
        panels.append(_panel(f"force along the commanded one, {name}", found, steps[0].begin, end))
    return Result(rows, panels)


def _moving(found: Along, step: Step) -> list[Comparison]:
    """True force with the commanded one, and the estimate with the true force, while the link slides."""
    during = (found.time > step.begin + BOUNDS.slide_start) & (found.time < step.end)
    force, true = float(found.commanded[during].mean()), found.true[during]
    error = float(np.sqrt(np.mean((found.estimated[during] - true) ** 2)))
    return [
        near(f"{step.name}, true, mean", force, true.mean(), "N", "no error, 5.1.2", BOUNDS.force_at_rest),
        below(f"{step.name}, largest error", np.abs(true - force).max(), "N", BOUNDS.force_sliding * force),
        below(f"{step.name}, error of the estimate, rms", error, "N", BOUNDS.estimate * force, "chapter 2"),
    ]


def _at_rest(found: Along, step: Step, label: str, is_pinned: bool) -> list[Comparison]:
    """True force with the commanded one, estimate with the true force, and cycle, in the last part of a step.

    Of the estimate nothing is claimed where the contact is near an end of the link.
    """
    late = _late(found.time, step)
    rest = late if is_pinned else _late(found.time, step, 0.5)  # before that the joints may still stick and slip
    commanded, true, estimated = (float(x[late].mean()) for x in (found.commanded, found.true, found.estimated))
    within = math.nan if is_pinned else max(BOUNDS.estimate, BOUNDS.smallest_estimate_error / commanded)
    cycle = max(BOUNDS.arm_cycle * commanded, min(BOUNDS.single_slip, 0.1 * commanded))
    return [
        near(f"{label}, true", commanded, true, "N", "no error, 5.1.2", BOUNDS.force_at_rest),
        near(f"{label}, estimated", true, estimated, "N", "chapter 2", within),
        below(f"{label}, peak to peak", np.ptp(found.true[rest]), "N", cycle, "no cycle"),
    ]


def _late(time: Numbers, step: Step, part: float = 1.0) -> NDArray[np.bool_]:
    """The last part of a step, in which a press is steady."""
    return (time > step.end - part * BOUNDS.steady_press) & (time < step.end)


def _outside(run: Recording, step: Step, label: str, position: float) -> Comparison:
    """How far the true position of a contact is outside the set that the estimator states: none where it is in it."""
    found = run.columns("contact/hypotheses", TableColumns)
    columns = found.columns
    cover = run.shared.arm.covers.names.index("outer_link")
    here = _late(found.row_stamp_ns / 1e9, step) & (columns["link"] == cover)
    low, high = columns["low"][here], columns["high"][here]
    beyond = np.maximum(np.maximum(low - position, position - high), 0.0)
    outside = float(np.median(np.nan_to_num(beyond, nan=np.inf))) if len(low) else math.inf
    return below(f"{label}, beyond the 90 % set", outside, "m", BOUNDS.outside_set, "90 % set")


def along(run: Recording) -> Along:
    """Components along the commanded force, in the frame of the command."""
    command, truth = run.forces("force_command"), run.forces("sim/contact/wrench")
    estimated = run.forces("contact/wrench")
    pressed = np.linalg.norm(command.force, axis=1) > 0.0
    axis = command.force[pressed][0] / np.linalg.norm(command.force[pressed][0])
    frame = command.frames[int(np.flatnonzero(pressed)[0])]

    def at_truth(forces: Forces, sign: float) -> Numbers:
        values = np.where(forces.frames == frame, sign * (forces.force @ axis), 0.0)
        return np.interp(truth.time, forces.time, values)

    return Along(truth.time, at_truth(command, 1.0), at_truth(truth, -1.0), at_truth(estimated, -1.0))


def _position(run: Recording, steps: Sequence[Step]) -> Comparison:
    """Greatest error of the estimated position, of the means of each step."""
    both, errors = (run.positions("sim/contact/point"), run.positions("contact/point")), []
    for step in steps:
        true, estimated = (float(np.nanmean(position[_late(time, step)])) for time, position in both)
        errors.append(abs(estimated - true))
    return below("position error, worst step", max(errors), "m", BOUNDS.position, "chapter 2")


def _panel(title: str, found: Along, begin: float, end: float) -> Panel:
    shown = (found.time >= begin) & (found.time < end)
    time = found.time[shown]
    curves = [
        ("true", measured(time, found.true[shown])),
        ("estimated", measured(time, found.estimated[shown])),
        ("commanded", line_only(time, found.commanded[shown])),
    ]
    return Panel(title, "time [s]", "force [N]", curves)


def pushed(runs: Runs) -> Result:
    """The experiment `wam-touch`: one push, with what `wam analyse` lists of it.

    Raises
    ------
    BagError
        if the push was not detected.
    """
    (run,) = runs.values()
    analysed = AnalysedRecording(run.bag, run.namespace)
    (push,) = analysed.touched
    found = next((one for one in analysed.contacts if one.true == push.link), None)
    if found is None:
        raise BagError(f"{run.bag.path}: the push on {push.link} was not detected")
    force, place = (found.true_force, found.force), (found.true_position, found.position)
    rows = [
        below("time of false detections", analysed.traces.false_seconds, "s", BOUNDS.latency, "chapter 2"),
        below("detection latency", found.latency, "s", BOUNDS.latency, "chapter 2"),
        near("time with the correct link", 1.0, push.right, "fraction of the push", "chapter 2", BOUNDS.wrong_link),
        near("force, median", *force, "N", "chapter 2", BOUNDS.push_in_motion),
        Comparison("position, median", *place, "m", BOUNDS.position, "chapter 2", True),
    ]
    truth, estimate = run.forces("sim/contact/wrench"), run.forces("contact/wrench")
    sizes = [np.linalg.norm(each.force, axis=1) for each in (truth, estimate)]
    curves = [("estimated", measured(estimate.time, sizes[1])), ("true", line_only(truth.time, sizes[0]))]
    return Result(rows, [Panel("force on the arm", "time [s]", "force [N]", curves)])
