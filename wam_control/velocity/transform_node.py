"""Node `transform`: motor space to joint space and back."""

import math
from typing import Any, Final

from wam_control.velocity.transform import Transform, TransformParameters
from wam_description.arm import Shared
from wam_description.event import Level
from wam_description.signals import NodeStatus, State
from wam_description.wiring import Input, Inputs, Outputs, reaction

HELD: Final = NodeStatus(
    Level.WARN,
    "joint_effort_command has no lasting effect: without joint_velocity_command the velocity loop holds the motors at "
    "0 rad/s against it; publish joint_velocity_command, too, with an empty velocity to command torque alone: "
    "State([], [], [])",
)


class TransformNode:
    """Converts each message as it comes; the stamp stays that of the state that caused it."""

    name, parameters = "transform", TransformParameters

    def __init__(self, shared: Shared, own: TransformParameters) -> None:
        self._transform = Transform(shared.arm, own.creep_correction)
        self._no_effort = State([], [], [0.0] * shared.arm.n)
        self._limit = shared.ages.limit_ns("feedback")
        self._velocity_stamp = 0  # ns, newest velocity command
        self._since = math.inf  # ns, first torque without one
        self._is_held = False

    @reaction(Input("motor_states"), outputs=("joint_states",), thinned=True)
    def states(self, inputs: Inputs) -> Outputs:
        """Joint states of the motor states, at the outer rate."""
        return {"joint_states": self._transform.joint_state(inputs["motor_states"])}

    @reaction(Input("joint_velocity_command", "velocity?"), outputs=("motor_velocity_command",))
    def velocity(self, inputs: Inputs) -> Outputs:
        """Motor velocities of the commanded joint velocities."""
        self._velocity_stamp = inputs.stamp
        velocity = self._transform.motor_velocity(inputs["joint_velocity_command"].velocity)
        return {"motor_velocity_command": State([], velocity, [])}

    @reaction(
        Input("gravity_effort", "effort"),
        Input("joint_effort_command", "effort"),
        outputs=("motor_effort_command",),
    )
    def effort(self, inputs: Inputs) -> Outputs:
        """Motor torques that carry the links and give the commanded joint torques on top."""
        command = inputs["joint_effort_command"] or self._no_effort
        effort = self._transform.motor_effort(inputs["gravity_effort"].effort, command.effort)
        outputs: dict[str, Any] = {"motor_effort_command": State([], [], effort)}
        if self._is_held is not self._look_for_hold(inputs.stamp, command.effort):
            self._is_held = not self._is_held
            outputs["status"] = HELD if self._is_held else NodeStatus(Level.OK, "ready")
        return outputs

    def _look_for_hold(self, stamp: int, effort: list[float]) -> bool:
        """Whether torque has been commanded for a while without any velocity, so that the velocity loop opposes it."""
        is_followed = not any(effort) or 0 <= stamp - self._velocity_stamp <= self._limit
        self._since = stamp if is_followed else min(self._since, stamp)
        return stamp - self._since > self._limit
