"""The inner loop: a velocity servo on each motor, with torque feed-forward (section 5.1.2)."""

from collections.abc import Sequence
from dataclasses import dataclass

from wam_control.dither import DitherParameters
from wam_description.arm import Motors
from wam_description.parameters import parameter, require


@dataclass(frozen=True)
class VelocityLoopParameters:
    """Gains of the velocity servo, one per motor, and the dither on top of it."""

    dither: DitherParameters
    proportional_gain: tuple[float, ...] = parameter("torque per velocity error", "N m s/rad", low=0.0, live=True)
    integral_gain: tuple[float, ...] = parameter("torque per angle error", "N m/rad", low=0.0, live=True)
    command_timeout: float = parameter(
        "age at which a velocity command, also an empty one, no longer counts and the motors are held still",
        "s",
        low=0.001,
    )

    def __post_init__(self) -> None:
        require(
            len(self.proportional_gain) == len(self.integral_gain),
            f"proportional_gain has {len(self.proportional_gain)} values, integral_gain {len(self.integral_gain)}; "
            "give one of each per motor",
        )


class VelocityLoop:
    """PI control of motor velocity plus feed-forward; torque asked for, as current.

    tau = K_p e + K_i integral(e) + tau_ff, e = commanded minus measured velocity, clipped to the
    peak torque; i = tau/k_t.  The integral stands still where it would only push further into a
    limit, and starts anew where the torque asked for does not flow at all (brakes, fault), so that
    an enabled arm starts without a jolt.
    """

    def __init__(self, motors: Motors, parameters: VelocityLoopParameters) -> None:
        self._peak = motors.peak_torque
        self._constant = motors.torque_constant
        self._integral = [0.0] * len(self._peak)
        self._asked = [0.0] * len(self._peak)
        self.tune(parameters)

    def tune(self, parameters: VelocityLoopParameters) -> None:
        """Take new gains; the integral, kept as a torque, does not jump."""
        require(
            len(parameters.proportional_gain) == len(self._peak),
            f"proportional_gain has {len(parameters.proportional_gain)} values; the arm has {len(self._peak)} motors",
        )
        self._kp, self._ki = parameters.proportional_gain, parameters.integral_gain
        self._timeout = parameters.command_timeout

    def step(
        self,
        thetad: Sequence[float],
        tau_motor: Sequence[float],
        command: Sequence[float],
        command_age: float,
        feedforward: Sequence[float],
        dt: float,
    ) -> list[float]:
        """Currents that answer one measurement.

        Parameters
        ----------
        thetad : measured motor velocities (n,), rad/s.
        tau_motor : torques that the motors gave in the last period (n,), N m.
        command : motor velocities asked for (n,), rad/s; empty for torque only.
        command_age : time since the state that the command answers, s; an old command, also one for torque
            only, counts as zero velocity.
        feedforward : torques (n,), N m.
        dt : time since the last measurement, s.

        Returns
        -------
        list of float
            currents (n,), A.
        """
        if command_age > self._timeout:
            command = [0.0] * len(self._peak)
        currents = []
        for i, peak in enumerate(self._peak):
            if not command:
                self._integral[i] = 0.0
                torque = feedforward[i]
            else:
                if tau_motor[i] == 0.0 and self._asked[i] != 0.0:
                    self._integral[i] = 0.0
                error = command[i] - thetad[i]
                torque = self._kp[i] * error + self._integral[i] + feedforward[i]
                growth = self._ki[i] * error * dt
                if abs(torque) < peak or torque * growth < 0.0:
                    self._integral[i] += growth
                    torque += growth
            torque = min(max(torque, -peak), peak)
            self._asked[i] = torque
            currents.append(torque / self._constant[i])
        return currents
