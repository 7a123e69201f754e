"""What a client of FollowJointTrajectory is told, from the arm's angles alone."""

from dataclasses import replace
from itertools import count

import pytest
from arms import CONFIGURATION, SHARED, WAM

from wam_control.force.force_loop_node import ForceLoopNode
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.task.motion import PostureMotion
from wam_control.task.trajectory_goal import GoalCode, GoalEnd, JointTolerance, TrajectoryGoal, TrajectoryPlayer
from wam_control.thresholds import MOTION
from wam_description.parameters import ParameterError
from wam_description.signals import PathPoint, PosturePath, State
from wam_description.wiring import Inputs

START = (0.0, -0.8, 0.0, 0.3)
GOAL = (0.2, -0.9, 0.0, 0.5)
PERIOD = 0.005
PATH = PosturePath((PathPoint(GOAL, (), 1.0),))


def follow(
    goal: TrajectoryGoal, offset: float = 0.0, lag: float = 0.0, joint: int = 0, moves: bool = True
) -> tuple[GoalEnd, float]:
    """Play an arm that is off by an angle, or late by a time, in one joint; how the goal ended and when."""
    motion = PostureMotion(START, PATH, WAM, SHARED.motion)
    for k in count():
        time = k * PERIOD
        assert time < 10.0
        exact, late = motion.at(time), motion.at(max(time - lag, 0.0))
        position, velocity = (list(exact[i]) for i in (0, 1))
        position[joint], velocity[joint] = late.position[joint], late.velocity[joint]
        if time > 0.0:
            position[joint] += offset
        end = goal.step(
            State(position if moves else list(START), velocity if moves else [0.0] * 4, []), PERIOD if k else 0.0
        )
        if end is not None:
            return end, time
    raise AssertionError


def goal(
    on_path: dict[str, JointTolerance] | None = None,
    at_goal: dict[str, JointTolerance] | None = None,
    path: PosturePath = PATH,
) -> TrajectoryGoal:
    return TrajectoryGoal(path, SHARED, on_path or {}, at_goal or {}, 0.0)


def test_an_arm_that_follows_reaches_the_goal_at_its_time() -> None:
    end, time = follow(goal())
    assert end == GoalEnd(GoalCode.SUCCESSFUL, "")
    assert time == pytest.approx(1.0, abs=PERIOD)


def test_an_arm_that_stays_does_not_reach_the_goal_and_is_named_with_the_number() -> None:
    end, time = follow(goal(), moves=False)
    assert end.code is GoalCode.GOAL_TOLERANCE_VIOLATED
    assert "joint1 is off by -0.2 rad, allowed: 0.02 rad" in end.reason
    assert time == pytest.approx(1.0 + MOTION.goal_time, abs=2 * PERIOD)


@pytest.mark.parametrize(("allowed", "code"), [
    (0.04, GoalCode.PATH_TOLERANCE_VIOLATED), (0.06, GoalCode.SUCCESSFUL), (-1.0, GoalCode.SUCCESSFUL),
])  # fmt: skip
def test_the_tolerance_of_the_path_is_of_the_joint_it_names(allowed: float, code: GoalCode) -> None:
    tolerances = {"joint4": JointTolerance(allowed)}
    end, _ = follow(goal(tolerances, {"joint4": JointTolerance(-1.0)}), offset=0.05, joint=3)
    assert end.code is code
    assert (
        follow(goal(tolerances, {"joint2": JointTolerance(-1.0)}), offset=0.05, joint=1)[0].code is GoalCode.SUCCESSFUL
    )


def test_a_velocity_that_is_off_breaks_its_tolerance() -> None:
    end, _ = follow(goal({"joint1": JointTolerance(0.0, 0.05)}), lag=0.2)
    assert end.code is GoalCode.PATH_TOLERANCE_VIOLATED
    assert "rad/s" in end.reason


def test_a_trajectory_that_the_arm_cannot_follow_is_refused_with_what_to_do() -> None:
    end, time = follow(goal(path=PosturePath((PathPoint(GOAL, (), 0.05),))))
    assert end.code is GoalCode.INVALID_GOAL
    assert time == 0.0
    assert "times the time" in end.reason


def test_a_first_point_at_zero_is_where_the_arm_is() -> None:
    planned = PosturePath((PathPoint(START, (0.0,) * 4), *PATH.points))
    with_start, without = (PostureMotion(START, path, WAM, SHARED.motion) for path in (planned, PATH))
    assert with_start.duration == without.duration
    assert with_start.at(0.37) == without.at(0.37)
    elsewhere = PosturePath((PathPoint((0.1, *START[1:])), *PATH.points))
    with pytest.raises(ParameterError, match=r"joint1 of the trajectory starts at .* rad, but the arm is at 0 rad"):
        PostureMotion(START, elsewhere, WAM, SHARED.motion)
    moving = PosturePath((PathPoint(START, (0.1, 0.0, 0.0, 0.0)), *PATH.points))
    with pytest.raises(ParameterError, match="starts with a velocity"):
        PostureMotion(START, moving, WAM, SHARED.motion)


def test_it_waits_until_the_arm_is_at_rest() -> None:
    waiting = goal()
    for _ in range(10):
        assert waiting.step(State(list(START), [0.0, 0.2, 0.0, 0.0], []), PERIOD) is None
    assert waiting.desired is None
    assert waiting.time == 0.0
    assert follow(waiting)[0].code is GoalCode.SUCCESSFUL
    moving = goal()
    *_, end = [moving.step(State(list(START), [0.0, 0.2, 0.0, 0.0], []), PERIOD) for _ in range(202)]
    assert end is not None
    assert "a joint moves at 0.2 rad/s" in end.reason


def test_an_arm_that_a_dither_shakes_is_at_rest() -> None:
    player = TrajectoryPlayer(replace(SHARED, timing=replace(SHARED.timing, dither_cycle=40)))
    found = [player.step(PATH, START, [0.0, 0.2 * (-1) ** k, 0.0, 0.0], PERIOD) for k in range(8)]
    assert [one is not None for one in found] == [False] * 7 + [True], "after a whole cycle"
    others = [PosturePath((PathPoint(GOAL, (), 1.0 + k // 3),)) for k in range(9)]
    assert all(player.step(other, START, [0.0, 0.2 * (-1) ** k, 0.0, 0.0], PERIOD) for k, other in enumerate(others))


def test_a_streamed_trajectory_begins_as_the_brakes_are_released() -> None:
    given = CONFIGURATION.node("force_loop", ForceLoopParameters)
    first, late = (ForceLoopNode(SHARED, given) for _ in range(2))
    for effort in [0.0] * 100 + [1.0] * 100:
        joints = State(list(START), [0.0] * 4, [effort] * 4)
        inputs = Inputs.of(1, PERIOD, {"joint_states": (1, joints), "joint_trajectory": (1, PATH)})
        found = late.step(inputs)["joint_velocity_command"]
        assert not effort or found == first.step(inputs)["joint_velocity_command"]
