"""Node `gravity`: the joint torques that carry the links."""

from typing import Any

from rclpy.node import Node

from wam_description.parameters import Nothing
from wam_description.rigid_body import RigidBody
from wam_description.signals import State
from wam_ros.lockstep import Gate
from wam_ros.messages import read_joint_state
from wam_ros.parameters import declare
from wam_ros.ports import Ports
from wam_ros.run import run

PARAMETERS = Nothing


class GravityNode(Node):
    """Answers each joint state with the torque that holds the arm there."""

    def __init__(self, **ros: Any) -> None:
        super().__init__("gravity", **ros)
        shared, _ = declare(self, PARAMETERS)
        self._body = RigidBody(shared.arm)
        self._ports = Ports(self, shared)
        joints = list(shared.arm.joints.names)
        gate = Gate(shared.timing, "joint_states", {})
        self._ports.feed(gate, "joint_states", lambda m: read_joint_state(m, joints, "position"), self._work)

    def _work(self, stamp: int, inputs: dict[str, Any]) -> None:
        effort = self._body.gravity_torque(inputs["joint_states"].position).tolist()
        self._ports.publish_joints("gravity_effort", stamp, State([], [], effort))
        self._ports.report(stamp)


def main() -> None:
    """Run the node as this process."""
    run(GravityNode)


if __name__ == "__main__":
    main()
