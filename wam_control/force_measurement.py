"""The measured force F_c: of the arm on the world, from the feedback that the parameters choose."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wam_control.contact_position import ForcePoint
from wam_control.force_loop_parameters import ForceLoopParameters
from wam_control.stability_guard import SMALLEST_LEVER
from wam_description.rigid_body import RigidBody
from wam_description.signals import Contact, State

Array = NDArray[np.float64]


class ForceMeasurement:
    """External torques of the joints, their tare, and the force along a direction.

    Attributes
    ----------
    external : torques of the world on the joints (n,), N m, less the tare.
    """

    def __init__(self, body: RigidBody) -> None:
        self._body = body
        self._n = len(body.arm.joints.names)
        self._tare = np.zeros(self._n)
        self.external = np.zeros(self._n)

    def tare(self) -> None:
        """Take the present external torques as zero."""
        self._tare = self._tare + self.external

    def step(self, parameters: ForceLoopParameters, sensors: State | None, estimated: Sequence[float] | None) -> None:
        """Take the signals of one outer period.

        Parameters
        ----------
        parameters : `feedback` chooses the signal.  joint_sensors: at rest, the torque that carries the links
            less the strain.  joint_position: deflection of a known spring, section 5.6.
        sensors : joint-side sensors, None where there are none.
        estimated : estimated torques of the world on the joints (n,), N m.
        """
        self.external = self._torque(parameters, sensors, estimated) - self._tare

    def _torque(
        self, parameters: ForceLoopParameters, sensors: State | None, estimated: Sequence[float] | None
    ) -> Array:
        if parameters.feedback == "contact_estimate":
            return np.zeros(self._n) if estimated is None else np.array(estimated)
        if sensors is None:
            return np.zeros(self._n)
        if parameters.feedback == "joint_position":
            return np.array(parameters.spring_stiffness) * (np.array(parameters.spring_rest) - sensors.position)
        return self._body.gravity_torque(sensors.position) - np.array(sensors.effort)

    def along(
        self,
        direction: Array,
        q: Sequence[float],
        jacobian: Array,
        feedback: str,
        contact: Contact,
        point: ForcePoint,
    ) -> float:
        """Force of the arm on the world along a direction, N.

        Parameters
        ----------
        direction : unit vector in the base frame (3,).
        q : joint angles (n,), rad.
        jacobian : of the point of action (3, n), m.
        feedback : parameter of this name.
        contact, point : estimated contact, and the point of action selected for it.
        """
        if feedback == "contact_estimate" and not contact.cover:
            return 0.0
        if feedback == "contact_estimate" and (math.isnan(contact.place) or not point.rejection):
            return -float(direction @ (self._body.cover_pose(q, contact.cover).rotation @ np.array(contact.force)))
        force = np.linalg.pinv(jacobian.T, rcond=SMALLEST_LEVER) @ self.external
        return -float(direction @ force)


class LowPass:
    """First-order low pass that starts at its first input."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget all inputs."""
        self._value: float | None = None

    def step(self, value: float, time_constant: float, dt: float) -> tuple[float, float]:
        """Filtered value now and one period before; `time_constant` and `dt` in s."""
        before = value if self._value is None else self._value
        self._value = value if self._value is None else before + (value - before) * dt / (dt + time_constant)
        return self._value, before
