"""The arm itself on foam: force that is asked for, applied, measured and estimated; pressing and sliding."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from wam_analysis.bag import BagError, PointColumns
from wam_analysis.experiments.recording import Forces, Recording, Step
from wam_analysis.experiments.rows import Curve, Numbers, Panel, Result, Row

STEADY = 0.8  # s at the end of a press
START = 0.5  # s after which a slide is judged
FORCE = 0.05  # of what is asked for, at rest
MOVING = 0.2  # of what is asked for, while sliding: where the motion turns round, so does the friction
ESTIMATE = 0.05  # of the force that is there
PLACE = 0.04  # m
NOWHERE = "base"  # frame of a contact wrench where nothing touches
FELT = 0.1  # s until a push is felt
ELSEWHERE = 0.05  # of the time of a push in which another link or none may seem touched
TOUCH = 0.15  # of the force of a push while the arm moves
CYCLE = 0.02  # of the force, peak to peak, from which on it counts as a cycle


class Along(NamedTuple):
    """Forces of the arm on the world along the one that is asked for, N, at the times of the truth, s."""

    time: Numbers
    asked: Numbers
    applied: Numbers
    measured: Numbers
    estimated: Numbers


def pressing(runs: Mapping[str, Recording]) -> Result:
    """The experiment `wam-press`."""
    run = runs["press"]
    found = along(run)
    rows: list[Row] = []
    for step in _named(run, "press"):
        late = (found.time > step.end - STEADY) & (found.time < step.end)
        force = float(found.asked[late].mean())
        applied = float(found.applied[late].mean())
        estimated = float(found.estimated[late].mean())
        # in the last half of that time: stick and slip of the joints may still end the approach
        rest = (found.time > step.end - 0.5 * STEADY) & (found.time < step.end)
        rows += [
            Row(f"{step.name}, applied", force, applied, "N", FORCE, "no error, 5.1.2"),
            Row(f"{step.name}, estimated", applied, estimated, "N", ESTIMATE, "chapter 2"),
            Row(f"{step.name}, swing", 0.0, float(np.ptp(found.applied[rest])), "N", CYCLE * force, "no cycle", True),
        ]
    rows.append(_place(run, _named(run, "press")))
    return Result(rows, [_panel(found, _named(run, "press"))], _remarks(run))


def sliding(runs: Mapping[str, Recording]) -> Result:
    """The experiment `wam-slide`."""
    run = runs["slide"]
    found = along(run)
    steps = _named(run, "slide")
    rows: list[Row] = []
    for step in steps:
        during = (found.time > step.begin + START) & (found.time < step.end)
        force = float(found.asked[during].mean())
        applied = found.applied[during]
        error = float(np.sqrt(np.mean((found.estimated[during] - applied) ** 2)))
        rows += [
            Row(f"{step.name}, applied, mean", force, float(applied.mean()), "N", FORCE, "no error, 5.1.2"),
            Row(
                f"{step.name}, farthest from it",
                0.0,
                float(np.abs(applied - force).max()),
                "N",
                MOVING * force,
                "",
                True,
            ),
            Row(f"{step.name}, error of the estimate, rms", 0.0, error, "N", ESTIMATE * force, "chapter 2", True),
        ]
    rows.append(_place(run, steps))
    every = [*_named(run, "press"), *steps, *_named(run, "rest")]
    return Result(rows, [_panel(found, every)], _remarks(run))


def along(run: Recording) -> Along:
    """Components along the force asked for, all in the frame of the command."""
    command, truth = run.forces("force_command"), run.forces("sim/contact/wrench")
    measured, felt = run.forces("force_measured"), run.forces("contact/wrench")
    pressed = np.linalg.norm(command.force, axis=1) > 0.0
    axis = command.force[pressed][0] / np.linalg.norm(command.force[pressed][0])
    frame = command.frames[int(np.flatnonzero(pressed)[0])]

    def at_truth(forces: Forces, sign: float) -> Numbers:
        in_frame = np.array([name == frame for name in forces.frames])
        values = np.where(in_frame, sign * (forces.force @ axis), 0.0)
        return np.interp(truth.time, forces.time, values)

    return Along(
        truth.time,
        at_truth(command, 1.0),
        at_truth(truth, -1.0),
        at_truth(measured, 1.0),
        at_truth(felt, -1.0),
    )


def _named(run: Recording, word: str) -> Sequence[Step]:
    return [step for step in run.steps if step.name.startswith(word)]


def _place(run: Recording, steps: Sequence[Step]) -> Row:
    """Greatest error of the place, of the means of each step."""
    true, felt = _places(run, "sim/contact/point"), _places(run, "contact/point")
    errors = []
    for step in steps:
        means = []
        for time, place in (true, felt):
            late = (time > step.end - STEADY) & (time < step.end)
            means.append(float(np.nanmean(place[late])))
        errors.append(abs(means[1] - means[0]))
    return Row("error of the place, worst step", 0.0, max(errors), "m", PLACE, "chapter 2", True)


def _places(run: Recording, topic: str) -> tuple[Numbers, Numbers]:
    columns = run.bag.topics.get(f"{run.namespace}/{topic}")
    if not isinstance(columns, PointColumns):
        raise BagError(f"{run.bag.path} has no topic '{topic}'; record it")
    return columns.stamp_ns / 1e9, columns.point[:, 0]


def _panel(found: Along, steps: Sequence[Step]) -> Panel:
    shown = (found.time >= steps[0].begin) & (found.time < steps[-1].end)
    time = found.time[shown]
    curves = [
        Curve("measured", "applied", time, found.applied[shown]),
        Curve("measured", "estimated", time, found.estimated[shown]),
        Curve("predicted", "asked for", time, found.asked[shown]),
    ]
    return Panel("force along the one asked for", "time [s]", "force [N]", curves)


def _remarks(run: Recording) -> tuple[str, ...]:
    friction = run.parameters["driver"]["world.obstacles.friction"]
    return (f"the foam has a friction of {friction[0]:g}: the tube also pulls along itself where it sticks",)


def touching(runs: Mapping[str, Recording]) -> Result:
    """The experiment `wam-touch`: one push, judged while the simulator says that it is there."""
    (run,) = runs.values()
    truth, felt = run.forces("sim/contact/wrench"), run.forces("contact/wrench")
    there = np.linalg.norm(truth.force, axis=1) > 0.0
    touched, link = truth.time[there], truth.frames[int(np.flatnonzero(there)[0])]
    begin, end = float(touched[0]), float(touched[-1])
    right = np.array([frame == link for frame in felt.frames])
    first = felt.time[right & (felt.time >= begin)]
    during = (felt.time > begin + FELT) & (felt.time <= end)
    shares = float(np.mean(right[during]))
    applied = float(np.linalg.norm(truth.force[there], axis=1).mean())
    estimated = float(np.linalg.norm(felt.force[during & right], axis=1).mean())
    places = [
        float(np.nanmedian(place[(time > begin + FELT) & (time <= end)]))
        for time, place in (_places(run, "sim/contact/point"), _places(run, "contact/point"))
    ]
    quiet = felt.time < begin
    before = float(np.mean([bool(frame) and frame != NOWHERE for frame in np.array(felt.frames)[quiet]]))
    rows = [
        Row("felt before, of the time until then", 0.0, before, "", ELSEWHERE, "chapter 2", True),
        Row("felt after", 0.0, float(first[0]) - begin if len(first) else math.nan, "s", FELT, "chapter 2", True),
        Row(f"felt on {link}, of the time after that", 1.0, shares, "", ELSEWHERE, "chapter 2"),
        Row("force, mean", applied, estimated, "N", TOUCH, "chapter 2"),
        Row("place, median", places[0], places[1], "m", PLACE, "chapter 2", True),
    ]
    force = [np.linalg.norm(each.force, axis=1) for each in (truth, felt)]
    curves = [
        Curve("measured", "estimated", felt.time, force[1]),
        Curve("predicted", "applied", truth.time, force[0]),
    ]
    return Result(rows, [Panel("force on the arm", "time [s]", "force [N]", curves)])
