"""Second publishers: false commands and feedback with right stamps, and another type."""

from functools import partial
from typing import Final

from rclpy._rclpy_pybind11 import RCLError
from rclpy.serialization import serialize_message
from std_msgs.msg import Int64, String

from wam_ros.topics import qos
from wam_studies.faults.message_faults import EFFECTIVE, SECOND, made_effective, set_stamp
from wam_studies.faults.trials import FAULTS, KEPT, FaultCase, FaultTrial
from wam_studies.faults.watched_stack import WatchedStack, watched_trial

GUARDED: Final = tuple(topic for topic in EFFECTIVE if topic != "sim/disturbance")  # a second publisher is a fault


def play(case: FaultCase) -> FaultTrial:
    """A trial with a second publisher: topics that a node takes, in turn, with messages of their type or another."""
    topics = KEPT.ready(WatchedStack, case.configuration).taken_topics()
    topic, is_other_type = topics[case.number % len(topics)], case.number // len(topics) % 3 == 2
    name = f"{topic}, {'another type' if is_other_type else 'second publisher'}"
    return watched_trial(case, name, partial(_other_type if is_other_type else _stream, topic))


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
