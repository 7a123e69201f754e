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
from wam_description.number_text import brief
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


AT_LEAST: Final = "at least {} N in all"
AT_COMMANDED: Final = "{} N in all, if it acts where the commanded force does"
AT_OTHER: Final = "at least {{}} N in all, if it acts in the middle of {}"
AT_ESTIMATED: Final = "at least {} N in all, if the estimated contact is on the right link"


class WholeForce(NamedTuple):
    """A force that presses on something.

    Attributes
    ----------
    desired : commanded, N, in all directions together.
    measured : the one in all, N, and its words, where the position of the commanded one is known; None where not.
    """

    desired: float
    measured: Callable[[], tuple[float, str] | None]


class Limited(NamedTuple):
    """Joint velocities (n,), rad/s, and why they are not those commanded, '' where they are."""

    velocity: list[float]
    joint_end: str
    contact_force: str


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
        self._how_known = ""  # that force: a lower bound, or the one at an assumed position
        self._reason, self._reported = "", 0.0  # the last one, and for how long, s, it is reported still

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
            return Limited([], "", "")
        slowed, force = self._against_the_world(list(velocity), q, push, whole)
        stopped, end = self._before_the_ends(slowed, q)
        if force:
            self._reason, self._reported = force, FORCE.lasting
        else:
            self._reported = max(self._reported - dt, 0.0)
        return Limited(stopped, end, self._reason if self._reported else "")

    def forget(self) -> None:
        """Report nothing any more of what has pushed."""
        self._pushed = self._reported = 0.0

    def _against_the_world(
        self, velocity: list[float], q: Sequence[float], push: ArmPush, whole: WholeForce | None
    ) -> tuple[list[float], str]:
        """Against a force that has come near the largest one no faster than the force law towards that one."""
        on = push.position[0] if push.position else ""
        if on != self._on:
            self._on, self._pushed = on, 0.0  # what pushes elsewhere was not this
        force, allowed, how_known = self._push(q, push, whole)
        if not self._pushed and force <= FORCE.slow_from * allowed:
            return velocity, ""
        has_room = self._given.way < self._parameters.free_travel
        push = push._replace(allowed=allowed, gain=push.gain if has_room or force < allowed else 0.0)
        missing = push.correction(self._body, q, velocity, force, self._fastest)
        is_bound = bool(missing.any())
        if not is_bound and force <= FORCE.slow_from * allowed:
            self._pushed = 0.0
            return velocity, ""
        if force > self._pushed:
            self._pushed, self._how_known = force, how_known
        limited: list[float] = (np.array(velocity) + missing).tolist()
        if force > allowed:
            self._given.give()
        if not is_bound and (force <= allowed or float(push.torques @ limited) > 0.0):
            return limited, ""  # by itself, the arm gives way fast enough
        limit = self._in_words(allowed, whole)
        return limited, (
            f"the world pushes with {self._how_known.format(brief(self._pushed))}; allowed: {limit}; from "
            f"{FORCE.slow_from:g} of "
            "that on the arm is slow against it, above it gives way by limits.free_travel at most, unless that "
            "overpowers its motors: command a direction or a posture away from it, or less force"
        )

    def _push(self, q: Sequence[float], push: ArmPush, whole: WholeForce | None) -> tuple[float, float, str]:
        """Force, N, the largest one allowed, of those that count here the one that is nearest to it, and its words."""
        own = self._parameters
        most, allowed = own.contact_force, own.whole_force * whole.desired if whole else math.inf
        least = push.least(self._body, q, FORCE.slow_from * min(most, allowed))
        if whole and allowed < most:
            force, words = whole.measured() or (least, AT_LEAST)
            if force * most >= least * allowed:
                return force, allowed, words
        return least, most, AT_ESTIMATED if push.is_estimated else AT_LEAST

    def _in_words(self, allowed: float, whole: WholeForce | None) -> str:
        own = self._parameters
        if whole is None or allowed == own.contact_force:
            return f"limits.contact_force, {own.contact_force:g} N"
        return f"limits.whole_force, {own.whole_force:g} times the commanded {whole.desired:.3g} N"

    def _before_the_ends(self, velocity: list[float], q: Sequence[float]) -> tuple[list[float], str]:
        gain, margin = self._parameters.joint_gain, self._parameters.joint_margin
        if not gain:
            return velocity, ""
        joints, reason, limited = self._joints, "", []
        for name, low, angle, high, speed in zip(joints.names, joints.lower, q, joints.upper, velocity, strict=True):
            slowest, fastest = -_approach(angle - low, gain, margin), _approach(high - angle, gain, margin)
            if slowest <= speed <= fastest:
                limited.append(speed)
                continue
            limited.append(min(max(speed, slowest), fastest))
            end = low if speed < slowest else high
            if limited[-1] != speed and abs(angle - end) <= margin + FORCE.push_back / gain:
                reason = (
                    f"{name} is at {angle:.4g} rad, its end is {end:.4g} rad and limits.joint_margin {margin:g} rad: "
                    "it does not move on; command another posture or direction"
                )
        return limited, reason


def _approach(distance: float, gain: float, margin: float) -> float:
    """Largest speed towards an end at this distance, rad/s; beyond the end negative, back from it."""
    if distance < 0.0:
        return max(gain * distance, -FORCE.push_back)
    return gain * max(distance - margin, 0.0)
