"""The experiment `wam-grope`, groping a box (7.3): its position by the contacts of the arm, and the true one."""

import numpy as np

from wam_bag.bag import BagError
from wam_description.rigid_body import RigidBody
from wam_studies.figures.panels import Numbers, Panel, line_only, measured
from wam_studies.thesis.bounds import BOUNDS
from wam_studies.thesis.recording import Recording, Runs, Step
from wam_studies.thesis.rows import Comparison, Result


def groping(runs: Runs) -> Result:
    """Top, left and right edge of the box, one contact each; of a sample those that it has."""
    (run,) = runs.values()
    obstacles = run.world.obstacles
    centre, half = np.array(obstacles.positions[:3]), np.array(obstacles.sizes[:3])
    low, high = centre - half, centre + half
    until = float(run.joints("joint_states").time[-1]) - BOUNDS.position_known_after
    steps = [step for step in run.steps if step.name.startswith("touch") and step.end <= until]
    points = {step.name.removeprefix("touch the "): touched(run, step) for step in steps}
    rows = [
        Comparison(f"{side}, height", high[2], float(point[2]), "m", BOUNDS.surface_height, "true position", True)
        for side, point in points.items()
    ]
    for side, edge in (("left edge", high[1]), ("right edge", low[1])):
        if side in points:
            x, y, _ = points[side].tolist()
            rows += [
                Comparison(f"{side}, y", edge, y, "m", BOUNDS.surface_across, "", True),
                Comparison(f"{side}, x of the near corner", low[0], x, "m", BOUNDS.surface_along, "", True),
            ]
    corners = np.array([low, [high[0], low[1], 0.0], high, [low[0], high[1], 0.0], low])
    found = np.array(list(points.values()))
    curves = [
        ("box", line_only(corners[:, 0], corners[:, 1])),
        (f"touched: {', '.join(points)}", measured(found[:, 0], found[:, 1])),
    ]
    return Result(rows, [Panel("seen from above", "x [m]", "y [m]", curves)])


def touched(run: Recording, step: Step) -> Numbers:
    """Point of the skin at which a step ended in contact, (3,), m, base frame, by joint angles and estimate.

    Raises
    ------
    BagError
        if no contact is estimated there.
    """
    arm, time = run.shared.arm, step.end + BOUNDS.position_known_after
    joints, wrench = run.joints("joint_states"), run.forces("contact/wrench")
    times, places = run.positions("contact/point")
    q = joints.position[_last(joints.time, time)]
    place = float(places[_last(times, time)])
    at = _last(wrench.time, time)
    cover, push = wrench.frames[at], wrench.force[at]
    if cover not in arm.covers.names or np.isnan(place):
        raise BagError(f"{run.bag.path}: no contact is estimated {BOUNDS.position_known_after} s after '{step.name}'")
    i = arm.covers.names.index(cover)
    inwards = np.array([0.0, push[1], push[2]]) / np.hypot(push[1], push[2])
    axis = np.array(arm.covers.on_axis(cover, place))
    return RigidBody(arm).point(q, cover, axis - arm.covers.radius[i] * inwards)


def _last(times: Numbers, time: float) -> int:
    return int(np.searchsorted(times, time + 1e-9)) - 1
