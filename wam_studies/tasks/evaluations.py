"""Each task's numbers: what was commanded or follows by hand, against the truth of the simulator."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from wam_studies.figures.panels import Numbers, Panel, line_only, measured
from wam_studies.thesis.recording import ObjectTrace, Recording, Runs, Step
from wam_studies.thesis.rows import Comparison, Result, below, near, noted

NO_CLAIM = math.nan
TRUE, ESTIMATED = "sim/contact/wrench", "contact/wrench"


@dataclass(frozen=True)
class TaskBounds:
    """What the evaluations of the tasks allow, relative unless a unit is given."""

    steady: float = 0.8  # s at the end of a step, taken as its steady state
    force: float = 0.1  # of the commanded force
    slipped: float = 0.15  # the same where friction along the link moves the estimated position
    still: float = 1e-3  # m, that a body moves at rest
    moving: float = 1e-3  # m/s above which a body slides
    moved: float = 0.05  # m, of a body that was swept along
    together: float = 0.5  # of the angle before
    closed_form: float = 0.03  # of the torque on the door


BOUNDS: Final = TaskBounds()


def pushing(runs: Runs) -> Result:
    """The task `push-box`: a force below the friction, then a push that moves the box."""
    (run,) = runs.values()
    box, bodies = run.objects["box"], run.world.bodies
    friction, weight = bodies.ground_friction[0], bodies.mass[0] * _gravity(run)
    press, push = run.step("press 4 N"), run.step("push the box")
    pressed, pushed = box.late(press, BOUNDS.steady), box.during(push.begin, push.end)
    slides = pushed.during(*_sliding(pushed))
    along, lift = float(slides.arm_force[:, 0].mean()), float(slides.arm_force[:, 2].mean())
    rows = [
        near("press 4 N, true force across the link", 4.0, _across(run, press), "N", "commanded", BOUNDS.slipped),
        below("press 4 N, motion of the box", _moved(pressed), "m", BOUNDS.still, "friction holds"),
        near("horizontal force while it slides, mean", friction * (weight - lift), along, "N", "mu N", BOUNDS.force),
        near(
            "weight carried by the table",
            weight - lift,
            float(np.abs(slides.other_force[:, 2]).mean()),
            "N",
            "m g - lift",
            0.02,
        ),
        noted("distance pushed", _moved(pushed), "m"),
        below("motion of the box across the push", np.ptp(pushed.position[:, 1]), "m", 0.01, "straight"),
        *_estimate(run, push),
    ]
    return Result(rows, [_forces(run, press.begin, push.end), _path({"box": pushed}, 0)])


def sweeping(runs: Runs) -> Result:
    """The task `sweep-objects`: how close together the objects are, and what it takes."""
    (run,) = runs.values()
    objects, sweep, rest = run.objects, run.step("sweep"), run.step("rest")
    swept = {name: trace.during(sweep.begin, rest.end) for name, trace in objects.items()}
    before, after = (float(np.ptp(_angles(swept, at))) for at in (0, -1))
    moved = sum(_moved(trace) > BOUNDS.moved for trace in swept.values())
    calm = max(float(np.linalg.norm(trace.velocity[-1])) for trace in swept.values())
    rows = [
        Comparison("objects that move with the link", float(len(objects)), float(moved), "", 0.0, "all"),
        noted("angle the objects span at the base, before", before, "rad"),
        below("angle the objects span at the base, after / before", after / before, "", BOUNDS.together, "together"),
        below("speed of the fastest object, after", calm, "m/s", 0.01, "at rest"),
        noted("largest true force of the arm", _largest(swept), "N"),
        *_estimate(run, sweep),
    ]
    return Result(rows, [_forces(run, sweep.begin, rest.end), _path(swept, 1)])


def holding(runs: Runs) -> Result:
    """The task `hold-tube`: the shelf is lowered, and friction carries the tube."""
    (run,) = runs.values()
    objects, bodies = run.objects, run.world.bodies
    press = run.step("press 15 N")
    tube, shelf = objects["tube"], objects["shelf"].late(press, BOUNDS.steady)
    held = tube.late(press, BOUNDS.steady)
    weight = bodies.mass[0] * _gravity(run)
    squeeze, lift = -float(held.arm_force[:, 0].mean()), float(held.arm_force[:, 2].mean())
    carried = float((held.arm_force + held.other_force)[:, 2].mean())
    start, lowered = (objects[name].during(press.begin + 1.0, press.end) for name in ("tube", "shelf"))
    capacity = squeeze * (bodies.friction[0] + bodies.ground_friction[0])
    rows = [
        near("true force across the tube", 15.0, squeeze, "N", "commanded", BOUNDS.force),
        near("weight carried by friction", weight, carried, "N", "m g", 0.02),
        noted("of it by the link", lift, "N"),
        noted("friction that is needed", weight / capacity, "of the largest at 15 N"),
        noted("shelf lowered by", np.ptp(objects["shelf"].position[:, 2]), "m"),
        below("force of the shelf, after", np.abs(shelf.other_force).max(), "N", 1e-6),
        below("the tube sinks", np.ptp(start.position[:, 2]), "m", 2 * BOUNDS.still, "friction holds"),
        *_estimate(run, press),
    ]
    return Result(rows, [_forces(run, press.begin, press.end), _path({"tube": start, "shelf": lowered}, 2)])


def opening(runs: Runs) -> Result:
    """The task `open-door`: torque of the arm on the door against the door's equation of motion."""
    (run,) = runs.values()
    door, step, hold = run.objects["door"], run.step("open the door"), run.step("hold it open")
    open_ = door.during(step.begin, step.end)
    predicted, torque = _hinge_torque(run, open_), open_.arm_torque[:, 2]
    turning = np.gradient(open_.angle, open_.time) > 0.02
    mean = float(predicted[turning].mean())
    error = float(np.sqrt(np.mean((torque - predicted)[turning] ** 2)))
    held = door.late(hold, BOUNDS.steady)
    rows = [
        near(
            "torque on the hinge while it turns, mean",
            mean,
            torque[turning].mean(),
            "N m",
            "I a + d w + k phi + friction",
            BOUNDS.closed_form,
        ),
        below("torque on the hinge while it turns, rms difference", error, "N m", 0.05),
        noted("angle of the door, held", held.angle.mean(), "rad"),
        below("change of the angle while the door is held", np.ptp(held.angle), "rad", 0.01),
        noted("largest true force of the arm", _largest({"door": open_}), "N"),
        *_estimate(run, step),
    ]
    curves = [
        ("true", measured(open_.time, torque)),
        ("equation of motion", line_only(open_.time, predicted)),
    ]
    panel = Panel("torque of the arm on the hinge", "time [s]", "torque [N m]", curves)
    angle = Panel("door", "time [s]", "angle [rad]", [("", measured(door.time, door.angle))])
    return Result(rows, [panel, angle])


def following(runs: Runs) -> Result:
    """The task `follow-surface`: 10 N on a surface that moves up and down."""
    (run,) = runs.values()
    press, follow = run.step("press 10 N"), run.step("follow the surface")
    surface = run.objects["foam_box"].during(follow.begin + 1.0, follow.end)
    force = run.forces(TRUE).during(follow.begin + 1.0, follow.end).across
    speed = float(np.abs(np.gradient(surface.position[:, 2], surface.time)).max())
    rows = [
        near("at rest, true force across the link", 10.0, _across(run, press), "N", "commanded", BOUNDS.force),
        near("moving, true force, mean", 10.0, force.mean(), "N", "commanded", BOUNDS.force),
        below("moving, true force, rms error", np.sqrt(np.mean((force - 10.0) ** 2)), "N", 1.0),
        below("moving, true force, largest error", np.abs(force - 10.0).max(), "N", 2.0),
        below("time without contact", np.mean(force == 0.0), "fraction", 0.0, "never"),
        noted("motion of the surface", np.ptp(surface.position[:, 2]), "m"),
        noted("largest speed of the surface", speed, "m/s"),
        *_estimate(run, follow),
    ]
    return Result(rows, [_forces(run, press.begin, follow.end), _path({"surface": surface}, 2)])


def _gravity(run: Recording) -> float:
    return -float(run.shared.arm.gravity[2])


def _sliding(trace: ObjectTrace) -> tuple[float, float]:
    """The middle half of the time in which a body slides along x, s."""
    moving = trace.time[np.abs(trace.velocity[:, 0]) > BOUNDS.moving]
    if not len(moving):
        return math.nan, math.nan
    begin, end = float(moving[0]), float(moving[-1])
    return begin + 0.25 * (end - begin), end - 0.25 * (end - begin)


def _moved(trace: ObjectTrace) -> float:
    """Distance between both ends of the motion, m."""
    return float(np.linalg.norm(trace.position[-1, :2] - trace.position[0, :2]))


def _largest(traces: Mapping[str, ObjectTrace]) -> float:
    """Largest force of the arm on an object, N."""
    return max(float(np.linalg.norm(trace.arm_force, axis=1).max()) for trace in traces.values())


def _angles(traces: Mapping[str, ObjectTrace], at: int) -> Numbers:
    return np.array([math.atan2(trace.position[at, 1], trace.position[at, 0]) for trace in traces.values()])


def _hinge_torque(run: Recording, door: ObjectTrace) -> Numbers:
    """Torque that turns the door as it was turned: I phi'' + d phi' + k (phi - phi_0) + friction, N m."""
    doors = run.world.doors
    length, thickness = doors.sizes[0], doors.sizes[1]
    inertia = doors.mass[0] * (4.0 * length**2 + thickness**2) / 3.0  # about the hinge
    rate = np.gradient(door.angle, door.time)
    return (
        inertia * np.gradient(rate, door.time)
        + doors.hinge_damping[0] * rate
        + doors.spring[0] * (door.angle - doors.rest[0])
        + doors.hinge_friction[0] * np.sign(rate)
    )


def _across(run: Recording, step: Step) -> float:
    """True force across the link at the end of a step, mean, N."""
    return float(run.forces(TRUE).during(step.end - BOUNDS.steady, step.end).across.mean())


def _estimate(run: Recording, step: Step) -> list[Comparison]:
    """The estimate over a step next to the truth: the force across, and the time with the correct link."""
    truth, estimate = run.forces(TRUE).during(step.begin, step.end), run.forces(ESTIMATED)
    at = np.searchsorted(estimate.time, truth.time).clip(0, len(estimate.time) - 1)
    touched = truth.frames != "base"
    if not np.any(touched):
        return [Comparison(f"{step.name}, contact", "yes", "no")]
    right = estimate.frames[at][touched] == truth.frames[touched]
    true, estimated = float(truth.across[touched].mean()), float(estimate.across[at][touched].mean())
    return [
        Comparison(f"{step.name}, estimated force across the link, mean", true, estimated, "N", NO_CLAIM, "true"),
        Comparison(
            f"{step.name}, time with the correct link", 1.0, float(np.mean(right)), "fraction of the contact", NO_CLAIM
        ),
    ]


def _forces(run: Recording, begin: float, end: float) -> Panel:
    curves = []
    for topic, label in ((ESTIMATED, "estimated"), (TRUE, "true")):
        forces = run.forces(topic).during(begin, end)
        curves.append((label, measured(forces.time, forces.across)))
    commanded = run.forces("force_command").during(begin, end)
    size = np.linalg.norm(commanded.force, axis=1)
    if np.any(size):
        curves.append(("commanded", line_only(commanded.time, size)))
    return Panel("force across the link", "time [s]", "force [N]", curves)


def _path(traces: Mapping[str, ObjectTrace], axis: int) -> Panel:
    curves = [
        (name, measured(trace.time, trace.position[:, axis] - trace.position[0, axis]))
        for name, trace in traces.items()
        if len(trace.time)
    ]
    return Panel(f"motion along {'xyz'[axis]}", "time [s]", "distance [m]", curves)
