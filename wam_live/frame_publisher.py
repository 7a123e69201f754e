"""/tf and /tf_static of a running stack, where tf2_msgs is installed."""

from geometry_msgs.msg import TransformStamped
from rclpy.qos import DurabilityPolicy, QoSProfile
from tf2_msgs.msg import TFMessage

from wam_description.frames import ArmFrames, FramePlacement
from wam_description.signals import State
from wam_live.thresholds import LIVE
from wam_ros.client import StackClient
from wam_ros.ros_topics import NAMESPACE, header
from wam_ros.run import Closing


class FramePublisher(Closing):
    """Publishes the frames of the arm at the display rate, with the stamps of `joint_states`.

    An arm in another namespace than `wam` whose frames have no prefix has topics of its own, `tf` and `tf_static` in
    its namespace: its frames have the names of those of the first arm.

    Parameters
    ----------
    client : of the stack, with its shared parameters.
    prefix : put before every frame, as 'left/'.
    """

    def __init__(self, client: StackClient, prefix: str) -> None:
        node, timing = client.node, client.shared.timing
        self._frames = ArmFrames(client.shared.arm, prefix)
        self._period = timing.outer_period_ns * timing.display_divisor
        self._last = -self._period
        place = "/" if prefix or node.get_namespace().strip("/") == NAMESPACE else ""
        self._moving = node.create_publisher(TFMessage, f"{place}tf", QoSProfile(depth=LIVE.depth))
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        fixed = node.create_publisher(TFMessage, f"{place}tf_static", latched)
        fixed.publish(TFMessage(transforms=[_message(one, 0) for one in self._frames.fixed]))
        warn = node.get_logger().warning
        client.listen(
            "joint_states", self._take, "position",
            lambda reason: warn(f"joint_states: {reason}", throttle_duration_sec=5.0),
        )  # fmt: skip

    def _take(self, stamp: int, joints: State) -> None:
        if not 0 <= stamp - self._last < self._period:
            self._last = stamp
            moving = self._frames.moving(joints.position)
            self._moving.publish(TFMessage(transforms=[_message(one, stamp) for one in moving]))


def _message(frame: FramePlacement, stamp: int) -> TransformStamped:
    message = TransformStamped(header=header(stamp, frame.parent), child_frame_id=frame.child)
    place, turn = message.transform.translation, message.transform.rotation
    place.x, place.y, place.z = frame.translation
    turn.x, turn.y, turn.z, turn.w = frame.quaternion
    return message
