"""Messages in and out: matched by name, refused whole, the same after a round trip."""

import math
import struct
from array import array
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import PointStamped, WrenchStamped
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState, PointCloud2

from wam_description.event import Level
from wam_description.signals import NodeStatus, Point, State, Table, Wrench
from wam_ros.messages import (
    Refused,
    diagnostic_status,
    joint_state,
    point_stamped,
    read_joint_state,
    read_point,
    read_status,
    read_table,
    read_wrench,
    table,
    wrench_stamped,
)
from wam_ros.topics import header, stamp_of

NAMES = ["motor1", "motor2", "motor3", "motor4"]
FRAMES = ("base", "inner_link", "outer_link")
ALL = "position velocity effort"
STATE = State([1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0], [-1.0, -2.0, -3.0, -4.0])
STAMP = 1_234_567_890_123
pytestmark = pytest.mark.usefixtures("checked_fields")


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
        (spoilt(name=["motor1", "motor2", "motor3", "motor3"]), "name 'motor3' is there twice; send each of"),
        (spoilt(name=[*NAMES, "motor1"]), "name 'motor1' is there twice"),
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
    assert type(point_stamped(STAMP, Point("base", (np.int64(2), 0, 0))).point.x) is float


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
        read_point(point_stamped(STAMP, Point(frame, (0.1, 0.0, 0.0))), FRAMES)


def test_a_position_may_be_unknown_but_not_infinite() -> None:
    point = Point("outer_link", (0.28, 0.0, 0.0))
    assert (
        read_point(deserialize_message(serialize_message(point_stamped(STAMP, point)), PointStamped), FRAMES) == point
    )
    unknown = point_stamped(STAMP, Point("outer_link", (math.nan, 0.0, 0.0)))
    assert math.isnan(read_point(unknown, FRAMES).position[0])
    with pytest.raises(Refused, match=r"position is .*inf.* m; send finite numbers, or NaN where it is not known"):
        read_point(point_stamped(STAMP, Point("outer_link", (math.inf, 0.0, 0.0))), FRAMES)


COLUMNS = ("link", "probability", "position")
ROWS = Table("outer_link", ((1.0, 0.75, 0.1 + 0.2), (0.0, 0.25, math.inf - math.inf)))


def test_a_table_is_the_same_to_the_bit_after_a_round_trip() -> None:
    for rows in (ROWS, Table("base", ())):
        message = deserialize_message(serialize_message(table(STAMP, COLUMNS, rows)), PointCloud2)
        assert repr(read_table(message, COLUMNS, FRAMES)) == repr(rows)
        assert stamp_of(message) == STAMP


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"fields": []}, "fields are none; send little-endian float64 fields link, probability, position"),
        ({"is_bigendian": True}, "send little-endian float64 fields"),
        ({"width": 3}, "48 bytes of data; 3 rows need 24 bytes each"),
        ({"point_step": 8}, "48 bytes of data"),
        ({"data": array("B", struct.pack("<6d", 1, 1, math.inf, 0, 0, 0))}, "a number is infinite"),
        ({"header": header(STAMP, "hand")}, "frame_id is 'hand'; allowed are base"),
    ],
)
def test_a_table_that_is_not_whole_is_refused(change: dict[str, Any], text: str) -> None:
    message = table(STAMP, COLUMNS, ROWS)
    for name, value in change.items():
        setattr(message, name, value)
    with pytest.raises(Refused, match=text):
        read_table(message, COLUMNS, FRAMES)


def test_a_status_is_the_same_after_a_round_trip() -> None:
    facts = {"gain factor": "1", "worst": ""}
    for status in (
        NodeStatus(Level.WARN, "domain I", "force_loop", connected=True, facts=facts),
        NodeStatus(Level.ERROR, "fault: x", "driver", mode="fault", fault="x", stamp=5_000_000),
        NodeStatus(Level.OK, "press", "scenario", step="press", stamp=1),
    ):
        wire = serialize_message(diagnostic_status(status, "wam"))
        assert read_status(deserialize_message(wire, DiagnosticStatus)) == status


def test_a_foreign_status_is_read_without_an_error() -> None:
    message = DiagnosticStatus(name="x", level=bytes([77]), message="y", values=[KeyValue(key="stamp", value="-3e9")])
    assert read_status(message) == NodeStatus(Level.ERROR, "y", "x")
