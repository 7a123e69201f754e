"""How the errors of the nominal model act on the torques that an observer of the motors sees."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wam_control.contact.model_errors import Observation
from wam_control.contact.motor_side import MotorSide
from wam_control.contact.observer_parameters import ObserverParameters
from wam_description.rigid_body import RigidBody

Array = NDArray[np.float64]
Means = tuple[Array, Array, Array, Array]


class ErrorEffects:
    """Effects of friction, masses, loads, torque constants, centres, delay and payload, and the covariance of the rest.

    Parameters
    ----------
    body : the links as modelled.
    side : motors, cables and their nominal friction.
    parameters : the uncertainty of the nominal model.
    times : time constants of the observer's filters, s.
    has_dither : whether torques and signals are means over a cycle of a dither.
    """

    def __init__(
        self,
        body: RigidBody,
        side: MotorSide,
        parameters: ObserverParameters,
        times: Sequence[float],
        has_dither: bool,
    ) -> None:
        inverse = side.map.motor_from_joint
        n = self._n = len(inverse)
        self._from_motors, self._parameters, self._times = side.map.joint_from_motor, parameters, times
        levels, statics = 0.5 * np.array(side.friction.dynamic), np.array(side.friction.static)
        self._sds = np.concatenate((parameters.rest_uncertainty * statics, parameters.shape_uncertainty * statics))
        self._gauges = parameters.joint_torque_sd * np.eye(n)
        through = self._through = np.hstack((inverse.T, np.eye(n)))  # joint torques of torques at motors and joints
        # the same of the errors of the model per signal
        self._errors = np.hstack((-through * levels, through * levels, np.eye(n), -through, inverse.T))
        self._to_joints, self._has_dither, self._body, self._still = inverse.T, has_dither, body, np.zeros(n)
        self._masses = np.multiply(body.arm.links.mass, parameters.mass_scale)[:, None]

    def observation(
        self, means: Means, load: Array, inertia: Array, velocity_sd: Sequence[float], which: int
    ) -> Observation:
        """The residual, the effects of the errors on it, and the covariance of the rest.

        Parameters
        ----------
        means : filtered residual and torque of the model, N m, pose, rad, each (n,); signals of the shafts, (11 n,),
            none from joint sensors, whose torques show masses, centres and payload alone.
        load : (n,), torques of a mass of 1 kg at the tool, through the same filter; 0 where not followed.
        inertia : (n, n), kg m^2.
        velocity_sd : of the motors' velocities, (n,), rad/s.
        which : of the filters.
        """
        n, given, time = self._n, self._parameters, self._times[which]
        residual, model, pose, signals = means
        effects = np.zeros((n, 11 * n + 2))
        effects[:, 4 * n : 5 * n] = np.diag(model)
        # per m of the coordinates of the centres of mass
        regressor = self._body.inverse_dynamics_regressor(pose, self._still, self._still).reshape(n, n, 10)
        effects[:, 8 * n : -2] = (-regressor[:, :, 1:4] * self._masses).reshape(n, -1)
        effects[:, -1] = load
        apart = residual - given.payload[0] * load
        if not len(signals):
            return Observation(apart, effects, np.square(self._gauges), self._still, pose, self._gauges)
        sliding, moving, uncertain = signals[: 2 * n], signals[2 * n : 4 * n], signals[4 * n : 8 * n]
        if self._has_dither:
            # a shaft that slips in both directions within a cycle stops at both limits of its stiction
            resting, shape = uncertain.reshape(2, -1)
            uncertain = np.concatenate((resting * resting, np.minimum(shape, np.abs(sliding))))
        modelled = self._from_motors.T.dot(model)
        driving = modelled - self._from_motors.T.dot(residual)
        sizes = np.concatenate((moving + sliding, moving - sliding, model, signals[8 * n : 10 * n], driving))
        np.multiply(self._errors, sizes, out=effects[:, : 8 * n])
        effects[:, -2] = self._to_joints.dot(signals[10 * n :])
        variance = np.square(self._sds * uncertain).reshape(2, -1).sum(axis=0)
        lasting = self._through * np.sqrt(variance)
        less = self._times[0] / time  # a faster filter averages less of what is noise
        variance[:n] += less * (given.motor_torque_sd**2 + np.square(given.motor_torque_fraction * modelled))
        momentum = inertia.dot(self._from_motors * (np.array(velocity_sd) / time))
        rest = (self._through * variance).dot(self._through.T) + momentum.dot(momentum.T)
        return Observation(apart, effects, rest, less * moving[:n], pose, lasting)
