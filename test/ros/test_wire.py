"""The fast path between bytes and values is the reference path through message objects, only faster."""

import math
import random
import struct
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import WrenchStamped
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from wam_description.configuration import Configuration, packaged
from wam_description.signals import Point, State, Table, Wrench
from wam_description.topics import BY_NAME, JOINT_STATE, POINT, TABLE, WRENCH, Topic
from wam_ros.messages import Refused, message_type, read_status, reader, writer
from wam_ros.wire import decoder, encoder, stamp_of

SHARED = Configuration.load(packaged("wam")).shared
NUMBERS = [topic for topic in BY_NAME.values() if topic.is_numbers]
STAMP = 12_345_678_901
SEED = 20261120


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
        return Point(frame, (rng.choice([x, math.nan]), y, z))
    rows = tuple((float(rng.randrange(2)), *(number() for _ in topic.columns[1:])) for _ in range(rng.randrange(4)))
    return Table(frame, rows)


@pytest.mark.slow
@pytest.mark.parametrize("topic", NUMBERS, ids=lambda topic: topic.name)
def test_a_value_is_the_same_to_the_bit_by_either_way(topic: Topic) -> None:
    rng = random.Random(SEED)
    encode, decode = encoder(topic, SHARED), decoder(topic, SHARED, "position? velocity? effort?")
    write, read = writer(topic, SHARED), reader(topic, SHARED, "position? velocity? effort?")
    kind = message_type(topic)
    for _ in range(200):
        value = value_of(topic, rng)
        data, reference = encode(STAMP, value), bytes(serialize_message(write(STAMP, value)))
        assert stamp_of(data) == stamp_of(reference) == STAMP
        assert deserialize_message(data, kind) == deserialize_message(reference, kind) or "nan" in repr(value)
        for received in (data, reference, data + bytes(16)):
            assert repr(decode(received)) == repr(value)
        assert repr(read(deserialize_message(data, kind))) == repr(value)


@pytest.mark.parametrize("stamp", [0, 1, STAMP, 2**31 * 10**9 - 1])
def test_the_clock_is_the_same_to_the_bit_by_either_way(stamp: int) -> None:
    topic = BY_NAME["/clock"]
    assert encoder(topic, SHARED)(stamp, None) == bytes(serialize_message(writer(topic, SHARED)(stamp, None)))


def refusal(take: Any, argument: Any) -> str:
    try:
        return f"taken: {take(argument)!r}"
    except Refused as reason:
        return str(reason)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [JOINT_STATE, WRENCH, POINT, TABLE])
def test_a_message_with_one_changed_byte_is_taken_or_refused_alike(kind: str) -> None:
    """Names, frames, counts, sizes, columns, byte order, numbers that are not finite: every byte is one of these."""
    rng = random.Random(SEED)
    topic = next(topic for topic in NUMBERS if topic.type == kind)
    arrays = "position velocity effort?"
    encode, decode, read = encoder(topic, SHARED), decoder(topic, SHARED, arrays), reader(topic, SHARED, arrays)
    refused = 0
    for _ in range(1500):
        value = value_of(topic, rng, rng.choice([0.0] * 40 + [1e200, -1e13, math.nan]))
        data = bytearray(encode(STAMP, value))
        data[rng.randrange(12, len(data))] = rng.choice([0, 1, 0x7F, 0x80, 0xF0, 0xFF, rng.randrange(256)])
        try:
            message = deserialize_message(bytes(data), message_type(topic))
        except Exception:  # the middleware would not have delivered it
            assert "send one of that type" in refusal(decode, bytes(data))
            refused += 1
            continue
        fast = refusal(decode, bytes(data))
        assert fast == refusal(read, message)
        refused += not fast.startswith("taken")
    assert refused > 100


def test_numbers_that_are_not_finite_are_refused_by_name() -> None:
    topic = BY_NAME["motor_states"]
    decode = decoder(topic, SHARED, "position velocity effort")
    data = encoder(topic, SHARED)(STAMP, State([1.0] * 4, [2.0] * 4, [3.0] * 4))
    wrong = data.replace(struct.pack("<d", 2.0), struct.pack("<d", math.nan), 1)
    with pytest.raises(Refused, match="velocity of motor1 is nan"):
        decode(wrong)


ABSURD = {
    JOINT_STATE: State([1.0] * 4, [2.0, -1e200, 0.0, 0.0], [3.0] * 4),
    WRENCH: Wrench("base", (1.0, 2.0, 1e10), (0.0, 0.0, 0.0)),
    POINT: Point("base", (1e200, math.nan, math.nan)),
}


@pytest.mark.parametrize("topic", NUMBERS, ids=lambda topic: topic.name)
def test_a_number_that_no_arm_reaches_is_refused_by_either_way(topic: Topic) -> None:
    row = (0.0, 1.0, 1e200, *[0.0] * (len(topic.columns) - 3))
    data = encoder(topic, SHARED)(STAMP, ABSURD.get(topic.type, Table("base", (row,))))
    decode, read = decoder(topic, SHARED, "position velocity effort"), reader(topic, SHARED, "position velocity effort")
    said = refusal(decode, data)
    assert said == refusal(read, deserialize_message(data, message_type(topic)))
    assert "no arm reaches that, send at most" in said


@pytest.mark.parametrize("data", [b"", b"\0", b"\0\1\0\0", b"\0\1\0\0" + b"\xff" * 40])
def test_what_is_no_message_is_refused(data: bytes) -> None:
    for topic in NUMBERS:
        with pytest.raises(Refused):
            decoder(topic, SHARED, "effort")(data)
        assert isinstance(stamp_of(data), int)


@pytest.mark.parametrize("topic", [next(t for t in NUMBERS if t.type == kind) for kind in (JOINT_STATE, WRENCH, TABLE)])
@pytest.mark.parametrize("options", [b"\0\3", b"\x80\0"])
def test_option_bits_of_the_encapsulation_do_not_change_the_value(topic: Topic, options: bytes) -> None:
    """The last two count padding at the end; the others are reserved."""
    value = value_of(topic, random.Random(SEED))
    data = encoder(topic, SHARED)(STAMP, value)
    decode = decoder(topic, SHARED, "position? velocity? effort?")
    assert repr(decode(data[:2] + options + data[4:])) == repr(decode(data)) == repr(value)
    assert stamp_of(data[:2] + options + data[4:]) == STAMP


def table_of(topic: str, rows: int) -> bytes:
    row = BY_NAME[topic]
    return encoder(row, SHARED)(STAMP, Table("base", ((0.0,) * len(row.columns),) * rows))


def trajectory_of(points: int) -> bytes:
    names = list(SHARED.arm.joints.names)
    whole = JointTrajectory(joint_names=names, points=[JointTrajectoryPoint(positions=[0.0] * 4)] * points)
    return bytes(serialize_message(whole))


LARGE = [
    ("task_command", table_of("task_command", 5), "5 rows; send at most 4"),
    ("task_command", table_of("task_command", 100_000), "send at most 262144"),
    ("contact/hypotheses", table_of("contact/hypotheses", 257), "257 rows; send at most 256"),
    ("joint_trajectory", trajectory_of(501), "501 points; send 1 to 500"),
    ("joint_trajectory", trajectory_of(100_000), "send at most 262144"),
    ("joint_states", bytes(serialize_message(JointState(name=["joint1"] * 100_000))), "send at most 262144"),
    ("force_command", bytes(serialize_message(WrenchStamped(header=Header(frame_id="x" * 300_000)))), "262144"),
]


@pytest.mark.parametrize(("topic", "data", "text"), LARGE, ids=[f"{row[0]}, {len(row[1])} bytes" for row in LARGE])
def test_a_message_that_is_too_large_is_refused_before_its_values_are_looked_at(
    topic: str, data: bytes, text: str
) -> None:
    with pytest.raises(Refused, match=text):
        decoder(BY_NAME[topic], SHARED, "position?")(data)


def test_a_trajectory_that_is_streamed_is_read_once() -> None:
    decode, data = decoder(BY_NAME["joint_trajectory"], SHARED, ""), trajectory_of(3)
    first = decode(data)
    assert decode(data[:4] + b"\1" * 8 + data[12:]) is first
    other = decode(trajectory_of(2))
    assert other != first
    assert decode(data) == first


def test_a_status_is_fit_for_a_terminal() -> None:
    message = DiagnosticStatus(name="x\33[2J", message="a\nb", values=[KeyValue(key="fault", value="\33]0;owned\7")])
    status = read_status(message)
    assert all(text.isprintable() for text in (status.node, status.message, status.fault))
