"""The guard's part of the force loop: it admits a parameter set, and scales its gains while the arm moves."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from wam_control.force.contact_position import ForcePoint
from wam_control.force.force_loop_parameters import ForceLoopParameters, force_law, sensing_of, task_of, torque_law
from wam_control.force.guard_report import report
from wam_control.force.guard_watch import Watch, possible_contacts
from wam_control.force.stability_guard import GuardAssessment, Guarded, GuardedContact, StabilityGuard
from wam_description.arm import Arm, Servo, Timing
from wam_description.parameters import require

Triple = tuple[float, float, float]


class Supervision:
    """A parameter set that the guard has let pass; another set needs another object.

    Parameters
    ----------
    arm : the arm as the controller knows it.
    servo : gains of the velocity loop.
    timing : periods of the loops.
    parameters : of the force loop.
    q : present joint angles (n,), rad; empty before the first state.

    Attributes
    ----------
    force_law, torque_law : laws in force; with guard.mode `limit` their saturation may be lower than configured.
    assessment : what the guard finds; None where it is off or nothing is fed back.
    watch : what the guard does while the arm moves; None with the assessment.
    report : the guard's report; a new object where it has changed.

    Raises
    ------
    ParameterError
        where the guard does not accept the set.
    """

    def __init__(
        self, arm: Arm, servo: Servo, timing: Timing, parameters: ForceLoopParameters, q: tuple[float, ...]
    ) -> None:
        self._covers, self._parameters = arm.covers, parameters
        self.force_law, self.torque_law = force_law(parameters), torque_law(parameters, arm.joints.names)
        self.assessment: GuardAssessment | None = None
        self.watch: Watch | None = None
        self._guard = StabilityGuard(arm, servo, timing, parameters.guard, sensing_of(parameters))
        if parameters.guard.mode != "off" and parameters.mode != "open_loop":
            self._judge([parameters.guard.posture, q] if q else [parameters.guard.posture])
        self._report()

    def _judge(self, postures: Sequence[tuple[float, ...]]) -> None:
        guard, parameters = self._guard, self._parameters
        is_joints, mode = parameters.mode == "joint_torque", parameters.guard.mode
        task = task_of(parameters, self.torque_law if is_joints else self.force_law)
        is_pinned = parameters.contact_source == "pinned"
        position_sd = parameters.contact_position_sd if is_pinned else parameters.position_uncertainty_limit
        contacts = [
            contact
            for q in postures
            for contact in guard.contacts(q, parameters.contact_cover, parameters.contact_position, position_sd)
        ]
        found = guard.assess(task, contacts if is_joints else guard.sensed(contacts))
        if found.reason and found.stable_error and mode == "limit":
            limits = tuple(min(limit, found.stable_error) for limit in task.law.error_limit)
            task = task._replace(law=replace(task.law, error_limit=limits))
            found = found._replace(reason="")
        require(not found.reason or mode == "warn", found.reason)
        if is_joints:
            self.torque_law = task.law
        else:
            self.force_law = task.law
        self.assessment, self.watch = found, Watch(guard, task, found, parameters.schedule == "position")

    def _report(self) -> None:
        parameters = self._parameters
        self.report = report(self.assessment, self.watch, parameters.guard.mode, parameters.mode == "joint_torque")

    def step(
        self, q: tuple[float, ...], point: ForcePoint, direction: Triple | None, force: float, dt: float
    ) -> tuple[float, bool]:
        """Factor of the gains in this period, and whether it has changed.

        Parameters
        ----------
        q : joint angles (n,), rad.
        point : of action.
        direction : of the force in the base frame (3,); None for both directions across the cover.
        force : commanded, N.
        dt : outer period, s.
        """
        return self.factor(lambda: self._contacts(q, point, direction, force), dt)

    def factor(self, where: Callable[[], Sequence[Guarded]], dt: float) -> tuple[float, bool]:
        """Factor of the gains in this period, and whether it has changed.

        Parameters
        ----------
        where : gives the contacts that are controlled now.
        dt : outer period, s.
        """
        watch = self.watch
        if watch is None:
            return 1.0, False
        before = watch.assessed
        has_changed = watch.step(where, dt)
        if watch.assessed is not before:
            self._report()
        return self.present, has_changed

    @property
    def present(self) -> float:
        """Factor of the gains in force."""
        return 1.0 if self.watch is None or self._parameters.guard.mode == "warn" else self.watch.factor

    def _contacts(
        self, q: tuple[float, ...], point: ForcePoint, direction: Triple | None, force: float
    ) -> list[GuardedContact]:
        guard, covers = self._guard, self._covers
        if self._parameters.schedule == "position" and not point.is_certain:
            return possible_contacts(guard, q, point.cover, covers.length_of(point.cover))
        if direction is None:
            return guard.contacts(q, point.cover, point.position, point.position_sd)
        contact = GuardedContact(q, point.cover, point.position, point.position_sd, direction, force)
        return guard.sensed(guard.with_lever(contact))
