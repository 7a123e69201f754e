"""Which parameters of the force loop are stable on the arm: domain, margin, and what would be accepted.

The linear part is the whole sampled loop of `wam_control.force.sampled_loop`, rotors, cables, velocity
loop, hold and delay, in contact with every stiffness up to the largest.  Below its margin no set
of parameters can diverge, whatever the friction (domain I).  Above it, friction may still stabilise
the loop for small errors (domain II); the guard does not rely on that.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np

from wam_control.force.force_axis import ForceAxes, ForceAxis, ForcePlace, SensingParameters
from wam_control.force.force_law import ForceLaw
from wam_control.force.sampled_loop import Axes, Feedback, SampledLoop
from wam_control.force.task import TaskAxis
from wam_control.force.thresholds import GUARD
from wam_description.arm import Arm, Servo, Timing
from wam_description.parameters import lengths, parameter
from wam_description.rigid_body import Array
from wam_description.signals import Triple
from wam_theory.friction_verdict import Domain, PredictedCycle, stiction_cycle
from wam_theory.linear_loop import series_stiffness
from wam_theory.rounding import rounded_down
from wam_theory.stick_slip import FrictionNode
from wam_theory.thresholds import DESIGN

ESTIMATE = "contact_estimate"
SCALES: tuple[float, ...] = (GUARD.least_scale, *np.geomspace(0.01, GUARD.largest_scale, 19).tolist())


@dataclass(frozen=True)
class GuardParameters:
    """Assumptions of the guard, and its reaction to unstable parameters."""

    mode: str = parameter(
        "off: no guard; warn: report unstable parameters; refuse: refuse them; limit: lower the gains, and "
        "posture_gain where no force gain is stable with it",
        choices=("off", "warn", "refuse", "limit"),
    )
    contact_stiffness: float = parameter("stiffness of the stiffest surface that the arm will touch", "N/m", low=1.0)
    posture: tuple[float, ...] = parameter(
        "joint angles at which parameters are assessed before the arm moves", "rad", within=13.0
    )
    stability_fraction: float = parameter(
        "accepted fraction of the largest gain that is stable without friction", low=0.05, high=1.0
    )
    feedback_lag: float = parameter(
        "time constant of the estimated force, with feedback contact_estimate", "s", high=10.0
    )
    extra_delay: int = parameter(
        "inner periods by which a command may be later than timing.outer_delay, as in realtime",
        high=100,
    )
    interval: float = parameter(
        "shortest time between two assessments while pose, force direction or contact position change",
        "s",
        low=0.01,
        high=3600.0,
    )


class GuardedTask(NamedTuple):
    """What the force loop controls, and how.

    Attributes
    ----------
    law : of the axes of the force.
    feedback : where the force comes from.
    hold_gain : posture gain, 1/s.
    filter_time : time constant of the low pass on the force, s.
    delay_samples : delay of the command in outer periods.
    """

    law: ForceLaw
    feedback: Feedback
    hold_gain: float
    filter_time: float
    delay_samples: int


class GuardedContact(NamedTuple):
    """A contact, and the force commanded there.

    Attributes
    ----------
    q : joint angles (n,), rad.
    cover, position, position_sd : position along the cover and its standard deviation, m.
    direction : of the force (3,), base frame.
    force : commanded, N.
    """

    q: tuple[float, ...]
    cover: str
    position: float
    position_sd: float
    direction: Triple
    force: float

    @property
    def contacts(self) -> tuple["GuardedContact", ...]:
        """Itself alone."""
        return (self,)


class GuardedForces(NamedTuple):
    """Forces at several contacts at once, which the guard considers together: two that are stable alone may not be.

    Attributes
    ----------
    contacts : all of them, in one posture.
    sense, move, gain, proportional_gain, hold, spring : as in `wam_control.force.sampled_loop.Axes`, of all axes of the
        task.
    others : axes that are no forces, without where they lead.
    """

    contacts: tuple[GuardedContact, ...]
    sense: Array
    move: Array
    gain: Array
    proportional_gain: Array
    hold: Array
    spring: Array
    others: tuple[TaskAxis, ...]

    @property
    def q(self) -> tuple[float, ...]:
        """Joint angles (n,), rad."""
        return self.contacts[0].q


Guarded = GuardedContact | GuardedForces


class GuardAssessment(NamedTuple):
    """What the guard finds at some contacts.

    Attributes
    ----------
    domain : of figure 5.8; below `stability_fraction` of the linear margin counts as I.
    scale : factor of the gains at which the loop becomes linearly unstable, up to `largest_scale`.
    stiffness : k_tr k_c/(k_tr + k_c) at the contact, N/m.
    cycle : stiction limit cycle by (5.8) and (5.9).
    where : the worst contact: direction of the force, position and posture.
    reason : why the parameters are refused, '' if they are accepted.
    """

    domain: Domain
    scale: float
    stiffness: float
    cycle: PredictedCycle
    where: str
    reason: str


@dataclass(frozen=True)
class StabilityGuard:
    """Assesses parameters of the force loop on one arm; guards with the same parameters are equal.

    Parameters
    ----------
    arm : the arm as the controller knows it.
    servo : gains of the velocity loop.
    timing : periods of the loops, and the delay of the outer one.
    parameters : of the guard.
    sensing : how the force is sensed.

    Raises
    ------
    ParameterError
        where lists do not fit the arm.
    """

    arm: Arm
    servo: Servo
    timing: Timing
    parameters: GuardParameters
    sensing: SensingParameters

    def __post_init__(self) -> None:
        lengths("guard", self.arm.joints.names, {"posture": self.parameters.posture})

    @cached_property
    def _loop(self) -> SampledLoop:
        return SampledLoop(self.arm, self.timing, self.servo)

    @cached_property
    def _force_axes(self) -> ForceAxes:
        return ForceAxes(self._loop.body, self.sensing)

    def contacts(
        self,
        q: Sequence[float],
        cover: str,
        position: float,
        position_sd: float,
        forces: Sequence[float] = GUARD.forces,
    ) -> list[GuardedContact]:
        """Contacts at a position of a cover, m: along both axes across it, with each of some forces, N."""
        rotation = self._loop.body.cover_pose(q, cover).rotation
        candidates = [
            GuardedContact(tuple(q), cover, position, position_sd, triple(rotation[:, axis]), force)
            for axis in (1, 2)
            for force in forces
        ]
        return [contact for each in candidates for contact in self.with_lever(each)]

    def with_lever(self, contact: GuardedContact) -> list[GuardedContact]:
        """The contact itself; nothing where its force has no lever on any joint."""
        return [contact] if self.axis(contact).force_sd < math.inf else []

    def axis(self, contact: GuardedContact) -> ForceAxis:
        """How the force loop senses the force of a contact, and moves along it."""
        return self._force_axes.axis(contact.q, ForcePlace(*contact[1:4]), np.array(contact.direction), contact.force)

    def scales(
        self, task: GuardedTask, contacts: Sequence[Guarded], tried: Sequence[float] = SCALES
    ) -> Iterator[float]:
        """Largest linearly stable scales of the gains, each for one contact or several, stiffness, delay and lag.

        One at a time, so that the work can be distributed over periods; the smallest counts.

        Parameters
        ----------
        task : what is controlled.
        contacts : contacts to consider.
        tried : scales to try, in rising order; the last one is returned where all are stable.
        """
        is_spring = task.feedback.kind == "joint_position"  # of its own stiffness alone
        parts = DESIGN.softer[:1] if is_spring else DESIGN.softer
        # a lag can also stabilise a loop, which is not relied on
        lags = sorted({0.0, task.feedback.lag if task.feedback.kind == ESTIMATE else 0.0})
        for each in contacts:
            levers = [self.axis(contact).lever for contact in each.contacts]
            alone = [self.parameters.contact_stiffness * np.outer(lever, lever) for lever in levers]
            together = [np.sum(alone, axis=0), *alone] if len(alone) > 1 else alone
            for late, lag in product(self._delays(task), lags):
                axes, feedback = self._axes(task, each, late), task.feedback._replace(lag=lag)
                for part, stiffness in product(parts, together):
                    yield self._loop.margin(each.q, axes, part * stiffness, feedback, tried)

    @lru_cache(maxsize=64)  # noqa: B019 - what a process has assessed lately is not computed again
    def assess(self, task: GuardedTask, contacts: tuple[GuardedContact, ...]) -> GuardAssessment:
        """Assess a task at its worst contact.

        Parameters
        ----------
        task : what is controlled.
        contacts : contacts to consider; none counts as a task that controls nothing.
        """
        law = task.law
        if not contacts or not any((*law.gain, *law.proportional_gain)):
            return GuardAssessment(
                Domain.I, GUARD.largest_scale, 0.0, PredictedCycle(0.0, 0.0, 0.0), "nothing is controlled", ""
            )
        scale, contact = min((min(self.scales(task, [each])), each) for each in contacts)
        node = self.node(contact)
        stiffness = float(series_stiffness(node.transmission_stiffness, node.contact_stiffness))
        along = f"force along {listed(contact.direction)} in the base frame"
        where = f"{along} at {contact.position:g} m along {contact.cover}, {posture_of(contact)}"
        domain = Domain.I if scale * self.parameters.stability_fraction >= 1.0 else Domain.BEYOND
        found = GuardAssessment(domain, scale, stiffness, stiction_cycle(node, max(law.gain)), where, "")
        if domain is Domain.I:
            return found
        return found._replace(reason=self._refusal(law, found) if scale else self._hopeless(task, contacts, found))

    def softer_hold(self, task: GuardedTask, contacts: Sequence[GuardedContact]) -> float:
        """A posture gain, 1/s, with which some force gain is stable where none is with the given one; 0 for none.

        A velocity loop whose gains are stable by themselves may be too slow for the posture that it has to hold.
        """
        halved = (task.hold_gain * 0.5**i for i in range(1, GUARD.halvings + 1))
        stable = (gain for gain in halved if self._controls(task._replace(hold_gain=gain), contacts))
        return self.parameters.stability_fraction * next(stable, 0.0)

    def _controls(self, task: GuardedTask, contacts: Sequence[GuardedContact]) -> bool:
        """Whether some force gain is stable."""
        return all(self.scales(task, contacts, SCALES[:1]))

    def accepted_scale(self, found: GuardAssessment) -> float:
        """Factor of the gains up to which they are accepted as domain I."""
        return (1.0 - GUARD.slack) * self.parameters.stability_fraction * found.scale

    def node(self, contact: GuardedContact) -> FrictionNode:
        """The arm as the one friction node of figure 5.4, along the direction of a force.

        With the friction of the joints alone: the velocity loop encloses that of the rotors.
        """
        joints, axis = self.arm.joints, self.axis(contact)
        reach = axis.lever
        square = float(reach @ reach)

        def along(matrix: Array) -> float:
            return 1.0 / float(reach @ np.linalg.solve(matrix, reach))

        def friction(values: Sequence[float]) -> float:
            return float(np.abs(reach) @ np.array(values)) / square

        damping = np.array(joints.viscous_friction)
        return FrictionNode(
            inertia=along(self._force_axes.inertia(contact.q)),
            damping=along(np.diag(damping)) if damping.all() else 0.0,
            transmission_stiffness=1.0 / axis.compliance,
            contact_stiffness=self.parameters.contact_stiffness,
            dynamic_friction=friction(joints.dynamic_friction),
            static_friction=friction(joints.static_friction),
        )

    def _refusal(self, law: ForceLaw, found: GuardAssessment) -> str:
        """Why gains above their linear margin are refused, and what would be accepted."""
        most = self.accepted_scale(found)
        surface = f"contact up to {self.parameters.contact_stiffness:g} N/m (guard.contact_stiffness)"
        return (
            f"force_gain {listed(law.gain)} is {1.0 / found.scale:.3g} times the largest linearly stable one, above "
            f"guard.stability_fraction, {self.parameters.stability_fraction:g}, so it counts as domain {found.domain}; "
            f"allowed: force_gain up to {listed([rounded_down(most * each) for each in law.gain])}; "
            f"worst case: {found.where}, {surface}"
        )

    def _hopeless(self, task: GuardedTask, contacts: Sequence[GuardedContact], found: GuardAssessment) -> str:
        """Why every force gain is refused, and what of that would help which was tried."""
        own, gain = self.parameters, self.softer_hold(task, contacts)
        half = replace(own, contact_stiffness=0.5 * own.contact_stiffness)
        ways = [f"lower posture_gain to {rounded_down(gain):g}"] * bool(gain)
        if replace(self, parameters=half)._controls(task, contacts):
            ways.append(f"declare softer surfaces (guard.contact_stiffness={half.contact_stiffness:g})")
        return (
            f"force_gain {listed(task.law.gain)} is not stable, nor is any smaller one ({found.where}, contact up to "
            f"{own.contact_stiffness:g} N/m); {' or '.join(ways) or 'change the gains of the velocity loop, servo'}"
        )

    def _delays(self, task: GuardedTask) -> list[int]:
        """Inner periods by which a command may be later; the mean over a cycle of a dither is half a cycle old."""
        extra = self.parameters.extra_delay
        mean = self.timing.dither_cycle // 2 if task.feedback.kind == ESTIMATE else 0
        return sorted({0, extra, extra + mean})

    def _axes(self, task: GuardedTask, contact: Guarded, late: int) -> Axes:
        timing = self.timing
        n = self.arm.n
        delay = task.delay_samples * timing.outer_divisor + timing.outer_delay + late
        if isinstance(contact, GuardedForces):
            return Axes(*contact[1:-1], task.filter_time, delay)
        axis, law = self.axis(contact), task.law
        lever = axis.lever
        hold = task.hold_gain * (np.eye(n) - np.outer(lever, lever) / float(lever @ lever))
        gains = np.array([max(law.gain)]), np.array([max(law.proportional_gain)])
        none = np.zeros((1, n))
        return Axes(axis.sense[None], axis.move[:, None], *gains, hold, none, task.filter_time, delay)


def posture_of(contact: GuardedContact) -> str:
    """The posture of a contact in words."""
    return f"posture {listed(contact.q)} rad"


def listed(values: Sequence[float]) -> str:
    """Numbers for people, to three digits."""
    return "[" + ", ".join(f"{0.0 if abs(value) < 1e-9 else value:.3g}" for value in values) + "]"


def triple(values: Array) -> Triple:
    """A vector (3,) as a tuple."""
    x, y, z = values.tolist()
    return x, y, z
