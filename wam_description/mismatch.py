"""Model mismatch: how the true plant differs from the configured arm, which is all that the controllers know."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from wam_description.arm import Arm
from wam_description.cables import Cables
from wam_description.parameters import parameter, require_fit
from wam_description.parts import Joints, Links, Motors

Part = TypeVar("Part", Motors, Joints, Links, Cables)
FRICTION = ("static_friction", "dynamic_friction", "viscous_friction")


@dataclass(frozen=True)
class ModelMismatch:
    """Factors of the true plant on the configured values; without mismatch all are 1 and there is no payload."""

    aligned_with = "mismatch", "motors"
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
    require_fit(mismatch, arm)
    by_motor = dict(zip(arm.motors.names, mismatch.stiffness, strict=True))
    stages = [by_motor[motor] for motor in arm.cables.stage_motors]
    motors = _scaled(arm.motors, mismatch.torque_constant, "torque_constant")
    return dataclasses.replace(
        arm,
        motors=_scaled(motors, mismatch.motor_friction, *FRICTION),
        joints=_scaled(arm.joints, mismatch.joint_friction, *FRICTION),
        links=_scaled(arm.links, mismatch.mass, "mass", "inertia", "product"),
        payload=arm.payload + mismatch.payload,
        cables=_scaled(arm.cables, stages, "stage_ea"),
    )


def _scaled(part: Part, factors: Sequence[float], *lists: str) -> Part:
    """A part with other values in some of its lists, which have one or several for each factor."""
    found = {}
    for name in lists:
        values = getattr(part, name)
        width = len(values) // len(factors)
        found[name] = tuple(value * factors[i // width] for i, value in enumerate(values))
    return dataclasses.replace(part, **found)
