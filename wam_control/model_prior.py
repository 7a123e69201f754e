"""What is known of the errors of the model before any motion: as configured, or as identified from a recording."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.observer_parameters import ObserverParameters
from wam_description.arm import Arm
from wam_description.model import ArmModel
from wam_description.transmission_map import TransmissionMap

Array = NDArray[np.float64]
WAYS = ("positive", "negative")
# friction, masses, load friction and torque constants per torque; delay, s; payload, kg: beyond, a warning
TOLERABLE = (0.2, 0.04, 0.05, 0.05, 3e-3, 0.05)
INFLATED = 2.0  # of identified standard deviations: those stated are too small by up to that (docs/identify.md)
LEAST = 0.02  # sd of an identified friction, per friction


class ModelPrior(NamedTuple):
    """Errors of the model: friction in positive, then in negative motion; masses; load; constants; delay; payload.

    Friction and its share of the load are those of motors, then joints.

    Attributes
    ----------
    names : of the k errors.
    errors : (k,), friction per dynamic friction, delay in s, payload in kg, the others per torque.
    covariance : (k, k).
    limit : (k,), largest variances.
    tolerable : (k,), errors above which the model is off.
    """

    names: tuple[str, ...]
    errors: Array
    covariance: Array
    limit: Array
    tolerable: Array


def model_prior(arm: Arm, given: ObserverParameters, payload_sd: float, model: ArmModel | None) -> ModelPrior:
    """The errors of the model of an arm; `payload_sd` in kg; `model` is the identified one, if there is any."""
    n = len(arm.joints.names)
    motors, joints = arm.motors.names, arm.joints.names
    # the load friction of a joint that one motor drives is that of the motor
    driven_by = np.count_nonzero(TransmissionMap.of(arm).joint_from_motor, axis=1)
    covariance = np.diag(
        np.square(
            [
                *[np.hypot(given.moving_uncertainty, given.asymmetry_uncertainty)] * (4 * n),
                *[given.mass_uncertainty] * n,
                *[given.load_uncertainty] * n,
                *np.where(driven_by > 1, given.load_uncertainty, 0.0),
                *[given.torque_scale_uncertainty] * n,
                given.torque_delay_uncertainty,
                payload_sd,
            ]
        )
    )
    both = np.arange(2 * n)
    covariance[both, 2 * n + both] = covariance[2 * n + both, both] = given.moving_uncertainty**2
    limit, errors = covariance.diagonal().copy(), np.zeros(len(covariance))
    if model is not None and model.is_identified:
        _identify(arm, model, errors, covariance)
    shafts = [*motors, *joints]
    names = (
        *(f"friction of {name} in {way} motion" for way in WAYS for name in shafts),
        *(f"masses at {name}" for name in joints),
        *(f"load friction of {name}" for name in shafts),
        *(f"torque constant of {name}" for name in motors),
        "delay of the torques",
        "payload",
    )
    return ModelPrior(names, errors, covariance, limit, np.repeat(TOLERABLE, [4 * n, n, 2 * n, n, 1, 1]))


def _identify(arm: Arm, model: ArmModel, errors: Array, covariance: Array) -> None:
    """Put the friction that was identified, per mean friction of both directions, and its covariance in place."""
    n = len(arm.joints.names)
    motors = arm.motors.names
    rows, names, levels = [], [], []
    for way, values in enumerate((model.motors.coulomb_positive, model.motors.coulomb_negative)):
        for j, (value, level) in enumerate(zip(values, arm.motors.dynamic_friction, strict=True)):
            if level:
                errors[2 * n * way + j] = value / level - 1.0
                rows.append(2 * n * way + j)
                names.append(f"motors.coulomb_{WAYS[way]}.{motors[j]}")
                levels.append(level)
        for j, level in enumerate(arm.joints.dynamic_friction):
            name = f"joints.coulomb.{arm.joints.names[j]}"
            if level and name in model.covariance.parameters:
                rows.append(2 * n * way + n + j)
                names.append(name)
                levels.append(level)
    known = model.covariance_of(names)
    if known is not None:
        scale = INFLATED / np.array(levels)
        covariance[rows] = covariance[:, rows] = 0.0
        covariance[np.ix_(rows, rows)] = known * np.outer(scale, scale) + LEAST**2 * np.eye(len(rows))
    at_joints = [j for j, name in enumerate(arm.joints.names) if f"joints.load.{name}" in model.covariance.parameters]
    load = [f"motors.load_{way}.{name}" for way in WAYS for name in motors]
    known = model.covariance_of([*load, *(f"joints.load.{arm.joints.names[j]}" for j in at_joints)])
    if known is not None:
        rows = [*range(5 * n, 6 * n), *(6 * n + j for j in at_joints)]
        mean = np.zeros((len(rows), len(known)))
        mean[:n, : 2 * n], mean[n:, 2 * n :] = 0.5 * np.hstack((np.eye(n), np.eye(n))), np.eye(len(at_joints))
        at_joint = [model.joints.load[j] for j in at_joints]
        errors[rows] = mean @ np.array([*model.motors.load_positive, *model.motors.load_negative, *at_joint])
        covariance[np.ix_(rows, rows)] = INFLATED**2 * mean @ known @ mean.T
