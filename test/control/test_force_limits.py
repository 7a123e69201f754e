"""What bounds the motion: joint ends, the acceleration, the impact, the rise of a force, and pushes."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from arms import CONFIGURATION, WAM
from test_force_belief import BODY, OUTER, OWN, POSES, axis_at

from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.held_arm import PushedArm
from wam_control.force.limits import (
    approach_speed,
    certain_size,
    followed,
    joint_bounds,
    largest_lever,
    lever_of,
    likeliest_link,
    servo_yielding,
)
from wam_description.signals import ZERO, Contact

JOINTS, STILL, DT = WAM.joints, [0.0] * 4, 0.005
MOTORS = replace(OWN, feedback="contact_estimate")
STIFF_SERVO = WAM.transmission.at_joints(CONFIGURATION.shared.servo.integral_gain)
LOWER, UPPER = np.array(JOINTS.lower), np.array(JOINTS.upper)


def limited(own: ForceLoopParameters = OWN, **limits: float) -> ForceLoopParameters:
    return replace(own, limits=replace(own.limits, **limits))


def test_no_joint_comes_nearer_to_its_end_than_allowed_however_it_is_driven() -> None:
    random = np.random.default_rng(1)
    for seed in range(10):
        q, sign = random.uniform(LOWER + 0.1, UPPER - 0.1), 1.0 if seed % 2 else -1.0
        for _ in range(1500):
            low, high = map(np.array, joint_bounds(q.tolist(), JOINTS, OWN, STILL, math.inf))
            assert (low <= high).all()
            assert max(abs(low).max(), abs(high).max()) <= OWN.joint_speed_limit
            q = q + (high if sign > 0 else low) * DT
        ends = UPPER - OWN.limits.joint_margin if sign > 0 else LOWER + OWN.limits.joint_margin
        assert q == pytest.approx(ends, abs=1e-3)


def test_a_joint_beyond_its_end_is_brought_back_slowly() -> None:
    q = UPPER + 0.2
    for _ in range(2000):
        low, high = map(np.array, joint_bounds(q.tolist(), JOINTS, OWN, STILL, math.inf))
        assert (low <= high).all()
        assert (high >= -0.3).all()
        q = q + high * DT
    assert q == pytest.approx(UPPER, abs=1e-3)
    slow = joint_bounds((UPPER + 0.2).tolist(), JOINTS, replace(OWN, joint_speed_limit=0.05), STILL, math.inf)
    assert set(slow[1]) == {-0.05}, "no faster than any other motion"
    free = joint_bounds((UPPER + 0.2).tolist(), JOINTS, limited(joint_gain=0.0), STILL, math.inf)
    assert set(free[1]) == {OWN.joint_speed_limit}, "ends that are not watched"


@pytest.mark.parametrize("q", POSES)
@pytest.mark.parametrize("own", [OWN, MOTORS, replace(OWN, force_filter=0.0)])
def test_an_approach_hits_no_harder_than_allowed_and_a_touch_rises_no_faster_than_it_is_measured(
    own: ForceLoopParameters, q: tuple[float, ...]
) -> None:
    stiffness = own.guard.contact_stiffness
    for force in (2.0, 10.0, 40.0):
        axis = axis_at(q, force)
        assert axis.sensed is not None
        assert axis.place is not None
        fraction = axis.sensed.speed_fraction
        hit = fraction * approach_speed(axis, False, own) * math.sqrt(axis.sensed.impact_mass * stiffness)
        assert hit == pytest.approx(own.limits.impact * force)
        rising = fraction * approach_speed(axis, True, own) / (1.0 / stiffness + axis.sensed.compliance)
        latency = own.force_filter + (own.guard.feedback_lag if own.is_estimated else 0.0)
        assert rising * 5.0 * latency <= force, "at least 5 latencies"
        unknown = axis._replace(place=axis.place._replace(is_pinned=False, is_known=False))
        for is_touching in (False, True):
            assert approach_speed(unknown, is_touching, own) <= approach_speed(axis, is_touching, own)
    speeds = [approach_speed(axis_at(q, force), True, own) for force in (1.0, 2.0, 5.0, 20.0)]
    assert all(b > a for a, b in pairwise(speeds))
    assert approach_speed(axis_at(q), False, limited(own, impact=0.0)) == math.inf


def test_a_force_at_a_place_that_is_not_known_rises_as_fast_as_the_velocity_loops_wind_up() -> None:
    axis = axis_at(POSES[0])
    assert axis.place is not None
    assert servo_yielding(axis, STIFF_SERVO, MOTORS) == 0.0, "at a pinned place the torque is fed forward"
    estimated = axis._replace(place=axis.place._replace(is_pinned=False, is_known=False))
    assert servo_yielding(estimated, STIFF_SERVO, OWN) == 0.0
    yielding = servo_yielding(estimated, STIFF_SERVO, MOTORS)
    assert servo_yielding(estimated, 2.0 * STIFF_SERVO, MOTORS) == pytest.approx(yielding / 2.0)
    faster = approach_speed(estimated, True, MOTORS, yielding) - approach_speed(estimated, True, MOTORS)
    assert faster > 0.0
    assert approach_speed(estimated, False, MOTORS, yielding) == approach_speed(estimated, False, MOTORS)


@pytest.mark.parametrize("cover", [0, 1])
def test_a_push_is_never_stated_as_larger_than_the_force(cover: int) -> None:
    random, sd, far = np.random.default_rng(5), np.full(4, 0.02), 0.9 * WAM.covers.length[cover]
    for _ in range(300):
        q = random.uniform(LOWER, UPPER)
        force = random.normal(size=3)
        force *= 50.0 / np.linalg.norm(force)
        torques = force @ BODY.point_jacobian(q, WAM.covers.names[cover], (far, 0.0, 0.0))
        ends = (BODY.point_jacobian(q, WAM.covers.names[cover], (x, 0.0, 0.0)) for x in (0.0, far / 0.9))
        levers = largest_lever(likeliest_link(BODY, q, torques)), max(lever_of(end, torques) for end in ends)
        assert 0.0 <= certain_size(torques, sd) / min(levers) <= 50.0 * (1.0 + 1e-9)
        assert certain_size(0.02 * random.normal(size=4), 0.1 * np.ones(4)) == 0.0, "noise is no push"


def test_an_arm_gives_way_to_what_is_above_the_allowed_force_and_does_not_move_against_it() -> None:
    torques, touched = np.array([0.0, -40.0, 0.0, 60.0]), Contact(OUTER, 0.28, ZERO)
    least = math.hypot(40.0, 60.0) / largest_lever(BODY.point_jacobian(POSES[0], OUTER, (0.28, 0.0, 0.0)))
    for part, gain, sense in ((0.5, 0.03, 1.0), (1.0, 0.03, 0.0), (2.0, 0.03, -1.0), (0.0, 1e9, 1.0)):
        given = POSES[0], [], torques, np.zeros(4), touched, 0.0, (part * least, ""), False, False, gain, OWN, DT
        (row,) = PushedArm(BODY).step(*given)
        assert row.along @ torques > 0.0, "along the torques of the world"
        assert np.sign(round(row.speed, 12)) == sense
    assert row.speed == OWN.joint_speed_limit


def test_the_link_that_is_pushed_is_the_one_that_explains_the_torques() -> None:
    for cover, length in zip(WAM.covers.names, WAM.covers.length, strict=True):
        jacobian = BODY.point_jacobian(POSES[0], cover, (length, 0.0, 0.0))
        found = likeliest_link(BODY, POSES[0], np.array([3.0, -9.0, 6.0]) @ jacobian)
        assert found == pytest.approx(jacobian)


def test_a_posture_slides_the_link_no_faster_than_the_force_follows() -> None:
    axis = axis_at(POSES[0], 5.0)
    point = WAM.covers.on_axis(OUTER, 0.28)
    for speed in (1e-3, 1.0):
        wanted = speed * np.array([1.0, 0.5, -0.5, 1.0])
        found = followed(wanted, axis, BODY, POSES[0], OWN)
        slide = float(np.linalg.norm(BODY.point_jacobian(POSES[0], OUTER, point) @ found))
        assert 0.3 * slide <= max(OWN.force_gain) * OWN.limits.tolerance * 5.0 * (1.0 + 1e-9)
        assert speed > 1e-3 or (found == wanted).all()
