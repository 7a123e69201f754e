"""/tf and /tf_static of a running stack, where tf2_msgs is installed."""

from typing import Any

from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from wam_description.arm import Shared
from wam_description.frames import ArmFrames, FramePlacement
from wam_description.topics import BY_NAME
from wam_live.thresholds import LIVE
from wam_ros.messages import Refused
from wam_ros.ros_topics import NAMESPACE, header, qos
from wam_ros.wire import decoder, stamp_in


class FramesNode(Node):
    """Publishes the frames of the arm at the display rate, with the stamps of `joint_states`.

    An arm in another namespace than `wam` whose frames have no prefix has topics of its own, `tf` and `tf_static` in
    its namespace: its frames have the names of those of the first arm.

    Parameters
    ----------
    context, namespace : of ROS.
    shared : shared parameters of the driver.
    prefix : put before every frame, as 'left/'.
    """

    def __init__(self, context: Any, namespace: str, shared: Shared, prefix: str) -> None:
        super().__init__("frames", context=context, namespace=namespace)
        self._frames = ArmFrames(shared.arm, prefix)
        self._decode = decoder(BY_NAME["joint_states"], shared, "position")
        self._period = shared.timing.outer_period_ns * shared.timing.display_divisor
        self._last = -self._period
        place = "/" if prefix or namespace.strip("/") == NAMESPACE else ""
        self._moving = self.create_publisher(TFMessage, f"{place}tf", QoSProfile(depth=LIVE.depth))
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._fixed = self.create_publisher(TFMessage, f"{place}tf_static", latched)
        self._fixed.publish(TFMessage(transforms=[_message(one, 0) for one in self._frames.fixed]))
        self.create_subscription(JointState, "joint_states", self._take, qos(BY_NAME["joint_states"]), raw=True)

    def _take(self, data: bytes) -> None:
        stamp = stamp_in(data)
        if 0 <= stamp - self._last < self._period:
            return
        try:
            q = self._decode(data).position
        except Refused as refusal:
            self.get_logger().warning(f"joint_states: {refusal}", throttle_duration_sec=5.0)
            return
        self._last = stamp
        self._moving.publish(TFMessage(transforms=[_message(one, stamp) for one in self._frames.moving(q)]))


def _message(frame: FramePlacement, stamp: int) -> TransformStamped:
    message = TransformStamped(header=header(stamp, frame.parent), child_frame_id=frame.child)
    place, turn = message.transform.translation, message.transform.rotation
    place.x, place.y, place.z = frame.translation
    turn.x, turn.y, turn.z, turn.w = frame.quaternion
    return message
