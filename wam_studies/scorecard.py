"""The arm of a configuration compared with the requisites of chapter 3: ``wam model scorecard``."""

import math
from itertools import product

import numpy as np

from wam_analysis.table import markdown
from wam_description.arm import Arm
from wam_description.configuration import Configuration
from wam_description.constants import constants
from wam_description.rigid_body import Array, RigidBody
from wam_driver.driver import DriverParameters
from wam_studies.figures.backdrivability import Backdriving
from wam_studies.plant.ideal_testbed import limiting_efficiency
from wam_theory.cable import tensions
from wam_theory.requisites import TOLERANCE, Measures, Requisite, scorecard
from wam_theory.resonance import (
    best_contact_stiffness,
    best_transmission_stiffness,
    force_resonances,
    hard_contact_bandwidth,
)
from wam_theory.stiction import stiction_cycle_force

POSES = 15  # of each joint apart from the first, which does not change the torques
DIRECTIONS = 180
HZ = 0.5 / math.pi


def printed(meaning: str) -> tuple[float, ...]:
    """A constant printed in the thesis, SI."""
    (row,) = (row for row in constants("wam") if row.source and row.meaning == meaning)
    return row.si


def measures(configuration: Configuration) -> Measures:
    """Quantities of the scorecard from the parameters of the arm.

    Inertia and stiffness are those in the pose of (A.2), each joint with the others at rest.

    Parameters
    ----------
    configuration : of an arm with the four joints and two links of the MIT/WAM.

    Raises
    ------
    ValueError
        for another arm, for which the thesis has no numbers.
    """
    arm = configuration.shared.arm
    if arm.joints.twist != printed("link twist") or len(arm.covers.names) != 2:
        raise ValueError(
            f"arm '{arm.name}' has other joints or links than the MIT/WAM, whose scorecard this is: "
            "use the configuration 'wam', or one that builds on it"
        )
    driver = configuration.node("driver", DriverParameters)
    body, tip, gears = RigidBody(arm), Backdriving(arm), arm.transmission.motor_from_joint
    pose = printed("pose in the middle of the workspace")
    links = body.mass_matrix(pose) + arm.pulleys
    directions = normal_directions(body, pose)
    levers = directions @ body.tool_jacobian(pose)  # (directions, joints), m
    stiffness = max(driver.world.obstacles.stiffness)
    radius, pretension = [c.radius for c in arm.circuits], np.array(arm.cables.pretension)
    tight, _ = tensions(arm.motors.peak_torque, pretension, radius)
    return Measures(
        steady_force=steady_force(arm),
        steady_force_required=printed("steady contact force at any point, any pose")[0],
        least_force=float(tip.pushes(pose, directions).max()),
        cycle_force=cycle_force(arm, levers, stiffness),
        friction_share=tuple((tip.friction / (np.abs(gears.T) @ arm.motors.peak_torque)).tolist()),
        friction_required=printed("joint friction, of peak torque; 2 to 4 are bounds"),
        impact_speed=driver.tip_speed_limit,
        effective_mass=float(tip.masses(pose, directions).max()),
        contact_stiffness=stiffness,
        cable_tension=float(np.max(tight / arm.cables.breaking_strength)),
        pretension=float(np.min(2.0 * pretension * radius / arm.motors.peak_torque)),
        link_inertia=tuple(np.diag(links).tolist()),
        rotor_inertia=tuple(np.diag(tip.rotors).tolist()),
        transmission_stiffness=tuple((np.square(gears.T) @ [c.stiffness for c in arm.circuits]).tolist()),
        joint_contact_stiffness=tuple((stiffness * np.square(levers).max(axis=0)).tolist()),
        coupled_bandwidth=coupled_bandwidth(arm, links, levers, stiffness),
        aspect_ratio=aspect_ratios(arm),
        aspect_required=(*printed("aspect ratio of the inner link"), *printed("aspect ratio of the outer link")),
        cover_friction=min(driver.world.obstacles.friction),
        efficiency=min(limiting_efficiency(arm, torque, i) for i, torque in enumerate(arm.motors.peak_torque)),
        efficiency_required=printed("least limiting efficiency at full torque")[0],
    )


def normal_directions(body: RigidBody, q: tuple[float, ...]) -> Array:
    """Unit vectors normal to the outer link, (directions, 3), in the base frame."""
    rotation = body.cover_pose(q, body.covers[-1]).rotation
    angles = np.linspace(0.0, math.pi, DIRECTIONS, endpoint=False)
    return np.outer(np.cos(angles), rotation[:, 1]) + np.outer(np.sin(angles), rotation[:, 2])


def steady_force(arm: Arm) -> float:
    """Force, N, at the tip and at the elbow within the continuous torques, in any direction, and a pose of a grid.

    The stretched pose of (A.3), which has the longest lever, is added; 0 if gravity alone takes more in one.
    """
    body, torque_share = RigidBody(arm), arm.transmission.joint_from_motor.T
    limits = np.array(arm.motors.continuous_torque)
    ranges = [np.linspace(low, high, POSES) for low, high in zip(arm.joints.lower, arm.joints.upper, strict=True)]
    least = math.inf
    for q in (printed("pose with both links stretched out horizontally"), *product((0.0,), *ranges[1:])):
        left = np.maximum(limits - np.abs(torque_share @ body.gravity_torque(q)), 0.0)
        for jacobian in (body.tool_jacobian(q), body.point_jacobian(q, arm.covers.names[0], arm.covers.end[:3])):
            needed = np.linalg.norm(torque_share @ jacobian.T, axis=1)
            least = min(least, float(np.min(left / np.maximum(needed, 1e-12))))
    return least


def cycle_force(arm: Arm, levers: Array, stiffness: float) -> float:
    """Greatest stiction cycle (5.8) at the tip, peak to peak, N, over joints and directions, undamped: Omega is 2.

    The friction of the joints; that of the motors is within their velocity loops.

    Parameters
    ----------
    arm : with the friction and the cables.
    levers : of directions at the tip, (directions, joints), m.
    stiffness : of the contact, N/m.
    """
    gears, joints = arm.transmission.motor_from_joint, arm.joints
    cables = np.square(gears.T) @ [circuit.stiffness for circuit in arm.circuits]
    lever = np.maximum(np.abs(levers), 1e-9)
    torque = stiction_cycle_force(cables, stiffness * lever**2, joints.static_friction, joints.dynamic_friction, 0.0)
    return float((torque / lever).max())


def coupled_bandwidth(arm: Arm, links: Array, levers: Array, stiffness: float) -> float:
    """Least resonance, Hz, over directions of a contact at the tip, with all rotors, cables and links free to move.

    Parameters
    ----------
    arm : its rotors and cables.
    links : mass matrix of the links, (joints, joints), kg m^2.
    levers : of directions at the tip, (directions, joints), m.
    stiffness : of the contact, N/m.
    """
    n = arm.n
    stretch = np.hstack([np.eye(n), -arm.transmission.motor_from_joint])
    cables = stretch.T @ np.diag([circuit.stiffness for circuit in arm.circuits]) @ stretch
    inertia = np.block([[np.diag(arm.motors.inertia), np.zeros((n, n))], [np.zeros((n, n)), links]])
    least = math.inf
    for lever in levers:
        contact = np.concatenate([np.zeros(n), lever])
        squares = np.sort(
            np.linalg.eigvals(np.linalg.solve(inertia, cables + stiffness * np.outer(contact, contact))).real
        )
        least = min(least, math.sqrt(squares[n - 1]) / (2.0 * math.pi))  # without the contact n motions are free
    return least


def aspect_ratios(arm: Arm) -> tuple[float, ...]:
    """Length over width by 7.2.1: inner link over the joint-4 mechanism, outer tube with its ends."""
    (hole,) = printed("hole through which the joint-4 mechanism fits")
    tube = np.linalg.norm(np.subtract(arm.covers.end[3:], arm.covers.start[3:])) + 2.0 * arm.covers.radius[1]
    inner_width = max(hole, 2.0 * arm.covers.radius[0])
    return arm.covers.length[0] / inner_width, float(tube) / (2.0 * arm.covers.radius[1])


def table(rows: tuple[Requisite, ...]) -> str:
    """The scorecard as Markdown."""
    lines = []
    for row in rows:
        required = f"{row.sense} {row.required:.3g}" if row.sense else "no number"
        is_short = (row.value < row.required) == (row.sense == "at least")
        met = {True: "yes", False: "no", None: ""}[row.met]
        if row.met and is_short and f"{row.value:.3g}" != f"{row.required:.3g}":
            met = f"yes, within {TOLERANCE:.0%}"
        value = f"{row.value:.3g} {row.unit}".strip()
        lines.append((row.requisite, row.measure, value, required, row.source, met))
    return markdown(("requisite", "measure", "value", "thesis", "source", "met"), lines)


def report(configuration: Configuration) -> str:
    """The scorecard of a configuration's arm as Markdown."""
    return table(scorecard(measures(configuration)))


def stiffness_rule(configuration: Configuration) -> dict[str, Array]:
    """The rule of 4.4, with the hardest contact of the configuration at the tip: quantities of each joint, by name.

    The last one is the bandwidth with the transmission that (4.10) requires, on the present contact.

    Parameters
    ----------
    configuration : of the arm, as in `scorecard.measures`.
    """
    m = measures(configuration)
    cable, contact, rotor, link = map(
        np.array, (m.transmission_stiffness, m.joint_contact_stiffness, m.rotor_inertia, m.link_inertia)
    )
    best = best_transmission_stiffness(rotor, link, contact)
    bandwidth, with_best = (force_resonances(rotor, link, k, contact, 1.0).lower * HZ for k in (cable, best))
    return {
        "k_tr, N m/rad": cable,
        f"k_c of {m.contact_stiffness:g} N/m at the tip": contact,
        "k_tr by (4.10)": best,
        "k_c by (4.9)": best_contact_stiffness(rotor, link, cable),
        "bandwidth, Hz": bandwidth,
        "its asymptote (4.6)": hard_contact_bandwidth(rotor, cable) * HZ,
        "bandwidth with k_tr of (4.10)": with_best,
    }


def stiffness_table(configuration: Configuration) -> str:
    """`stiffness_rule` as Markdown."""
    rule = stiffness_rule(configuration)
    joints = enumerate(zip(*rule.values(), strict=True), 1)
    return markdown(("joint", *rule), [(str(joint), *(f"{value:.3g}" for value in row)) for joint, row in joints])
