"""Node `force_loop`: the outer loop, forces and postures in, joint velocities and torques out."""

import math
from typing import Any

from wam_control.contact.contact_table import contact_of
from wam_control.force.force_loop import ForceInput, ForceLoop, ForceLoopParameters, ForceOutput, by_seriousness
from wam_control.force.guard import Report
from wam_control.force.task import TaskCommand, task_of
from wam_control.task.trajectory_goal import TrajectoryPlayer
from wam_description.arm import Shared
from wam_description.event import OBEYED, Event, Level, refused
from wam_description.event_text import sentences
from wam_description.number_text import brief
from wam_description.parameters import ParameterError
from wam_description.signals import BASE, ZERO, Answer, ForceCommand, NodeStatus, State, Table, Wrench
from wam_description.status import REFUSED
from wam_description.wiring import Input, Inputs, Outputs, reaction


class ForceLoopNode:
    """Answers each joint state with a joint velocity and a feed-forward torque."""

    name, parameters = "force_loop", ForceLoopParameters
    services = ("tare",)

    def __init__(self, shared: Shared, own: ForceLoopParameters) -> None:
        self._loop = ForceLoop(shared.model_arm, shared.servo, own, shared.timing, shared.ages.command)
        self.tune = self._loop.tune
        self._shared = shared
        self._player = TrajectoryPlayer(shared)
        self._command: Table | None = None
        self._known: TaskCommand | None = None
        self._refusal = ""
        self._reported: tuple[Any, ...] | None = None
        self._event = OBEYED

    @reaction(
        Input("joint_states"),
        Input("joint_sensors", absent="hold"),
        Input("external_joint_torques", "effort", absent="brake"),
        Input("external_joint_torques_sd", "effort"),
        Input("contact/hypotheses", absent="brake"),
        Input("force_command", age="command", absent="hold"),
        Input("joint_posture_command", "position velocity?", age="command", absent="hold"),
        Input("joint_trajectory", age="command", absent="hold"),
        Input("joint_torque_command", "effort", age="command", absent="hold"),
        Input("task_command", age="command", absent="hold"),
        outputs=(
            "joint_velocity_command",
            "joint_effort_command",
            "force_measured",
            "force_error",
            "force_error_limited",
            "force_axis",
            "task_axes",
            "external_torque_zero",
        ),
    )
    def step(self, inputs: Inputs) -> Outputs:
        """One outer period."""
        command, posture, torque = (
            inputs["force_command"], inputs["joint_posture_command"], inputs["joint_torque_command"]
        )  # fmt: skip
        task, joints = self._task(inputs["task_command"]), inputs["joint_states"]
        if inputs["joint_trajectory"] is not None or self._player.trajectory is not None:
            posture = self._on_trajectory(inputs)
        if self._refusal:
            command = posture = torque = None  # the arm holds its position
        external, hypotheses = inputs["external_joint_torques"], inputs["contact/hypotheses"]
        torque_sd = inputs["external_joint_torques_sd"]
        given = ForceInput(
            joints,
            inputs.dt,
            inputs["joint_sensors"],
            contact_of(hypotheses, self._shared.arm.covers.names) if external and hypotheses else None,
            external.effort if external else None,
            torque_sd.effort if torque_sd else None,
            ForceCommand(command.frame, command.force, command.torque) if command else None,
            posture.position if posture else None,
            posture.velocity if posture else None,
            torque.effort if torque else None,
            task,
        )
        out = self._loop.step(given)
        return {
            "joint_velocity_command": State([], out.velocity, []),
            "joint_effort_command": State([], [], out.effort),
            "force_measured": Wrench(out.frame, out.measured, ZERO),
            "force_error": Wrench(out.frame, out.error, ZERO),
            "force_error_limited": Wrench(out.frame, out.limited, ZERO),
            "external_torque_zero": State([], [], self._loop.free_torques),
            **self._force_axis(out, inputs.stamp),
            **self._status(command, torque, task),
        }

    def _on_trajectory(self, inputs: Inputs) -> State | None:
        """The posture on a trajectory, which begins as the brakes are released; None: the arm stays where it is."""
        joints = inputs["joint_states"]
        trajectory = inputs["joint_trajectory"] if any(joints.effort) else None
        moving = self._player.step(trajectory, joints.position, joints.velocity, inputs.dt)
        return State(moving.position, moving.velocity, []) if moving else None

    def _task(self, command: Table | None) -> TaskCommand | None:
        """The commanded task; one that is not understood is refused, and the arm holds its position."""
        if command != self._command:
            self._command, self._refusal = command, ""
            try:
                self._known = task_of(command, self._shared.arm)
            except ParameterError as error:
                self._known, self._refusal = None, f"{error}; the arm holds its position"
        return self._known

    @property
    def needs(self) -> frozenset[str]:
        """The estimate, where the force is controlled by it."""
        is_fed_back = self._loop.parameters.is_estimated
        return frozenset({"external_joint_torques", "contact/hypotheses"} if is_fed_back else ())

    def _force_axis(self, out: ForceOutput, stamp: int) -> Outputs:
        """How well the force is known, in the order of `FORCE_AXIS`; at the display rate and with another event."""
        event, before = self._loop.event, self._event
        self._event = event
        is_same = event is before or event.subject == before.subject
        if is_same and not self._shared.timing.is_display(stamp):
            return {}
        if out.rows:
            return {"force_axis": Table(BASE, ()), "task_axes": Table(out.frame, out.rows)}
        axis, place = (out.axes[0].sensed, out.axes[0].place) if out.axes else (None, None)
        if axis is None or place is None:
            return {"force_axis": Table(BASE, ())}
        known = out.known[0]
        row = (
            *(float(event.code.number), float(event.holds), known.doubt, known.tolerance, *known.errors, known.sd),
            *(math.hypot(*axis.lever), axis.apparent_mass, axis.speed_fraction, place.position, place.position_sd),
        )
        return {"force_axis": Table(place.cover, (row,))}

    def _status(self, command: Wrench | None, torque: State | None, task: TaskCommand | None) -> Outputs:
        """What the guard reports, how the loop reacts and what it refuses, where it has changed."""
        report, events = self._loop.supervision.report, self._loop.events
        refusals = self.refusals
        commanded = ""
        if refusals or self._loop.event.holds:  # of the command for which it was given
            values = [*(command.force if command else ()), *(torque.effort if torque else ())]
            values += [axis.value or 0.0 for axis in task.axes] if task else []
            unit = " N" if command and not (torque or task) else ""
            commanded = f"; commanded: {', '.join(map(brief, values))}{unit}" if values else ""
            events = by_seriousness([*events, *refusals.values()])
        # the numbers of an event change in every period
        subjects = [event.subject for event in events]
        present = report, list(refusals), subjects, self._loop.is_advised, commanded
        if present == self._reported:
            return {}
        self._reported = present
        level = Level.WARN if report.is_warning or events else Level.OK
        facts = report.facts | ({REFUSED: ", ".join(refusals)} if refusals else {})
        message = sentences(events) + commanded or report.message
        return {"status": NodeStatus(level, message, facts=facts, events=events)}

    @property
    def refusals(self) -> dict[str, Event]:
        """Why a present command or contact is not used, by topic."""
        refusals = self._loop.refusals.copy()
        if self._refusal:
            refusals["task_command"] = refused("task_command", self._refusal)
        if self._player.refusal:
            refusals["joint_trajectory"] = refused("joint_trajectory", self._player.refusal)
        return refusals

    @property
    def event(self) -> Event:
        """What the loop does instead of what is commanded."""
        return self._loop.event

    @property
    def guard_report(self) -> Report:
        """What the guard reports of the parameters in use."""
        return self._loop.supervision.report

    @property
    def lowered(self) -> str:
        """What applies in place of parameters that the guard does not accept; '' where it accepts all."""
        return self._loop.supervision.lowered

    def tare(self) -> Answer:
        """Take the present external torques as zero."""
        reason = self._loop.tare()
        return Answer(not reason, reason or "the present external torques now count as zero in the force loop")
