"""By how much the arm that is built departs from the arm as configured, which is all that its controllers know."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from wam_description.arm import Arm, Joints, Links, Motors
from wam_description.parameters import lengths, parameter, require

Shafts = TypeVar("Shafts", Motors, Joints)


@dataclass(frozen=True)
class Departure:
    """Factors of the plant on the configured values; all 1 and no payload for the arm as configured."""

    mass: tuple[float, ...] = parameter("mass and inertia of each link, per configured", low=0.1, high=10.0)
    motor_friction: tuple[float, ...] = parameter("friction of each motor, per configured", low=0.0, high=10.0)
    joint_friction: tuple[float, ...] = parameter("friction of each joint, per configured", low=0.0, high=10.0)
    stiffness: tuple[float, ...] = parameter("stiffness of each cable circuit, per configured", low=0.01, high=100.0)
    payload: float = parameter("mass at the tool that nobody knows of", "kg", low=0.0)


def built(arm: Arm, departure: Departure) -> Arm:
    """The arm as it is built.

    Raises
    ------
    ParameterError
        where a list has not one value each, or the tool lies so that a payload tilts the axes of inertia.
    """
    lengths("departure", arm.links.names, {"mass": departure.mass})
    lengths("departure", arm.motors.names, {"motor_friction": departure.motor_friction})
    lengths("departure", arm.motors.names, {"stiffness": departure.stiffness})
    lengths("departure", arm.joints.names, {"joint_friction": departure.joint_friction})
    by_motor = dict(zip(arm.motors.names, departure.stiffness, strict=True))
    stages = [by_motor[motor] for motor in arm.cables.stage_motors]
    return dataclasses.replace(
        arm,
        motors=_rubbing(arm.motors, departure.motor_friction),
        joints=_rubbing(arm.joints, departure.joint_friction),
        links=_loaded(arm, departure),
        cables=dataclasses.replace(arm.cables, stage_ea=_scaled(arm.cables.stage_ea, stages)),
    )


def _scaled(values: Sequence[float], factors: Sequence[float]) -> tuple[float, ...]:
    return tuple(value * factor for value, factor in zip(values, factors, strict=True))


def _rubbing(shafts: Shafts, factors: Sequence[float]) -> Shafts:
    return dataclasses.replace(
        shafts,
        static_friction=_scaled(shafts.static_friction, factors),
        dynamic_friction=_scaled(shafts.dynamic_friction, factors),
        viscous_friction=_scaled(shafts.viscous_friction, factors),
    )


def _loaded(arm: Arm, departure: Departure) -> Links:
    links = arm.links
    mass = np.multiply(links.mass, departure.mass)
    centre = np.reshape(links.centre, (-1, 3)).astype(float)
    inertia = np.reshape(links.inertia, (-1, 3)) * np.array(departure.mass)[:, None]
    if departure.payload > 0.0:
        lever = np.array(arm.tool) - centre[-1]
        require(
            int(np.count_nonzero(lever)) <= 1,
            f"departure.payload is {departure.payload:g} kg, but the tool is not on an axis of the last link's "
            "inertia; set it to 0",
        )
        share = departure.payload / (mass[-1] + departure.payload)
        reduced = mass[-1] * share
        inertia[-1] += reduced * (lever @ lever - lever * lever)
        centre[-1] += share * lever
        mass[-1] += departure.payload
    return dataclasses.replace(links, mass=_row(mass), centre=_row(centre), inertia=_row(inertia))


def _row(values: np.ndarray) -> tuple[float, ...]:
    return tuple(values.ravel().tolist())
