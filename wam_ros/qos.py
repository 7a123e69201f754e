"""Quality of service, from the interface table."""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from wam_description.topics import Topic

DEPTH = 1000  # a second of the inner loop: a late reader loses nothing until then


def qos(topic: Topic) -> QoSProfile:
    """Reliable, keep last; latched topics keep one message for late subscribers."""
    return QoSProfile(
        reliability=ReliabilityPolicy.RELIABLE,
        history=HistoryPolicy.KEEP_LAST,
        depth=1 if topic.latched else DEPTH,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if topic.latched else DurabilityPolicy.VOLATILE,
    )
