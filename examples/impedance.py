"""A controller of your own: tip impedance in place of the force loop.

A spring pulls the tip from its place x to x0, where it is in the commanded posture; a damper brakes it:
tau = J' (K (x0 - x) - D xd).  Run it in three ways, from this directory:

    python3 impedance.py                                   # in one process, without ROS
    PYTHONPATH=. wam up --config impedance.yaml            # over topics
    PYTHONPATH=. wam replay BAG impedance:Impedance        # on the inputs in a bag of the line above with --record
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wam_control.task.scenario import Push, ScenarioStep
from wam_description.arm import Shared
from wam_description.configuration import Configuration
from wam_description.parameters import parameter
from wam_description.rigid_body import RigidBody
from wam_description.signals import State
from wam_description.wiring import Input, Inputs, Outputs, reaction
from wam_sim.simulation import Simulation


@dataclass(frozen=True)
class ImpedanceParameters:
    """Spring and damper at the tip, in the base frame."""

    stiffness: tuple[float, ...] = parameter("stiffness along x y z", "N/m", low=0.0, high=2000.0, live=True, length=3)
    damping: tuple[float, ...] = parameter("damping along x y z", "N s/m", low=0.0, high=100.0, live=True, length=3)


class Impedance:
    """Answers each joint state with the joint torques of the spring and the damper."""

    name, parameters = "impedance", ImpedanceParameters

    def __init__(self, shared: Shared, own: ImpedanceParameters) -> None:
        self._body, self._joints = RigidBody(shared.arm), shared.arm.joints
        self._rest: list[float] = []  # posture that the spring pulls to, rad
        self.refusals: dict[str, str] = {}
        self.tune(own)

    def tune(self, own: ImpedanceParameters) -> None:
        """Take new values while the arm moves."""
        self._stiffness, self._damping = np.array(own.stiffness), np.array(own.damping)

    @reaction(
        Input("joint_states", "position velocity"),
        Input("joint_posture_command", "position", age="command", absent="hold"),
        outputs=("joint_velocity_command", "joint_effort_command"),
    )
    def step(self, inputs: Inputs) -> Outputs:
        """Torques of one outer period; an empty velocity commands torque only."""
        joints, posture = inputs["joint_states"], inputs["joint_posture_command"]
        q = joints.position
        jacobian = self._body.tool_jacobian(q)
        rest = self._body.tool_pose(self._admitted(posture.position if posture else [], q)).position
        force = self._stiffness * (rest - self._body.tool_pose(q).position) - self._damping * (
            jacobian @ joints.velocity
        )
        return {
            "joint_velocity_command": State([], [], []),
            "joint_effort_command": State([], [], (force @ jacobian).tolist()),
        }

    def _admitted(self, posture: list[float], q: list[float]) -> list[float]:
        """Posture in which the tip is at x0: the last commanded one within the stops.

        Without a command it is the present posture q.
        """
        beyond = self._joints.beyond(posture) if posture else ""
        self.refusals = {"joint_posture_command": beyond} if beyond else {}
        self._rest = [] if not posture else self._rest if beyond else posture
        return self._rest or q


PUSH = Push("outer_link", 0.4, (0.0, 20.0, 0.0), begin=0.5, end=2.0)
TASK = [
    ScenarioStep("release", 0.3, request="enable"),
    ScenarioStep("move", 1.5, posture=(0.0, -1.2, 0.0, 0.9)),
    ScenarioStep("push the tip", 2.0, push=PUSH),
]


def main() -> None:
    """Push the tip with 20 N and print how far it yields."""
    configuration = Configuration.load(Path(__file__).with_name("impedance.yaml"))
    run = Simulation(configuration, TASK)
    body = RigidBody(configuration.shared.arm)
    if failure := run.play():
        raise SystemExit(failure)
    tips = np.array([body.tool_pose(row.values[:4]).position for row in run.rows["sim/joint_states"]])
    times = np.array([row.stamp for row in run.rows["sim/joint_states"]]) / 1e9
    before, pushed = (tips[np.searchsorted(times, at)] for at in (2.2, 3.7))
    spring = 20.0 / configuration.sections["impedance"]["stiffness"][0]
    yielded = np.linalg.norm(pushed - before)
    print(f"20 N move the tip by {1e3 * yielded:.0f} mm; the spring alone would give {1e3 * spring:.0f} mm")


if __name__ == "__main__":
    main()
