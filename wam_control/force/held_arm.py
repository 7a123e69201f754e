"""An arm that holds its position instead of controlling a force, and gives way where it is pressed harder than that."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.force.arm_push import ArmPush
from wam_control.force.force_axis import ForceAxis
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.given_way import GivenWay
from wam_control.force.hybrid_velocity import posture_velocity
from wam_control.force.thresholds import FORCE
from wam_control.thresholds import MOTION
from wam_description.rigid_body import RigidBody

Array = NDArray[np.float64]


class RetreatForce(NamedTuple):
    """A commanded force that is not controlled: its axis, and the speed along it by what is above it, m/s."""

    axis: ForceAxis
    speed: float


class HeldArm:
    """Holds a posture, and presses no harder than commanded on what comes.

    Along a force it goes back by what is measured there.  Whatever else pushes, from any side and where no force can
    be sensed, pushes with at least the smallest force that explains the torques, and moves the joints along these.

    Parameters
    ----------
    body : kinematics of the arm.
    given : how far the arm has given way.
    """

    def __init__(self, body: RigidBody, given: GivenWay) -> None:
        self._body, self._given = body, given
        self.release()

    def release(self) -> None:
        """Hold no longer."""
        self._at: list[float] = []
        self._has_arrived, self._pushed = False, 0.0

    @property
    def is_holding(self) -> bool:
        """Whether a posture is held."""
        return bool(self._at)

    @property
    def pushed(self) -> float:
        """Largest force, N, with which something has pushed the arm since it holds; 0 where nothing has."""
        return self._pushed

    def hold(self, at: Sequence[float]) -> None:
        """Hold a posture (n,), rad."""
        self._at, self._has_arrived, self._pushed = list(at), False, 0.0

    def step(
        self,
        q: Sequence[float],
        forces: Sequence[RetreatForce],
        push: ArmPush,
        inertia: Array,
        parameters: ForceLoopParameters,
    ) -> tuple[list[float], bool]:
        """Joint velocities (n,), rad/s, of one outer period, and whether the arm gives way.

        Parameters
        ----------
        q : joint angles (n,), rad.
        forces : that are commanded.
        push : what pushes.
        inertia : of the arm with its rotors at the joints (n, n), kg m^2.
        parameters : of the force loop.
        """
        limit = parameters.joint_speed_limit
        energy = parameters.impact_energy(push.allowed)
        back = _slowed(posture_velocity(self._at, q, parameters.posture_gain, limit), inertia, energy)
        self._has_arrived = (
            self._has_arrived or max(abs(a - b) for a, b in zip(self._at, q, strict=True)) < MOTION.arrived
        )
        least = push.least(self._body, q)
        is_yielding = least > push.allowed or any(force.speed for force in forces)
        if is_yielding:
            self._given.give()  # also where it may no further: what overpowers the motors still moves it
        if self._given.way >= parameters.limits.free_travel:
            push, is_yielding = push._replace(gain=0.0), False
        velocity = np.array(back)
        if least:
            velocity += push.correction(self._body, q, back, least, limit)
        if not is_yielding:
            return velocity.tolist(), False
        self._pushed = max(self._pushed, least)
        for force in forces:
            if force.speed:
                row = force.axis.lever
                velocity -= row * (float(row @ velocity) / float(row @ row))
        for force in forces:
            velocity += force.axis.move * force.speed
        velocity *= min(limit / max(float(np.abs(velocity).max()), FORCE.slowest), 1.0)
        if self._has_arrived:
            self._at = list(q)
        return velocity.tolist(), True


def _slowed(velocity: list[float], inertia: Array, energy: float) -> list[float]:
    """Velocities (n,), rad/s, with no more than this kinetic energy, J: something may be in the way."""
    fast = np.array(velocity)
    moving = 0.5 * float(fast @ inertia @ fast)
    slow: list[float] = (fast * math.sqrt(energy / moving)).tolist() if moving > energy else velocity
    return slow
