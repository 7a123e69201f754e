"""Motor amplifier: from the commanded to the actual current and the torque of the motor."""

from collections import deque
from collections.abc import Sequence
from math import exp, pi, sin
from operator import add, mul

import numpy as np

from wam_description.parts import Motors
from wam_driver.imperfections import AmplifierParameters


class Amplifier:
    """Clips each current to the motor's peak and, over time, to its thermal limit.

    The winding's heat follows w' = ((i/i_continuous)^2 - w)/T.  While w is 1 or more, the current is clipped
    to the continuous current (I2t).  The current follows its command after `delay` periods, with a lag of first order
    where the current loop has a bandwidth.

    Parameters
    ----------
    motors : torque constants and limits, as configured.
    parameters : deadband, ripple, noise, offset, thermal time constant.
    random : source of the noise.
    true_constant : torque of each true motor per current (n,), N m/A; None where it is as configured.

    Attributes
    ----------
    heat : w of each motor, 1 at the thermal limit.
    """

    def __init__(
        self,
        motors: Motors,
        parameters: AmplifierParameters,
        random: np.random.Generator,
        true_constant: Sequence[float] | None = None,
    ) -> None:
        self.torque_constant = list(motors.torque_constant)
        self._true_constant = list(true_constant or motors.torque_constant)
        self.peak = list(motors.peak_current)
        self.continuous = [t / k for t, k in zip(motors.continuous_torque, motors.torque_constant, strict=True)]
        self._parameters = parameters
        self._is_noisy = any(parameters.current_noise)
        ripples = zip(parameters.torque_ripple, parameters.ripple_cycles, strict=True)
        self._ripples = [(i, ripple, cycles) for i, (ripple, cycles) in enumerate(ripples) if ripple]
        self._offset = list(parameters.torque_offset) if any(parameters.torque_offset) else []
        self._random = random
        self._is_slow = parameters.bandwidth > 0.0 or parameters.delay > 0
        self.reset()

    def reset(self) -> None:
        """Let the motors be cold and without a current."""
        self.heat = [0.0] * len(self.peak)
        self.cut()

    def cut(self) -> None:
        """End every current at once, as the brakes do, and those that wait."""
        self._flowing = [0.0] * len(self.peak)
        self._waiting = deque([self._flowing] * self._parameters.delay)

    def step(self, currents: Sequence[float], dt: float) -> list[float]:
        """Actual currents over `dt` seconds, A, (n,), for the commanded currents, A, (n,)."""
        parameters, continuous, heat = self._parameters, self.continuous, self.heat
        time, deadband = parameters.thermal_time, parameters.deadband
        noise = self._random.standard_normal(len(self.peak)).tolist() if self._is_noisy else None
        actual = []
        if self._is_slow:
            currents = self._followed(currents, dt)
        for i, current in enumerate(currents):
            limit = continuous[i] if heat[i] >= 1.0 else self.peak[i]
            if -deadband[i] < current < deadband[i]:
                current = 0.0  # noqa: PLW2901
            if noise and current:
                current += parameters.current_noise[i] * noise[i]  # noqa: PLW2901
            limited = current if -limit <= current <= limit else min(max(current, -limit), limit)
            actual.append(limited)
            ratio = limited / continuous[i]
            heat[i] += (ratio * ratio - heat[i]) * dt / time
        return actual

    def _followed(self, currents: Sequence[float], dt: float) -> list[float]:
        """Currents of a loop with a delay and a lag, A, (n,), at the end of `dt`."""
        self._waiting.append([min(max(i, -peak), peak) for i, peak in zip(currents, self.peak, strict=True)])
        wanted, bandwidth = self._waiting.popleft(), self._parameters.bandwidth
        left = exp(-2.0 * pi * bandwidth * dt) if bandwidth else 0.0
        self._flowing = [to + left * (now - to) for to, now in zip(wanted, self._flowing, strict=True)]
        return self._flowing

    def nominal_torque(self, currents: Sequence[float]) -> list[float]:
        """Torque of the motors from their torque constants, N m, (n,): the reported torque."""
        return list(map(mul, self.torque_constant, currents))

    def torque(self, currents: Sequence[float], theta: Sequence[float]) -> list[float]:
        """Torque on the rotors at the angles theta, rad, with offset and ripple of the commutation, N m, (n,)."""
        torque = list(map(mul, self._true_constant, currents))
        if self._offset:
            torque = list(map(add, torque, self._offset))
        for i, ripple, cycles in self._ripples:
            torque[i] *= 1.0 + ripple * sin(cycles * theta[i])
        return torque
