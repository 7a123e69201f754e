"""Force control of the simulated plant: the loop of figure 5.4 around the testbed with an ideal velocity source."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wam_description.arm import Arm
from wam_driver.plant import Plant
from wam_studies.plant.ideal_testbed import (
    IMMOVABLE,
    RATIO,
    STEP,
    Numbers,
    against_spring,
    ideal_testbed,
    link_inertia,
    released_plant,
)
from wam_theory.friction_model import FrictionNode


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
    """Its plant against a spring, N m/rad; a unilateral one pushes at angles below zero; backlash at the joint, rad."""
    return released_plant(arm, against_spring(stiffness, unilateral), step, backlash=(RATIO * backlash,))


def loop_node(arm: Arm, stiffness: float, unilateral: bool = False) -> FrictionNode:
    """The node of figure 5.4 with the parameters of this arm."""
    joints = arm.joints
    return FrictionNode(
        link_inertia(arm),
        joints.viscous_friction[0],
        RATIO**2 * arm.circuits[0].stiffness,
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
