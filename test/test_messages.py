"""Messages in and out: matched by name, refused whole, the same after a round trip."""

import math
import sys
from array import array
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PointStamped, WrenchStamped
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from wam_description.signals import NO_CONTACT, Contact, State
from wam_ros.messages import (
    Refused,
    Wrench,
    contact_of,
    header,
    joint_state,
    point_stamped,
    read_contact,
    read_joint_state,
    read_wrench,
    stamp_of,
    wrench_stamped,
)

NAMES = ["motor1", "motor2", "motor3", "motor4"]
FRAMES = ("base", "inner_link", "outer_link")
ALL = "position velocity effort"
STATE = State([1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0], [-1.0, -2.0, -3.0, -4.0])
STAMP = 1_234_567_890_123


@pytest.fixture(autouse=True)
def checked_fields(monkeypatch: pytest.MonkeyPatch) -> None:
    """What ROS_PYTHON_CHECK_FIELDS=1 does: a field of a wrong type fails."""
    for name, module in list(sys.modules.items()):
        if ".msg._" in name and hasattr(module, "ros_python_check_fields"):
            monkeypatch.setattr(module, "ros_python_check_fields", "1")


def test_fields_are_checked_in_these_tests() -> None:
    with pytest.raises(AssertionError):
        DiagnosticStatus(name=1)


def test_joint_states_survive_the_wire() -> None:
    message = deserialize_message(serialize_message(joint_state(STAMP, NAMES, STATE)), JointState)
    assert read_joint_state(message, NAMES, ALL) == STATE
    assert stamp_of(message) == STAMP


@pytest.mark.parametrize("stamp", [0, 1, 999_999_999, 1_000_000_000, 2**31 * 1_000_000_000 - 1])
def test_stamps_are_kept_to_the_nanosecond(stamp: int) -> None:
    assert stamp_of(JointState(header=header(stamp))) == stamp


@pytest.mark.parametrize("order", [[0, 1, 2, 3], [3, 2, 1, 0], [2, 0, 3, 1]])
def test_values_are_matched_by_name_in_any_order(order: list[int]) -> None:
    turned = State(*([values[i] for i in order] for values in STATE))
    message = joint_state(STAMP, [NAMES[i] for i in order], turned)
    assert read_joint_state(message, NAMES, ALL) == STATE


def test_only_what_was_asked_for_comes_back() -> None:
    message = joint_state(STAMP, NAMES, STATE)
    assert read_joint_state(message, NAMES, "velocity") == State([], STATE.velocity, [])
    assert read_joint_state(message, NAMES, "velocity?") == State([], STATE.velocity, [])


def test_an_empty_array_is_allowed_where_it_means_something() -> None:
    empty = joint_state(STAMP, NAMES, State([], [], []))
    assert read_joint_state(empty, NAMES, "velocity?") == State([], [], [])
    turned = joint_state(STAMP, NAMES[::-1], State([], [], []))
    assert read_joint_state(turned, NAMES, "velocity?") == State([], [], [])
    with pytest.raises(Refused, match="velocity has 0 values; send 4, one for each of motor1, motor2, motor3, motor4"):
        read_joint_state(empty, NAMES, "velocity")


def spoilt(**fields: Any) -> JointState:
    message = joint_state(STAMP, NAMES, STATE)
    for name, value in fields.items():
        setattr(message, name, value if name == "name" else array("d", value))
    return message


@pytest.mark.parametrize(
    ("message", "text"),
    [
        (spoilt(effort=[0.0, math.nan, 0.0, 0.0]), "effort of motor2 is nan; send finite numbers"),
        (spoilt(effort=[0.0, 0.0, 0.0, math.inf]), "effort of motor4 is inf; send finite numbers"),
        (spoilt(effort=[-math.inf, 0.0, 0.0, 0.0]), "effort of motor1 is -inf; send finite numbers"),
        (spoilt(effort=[0.0] * 3), "effort has 3 values; send 4, one for each of motor1, motor2, motor3, motor4"),
        (spoilt(effort=[0.0] * 5), "effort has 5 values; send 4"),
        (spoilt(effort=[]), "effort has 0 values; send 4"),
        (spoilt(name=["motor1", "motor2", "motor3", "elbow"]), "unknown name 'elbow'; allowed are motor1, motor2"),
        (spoilt(name=["motor1", "motor2", "motor3", "motor3"]), "name 'motor3' stands there twice; send each of"),
        (spoilt(name=[*NAMES, "motor1"]), "name 'motor1' stands there twice"),
        (spoilt(name=NAMES[:3]), "name 'motor4' is missing; send all of motor1, motor2, motor3, motor4"),
        (spoilt(name=[]), "name 'motor1' is missing"),
        (spoilt(name=["motor4", "motor3", "motor2", "motor1"], effort=[math.nan, 0, 0, 0]), "effort of motor4 is nan"),
        (spoilt(position=[math.nan] * 4), "position of motor1 is nan"),
        (spoilt(velocity=[1.0]), "velocity has 1 values; send 4"),
    ],
)
def test_a_joint_state_that_is_not_whole_is_refused_whole(message: JointState, text: str) -> None:
    for fields in ("effort", "effort velocity?"):
        with pytest.raises(Refused, match=text):
            read_joint_state(message, NAMES, fields)
    assert read_joint_state(spoilt(), NAMES, "effort").effort == STATE.effort


WRENCH = Wrench("outer_link", (1.0, -2.0, 3.0), (0.1, 0.2, -0.3))


def test_wrenches_survive_the_wire() -> None:
    message = deserialize_message(serialize_message(wrench_stamped(STAMP, WRENCH)), WrenchStamped)
    assert read_wrench(message, FRAMES) == WRENCH
    assert stamp_of(message) == STAMP


def test_numbers_of_other_types_become_floats() -> None:
    force = np.array([1, 2, 3])
    message = wrench_stamped(STAMP, Wrench("base", tuple(force), tuple(np.float32([0.5, 0.25, 0.0]))))
    assert read_wrench(message, FRAMES) == Wrench("base", (1.0, 2.0, 3.0), (0.5, 0.25, 0.0))
    assert type(point_stamped(STAMP, "base", np.array([2, 0, 0])).point.x) is float


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", range(6))
def test_a_wrench_that_is_not_finite_is_refused(bad: float, place: int) -> None:
    numbers = [0.0] * 6
    numbers[place] = bad
    wrench = Wrench("base", tuple(numbers[:3]), tuple(numbers[3:]))
    with pytest.raises(Refused, match=f"{bad}.* N.*; send finite numbers"):
        read_wrench(wrench_stamped(STAMP, wrench), FRAMES)


@pytest.mark.parametrize("frame", ["", "hand", "Base", "/base"])
def test_an_unknown_frame_is_refused(frame: str) -> None:
    text = f"frame_id is '{frame}'; allowed are base, inner_link, outer_link"
    with pytest.raises(Refused, match=text):
        read_wrench(wrench_stamped(STAMP, WRENCH._replace(frame=frame)), FRAMES)
    with pytest.raises(Refused, match=text):
        read_contact(point_stamped(STAMP, frame, (0.1, 0.0, 0.0)), FRAMES)


def test_a_place_may_be_unknown_but_not_infinite() -> None:
    wire = serialize_message(point_stamped(STAMP, "outer_link", (0.28, 0.0, 0.0)))
    assert read_contact(deserialize_message(wire, PointStamped), FRAMES) == 0.28
    assert math.isnan(read_contact(point_stamped(STAMP, "outer_link", (math.nan, 0.0, 0.0)), FRAMES))
    with pytest.raises(Refused, match="place is inf m; send a finite number, or NaN where it is not known"):
        read_contact(point_stamped(STAMP, "outer_link", (math.inf, 0.0, 0.0)), FRAMES)


def test_a_contact_needs_both_a_wrench_and_a_place() -> None:
    assert contact_of(WRENCH, 0.28) == Contact("outer_link", 0.28, (1.0, -2.0, 3.0))
    for wrench, place in ((None, 0.28), (WRENCH, None), (WRENCH._replace(frame="base"), 0.28)):
        assert contact_of(wrench, place) is NO_CONTACT
