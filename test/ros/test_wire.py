"""The codec: values survive bit for bit by either path; what is not whole is refused whole, in words."""

import math
import random
import struct
from array import array
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import PointStamped, WrenchStamped
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from wam_description.configuration import Configuration, packaged
from wam_description.defects import defect_finder
from wam_description.event import Level
from wam_description.signals import NodeStatus, Point, State, Table, Wrench
from wam_description.topics import BY_NAME, JOINT_STATE, POINT, TABLE, WRENCH, Topic
from wam_ros.messages import Refused, diagnostic_status, joint_state, message_type, read_status, reader
from wam_ros.ros_topics import header, stamp_of
from wam_ros.wire import decoder, encoder, stamp_in, status_of

SHARED = Configuration.load(packaged("wam")).shared
NAMES = list(SHARED.arm.motors.names)
NUMBERS = [topic for topic in BY_NAME.values() if topic.is_numbers]
ONE_OF_EACH = [next(topic for topic in NUMBERS if topic.type == kind) for kind in (JOINT_STATE, WRENCH, POINT, TABLE)]
ANY = "position? velocity? effort?"
STATE = State([1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0], [-1.0, -2.0, -3.0, -4.0])
STAMP = 12_345_678_901
SEED = 20261120
NAN, INF = math.nan, math.inf


def value_of(topic: Topic, rng: random.Random, absurd: float = 0.0) -> Any:
    """A value with numbers of every size, and `absurd` ones, and arrays that may be empty."""

    def number() -> float:
        return rng.choice([0.0, -0.0, 1e-308, 1e3, rng.uniform(-1.0, 1.0), rng.uniform(-1e3, 1e3), absurd])

    if topic.type == JOINT_STATE:
        arrays = [[number() for _ in range(4)] if rng.random() < 0.7 else [] for _ in range(3)]
        return State(*arrays)
    frame = rng.choice(["base", *SHARED.arm.covers.names])
    x, y, z, a, b, c = (number() for _ in range(6))
    if topic.type == WRENCH:
        return Wrench(frame, (x, y, z), (a, b, c))
    if topic.type == POINT:
        return Point(frame, (rng.choice([x, NAN]), y, z))
    rows = tuple((float(rng.randrange(2)), *(number() for _ in topic.columns[1:])) for _ in range(rng.randrange(4)))
    return Table(frame, rows)


def answer(take: Any, argument: Any) -> str:
    """What a decoder makes of a message: the value, or why it is refused."""
    try:
        return repr(take(argument))
    except Refused as reason:
        return f"refused: {reason}"


def by_objects(topic: Topic, arrays: str) -> Any:
    """The reference: a message object of the middleware, read and checked."""
    read, defect_of = reader(topic, SHARED.arm), defect_finder(topic, SHARED.arm, arrays)

    def take(data: bytes) -> Any:
        value = read(deserialize_message(data, message_type(topic)))
        if defect := defect_of(value):
            raise Refused(defect)
        return value

    return take


@pytest.mark.slow
@pytest.mark.parametrize("topic", NUMBERS, ids=lambda topic: topic.name)
def test_a_value_is_the_same_to_the_bit_by_either_path(topic: Topic) -> None:
    rng = random.Random(SEED)
    encode, decode, reference = encoder(topic, SHARED), decoder(topic, SHARED, ANY), by_objects(topic, ANY)
    for _ in range(200):
        value = value_of(topic, rng)
        data = encode(STAMP, value)
        message = deserialize_message(data, message_type(topic))
        assert stamp_in(data) == stamp_of(message) == STAMP
        for received in (data, bytes(serialize_message(message)), data + bytes(16)):
            assert repr(decode(received)) == repr(value)
        assert repr(reference(data)) == repr(value)


@pytest.mark.parametrize("stamp", [0, 1, 999_999_999, 1_000_000_000, STAMP, 2**31 * 10**9 - 1])
def test_stamps_are_kept_to_the_nanosecond(stamp: int) -> None:
    clock = encoder(BY_NAME["/clock"], SHARED)(stamp, None)
    assert clock == bytes(serialize_message(Clock(clock=header(stamp).stamp)))
    assert stamp_in(encoder(BY_NAME["motor_states"], SHARED)(stamp, STATE)) == stamp


@pytest.mark.slow
@pytest.mark.parametrize("topic", ONE_OF_EACH, ids=lambda topic: topic.name)
def test_a_message_with_one_changed_byte_is_taken_or_refused_alike(topic: Topic) -> None:
    rng = random.Random(SEED)
    arrays = "position velocity effort?"
    decode, reference = decoder(topic, SHARED, arrays), by_objects(topic, arrays)
    refused = 0
    for _ in range(1500):
        data = bytearray(
            encoder(topic, SHARED)(STAMP, value_of(topic, rng, rng.choice([0.0] * 40 + [1e200, -1e13, NAN])))
        )
        data[rng.randrange(12, len(data))] = rng.choice([0, 1, 0x7F, 0x80, 0xF0, 0xFF, rng.randrange(256)])
        found = answer(decode, bytes(data))
        try:
            assert found == answer(reference, bytes(data))
        except AssertionError:
            raise
        except Exception:  # the middleware would not have delivered it
            assert "send one of that type" in found
        refused += found.startswith("refused")
    assert refused > 100


@pytest.mark.parametrize("topic", ONE_OF_EACH, ids=lambda topic: topic.name)
@pytest.mark.parametrize("options", [b"\0\3", b"\x80\0"])
def test_option_bits_of_the_encapsulation_do_not_change_the_value(topic: Topic, options: bytes) -> None:
    """The last two count padding at the end; the others are reserved."""
    value = value_of(topic, random.Random(SEED))
    data = encoder(topic, SHARED)(STAMP, value)
    decode = decoder(topic, SHARED, ANY)
    assert repr(decode(data[:2] + options + data[4:])) == repr(decode(data)) == repr(value)
    assert stamp_in(data[:2] + options + data[4:]) == STAMP


def decoded(topic: str, message: Any, arrays: str = ANY) -> Any:
    return decoder(BY_NAME[topic], SHARED, arrays)(bytes(serialize_message(message)))


@pytest.mark.parametrize("order", [[0, 1, 2, 3], [3, 2, 1, 0], [2, 0, 3, 1]])
def test_values_are_matched_by_name_in_any_order(order: list[int]) -> None:
    turned = joint_state(STAMP, [NAMES[i] for i in order], State(*([values[i] for i in order] for values in STATE)))
    empty = joint_state(STAMP, [NAMES[i] for i in order], State([], [], []))
    assert decoded("motor_states", turned) == STATE
    assert decoded("motor_states", turned, "velocity") == State([], STATE.velocity, [])
    assert decoded("motor_states", empty, "velocity?") == State([], [], [])


def spoilt(**fields: Any) -> JointState:
    message = joint_state(STAMP, NAMES, STATE)
    for name, value in fields.items():
        setattr(message, name, value if name == "name" else array("d", value))
    return message


def wrench(frame: str = "base", force: Any = (1.0, 2.0, 3.0), torque: float = 0.0) -> WrenchStamped:
    message = WrenchStamped(header=header(STAMP, frame))
    message.wrench.force.x, message.wrench.force.y, message.wrench.force.z = force
    message.wrench.torque.z = torque
    return message


def point(x: float, frame: str = "outer_link") -> PointStamped:
    message = PointStamped(header=header(STAMP, frame))
    message.point.x = x
    return message


TASK = BY_NAME["sim/objects"]


def table(**fields: Any) -> PointCloud2:
    message = deserialize_message(
        encoder(TASK, SHARED)(STAMP, Table("base", ((0.0,) * len(TASK.columns),) * 2)), PointCloud2
    )
    for name, value in fields.items():
        setattr(message, name, value)
    return message


def numbers(*first: float) -> Any:
    return array("B", struct.pack(f"<{2 * len(TASK.columns)}d", *first, *[0.0] * (2 * len(TASK.columns) - len(first))))


REFUSED = [
    ("motor_states", spoilt(effort=[0.0, NAN, 0.0, 0.0]), "effort of motor2 is nan; send finite numbers"),
    ("motor_states", spoilt(effort=[0.0, 0.0, 0.0, -INF]), "effort of motor4 is -inf; send finite numbers"),
    ("motor_states", spoilt(velocity=[2.0, -1e200, 0.0, 0.0]), r"velocity of motor2 is -1e\+200; no arm reaches that"),
    ("motor_states", spoilt(effort=[0.0] * 3), f"effort has 3 values; send 4, one for each of {', '.join(NAMES)}"),
    ("motor_states", spoilt(name=NAMES[::-1], effort=[]), "effort has 0 values; send 4"),
    ("motor_states", spoilt(name=[*NAMES[:3], "elbow"]), "unknown name 'elbow'; allowed: motor1, motor2"),
    ("motor_states", spoilt(name=[*NAMES[:3], "motor3"]), "name 'motor3' is given twice; send each of"),
    ("motor_states", spoilt(name=NAMES[:3]), "name 'motor4' is missing; send all of motor1, motor2, motor3, motor4"),
    ("motor_states", spoilt(name=NAMES[::-1], effort=[NAN, 0, 0, 0]), "effort of motor4 is nan"),
    *(
        ("force_command", wrench(force=(0.0, bad, 0.0)), f"{bad}.* N.*; send finite numbers")
        for bad in (NAN, INF, -INF)
    ),
    ("force_command", wrench(torque=NAN), "send finite numbers"),
    ("force_command", wrench(force=(1e10, 0.0, 0.0)), "force has 1e.10 N; no arm reaches that, send at most"),
    *(("force_command", wrench(frame), f"frame_id is '{frame}'; allowed: base, ") for frame in ("", "Base", "/base")),
    ("contact/point", point(0.1, "hand"), "frame_id is 'hand'; allowed: base, "),
    ("contact/point", point(INF), r"position is .*inf.* m; send finite numbers, or NaN where it is not known"),
    ("sim/objects", table(fields=[]), f"fields are none; send little-endian float64 fields {TASK.columns[0]}, "),
    ("sim/objects", table(width=3), "bytes of data; 3 rows need "),
    ("sim/objects", table(data=numbers(0.0, INF)), f"{TASK.columns[1]} is inf; send a finite number"),
    ("sim/objects", table(header=header(STAMP, "hand")), "frame_id is 'hand'; allowed: base"),
]


@pytest.mark.parametrize(("topic", "message", "text"), REFUSED, ids=[f"{row[0]}: {row[2][:30]}" for row in REFUSED])
def test_a_message_that_is_not_whole_is_refused_whole(topic: str, message: Any, text: str) -> None:
    for arrays in ("effort", "position? effort velocity?"):
        with pytest.raises(Refused, match=text):
            decoded(topic, message, arrays)


@pytest.mark.parametrize("data", [b"", b"\0", b"\0\1\0\0", b"\0\1\0\0" + b"\xff" * 40])
def test_what_is_no_message_is_refused(data: bytes) -> None:
    for topic in NUMBERS:
        with pytest.raises(Refused):
            decoder(topic, SHARED, "effort")(data)
        assert isinstance(stamp_in(data), int)


def table_of(topic: str, rows: int) -> bytes:
    row = BY_NAME[topic]
    return encoder(row, SHARED)(STAMP, Table("base", ((0.0,) * len(row.columns),) * rows))


def trajectory_of(points: int, **fields: Any) -> bytes:
    names = list(SHARED.arm.joints.names)
    whole = JointTrajectory(joint_names=names, points=[JointTrajectoryPoint(positions=[0.0] * 4, **fields)] * points)
    return bytes(serialize_message(whole))


LARGE = [
    ("task_command", table_of("task_command", 5), "5 rows; send at most 4"),
    ("joint_trajectory", trajectory_of(501), "501 points; send 1 to 500"),
    ("joint_trajectory", trajectory_of(2, velocities=[NAN] * 4), "point 0: velocity of joint1 is nan"),
    ("joint_states", bytes(serialize_message(JointState(name=["joint1"] * 100_000))), "send at most 262144"),
    ("force_command", bytes(serialize_message(WrenchStamped(header=Header(frame_id="x" * 300_000)))), "262144"),
    ("status", bytes(serialize_message(DiagnosticStatus(values=[KeyValue()] * 2000))), "send at most 16384"),
]


@pytest.mark.parametrize(("topic", "data", "text"), LARGE, ids=[f"{row[0]}, {len(row[1])} bytes" for row in LARGE])
def test_a_message_that_is_too_large_is_refused_before_its_values_are_looked_at(
    topic: str, data: bytes, text: str
) -> None:
    with pytest.raises(Refused, match=text):
        (status_of if topic == "status" else decoder(BY_NAME[topic], SHARED, "position?"))(data)


def test_a_trajectory_that_is_streamed_is_read_once() -> None:
    decode, data = decoder(BY_NAME["joint_trajectory"], SHARED, ""), trajectory_of(3)
    first = decode(data)
    assert decode(data[:4] + b"\1" * 8 + data[12:]) is first
    other = decode(trajectory_of(2))
    assert other != first
    assert decode(data) == first


@pytest.mark.usefixtures("checked_fields")
@pytest.mark.parametrize("status", [
    NodeStatus(Level.WARN, "domain I", "force_loop", connected=True, facts={"margin here": "1", "worst case": ""}),
    NodeStatus(Level.ERROR, "fault: x", "driver", mode="fault", fault="x", stamp=5_000_000),
    NodeStatus(Level.OK, "press", "scenario", step="press", stamp=1),
])  # fmt: skip
def test_a_status_is_the_same_after_a_round_trip(status: NodeStatus) -> None:
    assert status_of(bytes(serialize_message(diagnostic_status(status, "wam")))) == status


def test_a_foreign_status_is_read_without_an_error_and_fit_for_a_terminal() -> None:
    message = DiagnosticStatus(name="x", level=bytes([77]), message="y", values=[KeyValue(key="stamp", value="-3e9")])
    assert read_status(message) == NodeStatus(Level.ERROR, "y", "x")
    message = DiagnosticStatus(name="x\33[2J", message="a\nb", values=[KeyValue(key="fault", value="\33]0;owned\7")])
    status = read_status(message)
    assert all(text.isprintable() for text in (status.node, status.message, status.fault))
