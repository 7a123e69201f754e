"""Node `velocity_loop`: the inner loop, motor states in, motor currents out."""

from math import copysign
from operator import gt

from wam_control.velocity.dither import Dither
from wam_control.velocity.servo_guard import ServoGuard
from wam_control.velocity.velocity_loop import SERVO_REACTION, VelocityLoop, VelocityLoopParameters
from wam_description.arm import Shared
from wam_description.signals import State
from wam_description.wiring import Inputs, Outputs


class VelocityLoopNode:
    """Answers each motor state with currents, from the velocity and effort commands."""

    name, parameters = "velocity_loop", VelocityLoopParameters
    high_priority = True

    def __init__(self, shared: Shared, own: VelocityLoopParameters) -> None:
        ServoGuard(shared.model_arm, shared.timing, own.guard).require_stable(shared.servo)
        self._loop = VelocityLoop(shared.arm.motors, shared.servo, own)
        self._shared = shared
        self.tune(own)
        zero = [0.0] * shared.arm.n
        self._motors = shared.arm.motors.names
        self._fastest = shared.arm.transmission.largest_motor_velocities(shared.arm.joints.speed_limit)
        self.refusals: dict[str, str] = {}
        self._at_rest, self._no_effort = State([], zero, []), State([], [], zero)
        self._command, self._velocity = self._at_rest, zero  # and within the limits, rad/s

    @SERVO_REACTION
    def step(self, inputs: Inputs) -> Outputs:
        """Currents that answer a motor state, A."""
        motors = inputs["motor_states"]
        command = inputs["motor_velocity_command"] or self._at_rest
        if command is not self._command:  # the same in every inner period of an outer one
            self._command, self._velocity = command, self._limited(command.velocity)
        effort = inputs["motor_effort_command"] or self._no_effort
        currents = self._loop.step(
            motors.velocity,
            motors.effort,
            self._velocity,
            self._dither.added(inputs.stamp, effort.effort),
            inputs.dt,
        )
        return {"motor_current_command": State([], [], currents)}

    def _limited(self, velocity: list[float]) -> list[float]:
        """A commanded velocity within what the speed limits of the joints allow each motor, rad/s."""
        if not any(map(gt, map(abs, velocity), self._fastest)):
            if self.refusals:
                self.refusals.clear()
            return velocity
        each = zip(self._motors, velocity, self._fastest, strict=True)
        name, speed, most = next(one for one in each if abs(one[1]) > one[2])
        self.refusals["motor_velocity_command"] = (
            f"{speed:.4g} rad/s of {name}; {copysign(most, speed):.4g} rad/s is used instead, the largest that "
            "arm.joints.speed_limit allows"
        )
        return [min(max(v, -m), m) for v, m in zip(velocity, self._fastest, strict=True)]

    def tune(self, own: VelocityLoopParameters) -> None:
        """Take another level of the dither while the arm moves; the other parameters need a restart."""
        dither = Dither(self._shared.model_arm, self._shared.timing, own.dither)
        self._cost = dither.cost(self._shared.arm.joints.start)
        self._dither = dither

    def diagnostics(self) -> dict[str, str]:
        """What the dither costs, where it is on."""
        if not self._cost.tip_motion:
            return {}
        return {
            "dither: largest tip motion": f"{self._cost.tip_motion * 1e3:.2g} mm",
            "dither: heat": f"{max(self._cost.heat):.2%} of the thermal limit",
        }
