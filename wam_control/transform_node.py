"""Node `transform`: motor space to joint space and back."""

from wam_control.transform import Transform, TransformParameters
from wam_description.arm import Shared
from wam_description.signals import State
from wam_description.synchroniser import Inputs
from wam_description.wiring import Input, Outputs, reaction


class TransformNode:
    """Converts each message as it comes; the stamp stays that of the state that caused it."""

    name, parameters = "transform", TransformParameters

    def __init__(self, shared: Shared, own: TransformParameters) -> None:
        self._transform = Transform(shared.arm, own.creep_correction)
        self._no_effort = State([], [], [0.0] * len(shared.arm.joints.names))

    @reaction(Input("motor_states"), outputs=("joint_states",), thinned=True)
    def states(self, inputs: Inputs) -> Outputs:
        """Joint states of the motor states, at the outer rate."""
        return {"joint_states": self._transform.joint_state(inputs["motor_states"])}

    @reaction(Input("joint_velocity_command", "velocity?"), outputs=("motor_velocity_command",))
    def velocity(self, inputs: Inputs) -> Outputs:
        """Motor velocities of the commanded joint velocities."""
        velocity = self._transform.motor_velocity(inputs["joint_velocity_command"].velocity)
        return {"motor_velocity_command": State([], velocity, [])}

    @reaction(
        Input("gravity_effort", "effort"),
        Input("joint_effort_command", "effort", absent="zero"),
        outputs=("motor_effort_command",),
    )
    def effort(self, inputs: Inputs) -> Outputs:
        """Motor torques that carry the links and give the commanded joint torques on top."""
        command = inputs["joint_effort_command"] or self._no_effort
        effort = self._transform.motor_effort(inputs["gravity_effort"].effort, command.effort)
        return {"motor_effort_command": State([], [], effort)}
