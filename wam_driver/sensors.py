"""Sensors: the plant's true state with resolution and seeded noise."""

from collections.abc import Sequence

import numpy as np

from wam_description.arm import Arm
from wam_description.parameters import aligned, each
from wam_description.signals import State
from wam_driver.imperfections import SensorParameters


class Encoders:
    """Angles and velocities of shafts, as measured.

    With resolution or noise, the velocity is the difference of two readings over a period, as from a real
    counter; otherwise it is the true velocity.
    """

    def __init__(self, resolution: Sequence[float], noise: Sequence[float], random: np.random.Generator) -> None:
        self._resolution, self._noise, self._random = list(resolution), list(noise), random
        self._is_perfect = not any(resolution) and not any(noise)
        self._last: list[float] | None = None

    def reset(self) -> None:
        """Discard the last reading, so that the next velocity is zero."""
        self._last = None

    def read(self, angle: list[float], velocity: list[float], dt: float) -> tuple[list[float], list[float]]:
        """Angles, rad, and velocities, rad/s, `dt` seconds after the last reading."""
        if self._is_perfect:
            return angle, velocity
        draws = self._random.standard_normal(len(angle)).tolist()
        read = [a + sd * draw for a, sd, draw in zip(angle, self._noise, draws, strict=True)]
        read = [round(a / step) * step if step else a for a, step in zip(read, self._resolution, strict=True)]
        before = self._last
        self._last = read
        return read, [0.0] * len(read) if before is None else [(b - a) / dt for a, b in zip(before, read, strict=True)]


class Sensors:
    """Motor encoders, joint encoders and strain gauges of an arm."""

    def __init__(self, arm: Arm, parameters: SensorParameters, random: np.random.Generator) -> None:
        aligned("sensors", arm.motors.names, parameters)
        resolution = each(parameters.joint_encoder_resolution, len(arm.joints.names))
        self._motors = Encoders(parameters.encoder_resolution, parameters.encoder_noise, random)
        self._joints = Encoders(resolution, parameters.joint_encoder_noise, random)
        self._strain_noise = parameters.strain_noise
        self._is_strain_noisy = any(parameters.strain_noise)
        self._random = random

    def reset(self) -> None:
        """Discard the last readings."""
        self._motors.reset()
        self._joints.reset()

    def motors(self, theta: list[float], thetad: list[float], torque: list[float], dt: float) -> State:
        """Reading of the motor side, (n,) each: rad, rad/s, and the torque from the current, N m."""
        angle, velocity = self._motors.read(theta, thetad, dt)
        return State(angle, velocity, torque)

    def joints(self, q: list[float], qd: list[float], strain: list[float], dt: float) -> State:
        """Reading of the joint side, (n,) each: rad, rad/s, strain torque N m."""
        angle, velocity = self._joints.read(q, qd, dt)
        if self._is_strain_noisy:
            draws = self._random.standard_normal(len(strain)).tolist()
            strain = [t + sd * draw for t, sd, draw in zip(strain, self._strain_noise, draws, strict=True)]
        return State(angle, velocity, strain)
