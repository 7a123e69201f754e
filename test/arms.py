"""The packaged arm, and arms that the plant is tested with, built from parameters alone."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from wam_description.arm import Arm, Cables, Covers
from wam_description.configuration import Configuration
from wam_description.effects import no_effects
from wam_description.mjcf import mjcf
from wam_description.parts import Joints, Links, Motors
from wam_description.rigid_body import RigidBody
from wam_description.world import NO_SPRINGS, Obstacles, World
from wam_driver.plant import Plant

CONFIGURATION = Configuration.load(Path(__file__).parents[1] / "config" / "wam.yaml")
SHARED = CONFIGURATION.shared
WAM = SHARED.arm
BODY = RigidBody(WAM)
NOWHERE = Obstacles((), (), (), (), (), (), (), (), ())
FRICTIONS = ("static_friction", "dynamic_friction", "viscous_friction")


def changed(
    arm: Arm,
    *,
    motors: Mapping[str, tuple[float, ...]] | None = None,
    joints: Mapping[str, tuple[float, ...]] | None = None,
    cables: Mapping[str, tuple[float, ...]] | None = None,
    gravity: tuple[float, float, float] | None = None,
) -> Arm:
    """An arm with some parameters replaced."""
    return dataclasses.replace(
        arm,
        motors=_replaced(arm.motors, motors),
        joints=_replaced(arm.joints, joints),
        cables=_replaced(arm.cables, cables),
        gravity=arm.gravity if gravity is None else gravity,
    )


def _replaced(part: Any, values: Mapping[str, Any] | None) -> Any:
    return dataclasses.replace(part, **(values or {}))


def frictionless(arm: Arm, start: tuple[float, ...] | None = None, damping: float = 0.0) -> Arm:
    """No dry, no viscous friction; cable damping scaled."""
    zero = dict.fromkeys(FRICTIONS, (0.0,) * arm.n)
    return changed(
        arm,
        motors=zero,
        joints=zero | {"start": start or arm.joints.start},
        cables={"damping": tuple(damping * d for d in arm.cables.damping)},
    )


def ideal_plant(arm: Arm, obstacles: Obstacles, step: float) -> Plant:
    """The plant with its friction and its elastic cables, without any further effect."""
    return Plant(arm, World(obstacles, NO_SPRINGS), no_effects(arm), step)


def ideal_mjcf(arm: Arm, step: float, obstacles: Obstacles) -> str:
    """MJCF of the same."""
    return mjcf(arm, step, World(obstacles, NO_SPRINGS), no_effects(arm))


def box(
    position: tuple[float, float, float],
    size: tuple[float, float, float],
    stiffness: float,
    damping: float = 20.0,
    friction: float = 0.0,
    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Obstacles:
    """One box."""
    return Obstacles(("block",), (stiffness,), (damping,), (friction,), ("box",), position, rotation, size, (0.0,))


LEVER = 0.9144  # m, the tip of the testbed's 36 in link
LINK_INERTIA = 0.45  # kg m^2 about the joint: 64 oz in s^2


def one_joint(ratio: float = 14.0, cable: float = 8.33) -> Arm:
    """Motor, cable and a link that turns about a vertical axis, without friction, damping and gravity.

    All inertia of the link stands in its armature and in a body at the axis; a tube without mass
    reaches to LEVER, where it can touch.
    """
    return Arm(
        motors=Motors(("motor1",), (4.067e-5,), (0.25,), (6.8,), (1.7,), (0.0,), (0.0,), (0.0,)),
        cables=Cables(
            pretension=(300.0,),
            breaking_strength=(1e4,),
            damping=(0.0,),
            reducer=("joint",),
            stage_motors=("motor1",),
            stage_ea=(cable / (2.0 * 0.01**2),),
            stage_length=(1.0,),
            stage_radius=(0.01,),
            stage_circuits=(1.0,),
            stage_ratio=(1.0,),
        ),
        joints=Joints(
            ("joint1",), (0.0,), (0.0,), (0.0,), (-3.0,), (3.0,), (0.0,), (0.05,), (0.0,), (0.0,), (0.0,), (9.0,)
        ),
        links=Links(("link1",), (1.0,), (0.0, 0.0, 0.0), (0.3, 0.3, LINK_INERTIA - 0.05), (0.0,) * 3),
        covers=Covers(("tube",), ("link1",), (0.0,) * 3, (0.0,) * 3, (LEVER,), (0.0,) * 3, (LEVER, 0.0, 0.0), (0.02,)),
        name="one",
        joint_from_motor=(1.0 / ratio,),
        tool=(LEVER, 0.0, 0.0),
        payload=0.0,
        gravity=(0.0, 0.0, 0.0),
        joint_sensors=True,
    )


def eigenvalues(jm: float, jl: float, ktr: float, kc: float, n: float) -> np.ndarray:
    """Natural frequencies, rad/s, of rotor and link as two masses on two springs."""
    stiffness = np.array([[ktr, -n * ktr], [-n * ktr, n * n * ktr + kc]])
    scale = np.diag([jm**-0.5, jl**-0.5])
    return np.sqrt(np.linalg.eigvalsh(scale @ stiffness @ scale))
