"""Node `force_loop`: the outer loop, forces and postures in, joint velocities and torques out."""

from wam_control.contact_table import contact_of
from wam_control.force_loop import ForceLoop, ForceLoopParameters
from wam_control.guard_report import Report
from wam_description.arm import Shared
from wam_description.signals import ZERO, Answer, ForceCommand, Level, NodeStatus, State, Wrench
from wam_description.synchroniser import Inputs
from wam_description.wiring import Followed, Input, Outputs, reaction


class ForceLoopNode:
    """Answers each joint state with a joint velocity and a feed-forward torque."""

    name, parameters = "force_loop", ForceLoopParameters
    services = ("tare",)
    follows = Followed("velocity_loop", "servo")

    def __init__(self, shared: Shared, own: ForceLoopParameters) -> None:
        self._loop = ForceLoop(shared.arm, shared.servo, own, shared.timing)
        self.tune = self._loop.tune
        self.retune = self._loop.retune_servo
        self._covers = shared.arm.covers.names
        self._reported: Report | None = None

    @reaction(
        Input("joint_states"),
        Input("joint_sensors"),
        Input("external_joint_torques", "effort"),
        Input("contact/hypotheses"),
        Input("force_command"),
        Input("joint_posture_command", "position"),
        Input("joint_torque_command", "effort"),
        outputs=(
            "joint_velocity_command",
            "joint_effort_command",
            "force_measured",
            "force_error",
            "force_error_limited",
        ),
    )
    def step(self, inputs: Inputs) -> Outputs:
        """One outer period."""
        command, external, posture, torque = (
            inputs[topic]
            for topic in ("force_command", "external_joint_torques", "joint_posture_command", "joint_torque_command")
        )
        out = self._loop.step(
            inputs["joint_states"],
            inputs["joint_sensors"],
            contact_of(inputs["contact/hypotheses"], self._covers),
            external.effort if external else None,
            ForceCommand(command.frame, command.force, command.torque) if command else None,
            inputs.age("force_command"),
            posture.position if posture else None,
            torque.effort if torque else None,
            inputs.dt,
        )
        return {
            "joint_velocity_command": State([], out.velocity, []),
            "joint_effort_command": State([], [], out.effort),
            "force_measured": Wrench(out.frame, out.measured, ZERO),
            "force_error": Wrench(out.frame, out.error, ZERO),
            "force_error_limited": Wrench(out.frame, out.limited, ZERO),
            **self._status(),
        }

    def _status(self) -> Outputs:
        """What the guard reports, where it has changed."""
        report = self._loop.report
        if report is self._reported:
            return {}
        self._reported = report
        level = Level.WARN if report.is_warning else Level.OK
        return {"status": NodeStatus(level, report.message, facts=report.facts)}

    @property
    def refusals(self) -> dict[str, str]:
        """Why a present command or contact is not used, by topic."""
        return self._loop.refusals

    @property
    def reason(self) -> str:
        """Why the loop does not do what is commanded, '' where it does."""
        return self._loop.reason

    def diagnostics(self) -> dict[str, str]:
        """Why the estimated contact position is not used."""
        return {"estimated contact position not used": self._loop.fallback or "-"}

    def tare(self) -> Answer:
        """Take the present external torques as zero."""
        self._loop.tare()
        return Answer(True, "the present external torques now count as zero")
