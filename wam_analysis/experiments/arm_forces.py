"""The arm itself on foam: force that is asked for, applied, measured and estimated; pressing and sliding."""

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
