"""An inner loop on torque with its sensor beyond the cable (non-collocated), 2.1.2: config/torque-loop.yaml.

What lies between motor and sensor limits its gain, and with it what it leaves of friction: the thesis recommends a
velocity or position loop in its place.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from wam_description.arm import Shared
from wam_description.parameters import lengths, parameter
from wam_description.parts import Motors
from wam_description.signals import State
from wam_description.wiring import Input, Inputs, Outputs, reaction


@dataclass(frozen=True)
class TorqueLoopParameters:
    """Gain of the torque loop."""

    gain: tuple[float, ...] = parameter(
        "torque of each motor per error of its torque, by the strain gauges; friction F leaves F/(1 + gain)",
        high=100.0,
    )


class TorqueLoop:
    """tau = tau_ff + g (tau_ff - tau_sensor), clipped to the peak torque; i = tau/k_t."""

    def __init__(self, motors: Motors, gain: Sequence[float]) -> None:
        lengths("torque_loop", motors.names, {"gain": tuple(gain)})
        self._each = list(zip(gain, motors.peak_torque, motors.torque_constant, strict=True))

    def step(self, sensed: Sequence[float], commanded: Sequence[float]) -> list[float]:
        """Currents (n,), A, for the torques that the sensors see and those commanded, at the motors (n,), N m."""
        return [
            min(max(wanted + gain * (wanted - seen), -peak), peak) / constant
            for (gain, peak, constant), seen, wanted in zip(self._each, sensed, commanded, strict=True)
        ]


class TorqueLoopNode:
    """Takes the place of the velocity loop.  It controls torque only: the force loop has to be in mode open_loop."""

    name, parameters = "torque_loop", TorqueLoopParameters
    high_priority = True

    def __init__(self, shared: Shared, own: TorqueLoopParameters) -> None:
        self._loop, self._map = TorqueLoop(shared.arm.motors, own.gain), shared.arm.transmission
        self._zero = [0.0] * shared.arm.n
        self.refusals: dict[str, str] = {}

    @reaction(
        Input("motor_states"),
        Input("joint_sensors", absent="brake"),
        Input("motor_velocity_command", "velocity?", delayed=True),
        Input("motor_effort_command", "effort", delayed=True, absent="brake"),
        outputs=("motor_current_command",),
    )
    def step(self, inputs: Inputs) -> Outputs:
        """Currents that answer a motor state, A."""
        velocity, effort, sensors = (
            inputs[name] for name in ("motor_velocity_command", "motor_effort_command", "joint_sensors")
        )
        self.refusals.clear()
        if velocity and velocity.velocity:
            self.refusals["motor_velocity_command"] = (
                "a velocity is commanded, which torque_loop does not control; set force_loop:mode open_loop"
            )
        wanted = effort.effort if effort else self._zero
        sensed = self._map.motor_torques(sensors.effort) if sensors else wanted
        return {"motor_current_command": State([], [], self._loop.step(sensed, wanted))}
