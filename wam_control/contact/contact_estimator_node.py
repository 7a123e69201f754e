"""Node `contact_estimator`: what touches the arm, where, how hard, with what uncertainty."""

from collections.abc import Sequence
from typing import Any

from wam_control.contact.contact_estimator import ContactEstimator, ContactEstimatorParameters
from wam_control.contact.contact_table import contact_of, friction_table, hypothesis_table, likely_of
from wam_control.force.task import is_pressing
from wam_description.arm import Shared, seconds
from wam_description.event import Event, Level
from wam_description.event_text import sentences
from wam_description.signals import (
    BASE,
    Answer,
    ContactView,
    NodeStatus,
    Point,
    State,
    Wrench,
)
from wam_description.status import ENABLED
from wam_description.wiring import Input, Inputs, Outputs, reaction


class ContactEstimatorNode:
    """Observes every motor state, publishes the estimate every outer period."""

    name, parameters = "contact_estimator", ContactEstimatorParameters
    services = ("tare",)

    def __init__(self, shared: Shared, own: ContactEstimatorParameters) -> None:
        self._estimator = ContactEstimator(shared.model_arm, shared.timing, own, shared.model)
        self._arm, self._friction_scale = shared.model_arm, own.observer.friction_scale
        self._covers, self._timing = shared.arm.covers.names, shared.timing
        self._samples: list[tuple[State, State | None, float]] = []
        self._in_contact: bool | None = None
        self._warned: Event | None = None
        self._second = -1
        # the errors of the model are tracked from the motors alone
        commands = {"force_command", "task_command", "joint_torque_command"}
        zero = "external_torque_zero"  # of joint sensors, which show the weight of the arm
        self.unused = frozenset(commands if own.use_joint_sensors else {"joint_sensors", zero})
        self._zero: Sequence[float] = ()
        self.estimate = self._estimator.estimate()

    @reaction(
        Input("motor_states"),
        Input("joint_sensors"),
        Input("force_command", age="command", answers=True),
        Input("task_command", age="command", answers=True),
        Input("joint_torque_command", "effort", age="command", answers=True),
        Input("external_torque_zero", "effort", answers=True),
        outputs=(
            "external_joint_torques",
            "external_joint_torques_sd",
            "contact/wrench",
            "contact/point",
            "contact/hypotheses",
            "contact/tracked_friction",
            "contact/markers",
            "contact/in_contact",
        ),
    )
    def step(self, inputs: Inputs) -> Outputs:
        """Keep the samples of one inner period; in an outer one, observe them and estimate."""
        self._samples.append((inputs["motor_states"], inputs["joint_sensors"], inputs.dt))
        if not self._timing.is_outer(inputs.stamp):
            return {}
        self._observe()
        self._follow_zero(inputs["external_torque_zero"])
        self.estimate = estimate = self._estimator.estimate(_is_pressing(inputs))
        best = estimate.best
        frame = best.cover or BASE
        hypotheses = hypothesis_table(estimate.hypotheses, self._covers)
        outputs: dict[str, Any] = {
            "external_joint_torques": State([], [], list(estimate.external_torques)),
            "external_joint_torques_sd": State([], [], list(estimate.torque_sd)),
            "contact/wrench": Wrench(frame, best.force, best.moment),
            "contact/point": Point(frame, (best.position, 0.0, 0.0)),
            "contact/hypotheses": hypotheses,
        }
        if self._timing.is_display(inputs.stamp):
            contact, likely = contact_of(hypotheses, self._covers), likely_of(hypotheses, self._covers)
            outputs["contact/markers"] = ContactView(contact, likely)
        second = int(seconds(inputs.stamp))
        if second != self._second and (errors := self._estimator.model_errors):
            self._second = second
            outputs["contact/tracked_friction"] = friction_table(errors, self._arm, self._friction_scale)
        if estimate.in_contact is not self._in_contact:
            self._in_contact = estimate.in_contact
            outputs["contact/in_contact"] = estimate.in_contact
        if (warning := estimate.warning) != self._warned:
            self._warned = warning
            events = (warning,) if warning else ()
            level = Level.WARN if warning else Level.OK
            outputs["status"] = NodeStatus(level, sentences(events), stamp=inputs.stamp, events=events)
        return outputs

    def _follow_zero(self, zero: State | None) -> None:
        """Zero as the force loop does: as it is tared, and as a force begins at rest."""
        if zero is not None and any(zero.effort) and zero.effort != self._zero:
            self._zero = zero.effort
            self._estimator.zero()

    def _observe(self) -> None:
        """Observe the samples since the last time: together a third faster than one by one between other nodes."""
        for motor, sensors, dt in self._samples:
            self._estimator.observe(motor, sensors, dt)
        self._samples.clear()

    def diagnostics(self) -> dict[str, float]:
        """The errors of the model as they are tracked between contacts, by name."""
        return {name: error.value for name, error in self._estimator.model_errors.items()}

    def take_status(self, status: NodeStatus) -> None:
        """Follow the brakes in realtime.

        A status has no fixed time among the states: in lockstep the motor torque, exactly zero, shows the brakes.
        """
        if status.node == "driver" and self._timing.mode == "realtime":
            self._observe()
            self._estimator.brake((status.mode or ENABLED) != ENABLED)

    def tare(self) -> Answer:
        """Take the present torques as those of an arm at rest that nothing touches."""
        self._observe()
        reason = self._estimator.zero()
        return Answer(not reason, reason or "masses, centres of mass and payload are known better from these torques")


def _is_pressing(inputs: Inputs) -> bool:
    """Whether a force is commanded, alone or along an axis of a task, or torques."""
    force, task, torque = inputs["force_command"], inputs["task_command"], inputs["joint_torque_command"]
    return bool((force and any(force.force)) or (task and is_pressing(task)) or (torque and any(torque.effort)))
