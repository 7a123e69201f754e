"""Limits of the commanded joint velocities: near the ends of the joints, and where the world pushes back too hard."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_description.arm import Arm
from wam_description.parameters import parameter
from wam_description.rigid_body import RigidBody

Array = NDArray[np.float64]
PUSH_BACK = 0.3  # rad/s, at which a joint beyond its end is brought back, at most
BEGIN = 0.9  # of the largest contact force, from which motion against it is slowed down
REPORTED = 0.5  # of the speed against it, below which that is reported: the force comes near its limit ever more slowly


@dataclass(frozen=True)
class LimitParameters:
    """Where the force loop stops the arm."""

    joint_gain: float = parameter(
        "largest speed of a joint per distance from where it has to stop; 0: the ends of the joints are not watched",
        "1/s",
        low=0.0,
        high=100.0,
        live=True,
        before=0.0,
    )
    joint_margin: float = parameter(
        "distance from the end of a joint at which it has to stop", "rad", low=0.0, high=1.0, live=True, before=0.0
    )
    contact_force: float = parameter(
        "largest force on the arm, as far as the joints measure it; above it the arm does not move against it",
        "N",
        low=0.0,
        high=1e9,
        live=True,
        before=1e9,
    )
    whole_force: float = parameter(
        "largest force in all at a known position, per commanded force; above it the arm does not move against it",
        low=0.0,
        high=1e9,
        live=True,
        before=1e9,
    )
    impact: float = parameter(
        "predicted peak of the impact (3.1) on a surface of guard.contact_stiffness, per commanded force: it limits "
        "the speed along the force until something is touched; 0: no limit",
        low=0.0,
        high=1e3,
        live=True,
        before=0.0,
    )
    settling_time: float = parameter(
        "time after which a force that is still not reached is reported", "s", low=0.0, high=1e9, live=True, before=1e9
    )
    free_travel: float = parameter(
        "largest way along a commanded force without touching anything; then the arm holds its position",
        "m",
        low=0.0,
        high=1e9,
        live=True,
        before=1e9,
    )
    least_tolerance: float = parameter(
        "least error up to which a force counts as reached, however small it is",
        "N",
        low=0.0,
        high=1e3,
        live=True,
        before=0.3,
    )
    cycle_force: float = parameter(
        "swing of the measured force, per commanded force, from which it is reported as a limit cycle",
        low=0.0,
        high=1e9,
        live=True,
        before=1e9,
    )
    shake_force: float = parameter(
        "swing of the force, per commanded force, that a shaking arm (dither) may make on a surface of "
        "guard.contact_stiffness; above it the arm holds its position; with feedback contact_estimate",
        low=0.0,
        high=1e9,
        live=True,
        before=1e9,
    )
    surface_speed: float = parameter(
        "largest speed along the force of the surface that will be touched: a force that is off by more than "
        "sensing.reported_fraction while it follows is refused",
        "m/s",
        low=0.0,
        high=10.0,
        live=True,
        before=0.0,
    )
    slide_speed: float = parameter(
        "largest speed across the force of the surface that will be touched: one that comes nearer by more of the "
        "force than it may be off while the friction of the arm turns round is refused",
        "m/s",
        low=0.0,
        high=10.0,
        live=True,
        before=0.0,
    )


class WholeForce(NamedTuple):
    """A force that is commanded at a known place, N, and the one that is measured there in all, in any direction."""

    desired: float
    measured: Callable[[], float]


class Limited(NamedTuple):
    """Joint velocities (n,), rad/s, and why they are less than commanded, '' where they are not."""

    velocity: list[float]
    joint_end: str
    contact_force: str


class MotionLimits:
    """Limits the velocities of one arm.

    Parameters
    ----------
    arm : the arm as the controller knows it.
    body : its kinematics.
    parameters : the limits.
    """

    def __init__(self, arm: Arm, body: RigidBody, parameters: LimitParameters) -> None:
        self._joints, self._body, self._parameters = arm.joints, body, parameters

    def step(
        self,
        velocity: Sequence[float],
        q: Sequence[float],
        external: Array,
        position: tuple[str, float] | None = None,
        whole: WholeForce | None = None,
    ) -> Limited:
        """Limit commanded velocities.

        Parameters
        ----------
        velocity : commanded (n,), rad/s; empty for torque only, which is not limited.
        q : joint angles (n,), rad.
        external : torques of the world on the joints (n,), N m.
        position : cover and position along it, m, where the commanded force acts; None if that is not known.
        whole : the force in all there.
        """
        if not velocity:
            return Limited([], "", "")
        slowed, force = self._against_the_world(list(velocity), q, external, position, whole)
        stopped, end = self._before_the_ends(slowed, q)
        return Limited(stopped, end, force)

    def _against_the_world(
        self,
        velocity: list[float],
        q: Sequence[float],
        external: Array,
        position: tuple[str, float] | None,
        whole: WholeForce | None,
    ) -> tuple[list[float], str]:
        """Without the part that does work on the world, where its force is above the limit."""
        own, power = self._parameters, float(external.dot(velocity))
        if power >= 0.0:
            return velocity, ""
        most = own.contact_force
        force, limit = least_force(self._body, q, external, BEGIN * most, position), f"limits.contact_force, {most:g} N"
        part = _beyond(force, most)
        if whole and (allowed := own.whole_force * whole.desired) < most:
            found = whole.measured()
            if (beyond := _beyond(found, allowed)) > part:
                force, part = found, beyond
                limit = f"limits.whole_force, {own.whole_force:g} times the commanded {whole.desired:.3g} N"
        if not part:
            return velocity, ""
        slowed: list[float] = (np.array(velocity) - part * power / float(external @ external) * external).tolist()
        reason = (
            f"the world pushes with at least {force:.3g} N in all; allowed: {limit}; the arm does not move against it: "
            "command a direction or a posture away from it, or less force"
        )
        return slowed, reason if part > REPORTED else ""

    def _before_the_ends(self, velocity: list[float], q: Sequence[float]) -> tuple[list[float], str]:
        gain, margin = self._parameters.joint_gain, self._parameters.joint_margin
        if not gain:
            return velocity, ""
        joints, reason, limited = self._joints, "", []
        for name, low, angle, high, speed in zip(joints.names, joints.lower, q, joints.upper, velocity, strict=True):
            slowest, fastest = -_approach(angle - low, gain, margin), _approach(high - angle, gain, margin)
            limited.append(min(max(speed, slowest), fastest))
            end = low if speed < slowest else high
            if limited[-1] != speed and abs(angle - end) <= margin + PUSH_BACK / gain:
                reason = (
                    f"{name} is at {angle:.4g} rad, its end is {end:.4g} rad and limits.joint_margin {margin:g} rad: "
                    "it does not move on; command another posture or direction"
                )
        return limited, reason


def _beyond(force: float, most: float) -> float:
    """Part of the motion against a force, N, that the largest one takes away, 0 to 1."""
    return min(max((force - BEGIN * most) / max((1.0 - BEGIN) * most, 1e-9), 0.0), 1.0)


def _approach(distance: float, gain: float, margin: float) -> float:
    """Largest speed towards an end at this distance, rad/s; beyond the end negative, back from it."""
    if distance < 0.0:
        return max(gain * distance, -PUSH_BACK)
    return gain * max(distance - margin, 0.0)


def least_force(
    body: RigidBody, q: Sequence[float], external: Array, above: float = 0.0, position: tuple[str, float] | None = None
) -> float:
    """Smallest force, N, that gives external torques of this size: at a position along a cover, m, or at the tool.

    A force nearer to the base than the tool is larger.  One that is certainly not `above` this, N, is returned as 0:
    the singular values, squared, of the Jacobian have their mean below the largest.
    """
    jacobian = (
        body.tool_jacobian(q) if position is None else body.point_jacobian(q, position[0], (position[1], 0.0, 0.0))
    )
    size = math.sqrt(float(external.dot(external)))
    if size <= above * math.sqrt(float(np.vdot(jacobian, jacobian)) / 3.0):
        return 0.0
    largest = math.sqrt(float(np.linalg.eigvalsh(jacobian @ jacobian.T)[-1]))
    return size / largest if largest > 0.0 else 0.0
