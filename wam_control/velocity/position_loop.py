"""An inner loop on the position of each motor, 2.1.2: config/position-loop.yaml.

Its reference is the integral of the commanded velocity, so that force loop and transform are those of the velocity
loop.  The gains are `wam_description.arm.Servo`: integral_gain is the stiffness, proportional_gain the damping.
"""

from collections.abc import Sequence

from wam_control.thresholds import VELOCITY
from wam_control.velocity.servo_guard import ServoGuard, ServoGuardParameters
from wam_control.velocity.velocity_loop import SERVO_REACTION
from wam_description.arm import Servo, Shared
from wam_description.parts import Motors
from wam_description.signals import State
from wam_description.wiring import Inputs, Outputs


class PositionLoop:
    """tau = K_i (theta_ref - theta) + K_p (commanded - measured velocity) + tau_ff, clipped to the peak torque.

    The reference is never further from the motor than peak torque holds (anti-windup), and is at the motor where the
    commanded torque does not act at all (brakes, fault).
    """

    def __init__(self, motors: Motors, servo: Servo) -> None:
        self._each = list(
            zip(
                servo.integral_gain, servo.proportional_gain, motors.peak_torque, motors.torque_constant, strict=True
            )
        )  # fmt: skip
        self._reference: list[float] = []
        self._commanded = [0.0] * len(motors.names)

    def step(self, motors: State, command: Sequence[float], feedforward: Sequence[float], dt: float) -> list[float]:
        """Currents for one measurement, (n,), A.

        Parameters
        ----------
        motors : measured state of the motors; the torques are those of the last period.
        command, feedforward, dt : as in `VelocityLoop.step`.
        """
        theta, currents = motors.position, []
        reference = self._reference = list(self._reference if command and self._reference else theta)
        for i, (stiffness, damping, peak, constant) in enumerate(self._each):
            torque = feedforward[i]
            if command:
                if motors.effort[i] == 0.0 and abs(self._commanded[i]) > VELOCITY.deadband * peak:
                    reference[i] = theta[i]
                lead, most = reference[i] + command[i] * dt - theta[i], peak / max(stiffness, 1e-9)
                lead = min(max(lead, -most), most)
                reference[i] = theta[i] + lead
                torque += stiffness * lead + damping * (command[i] - motors.velocity[i])
            self._commanded[i] = torque = min(max(torque, -peak), peak)
            currents.append(torque / constant)
        return currents


class PositionLoopNode:
    """Takes the place of the velocity loop, with its gains and its guard, without its limits of rates and speeds."""

    name, parameters = "position_loop", ServoGuardParameters
    high_priority = True

    def __init__(self, shared: Shared, own: ServoGuardParameters) -> None:
        ServoGuard(shared.model_arm, shared.timing, own).require_stable(shared.servo)
        self._loop = PositionLoop(shared.arm.motors, shared.servo)
        self._zero = [0.0] * shared.arm.n

    @SERVO_REACTION
    def step(self, inputs: Inputs) -> Outputs:
        """Currents that answer a motor state, A."""
        velocity, effort = inputs["motor_velocity_command"], inputs["motor_effort_command"]
        currents = self._loop.step(
            inputs["motor_states"],
            velocity.velocity if velocity else self._zero,
            effort.effort if effort else self._zero,
            inputs.dt,
        )
        return {"motor_current_command": State([], [], currents)}
