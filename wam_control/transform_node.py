"""Node `transform`: motor space to joint space and back."""

from typing import Any

from rclpy.node import Node

from wam_control.transform import Transform
from wam_description.parameters import Nothing
from wam_description.signals import State
from wam_ros.lockstep import Gate, Need
from wam_ros.messages import read_joint_state
from wam_ros.parameters import declare
from wam_ros.ports import Ports
from wam_ros.run import run

PARAMETERS = Nothing


class TransformNode(Node):
    """Converts each message as it comes and hands its stamp on."""

    def __init__(self, **ros: Any) -> None:
        super().__init__("transform", **ros)
        shared, _ = declare(self, PARAMETERS)
        self._transform = Transform(shared.arm)
        self._ports = Ports(self, shared)
        self._timing = shared.timing
        motors, joints = list(shared.arm.motors.names), list(shared.arm.joints.names)
        self._none = [0.0] * len(joints)
        effort = {"joint_effort_command": Need(outer=True, streamed=self._ports.streamed("force_loop"))}
        feed = self._ports.feed
        states = Gate(self._timing, "motor_states", {})
        feed(states, "motor_states", lambda m: read_joint_state(m, motors, "position velocity effort"), self._states)
        velocities = Gate(self._timing, "joint_velocity_command", {})
        feed(velocities, "joint_velocity_command", lambda m: read_joint_state(m, joints, "velocity?"), self._velocity)
        efforts = Gate(self._timing, "gravity_effort", effort)
        for topic in ("gravity_effort", "joint_effort_command"):
            feed(efforts, topic, lambda m: read_joint_state(m, joints, "effort"), self._effort)

    def _states(self, stamp: int, inputs: dict[str, Any]) -> None:
        if self._timing.is_outer(stamp):
            self._ports.publish_joints("joint_states", stamp, self._transform.joint_state(inputs["motor_states"]))
        self._ports.report(stamp)

    def _velocity(self, stamp: int, inputs: dict[str, Any]) -> None:
        velocity = self._transform.motor_velocity(inputs["joint_velocity_command"].velocity)
        self._ports.publish_motors("motor_velocity_command", stamp, State([], velocity, []))

    def _effort(self, stamp: int, inputs: dict[str, Any]) -> None:
        command = inputs["joint_effort_command"]
        effort = self._transform.motor_effort(
            inputs["gravity_effort"].effort, command.effort if command else self._none
        )
        self._ports.publish_motors("motor_effort_command", stamp, State([], [], effort))


def main() -> None:
    """Run the node as this process."""
    run(TransformNode)


if __name__ == "__main__":
    main()
