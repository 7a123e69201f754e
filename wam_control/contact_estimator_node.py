"""Node `contact_estimator`: what touches the arm, where, how hard, how sure."""

from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from wam_control.contact_estimator import ContactEstimate, ContactEstimator, ContactEstimatorParameters
from wam_control.contact_inference import Hypothesis
from wam_description.arm import seconds
from wam_description.signals import State
from wam_ros.lockstep import Gate, Need
from wam_ros.markers import Likely, contact_markers
from wam_ros.messages import BASE, Wrench, header, point_stamped, read_joint_state, wrench_stamped
from wam_ros.parameters import declare
from wam_ros.ports import Ports
from wam_ros.run import run

PARAMETERS = ContactEstimatorParameters
ENABLED = "enabled"  # mode of the driver in which no brake holds


class ContactEstimatorNode(Node):
    """Observes every motor state, publishes the estimate every outer period."""

    def __init__(self, **ros: Any) -> None:
        super().__init__("contact_estimator", **ros)
        shared, own = declare(self, PARAMETERS)
        self._estimator = ContactEstimator(shared.arm, shared.timing, own)
        self._ports = ports = Ports(self, shared)
        self._timing = shared.timing
        self._last: int | None = None
        self._in_contact: bool | None = None
        self._is_realtime = shared.timing.mode == "realtime"
        motors, joints = list(shared.arm.motors.names), list(shared.arm.joints.names)
        needs = {"joint_sensors": Need(outer=False)} if own.use_joint_sensors else {}
        gate = Gate(shared.timing, "motor_states", needs)
        fields = "position velocity effort"
        ports.feed(gate, "motor_states", lambda m: read_joint_state(m, motors, fields), self._work)
        # a latched status comes at no certain period: in lockstep the torque tells of the brakes, as exactly zero
        ports.listen("status", self._said)
        self.create_service(Trigger, "~/tare", self._tare)
        if needs:
            ports.feed(gate, "joint_sensors", lambda m: read_joint_state(m, joints, fields), self._work)
        elif shared.arm.joint_sensors:
            ports.listen("joint_sensors", lambda m: None)  # the driver starts when all its listeners are there

    def _work(self, stamp: int, inputs: dict[str, Any]) -> None:
        dt = self._timing.period_ns if self._last is None else stamp - self._last
        self._last = stamp
        self._estimator.observe(inputs["motor_states"], inputs.get("joint_sensors"), seconds(dt))
        if self._timing.is_outer(stamp):
            self._publish(stamp, self._estimator.estimate())
        self._ports.report(stamp)

    def _said(self, status: DiagnosticStatus) -> None:
        if status.name == "driver" and self._is_realtime:
            mode = next((item.value for item in status.values if item.key == "mode"), ENABLED)
            self._estimator.brake(mode != ENABLED)

    def _tare(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        reason = self._estimator.tare()
        response.success, response.message = not reason, reason or "what is felt now counts as payload"
        return response

    def _publish(self, stamp: int, estimate: ContactEstimate) -> None:
        ports, frame = self._ports, estimate.link or BASE
        ports.publish_joints("external_joint_torques", stamp, State([], [], list(estimate.external_torques)))
        ports.publish_joints("external_joint_torques_sd", stamp, State([], [], list(estimate.torque_sd)))
        ports.publish("contact/wrench", wrench_stamped(stamp, Wrench(frame, estimate.force, estimate.moment)))
        ports.publish("contact/point", point_stamped(stamp, frame, (estimate.place, 0.0, 0.0)))
        spread = (estimate.place_sd, estimate.probability, estimate.direction_sd)
        ports.publish("contact/spread", point_stamped(stamp, frame, spread))
        if self._timing.is_display(stamp):
            likely = [Likely(h.cover, h.low, h.high) for h in estimate.hypotheses if h.low < h.high]
            ports.publish("contact/hypotheses", hypotheses(stamp, estimate))
            ports.publish(
                "contact/markers", contact_markers(stamp, estimate.link, estimate.place, estimate.force, likely)
            )
        if estimate.in_contact is not self._in_contact:
            self._in_contact = estimate.in_contact
            ports.publish("contact/in_contact", Bool(data=bool(estimate.in_contact)))


def hypotheses(stamp: int, estimate: ContactEstimate) -> DiagnosticArray:
    """Every explanation of the external torques, the most probable first."""
    array = DiagnosticArray(header=header(stamp))
    array.status = [_status(hypothesis) for hypothesis in estimate.hypotheses]
    return array


def _status(hypothesis: Hypothesis) -> DiagnosticStatus:
    facts = hypothesis._asdict()
    cover, reason = str(facts.pop("cover")), str(facts.pop("reason"))
    values = [KeyValue(key=key, value=_text(value)) for key, value in facts.items()]
    level = DiagnosticStatus.WARN if reason else DiagnosticStatus.OK
    return DiagnosticStatus(name=cover, level=level, message=reason, values=values)


def _text(value: Any) -> str:
    if isinstance(value, tuple):
        return " ".join(_text(element) for element in value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def main() -> None:
    """Run the node as this process."""
    run(ContactEstimatorNode)


if __name__ == "__main__":
    main()
