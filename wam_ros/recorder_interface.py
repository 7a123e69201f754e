"""What the recorder takes: every topic; it publishes nothing but its status and diagnostics."""


class RecorderInterface:
    """Node `recorder`."""

    name = "recorder"
    parameters = "wam_ros.recorder_node:RecorderParameters"
    ros_node = "wam_ros.recorder_node:RecorderNode"
    sources: tuple[str, ...] = ()
