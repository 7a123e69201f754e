"""The way by which an arm gives way to what pushes it is one count, of the point that moves most."""

import numpy as np
import pytest
from arms import WAM

from wam_control.force.given_way import GivenWay
from wam_control.force.thresholds import FORCE
from wam_description.rigid_body import RigidBody

BODY = RigidBody(WAM)
POSE = np.array([0.0, -1.2, 0.0, 1.2])
DT = 0.005
PUSHED = np.array([0.1, 0.0, 0.0, 0.0])  # rad
ELBOW = np.array([0.0, 0.1, 0.0, -0.2])  # rad, that move the elbow further than the tool


def tool_way(begin: np.ndarray, end: np.ndarray) -> float:
    return float(np.linalg.norm(BODY.tool_pose(end).position - BODY.tool_pose(begin).position))


def move(given: GivenWay, begin: np.ndarray, end: np.ndarray, is_pushed: bool, periods: int = 60) -> np.ndarray:
    """Move the joints, with a push or without."""
    for k in range(periods + 1):
        if is_pushed:
            given.give()
        given.step((begin + (end - begin) * k / periods).tolist(), DT)
    return end


def rest(given: GivenWay, at: np.ndarray) -> None:
    """Wait until a push has ended."""
    move(given, at, at, False)


def test_the_way_is_that_of_the_fastest_point() -> None:
    given = GivenWay(BODY)
    move(given, POSE, POSE + PUSHED, True)
    assert given.way == pytest.approx(tool_way(POSE, POSE + PUSHED), rel=1e-6)
    given.restart()
    move(given, POSE, POSE + ELBOW, True)
    elbow = [BODY.point(q, "inner_link", (WAM.covers.length_of("inner_link"), 0.0, 0.0)) for q in (POSE, POSE + ELBOW)]
    assert given.way == pytest.approx(np.linalg.norm(elbow[1] - elbow[0]), rel=1e-6)
    assert given.way > 1.05 * tool_way(POSE, POSE + ELBOW)


def test_along_a_direction_its_way_alone_counts_until_it_counts_in_any() -> None:
    given, along = GivenWay(BODY), np.array([1.0, 0.0, 0.0])
    ends = BODY.tool_pose(POSE).position, BODY.tool_pose(POSE + ELBOW).position
    for k in range(61):
        given.give(along)
        given.step((POSE + ELBOW * k / 60).tolist(), DT)
    covers = zip(WAM.covers.names, WAM.covers.length, strict=True)
    moved = [ends[1] - ends[0]]
    for name, length in covers:
        begin, end = (BODY.point(q, name, (length, 0.0, 0.0)) for q in (POSE, POSE + ELBOW))
        moved.append(end - begin)
    assert given.way == pytest.approx(max(0.0, *(float(one[0]) for one in moved)), rel=1e-6)
    assert given.way < 0.95 * max(float(np.linalg.norm(one)) for one in moved)
    for k in range(2000):
        given.give(along)
        given.give()  # another push at the same time
        given.step((POSE + ELBOW + 0.01 * PUSHED * (-1) ** k).tolist(), DT)
    assert given.way < max(0.0, *(float(one[0]) for one in moved)) + 0.003, "a push that shakes"


def test_a_pause_of_the_push_renews_nothing_and_another_command_does() -> None:
    given, q = GivenWay(BODY), POSE
    for k in range(3):
        q = move(given, q, q + PUSHED, True)
        rest(given, q)
        assert given.way == pytest.approx((k + 1) * tool_way(POSE, POSE + PUSHED), rel=1e-6)
    given.restart()
    rest(given, q)
    assert given.way == 0.0


def test_what_the_arm_moves_by_itself_is_taken_off_and_not_that_on_which_it_runs() -> None:
    given = GivenWay(BODY)
    q = move(given, POSE, POSE + PUSHED, True)
    q = move(given, q, q + 0.2 * PUSHED, False, round(0.5 * FORCE.lasting / DT))
    assert given.way == pytest.approx(tool_way(POSE, q), rel=1e-3), "the arm runs on"
    rest(given, q)
    q = move(given, q, POSE + 0.6 * PUSHED, False)
    assert given.way == pytest.approx(tool_way(POSE, q), rel=1e-2), "it goes back half of the way"
    move(given, q, POSE - PUSHED, False)
    assert given.way == 0.0


def test_bumps_on_the_way_to_and_fro_do_not_add_up() -> None:
    given, q = GivenWay(BODY), POSE
    for _ in range(5):
        q = move(given, q, q + 0.1 * PUSHED, True)
        rest(given, q)
        elsewhere = move(given, q, POSE + 3.0 * PUSHED, False)
        assert given.way == 0.0
        q = move(given, elsewhere, q, False)
        assert given.way == 0.0, "what the arm has moved by itself is not given back"


def test_a_push_that_shakes_the_arm_is_counted_by_where_it_has_moved_it() -> None:
    given = GivenWay(BODY)
    for k in range(2000):
        given.give()
        given.step((POSE + 0.01 * PUSHED * (-1) ** k).tolist(), DT)
    assert given.way < 0.003
