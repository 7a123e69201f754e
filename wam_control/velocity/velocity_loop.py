"""The inner loop: a velocity servo on each motor, with torque feed-forward (section 5.1.2)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from wam_control.thresholds import VELOCITY
from wam_control.velocity.dither import DitherParameters
from wam_control.velocity.servo_guard import ServoGuardParameters
from wam_description.arm import Servo
from wam_description.parameters import parameter
from wam_description.parts import Motors
from wam_description.wiring import Input, reaction


@dataclass(frozen=True)
class VelocityLoopParameters:
    """Dither, guard and limits of the velocity loop; its gains are `wam_description.arm.Servo`."""

    dither: DitherParameters
    guard: ServoGuardParameters
    acceleration_limit: float = parameter(
        "largest rate at which the commanded motor velocity changes", "rad/s^2", low=1.0, high=1e12
    )
    torque_rate_limit: float = parameter(
        "largest rate at which the feed-forward torque of a motor changes", "N m/s", low=1.0, high=1e12
    )


class VelocityLoop:
    """PI control of motor velocity plus torque feed-forward, as motor currents.

    tau = K_p e + K_i integral(e) + tau_ff, e = commanded minus measured velocity, clipped to the
    peak torque; i = tau/k_t.  The integral is frozen where it would only push further into a limit
    (anti-windup), and reset where the commanded torque does not act at all (brakes, fault), so that
    an enabled arm starts without a jolt.  It grows through the deadband of an amplifier.  Commanded velocity and
    feed-forward follow their commands no faster than their rate limits, from the measured velocity and from zero.
    """

    def __init__(self, motors: Motors, servo: Servo, parameters: VelocityLoopParameters) -> None:
        self._limits = list(zip(motors.peak_torque, motors.torque_constant, strict=True))
        n = len(self._limits)
        self._integral, self._commanded, self._velocity, self._feedforward = ([0.0] * n for _ in range(4))
        self._kp, self._ki = servo.proportional_gain, servo.integral_gain
        self._acceleration, self._torque_rate = parameters.acceleration_limit, parameters.torque_rate_limit

    def step(
        self,
        thetad: Sequence[float],
        tau_motor: Sequence[float],
        command: Sequence[float],
        feedforward: Sequence[float],
        dt: float,
    ) -> list[float]:
        """Currents for one measurement.

        Parameters
        ----------
        thetad : measured motor velocities (n,), rad/s.
        tau_motor : torques that the motors gave in the last period (n,), N m.
        command : commanded motor velocities (n,), rad/s; empty for torque only.
        feedforward : torques (n,), N m.
        dt : time since the last measurement, s.

        Returns
        -------
        list of float
            currents (n,), A.
        """
        currents, integral, commanded = [], self._integral, self._commanded
        velocities, carried, kp, ki = self._velocity, self._feedforward, self._kp, self._ki
        faster, stronger = self._acceleration * dt, self._torque_rate * dt
        for i, (peak, constant) in enumerate(self._limits):
            added, speed = feedforward[i], thetad[i]
            if not -stronger <= added - carried[i] <= stronger:  # so that NaN goes no further
                added = _toward(added, carried[i], stronger)
            carried[i] = torque = added
            if not command:
                integral[i] = 0.0
                velocities[i] = speed
            else:
                if tau_motor[i] == 0.0 and commanded[i] != 0.0:
                    velocities[i] = speed
                    integral[i] *= abs(commanded[i]) <= VELOCITY.deadband * peak
                velocity = command[i]
                if not -faster <= velocity - velocities[i] <= faster:
                    velocity = _toward(velocity, velocities[i], faster)
                velocities[i] = velocity
                error = velocity - speed
                torque = kp[i] * error + integral[i] + added
                growth = ki[i] * error * dt
                if -peak < torque < peak or torque * growth < 0.0:
                    integral[i] += growth
                    torque += growth
            commanded[i] = torque = torque if -peak <= torque <= peak else min(max(torque, -peak), peak)
            currents.append(torque / constant)
        return currents


def _toward(wanted: float, present: float, most: float) -> float:
    """As near to the wanted value as a change of at most `most`, which is less than it takes, allows."""
    return present + math.copysign(most, wanted - present)


SERVO_REACTION: Final = reaction(
    Input("motor_states"),
    Input("motor_velocity_command", "velocity?", delayed=True, absent="brake"),
    Input("motor_effort_command", "effort", delayed=True, absent="brake"),
    outputs=("motor_current_command",),
)
