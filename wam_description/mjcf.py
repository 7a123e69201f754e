"""The arm as a MuJoCo model (MJCF), from the same parameters as everything else.

Structure: one body per link with a hinge along z of frame i (A.4); one body per rotor, fixed in the
base; two fixed tendons (strands) per cable circuit, of length theta_m - (row of the inverse of (A.5)) q, whose
springs together are the transmission stiffness k_tr on the motor side.
"""

from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from wam_description.arm import Arm
from wam_description.contact_pairs import ContactPair, contact_pairs, folded
from wam_description.effects import Effects, Ripples
from wam_description.mjcf_objects import add_bodies, add_doors
from wam_description.parameters import require, rows
from wam_description.parts import Motors
from wam_description.small_matrices import rotation_xyz
from wam_description.thresholds import MODEL
from wam_description.world import PUSHER_SHAPES, SHAPES, Folding, Pushers, Springs, World
from wam_description.xml_element import add, text


def mjcf(arm: Arm, step: float, world: World, effects: Effects) -> str:
    """MJCF of the arm in its world.

    Parameters
    ----------
    arm : the arm.
    step : simulation step, s.
    world : obstacles, free bodies and doors, each paired with every cover; free bodies also with each other, with
        obstacles and doors; springs at joints; pushers, each paired with its cover.
    effects : slack, backlash, torque ripple of motors and pulleys.

    Returns
    -------
    str
        XML with joints named as motors and joints, tendons and actuators named as motors, bodies
        as links, geoms as covers and obstacles, a site ``tool``.

    Raises
    ------
    ParameterError
        if an obstacle has the name of a cover, or springs and effects do not fit the arm.
    """
    _refuse_misfits(arm, world, effects)
    root = Element("mujoco", model=arm.name)
    add(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false", eulerseq="XYZ")
    _add_solver(root, arm, step)
    bodies = add(root, "worldbody")
    _add_rotors(bodies, effects.dry(arm))
    _add_links(bodies, arm, world.folding)
    for obstacle in rows(world.obstacles):
        _add_obstacle(bodies, obstacle, obstacle.name in world.moving)
    _add_pushers(bodies, world.pushers)
    add_doors(bodies, world.doors)
    add_bodies(bodies, world.bodies)
    contact = add(root, "contact")
    for pair in contact_pairs(arm, world):
        _add_pair(contact, pair)
    tendons = add(root, "tendon")
    _add_cables(tendons, arm, effects)
    _add_springs(tendons, world.springs)
    _add_actuators(root, arm, effects.ripples)
    return text(root)


def _refuse_misfits(arm: Arm, world: World, effects: Effects) -> None:
    motors, joints = arm.motors.names, arm.joints.names
    covers, obstacles = arm.covers.names, world.obstacles.names
    for what, names, taken in (
        ("obstacle", obstacles, covers),
        ("pusher", world.pushers.names, (*covers, *obstacles)),
        ("object", world.objects, (*covers, *arm.links.names, *motors, *joints)),
    ):
        for name in names:
            require(name not in taken, f"{what} '{name}' has the name of a part of the arm or an obstacle; rename it")
    for pusher in rows(world.pushers):
        known = ", ".join(covers)
        require(pusher.cover in covers, f"pusher '{pusher.name}' presses on '{pusher.cover}'; covers: {known}")
    for name in world.springs.joints:
        require(name in joints, f"world.springs.joints names '{name}'; joints: {', '.join(joints)}")
    for name in effects.ripples.shafts:
        shafts = (*motors, *joints)
        require(name in shafts, f"effects.ripples.shafts names '{name}'; motors and joints: {', '.join(shafts)}")
    effects.require_fit(arm)


def _add_solver(root: Element, arm: Arm, step: float) -> None:
    # explicit damping: implicitfast omits the terms that couple rotor and joint, which acts like an additional
    # inertia of step x damping on each rotor (5 %) and an error of 0.1 N m in the strain torque
    option = add(
        root,
        "option",
        timestep=step,
        gravity=arm.gravity,
        integrator="Euler",
        solver="Newton",
        cone="elliptic",
        impratio="1",
        noslip_iterations="4",
        noslip_tolerance="0",
    )
    # without autoreset MuJoCo does not put a diverging arm back to zero by itself; the driver stops it instead
    add(option, "flag", diagexact="enable", eulerdamp="disable", autoreset="disable")
    default = add(root, "default")
    # a stiff friction constraint: with MuJoCo's own values a stuck joint creeps at about 1 rad/s
    add(
        default,
        "joint",
        type="hinge",
        axis="0 0 1",
        solreffriction=(2 * step, 1.0),
        solimpfriction="0.9999 0.9999 0.001 0.5 2",
        solreflimit=(4 * step, 1.0),
    )
    add(default, "geom", contype="0", conaffinity="0")


def _add_rotors(world: Element, motors: Motors) -> None:
    for i, motor in enumerate(rows(motors)):
        body = add(world, "body", name=f"{motor.name}_rotor", pos=(-0.3, 0.15 * i, -0.3))
        add(body, "inertial", pos="0 0 0", mass=MODEL.rotor_mass, diaginertia=[motor.inertia] * 3)
        add(body, "joint", name=motor.name, damping=motor.viscous_friction, frictionloss=motor.static_friction)


def _add_links(world: Element, arm: Arm, folding: Folding) -> None:
    parent = world
    for link, joint, place in zip(rows(arm.carried), rows(arm.joints), arm.joints.places, strict=True):
        parent = add(parent, "body", name=link.name, pos=place, euler=(joint.twist, 0.0, 0.0))
        inertia = {"fullinertia": link.inertia + link.product} if any(link.product) else {"diaginertia": link.inertia}
        add(parent, "inertial", pos=link.centre, mass=link.mass, **inertia)
        add(
            parent,
            "joint",
            name=joint.name,
            range=(joint.lower, joint.upper),
            armature=joint.armature,
            damping=joint.viscous_friction,
            frictionloss=joint.static_friction,
        )
        for i, cover in enumerate(rows(arm.covers)):
            if cover.link == link.name:
                _add_cover(parent, i, cover, folding.clearance if folding.stiffness and i else None)
    add(parent, "site", name="tool", pos=arm.tool)


def _add_cover(body: Element, i: int, cover: Any, clearance: float | None) -> None:
    add(body, "site", name=f"{cover.name}_frame", pos=cover.origin, euler=cover.rotation)
    rotation = rotation_xyz(*cover.rotation)
    start, end = (rotation @ np.array(one) + np.array(cover.origin) for one in (cover.start, cover.end))
    geoms = {cover.name: start}
    if clearance is not None:
        geoms[folded(cover.name)] = start + clearance * (end - start) / float(np.linalg.norm(end - start))
    for geom, begin in geoms.items():
        add(
            body,
            "geom",
            name=geom,
            type="capsule",
            fromto=[*begin, *end],
            size=cover.radius,
            rgba="0.25 0.25 0.28 1" if i % 2 == 0 else "0.35 0.35 0.4 1",
        )


def _add_obstacle(world: Element, obstacle: Any, moves: bool) -> None:
    name, shape, size = obstacle.name, obstacle.shape, list(obstacle.size)
    if shape == "plane":
        size[2] = 0.1  # MuJoCo's spacing of the grid lines that it draws
    pose = {"pos": obstacle.position, "euler": obstacle.rotation}
    parent = add(world, "body", name=name, mocap="true", **pose) if moves else world
    own = {} if moves else pose
    add(parent, "geom", name=name, type=shape, **own, size=size[: SHAPES[shape]], rgba="0.95 0.75 0.35 1")


def _add_pushers(world: Element, pushers: Pushers) -> None:
    """Bodies whose pose the plant prescribes, far away at first."""
    for i, pusher in enumerate(rows(pushers)):
        if pusher.force > 0.0:
            away = (MODEL.far_away, MODEL.far_away, i)
            body = add(world, "body", name=pusher.name, mocap="true", pos=away)
            size = pusher.size[: PUSHER_SHAPES[pusher.shape]]
            add(body, "geom", name=pusher.name, type=pusher.shape, size=size, rgba="0.85 0.6 0.5 1")


def _add_pair(contact: Element, pair: ContactPair) -> None:
    friction = pair.friction
    add(
        contact,
        "pair",
        name=pair.name,
        geom1=pair.first,
        geom2=pair.second,
        condim="3" if friction > 0.0 else "1",
        friction=(friction, friction, 0.0, 0.0, 0.0),
        # with so small an impedance the plant can set the force itself, see wam_driver/surfaces.py
        solimp="0.001 0.001 0.001 0.5 2",
        solref=(-pair.stiffness, -pair.damping),
    )


def _add_cables(tendons: Element, arm: Arm, effects: Effects) -> None:
    """Two strands per circuit, each with half the stiffness, pretensioned, unable to push.

    With backlash they are the two flanks of a tooth, each with the whole stiffness.
    """
    motor_from_joint = arm.transmission.motor_from_joint
    for i, (motor, circuit) in enumerate(zip(arm.motors.names, arm.circuits, strict=True)):
        stretch, share = circuit.slack_stretch if effects.slack else MODEL.never_slack, 0.5
        if play := effects.play(i):
            stretch, share = -0.5 * play, 1.0
        for strand, springlength in (("tight", (-MODEL.far, -stretch)), ("loose", (stretch, MODEL.far))):
            tendon = add(
                tendons,
                "fixed",
                name=f"{motor}_{strand}",
                stiffness=circuit.stiffness * share,
                damping=circuit.damping / 2.0,
                springlength=springlength,
                springyield=MODEL.never_yields,
            )
            add(tendon, "joint", joint=motor, coef="1")
            for joint, ratio in zip(arm.joints.names, motor_from_joint[i], strict=True):
                if abs(ratio) > 1e-12:
                    add(tendon, "joint", joint=joint, coef=-ratio)


def _add_springs(tendons: Element, springs: Springs) -> None:
    for i, spring in enumerate(springs.present):
        rest = spring.lever * spring.rest
        length = (rest, rest if spring.bilateral else MODEL.far)
        tendon = add(tendons, "fixed", name=f"spring{i}", stiffness=spring.stiffness, springlength=length)
        add(tendon, "joint", joint=spring.joint, coef=spring.lever)


def _add_actuators(root: Element, arm: Arm, ripples: Ripples) -> None:
    actuator = add(root, "actuator")
    for motor in arm.motors.names:
        add(actuator, "motor", name=motor, joint=motor)
    for i, ripple in enumerate(rows(ripples)):
        if ripple.amplitude == 0.0:
            continue
        add(
            actuator,
            "dcmotor",
            name=f"ripple{i}",
            joint=ripple.shaft,
            input="none",
            gear=ripple.ratio,
            # MuJoCo needs a winding; without input it carries no current
            resistance="1",
            motorconst="0",
            cogging=(ripple.amplitude, ripple.cycles, ripple.phase),
        )
