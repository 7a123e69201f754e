"""The requisites of chapter 3 for good force control, as formulas and as a scorecard."""

import math
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wam_theory.arguments import Array, above_zero, quotient, zero_or_more
from wam_theory.resonance import force_resonances, hard_contact_bandwidth

TOLERANCE: Final = 0.01  # of a required value that is printed with two digits


def impact_force(speed: ArrayLike, inertia: ArrayLike, contact_stiffness: ArrayLike) -> Array:
    """Greatest force of an impact, N, (3.1): v sqrt(J k_c), kinetic energy equal to the energy of the contact (3.2.2).

    J is the EFFECTIVE mass at the contact, including the rotors if their transmission is stiff; the print has
    the link's inertia, which fits rotary quantities only: then v is rad/s, J kg m^2, k_c N m/rad and the
    result N m.  No loss, no friction, no other motion.

    Parameters
    ----------
    speed : v at the contact, m/s, zero or more.
    inertia : J, kg, above zero.
    contact_stiffness : k_c, N/m, above zero.
    """
    (v,) = zero_or_more(speed=speed)
    j, k = above_zero(inertia=inertia, contact_stiffness=contact_stiffness)
    return v * np.sqrt(j * k)


def secure_angle(friction_coefficient: ArrayLike) -> Array:
    """Largest angle between two links from which a cylinder does not slip, rad: 2 atan(mu), the whole friction cone.

    tan(theta/2) = mu, required for (3.2) and (3.3) to be consistent (3.2.4); not in print.

    Parameters
    ----------
    friction_coefficient : mu, zero or more.
    """
    (mu,) = zero_or_more(friction_coefficient=friction_coefficient)
    return 2.0 * np.arctan(mu)


def useful_length(aspect_ratio: ArrayLike, angle: ArrayLike) -> Array:
    """Fraction of a link that can grasp, L'/L, (3.2): 1 - (W/L)/(2 tan(theta/2)), at least 0 (3.2.4).

    Two equal links of width W whose axes meet at the joint: their faces meet only beyond W/2/tan(theta/2).

    Parameters
    ----------
    aspect_ratio : L/W, above zero.
    angle : theta between the links, rad, zero to pi; `secure_angle` for a grasp without slip.
    """
    (ratio,) = above_zero(aspect_ratio=aspect_ratio)
    (theta,) = zero_or_more(angle=angle)
    if not np.all(theta <= math.pi):
        raise ValueError(f"angle is {angle!r} rad; it must not be above pi")
    return np.maximum(1.0 - quotient(0.5, ratio * np.tan(theta / 2.0)), 0.0)


def largest_cylinder(aspect_ratio: ArrayLike, friction_coefficient: ArrayLike) -> Array:
    """Largest cylinder that two links hold, D/L, (3.3): 2 mu - W/L, at least 0 (3.2.4).

    At the angle tan(theta/2) = mu, in contact with the ends of the links.

    Parameters
    ----------
    aspect_ratio : L/W, above zero.
    friction_coefficient : mu, zero or more.
    """
    (ratio,) = above_zero(aspect_ratio=aspect_ratio)
    (mu,) = zero_or_more(friction_coefficient=friction_coefficient)
    return np.maximum(2.0 * mu - 1.0 / ratio, 0.0)


@dataclass(frozen=True)
class Measures:
    """Quantities of a scorecard; one number, or one for each joint or link.

    Parameters
    ----------
    steady_force : continuous force at any point of the links in any pose, N.
    steady_force_required : by the thesis, N.
    least_force : force at the tip masked by dry friction, N.
    cycle_force : greatest stiction cycle of a force loop, (5.8) at the tip, peak to peak, N; zero without stiction.
    friction_share : dry friction of each joint over its peak torque.
    friction_required : by the thesis, of each joint.
    impact_speed : speed limit of the tip, m/s.
    effective_mass : at the tip, normal to the link, including the rotors, kg.
    contact_stiffness : of the hardest contact, N/m.
    cable_tension : greatest ratio of a cable's tension at peak torque to its breaking strength.
    pretension : least ratio to half of the tension difference at peak torque; below 1 a strand goes slack.
    link_inertia : of each joint, kg m^2.
    rotor_inertia : of the motors, reflected to each joint, kg m^2.
    transmission_stiffness : at each joint, N m/rad.
    joint_contact_stiffness : of the contact, at each joint, N m/rad.
    coupled_bandwidth : least resonance of the arm on the contact with every joint driven by a torque, Hz.
    aspect_ratio : length over width of each link.
    aspect_required : by the thesis, of each link.
    cover_friction : coefficient of friction of the covers.
    efficiency : least limiting efficiency of a transmission at peak torque.
    efficiency_required : by the thesis.
    """

    steady_force: float
    steady_force_required: float
    least_force: float
    cycle_force: float
    friction_share: tuple[float, ...]
    friction_required: tuple[float, ...]
    impact_speed: float
    effective_mass: float
    contact_stiffness: float
    cable_tension: float
    pretension: float
    link_inertia: tuple[float, ...]
    rotor_inertia: tuple[float, ...]
    transmission_stiffness: tuple[float, ...]
    joint_contact_stiffness: tuple[float, ...]
    coupled_bandwidth: float
    aspect_ratio: tuple[float, ...]
    aspect_required: tuple[float, ...]
    cover_friction: float
    efficiency: float
    efficiency_required: float


class Requisite(NamedTuple):
    """One row of the scorecard; `required` is NaN and `met` None if the thesis has no number.

    The thesis prints two digits: a value within `TOLERANCE` of the required one meets it.
    """

    requisite: str
    measure: str
    value: float
    unit: str
    sense: Literal["at least", "at most", ""]
    required: float
    source: str
    met: bool | None


def scorecard(measures: Measures) -> tuple[Requisite, ...]:
    """The six requisites of chapter 3, compared with the thesis's values for the MIT/WAM.

    Dynamic stability, one half of robustness, is not included: it depends on the gains of the force loop
    and on the contact ((5.15), (5.17)).

    Parameters
    ----------
    measures : of the arm.

    Returns
    -------
    Rows in the order of section 3.2; one row for each joint or link if the thesis has a number for each,
    else one for the worst.
    """
    m = measures
    rows = [
        *_dynamic_range(m),
        _row("robustness", "impact force at the tip (3.1)", _impact(m), "N", source="3.2.2"),
        _row(
            "robustness",
            "greatest cable tension at peak torque / cable strength",
            m.cable_tension,
            "",
            "at most",
            1.0,
            "3.2.1",
        ),
        _row("robustness", "pretension / half of the full-torque tension", m.pretension, "", "at least", 1.0, "6.5"),
        *_bandwidth(m),
        *_slenderness(m),
        _row(
            "high efficiency",
            "limiting efficiency at peak torque",
            m.efficiency,
            "",
            "at least",
            m.efficiency_required,
            "7.2.2",
        ),
        *_backdrivability(m),
    ]
    return tuple(rows)


def _row(
    requisite: str,
    measure: str,
    value: float,
    unit: str,
    sense: Literal["at least", "at most", ""] = "",
    required: float = math.nan,
    source: str = "",
) -> Requisite:
    met = {"at least": value >= (1.0 - TOLERANCE) * required, "at most": value <= (1.0 + TOLERANCE) * required}.get(
        sense
    )
    return Requisite(requisite, measure, value, unit, sense, required, source, met)


def _impact(m: Measures) -> float:
    return float(impact_force(m.impact_speed, m.effective_mass, m.contact_stiffness))


def _dynamic_range(m: Measures) -> list[Requisite]:
    name = "dynamic range"
    joints = [
        _row(name, f"peak torque / friction, joint {i}", float(ratio), "", "at least", 1.0 / required, "7.2.2")
        for i, (ratio, required) in enumerate(zip(quotient(1.0, m.friction_share), m.friction_required, strict=True), 1)
    ]
    return [
        _row(
            name,
            "steady force at any point in any pose",
            m.steady_force,
            "N",
            "at least",
            m.steady_force_required,
            "7.2.2",
        ),
        _row(
            name,
            "steady force / force masked by friction, open loop",
            float(quotient(m.steady_force, m.least_force)),
            "",
            source="3.2.1",
        ),
        _row(
            name,
            "steady force / largest stiction cycle (5.8), force feedback, friction of the joints only",
            float(quotient(m.steady_force, m.cycle_force)),
            "",
            source="3.2.1",
        ),
        *joints,
    ]


def _bandwidth(m: Measures) -> list[Requisite]:
    """The lowest resonance of any joint, and its ratio to the asymptote (4.6); all quantities at the joint, ratio 1."""
    rotor, stiffness = np.array(m.rotor_inertia), np.array(m.transmission_stiffness)
    lower = force_resonances(rotor, m.link_inertia, stiffness, m.joint_contact_stiffness, 1.0).lower
    share = lower / hard_contact_bandwidth(rotor, stiffness)
    worst = int(np.argmin(lower))
    text, all_joints = f"open-loop force bandwidth, joint {worst + 1}", "the same, but no joint is held"
    return [
        _row("high bandwidth", f"{text} (4.4)", float(lower[worst]) / (2.0 * math.pi), "Hz", source="3.2.3"),
        _row("high bandwidth", all_joints, m.coupled_bandwidth, "Hz", source="3.2.3"),
        _row("high bandwidth", f"{text} / its asymptote (4.6)", float(share[worst]), "", source="4.4"),
    ]


def _slenderness(m: Measures) -> list[Requisite]:
    name = "high aspect ratio"
    rows = [
        _row(name, f"length / width, {link} link", ratio, "", "at least", required, "7.2.1")
        for link, ratio, required in zip(("inner", "outer"), m.aspect_ratio, m.aspect_required, strict=True)
    ]
    worst = min(m.aspect_ratio)
    grasp = float(useful_length(worst, secure_angle(m.cover_friction)))
    cylinder = float(largest_cylinder(worst, m.cover_friction))
    return [
        *rows,
        _row(name, "useful length / length of the least slender link (3.2)", grasp, "", source="3.2.4"),
        _row(name, "diameter of the largest held cylinder / length of a link (3.3)", cylinder, "", source="3.2.4"),
    ]


def _backdrivability(m: Measures) -> list[Requisite]:
    """Rotors below the link, N below N_m (4.1.2); friction is in the dynamic range."""
    name = "good backdrivability"
    reflected = [
        _row(name, f"rotors' inertia / link's inertia, joint {i}", rotor / link, "", "at most", 1.0, "3.2.6, 4.1.2")
        for i, (rotor, link) in enumerate(zip(m.rotor_inertia, m.link_inertia, strict=True), 1)
    ]
    mass = _row(name, "effective mass at the tip", m.effective_mass, "kg", source="3.2.6")
    hidden = _row(name, "force at the tip masked by friction", m.least_force, "N", source="3.2.6")
    return [*reflected, mass, hidden]
