"""Motor amplifier: current asked for in, current that flows and torque that comes out."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sin

import numpy as np

from wam_description.arm import Motors
from wam_description.parameters import lengths, parameter


@dataclass(frozen=True)
class AmplifierParameters:
    """What the amplifiers do to the currents asked for."""

    thermal_time: float = parameter("time constant of the motors' windings", "s", low=0.1)
    deadband: tuple[float, ...] = parameter("current asked for below which nothing flows", "A", low=0.0)
    torque_ripple: tuple[float, ...] = parameter("ripple as a share of the torque (2.1.1)", low=0.0, high=1.0)
    ripple_cycles: tuple[int, ...] = parameter("cycles of that ripple per turn of the motor", low=1)
    current_noise: tuple[float, ...] = parameter("standard deviation of the current that flows", "A", low=0.0)


class Amplifier:
    """Clips each current to the motor's peak and, over time, to what the winding can stand.

    The winding's heat follows w' = ((i/i_continuous)^2 - w)/T; once w reaches 1 the current is
    held at the continuous limit until w has fallen (I2t).

    Parameters
    ----------
    motors : torque constants and limits.
    parameters : deadband, ripple, noise, heat.
    random : source of the noise.
    """

    def __init__(self, motors: Motors, parameters: AmplifierParameters, random: np.random.Generator) -> None:
        keys = ("deadband", "torque_ripple", "ripple_cycles", "current_noise")
        lengths("amplifier", motors.names, {key: getattr(parameters, key) for key in keys})
        self.torque_constant = list(motors.torque_constant)
        self.peak = [t / k for t, k in zip(motors.peak_torque, motors.torque_constant, strict=True)]
        self.continuous = [t / k for t, k in zip(motors.continuous_torque, motors.torque_constant, strict=True)]
        self.heat = [0.0] * len(self.peak)
        self._parameters = parameters
        self._is_noisy = any(parameters.current_noise)
        self._random = random

    def reset(self) -> None:
        """Forget the heat."""
        self.heat = [0.0] * len(self.peak)

    def step(self, currents: Sequence[float], dt: float) -> list[float]:
        """Currents that flow for `dt` seconds, A, (n,), for the currents asked for, A, (n,)."""
        parameters = self._parameters
        noise = self._random.standard_normal(len(self.peak)).tolist() if self._is_noisy else None
        flowing = []
        for i, current in enumerate(currents):
            limit = self.continuous[i] if self.heat[i] >= 1.0 else self.peak[i]
            if abs(current) < parameters.deadband[i]:
                current = 0.0  # noqa: PLW2901
            if noise and current:
                current += parameters.current_noise[i] * noise[i]  # noqa: PLW2901
            flowing.append(min(max(current, -limit), limit))
            ratio = flowing[i] / self.continuous[i]
            self.heat[i] += (ratio * ratio - self.heat[i]) * dt / parameters.thermal_time
        return flowing

    def nominal_torque(self, currents: Sequence[float]) -> list[float]:
        """Torque of the motors by their torque constants alone, N m, (n,): what is reported."""
        return [k * i for k, i in zip(self.torque_constant, currents, strict=True)]

    def torque(self, currents: Sequence[float], theta: Sequence[float]) -> list[float]:
        """Torque on the rotors at the angles theta, rad, with the ripple of the commutation, N m, (n,)."""
        torque = self.nominal_torque(currents)
        for i, (share, cycles) in enumerate(
            zip(self._parameters.torque_ripple, self._parameters.ripple_cycles, strict=True)
        ):
            if share:
                torque[i] *= 1.0 + share * sin(cycles * theta[i])
        return torque
