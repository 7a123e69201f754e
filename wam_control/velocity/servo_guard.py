"""Which gains of the velocity loop are stable on the arm: the guard of the inner loop.

The linear part is rotors, cables and links under the sampled servo (`wam_theory.velocity_servo`), with the links held
and with the links free.  Friction only takes energy away; without it the bound holds for any friction.  Gains that
are too small are stable, but hold nothing: both are assessed here alone.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from wam_control.force.sampled_loop import Feedback, SampledLoop
from wam_control.thresholds import VELOCITY
from wam_description.arm import Arm, Servo, Timing
from wam_description.parameters import ParameterError, parameter, require
from wam_description.rigid_body import Array
from wam_theory.rounding import rounded_down, rounded_up
from wam_theory.velocity_servo import is_stable, largest_scale, least_damping, locked_rotors, servo_period


@dataclass(frozen=True)
class ServoGuardParameters:
    """Assumptions about the velocity loop, and the reaction to unstable gains."""

    mode: str = parameter(
        "off: accept any gains; refuse: refuse gains that are not stable or cannot slow a motor down",
        choices=("off", "refuse"),
    )
    stability_fraction: float = parameter(
        "accepted fraction of the largest gains that are stable without extra_delay",
        low=0.05,
        high=1.0,
    )
    extra_delay: int = parameter(
        "extra delay of a current in realtime with which the gains have to be stable, in inner periods",
        high=10,
    )
    velocity_by_difference: bool = parameter(
        "true if the motor velocity is the difference of two angles over a period, as with sensors.encoder_resolution",
    )


class Mechanism(NamedTuple):
    """Rotors and what they move: rate of the states, rate per motor torque, and what is assumed, in words."""

    rate: Array
    inlet: Array
    what: str


class ServoGuard:
    """Assesses gains of the velocity loop on one arm.

    Parameters
    ----------
    arm : the arm as the controller knows it.
    timing : periods of the loops.
    parameters : of the guard.
    """

    def __init__(self, arm: Arm, timing: Timing, parameters: ServoGuardParameters) -> None:
        self._arm, self._timing, self._parameters = arm, timing, parameters

    def require_stable(self, servo: Servo) -> None:
        """Refuse gains that are not stable, or cannot slow a motor down.

        Raises
        ------
        ParameterError
            names the gains, their limit and the smallest or largest that would be taken.
        """
        if self._parameters.mode == "off":
            return
        self._require_holding(servo)
        kp, ki = np.array(servo.proportional_gain), np.array(servo.integral_gain)
        trouble = self._trouble(kp, ki)
        if not trouble:
            return
        proportional = largest_scale(lambda scale: not self._trouble(scale * kp, ki), 1.0)
        integral = largest_scale(lambda scale: not self._trouble(kp, scale * ki), 1.0)
        ways = []
        if proportional and any(kp):
            ways.append(f"servo.proportional_gain up to {_listed(kp, proportional)} with this integral_gain")
        if integral and any(ki):
            ways.append(f"servo.integral_gain up to {_listed(ki, integral)} with this proportional_gain")
        if not ways:
            alone = largest_scale(lambda scale: not self._trouble(scale * kp, 0.0 * ki), 1.0)
            ways.append(f"servo.proportional_gain up to {_listed(kp, alone)} with servo.integral_gain 0")
        raise ParameterError(
            f"servo.proportional_gain {_listed(kp)} with servo.integral_gain {_listed(ki)} is not stable: "
            f"{trouble}; allowed: {', or '.join(ways)}"
        )

    def _require_holding(self, servo: Servo) -> None:
        """Refuse proportional gains with which a motor at its largest speed is hardly braked.

        The integral gain alone does not brake: it is a spring to the motor.
        """
        motors = self._arm.motors
        speeds = self._arm.transmission.largest_motor_velocities(self._arm.joints.speed_limit)
        least = [
            VELOCITY.deadband * peak / speed if speed else 0.0
            for peak, speed in zip(motors.peak_torque, speeds, strict=True)
        ]
        for name, gain, enough, speed in zip(motors.names, servo.proportional_gain, least, speeds, strict=True):
            require(
                gain >= enough,
                f"servo.proportional_gain {_listed(servo.proportional_gain)} cannot hold the arm: {name} at "
                f"{speed:.3g} rad/s, the most that arm.joints.speed_limit allows, is braked with only "
                f"{gain * speed:.3g} N m; {VELOCITY.deadband:.0%} of its peak torque are needed; allowed: at least "
                f"{_listed([rounded_up(each) for each in least])}, or a higher arm.joints.speed_limit",
            )

    def _trouble(self, kp: Array, ki: Array) -> str:
        """Why gains, (n,), are not accepted; '' if they are."""
        fraction = self._parameters.stability_fraction
        late = self._parameters.extra_delay if self._timing.mode == "realtime" else 0
        for mechanism in self._mechanisms:
            found = least_damping(self._period(mechanism, kp, ki, 0), VELOCITY.slow_mode)
            if found < VELOCITY.least_damping:
                return (
                    f"an oscillation hardly decays with {mechanism.what}, its damping ratio is {found:.2g} "
                    f"(at least {VELOCITY.least_damping:g})"
                )
            for scale, delay in sorted({(1.0, 0), (1.0 / fraction, 0), (1.0, late)}):
                if not is_stable(self._period(mechanism, scale * kp, scale * ki, delay)):
                    when = f"delayed by {delay} periods" if delay else "on time"
                    gains = f" and {scale:.3g} times these gains (velocity_loop:guard.stability_fraction)"
                    return f"an oscillation grows with {mechanism.what}, currents {when}{gains if scale > 1.0 else ''}"
        return ""

    def _period(self, mechanism: Mechanism, kp: Array, ki: Array, delay: int) -> Array:
        by_difference = self._parameters.velocity_by_difference
        return servo_period(mechanism.rate, mechanism.inlet, kp, ki, self._timing.period, delay, by_difference)

    @cached_property
    def _mechanisms(self) -> tuple[Mechanism, ...]:
        """The rotors with the links held, and with the links free in some poses."""
        arm = self._arm
        n = arm.n
        loop = SampledLoop(arm, self._timing, Servo((0.0,) * n, (0.0,) * n))
        held = locked_rotors(
            arm.motors.inertia,
            arm.cables.damping,
            [circuit.stiffness for circuit in arm.circuits],
            arm.motors.viscous_friction,
        )
        found = [Mechanism(held, loop.inlet[: 2 * n], "the links held")]
        # the cables decide, not the links: over all poses the largest stable gain changes by 2 %
        for pose, q in (("at arm.joints.start", arm.joints.start), ("with all joints at 0", (0.0,) * n)):
            rate, _ = loop.plant(q, np.zeros((n, n)), Feedback("contact_estimate", (), 0.0))
            found.append(Mechanism(rate, loop.inlet, f"the links free, {pose}"))
        return tuple(found)


def _listed(gains: Iterable[float], scale: float = 1.0) -> str:
    """Gains times a scale, rounded down: a gain that is named as allowed has to be accepted."""
    return f"[{', '.join(f'{gain if scale == 1.0 else rounded_down(scale * gain):.3g}' for gain in gains)}]"
