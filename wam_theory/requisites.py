"""What chapter 3 asks of a manipulator for good force control, as formulas and as a scorecard."""

import math
from dataclasses import dataclass, fields
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wam_theory.arguments import Array, above_zero, zero_or_more
from wam_theory.resonance import force_resonances, hard_contact_bandwidth


def impact_force(speed: ArrayLike, inertia: ArrayLike, contact_stiffness: ArrayLike) -> Array:
    """Greatest force of an impact, N, (3.1): v sqrt(J k_c), kinetic energy become that of the contact (3.2.2).

    J is the EFFECTIVE mass at the contact, rotors with it as far as their transmission is stiff; the
    print takes the link's inertia, which fits only where everything is rotary: then v is rad/s, J kg m^2,
    k_c N m/rad and the result N m.  No loss, no friction, nothing else moves.

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

    tan(theta/2) = mu, without which (3.2) and (3.3) do not fit together (3.2.4); not in print.

    Parameters
    ----------
    friction_coefficient : mu, above zero.
    """
    (mu,) = above_zero(friction_coefficient=friction_coefficient)
    return 2.0 * np.arctan(mu)


def useful_length(aspect_ratio: ArrayLike, angle: ArrayLike) -> Array:
    """Share of a link that can grasp, L'/L, (3.2): 1 - (W/L)/(2 tan(theta/2)), 0 where nothing is left (3.2.4).

    Two equal links of width W whose axes meet at the joint: their faces meet only beyond W/2/tan(theta/2).

    Parameters
    ----------
    aspect_ratio : L/W, above zero.
    angle : theta between the links, rad, above zero, at most pi; `secure_angle` for a grasp that holds.
    """
    ratio, theta = above_zero(aspect_ratio=aspect_ratio, angle=angle)
    if not np.all(theta <= math.pi):
        raise ValueError(f"angle is {angle!r} rad; it must not be above pi")
    return np.maximum(1.0 - 0.5 / (ratio * np.tan(theta / 2.0)), 0.0)


def largest_cylinder(aspect_ratio: ArrayLike, friction_coefficient: ArrayLike) -> Array:
    """Largest cylinder that two links hold, D/L, (3.3): 2 mu - W/L, 0 where they hold none (3.2.4).

    At the angle tan(theta/2) = mu, touched at the ends of the links.

    Parameters
    ----------
    aspect_ratio : L/W, above zero.
    friction_coefficient : mu, above zero.
    """
    ratio, mu = above_zero(aspect_ratio=aspect_ratio, friction_coefficient=friction_coefficient)
    return np.maximum(2.0 * mu - 1.0 / ratio, 0.0)


@dataclass(frozen=True)
class Measures:
    """What a scorecard is made from; one number, or one for each joint or link.

    Parameters
    ----------
    steady_force : force that can be held at any point of the links in any pose, N.
    steady_force_asked : what the thesis gives, N.
    least_force : force at the tip that dry friction hides, N.
    friction_share : dry friction of each joint over its peak torque.
    friction_asked : what the thesis gives for each.
    impact_speed : speed at the tip up to which the arm may run, m/s.
    effective_mass : at the tip, normal to the link, rotors with it, kg.
    contact_stiffness : of the hardest contact, N/m.
    cable_tension : of the tightest cable at peak torque over its breaking strength.
    pretension : least one over half of the tension difference at peak torque, below which a strand goes slack.
    link_inertia : of each joint, kg m^2.
    rotor_inertia : of the motors, reflected to each joint, kg m^2.
    transmission_stiffness : at each joint, N m/rad.
    joint_contact_stiffness : of the contact, at each joint, N m/rad.
    aspect_ratio : length over width of each link.
    aspect_asked : what the thesis gives for each.
    cover_friction : coefficient of friction of the covers.
    efficiency : least limiting efficiency of a transmission at peak torque.
    efficiency_asked : what the thesis gives.

    Raises
    ------
    ValueError
        where a value is not finite and above zero.
    """

    steady_force: float
    steady_force_asked: float
    least_force: float
    friction_share: tuple[float, ...]
    friction_asked: tuple[float, ...]
    impact_speed: float
    effective_mass: float
    contact_stiffness: float
    cable_tension: float
    pretension: float
    link_inertia: tuple[float, ...]
    rotor_inertia: tuple[float, ...]
    transmission_stiffness: tuple[float, ...]
    joint_contact_stiffness: tuple[float, ...]
    aspect_ratio: tuple[float, ...]
    aspect_asked: tuple[float, ...]
    cover_friction: float
    efficiency: float
    efficiency_asked: float

    def __post_init__(self) -> None:
        for field in fields(self):
            value = np.asarray(getattr(self, field.name))
            if not np.all(np.isfinite(value) & (value > 0.0)):
                raise ValueError(f"{field.name} is {getattr(self, field.name)!r}; it must be finite and above zero")


class Requisite(NamedTuple):
    """One row of the scorecard; `asked` is NaN and `met` None where the thesis gives no number.

    The thesis prints two digits: a value within 1 % of what is asked meets it.
    """

    requisite: str
    measure: str
    value: float
    unit: str
    sense: Literal["at least", "at most", ""]
    asked: float
    source: str
    met: bool | None


def scorecard(measures: Measures) -> tuple[Requisite, ...]:
    """The six requisites of chapter 3 beside what the thesis asks or gives for the MIT/WAM.

    Dynamic stability, one half of robustness, is not here: it belongs to the gains of the force loop
    and to the contact, not to the arm ((5.15), (5.17)).

    Parameters
    ----------
    measures : of the arm.

    Returns
    -------
    Rows in the order of section 3.2; of several joints or links each has its own row where the thesis
    gives a number for each, else the worst.
    """
    m = measures
    rows = [
        *_dynamic_range(m),
        _row("robustness", "impact force at the tip (3.1)", _impact(m), "N", source="3.2.2"),
        _row(
            "robustness", "tightest cable at peak torque, of its strength", m.cable_tension, "", "at most", 1.0, "3.2.1"
        ),
        _row("robustness", "pretension, of half the full-torque tension", m.pretension, "", "at least", 1.0, "6.5"),
        *_bandwidth(m),
        *_slenderness(m),
        _row(
            "high efficiency",
            "limiting efficiency at peak torque",
            m.efficiency,
            "",
            "at least",
            m.efficiency_asked,
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
    asked: float = math.nan,
    source: str = "",
) -> Requisite:
    met = {"at least": value >= 0.99 * asked, "at most": value <= 1.01 * asked}.get(sense)
    return Requisite(requisite, measure, value, unit, sense, asked, source, met)


def _impact(m: Measures) -> float:
    return float(impact_force(m.impact_speed, m.effective_mass, m.contact_stiffness))


def _dynamic_range(m: Measures) -> list[Requisite]:
    name = "dynamic range"
    joints = [
        _row(name, f"peak torque over friction, joint {i}", 1.0 / share, "", "at least", 1.0 / asked, "7.2.2")
        for i, (share, asked) in enumerate(zip(m.friction_share, m.friction_asked, strict=True), 1)
    ]
    return [
        _row(
            name,
            "steady force at any point in any pose",
            m.steady_force,
            "N",
            "at least",
            m.steady_force_asked,
            "7.2.2",
        ),
        _row(name, "steady force over hidden force, open loop", m.steady_force / m.least_force, "", source="3.2.1"),
        *joints,
    ]


def _bandwidth(m: Measures) -> list[Requisite]:
    """The lowest resonance of any joint, and that over its asymptote (4.6); ratio 1, all seen at the joint."""
    rotor, stiffness = np.array(m.rotor_inertia), np.array(m.transmission_stiffness)
    lower = force_resonances(rotor, m.link_inertia, stiffness, m.joint_contact_stiffness, 1.0).lower
    share = lower / hard_contact_bandwidth(rotor, stiffness)
    worst = int(np.argmin(lower))
    text = f"open-loop force bandwidth, joint {worst + 1}"
    return [
        _row("high bandwidth", f"{text} (4.4)", float(lower[worst]) / (2.0 * math.pi), "Hz", source="3.2.3"),
        _row("high bandwidth", f"{text}, of its asymptote (4.6)", float(share[worst]), "", source="4.4"),
    ]


def _slenderness(m: Measures) -> list[Requisite]:
    name = "high aspect ratio"
    rows = [
        _row(name, f"length over width, link {i}", ratio, "", "at least", asked, "7.2.1")
        for i, (ratio, asked) in enumerate(zip(m.aspect_ratio, m.aspect_asked, strict=True), 1)
    ]
    worst = min(m.aspect_ratio)
    grasp = float(useful_length(worst, secure_angle(m.cover_friction)))
    cylinder = float(largest_cylinder(worst, m.cover_friction))
    return [
        *rows,
        _row(name, "useful share of the least slender link (3.2)", grasp, "", source="3.2.4"),
        _row(name, "largest cylinder it holds, of its length (3.3)", cylinder, "", source="3.2.4"),
    ]


def _backdrivability(m: Measures) -> list[Requisite]:
    """Rotors below the link, N below N_m (4.1.2); friction stands under dynamic range."""
    name = "good backdrivability"
    reflected = [
        _row(name, f"rotors' inertia over the link's, joint {i}", rotor / link, "", "at most", 1.0, "3.2.6, 4.1.2")
        for i, (rotor, link) in enumerate(zip(m.rotor_inertia, m.link_inertia, strict=True), 1)
    ]
    mass = _row(name, "effective mass at the tip", m.effective_mass, "kg", source="3.2.6")
    hidden = _row(name, "force at the tip that moves no joint", m.least_force, "N", source="3.2.6")
    return [*reflected, mass, hidden]
