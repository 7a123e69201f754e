"""How the errors of the nominal model act on the torques that an observer of the motors sees."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wam_control.contact.model_errors import Observation
from wam_control.contact.motor_side import MotorSide
from wam_control.contact.observer_parameters import ObserverParameters
from wam_control.contact.shaft_friction import DISTANCE_VARIANCE, DISTANCE_WEIGHTS, EQUAL, LOG_DISTANCES
from wam_control.contact.thresholds import CONTACT
from wam_description.arm import Arm
from wam_description.rigid_body import Array, RigidBody, point_mass


class FilteredMotion(NamedTuple):
    """What an observer filters, all by the same filter.

    Attributes
    ----------
    residual, model : (n,), N m, the residual and the torque of the model.
    pose, velocity, acceleration : (n,), rad, rad/s, rad/s^2, of the joints.
    signals : of the shafts; empty with joint sensors.
    """

    residual: Array
    model: Array
    pose: Array
    velocity: Array
    acceleration: Array
    signals: Array


class LinkEffects:
    """Apparent external torques of links whose centres of mass differ from the model, and of a mass at the tool.

    Parameters
    ----------
    arm, body : the arm as modelled, and its links.
    masses : of the links, (n,), kg.
    """

    def __init__(self, arm: Arm, body: RigidBody, masses: Array) -> None:
        n = len(masses)
        self.body = body
        centres = np.kron(np.diag(-masses), np.eye(10, 3, -1))
        load = np.concatenate((np.zeros(10 * n - 10), -point_mass(arm.tool)))
        self._per_error = np.column_stack((centres, load))

    def of(self, motion: FilteredMotion) -> Array:
        """Torques, (n, 3 n + 1), per m of the centres' coordinates in the frames of their links, and per kg."""
        moves = motion.pose, motion.velocity, motion.acceleration
        return self.body.inverse_dynamics_regressor(*moves).dot(self._per_error)


class GaugeEffects:
    """Effects of masses, centres and payload on the torques of joint sensors, and the covariance of the gauges."""

    def __init__(self, n: int, parameters: ObserverParameters, links: LinkEffects) -> None:
        self._lasting = np.diag(np.full(n, parameters.joint_torque_sd))
        self._rest = np.square(self._lasting)
        self._links, self._payload = links, parameters.payload[0]

    def observation(self, motion: FilteredMotion, *_: object) -> Observation:
        """See `ErrorEffects.observation`."""
        n = len(motion.model)
        effects = np.zeros((n, 4 * n + 1))
        effects.ravel()[:: 4 * n + 2] = -motion.model  # the diagonal
        effects[:, n:] = self._links.of(motion)
        residual = motion.residual - self._payload * effects[:, -1]
        moving = motion.signals  # there are none
        return Observation(residual, effects, self._rest, moving, motion.pose, self._lasting)


class ErrorEffects:
    """Effects of friction, weights, inertias, loads, constants, centres, delay, payload; the covariance of the rest.

    Parameters
    ----------
    side : motors, cables and their nominal friction.
    times : time constants of the observer's filters, s.
    links : effects of centres of mass and payload.
    """

    def __init__(self, side: MotorSide, times: Sequence[float], links: LinkEffects) -> None:
        self._side, inverse, friction, given = side, side.map.motor_from_joint, side.friction, side.parameters
        n = self._n = len(inverse)
        self._from_motors, self._times, self._links = side.map.joint_from_motor, times, links
        self._sds = given.rest_uncertainty * friction.static, given.shape_uncertainty * friction.static
        self._dynamic, levels = friction.dynamic, 0.5 * friction.dynamic
        through = self._through = np.hstack((inverse.T, np.eye(n)))  # joint torques of torques at motors and joints
        # the same of the errors of the model per signal
        self._errors = np.hstack((-through * levels, through * levels, -np.eye(n), -np.eye(n), -through))
        # with the model, the constants were identified that motors have in common that move the same joints
        driven = self._from_motors != 0.0
        common = driven.T @ driven * friction.is_identified
        self._differs = np.eye(n) - common / np.maximum(1.0, common.sum(axis=1))
        self._to_joints = inverse.T

    def observation(self, motion: FilteredMotion, inertia: Array, which: int, errors: Array) -> Observation:
        """The residual, the effects of the errors on it, and the covariance of the rest.

        Parameters
        ----------
        motion : with the signals of the shafts.
        inertia : (n, n), kg m^2.
        which : of the filters.
        errors : of the model as tracked, (k,): a shaft with more friction in motion has more at rest, too.
        """
        n, given, time = self._n, self._side.parameters, self._times[which]
        residual, model, signals = motion.residual, motion.model, motion.signals
        at = 2 * n * len(LOG_DISTANCES)
        by_distance = signals[:at].reshape(2 * n, -1)
        moving, resting, slow, loaded = signals[at : at + 8 * n].reshape(4, -1)
        sliding = by_distance.dot(EQUAL)
        if self._side.has_dither:  # torques and signals are means over a cycle
            # a shaft that slips in both directions within a cycle passes at its stops from one limit of its friction to
            # the other: what it slips further in one of them is all that is left of both
            uneven = np.abs(sliding)
            both_ways = np.maximum(1.0 - resting - uneven, 0.0)
            resting = resting * np.maximum(1.0 - both_ways / CONTACT.slips_both_ways, uneven)
            slow = np.minimum(slow, uneven)
        # friction by presliding distance: what is linear in its logarithm is tracked, the rest is not
        slope = by_distance.dot(DISTANCE_WEIGHTS)
        curved = np.maximum(
            0.0, np.square(by_distance).dot(EQUAL) - sliding * sliding - slope * slope * DISTANCE_VARIANCE
        )
        modelled = self._from_motors.T.dot(model)
        weights = self._links.body.gravity_torque(motion.pose)
        effects = np.zeros((n, 14 * n + 2))
        sizes = np.concatenate((moving + sliding, moving - sliding, weights, model - weights, loaded))
        np.multiply(self._errors, sizes, out=effects[:, : 8 * n])
        own = modelled[:, None] * self._differs
        own.ravel()[:: n + 1] -= self._from_motors.T.dot(residual)  # the diagonal
        effects[:, 8 * n : 9 * n] = self._to_joints.dot(own)
        effects[:, 9 * n : 11 * n] = self._through * (-self._dynamic * slope)
        effects[:, 11 * n] = self._to_joints.dot(signals[-n:])
        effects[:, 11 * n + 1 :] = self._links.of(motion)
        residual = residual - given.payload[0] * effects[:, -1]
        at_rest, shape = self._sds
        variance = np.square(at_rest * resting) + np.square(shape * slow) + np.square(self._dynamic) * curved
        variance *= np.square(np.maximum(1.0 + 0.5 * (errors[: 2 * n] + errors[2 * n : 4 * n]), 1.0))
        lasting = self._through * np.sqrt(variance)
        less = self._times[0] / time  # a faster filter averages less of what is noise
        variance[:n] += less * (given.motor_torque_sd**2 + np.square(given.motor_torque_fraction * modelled))
        momentum = inertia.dot(self._from_motors * (np.array(self._side.velocity.sd) / time))
        rest = (self._through * variance).dot(self._through.T) + momentum.dot(momentum.T)
        return Observation(residual, effects, rest, less * moving[:n], motion.pose, lasting)
