"""Model mismatch: how the true plant differs from the configured arm, which is all that the controllers know."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from wam_description.arm import Arm
from wam_description.parameters import aligned, parameter
from wam_description.parts import Joints, Links, Motors

Shafts = TypeVar("Shafts", Motors, Joints)


@dataclass(frozen=True)
class ModelMismatch:
    """Factors of the true plant on the configured values; without mismatch all are 1 and there is no payload."""

    mass: tuple[float, ...] = parameter("factor on mass and inertia of each link", low=0.1, high=10.0)
    motor_friction: tuple[float, ...] = parameter("factor on the friction of each motor", high=10.0)
    joint_friction: tuple[float, ...] = parameter("factor on the friction of each joint", high=10.0)
    stiffness: tuple[float, ...] = parameter("factor on the stiffness of each cable circuit", low=0.01, high=100.0)
    payload: float = parameter("unmodelled payload at the tool, in addition to arm.payload", "kg", high=100.0)
    torque_constant: tuple[float, ...] = parameter("factor on the torque of each motor per current", low=0.1, high=10.0)


def true_arm(arm: Arm, mismatch: ModelMismatch) -> Arm:
    """The arm of the true plant.

    Raises
    ------
    ParameterError
        if a list has not one value each, or a payload would tilt the principal axes of the last link.
    """
    aligned("mismatch", arm.motors.names, mismatch)
    by_motor = dict(zip(arm.motors.names, mismatch.stiffness, strict=True))
    stages = [by_motor[motor] for motor in arm.cables.stage_motors]
    constants = _scaled(arm.motors.torque_constant, mismatch.torque_constant)
    return dataclasses.replace(
        arm,
        motors=dataclasses.replace(_with_friction(arm.motors, mismatch.motor_friction), torque_constant=constants),
        joints=_with_friction(arm.joints, mismatch.joint_friction),
        links=_scaled_links(arm, mismatch),
        payload=arm.payload + mismatch.payload,
        cables=dataclasses.replace(arm.cables, stage_ea=_scaled(arm.cables.stage_ea, stages)),
    )


def _scaled(values: Sequence[float], factors: Sequence[float]) -> tuple[float, ...]:
    return tuple(value * factor for value, factor in zip(values, factors, strict=True))


def _with_friction(shafts: Shafts, factors: Sequence[float]) -> Shafts:
    return dataclasses.replace(
        shafts,
        static_friction=_scaled(shafts.static_friction, factors),
        dynamic_friction=_scaled(shafts.dynamic_friction, factors),
        viscous_friction=_scaled(shafts.viscous_friction, factors),
    )


def _scaled_links(arm: Arm, mismatch: ModelMismatch) -> Links:
    links, of_elements = arm.links, [factor for factor in mismatch.mass for _ in range(3)]
    return dataclasses.replace(
        links,
        mass=_scaled(links.mass, mismatch.mass),
        inertia=_scaled(links.inertia, of_elements),
        product=_scaled(links.product, of_elements),
    )
