"""Numbers of figures 5.3, 5.5, 5.9, 5.10 and 5.11: responses to a step of the desired force, theory and plant.

Theory is the closed form where there is one, else the exact event-driven motion; the plant is the testbed
with an ideal motor, k_c = 1464 N m/rad as in section 5.6.
"""

from typing import NamedTuple

import numpy as np

from wam_studies.figures.conditions import CASE
from wam_studies.figures.series import Numbers, Series
from wam_studies.plant.force_response import PlantResponse, force_step
from wam_studies.plant.ideal_testbed import RATIO, ideal_testbed, link_inertia
from wam_theory.friction_model import IntegralLoop
from wam_theory.linear_loop import integral_time_constant, proportional_error, routh_gain, series_stiffness
from wam_theory.regimes import gamma_3
from wam_theory.stick_slip import Kind, Trajectory, inertialess_staircase, simulate


class SimpleResponses(NamedTuple):
    """Figure 5.3: F_c, N m, over time, s, under proportional and under integral control, without friction."""

    proportional: Series
    integral: Series
    steady_error: float  # (5.1), N m
    time_constant: float  # (5.2), s


class StaircaseResponse(NamedTuple):
    """Figure 5.5: F_c and k_tr x_m, N m, over time, s, with stiction; `jumps` is F_c of a node without inertia."""

    force: Series
    motor: Series
    jumps: tuple[Numbers, Numbers]


class CoulombResponse(NamedTuple):
    """Figures 5.9 and 5.11: F_c, N m, and x_m, rad, over time, s; and the trajectory (x_m, F_c, velocity), (3, n)."""

    force: Series
    motor: Series
    exact: Numbers
    plant: Numbers
    gamma: float
    zeta: float


class LostContact(NamedTuple):
    """Figure 5.10: one period of the settled cycle, velocity, rad/s, over k_c x, N m: F_c above zero, free below."""

    cycle: Series
    gamma: float
    zeta: float


def _stiffness() -> tuple[float, float, float]:
    """J_l, k_tr and natural frequency of the node, at the joint."""
    arm = ideal_testbed()
    inertia, ktr = link_inertia(arm), RATIO**2 * arm.circuits[0].stiffness
    return inertia, ktr, float(np.sqrt((ktr + CASE.contact) / inertia))


def _points(values: Numbers, count: int) -> Numbers:
    """About `count` of the values, evenly spaced."""
    return values[:: max(1, len(values) // count)]


def _series(found: PlantResponse, plant: Numbers, exact: Trajectory, line: str, count: int) -> Series:
    """Points of the plant with the exact motion, which has a corner at each event."""
    times = np.union1d(np.linspace(0.0, exact.until, 2000), [event.time for event in exact.events])
    return Series(times, getattr(exact.at(times), line), _points(found.time, count), _points(plant, count))


def simple_responses() -> SimpleResponses:
    """Step responses without friction; heavy damping and slow gains make the node nearly inertialess."""
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
    return SimpleResponses(
        Series(np.array([0.0, 0.0, seconds]), level, _points(jump.time[after], 20), _points(jump.force[after], 20)),
        Series(times, CASE.desired * (1.0 - np.exp(-times / tau)), _points(slow.time, 24), _points(slow.force, 24)),
        error,
        tau,
    )


def staircase() -> StaircaseResponse:
    """Step response with stiction, with a nearly inertialess node."""
    gain, seconds, friction = 2e-3, 12.0, (6.0, 3.0)
    found = force_step(CASE.stairs, CASE.contact, gain, 24.0, friction, seconds)
    exact = simulate(found.node, IntegralLoop(gain), CASE.stairs, seconds)
    steps = inertialess_staircase(found.node, gain, CASE.stairs, 60)
    shown = steps.times <= seconds
    times, forces = steps.times[shown], steps.contact_forces[shown]
    corners = np.concatenate([[0.0], np.repeat(times, 2), [seconds]])
    levels = np.repeat(np.concatenate([[0.0], forces]), 2)
    ktr = found.node.transmission_stiffness
    motor = _series(found, found.motor, exact, "x_m", 70)
    return StaircaseResponse(
        _series(found, found.force, exact, "contact_force", 70),
        Series(motor.x, ktr * motor.y, motor.plant_x, ktr * motor.plant_y),
        (corners, levels),
    )


def coulomb_response() -> CoulombResponse:
    """Step response of the inertial node in domain II, friction-dominated: overshoot, stick, a cycle of the motor."""
    gamma, zeta, seconds = 1.5, 0.25, 2.0
    inertia, ktr, natural = _stiffness()
    damping = 2.0 * zeta * inertia * natural
    gain = gamma * float(routh_gain(inertia, damping, ktr, CASE.contact))
    found = force_step(
        CASE.desired,
        CASE.contact,
        gain,
        damping,
        (CASE.friction, CASE.friction),
        seconds,
        step=5e-5,
    )
    exact = simulate(found.node, IntegralLoop(gain), CASE.desired, seconds)
    motion = exact.at(np.union1d(np.linspace(0.0, seconds, 4000), [event.time for event in exact.events]))
    shown = np.unique(np.geomspace(100.0, len(found.time) - 1.0, 110).astype(int))  # sticking times grow
    return CoulombResponse(
        _series(found, found.force, exact, "contact_force", 90),
        _series(found, found.motor, exact, "x_m", 90),
        np.array([motion.x_m, motion.contact_force, motion.v]),
        np.array([a[shown] for a in (found.motor, found.force, found.velocity)]),
        gamma,
        zeta,
    )


def lost_contact() -> LostContact:
    """The limit cycle of an unstable loop whose environment cannot pull."""
    zeta = 0.25
    gamma = 1.15 * float(gamma_3(zeta))
    inertia, ktr, natural = _stiffness()
    damping = 2.0 * zeta * inertia * natural
    gain = gamma * float(routh_gain(inertia, damping, ktr, CASE.contact))
    seconds, step = 6.0, 1e-4
    found = force_step(CASE.desired, CASE.contact, gain, damping, (6.0, 6.0), seconds, unilateral=True, step=step)
    exact = simulate(found.node, IntegralLoop(gain), CASE.desired, seconds)
    contacts = [event.time for event in exact.events if event.kind is Kind.SWITCH and event.sign > 0]
    motion = exact.at(np.linspace(contacts[-2], contacts[-1], 3000))
    late = slice(-round((contacts[-1] - contacts[-2]) / step), None)
    cycle = Series(
        CASE.contact * motion.x,
        motion.v,
        _points(CASE.contact * found.position[late], 60),
        _points(found.velocity[late], 60),
    )
    return LostContact(cycle, gamma, zeta)
