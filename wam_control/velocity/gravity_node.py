"""Node `gravity`: the joint torques that carry the links."""

from wam_description.arm import Shared
from wam_description.parameters import Nothing
from wam_description.rigid_body import RigidBody
from wam_description.signals import State
from wam_description.wiring import Input, Inputs, Outputs, reaction


class GravityNode:
    """Answers each joint state with the torque that holds the arm there."""

    name, parameters = "gravity", Nothing

    def __init__(self, shared: Shared, own: Nothing) -> None:
        self._body = RigidBody(shared.model_arm)

    @reaction(Input("joint_states", "position"), outputs=("gravity_effort",))
    def step(self, inputs: Inputs) -> Outputs:
        """Gravity torque of the present pose, N m."""
        q = inputs["joint_states"].position
        return {"gravity_effort": State([], [], self._body.gravity_torque(q).tolist())}
