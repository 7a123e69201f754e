"""A cylinder between adjacent links (figures 3.1 and 7.4): held while half of their angle is in the friction cone."""

import math

import numpy as np
import pytest
from arms import NOWHERE, WAM, changed

from wam_description.effects import no_effects
from wam_description.movable import FreeBodies
from wam_description.rigid_body import RigidBody
from wam_description.world import NO_SPRINGS, World
from wam_driver.plant import Plant
from wam_theory.requisites import secure_angle

STEP, RADIUS, MASS = 5e-4, 0.05, 0.4  # s, m, kg
ARM = changed(WAM, gravity=(0.0, 0.0, 0.0))


def angle_between(elbow: float) -> float:
    """Angle between the tubes, rad."""
    (_, one), (_, other) = tubes(elbow)
    return math.acos(float(-one @ other))


def tubes(elbow: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """A point of the axis of either tube, and its direction."""
    found, covers = [], ARM.covers
    for i, name in enumerate(covers.names):
        pose = RigidBody(ARM).cover_pose(pose_of(elbow), name)
        start, end = (pose.rotation @ np.array(ends[3 * i : 3 * i + 3]) for ends in (covers.start, covers.end))
        found.append((pose.position + start, (end - start) / np.linalg.norm(end - start)))
    return found


def pose_of(elbow: float) -> tuple[float, ...]:
    return (0.0, -1.0, 0.0, elbow)


def between(elbow: float) -> tuple[np.ndarray, np.ndarray]:
    """Centre and axis of the cylinder that touches both tubes, which cross it."""
    points, along = zip(*tubes(elbow), strict=True)
    axis = np.cross(along[0], along[1]) / np.linalg.norm(np.cross(along[0], along[1]))
    bisector = along[1] - along[0]
    sides = []
    for way in along:
        side = np.cross(axis, way)
        sides.append(side if side @ bisector > 0.0 else -side)
    reach = [RADIUS + radius for radius in ARM.covers.radius[-2:]]
    rows = np.array([*sides, axis])
    level = [*(side @ point + r for side, point, r in zip(sides, points, reach, strict=True)), axis @ points[1]]
    return np.linalg.solve(rows, level), axis


def roll_pitch_yaw(axis: np.ndarray) -> tuple[float, float, float]:
    """Rotation that turns z to the axis."""
    return (-math.asin(axis[1]), math.atan2(axis[0], axis[2]), 0.0)


def squeezed(elbow: float, friction: float) -> tuple[float, list[float]]:
    """Angle between the tubes after two seconds of 5 N m at the elbow, rad, and the loads on the tubes, N."""
    centre, axis = between(elbow)
    arm = changed(ARM, joints={"start": pose_of(elbow)})
    size, place = (RADIUS, 0.1, 0.0), (tuple(centre.tolist()), roll_pitch_yaw(axis))
    surface, laws = ((3e4,), (100.0,), (friction,)), ((MASS,), (0.0,), (2e4,), (50.0,))
    bodies = FreeBodies(("tube",), *surface, ("cylinder",), size, *place, *laws)
    plant = Plant(arm, World(NOWHERE, NO_SPRINGS, bodies=bodies), no_effects(arm), STEP)
    plant.brake(False)
    for _ in range(4000):
        plant.step([0.0, 0.0, 0.0, -0.25])
    return angle_between(plant.q[3]), [float(np.linalg.norm(load.force)) for load in plant.loads()]


@pytest.mark.slow
@pytest.mark.parametrize(("elbow", "friction"), [(-0.6, 0.5), (-0.3, 0.8)])
def test_a_cylinder_is_held_between_the_links_inside_the_friction_cone(elbow: float, friction: float) -> None:
    """Angles of 51, 69 and 34 degrees; the secure ones of (3.2) are 53, 77 and 53.  Its contacts yield a little."""
    before = angle_between(elbow)
    after, loads = squeezed(elbow, friction)
    assert before < secure_angle(friction)
    assert before - math.radians(2.5) < after < before
    assert len(loads) == 2
    assert min(loads) > 20.0


@pytest.mark.slow
@pytest.mark.parametrize(("elbow", "friction"), [(-0.6, 0.3), (0.0, 0.5)])
def test_a_cylinder_outside_the_friction_cone_is_squeezed_out_until_the_angle_is_secure(
    elbow: float, friction: float
) -> None:
    assert angle_between(elbow) > secure_angle(friction)
    after, _ = squeezed(elbow, friction)
    assert after < secure_angle(friction)
