"""The inner loop: a velocity servo on each motor, with torque feed-forward (section 5.1.2)."""

from collections.abc import Sequence
from dataclasses import dataclass

from wam_control.dither import DitherParameters
from wam_description.arm import Motors, Servo
from wam_description.parameters import lengths, parameter

DEAD = 0.02  # of the peak torque: a smaller one may be lost in the deadband of an amplifier, not in brakes


@dataclass(frozen=True)
class VelocityLoopParameters:
    """Dither and time limit of the velocity loop; its gains are `wam_description.arm.Servo`."""

    dither: DitherParameters
    command_timeout: float = parameter(
        "age at which a velocity command, also an empty one, is stale: zero velocity is commanded",
        "s",
        low=0.001,
    )


class VelocityLoop:
    """PI control of motor velocity plus torque feed-forward, as motor currents.

    tau = K_p e + K_i integral(e) + tau_ff, e = commanded minus measured velocity, clipped to the
    peak torque; i = tau/k_t.  The integral is frozen where it would only push further into a limit
    (anti-windup), and reset where the commanded torque does not act at all (brakes, fault), so that
    an enabled arm starts without a jolt.  It grows through the deadband of an amplifier.
    """

    def __init__(self, motors: Motors, servo: Servo, parameters: VelocityLoopParameters) -> None:
        self._motors = motors
        self._peak = motors.peak_torque
        self._constant = motors.torque_constant
        self._integral = [0.0] * len(self._peak)
        self._commanded = [0.0] * len(self._peak)
        self.tune(servo, parameters)

    def tune(self, servo: Servo, parameters: VelocityLoopParameters) -> None:
        """Take new gains; the integral, kept as a torque, does not jump.

        Raises
        ------
        ParameterError
            where there is not one of each gain per motor; the gains in use stay.
        """
        lengths("servo", self._motors.names, vars(servo))
        self._kp, self._ki = servo.proportional_gain, servo.integral_gain
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
        """Currents for one measurement.

        Parameters
        ----------
        thetad : measured motor velocities (n,), rad/s.
        tau_motor : torques that the motors gave in the last period (n,), N m.
        command : commanded motor velocities (n,), rad/s; empty for torque only.
        command_age : time since the state that the command answers, s; a stale command, also one for torque
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
                if tau_motor[i] == 0.0 and abs(self._commanded[i]) > DEAD * peak:
                    self._integral[i] = 0.0
                error = command[i] - thetad[i]
                torque = self._kp[i] * error + self._integral[i] + feedforward[i]
                growth = self._ki[i] * error * dt
                if abs(torque) < peak or torque * growth < 0.0:
                    self._integral[i] += growth
                    torque += growth
            torque = min(max(torque, -peak), peak)
            self._commanded[i] = torque
            currents.append(torque / self._constant[i])
        return currents
