"""How the errors of the nominal model act on the torques that an observer of the motors sees."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wam_control.contact.model_errors import Observation
from wam_control.contact.observer_parameters import ObserverParameters
from wam_control.contact.shaft_friction import ShaftFriction
from wam_control.contact.tool_load import ToolLoad
from wam_description.rigid_body import RigidBody
from wam_description.transmission_map import TransmissionMap

Array = NDArray[np.float64]


class CentreEffects:
    """External torques that the weight of links seems to have whose centres of mass are elsewhere.

    Parameters
    ----------
    body : the links as modelled.
    masses : of the links, (n,), kg.
    """

    def __init__(self, body: RigidBody, masses: Sequence[float]) -> None:
        n = len(masses)
        self._body, self._masses, self._still = body, np.repeat(masses, 3), np.zeros(n)
        self._columns = np.array([10 * i + 1 + axis for i in range(n) for axis in range(3)])

    def at(self, pose: Array) -> Array:
        """Torques, (n, 3 n), N, per m of the centres' coordinates in the frames of their links, in a pose (n,), rad."""
        regressor = self._body.inverse_dynamics_regressor(pose, self._still, self._still)
        return -regressor.take(self._columns, axis=1) * self._masses


class GaugeEffects:
    """Effects of masses, centres and payload on the torques of joint sensors, and the covariance of the gauges.

    Parameters
    ----------
    sd : of the gauges, N m.
    centres : effects of the centres of mass.
    """

    def __init__(self, n: int, sd: float, centres: CentreEffects) -> None:
        gauges = np.diag(np.full(n, sd * sd))
        self._n, self._centres, self._gauges, self._still = n, centres, (gauges, np.sqrt(gauges)), np.zeros(n)

    def observation(self, filtered: Sequence[float], load: ToolLoad | None, payload: float) -> Observation:
        """The residual, the effects of the errors on it, and the covariance of the rest.

        Parameters
        ----------
        filtered : residual and torque of the model, N m, and pose, rad, (3 n,).
        load : torques of a mass at the tool; None where none is declared.
        payload : kg that the model carries.
        """
        n, (rest, lasting) = self._n, self._gauges
        residual, model, pose = np.array(filtered).reshape(3, n)
        effects = np.zeros((n, 4 * n + 1))
        effects.ravel()[: n * (4 * n + 1) : 4 * n + 2] = model
        effects[:, n:-1] = self._centres.at(pose)
        if load is not None:
            effects[:, -1] = load.torque
            residual = residual - payload * effects[:, -1]
        return Observation(residual, effects, rest, self._still, pose, lasting)


class ErrorEffects:
    """Effects of friction, masses, loads, torque constants, centres, delay and payload, and the covariance of the rest.

    Parameters
    ----------
    transmission : between motors and joints.
    parameters : the uncertainty of the nominal model.
    motors, joints : their nominal friction.
    times : time constants of the observer's filters, s.
    has_dither : whether torques and signals are means over a cycle of a dither.
    centres : effects of the centres of mass.
    """

    def __init__(
        self,
        transmission: TransmissionMap,
        parameters: ObserverParameters,
        motors: ShaftFriction,
        joints: ShaftFriction,
        times: Sequence[float],
        has_dither: bool,
        centres: CentreEffects,
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
        self._to_joints, self._has_dither, self._centres = inverse.T, has_dither, centres

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
        effects = np.zeros((n, 11 * n + 2))
        modelled = self._map.motor_torques(model)
        pairs = zip(modelled, self._map.motor_torques(residual.tolist()), strict=True)
        driving = [torque - external for torque, external in pairs]
        sizes = self._sizes * np.concatenate(
            (moving + sliding, moving - sliding, model, signals[8 * n : 10 * n], driving)
        )
        np.multiply(self._through_errors, sizes, out=effects[:, : 8 * n])
        effects[:, 8 * n : -2] = self._centres.at(pose)
        effects[:, -2] = self._to_joints.dot(signals[10 * n :])
        if load is not None:
            effects[:, -1] = load.torque
            residual -= given.payload[0] * effects[:, -1]
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
