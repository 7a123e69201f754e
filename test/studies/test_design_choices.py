"""Numbers of the design rules: against eigenvalues and exact responses."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from wam_description.configuration import Configuration, packaged
from wam_studies.scorecard import measures, stiffness_rule
from wam_theory.linear_loop import routh_gain
from wam_theory.stick_slip import FrictionNode, IntegralLoop, Kind, Verdict, assess, simulate

# the testbed of 5.6, SI, with zeta = 0.25, beyond the Routh limit so that a largest stable step exists
BASE = FrictionNode(0.45194, 2.0 * 0.25 * math.sqrt(0.45194 * 3097.0), 1632.7, 1464.3, 0.7, 0.9)
HALF_FRICTION = replace(BASE, dynamic_friction=0.35, static_friction=0.45)
TWICE_STIFFNESS = replace(BASE, transmission_stiffness=2.0 * BASE.transmission_stiffness)
GAMMA, STEP = 1.8, 20.0  # G_I in the units of (5.15) at BASE; F_error, N m


@pytest.mark.slow
def test_a_transmission_by_4_10_would_cost_the_arm_a_tenth_of_its_bandwidth() -> None:
    """By the eigenvalues of two masses: so little do 3 % of the asymptote say against the transmission."""
    configuration = Configuration.load(packaged("wam"))
    m = measures(configuration)
    joints = zip(*stiffness_rule(configuration).values(), m.rotor_inertia, m.link_inertia, strict=True)
    for transmission, contact, best, _, bandwidth, _, with_best, jm, jl in joints:
        for cable, expected in ((transmission, bandwidth), (best, with_best)):
            stiffness = np.array([[cable, -cable], [-cable, cable + contact]])
            lowest = np.linalg.eigvals(np.linalg.solve(np.diag([jm, jl]), stiffness)).real.min()
            assert expected == pytest.approx(math.sqrt(lowest) / (2.0 * math.pi), rel=1e-6)
        assert 0.85 < with_best / bandwidth < 0.95
        assert best / contact == pytest.approx(jm / jl)
        assert transmission > 10.0 * best


def gain() -> float:
    return GAMMA * float(routh_gain(BASE.inertia, BASE.damping, BASE.transmission_stiffness, BASE.contact_stiffness))


def coulomb(node: FrictionNode) -> FrictionNode:
    j, b, ktr, kc = node.inertia, node.damping, node.transmission_stiffness, node.contact_stiffness
    return FrictionNode(j, b, ktr, kc, node.dynamic_friction, node.dynamic_friction)


def first_slip(node: FrictionNode) -> float:
    motion = simulate(coulomb(node), IntegralLoop(gain()), STEP, 1e3, max_events=5)
    return next(event.time for event in motion.events if event.kind is Kind.SLIP)


def motor_travel(node: FrictionNode) -> float:
    """Peak to peak of x_m once the error is small, in domain I above gamma_b."""
    linear = (node.inertia, node.damping, node.transmission_stiffness, node.contact_stiffness)
    loop = IntegralLoop(0.9 * float(routh_gain(*linear)))
    motion = simulate(coulomb(node), loop, 1e-3, 1e9, max_events=24)
    slips = [event.x_m - event.x for event in motion.events if event.kind is Kind.SLIP]
    at = [event.contact_force for event in motion.events if event.kind is Kind.SLIP]
    springs = [node.transmission_stiffness * s - f for s, f in zip(slips, at, strict=True)]
    return (max(springs) - min(springs)) / node.transmission_stiffness


def stiction_cycle(node: FrictionNode) -> float:
    found = assess(node, IntegralLoop(1e-3 * gain()), 5.0, tolerance=1e-6)
    assert found.verdict is Verdict.LIMIT_CYCLE
    return found.peak_to_peak


def stable_step(node: FrictionNode) -> float:
    low, high = 1e-2, 1e3
    while high > 1.0001 * low:
        middle = math.sqrt(low * high)
        diverges = assess(coulomb(node), IntegralLoop(gain()), middle).verdict is Verdict.DIVERGED
        low, high = (low, middle) if diverges else (middle, high)
    return low


@pytest.mark.parametrize(
    ("measured", "half_friction", "twice_stiffness"),
    [(first_slip, 0.5, 0.5), (motor_travel, 0.5, 0.5), (stiction_cycle, 0.5, 0.69), (stable_step, 0.5, 0.39)],
)
def test_half_the_friction_and_twice_the_stiffness_by_exact_responses(
    measured: Callable[[FrictionNode], float], half_friction: float, twice_stiffness: float
) -> None:
    """Section 5.7, at the same G_I, k_c and b: delay, cycle of the motor, stiction cycle, largest stable step."""
    base = measured(BASE)
    assert measured(HALF_FRICTION) / base == pytest.approx(half_friction, rel=0.01)
    assert measured(TWICE_STIFFNESS) / base == pytest.approx(twice_stiffness, rel=0.01)


def test_third_stage_leaves_96_percent_from_a_radius_of_an_inch_and_a_half_on() -> None:
    """In the units of the thesis: 43 in-lb times 30.4 at each pulley of the differential, E A 51 500 lb."""
    two_stages = measures(Configuration.load(packaged("wam"))).efficiency
    assert 1.2 < 43.0 * 30.4 / 51_500.0 / (1.0 - 0.96 / two_stages) < 2.0


def test_twist_of_the_circuit_of_joint_4_costs_little_torque_on_joint_3() -> None:
    """By the length of a helix and the slope of the energy of both strands."""
    t0 = Configuration.load(packaged("wam")).shared.arm.cables.pretension[3]
    ea, length, radius = 42258.1, 22 * 0.0254, 0.375 * 0.0254

    def energy(phi: float) -> float:
        longer = math.sqrt(length**2 + (radius * phi) ** 2) - length
        return 2.0 * (t0 * longer + 0.5 * ea / length * longer**2)

    slope = (energy(math.pi + 1e-4) - energy(math.pi - 1e-4)) / 2e-4
    twist = radius * math.pi / length
    tension = t0 + ea * (math.hypot(1.0, twist) - 1.0)
    torque = 2.0 * tension * radius * twist / math.hypot(1.0, twist)
    assert torque == pytest.approx(slope, rel=1e-5)
    assert 0.2 < tension / t0 - 1.0 < 0.25
    assert torque < 0.25 * 0.01 * 2.0 * 15.2 * 43.0 * 0.1129848  # of 1 % of the peak torque of joint 3


def test_two_motors_in_parallel_have_half_the_rotor_inertia_of_one_of_larger_diameter() -> None:
    """By sums over shells of solid cylinders with the same stress on their surface."""

    def cylinder(radius: float, length: float) -> tuple[float, float]:
        edges = np.linspace(0.0, radius, 2001)
        shells = 2.0 * math.pi * 0.5 * (edges[1:] + edges[:-1]) * np.diff(edges) * length
        inertia = float(shells @ (0.5 * (edges[1:] + edges[:-1])) ** 2)
        return 2.0 * math.pi * radius * length * radius, inertia  # torque of a stress of 1

    one, longer, wider = cylinder(0.02, 0.05), cylinder(0.02, 0.1), cylinder(0.02 * math.sqrt(2.0), 0.05)
    assert (longer[0] / one[0], wider[0] / one[0]) == (pytest.approx(2.0), pytest.approx(2.0))
    assert (longer[1] / one[1], wider[1] / one[1]) == (pytest.approx(2.0), pytest.approx(4.0))
