"""Figures 5.3, 5.5, 5.9, 5.10 and 5.11: responses to a step of the desired force, theory and plant.

Theory is the closed form where there is one, else the exact event-driven motion; the plant is the testbed
with an ideal motor, k_c = 1464 N m/rad as in section 5.6.
"""

from functools import cache
from itertools import combinations
from typing import Any

import numpy as np

from wam_studies.figures.conditions import CASE
from wam_studies.figures.panels import Mark, Numbers, Panel, Panels, Series
from wam_studies.plant.ideal_testbed import RATIO, PlantResponse, force_step, ideal_testbed, link_inertia
from wam_theory.friction_model import IntegralLoop
from wam_theory.linear_loop import integral_time_constant, proportional_error, routh_gain, series_stiffness
from wam_theory.regimes import gamma_3
from wam_theory.stick_slip import Kind, Trajectory, simulate

TIME, FORCE, MOTOR = "time [s]", "contact force F_c [N m]", "motor x_m at the joint [rad]"
EVENLY = 2000  # times at which an exact motion is drawn


def _stiffness() -> tuple[float, float, float]:
    """J_l, k_tr and natural frequency of the node, at the joint."""
    arm = ideal_testbed()
    inertia, ktr = link_inertia(arm), RATIO**2 * arm.circuits[0].stiffness
    return inertia, ktr, float(np.sqrt((ktr + CASE.contact) / inertia))


def _points(values: Numbers, count: int) -> Numbers:
    """About `count` of the values, evenly spaced."""
    return values[:: max(1, len(values) // count)]


def _compared(
    desired: float,
    gain: float,
    damping: float,
    friction: float | tuple[float, float],
    seconds: float,
    contact: float = CASE.contact,
    **options: Any,
) -> tuple[PlantResponse, Trajectory]:
    """The plant's response and the exact one; arguments as of `force_step`, of friction that of Coulomb as a number."""
    both = friction if isinstance(friction, tuple) else (friction, friction)
    found = force_step(desired, contact, gain, damping, both, seconds, **options)
    return found, simulate(found.node, IntegralLoop(gain), desired, seconds)


def _series(found: PlantResponse, plant: Numbers, exact: Trajectory, line: str, count: int) -> Series:
    """Points of the plant with the exact motion, which has a corner at each event."""
    times = np.union1d(np.linspace(0.0, exact.until, EVENLY), [event.time for event in exact.events])
    return Series(times, getattr(exact.at(times), line), _points(found.time, count), _points(plant, count))


def simple_responses() -> Panels:
    """Figure 5.3: no friction; heavy damping and slow gains make the node nearly inertialess."""
    inertia, ktr, natural = _stiffness()
    stiffness, seconds = float(series_stiffness(ktr, CASE.contact)), 1.5
    critical = 2.0 * inertia * natural
    gains = 3.0 / stiffness, 5.0 / stiffness  # G_P K = 3; 1/tau = 5 1/s
    none = (0.0, 0.0)
    jump = force_step(CASE.desired, CASE.contact, gains[0], critical, none, seconds, proportional=True)
    slow = force_step(CASE.desired, CASE.contact, gains[1], 0.2 * critical, none, seconds)
    error = float(proportional_error(CASE.desired, gains[0], stiffness))
    tau = float(integral_time_constant(gains[1], stiffness))
    times = np.linspace(0.0, seconds, 400)
    level = np.array([0.0, CASE.desired - error, CASE.desired - error])
    after = jump.time > 0.1  # s, transient of the inertia
    corners = np.array([0.0, 0.0, seconds])
    proportional = Series(corners, level, _points(jump.time[after], 20), _points(jump.force[after], 20))
    line = CASE.desired * (1.0 - np.exp(-times / tau))
    integral = Series(times, line, _points(slow.time, 24), _points(slow.force, 24))
    desired, shown = Mark("F_des", y=CASE.desired), (np.nan, np.nan, 0.0, 1.12 * CASE.desired)
    constant = Mark("τ = 1/(G_I K)", tau)
    return (
        Panel("a) proportional control", TIME, FORCE, (("(5.1)", proportional),), "", (desired,), shown),
        Panel("b) integral control", TIME, FORCE, (("(5.2)", integral),), "", (desired, constant), shown),
    )


def staircase() -> Panels:
    """Figure 5.5: stiction, with a nearly inertialess node."""
    found, exact = _compared(CASE.stairs, 2e-3, 24.0, (6.0, 3.0), 12.0)
    motor = _series(found, found.motor, exact, "x_m", 70).scaled(1.0, found.node.transmission_stiffness)
    force = _series(found, found.force, exact, "contact_force", 70)
    return (
        Panel("a) contact force", TIME, FORCE, (("exact", force),), marks=(Mark("F_des", y=CASE.stairs),)),
        Panel("b) motor", TIME, "k_tr x_m [N m]", (("exact", motor),)),
    )


def _loop(gamma: float) -> tuple[float, float]:
    """G_I and damping for this gamma, and the zeta of these figures."""
    inertia, ktr, natural = _stiffness()
    damping = 2.0 * CASE.unity_zeta * inertia * natural
    return gamma * float(routh_gain(inertia, damping, ktr, CASE.contact)), damping


@cache
def _coulomb() -> tuple[PlantResponse, Trajectory]:
    """Figures 5.9 and 5.11, in domain II and friction-dominated: the node sticks after each half cycle."""
    return _compared(CASE.desired, *_loop(CASE.coulomb_gamma), CASE.friction, 2.0, step=5e-5)


def coulomb_response() -> Panels:
    """Figure 5.9: overshoot, stick, a cycle of the motor."""
    found, exact = _coulomb()
    force = ("exact", _series(found, found.force, exact, "contact_force", 90))
    motor = ("exact", _series(found, found.motor, exact, "x_m", 90))
    return (
        Panel(
            f"a) γ = {CASE.coulomb_gamma:g}, ζ = {CASE.unity_zeta:g}",
            TIME,
            FORCE,
            (force,),
            marks=(Mark("F_des", y=CASE.desired),),
        ),
        Panel("b) motor", TIME, MOTOR, (motor,)),
    )


def trajectory() -> Panels:
    """Figure 5.11, which the thesis draws in space, as seen along each of its axes."""
    found, exact = _coulomb()
    motion = exact.at(np.union1d(np.linspace(0.0, exact.until, 2 * EVENLY), [event.time for event in exact.events]))
    shown = np.unique(np.geomspace(100.0, len(found.time) - 1.0, 110).astype(int))  # sticking times grow
    seen = {
        "motor x_m at the joint [mrad]": (1e3 * motion.x_m, 1e3 * found.motor[shown]),
        FORCE: (motion.contact_force, found.force[shown]),
        "velocity of the link [rad/s]": (motion.v, found.velocity[shown]),
    }
    return tuple(
        Panel(title, x, y, (("exact", Series(seen[x][0], seen[y][0], seen[x][1], seen[y][1])),))
        for title, (x, y) in zip(
            ("a) along the velocity", "b) along the force", "c) along the motor"), combinations(seen, 2), strict=True
        )
    )


def lost_contact() -> Panels:
    """Figure 5.10: one period of the settled cycle of an unstable loop whose environment cannot pull.

    The same loop on a contact of a quarter of the stiffness comes to rest: its first second.
    """
    gamma = 1.15 * float(gamma_3(CASE.unity_zeta))
    hard, soft = (_last_motion(share * CASE.contact, *_loop(gamma)) for share in (1.0, 0.25))
    axes = "k_c x, above 0 the contact force [N m]", "velocity of the link [rad/s]"
    marks = Mark("contact begins", 0.0), Mark("F_des", CASE.desired, 0.0)
    lines = (("exact", hard), ("a quarter of k_c", soft))
    return (Panel(f"γ = {gamma:.3g}, ζ = {CASE.unity_zeta:g}", *axes, lines, marks=marks),)


def _last_motion(contact: float, gain: float, damping: float) -> Series:
    """Velocity over k_c x between the last two contacts, of a motion that keeps contact in its first second."""
    step = 1e-4
    found, exact = _compared(CASE.desired, gain, damping, 6.0, 6.0, contact, unilateral=True, step=step)
    contacts = [event.time for event in exact.events if event.kind is Kind.SWITCH and event.sign > 0]
    begin, end = contacts[-2:] if len(contacts) > 1 else (0.0, 1.0)
    motion = exact.at(np.linspace(begin, end, 3000))
    count = round((end - begin) / step)
    shown = slice(-count, None) if begin else slice(count)
    return Series(
        contact * motion.x,
        motion.v,
        _points(contact * found.position[shown], 60),
        _points(found.velocity[shown], 60),
    )
