"""The testbed of section 5.6 reduced to the theory's model: one link, one cable circuit, requested effects only."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wam_description.arm import Arm
from wam_description.configuration import Configuration, packaged
from wam_description.effects import no_effects
from wam_description.world import NO_SPRINGS, Obstacles, Springs, World
from wam_driver.plant import Plant

Numbers = NDArray[np.float64]
STEP = 2.5e-4  # s
IMMOVABLE = 1e9  # kg m^2, of a rotor that the cable cannot accelerate
NOTHING = Obstacles((), (), (), (), (), (), (), (), ())
EMPTY = World(NOTHING, NO_SPRINGS)
LEVER = 0.9144  # m, from the joint to the tip
RATIO = 14.0


def ideal_testbed(
    ratio: float = 14.0, rotor: float | None = None, damping: float = 0.0, friction: tuple[float, float] = (0.0, 0.0)
) -> Arm:
    """The testbed without gravity and with the requested effects only.

    Parameters
    ----------
    ratio : N.
    rotor : inertia of the rotor, kg m^2; None for that of the motor.
    damping : of the cable circuit, N m s/rad.
    friction : static and dynamic, at the joint, N m.
    """
    arm = Configuration.load(packaged("testbed")).shared.arm
    none = (0.0,)
    motors = replace(
        arm.motors,
        inertia=(rotor or arm.motors.inertia[0],),
        static_friction=none,
        dynamic_friction=none,
        viscous_friction=none,
    )
    joints = replace(
        arm.joints,
        static_friction=(friction[0],),
        dynamic_friction=(friction[1],),
        viscous_friction=none,
        lower=(-1e3,),
        upper=(1e3,),
    )
    cables = replace(arm.cables, damping=(damping,))
    return replace(
        arm, motors=motors, joints=joints, cables=cables, joint_from_motor=(1.0 / ratio,), gravity=(0.0, 0.0, 0.0)
    )


def released_plant(arm: Arm, world: World = EMPTY, step: float = STEP, **effects: Any) -> Plant:
    """The plant of an arm with the named effects only, brakes released."""
    plant = Plant(arm, world, replace(no_effects(arm), **effects), step)
    plant.brake(False)
    return plant


def against_spring(stiffness: float, unilateral: bool = False) -> World:
    """A spring at the joint, N m/rad; a unilateral one pushes at angles below zero."""
    return World(NOTHING, Springs(("joint1",), (float(stiffness),), (1.0,), (0.0,), (not unilateral,)))


def link_inertia(arm: Arm) -> float:
    """J_l of the link about its joint, kg m^2."""
    return arm.links.inertia[1] + arm.links.mass[0] * arm.links.centre[0] ** 2


def one_step_map(plant: Plant) -> Numbers:
    """Matrix that takes angles and velocities over one step, by stepping from each unit state."""
    size, small = plant.model.nv, 1e-6
    columns = []
    for i in range(2 * size):
        state = np.zeros(2 * size)
        state[i] = small
        plant.data.qpos[:], plant.data.qvel[:] = state[:size], state[size:]
        plant.step([0.0])
        columns.append(np.concatenate([plant.data.qpos, plant.data.qvel]) / small)
    return np.array(columns).T
