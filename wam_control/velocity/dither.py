"""Dither: a small alternating motor torque, so that friction does not hide a contact while the arm is at rest.

Coulomb friction on a shaft that slips back and forth cancels over a whole cycle; the remaining torque
is external.  The torque of a shaft that sticks carries no information.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wam_control.thresholds import VELOCITY
from wam_description.arm import Arm, Timing
from wam_description.parameters import lengths, parameter, require
from wam_description.rigid_body import RigidBody


@dataclass(frozen=True)
class DitherParameters:
    """Size and shape of the dither; its period is `timing.dither_cycle`."""

    level: float = parameter(
        "torque amplitude of the dither, divided by the motor torque that overcomes static friction; 0: off",
        high=3.0,
        live=True,
    )
    phase: tuple[float, ...] = parameter("phase of each motor's dither, in cycles", within=1.0)

    def require_fit(self, arm: Arm) -> None:
        """Refuse phases that are not one for each motor."""
        lengths("dither", arm.motors.names, {"phase": self.phase})


class DitherCost(NamedTuple):
    """Side effects of the dither.

    Attributes
    ----------
    tip_motion : m, peak to peak, of the tool without any friction; with friction it is far less.
    heat : (n,), heat in each winding per rated (continuous) heat.
    """

    tip_motion: float
    heat: tuple[float, ...]


class Dither:
    """Torques of the dither as a function of the state's stamp: the same in every run.

    Parameters
    ----------
    arm : the arm; the amplitudes come from its friction.
    timing : `dither_cycle` 0 is no dither.
    parameters : level and phases.
    """

    def __init__(self, arm: Arm, timing: Timing, parameters: DitherParameters) -> None:
        parameters.require_fit(arm)
        require(
            timing.dither_cycle == 0 or timing.dither_cycle >= VELOCITY.shortest_cycle,
            f"parameter 'timing.dither_cycle' is {timing.dither_cycle}; it must be 0 or at "
            f"least {VELOCITY.shortest_cycle}",
        )
        self._arm, self._parameters = arm, parameters
        self._period_ns, cycle = timing.period_ns, timing.dither_cycle
        self._angular_frequency = 2.0 * math.pi / (cycle * timing.period) if cycle else 0.0
        self.amplitude = [parameters.level * level if cycle else 0.0 for level in friction_at_motors(arm)]
        self._torque = [
            [
                a * math.sin(2.0 * math.pi * (k / cycle + phase))
                for a, phase in zip(self.amplitude, parameters.phase, strict=True)
            ]
            for k in range(cycle)
        ]

    def torque(self, stamp: int) -> list[float]:
        """Torque added to each motor, (n,), N m, at a stamp, ns; empty without dither."""
        return self._torque[stamp // self._period_ns % len(self._torque)] if self._torque else []

    def added(self, stamp: int, effort: Sequence[float]) -> Sequence[float]:
        """Feed-forward torques plus dither, (n,), N m."""
        return [a + b for a, b in zip(effort, self.torque(stamp), strict=True)] if self._torque else effort

    def cost(self, q: Sequence[float]) -> DitherCost:
        """Side effects of the dither in pose q, (n,), rad.

        x = J M^-1 tau/omega^2 with the rotors and pulleys in M, the largest over a cycle; heat
        (tau_rms/tau_continuous)^2.
        """
        arm = self._arm
        heat = tuple(
            0.5 * (a / most) ** 2 for a, most in zip(self.amplitude, arm.motors.continuous_torque, strict=True)
        )
        if not self._torque:
            return DitherCost(0.0, heat)
        body = RigidBody(arm)
        inertia = body.mass_matrix(q) + arm.rotors + arm.pulleys
        efforts = np.array([arm.transmission.joint_torques(torque) for torque in self._torque])
        moved = body.tool_jacobian(q) @ np.linalg.solve(inertia, efforts.T) / self._angular_frequency**2
        return DitherCost(2.0 * float(np.linalg.norm(moved, axis=0).max()), heat)


def friction_at_motors(arm: Arm) -> list[float]:
    """Torque of each motor, (n,), N m, that overcomes its own static friction and its share of the joints'.

    A joint that several motors drive is divided among them in proportion to their transmission ratios.
    """
    inverse = np.abs(arm.transmission.motor_from_joint)
    share = inverse / inverse.sum(axis=0)
    joints = np.array(arm.joints.static_friction)
    borne = np.divide(share * joints, inverse, out=np.zeros_like(share), where=inverse > 0.0)
    return [float(own + carried) for own, carried in zip(arm.motors.static_friction, borne.sum(axis=1), strict=True)]
