"""How the errors of the nominal model act on the torques that an observer of the motors sees."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wam_control.contact.model_errors import Observation
from wam_control.contact.motor_side import MotorSide
from wam_control.contact.observer_parameters import ObserverParameters
from wam_control.contact.thresholds import CONTACT
from wam_description.rigid_body import RigidBody

Array = NDArray[np.float64]
Means = tuple[Array, Array, Array, Array]


class CentreEffects:
    """Apparent external torques of links whose centres of mass differ from the model.

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
    """Effects of masses, centres and payload on the torques of joint sensors, and the covariance of the gauges."""

    def __init__(self, n: int, parameters: ObserverParameters, centres: CentreEffects) -> None:
        self._lasting = np.diag(np.full(n, parameters.joint_torque_sd))
        self._rest, self._still = np.square(self._lasting), np.zeros(n)
        self._centres, self._payload = centres, parameters.payload[0]

    def observation(self, means: Means, load: Array | None, *_: object) -> Observation:
        """See `ErrorEffects.observation`."""
        residual, model, pose = means[:3]
        added = self._still if load is None else load
        effects = np.hstack((np.diag(model), self._centres.at(pose), added[:, None]))
        return Observation(residual - self._payload * added, effects, self._rest, self._still, pose, self._lasting)


class ErrorEffects:
    """Effects of friction, masses, loads, torque constants, centres, delay and payload, and the covariance of the rest.

    Parameters
    ----------
    side : motors, cables and their nominal friction.
    parameters : the uncertainty of the nominal model.
    times : time constants of the observer's filters, s.
    has_dither : whether torques and signals are means over a cycle of a dither.
    centres : effects of the centres of mass.
    """

    def __init__(
        self,
        side: MotorSide,
        parameters: ObserverParameters,
        times: Sequence[float],
        has_dither: bool,
        centres: CentreEffects,
    ) -> None:
        inverse, motors, joints = side.map.motor_from_joint, side.motors, side.joints
        n = self._n = len(inverse)
        self._from_motors, self._parameters, self._times = side.map.joint_from_motor, parameters, times
        levels = 0.5 * np.array([*motors.dynamic, *joints.dynamic])
        statics = np.array([*motors.static, *joints.static])
        self._sds = np.concatenate((parameters.rest_uncertainty * statics, parameters.shape_uncertainty * statics))
        through = self._through = np.hstack((inverse.T, np.eye(n)))  # joint torques of torques at motors and joints
        # the same of the errors of the model per signal
        self._errors = np.hstack((-through * levels, through * levels, np.eye(n), -through, inverse.T))
        self._to_joints, self._has_dither, self._centres = inverse.T, has_dither, centres

    def observation(
        self, means: Means, load: Array | None, inertia: Array, velocity_sd: Sequence[float], which: int
    ) -> Observation:
        """The residual, the effects of the errors on it, and the covariance of the rest.

        Parameters
        ----------
        means : filtered residual and torque of the model, N m, pose, rad, each (n,); signals of the shafts, (11 n,).
        load : (n,), torques of a mass of 1 kg at the tool, through the same filter; None where not followed.
        inertia : (n, n), kg m^2.
        velocity_sd : of the motors' velocities, (n,), rad/s.
        which : of the filters.
        """
        n, given, time = self._n, self._parameters, self._times[which]
        residual, model, pose, signals = means
        sliding, moving, uncertain = signals[: 2 * n], signals[2 * n : 4 * n], signals[4 * n : 8 * n]
        if self._has_dither:
            # a shaft that slips in both directions within a cycle passes at its stops from one limit of its friction to
            # the other: what it slips further in one of them is all that is left of both
            resting, shape = uncertain.reshape(2, -1)
            uneven = np.abs(sliding)
            both_ways = np.maximum(1.0 - resting - uneven, 0.0)
            unknown = np.maximum(1.0 - both_ways / CONTACT.slips_both_ways, uneven)
            uncertain = np.concatenate((resting * unknown, np.minimum(shape, uneven)))
        modelled = self._from_motors.T.dot(model)
        driving = modelled - self._from_motors.T.dot(residual)
        effects = np.zeros((n, 11 * n + 2))
        sizes = np.concatenate((moving + sliding, moving - sliding, model, signals[8 * n : 10 * n], driving))
        np.multiply(self._errors, sizes, out=effects[:, : 8 * n])
        effects[:, 8 * n : -2] = self._centres.at(pose)
        effects[:, -2] = self._to_joints.dot(signals[10 * n :])
        if load is not None:
            effects[:, -1] = load
            residual = residual - given.payload[0] * load
        variance = np.square(self._sds * uncertain).reshape(2, -1).sum(axis=0)
        lasting = self._through * np.sqrt(variance)
        less = self._times[0] / time  # a faster filter averages less of what is noise
        variance[:n] += less * (given.motor_torque_sd**2 + np.square(given.motor_torque_fraction * modelled))
        momentum = inertia.dot(self._from_motors * (np.array(velocity_sd) / time))
        rest = (self._through * variance).dot(self._through.T) + momentum.dot(momentum.T)
        return Observation(residual, effects, rest, less * moving[:n], pose, lasting)
