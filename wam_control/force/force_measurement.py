"""The torques behind the measured force F_c, from the feedback that the parameters choose."""

from collections.abc import Sequence
from operator import add, sub

import numpy as np
from numpy.typing import NDArray

from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.thresholds import FORCE
from wam_description.rigid_body import RigidBody
from wam_description.signals import State

Array = NDArray[np.float64]


class ForceMeasurement:
    """External torques of the joints, and what of them counts as zero.

    Attributes
    ----------
    external : torques of the world on the joints (n,), N m, less the tare and the zero of the present command.
    acceleration : of the joints by their sensors (n,), rad/s^2, mean over the last period.
    """

    def __init__(self, body: RigidBody) -> None:
        self._body = body
        self._n = len(body.arm.joints.names)
        self._tare = self._zero = [0.0] * self._n
        self._steady = LowPass()
        self.acceleration = self._velocity = [0.0] * self._n
        self.external = [0.0] * self._n

    def tare(self) -> None:
        """Take the present external torques as zero."""
        self._tare = list(map(add, self._tare, self.external))

    @property
    def free(self) -> list[float]:
        """Torques of the world on the joints (n,), N m, that count as those of a free arm: the tare and the zero."""
        return list(map(add, self._tare, self._zero))

    @property
    def resting(self) -> Array:
        """Steady torques of the world on the joints (n,), N m, less the tare and the zero."""
        steady = self._steady.value
        return np.array(self.external if steady is None else self._beyond_zero(steady))

    def _beyond_zero(self, torques: Sequence[float]) -> list[float]:
        return list(map(sub, map(sub, torques, self._tare), self._zero))

    def payload(self, q: Sequence[float], torques: Array, torque_sd: float) -> tuple[float, float]:
        """Mass at the tool, kg, that explains torques of the world on the joints best, and chi^2 of what is left.

        Parameters
        ----------
        q : joint angles (n,), rad.
        torques, torque_sd : torques (n,), N m, and the standard deviation of each, N m.
        """
        weight = np.array(self._body.arm.gravity) @ self._body.tool_jacobian(q)[:3] / torque_sd
        scaled = torques / torque_sd
        mass = float(weight @ scaled) / max(float(weight @ weight), FORCE.least_weight)
        left = scaled - mass * weight
        return mass, float(left @ left)

    def zero(self, limit: float) -> bool:
        """Take the steady torques of a free arm as zero, unless one of them is above a limit, N m; whether it did."""
        if self._steady.value is None:
            return False
        zero = list(map(sub, self._steady.value, self._tare))
        if max(map(abs, zero)) > limit:
            return False
        self._zero = zero
        return True

    def step(
        self,
        parameters: ForceLoopParameters,
        sensors: State | None,
        estimated: Sequence[float] | None,
        dt: float,
    ) -> None:
        """Take the signals of one outer period.

        Parameters
        ----------
        parameters : `feedback` chooses the signal.  joint_sensors: at rest, the torque that carries the links
            less the strain.  joint_position: deflection of a known spring, section 5.6.
        sensors : joint-side sensors, None where there are none.
        estimated : estimated torques of the world on the joints (n,), N m.
        dt : outer period, s.
        """
        torque = self._torque(parameters, sensors, estimated)
        velocity = [0.0] * self._n if sensors is None else sensors.velocity
        self.acceleration = [change / dt for change in map(sub, velocity, self._velocity)]
        self._velocity = velocity
        self._steady.step(torque, FORCE.steady_time, dt)
        self.external = self._beyond_zero(torque)

    def _torque(
        self, parameters: ForceLoopParameters, sensors: State | None, estimated: Sequence[float] | None
    ) -> list[float]:
        if parameters.is_estimated:
            return [0.0] * self._n if estimated is None else list(estimated)
        if sensors is None:
            return [0.0] * self._n
        if parameters.feedback == "joint_position":
            springs = zip(parameters.spring_stiffness, parameters.spring_rest, sensors.position, strict=True)
            return [stiffness * (rest - angle) for stiffness, rest, angle in springs]
        gravity = self._body.gravity_torque(sensors.position).tolist()
        return list(map(sub, gravity, sensors.effort))


class LowPass:
    """First-order low pass of several values that starts at its first input.

    Attributes
    ----------
    value : filtered values; None before the first input.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget all inputs."""
        self.value: list[float] | None = None

    def step(self, value: list[float], time_constant: float, dt: float) -> tuple[list[float], list[float]]:
        """Filtered values now and one period before; `time_constant` and `dt` in s."""
        before = self.value
        if before is None:
            self.value = value
            return value, value
        time = dt + time_constant
        self.value = [old + (new - old) * dt / time for old, new in zip(before, value, strict=True)]
        return self.value, before
