"""Motions: the limits hold, lines are straight, what leaves the limits is refused before it starts."""

import math

import numpy as np
import pytest
from arms import SHARED

from wam_control.task.motion import LineMotion, PostureMotion, SCurve
from wam_control.task.trajectory_goal import TrajectoryPlayer
from wam_description.parameters import ParameterError
from wam_description.rigid_body import RigidBody
from wam_description.signals import PathPoint, PosturePath

ARM, LIMITS = SHARED.arm, SHARED.motion
BODY = RigidBody(ARM)
START = [0.0, -1.2, 0.2, 0.3]
REST = [0.0] * 4
DT = 0.005


SPANS = ((-3.0, 1.0), (-1.0, 1.0), (-1.0, 1.5), (-1.0, 2.5))


@pytest.mark.parametrize("seed", range(5))
def test_an_s_curve_ends_where_it_should_within_its_limits(seed: int) -> None:
    random = np.random.default_rng(seed)
    distance, speed, acceleration, jerk = (10.0 ** random.uniform(low, high) for low, high in SPANS)
    curve = SCurve(distance, speed, acceleration, jerk)
    times = np.linspace(0.0, curve.duration, 8001)
    way, rate = np.array([curve.at(t) for t in times]).T
    step = times[1]
    assert curve.at(curve.duration * (1.0 - 1e-12)) == pytest.approx((distance, 0.0), rel=1e-9, abs=1e-9 * speed)
    assert np.max(rate) <= speed * (1.0 + 1e-9)
    assert np.max(np.abs(np.diff(rate))) <= acceleration * step * (1.0 + 1e-6)
    assert np.max(np.abs(np.diff(rate, 2))) <= jerk * step * step * (1.0 + 1e-6) + 1e-12 * speed
    middle = (rate[1:] + rate[:-1]) / 2.0
    assert np.max(np.abs(np.diff(way) - middle * step)) <= jerk * step**3, "the speed is that of the way"


def test_an_s_curve_takes_the_times_of_the_closed_form() -> None:
    # speed, acceleration and jerk are all reached: D/v + v/a + a/j
    assert SCurve(2.0, 1.0, 2.0, 8.0).duration == pytest.approx(2.0 + 0.5 + 0.25)
    # only jerk counts: 4 (D/2j)^(1/3)
    assert SCurve(0.016, 10.0, 100.0, 1.0).duration == pytest.approx(4.0 * 0.2)


def path(*points: PathPoint) -> PosturePath:
    return PosturePath(tuple(points))


def test_postures_are_reached_one_after_the_other_within_the_limits_of_every_joint() -> None:
    via, goal = (0.3, -1.0, 0.0, 0.5), (-0.2, -1.4, 0.4, 0.0)
    motion = PostureMotion(START, path(PathPoint(via), PathPoint(goal)), ARM, LIMITS)
    times = np.arange(0.0, motion.duration + DT, 1e-3)
    positions, rates = (np.array(part) for part in zip(*(motion.at(t) for t in times), strict=True))
    assert positions[0] == pytest.approx(START)
    assert positions[-1] == pytest.approx(goal)
    assert np.min(np.abs(positions - via).max(axis=1)) < 1e-4
    assert np.all(np.abs(rates).max(axis=0) <= np.array(LIMITS.joint_speed) + 1e-9)
    assert np.all(np.abs(np.diff(rates, axis=0)).max(axis=0) <= np.array(LIMITS.joint_acceleration) * 1.001e-3)
    assert np.gradient(positions, 1e-3, axis=0)[1:-1] == pytest.approx(rates[1:-1], abs=1e-4)


def test_times_and_velocities_are_kept() -> None:
    point = PathPoint((0.2, -1.1, 0.2, 0.3), (0.1, 0.05, 0.0, 0.0), 1.5)
    motion = PostureMotion(START, path(point, PathPoint((0.3, -1.0, 0.2, 0.3), (), 3.0)), ARM, LIMITS)
    assert motion.at(1.5).position == pytest.approx(point.position)
    assert motion.at(1.5).velocity == pytest.approx(point.velocity)
    assert motion.duration == 3.0


@pytest.mark.parametrize(("points", "reason"), [
    ([PathPoint((9.0, -1.2, 0.2, 0.3))], "the trajectory: joint1 is commanded to 9 rad"),
    ([PathPoint((0.5, -1.2, 0.2, 0.3), (), 0.2)], "joint1 of the trajectory reaches 4.69 rad/s; allowed: 1.2"),
    ([PathPoint(tuple(START), (), 1.0), PathPoint(tuple(START), (), 0.5)], "have to rise"),
    ([PathPoint((0.1, -1.2, 0.2, 0.3), (0.1, 0.0, 0.0, 0.0), 1.0)], "has to end at rest"),
    ([], "no points"),
    ([PathPoint((0.0, -1.2, 0.2, 0.3), (1e300, 0.0, 0.0, 0.0), 1e9)], "allowed: 1e-06 to 1e.06 s between them"),
    (
        [PathPoint((0.0, -1.2, 0.2, 0.3), (0.0, -1e308, 0.0, 0.0), 9.0)],
        "joint2 of the trajectory reaches 1e.308 rad/s",
    ),
    (
        [PathPoint((0.0, -1.2, 0.2, 0.3), (), 1.0), PathPoint((0.0, -1.2, 0.2, 0.3), (), 1.0 + 1e-9)],
        "1e-09 s after",
    ),
])  # fmt: skip
def test_a_trajectory_beyond_the_limits_is_refused_with_the_number(points: list[PathPoint], reason: str) -> None:
    with pytest.raises(ParameterError, match=reason):
        PostureMotion(START, path(*points), ARM, LIMITS)


def test_the_stretch_that_a_refusal_names_is_enough() -> None:
    goal = (0.5, -1.2, 0.2, 0.3)
    time = 0.2
    for _ in range(3):  # of speed, acceleration and jerk one is named after the other
        try:
            PostureMotion(START, path(PathPoint(goal, (), time)), ARM, LIMITS)
        except ParameterError as error:
            time *= 1.01 * float(str(error).split("give it ")[1].split(" times")[0])
    PostureMotion(START, path(PathPoint(goal, (), time)), ARM, LIMITS)


def test_the_tool_stays_on_a_straight_line() -> None:
    begin = BODY.tool_pose(START).position
    way = np.array([-0.1, 0.2, -0.15])
    motion = LineMotion(START, tuple(begin + way), ARM, BODY, LIMITS)
    times = np.arange(0.0, motion.duration, DT)
    places = np.array([BODY.tool_pose(motion.at(t).position).position for t in times]) - begin
    along = places @ way / np.linalg.norm(way)
    assert np.max(np.abs(places - np.outer(along, way) / np.linalg.norm(way))) < 1e-6
    assert BODY.tool_pose(motion.at(motion.duration).position).position == pytest.approx(begin + way, abs=1e-9)
    speed = np.gradient(along, DT)
    assert np.max(speed) <= LIMITS.speed * 1.001
    rates = np.array([motion.at(t).velocity for t in times])
    assert np.gradient([motion.at(t).position for t in times], DT, axis=0)[1:-1] == pytest.approx(rates[1:-1], abs=2e-3)
    assert np.abs(rates).max() <= min(LIMITS.joint_speed) * 1.001


@pytest.mark.parametrize("goal", [(0.0, 0.0, 0.964), (0.0, 0.0, 0.02)])
def test_a_line_out_of_reach_or_through_the_arm_is_refused_with_the_place(goal: tuple[float, float, float]) -> None:
    with pytest.raises(ParameterError, match=r"at [01]\.\d+ m of the line of .* allowed"):
        LineMotion(START, goal, ARM, BODY, LIMITS)


@pytest.mark.parametrize("goal", [(2.0, 0.0, 0.0), (600.0, 0.0, 0.0), (60.0, -90.0, 0.0)])
def test_a_goal_out_of_reach_is_refused_as_that(goal: tuple[float, float, float]) -> None:
    text = f"tip is {math.hypot(*goal):.3g} m from the origin of the base frame; allowed: up to 0.965 m, the reach"
    with pytest.raises(ParameterError, match=text):
        LineMotion(START, goal, ARM, BODY, LIMITS)


def test_the_tool_is_never_further_than_the_reach_of_the_arm_and_comes_close_to_it() -> None:
    random = np.random.default_rng(7)
    postures = random.uniform(ARM.joints.lower, ARM.joints.upper, (5000, 4))
    farthest = max(math.hypot(*BODY.tool_pose(q).position) for q in postures)
    assert 0.999 * BODY.reach < farthest <= BODY.reach


def test_a_streamed_trajectory_goes_on_and_one_that_ends_leaves_the_arm_where_it_is() -> None:
    player = TrajectoryPlayer(SHARED)
    there = path(PathPoint((0.3, -1.0, 0.0, 0.5)))
    outs = [player.step(path(*there.points), START, REST, DT) for _ in range(1000)]  # an equal one each time
    assert outs[-1] is not None
    assert outs[-1].position == pytest.approx(there.points[0].position)
    assert player.step(None, START, REST, DT) is None
    moving = [0.2, 0.0, 0.0, 0.0]
    assert player.step(there, START, moving, DT) is None, "another one waits until the arm is at rest"
    first = player.step(there, START, REST, DT)
    assert first is not None
    assert first.position == pytest.approx(START, abs=1e-4)


def test_a_trajectory_that_is_refused_does_not_move_the_arm() -> None:
    player = TrajectoryPlayer(SHARED)
    assert player.step(path(PathPoint((9.0, 0.0, 0.0, 0.0))), START, REST, DT) is None
    assert "joint1" in player.refusal
    assert player.step(path(PathPoint(tuple(START))), START, REST, DT) is not None
    assert player.refusal == ""
