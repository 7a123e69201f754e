"""The arm as a MuJoCo model (MJCF), from the same parameters as everything else.

Structure: one body per link with a hinge along z of frame i (A.4); one body per rotor, fixed in the
base; two fixed tendons (strands) per cable circuit, of length theta_m - (row of the inverse of (A.5)) q, whose
springs together are the transmission stiffness k_tr on the motor side.
"""

import math
from collections.abc import Sequence
from xml.etree import ElementTree

import numpy as np

from wam_description.arm import Arm
from wam_description.contact_pairs import ContactPair, contact_pairs, folded
from wam_description.effects import Effects, Ripples
from wam_description.mjcf_objects import add_bodies, add_doors, require_names
from wam_description.parameters import lengths, require
from wam_description.parts import Links, Motors
from wam_description.thresholds import MODEL
from wam_description.world import SHAPES, Folding, Obstacles, Pushers, Springs, World


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
    root = ElementTree.Element("mujoco", model=arm.name)
    _add(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false", eulerseq="XYZ")
    _add_solver(root, arm, step)
    bodies = _add(root, "worldbody")
    _add_rotors(bodies, effects.dry(arm))
    _add_links(bodies, arm, world.folding)
    for i, name in enumerate(world.obstacles.names):
        _add_obstacle(bodies, world.obstacles, i, name, name in world.moving)
    _add_pushers(bodies, world.pushers)
    add_doors(bodies, world.doors)
    add_bodies(bodies, world.bodies)
    contact = _add(root, "contact")
    for pair in contact_pairs(arm, world):
        _add_pair(contact, pair)
    tendons = _add(root, "tendon")
    _add_cables(tendons, arm, effects)
    _add_springs(tendons, world.springs)
    _add_actuators(root, arm, effects.ripples)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


def _refuse_misfits(arm: Arm, world: World, effects: Effects) -> None:
    motors, joints = arm.motors.names, arm.joints.names
    for name in world.obstacles.names:
        require(name not in arm.covers.names, f"obstacle '{name}' has the name of a cover of the arm; rename it")
    for name, cover in zip(world.pushers.names, world.pushers.covers, strict=True):
        taken = (*arm.covers.names, *world.obstacles.names)
        require(name not in taken, f"pusher '{name}' has the name of a cover or an obstacle; rename it")
        known = ", ".join(arm.covers.names)
        require(cover in arm.covers.names, f"pusher '{name}' presses on '{cover}'; covers: {known}")
    require_names(world, (*arm.covers.names, *arm.links.names, *motors, *joints))
    for name in world.springs.joints:
        require(name in joints, f"world.springs.joints names '{name}'; joints: {', '.join(joints)}")
    for name in effects.ripples.shafts:
        shafts = (*motors, *joints)
        require(name in shafts, f"effects.ripples.shafts names '{name}'; motors and joints: {', '.join(shafts)}")
    lengths("effects", motors, {"tension_friction": effects.tension_friction})
    if len(effects.backlash) != 1:
        lengths("effects", motors, {"backlash": effects.backlash})
    effects.require_fit(arm)


def _add(parent: ElementTree.Element, tag: str, **attributes: str) -> ElementTree.Element:
    return ElementTree.SubElement(parent, tag, {key: value for key, value in attributes.items() if value})


def _numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _triple(values: Sequence[float], i: int) -> str:
    return _numbers(values[3 * i : 3 * i + 3])


def _add_solver(root: ElementTree.Element, arm: Arm, step: float) -> None:
    # explicit damping: implicitfast omits the terms that couple rotor and joint, which acts like an additional
    # inertia of step x damping on each rotor (5 %) and an error of 0.1 N m in the strain torque
    option = _add(
        root,
        "option",
        timestep=repr(step),
        gravity=_numbers(arm.gravity),
        integrator="Euler",
        solver="Newton",
        cone="elliptic",
        impratio="1",
        noslip_iterations="4",
        noslip_tolerance="0",
    )
    # without autoreset MuJoCo does not put a diverging arm back to zero by itself; the driver stops it instead
    _add(option, "flag", diagexact="enable", eulerdamp="disable", autoreset="disable")
    default = _add(root, "default")
    # a stiff friction constraint: with MuJoCo's own values a stuck joint creeps at about 1 rad/s
    _add(
        default,
        "joint",
        type="hinge",
        axis="0 0 1",
        solreffriction=_numbers((2 * step, 1.0)),
        solimpfriction="0.9999 0.9999 0.001 0.5 2",
        solreflimit=_numbers((4 * step, 1.0)),
    )
    _add(default, "geom", contype="0", conaffinity="0")


def _add_rotors(world: ElementTree.Element, motors: Motors) -> None:
    for i, name in enumerate(motors.names):
        body = _add(world, "body", name=f"{name}_rotor", pos=_numbers((-0.3, 0.15 * i, -0.3)))
        inertia = motors.inertia[i]
        _add(
            body,
            "inertial",
            pos="0 0 0",
            mass=repr(MODEL.rotor_mass),
            diaginertia=_numbers((inertia, inertia, inertia)),
        )
        _add(
            body,
            "joint",
            name=name,
            damping=repr(motors.viscous_friction[i]),
            frictionloss=repr(motors.static_friction[i]),
        )


def _add_links(world: ElementTree.Element, arm: Arm, folding: Folding) -> None:
    joints, links, covers = arm.joints, arm.carried, arm.covers
    parent = world
    for i, name in enumerate(links.names):
        twist = joints.twist[i]
        position = (joints.length[i], -math.sin(twist) * joints.offset[i], math.cos(twist) * joints.offset[i])
        parent = _add(parent, "body", name=name, pos=_numbers(position), euler=_numbers((twist, 0.0, 0.0)))
        _add(
            parent,
            "inertial",
            pos=_triple(links.centre, i),
            mass=repr(links.mass[i]),
            **_inertia(links, i),
        )
        _add(
            parent,
            "joint",
            name=joints.names[i],
            range=_numbers((joints.lower[i], joints.upper[i])),
            armature=repr(joints.armature[i]),
            damping=repr(joints.viscous_friction[i]),
            frictionloss=repr(joints.static_friction[i]),
        )
        for j, cover in enumerate(covers.names):
            if covers.links[j] == name:
                _add_cover(parent, arm, j, cover, folding.clearance if folding.stiffness and j else None)
    _add(parent, "site", name="tool", pos=_numbers(arm.tool))


def _inertia(links: Links, i: int) -> dict[str, str]:
    moments, products = _triple(links.inertia, i), _triple(links.product, i)
    if any(links.product[3 * i : 3 * i + 3]):
        return {"fullinertia": f"{moments} {products}"}
    return {"diaginertia": moments}


def _add_cover(body: ElementTree.Element, arm: Arm, i: int, name: str, clearance: float | None) -> None:
    covers = arm.covers
    site = {"pos": _triple(covers.origin, i), "euler": _triple(covers.rotation, i)}
    _add(body, "site", name=f"{name}_frame", **site)
    rotation = rotation_xyz(*covers.rotation[3 * i : 3 * i + 3])
    ends = [
        rotation @ np.array(end[3 * i : 3 * i + 3]) + np.array(covers.origin[3 * i : 3 * i + 3])
        for end in (covers.start, covers.end)
    ]
    geoms = {name: ends[0]}
    if clearance is not None:
        geoms[folded(name)] = ends[0] + clearance * (ends[1] - ends[0]) / float(np.linalg.norm(ends[1] - ends[0]))
    for geom, start in geoms.items():
        _add(
            body,
            "geom",
            name=geom,
            type="capsule",
            fromto=_numbers([*start, *ends[1]]),
            size=repr(covers.radius[i]),
            rgba="0.25 0.25 0.28 1" if i % 2 == 0 else "0.35 0.35 0.4 1",
        )


def rotation_xyz(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Rotation matrix (3, 3) of URDF's roll, pitch, yaw: about fixed x, then y, then z."""
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _add_obstacle(world: ElementTree.Element, obstacles: Obstacles, i: int, name: str, moves: bool) -> None:
    shape = obstacles.shapes[i]
    size = list(obstacles.sizes[3 * i : 3 * i + 3])
    if shape == "plane":
        size[2] = 0.1  # MuJoCo's spacing of the grid lines that it draws
    pose = {"pos": _triple(obstacles.positions, i), "euler": _triple(obstacles.rotations, i)}
    parent = _add(world, "body", name=name, mocap="true", **pose) if moves else world
    _add(
        parent,
        "geom",
        name=name,
        type=shape,
        **({} if moves else pose),
        size=_numbers(size[: SHAPES[shape]]),
        rgba="0.95 0.75 0.35 1",
    )


def _add_pushers(world: ElementTree.Element, pushers: Pushers) -> None:
    """Bodies whose pose the plant prescribes, far away at first."""
    for i, name in enumerate(pushers.names):
        if pushers.force[i] == 0.0:
            continue
        body = _add(world, "body", name=name, mocap="true", pos=_numbers((MODEL.far_away, MODEL.far_away, float(i))))
        size = pushers.sizes[3 * i : 3 * i + (1 if pushers.shapes[i] == "sphere" else 3)]
        _add(body, "geom", name=name, type=pushers.shapes[i], size=_numbers(size), rgba="0.85 0.6 0.5 1")


def _add_pair(contact: ElementTree.Element, pair: ContactPair) -> None:
    friction = pair.friction
    _add(
        contact,
        "pair",
        name=pair.name,
        geom1=pair.first,
        geom2=pair.second,
        condim="3" if friction > 0.0 else "1",
        friction=_numbers((friction, friction, 0.0, 0.0, 0.0)),
        # with so small an impedance the plant can set the force itself, see wam_driver/surfaces.py
        solimp="0.001 0.001 0.001 0.5 2",
        solref=_numbers((-pair.stiffness, -pair.damping)),
    )


def _add_cables(tendons: ElementTree.Element, arm: Arm, effects: Effects) -> None:
    """Two strands per circuit, each with half the stiffness, pretensioned, unable to push.

    With backlash they are the two flanks of a tooth, each with the whole stiffness.
    """
    size = len(arm.motors.names)
    motor_from_joint = np.linalg.inv(np.array(arm.joint_from_motor).reshape(size, size))
    for i, (motor, circuit) in enumerate(zip(arm.motors.names, arm.circuits, strict=True)):
        stretch, share = circuit.slack_stretch if effects.slack else MODEL.never_slack, 0.5
        if play := effects.play(i):
            stretch, share = -0.5 * play, 1.0
        for strand, springlength in (("tight", (-MODEL.far, -stretch)), ("loose", (stretch, MODEL.far))):
            tendon = _add(
                tendons,
                "fixed",
                name=f"{motor}_{strand}",
                stiffness=repr(circuit.stiffness * share),
                damping=repr(circuit.damping / 2.0),
                springlength=_numbers(springlength),
                springyield=repr(MODEL.never_yields),
            )
            _add(tendon, "joint", joint=motor, coef="1")
            for joint, ratio in zip(arm.joints.names, motor_from_joint[i], strict=True):
                if abs(ratio) > 1e-12:
                    _add(tendon, "joint", joint=joint, coef=repr(-float(ratio)))


def _add_springs(tendons: ElementTree.Element, springs: Springs) -> None:
    for i, joint in enumerate(springs.joints):
        if springs.stiffness[i] == 0.0:
            continue
        lever = springs.lever[i]
        rest = lever * springs.rest[i]
        tendon = _add(
            tendons,
            "fixed",
            name=f"spring{i}",
            stiffness=repr(springs.stiffness[i]),
            springlength=_numbers((rest, rest) if springs.bilateral[i] else (rest, MODEL.far)),
        )
        _add(tendon, "joint", joint=joint, coef=repr(lever))


def _add_actuators(root: ElementTree.Element, arm: Arm, ripples: Ripples) -> None:
    actuator = _add(root, "actuator")
    for motor in arm.motors.names:
        _add(actuator, "motor", name=motor, joint=motor)
    for i, shaft in enumerate(ripples.shafts):
        if ripples.amplitude[i] == 0.0:
            continue
        _add(
            actuator,
            "dcmotor",
            name=f"ripple{i}",
            joint=shaft,
            input="none",
            gear=repr(ripples.ratio[i]),
            # MuJoCo needs a winding; without input it carries no current
            resistance="1",
            motorconst="0",
            cogging=_numbers((ripples.amplitude[i], ripples.cycles[i], ripples.phase[i])),
        )
