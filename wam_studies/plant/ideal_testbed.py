"""The testbed of section 5.6 reduced to the theory's model: one link, one cable circuit, requested effects only."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_description.arm import Arm
from wam_description.configuration import Configuration, packaged
from wam_description.effects import no_effects
from wam_description.parameters import empty
from wam_description.world import NO_SPRINGS, Obstacles, Springs, World
from wam_driver.plant import Plant
from wam_theory import cable
from wam_theory.friction_model import FrictionNode

Numbers = NDArray[np.float64]
STEP = 2.5e-4  # s
IMMOVABLE = 1e9  # kg m^2, of a rotor that the cable cannot accelerate
NOTHING = empty(Obstacles)
EMPTY = World(NOTHING, NO_SPRINGS)
LEVER = 0.9144  # m, from the joint to the tip
RATIO = 14.0


def ideal(
    arm: Arm,
    rotor: float | None = None,
    damping: float = 0.0,
    friction: tuple[float, float] = (0.0, 0.0),
    at_motor: float = 0.0,
) -> Arm:
    """An arm with one motor without gravity and ends, and with the requested effects only.

    Parameters
    ----------
    arm : with one joint.
    rotor : inertia of the rotor, kg m^2; None for that of the motor.
    damping : of the cable circuit, N m s/rad.
    friction : static and dynamic, at the joint, N m.
    at_motor : friction of the motor, N m.
    """
    none = (0.0,)
    motors = replace(
        arm.motors,
        inertia=(rotor or arm.motors.inertia[0],),
        static_friction=(at_motor,),
        dynamic_friction=(at_motor,),
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
    return replace(arm, motors=motors, joints=joints, cables=cables, gravity=(0.0, 0.0, 0.0))


def ideal_testbed(
    ratio: float = RATIO, rotor: float | None = None, damping: float = 0.0, friction: tuple[float, float] = (0.0, 0.0)
) -> Arm:
    """The testbed as an ideal arm with a ratio N; the other arguments are those of `ideal`."""
    arm = Configuration.load(packaged("testbed")).shared.arm
    return replace(ideal(arm, rotor, damping, friction), joint_from_motor=(1.0 / ratio,))


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
    return arm.links.inertia[1] + arm.links.mass[0] * arm.links.centre[0] ** 2 + arm.joints.armature[0]


def stepped_map(plant: Plant, steps: int = 1) -> tuple[Numbers, Numbers]:
    """What takes angles and velocities, and a held torque of one motor, over some steps: by stepping from units."""
    size, small, torque = plant.model.nv, 1e-6, 1e-3

    def after(state: Numbers, torque: float) -> Numbers:
        plant.data.qpos[:], plant.data.qvel[:] = state[:size], state[size:]
        plant.step([torque], steps)
        return np.concatenate([plant.data.qpos, plant.data.qvel])

    columns = [after(state, 0.0) / small for state in small * np.eye(2 * size)]
    return np.array(columns).T, after(np.zeros(2 * size), torque) / torque


def amplitude(state: Numbers, inlet: Numbers, z: NDArray[np.complex128], row: int) -> Numbers:
    """Amplitude of an element of the state over that of the input, at each z of a sampled map."""
    return np.abs([np.linalg.solve(one * np.eye(len(state)) - state, inlet)[row] for one in z])


def frequencies(plant: Plant, step: float = STEP) -> Numbers:
    """Undamped frequencies of the plant, each twice, the lowest first, rad/s, from its map over a step."""
    return np.sort(np.abs(np.angle(np.linalg.eigvals(stepped_map(plant)[0])))) / step


def power_ratio(plant: Plant, load: float, steps: int) -> float:
    """Work on a load at the joint, N m, over work of the motor, in so many steps of slow turning."""
    q, work = plant.q[0], 0.0
    for _ in range(steps):
        before = plant.theta[0]
        plant.step([0.0])
        work += plant.circuit_torque[0] * (plant.theta[0] - before)
    return load * (plant.q[0] - q) / work


def limiting_efficiency(arm: Arm, torque: float, motor: int = 0) -> float:
    """Power out over power in, at most, (6.15), under a torque of a motor, N m."""
    cables, name = arm.cables, arm.motors.names[motor]
    columns = cables.stage_motors, cables.stage_radius, cables.stage_ea, cables.stage_circuits, cables.stage_ratio
    stages = [stage for of, *stage in zip(*columns, strict=True) if of == name]
    return cable.efficiency(cable.stage_loss(torque, *zip(*stages, strict=True)))


class PlantResponse(NamedTuple):
    """Response of the plant to a step of the desired force, arrays over time (n,), and the node for the theory.

    `time` s, `force` F_c N m, `position` rad and `velocity` rad/s of the link, `motor` x_m at the joint rad.
    """

    time: Numbers
    force: Numbers
    position: Numbers
    velocity: Numbers
    motor: Numbers
    node: FrictionNode


def loop_arm(damping: float, friction: tuple[float, float]) -> Arm:
    """The testbed with this damping, N m s/rad, and this static and dynamic friction, N m, at its joint."""
    arm = ideal_testbed(rotor=IMMOVABLE, friction=friction)
    return replace(arm, joints=replace(arm.joints, viscous_friction=(damping,)))


def loop_plant(
    arm: Arm, stiffness: float, unilateral: bool = False, step: float = STEP, backlash: float = 0.0
) -> Plant:
    """Plant of an arm against a spring, N m/rad; a unilateral one pushes at angles below zero; backlash in rad."""
    return released_plant(arm, against_spring(stiffness, unilateral), step, backlash=(RATIO * backlash,))


def loop_node(arm: Arm, stiffness: float, unilateral: bool = False) -> FrictionNode:
    """The node of figure 5.4 with the parameters of this arm."""
    joints = arm.joints
    return FrictionNode(
        link_inertia(arm),
        joints.viscous_friction[0],
        (1.0 / arm.joint_from_motor[0]) ** 2 * arm.circuits[0].stiffness,
        stiffness,
        joints.dynamic_friction[0],
        joints.static_friction[0],
        unilateral,
    )


def force_step(
    desired: float,
    stiffness: float,
    gain: float,
    damping: float,
    friction: tuple[float, float],
    seconds: float,
    unilateral: bool = False,
    proportional: bool = False,
    step: float = STEP,
    backlash: float = 0.0,
) -> PlantResponse:
    """Response of the testbed to a step of the desired force, the loop closed in every step.

    Parameters
    ----------
    desired : F_des, N m.
    stiffness : k_c, N m/rad.
    gain : G_I, rad/s/(N m); G_P, rad/(N m), where proportional.
    damping : b at the joint, N m s/rad.
    friction : static and dynamic, at the joint, N m.
    seconds : duration.
    unilateral : whether the contact only pushes.
    proportional : whether the error sets the motor's position instead of its speed.
    step : of the plant, s.
    backlash : play between motor and link at the joint, rad.
    """
    arm = loop_arm(damping, friction)
    plant = loop_plant(arm, stiffness, unilateral, step, backlash)
    side = -1.0 if unilateral else 1.0  # the one-sided spring is below
    rows = []
    for _ in range(round(seconds / step)):
        q, motor = side * plant.q[0], side * plant.theta[0] / RATIO
        force = stiffness * (max(q, 0.0) if unilateral else q)
        rows.append((force, q, side * plant.qd[0], motor))
        rate = gain * (desired - force)
        if proportional:
            rate = (rate - motor) / step
        plant.data.qvel[0] = side * RATIO * rate
        plant.step([0.0])
    forces, positions, velocities, motors = np.array(rows).T
    time = np.arange(len(rows), dtype=np.float64) * step
    return PlantResponse(time, forces, positions, velocities, motors, loop_node(arm, stiffness, unilateral))
