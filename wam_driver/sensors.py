"""Sensors: the plant's true state with resolution and seeded noise."""

from collections.abc import Sequence

import numpy as np

from wam_description.arm import Arm
from wam_description.parameters import each, require_fit
from wam_description.signals import State
from wam_driver.imperfections import SensorParameters


class SideSensors:
    """What measures the motors, or the joints: encoders and torques.

    With resolution or noise, the velocity is the difference of two readings over a period, as from a real
    counter; otherwise it is the true velocity.
    """

    def __init__(
        self,
        resolution: Sequence[float],
        noise: Sequence[float],
        torque_noise: Sequence[float],
        random: np.random.Generator,
    ) -> None:
        self._resolution, self._noise, self._torque_noise = list(resolution), list(noise), list(torque_noise)
        self._are_encoders_true = not any(resolution) and not any(noise)
        self._is_torque_true = not any(torque_noise)
        self._random = random
        self.reset()

    def reset(self) -> None:
        """Discard the last reading, so that the next velocity is zero."""
        self._last: list[float] | None = None

    def read(self, state: State, dt: float) -> State:
        """What is read of a true state, rad, rad/s and N m, (n,) each, `dt` seconds after the last reading."""
        if not self._are_encoders_true:
            noisy = self._with_noise(state.position, self._noise)
            angle = [round(a / step) * step if step else a for a, step in zip(noisy, self._resolution, strict=True)]
            velocity = [(b - a) / dt for a, b in zip(self._last or angle, angle, strict=True)]
            self._last = angle
            state = State(angle, velocity, state.effort)
        if not self._is_torque_true:
            state = state._replace(effort=self._with_noise(state.effort, self._torque_noise))
        return state

    def _with_noise(self, values: list[float], deviation: list[float]) -> list[float]:
        draws = self._random.standard_normal(len(values)).tolist()
        return [value + sd * draw for value, sd, draw in zip(values, deviation, draws, strict=True)]


class Sensors:
    """Motor encoders, joint encoders and strain gauges of an arm."""

    def __init__(self, arm: Arm, parameters: SensorParameters, random: np.random.Generator) -> None:
        require_fit(parameters, arm)
        n = arm.n
        self.motors = SideSensors(parameters.encoder_resolution, parameters.encoder_noise, (0.0,) * n, random)
        resolution = each(parameters.joint_encoder_resolution, n)
        self.joints = SideSensors(resolution, parameters.joint_encoder_noise, parameters.strain_noise, random)

    def reset(self) -> None:
        """Discard the last readings."""
        self.motors.reset()
        self.joints.reset()
