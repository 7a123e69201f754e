"""A topic of the interface table as ROS has it: name, quality of service, header."""

from typing import Any

from builtin_interfaces.msg import Time
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Header

from wam_description.arm import Timing
from wam_description.topics import DEPTH, Topic
from wam_ros.limits import NODE_LIMITS

NAMESPACE = "wam"  # of the nodes, unless remapped with -r __ns:=/other
DIAGNOSTICS = "/diagnostics"
CLOCK = "/clock"
SECOND = 1_000_000_000  # ns


def topic_name(node: Node, topic: Topic) -> str:
    """The name of a topic at a node: two arms have two clocks, and tools know only one as /clock.

    It is that of the arm in the default namespace; another arm's is 'clock' in its own.
    """
    if topic.name == CLOCK and node.get_namespace() != f"/{NAMESPACE}":
        return CLOCK.strip("/")
    return topic.name


def qos(topic: Topic) -> QoSProfile:
    """Reliable, keep last, as ROS does by default; latched topics keep one message for late subscribers."""
    durability = DurabilityPolicy.TRANSIENT_LOCAL if topic.latched else DurabilityPolicy.VOLATILE
    return QoSProfile(depth=topic.depth, durability=durability)


def listening(topic: Topic) -> QoSProfile:
    """`qos` of a subscription: a latched topic may have many publishers, each with a message of its own."""
    profile = qos(topic)
    profile.depth = DEPTH
    return profile


def waiting(timing: Timing) -> int:
    """How many messages of a topic wait for a node: in realtime, a late one works on the newest state."""
    return NODE_LIMITS.newest_kept if timing.mode == "realtime" else DEPTH


def header(stamp: int, frame: str = "") -> Header:
    """Header with a stamp in nanoseconds."""
    return Header(stamp=Time(sec=stamp // SECOND, nanosec=stamp % SECOND), frame_id=frame)


def stamp_of(message: Any) -> int:
    """Stamp of a message with a header, ns."""
    time = message.header.stamp
    return int(time.sec * SECOND + time.nanosec)
