"""Which sets of the force loop are stable on the arm: domain, margin, and what would be accepted.

The linear part is the whole sampled loop of `wam_control.sampled_loop`, rotors, cables, velocity
loop, hold and delay, against every contact up to the stiffest one.  Below its margin no set can
diverge, whatever the friction (domain I).  Beyond it, what friction holds together depends on the
size of the error (domain II); that is relied on for an arm of one joint only, and never beyond the
saturation found stable.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.force_law import ForceLaw
from wam_control.friction_trial import stable_error
from wam_control.friction_verdict import SOFTER, Cycle, Domain, stiction_cycle
from wam_control.sampled_loop import Axes, Feedback, SampledLoop, Servo
from wam_description.arm import Arm, Timing
from wam_description.parameters import lengths, parameter
from wam_theory.linear_loop import series_stiffness
from wam_theory.stick_slip import FrictionNode

Array = NDArray[np.float64]
SMALLEST_LEVER = 0.05  # relative singular value below which a direction of force is left out
ESTIMATE = "contact_estimate"
LARGEST = 10.0  # scale of the gains above which no margin is looked for
SCALES: tuple[float, ...] = tuple(np.geomspace(0.01, LARGEST, 19).tolist())
SLACK = 0.003  # the search for a margin ends within 0.2 %
REACH = 1e-3  # m; a force whose lever on every joint is shorter cannot be applied


@dataclass(frozen=True)
class GuardParameters:
    """What the guard takes for granted, and what it does about a set that is not stable."""

    mode: str = parameter(
        "off: no guard; warn: says what it finds; refuse: refuses a set that is not stable; "
        "limit: lowers the saturation of a set in domain II to the stable error, refuses the rest",
        choices=("off", "warn", "refuse", "limit"),
        live=True,
    )
    contact_stiffness: float = parameter("stiffest surface that will be touched", "N/m", low=1.0, live=True)
    posture: tuple[float, ...] = parameter(
        "joint angles at which a set is judged before the arm moves", "rad", live=True
    )
    share: float = parameter(
        "part of the largest linearly stable gain that is accepted as domain I", low=0.05, high=1.0, live=True
    )
    servo_proportional: tuple[float, ...] = parameter(
        "proportional_gain of the velocity loop", "N m s/rad", low=0.0, live=True
    )
    servo_integral: tuple[float, ...] = parameter("integral_gain of the velocity loop", "N m/rad", low=0.0, live=True)
    feedback_lag: float = parameter(
        "time constant of the estimate in feedback contact_estimate", "s", low=0.0, live=True
    )
    late: int = parameter(
        "inner periods by which an answer may come later than timing.outer_delay, as in real time",
        low=0,
        high=100,
        live=True,
    )
    interval: float = parameter(
        "least time between two judgements while pose, direction or place change", "s", low=0.01, live=True
    )


class Task(NamedTuple):
    """What is controlled, as the force loop has it.

    Attributes
    ----------
    law : of the axes or the joints.
    is_joints : whether the joints are controlled, else the force along a direction.
    feedback : where the force comes from.
    hold_gain : posture gain, 1/s.
    filter_time : time constant of the low pass on the force, s.
    delay_samples : whole outer periods for which the answer is held back.
    """

    law: ForceLaw
    is_joints: bool
    feedback: Feedback
    hold_gain: float
    filter_time: float
    delay_samples: int


class Touch(NamedTuple):
    """Where the arm is and touches: joint angles (n,) rad, cover, place on it m, direction (3,) in the base frame."""

    q: tuple[float, ...]
    cover: str
    place: float
    direction: tuple[float, float, float]


class Judgement(NamedTuple):
    """What the guard finds.

    Attributes
    ----------
    domain : of figure 5.8; below `share` of the linear margin counts as I.
    scale : the gains may be so many times as large before the loop is linearly unstable, up to `LARGEST`.
    stable_error : largest saturation accepted, N or N m; infinite in domain I, 0 where none is.
    stiffness : k_tr k_c/(k_tr + k_c) at the contact or the joint, N/m or N m/rad.
    cycle : of stiction, by (5.8) and (5.9).
    where : the axis and the place that are worst.
    reason : why the set is refused, '' where it is accepted.
    """

    domain: Domain
    scale: float
    stable_error: float
    stiffness: float
    cycle: Cycle
    where: str
    reason: str


class StabilityGuard:
    """Judges sets of the force loop on one arm.

    Parameters
    ----------
    arm : as the controller knows it.
    timing : periods of the loops, and the delay of the outer one.
    parameters : of the guard.

    Raises
    ------
    ParameterError
        where lists do not fit the arm.
    """

    def __init__(self, arm: Arm, timing: Timing, parameters: GuardParameters) -> None:
        lengths("guard", arm.joints.names, {"posture": parameters.posture})
        gains = {key: getattr(parameters, key) for key in ("servo_proportional", "servo_integral")}
        lengths("guard", arm.motors.names, gains)
        self.parameters = parameters
        self._arm, self._timing = arm, timing
        servo = Servo(parameters.servo_proportional, parameters.servo_integral)
        self._loop = SampledLoop(arm, timing, servo)

    def touches(self, q: Sequence[float], cover: str, place: float) -> list[Touch]:
        """The touches that a place of a cover can have: against both axes across it, where they have a lever."""
        rotation = self._loop.body.cover_pose(q, cover).rotation
        candidates = [Touch(tuple(q), cover, place, _triple(rotation[:, axis])) for axis in (1, 2)]
        return [touch for each in candidates for touch in self.touching(each)]

    def touching(self, touch: Touch) -> list[Touch]:
        """The touch itself; nothing where its force has no lever on any joint."""
        lever = self._levers(touch)
        return [touch] if float(lever @ lever) > REACH * REACH else []

    def scales(self, task: Task, touches: Sequence[Touch], tried: Sequence[float] = SCALES) -> Iterator[float]:
        """Largest scales of the gains that are linearly stable, each for one contact and one delay.

        One at a time, so that the work can be spread over periods; the least of them counts.

        Parameters
        ----------
        task : what is controlled.
        touches : where.
        tried : scales that are tried, rising; the last one is returned where all are stable.
        """
        for touch in touches:
            contact = self._contact(touch)
            for late, feedback in product(sorted({0, self.parameters.late}), _lags(task.feedback)):
                axes = self._axes(task, touch, late)
                for part in self._parts(task):
                    yield self._loop.margin(touch.q, axes, part * contact, feedback, tried)

    def judge(self, task: Task, touches: Sequence[Touch]) -> Judgement:
        """The worst that a set comes to at some touches.

        Parameters
        ----------
        task : what is controlled.
        touches : where; none counts as a set that controls nothing.
        """
        law = task.law
        if not touches or not any((*law.gain, *law.proportional_gain)):
            return Judgement(Domain.I, LARGEST, math.inf, 0.0, Cycle(0.0, 0.0, 0.0), "nothing is controlled", "")
        scale, touch = min((min(self.scales(task, [each])), each) for each in touches)
        nodes = {name: self.node(task, touch, i) for i, name in enumerate(law.names)}
        cycles = {name: stiction_cycle(node, gain) for (name, node), gain in zip(nodes.items(), law.gain, strict=True)}
        name = max(cycles, key=lambda axis: cycles[axis].peak_to_peak)
        node = nodes[name]
        ktr, kc = node.transmission_stiffness, node.contact_stiffness
        where = f"{name} at {touch.place:g} m of {touch.cover}"
        domain = Domain.I if scale * self.parameters.share >= 1.0 else Domain.BEYOND
        found = Judgement(domain, scale, math.inf, float(series_stiffness(ktr, kc)), cycles[name], where, "")
        return found if domain is Domain.I else self._beyond(task, touch, found)

    def node(self, task: Task, touch: Touch, axis: int) -> FrictionNode:
        """The arm as the one friction node of figure 5.4, seen along the direction or at a joint.

        The joints' friction alone: that of the rotors stands behind the velocity loop.
        """
        joints, loop = self._arm.joints, self._loop
        lever = self._levers(touch)
        stiffness = self.parameters.contact_stiffness
        if task.is_joints:
            reach = np.zeros(len(joints.names))
            reach[axis] = 1.0
            jacobian = loop.body.point_jacobian(touch.q, touch.cover, (touch.place, 0.0, 0.0))
            stiffness *= float(np.sum(jacobian[:, axis] ** 2))
        else:
            reach = lever
        square = float(reach @ reach)
        inertia = loop.body.mass_matrix(touch.q) + loop.armature

        def along(matrix: Array) -> float:
            return 1.0 / float(reach @ np.linalg.solve(matrix, reach))

        def friction(values: Sequence[float]) -> float:
            return float(np.abs(reach) @ np.array(values)) / square

        damping = np.array(joints.viscous_friction)
        return FrictionNode(
            inertia=along(inertia),
            damping=along(np.diag(damping)) if damping.all() else 0.0,
            transmission_stiffness=along(loop.joint_stiffness),
            contact_stiffness=max(stiffness, 1e-9),
            dynamic_friction=friction(joints.dynamic_friction),
            static_friction=friction(joints.static_friction),
        )

    def _beyond(self, task: Task, touch: Touch, found: Judgement) -> Judgement:
        """The set beyond the margin: what would be accepted."""
        share, law = self.parameters.share, task.law
        group = law.group
        error, domain = 0.0, found.domain
        if len(self._arm.joints.names) == 1:
            error = self._stable_error(task, touch)
            domain = Domain.II if error else Domain.III
        found = found._replace(domain=domain, stable_error=error)
        if max(law.error_limit) <= error:
            return found
        most = (1.0 - SLACK) * share * found.scale
        allowed = f"{group}_gain up to {_list([_rounded_down(most * gain) for gain in law.gain])}"
        if error:
            allowed += f", or {group}_error_limit up to {_rounded_down(error):g} as it is (guard.mode limit sets it)"
        reason = (
            f"{group}_gain {_list(law.gain)} is {1.0 / max(found.scale, 1e-9):.3g} times the largest linearly stable "
            f"one (axis {found.where}, contact up to {self.parameters.contact_stiffness:g} N/m), of which guard.share, "
            f"{share:g}, is accepted: domain {domain}; allowed: {allowed}; lower one of them or guard.contact_stiffness"
        )
        if not found.scale:
            reason = (
                f"{group}_gain {_list(law.gain)} is not stable and neither is a hundredth of it "
                f"(axis {found.where}, contact up to {self.parameters.contact_stiffness:g} N/m); lower posture_gain, "
                f"{group}_proportional_gain or guard.contact_stiffness"
            )
        return found._replace(reason=reason)

    def _stable_error(self, task: Task, touch: Touch) -> float:
        """Largest saturation with which friction holds the set together at one joint, against every contact."""
        law = task.law
        node = self.node(task, touch, 0)
        least = math.inf
        for late in {0, self.parameters.late}:
            axes = self._axes(task, touch, late)
            for part in self._parts(task):
                softer = replace(node, contact_stiffness=part * node.contact_stiffness)
                cycle = stiction_cycle(softer, max(law.gain)).peak_to_peak
                contact = part * self._contact(touch)
                least = min(
                    least,
                    stable_error(self._loop, touch.q, axes, contact, task.feedback, softer, max(law.deadband), cycle),
                )
        return least

    def _parts(self, task: Task) -> tuple[float, ...]:
        """Parts of the stiffness that can be met; a known spring is what it is."""
        return SOFTER[:1] if task.feedback.kind == "joint_position" else SOFTER

    def _axes(self, task: Task, touch: Touch, late: int) -> Axes:
        timing = self._timing
        n = len(self._arm.joints.names)
        delay = task.delay_samples * timing.outer_divisor + timing.outer_delay + late
        law = task.law
        if task.is_joints:
            gains = np.array(law.gain), np.array(law.proportional_gain)
            return Axes(np.eye(n), np.eye(n), *gains, np.zeros((n, n)), 0.0, delay)
        lever = self._levers(touch)
        square = float(lever @ lever)
        jacobian = self._loop.body.point_jacobian(touch.q, touch.cover, (touch.place, 0.0, 0.0))
        sense = np.array(touch.direction) @ np.linalg.pinv(jacobian.T, rcond=SMALLEST_LEVER)
        hold = task.hold_gain * (np.eye(n) - np.outer(lever, lever) / square)
        gains = np.array([max(law.gain)]), np.array([max(law.proportional_gain)])
        return Axes(sense[None], lever[:, None] / square, *gains, hold, task.filter_time, delay)

    def _contact(self, touch: Touch) -> Array:
        lever = self._levers(touch)
        return self.parameters.contact_stiffness * np.outer(lever, lever)

    def _levers(self, touch: Touch) -> Array:
        """Torque on each joint per force along the direction, (n,), m."""
        jacobian = self._loop.body.point_jacobian(touch.q, touch.cover, (touch.place, 0.0, 0.0))
        result: Array = np.array(touch.direction) @ jacobian
        return result


def _lags(feedback: Feedback) -> list[Feedback]:
    """The feedback with its lag, and without: a lag can also steady a loop, and is not relied on."""
    return [feedback._replace(lag=lag) for lag in sorted({0.0, feedback.lag if feedback.kind == ESTIMATE else 0.0})]


def _rounded_down(value: float) -> float:
    """To three digits, never up: what is said to be allowed has to be accepted."""
    if not value:
        return 0.0
    digit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return math.floor(value / digit) * digit


def _list(values: Sequence[float]) -> str:
    return "[" + ", ".join(f"{value:.3g}" for value in values) + "]"


def _triple(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
