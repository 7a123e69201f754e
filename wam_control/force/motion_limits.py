"""Limits of the commanded joint velocities: near the ends of the joints, and where the world pushes back too hard."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.force.arm_push import ArmPush
from wam_control.force.given_way import GivenWay
from wam_control.force.thresholds import FORCE
from wam_description.arm import Arm
from wam_description.event import Code, Event, Value, warning
from wam_description.parameters import tunable
from wam_description.rigid_body import RigidBody

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LimitParameters:
    """Where the force loop stops the arm."""

    joint_gain: float = tunable(
        "largest speed of a joint per distance from where it has to stop; 0: the ends of the joints are not watched",
        "1/s",
        high=100.0,
    )
    joint_margin: float = tunable("distance from the end of a joint at which it has to stop", "rad", high=1.0)
    contact_force: float = tunable(
        "largest force on the arm, as far as the joints measure it; above it the arm gives way", "N"
    )
    whole_force: float = tunable(
        "largest force in all, per commanded force, at its position or, where that is not known, wherever it acts; "
        "above it the arm gives way",
    )
    impact: float = tunable(
        "predicted peak of the impact (3.1) on a surface of guard.contact_stiffness, per commanded force: it limits "
        "the speed along the force until something is touched; 0: no limit",
        high=1e3,
    )
    settling_time: float = tunable("time after which a force that is still not reached is reported", "s", low=1e-3)
    free_travel: float = tunable(
        "largest way along a commanded force that is not right, or back against it with what pushes; then the arm "
        "holds its position",
        "m",
    )
    least_tolerance: float = tunable(
        "least error up to which a force counts as reached, however small it is", "N", high=1e3
    )
    cycle_force: float = tunable(
        "swing of the measured force, per commanded force, from which it is reported as a limit cycle"
    )
    shake_force: float = tunable(
        "swing of the force, per commanded force, that a shaking arm (dither) may make on a surface of "
        "guard.contact_stiffness; above it the arm holds its position; with feedback contact_estimate",
    )
    surface_speed: float = tunable(
        "largest speed along the force of the surface that will be touched: a force that is off by more than "
        "sensing.reported_fraction while it follows is refused",
        "m/s",
        high=10.0,
    )
    slide_speed: float = tunable(
        "largest speed across the force of the surface that will be touched: one that comes nearer by more of the "
        "force than it may be off while the friction of the arm turns round is refused",
        "m/s",
        high=10.0,
    )


HowKnown = tuple[str, str]  # how a force is known, and the cover in whose middle it is assumed
AT_LEAST: Final[HowKnown] = ("at_least", "")
AT_COMMANDED: Final[HowKnown] = ("at_commanded", "")
AT_ESTIMATED: Final[HowKnown] = ("at_estimated", "")
AT_MIDDLE: Final = "at_middle"


class WholeForce(NamedTuple):
    """A force that presses on something.

    Attributes
    ----------
    desired : commanded, N, in all directions together.
    measured : the one in all, N, and how it is known, where the position of the commanded one is known;
        None where not.
    """

    desired: float
    measured: Callable[[], tuple[float, HowKnown] | None]


class Limited(NamedTuple):
    """Joint velocities (n,), rad/s, and why they are not those commanded, None where they are."""

    velocity: list[float]
    joint_end: Event | None
    contact_force: Event | None


class MotionLimits:
    """Limits the velocities of one arm.

    What pushes harder than allowed is not moved against, and the arm gives way to it: at rest its velocity loops would
    hold it against whatever comes.

    Parameters
    ----------
    arm : the arm as the controller knows it.
    body : its kinematics.
    parameters : the limits.
    fastest : speed of a joint, rad/s, with which the arm gives way at most.
    given : how far it has.
    """

    def __init__(self, arm: Arm, body: RigidBody, parameters: LimitParameters, fastest: float, given: GivenWay) -> None:
        self._joints, self._body, self._parameters, self._fastest = arm.joints, body, parameters, fastest
        self._given, self._pushed = given, 0.0  # N, in the present push
        self._on = ""  # the cover that is pushed, '' where that is not known
        self._how_known = AT_LEAST  # that force: a lower bound, or the one at an assumed position
        self._event: Event | None = None  # the last one
        self._reported = 0.0  # s, for which it is reported still

    def step(
        self,
        velocity: Sequence[float],
        q: Sequence[float],
        push: ArmPush,
        dt: float,
        whole: WholeForce | None = None,
    ) -> Limited:
        """Limit commanded velocities.

        Parameters
        ----------
        velocity : commanded (n,), rad/s; empty for torque only, which is not limited.
        q : joint angles (n,), rad.
        push : what pushes, where the commanded force, or else an estimated contact acts, if that is known.
        dt : outer period, s.
        whole : the commanded force, if something is pressed.
        """
        if not velocity:
            return Limited([], None, None)
        slowed, force = self._against_the_world(list(velocity), q, push, whole)
        stopped, end = self._before_the_ends(slowed, q)
        if force:
            self._event, self._reported = force, FORCE.lasting
        else:
            self._reported = max(self._reported - dt, 0.0)
        return Limited(stopped, end, self._event if self._reported else None)

    def forget(self) -> None:
        """Report nothing any more of what has pushed."""
        self._pushed = self._reported = 0.0

    def _against_the_world(
        self, velocity: list[float], q: Sequence[float], push: ArmPush, whole: WholeForce | None
    ) -> tuple[list[float], Event | None]:
        """Against a force that has come near the largest one no faster than the force law towards that one."""
        on = push.position[0] if push.position else ""
        if on != self._on:
            self._on, self._pushed = on, 0.0  # what pushes elsewhere was not this
        force, allowed, how_known = self._push(q, push, whole)
        if not self._pushed and force <= FORCE.slow_from * allowed:
            return velocity, None
        has_room = self._given.way < self._parameters.free_travel
        push = push._replace(allowed=allowed, gain=push.gain if has_room or force < allowed else 0.0)
        missing = push.correction(self._body, q, velocity, force, self._fastest)
        is_bound = bool(missing.any())
        if not is_bound and force <= FORCE.slow_from * allowed:
            self._pushed = 0.0
            return velocity, None
        if force > self._pushed:
            self._pushed, self._how_known = force, how_known
        limited: list[float] = (np.array(velocity) + missing).tolist()
        if force > allowed:
            self._given.give()
        if not is_bound and (force <= allowed or float(push.torques @ limited) > 0.0):
            return limited, None  # by itself, the arm gives way fast enough
        own, (known, cover) = self._parameters, self._how_known
        values: dict[str, Value] = {"force": self._pushed, "known": known, "cover": cover, "begin": FORCE.slow_from}
        if whole is None or allowed == own.contact_force:
            values |= {"limit": "contact_force", "allowed": own.contact_force}
        else:
            values |= {"limit": "whole_force", "allowed": own.whole_force, "desired": whole.desired}
        return limited, warning(Code.CONTACT_FORCE, "contact_force", **values)

    def _push(self, q: Sequence[float], push: ArmPush, whole: WholeForce | None) -> tuple[float, float, HowKnown]:
        """Force, N, the largest one allowed, of those that count here the one nearest to it, and how it is known."""
        own = self._parameters
        most, allowed = own.contact_force, own.whole_force * whole.desired if whole else math.inf
        least = push.least(self._body, q, FORCE.slow_from * min(most, allowed))
        if whole and allowed < most:
            force, known = whole.measured() or (least, AT_LEAST)
            if force * most >= least * allowed:
                return force, allowed, known
        return least, most, AT_ESTIMATED if push.is_estimated else AT_LEAST

    def _before_the_ends(self, velocity: list[float], q: Sequence[float]) -> tuple[list[float], Event | None]:
        gain, margin = self._parameters.joint_gain, self._parameters.joint_margin
        if not gain:
            return velocity, None
        joints, limited = self._joints, []
        reason: Event | None = None
        for name, low, angle, high, speed in zip(joints.names, joints.lower, q, joints.upper, velocity, strict=True):
            slowest, fastest = -_approach(angle - low, gain, margin), _approach(high - angle, gain, margin)
            if slowest <= speed <= fastest:
                limited.append(speed)
                continue
            limited.append(min(max(speed, slowest), fastest))
            end = low if speed < slowest else high
            if limited[-1] != speed and abs(angle - end) <= margin + FORCE.push_back / gain:
                reason = warning(Code.JOINT_END, "joint_end", joint=name, angle=angle, end=end, margin=margin)
        return limited, reason


def _approach(distance: float, gain: float, margin: float) -> float:
    """Largest speed towards an end at this distance, rad/s; beyond the end negative, back from it."""
    if distance < 0.0:
        return max(gain * distance, -FORCE.push_back)
    return gain * max(distance - margin, 0.0)
