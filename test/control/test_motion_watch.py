"""Whether an axis gets where its position or velocity takes it; the arm here is late by a time constant, or blocked."""

import math
from collections.abc import Callable

import pytest

from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.motion_watch import MotionWatch
from wam_control.thresholds import MOTION
from wam_description.configuration import Configuration, packaged
from wam_description.event import Code
from wam_description.event_text import sentence

OWN = Configuration.load(packaged("wam")).node("force_loop", ForceLoopParameters)
NONE, NOT_REACHED, NOT_FOLLOWED = Code.NONE, Code.NOT_REACHED, Code.NOT_FOLLOWED
LASTING, RATE, FASTEST = OWN.limits.settling_time, OWN.task.largest_rate, OWN.task.speed_limit
LEVER, DT, LAG = 0.5, 0.005, 0.05  # m, s, s
ALLOWED = MOTION.at_rest * LEVER / RATE  # m


def position(
    goal: Callable[[float], float],
    seconds: float,
    end: float = math.inf,
    rate: Callable[[float], float] = lambda time: 0.0,
    share: float = 1.0,
    law: float = RATE,
) -> list[Code]:
    """What is reported of an arm that goes to a goal, m, by the law of the axis, and not beyond an end, m."""
    watch, x, v, found = MotionWatch("axis", "m"), 0.0, 0.0, []
    for k in range(round(seconds / DT)):
        time = k * DT
        found.append(watch.position(goal(time), rate(time), x, LEVER, (law, FASTEST), share, OWN, DT)[0])
        most = FASTEST * share
        v += (min(max(rate(time) + law * (goal(time) - x), -most), most) - v) * DT / LAG
        x = min(x + v * DT, end)
    return found


def velocity(
    wanted: Callable[[float], float], made: Callable[[float], float], seconds: float, share: float = 1.0
) -> list[Code]:
    """What is reported of an arm that makes another velocity than the commanded one, m/s."""
    watch, times = MotionWatch("axis", "m"), [k * DT for k in range(round(seconds / DT))]
    return [watch.velocity(wanted(t), made(t) * DT, LEVER, share, OWN, DT)[0] for t in times]


@pytest.mark.parametrize("goal", [0.01, 0.1, -0.8])
def test_an_arm_that_goes_where_it_is_commanded_is_not_reported(goal: float) -> None:
    assert set(position(lambda time: goal, 4.0)) == {NONE}


@pytest.mark.parametrize(("miss", "is_reported"), [(0.8, False), (1.2, True)])
def test_a_position_counts_as_reached_where_its_law_commands_no_joint_that_moves(
    miss: float, is_reported: bool
) -> None:
    found = position(lambda time: 0.1, LASTING, end=0.1 - miss * ALLOWED)
    assert set(found) == {NONE, *([NOT_REACHED] if is_reported else [])}


def test_a_position_that_is_reached_later_is_reported_no_more() -> None:
    found = position(lambda time: 0.1 if time < 2.0 else 0.02, 4.0, end=0.05)
    assert NOT_REACHED in found
    assert found[-1] is NONE


@pytest.mark.parametrize("every", [1, 10])
def test_a_position_that_moves_is_behind_by_its_law_alone(every: int) -> None:
    def wave(time: float) -> float:
        return 0.05 * math.sin(3.0 * (time - time % (every * DT)))

    assert set(position(wave, 4.0)) == {NONE}
    assert NOT_REACHED in position(wave, 4.0, end=0.0)


def test_a_rate_counts_while_the_position_moves_alone() -> None:
    assert set(position(lambda time: 0.1 * time, 3.0, rate=lambda time: 0.1)) == {NONE}
    assert position(lambda time: 0.1, 3.0, rate=lambda time: 0.1)[-1] is NOT_REACHED, "by 0.1 m/s over largest_rate"


def test_a_law_that_is_too_slow_to_arrive_in_time_is_reported() -> None:
    assert NOT_REACHED in position(lambda time: 0.3, LASTING, law=0.1)


def test_a_position_to_which_the_joints_are_not_fast_enough_is_late_only_while_it_moves() -> None:
    assert set(position(lambda time: 0.4, 4.0, share=0.5)) == {NONE}
    assert NOT_FOLLOWED in position(lambda time: 0.45 * time, 2.0, share=0.5)


@pytest.mark.parametrize("speed", [0.005, 0.03, -0.3])
def test_a_velocity_that_is_not_made_is_reported_in_the_time_for_it(speed: float) -> None:
    assert set(velocity(lambda time: speed, lambda time: speed * (1.0 - math.exp(-time / LAG)), 4.0)) == {NONE}
    found = velocity(lambda time: speed, lambda time: 0.0, LASTING)
    assert found[-1] is NOT_REACHED
    assert NOT_FOLLOWED in velocity(lambda time: speed, lambda time: 0.5 * speed, 4.0, share=0.5)


@pytest.mark.parametrize(("share", "is_reported"), [(0.92, False), (0.85, True), (1.2, True)])
def test_a_velocity_may_be_off_by_a_tenth(share: float, is_reported: bool) -> None:
    found = velocity(lambda time: 0.1, lambda time: 0.1 * share, 10.0)
    assert (NOT_REACHED in found) is is_reported


def test_a_velocity_that_swings_counts_in_the_mean() -> None:
    found = velocity(lambda time: 0.1 * math.sin(6.0 * time), lambda time: 0.1 * math.sin(6.0 * time - 0.4), 4.0)
    assert set(found) == {NONE}


def test_an_arm_that_drifts_while_it_is_to_be_at_rest_is_reported() -> None:
    assert set(velocity(lambda time: 0.0, lambda time: 0.8 * ALLOWED / LASTING, 10.0)) == {NONE}
    assert NOT_REACHED in velocity(lambda time: 0.0, lambda time: 1.2 * ALLOWED / LASTING, 10.0)


def test_a_push_that_is_over_is_not_reported_for_long() -> None:
    found = velocity(lambda time: 0.02, lambda time: -0.3 if time < 0.1 else 0.02, 3.0)
    assert NOT_REACHED in found
    assert found[round(2.3 / DT)] is NONE


def test_the_reason_has_the_axis_and_the_commanded_and_the_present_value() -> None:
    watch = MotionWatch("velocity of joint 4", "rad")
    for _ in range(400):
        event = watch.velocity(1.2, 0.0, 1.0, 1.0, OWN, DT)
    assert sentence(event).startswith(
        "velocity of joint 4: 1.2 rad/s are commanded, and it moves with 0 rad/s; it has been off by"
    )
    watch = MotionWatch("position of joint 4", "rad")
    for _ in range(400):
        event = watch.position(0.3, 0.0, 0.1, 1.0, (RATE, FASTEST), 1.0, OWN, DT)
    assert sentence(event).startswith(
        "position of joint 4: 0.3 rad is commanded, and it is at 0.1 rad; it has been off by more"
    )
