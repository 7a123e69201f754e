"""Node `force_loop`: the outer loop, forces and postures in, joint velocities and torques out."""

from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from std_srvs.srv import Trigger

from wam_control.force_loop import ForceCommand, ForceLoop, ForceLoopParameters
from wam_control.guard_report import Report
from wam_description.arm import seconds
from wam_description.parameters import ParameterError
from wam_description.signals import State
from wam_ros.lockstep import Gate, Need
from wam_ros.messages import (
    BASE,
    Wrench,
    contact_of,
    read_contact,
    read_joint_state,
    read_spread,
    read_wrench,
    stamp_of,
    wrench_stamped,
)
from wam_ros.parameters import declare, follow
from wam_ros.ports import Ports
from wam_ros.run import run

PARAMETERS = ForceLoopParameters
NO_TORQUE = (0.0, 0.0, 0.0)


class ForceLoopNode(Node):
    """Answers each joint state with a joint velocity and a feed-forward torque."""

    def __init__(self, **ros: Any) -> None:
        super().__init__("force_loop", **ros)
        shared, own = declare(self, PARAMETERS)
        try:
            self._loop = ForceLoop(shared.arm, own, shared.timing)
        except ParameterError as error:
            raise ParameterError(f"node '{self.get_name()}': {error}") from None
        follow(self, own, self._loop.tune)
        self._ports = ports = Ports(self, shared)
        self._outer_period = shared.timing.outer_period_ns
        self._last: int | None = None
        self._said: Report | None = None
        joints, frames = list(shared.arm.joints.names), (BASE, *shared.arm.covers.names)
        estimated = Need(True, streamed=ports.streamed("contact_estimator"))
        played = Need(True, streamed=ports.streamed("scenario"))
        needs = {
            "external_joint_torques": estimated,
            "contact/wrench": estimated,
            "contact/point": estimated,
            "contact/spread": estimated,
            "force_command": played,
            "joint_posture_command": played,
            "joint_torque_command": Need(True, streamed=False),
        }
        if shared.arm.joint_sensors:
            needs["joint_sensors"] = Need(outer=False)
        gate = Gate(shared.timing, "joint_states", needs)
        readers = {
            "joint_states": lambda m: read_joint_state(m, joints, "position velocity effort"),
            "joint_sensors": lambda m: read_joint_state(m, joints, "position velocity effort"),
            "external_joint_torques": lambda m: read_joint_state(m, joints, "effort").effort,
            "contact/wrench": lambda m: read_wrench(m, frames),
            "contact/point": lambda m: read_contact(m, frames),
            "contact/spread": lambda m: read_spread(m, frames),
            "force_command": lambda m: (stamp_of(m), read_wrench(m, frames)),
            "joint_posture_command": lambda m: read_joint_state(m, joints, "position").position,
            "joint_torque_command": lambda m: read_joint_state(m, joints, "effort").effort,
        }
        for topic in ("joint_states", *needs):
            ports.feed(gate, topic, readers[topic], self._work)
        self.create_service(Trigger, "~/tare", self._tare)

    def _work(self, stamp: int, inputs: dict[str, Any]) -> None:
        dt = self._outer_period if self._last is None else stamp - self._last
        self._last = stamp
        command_stamp, command = inputs["force_command"] or (stamp, None)
        out = self._loop.step(
            inputs["joint_states"],
            inputs.get("joint_sensors"),
            contact_of(inputs["contact/wrench"], inputs["contact/point"], inputs["contact/spread"]),
            inputs["external_joint_torques"],
            ForceCommand(command.frame, command.force) if command else None,
            seconds(stamp - command_stamp),
            inputs["joint_posture_command"],
            inputs["joint_torque_command"],
            seconds(dt),
        )
        ports = self._ports
        for topic, reason in self._loop.refusals.items():
            ports.refuse(topic, reason)
        ports.facts["felt place not used"] = self._loop.fallback or "-"
        ports.publish_joints("joint_velocity_command", stamp, State([], out.velocity, []))
        ports.publish_joints("joint_effort_command", stamp, State([], [], out.effort))
        frame = command.frame if command else BASE
        ports.publish("force_measured", wrench_stamped(stamp, Wrench(frame, out.measured, NO_TORQUE)))
        ports.publish("force_error", wrench_stamped(stamp, Wrench(frame, out.error, NO_TORQUE)))
        ports.publish("force_error_limited", wrench_stamped(stamp, Wrench(frame, out.limited, NO_TORQUE)))
        self._announce()
        ports.report(stamp)

    def _announce(self) -> None:
        """Publish what the guard says where it has changed, once the peers are there."""
        report = self._loop.report
        if report is self._said or not self._ports.ready:
            return
        self._said = report
        level = DiagnosticStatus.WARN if report.is_warning else DiagnosticStatus.OK
        self._ports.set_status(level, report.message, peers="connected", **report.facts)

    def _tare(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._loop.tare()
        response.success, response.message = True, "the external torques felt now count as zero"
        return response


def main() -> None:
    """Run the node as this process."""
    run(ForceLoopNode)


if __name__ == "__main__":
    main()
