"""How the errors of the nominal model act on the torques that an observer of the motors sees."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wam_control.contact.model_errors import Observation
from wam_control.contact.observer_parameters import ObserverParameters
from wam_control.contact.shaft_friction import ShaftFriction
from wam_control.contact.tool_load import ToolLoad
from wam_description.transmission_map import TransmissionMap

Array = NDArray[np.float64]


class ErrorEffects:
    """Effects of friction, masses, loads, torque constants, delay and payload, and the covariance of the rest.

    Parameters
    ----------
    transmission : between motors and joints.
    parameters : the uncertainty of the nominal model.
    motors, joints : their nominal friction.
    times : time constants of the observer's filters, s.
    has_dither : whether torques and signals are means over a cycle of a dither.
    """

    def __init__(
        self,
        transmission: TransmissionMap,
        parameters: ObserverParameters,
        motors: ShaftFriction,
        joints: ShaftFriction,
        times: Sequence[float],
        has_dither: bool,
    ) -> None:
        inverse, n = transmission.motor_from_joint, len(transmission.motor_from_joint)
        half_levels = 0.5 * np.array([*motors.dynamic, *joints.dynamic])
        statics = np.array([*motors.static, *joints.static])
        self._n, self._map, self._parameters, self._times = n, transmission, parameters, times
        self._rest_sd, self._shape_sd = parameters.rest_uncertainty * statics, parameters.shape_uncertainty * statics
        self._through = np.hstack((inverse.T, np.eye(n)))  # joint torques of torques at motors and joints
        # the same of the errors of the model, and their sizes
        self._through_errors = np.hstack((-self._through, self._through, np.eye(n), -self._through, inverse.T))
        self._sizes = np.concatenate((half_levels, half_levels, np.ones(4 * n)))
        self._to_joints, self._has_dither = inverse.T, has_dither

    def observation(
        self,
        means: tuple[Array, list[float], Array, Array],
        load: ToolLoad | None,
        inertia: Array,
        velocity_sd: Sequence[float],
        which: int,
    ) -> Observation:
        """The residual, the effects of the errors on it, and the covariance of the rest.

        Parameters
        ----------
        means : filtered residual and torque of the model, N m, pose, rad, each (n,); signals of the shafts, (11 n,).
        load : torques of a mass at the tool, through the same filter; None where not followed.
        inertia : (n, n), kg m^2.
        velocity_sd : of the motors' velocities, (n,), rad/s.
        which : of the filters.
        """
        n, given = self._n, self._parameters
        residual, model, pose, signals = means
        sliding, moving, resting, shape = signals[: 8 * n].reshape(4, 2 * n)
        if self._has_dither:
            # a shaft that slips in both directions within a cycle stops at both limits of its stiction
            resting, shape = resting * resting, np.minimum(shape, np.abs(sliding))
        effects = np.zeros((n, 8 * n + 2))
        modelled = self._map.motor_torques(model)
        pairs = zip(modelled, self._map.motor_torques(residual.tolist()), strict=True)
        driving = [torque - external for torque, external in pairs]
        sizes = self._sizes * np.concatenate(
            (moving + sliding, moving - sliding, model, signals[8 * n : 10 * n], driving)
        )
        np.multiply(self._through_errors, sizes, out=effects[:, :-2])
        effects[:, -2] = self._to_joints.dot(signals[10 * n :])
        if load is not None:
            effects[:, -1] = load.torque
            residual -= load.mass * effects[:, -1]
        variance = np.square(self._rest_sd * resting) + np.square(self._shape_sd * shape)
        lasting = self._through * np.sqrt(variance)
        # a faster filter averages less of what is noise
        less, least = self._times[0] / self._times[which], given.motor_torque_sd**2
        sds = [given.motor_torque_fraction * torque for torque in modelled]
        variance[:n] += [less * (least + sd * sd) for sd in sds]
        rest = (self._through * variance).dot(self._through.T)
        speed = self._map.joint_from_motor * (np.array(velocity_sd) / self._times[which])
        momentum = inertia.dot(speed)
        return Observation(residual, effects, rest + momentum.dot(momentum.T), less * moving[:n], pose, lasting)
