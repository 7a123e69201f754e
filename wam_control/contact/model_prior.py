"""What is known of the errors of the model before any motion: as configured, or as identified from a recording."""

import math
from typing import NamedTuple

import numpy as np

from wam_control.contact.observer_parameters import ObserverParameters
from wam_control.contact.shaft_friction import DISTANCE_VARIANCE
from wam_control.contact.thresholds import CONTACT
from wam_description.arm import Arm
from wam_description.model import ArmModel
from wam_description.rigid_body import Array

WAYS = ("positive", "negative")


class ModelPrior(NamedTuple):
    """Errors: friction in positive, then in negative motion; weights; inertias; load; constants; and others.

    Each is what the arm has more than its model, as in the covariance of an identification.
    Friction and its share of the load are those of motors, then joints.

    Attributes
    ----------
    names : of the k errors.
    errors : (k,), friction per dynamic friction, centres in m, delay in s, payload in kg, the others per torque.
    covariance : (k, k).
    limit : (k,), largest variances.
    tolerable : (k,), errors above which the model is off.
    """

    names: tuple[str, ...]
    errors: Array
    covariance: Array
    limit: Array
    tolerable: Array


def friction_error(shaft: str, way: str) -> str:
    """Name of the error of the friction of a motor or joint in one of `WAYS`."""
    return f"friction of {shaft} in {way} motion"


def load_error(shaft: str) -> str:
    """Name of the error of its friction by load."""
    return f"load friction of {shaft}"


def model_prior(
    arm: Arm, given: ObserverParameters, model: ArmModel | None, use_joint_sensors: bool = False
) -> ModelPrior:
    """The errors of the model of an arm; joint sensors show those of masses, centres of mass and payload alone.

    Parameters
    ----------
    arm, given : the arm as modelled, and how certain that is.
    model : the identified one, if there is any.
    use_joint_sensors : whether the torques are those of joint sensors.
    """
    n, shafts, joints = arm.n, [*arm.motors.names, *arm.joints.names], arm.joints.names
    # the load friction of a joint that one motor drives is that of the motor
    low, high = given.payload
    # the arm without payload is the rule; sd of a uniform distribution, about the smallest mass
    payload_sd = (high - low) / math.sqrt(3.0) if high or use_joint_sensors else given.payload_uncertainty
    driven_by = np.count_nonzero(arm.transmission.joint_from_motor, axis=1)
    loads = [*[given.load_uncertainty] * n, *np.where(driven_by > 1, given.load_uncertainty, 0.0)]
    # of each kind: names, standard deviations, what is tolerable
    kinds: list[tuple[list[str], float | list[float], float]] = [
        (
            [friction_error(name, way) for way in WAYS for name in shafts],
            math.hypot(given.moving_uncertainty, given.asymmetry_uncertainty),
            CONTACT.tolerable_motion,
        ),
        ([f"masses at {name}" for name in joints], given.mass_uncertainty, CONTACT.tolerable_mass),
        ([f"inertias at {name}" for name in joints], given.mass_uncertainty, CONTACT.tolerable_motion),
        ([*map(load_error, shafts)], loads, CONTACT.tolerable_torque),
        (
            [f"torque constant of {name}" for name in arm.motors.names],
            given.torque_scale_uncertainty,
            CONTACT.tolerable_torque,
        ),
        (
            [f"presliding distance of {name}" for name in shafts],
            math.sqrt(DISTANCE_VARIANCE),
            math.inf,
        ),
        (["delay of the torques"], given.torque_delay_uncertainty, CONTACT.tolerable_delay),
        (
            [f"centre of mass of {name} along {axis}" for name in arm.links.names for axis in "xyz"],
            given.centre_uncertainty,
            CONTACT.tolerable_centre,
        ),
        (["payload"], payload_sd, CONTACT.tolerable_payload + high - low),
    ]
    if use_joint_sensors:
        kinds = [kinds[1], *kinds[7:]]
    names = tuple(name for each, _, _ in kinds for name in each)
    sds, tolerable = (
        np.concatenate([np.broadcast_to(kind[which], len(kind[0])) for kind in kinds]) for which in (1, 2)
    )
    errors, covariance, limit = np.zeros(len(names)), np.diag(np.square(sds)), np.square(sds)
    if not use_joint_sensors:
        both = np.arange(2 * n)
        covariance[both, 2 * n + both] = covariance[2 * n + both, both] = given.moving_uncertainty**2
        if model is not None and model.is_identified:
            _identify(arm, model, errors, covariance)
            limit[4 * n :] = covariance.diagonal()[4 * n :]  # friction alone changes after the identification
    return ModelPrior(names, errors, covariance, limit, tolerable)


def _identify(arm: Arm, model: ArmModel, errors: Array, covariance: Array) -> None:
    """Put in place what was identified: friction, per mean of both directions, load friction, weights and inertias.

    Errors of joints in both directions are one identified parameter, errors of load the mean of two.
    """
    n, motors, joints = arm.n, arm.motors.names, arm.joints.names
    known = model.covariance.parameters
    mixing = np.zeros((len(errors), len(known)))

    def add(row: int, name: str, part: float) -> None:
        if name in known:
            mixing[row, known.index(name)] = part

    for way, values in enumerate((model.motors.coulomb_positive, model.motors.coulomb_negative)):
        first = 2 * n * way
        for j, (value, level) in enumerate(zip(values, arm.motors.dynamic_friction, strict=True)):
            if level:
                errors[first + j] = value / level - 1.0
                add(first + j, f"motors.coulomb_{WAYS[way]}.{motors[j]}", 1.0 / level)
        for j, level in enumerate(arm.joints.dynamic_friction):
            if level:
                add(first + n + j, f"joints.coulomb.{joints[j]}", 1.0 / level)
    for j, (motor, joint) in enumerate(zip(motors, joints, strict=True)):
        add(4 * n + j, f"links.weight.{joint}", 1.0)
        add(5 * n + j, f"links.inertia.{joint}", 1.0)
        add(6 * n + j, f"motors.load_positive.{motor}", 0.5)
        add(6 * n + j, f"motors.load_negative.{motor}", 0.5)
        add(7 * n + j, f"joints.load.{joint}", 1.0)
    if all(f"links.inertia.{joint}" in known for joint in joints):  # with the torques, the centres are identified
        covariance[11 * n + 1 : -1] = 0.0
    errors[6 * n : 7 * n] = np.add(model.motors.load_positive, model.motors.load_negative) / 2.0
    errors[7 * n : 8 * n] = model.joints.load
    rows = np.flatnonzero(mixing.any(axis=1))
    found = mixing[rows] @ np.reshape(model.covariance.values, (len(known), len(known))) @ mixing[rows].T
    covariance[rows] = covariance[:, rows] = 0.0
    covariance[np.ix_(rows, rows)] = found + np.diag(np.where(rows < 4 * n, CONTACT.identified_friction_sd, 0.0) ** 2)
