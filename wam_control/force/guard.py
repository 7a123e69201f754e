"""The guard's part of the force loop: it admits a parameter set, and scales its gains while the arm moves.

An assessment takes milliseconds, so it is distributed: a part of it in each outer period, and a new
one only after the arm has moved.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, replace
from typing import Final, NamedTuple

import numpy as np

from wam_control.force.axes import CommandedAxis
from wam_control.force.contact_place import ContactPlace
from wam_control.force.force_loop_parameters import ForceLoopParameters, force_law, task_of, torque_law
from wam_control.force.problem import linear
from wam_control.force.stability_guard import (
    GuardAssessment,
    GuardedContact,
    GuardedForces,
    GuardedTask,
    StabilityGuard,
    listed,
    posture_of,
    triple,
)
from wam_control.force.task import AxisKind, TaskAxis
from wam_control.force.thresholds import FORCE, GUARD
from wam_description.arm import Arm, Servo, Timing
from wam_description.parameters import require
from wam_description.signals import Contact

UNKNOWN: Final = "that of `margin`, until a force is commanded"


class Report(NamedTuple):
    """One line, whether it is a warning, and the numbers behind it by name."""

    message: str
    is_warning: bool
    facts: dict[str, str]


class Supervision:
    """A parameter set that the guard has admitted; each set has its own object.

    With guard.mode `limit` the gains of a set that is not stable are lowered to stable ones; so is
    `posture_gain`, if no force gain is stable with it.

    Parameters
    ----------
    arm : the arm as the controller knows it.
    servo : gains of the velocity loop.
    timing : periods of the loops.
    parameters : of the force loop.
    q : present joint angles (n,), rad; empty before the first state.

    Attributes
    ----------
    guard : with the parameters of the set.
    servo_stiffness : integral gains of the velocity loop at the joints (n, n), N m/rad.
    parameters : those in force.
    force_law, torque_law : laws in force.
    assessment : what the guard finds; None where it is off or nothing is fed back.
    watch : what the guard does while the arm moves; None with the assessment.
    lowered : which parameters the guard has lowered, and to what; '' where none.
    report : the guard's report; a new object where it has changed.

    Raises
    ------
    ParameterError
        where the guard does not accept the set.
    """

    def __init__(
        self, arm: Arm, servo: Servo, timing: Timing, parameters: ForceLoopParameters, q: tuple[float, ...]
    ) -> None:
        self.parameters = parameters
        self.servo_stiffness = arm.transmission.at_joints(servo.integral_gain)
        self.assessment: GuardAssessment | None = None
        self.watch: Watch | None = None
        self.guard = StabilityGuard(arm, servo, timing, parameters.guard, parameters.sensing_fed_back)
        if parameters.guard.mode != "off" and parameters.mode != "open_loop":
            self._judge([parameters.guard.posture, q] if q else [parameters.guard.posture])
        self.force_law, self.torque_law = force_law(self.parameters), torque_law(self.parameters, arm.joints.names)
        self.lowered = _lowered(parameters, self.parameters)
        self.report = self._report()

    def _judge(self, postures: Sequence[tuple[float, ...]]) -> None:
        guard, own = self.guard, self.parameters
        contacts = tuple(
            each
            for q in postures
            for each in guard.contacts(q, own.contact_cover, own.contact_position, own.contact_position_sd)
            # what is not known well enough is refused
            if guard.axis(each).force_sd <= own.limits.doubt * own.limits.tolerance * each.force
        )
        task = task_of(own)
        found = guard.assess(task, contacts)
        if own.guard.mode == "limit":
            if not found.scale and (gain := guard.softer_hold(task, contacts)):
                self.parameters = replace(own, posture_gain=gain)
                found = guard.assess(task_of(self.parameters), contacts)
            if found.reason and found.scale:
                scale = guard.accepted_scale(found)  # as the reason of the refusal advises
                gains, rates = (
                    tuple(scale * each for each in one) for one in (own.force_gain, own.force_proportional_gain)
                )
                self.parameters = replace(self.parameters, force_gain=gains, force_proportional_gain=rates)
                found = guard.assess(task_of(self.parameters), contacts)
        require(not found.reason or own.guard.mode == "warn", found.reason)
        self.assessment, self.watch = found, Watch(guard, task_of(self.parameters), found)

    def _report(self) -> Report:
        """On the parameters in force."""
        mode, assessment, watch, lowered = self.parameters.guard.mode, self.assessment, self.watch, self.lowered
        if assessment is None or watch is None:
            return Report("ready", False, {"guard": "off" if mode == "off" else "no feedback"})
        here, factor = min(watch.scale, assessment.scale), self.factor
        message = f"stable, domain {assessment.domain}{lowered and '; lowered to be stable: '}{lowered}"
        if assessment.reason:
            message = f"not stable: {assessment.reason}"
        elif factor < 1.0:
            message += f"; this pose needs smaller gains, so each is multiplied by {factor:.3g}"
        cycle = assessment.cycle
        facts = {
            "guard.mode": mode,
            "domain": str(assessment.domain),
            "margin": margin_text(assessment.scale),
            "margin here": margin_text(here, watch.needed if watch.assessed else GUARD.largest_scale),
            "pose of margin here": f"{posture_of(watch.assessed[0].contacts[0])}, when a force was last commanded"
            if watch.assessed
            else UNKNOWN,
            "gains multiplied by": f"{factor:.4g}",
            "lowered": lowered or "nothing",
            "worst case": assessment.where,
            "effective stiffness [N/m]": f"{assessment.stiffness:.4g}",
            "limit cycle [N]": f"{cycle.peak_to_peak:.4g}",
            "period of the limit cycle [s]": f"{cycle.period:.4g}",
            "deadband that removes the limit cycle [N]": f"{cycle.deadband:.4g}",
            "gains": assessment.reason or "accepted",
        }
        return Report(message, bool(assessment.reason) or factor < 1.0, facts)

    def step(self, q: Sequence[float], axes: Sequence[CommandedAxis], contact: Contact, dt: float) -> None:
        """Go on with the assessment.

        Parameters
        ----------
        q : joint angles (n,), rad.
        axes : that are commanded.
        contact : estimated.
        dt : outer period, s.
        """
        if self.watch is not None and self.watch.step(lambda: self._guarded(q, axes, contact), dt):
            self.report = self._report()

    def _guarded(self, q: Sequence[float], axes: Sequence[CommandedAxis], contact: Contact) -> list[GuardedForces]:
        """Where the axes press: at all contacts at once; nothing where nothing presses.

        What is controlled there is the linear part of the problem of a period.  Torques of joints press wherever
        something is: each of its contacts is considered by itself.
        """
        own, contacts = self.parameters, []
        for axis in axes:
            if axis.place is not None and axis.sensed is not None and axis.sensed.force_sd < np.inf:
                direction = triple(axis.direction)
                contacts.append(GuardedContact(tuple(q), *axis.place[:3], direction, axis.desired or FORCE.hand))
        if contacts:
            together = [tuple(contacts)]
        elif any(axis.is_joint and axis.of.is_sensed for axis in axes):
            anywhere = TaskAxis(AxisKind.FORCE, position=None)
            places = ContactPlace(self.guard.arm.covers).step(anywhere, contact, 0.0, own)
            alone = (self.guard.contacts(q, *place[:3], [FORCE.sized_force]) for place in places)
            together = [(one,) for each in alone for one in each]
        else:
            return []
        n = len(q)
        move, left = linear([axis.along for axis in axes], n)
        hold, gain = own.posture_gain * left, np.zeros((2, len(axes)))
        sense, spring = np.zeros((2, len(axes), n))
        for i, axis in enumerate(axes):
            if axis.of.is_sensed:
                sense[i] = axis.along if axis.sensed is None else axis.sensed.sense
            if axis.is_force:
                move[:, i] *= 1.0 if axis.sensed is None else axis.sensed.speed_fraction
                law = self.torque_law if axis.is_joint else self.force_law.along(axis.in_frame.tolist())
                at = max(axis.of.joint, 0)
                gain[:, i] = law.gain[at], law.proportional_gain[at]
            elif axis.of.kind is AxisKind.IMPEDANCE:
                damping = own.task.damping(axis.of)
                gain[0, i], spring[i] = 1.0 / damping, axis.of.stiffness / damping * axis.along
            elif axis.of.kind is AxisKind.POSITION:
                hold = hold + own.task.largest_rate * np.outer(move[:, i], axis.along)
        others = tuple(axis.of._replace(value=0.0, rate=0.0) for axis in axes if not axis.is_force)
        return [GuardedForces(each, sense, move, gain[0], gain[1], hold, spring, others) for each in together]

    @property
    def factor(self) -> float:
        """Factor of the gains in force."""
        return 1.0 if self.watch is None or self.parameters.guard.mode == "warn" else self.watch.factor


class Watch:
    """Follows the arm and gives the factor by which the gains are scaled.

    The factor is 1, or less where the parameters would leave their domain.

    Parameters
    ----------
    guard : computes the margins.
    task : what is controlled, with the gains in force.
    found : assessment of these gains when they were tuned.

    Attributes
    ----------
    factor : of the gains.
    scale : factor up to which the gains in force are linearly stable here; at first that of `found`.
    needed : demanded `scale`, and the largest one that is tried: the true limit may be above it.
    assessed : forces of the last assessment, none before the first.
    is_assessed : whether what is commanded has been assessed, or presses nowhere.
    """

    def __init__(self, guard: StabilityGuard, task: GuardedTask, found: GuardAssessment) -> None:
        self._guard, self._task = guard, task
        self.needed = 1.0 / guard.parameters.stability_fraction
        self.assessed: Sequence[GuardedForces] = ()
        self.factor, self.scale = 1.0, found.scale
        self.restart()

    def restart(self) -> None:
        """Something else is commanded: it waits until it is assessed."""
        self._work: Iterator[bool] | None = None
        self._since, self.is_assessed = math.inf, False

    def step(self, where: Callable[[], Sequence[GuardedForces]], dt: float) -> bool:
        """Continue the present assessment, or begin one if it is due; True if it has ended.

        Parameters
        ----------
        where : gives the contacts that are possible now; called when an assessment is due.
        dt : outer period, s.
        """
        self._since += dt
        if self._work is None and self._since >= self._guard.parameters.interval:
            self._since = 0.0
            guarded = where()
            is_other = len(guarded) != len(self.assessed) or any(map(_differs, guarded, self.assessed))
            if guarded and is_other:
                self._work = self._assess(guarded)
            else:
                self.is_assessed = True
        has_ended = self._work is not None and next(self._work, True)
        if has_ended:
            self._work, self.is_assessed = None, True
        return has_ended

    def _assess(self, guarded: Sequence[GuardedForces]) -> Iterator[bool]:
        """One scale in each period; never true."""
        least = math.inf
        for scale in self._guard.scales(self._task, guarded, [part * self.needed for part in GUARD.scales]):
            least = min(least, scale)
            yield False
        self.assessed, self.scale, self.factor = guarded, least, min(least / self.needed, 1.0)


def _differs(one: GuardedForces, other: GuardedForces) -> bool:
    """Whether forces have other contacts, gains or other axes with them, or are measured in another way."""
    if len(one.contacts) != len(other.contacts) or any(map(_is_apart, one.contacts, other.contacts)):
        return True
    if one.others != other.others or any(a.tolist() != b.tolist() for a, b in zip(one[3:5], other[3:5], strict=True)):
        return True
    return bool(np.abs(one.sense - other.sense).max() > GUARD.turn * np.abs(other.sense).max())


def _is_apart(one: GuardedContact, other: GuardedContact) -> bool:
    turned = any(abs(a - b) > GUARD.turn for a, b in zip(one.q, other.q, strict=True))
    bent = any(abs(a - b) > GUARD.turn for a, b in zip(one.direction, other.direction, strict=True))
    shifted = max(abs(one.position - other.position), abs(one.position_sd - other.position_sd)) > GUARD.shift
    grown = not one.force / GUARD.growth <= other.force <= one.force * GUARD.growth
    return turned or bent or shifted or grown or one.cover != other.cover


def _lowered(given: ForceLoopParameters, taken: ForceLoopParameters) -> str:
    """Which parameters were lowered, and to what."""
    names = [one.name for one in fields(given) if getattr(given, one.name) != getattr(taken, one.name)]
    return "; ".join(f"{name} {listed(np.atleast_1d(getattr(taken, name)).tolist())}" for name in names)


def margin_text(scale: float, largest: float = GUARD.largest_scale, digits: int = 4) -> str:
    """Factor by which the gains may be larger; none above `largest` was tried."""
    return f"{min(scale, largest):.{digits}g}{' or more' * (scale >= largest)}"
