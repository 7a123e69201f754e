"""Motor amplifier: current asked for in, current that flows out."""

from wam_description.arm import Motors


class Amplifier:
    """Clips each current to the motor's peak and, over time, to what the winding can stand.

    The winding's heat follows w' = ((i/i_continuous)^2 - w)/T; once w reaches 1 the current is
    held at the continuous limit until w has fallen (I2t).

    Parameters
    ----------
    motors : torque constants and limits.
    thermal_time : time constant T of the winding, s.
    """

    def __init__(self, motors: Motors, thermal_time: float) -> None:
        self.torque_constant = list(motors.torque_constant)
        self.peak = [t / k for t, k in zip(motors.peak_torque, motors.torque_constant, strict=True)]
        self.continuous = [t / k for t, k in zip(motors.continuous_torque, motors.torque_constant, strict=True)]
        self.heat = [0.0] * len(self.peak)
        self._thermal_time = thermal_time

    def reset(self) -> None:
        """Forget the heat."""
        self.heat = [0.0] * len(self.peak)

    def step(self, currents: list[float], dt: float) -> list[float]:
        """Currents that flow for `dt` seconds, A, for the currents asked for, A."""
        flowing = []
        for i, current in enumerate(currents):
            limit = self.continuous[i] if self.heat[i] >= 1.0 else self.peak[i]
            flowing.append(min(max(current, -limit), limit))
            ratio = flowing[i] / self.continuous[i]
            self.heat[i] += (ratio * ratio - self.heat[i]) * dt / self._thermal_time
        return flowing

    def torque(self, currents: list[float]) -> list[float]:
        """Torque of the motors, N m, for the currents that flow, A."""
        return [k * i for k, i in zip(self.torque_constant, currents, strict=True)]
