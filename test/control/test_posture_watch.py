"""Whether a commanded posture moves on faster than the arm follows; the arm here is never faster than its limit."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from wam_control.force.posture_watch import PostureWatch
from wam_control.force.thresholds import FORCE
from wam_control.task.motion import GoalMotion, Moving
from wam_description.event_text import sentence

LIMIT, DT, WAY = 1.5, 0.005, 1.2
LEAST = 1.875 * WAY / (FORCE.caught_up * LIMIT)  # s, in which a minimum-jerk path is caught up with


def posture_watch() -> PostureWatch:
    return PostureWatch(["elbow"], "posture", "joint_speed_limit", "rad/s")


def late(posture: Callable[[float], float], seconds: float, has_rate: bool = False, every: int = 1) -> list[str]:
    """What is stated while a posture goes on, streamed every so many periods, and the arm goes to it."""
    watch, q, found = posture_watch(), 0.0, []
    for k in range(round(seconds / DT)):
        goal = posture(DT * (k - k % every))
        found.append(watch.step([goal], has_rate, [q], LIMIT, DT))
        q += min(max(goal - q, -LIMIT * DT), LIMIT * DT)
    return found


def path(seconds: float) -> Callable[[float], float]:
    motion = GoalMotion([0.0], [WAY], seconds)
    return lambda time: motion.at(time).position[0]


@pytest.mark.parametrize("every", [1, 10])
def test_a_posture_is_late_if_it_is_faster_than_the_arm_catches_up_with(every: int) -> None:
    assert not any(late(path(1.01 * LEAST), 3.0, every=every))
    found = late(path(0.7 * LEAST), 3.0, every=every)
    assert any(found)
    assert not found[-1], "until the arm has arrived"
    begin = next(k for k, text in enumerate(found) if text)
    assert all(event == found[begin] for event in found if event)
    assert sentence(found[begin]).startswith("the commanded posture moves faster than the arm follows, elbow with ")


def streamed(speed: float, interval: float, seconds: float = 6.0, age: float = math.inf, jitter: float = 0.0) -> bool:
    """Whether a joint is late on a way that is streamed at intervals, s, each command for no longer than its age, s."""
    random, watch, q, goal, since = np.random.default_rng(0), posture_watch(), 0.0, 0.0, 0.0
    due, found = interval, False
    for k in range(round(seconds / DT)):
        time = k * DT
        if time >= due:
            goal, since, due = speed * time, time, due + interval * (1.0 + jitter * random.uniform(-1.0, 1.0))
        if time - since < age:
            found |= bool(watch.step([goal], False, [q], LIMIT, DT))
            q += min(max(goal - q, -LIMIT * DT), LIMIT * DT)
        else:
            found |= bool(watch.wait(DT))
    return found


@pytest.mark.parametrize("rate", [1.0, 2.0, 5.0, 8.0, 20.0, 50.0])
def test_a_slow_stream_is_judged_by_its_own_interval(rate: float) -> None:
    """Below 10 Hz each posture was another goal, and nothing was late."""
    for jitter in (0.0, 0.2):
        assert not streamed(0.9 * LIMIT, 1.0 / rate, jitter=jitter)
        assert streamed(1.1 * FORCE.caught_up * LIMIT, 1.0 / rate, jitter=jitter)


def test_a_command_that_lapses_before_the_next_one_is_followed_for_its_age() -> None:
    assert not streamed(0.9 * 0.2 * LIMIT, 1.0, age=0.2)
    assert streamed(0.9 * LIMIT, 1.0, age=0.2)
    assert not streamed(0.9 * LIMIT, 0.19, age=0.2)


def test_goals_to_and_fro_in_a_rhythm_are_no_motion() -> None:
    assert not any(late(lambda time: 3.0 * (round(time) % 2), 8.0))


def test_with_velocities_the_path_counts_and_not_its_end_alone() -> None:
    for speed, is_late in ((0.99 * LIMIT, False), (1.1 * LIMIT, True)):
        assert any(late(lambda time, speed=speed: speed * time, 0.8, has_rate=True)) is is_late
        assert not any(late(lambda time, speed=speed: speed * time, 0.8))


def test_another_goal_is_no_motion_however_far_it_is() -> None:
    assert not any(late(lambda time: 2.0 * (time > 0.3) - 1.5 * (time > 0.5), 3.0))


def test_a_goal_that_is_set_elsewhere_within_a_noisy_stream_is_no_motion() -> None:
    assert not any(late(lambda time: 0.5 * (time > 0.3) + 1e-5 * (round(time / DT) % 3), 2.0))


def test_a_motion_that_goes_on_from_where_the_arm_is_begins_there() -> None:
    """As after a force, which has moved the arm away from its posture."""
    watch = posture_watch()
    postures = [0.001 * k for k in range(40)] + [0.5 + 0.001 * k for k in range(40)]
    assert not any(watch.step([one], False, [0.5], LIMIT, DT) for one in postures)


def test_a_joint_that_may_not_move_follows_nothing() -> None:
    watch = posture_watch()
    found = [watch.step([0.001 * k], False, [0.0], 0.0, DT) for k in range(40)]
    assert "allowed: joint_speed_limit, 0 rad/s" in sentence(found[-1])


def test_a_goal_is_reached_with_its_largest_speed_in_the_middle() -> None:
    motion = GoalMotion([0.0, 1.0], [WAY, 0.0], 2.0)
    assert motion.at(2.0) == Moving([WAY, 0.0], [])
    h = 1e-6
    middle = [
        (b - a) / h for a, b in zip(motion.at(1.0 - h / 2).position, motion.at(1.0 + h / 2).position, strict=True)
    ]
    assert [abs(speed) for speed in middle] == pytest.approx(motion.fastest)
