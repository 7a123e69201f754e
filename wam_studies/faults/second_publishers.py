"""Second publishers: false commands and feedback with right stamps, another type, and old bags replayed."""

import struct
from functools import partial
from pathlib import Path
from random import Random
from typing import Final

from rclpy._rclpy_pybind11 import RCLError
from rclpy.publisher import Publisher
from rclpy.serialization import serialize_message
from std_msgs.msg import Int64, String

from wam_bag.bag import raw
from wam_bag.cdr import LITTLE_ENDIAN
from wam_ros.topics import NAMESPACE, qos
from wam_ros.wire import stamp_of
from wam_studies.faults.message_faults import EFFECTIVE, SECOND, made_effective, set_stamp
from wam_studies.faults.trials import FAULTS, KEPT, FaultCase, FaultTrial
from wam_studies.faults.watched_stack import WatchedStack, watched_trial

WALL_CLOCK: Final = 1_790_000_000 * SECOND
STAMPS: Final = ("as recorded", "from now on", "of the wall clock")
GUARDED: Final = tuple(topic for topic in EFFECTIVE if topic != "sim/disturbance")  # a second publisher is a fault


def play(case: FaultCase) -> FaultTrial:
    """A trial with a second publisher: topics that a node takes, in turn, with messages of their type or another."""
    topics = KEPT.ready(WatchedStack, case.configuration).taken_topics()
    topic, is_other_type = topics[case.number % len(topics)], case.number // len(topics) % 3 == 2
    name = f"{topic}, {'another type' if is_other_type else 'second publisher'}"
    return watched_trial(case, name, partial(_other_type if is_other_type else _stream, topic))


def replay(case: FaultCase) -> FaultTrial:
    """A trial with a bag replayed onto the topics of an enabled arm: one topic, or all commands, or all feedback."""
    index = case.number
    recorded = {name.removeprefix(f"/{NAMESPACE}/"): found.data for name, found in raw(Path(case.bag)).items()}
    topics = KEPT.ready(WatchedStack, case.configuration).taken_topics()
    known = [topic for topic in topics if recorded.get(topic)]
    commands = [topic for topic in known if "command" in topic]
    feedback = [topic for topic in known if topic in ("motor_states", "joint_states", "joint_sensors")]
    alone = Random(f"replays {case.seed} {index}").choice(known)
    chosen = [commands, feedback, known][index % 3] if index % 2 else [alone]
    stamps = STAMPS[index // 2 % len(STAMPS)]
    what = chosen[0] if len(chosen) == 1 else f"{len(chosen)} topics"
    work = partial(_replay, {topic: recorded[topic] for topic in chosen}, stamps)
    return watched_trial(case, f"{what} replayed, stamps {stamps}", work)


def _stream(topic: str, stack: WatchedStack) -> int:
    """Answer every period with a false message that has the right stamp."""
    publisher = stack.foreign_publisher(topic)
    try:
        end = stack.stamp() + int(FAULTS.streamed * SECOND)
        while stack.stamp() < end and not stack.driver.safety.fault:
            message = stack.newest(topic)
            made_effective(topic, message, stack.cover)
            set_stamp(message, stack.stamp())
            stack.inject(publisher, serialize_message(message))
            stack.run(0.001)
        stack.run(FAULTS.after_publishers)
        if topic in GUARDED and not any(event.values.get("topic") == topic for event in stack.driver.safety.events):
            stack.escapes.append(f"no fault names {topic}: '{stack.driver.safety.fault}'")
    finally:
        stack.node.destroy_publisher(publisher)
    return 1


def _other_type(topic: str, stack: WatchedStack) -> int:
    """Publish messages of another type under the topic's name."""
    kind = Int64 if stack.type_of(topic) is String else String
    try:
        publisher = stack.node.create_publisher(kind, topic, qos(stack.topics[topic]))
    except RCLError:  # the middleware allows one type for each name among the nodes of one process
        return 1
    for _ in range(20):
        publisher.publish(kind())
        stack.run(0.002)
    stack.node.destroy_publisher(publisher)
    return 1


def _replay(messages: dict[str, list[bytes]], stamps: str, stack: WatchedStack) -> int:
    publishers: dict[str, Publisher] = {topic: stack.foreign_publisher(topic) for topic in messages}
    begin = stack.stamp()
    first = min(stamp_of(data[0]) for data in messages.values())
    for i in range(FAULTS.replayed):
        for topic, data in messages.items():
            if i < len(data):
                stack.inject(publishers[topic], _stamped(data[i], stamps, begin - first))
        stack.run(0.001)
    for publisher in publishers.values():
        stack.node.destroy_publisher(publisher)
    stack.run(FAULTS.after_publishers)
    return 1


def _stamped(data: bytes, stamps: str, offset: int) -> bytes:
    """A recorded message with other stamps."""
    if stamps == "as recorded" or data[:4] != LITTLE_ENDIAN or len(data) < 12:
        return data
    stamp = stamp_of(data) + (offset if stamps == "from now on" else WALL_CLOCK)
    return data[:4] + struct.pack("<iI", *divmod(stamp, SECOND)) + data[12:]
