"""Claims that the thesis makes in words: against exact responses, integration along a pulley, and balances by hand."""

import math

import numpy as np
import pytest

from wam_theory import describing_function, regimes, stiction, tension_element
from wam_theory.linear_loop import routh_gain
from wam_theory.stability_map import largest_stable_steps
from wam_theory.stick_slip import FrictionNode, IntegralLoop, Kind, Verdict, assess, simulate


def node_with(zeta: float, static: float = 1.0) -> FrictionNode:
    """J_l = 1, k_tr = k_c = 2, F_dynamic = 1."""
    return FrictionNode(1.0, 4.0 * zeta, 2.0, 2.0, 1.0, static)


@pytest.mark.parametrize("zeta", [0.02, 0.25, 0.6])
def test_each_slip_takes_kappa_of_the_asymmetry(zeta: float) -> None:
    node, gain = node_with(zeta, 1.3), 2.0 * 0.002
    x = (10.0 - 0.75 * 0.15 * float(stiction.slip_overshoot(zeta))) / 2.0
    motion = simulate(node, IntegralLoop(gain), 10.0, 1e9, (x, 0.0, 2.0 * x), max_events=100)
    errors = np.array([10.0 - event.contact_force for event in motion.events if event.kind is Kind.STICK])
    asymmetry = np.abs(errors[1:] + errors[:-1])
    measured = 1.0 - (asymmetry[40] / asymmetry[0]) ** (1.0 / 40.0)
    overshoot = float(stiction.slip_overshoot(zeta))
    assert measured == pytest.approx(0.002 * (math.pi / math.sqrt(1.0 - zeta**2) - 2.0 * zeta * overshoot), rel=0.02)


def test_period_of_an_asymmetric_cycle_is_that_of_its_two_delays() -> None:
    jump, static, gain = 0.2, 1.3, 1e-3
    spring = static - 2.0 * jump  # left by a slip of D at k_tr = k_c: the force falls by D ks/k_c
    delays = [stiction.breakaway_delay(gain, 2.0, static, e, -spring) for e in (0.05, 0.15)]
    symmetric = [stiction.breakaway_delay(gain, 2.0, static, e, -spring) for e in (0.1, 0.1)]
    ratio = float(np.sum(delays) / np.sum(symmetric))
    assert ratio == pytest.approx(jump**2 / (4.0 * 0.05 * (jump - 0.05)))


@pytest.mark.parametrize("gamma", [0.4, 0.8, 0.95])
def test_in_domain_one_small_and_large_steps_end_in_the_same_stiction_cycle(gamma: float) -> None:
    node, gain = node_with(0.25, 1.3), gamma * float(routh_gain(1.0, 1.0, 2.0, 2.0))
    found = [assess(node, IntegralLoop(gain), step) for step in (0.001, 1.0, 30.0)]
    assert all(outcome.verdict is Verdict.LIMIT_CYCLE for outcome in found)
    assert [outcome.peak_to_peak for outcome in found] == pytest.approx([found[0].peak_to_peak] * 3, rel=1e-5)


def test_gain_for_a_frequency_makes_a_cycle_of_it() -> None:
    node = node_with(0.3, 1.3)
    gain = 1e-4 * float(stiction.stiction_cycle_period(1.0, 2.0, 2.0, 1.3, 1.0, 0.3))
    found = assess(node, IntegralLoop(gain), 5.0, tolerance=1e-7)
    assert found.verdict is Verdict.LIMIT_CYCLE
    assert 1.0 / found.period == pytest.approx(1e-4, rel=0.02)


def test_every_deadband_ends_the_actuator_cycle_after_the_half_cycles_of_psi() -> None:
    zeta, gamma, step = 0.25, 0.9, 1.0
    gain, ratio = gamma * float(routh_gain(1.0, 1.0, 2.0, 2.0)), float(regimes.psi(gamma, zeta))
    free = simulate(node_with(zeta), IntegralLoop(gain), step, 1e6, max_events=60)
    errors = [abs(step - event.contact_force) for event in free.events if event.kind is Kind.STICK]
    for deadband in (0.2, 0.01):
        needed = math.ceil(math.log(deadband / step) / math.log(ratio))
        assert errors[needed - 1] <= deadband < ([step, *errors])[needed - 1]
        ended = simulate(node_with(zeta), IntegralLoop(gain, deadband=deadband), step, 1e9)
        assert ended.ended
        late = ended.at(np.linspace(ended.until / 2.0, ended.until, 50)).x_m
        assert np.ptp(late) < 1e-9


def test_a_stable_step_up_from_zero_never_loses_contact() -> None:
    """5.5.2, on random nodes: also where the step is not friction-dominated."""
    rng, judged = np.random.default_rng(5), 0
    for _ in range(60):
        zeta, ratio = rng.uniform(0.05, 1.5), 10.0 ** rng.uniform(-1.0, 1.0)
        gamma = rng.uniform(0.1, 0.98 * float(regimes.gamma_3(zeta)))
        contact = 4.0 / (1.0 + ratio)
        gain = gamma * float(routh_gain(1.0, 4.0 * zeta, 4.0 - contact, contact))
        largest = float(largest_stable_steps(gamma, zeta, ratio))
        step = min(largest, 100.0) * rng.uniform(0.05, 0.999)
        node = FrictionNode(1.0, 4.0 * zeta, 4.0 - contact, contact, 1.0, 1.0)
        motion = simulate(node, IntegralLoop(gain), step, 1e6, max_events=120)
        low = [e.contact_force for e in motion.events if e.kind in (Kind.STICK, Kind.REVERSE)]
        judged += bool(low)
        assert all(force > 0.0 for force in low), (gamma, zeta, ratio, step)
    assert judged > 40


@pytest.mark.parametrize(("gamma", "zeta"), [(0.9, 0.25), (1.5, 0.25), (1.2, 0.6)])
def test_a_step_down_loses_contact_beyond_1_plus_1_over_psi(gamma: float, zeta: float) -> None:
    node, gain = node_with(zeta), gamma * float(routh_gain(1.0, 4.0 * zeta, 2.0, 2.0))
    limit = 1.0 + 1.0 / float(regimes.psi(gamma, zeta))
    for factor, kept in ((0.99, True), (1.01, False)):
        x = 0.001 * factor * limit / 2.0
        motion = simulate(node, IntegralLoop(gain), 0.001, 1e9, (x, 0.0, 2.0 * x), max_events=20)
        assert (min(event.contact_force for event in motion.events) > 0.0) is kept


def test_bound_of_domain_two_moves_left_with_inertia_and_stiffness_and_right_with_damping() -> None:
    """5.5.1 says right with b or J_l K."""

    def last_gain(inertia: float, damping: float, stiffness: float) -> float:
        zeta = damping / (2.0 * math.sqrt(2.0 * stiffness * inertia))
        return float(regimes.gamma_3(zeta)) * float(routh_gain(inertia, damping, stiffness, stiffness))

    assert last_gain(1.0, 2.0, 2.0) > last_gain(1.0, 1.0, 2.0)
    assert last_gain(2.0, 1.0, 2.0) < last_gain(1.0, 1.0, 2.0)
    assert last_gain(1.0, 1.0, 4.0) < last_gain(1.0, 1.0, 2.0)


def test_arc_of_slip_grows_with_the_torque_as_integration_along_the_pulley_says() -> None:
    pretension, radius, mu = 200.0, 0.01, 0.25
    for torque in (0.5, 2.0, 3.6):
        tension, arc = pretension - torque / (2.0 * radius), 0.0
        while tension < pretension + torque / (2.0 * radius):
            tension += mu * tension * 1e-5
            arc += 1e-5
        half = torque / (2.0 * radius)
        found = float(tension_element.slip_arc(pretension - half, pretension + half, mu))
        assert found == pytest.approx(arc, rel=1e-4)
    full = pretension * math.tanh(0.5 * mu * math.pi)  # half of the difference at which the whole arc slips
    assert tension_element.slip_arc(pretension - full, pretension + full, mu) == pytest.approx(math.pi)


def test_sprocket_that_keeps_its_speed_loses_no_power() -> None:
    loose, tight, ea = 100.0, 700.0, 40_000.0
    unstretched = 1.0  # m/s of unstretched element
    slow, fast = unstretched * (1.0 + loose / ea), unstretched * (1.0 + tight / ea)
    assert tension_element.speed_ratio(loose, tight, ea) == pytest.approx(fast / slow)
    # power of the element at a pulley of one speed: tension times speed less the strain energy that leaves with it
    carried = tight * fast - loose * slow - unstretched * (tight**2 - loose**2) / (2.0 * ea)
    climbing = np.linspace(loose, tight, 100_001)  # the element changes its tension on the teeth, at its own radius
    shaft = np.trapezoid(unstretched * (1.0 + climbing / ea), climbing)
    assert shaft == pytest.approx(carried, rel=1e-9)  # all of it reaches the shaft
    fixed = (tight - loose) * slow  # a smooth pulley runs at the speed of the entering strand, (6.8)
    assert fixed < carried


def test_motion_of_the_puma_has_a_peak_of_1_14_radians_per_second_squared() -> None:
    """5.1.2: 2 rad peak to peak at 0.17 Hz; the print has 2.0."""
    time = np.linspace(0.0, 1.0 / 0.17, 20_001)
    acceleration = np.gradient(np.gradient(np.sin(2.0 * math.pi * 0.17 * time), time), time)
    assert np.abs(acceleration[5:-5]).max() == pytest.approx(1.14, abs=0.005)


def test_a_large_step_below_gamma_a_may_slide_to_rest_in_spite_of_stiction() -> None:
    """5.5 and 5.7: never settles; with gamma below gamma_a the last slip creeps to F_des."""
    gain = 0.5 * float(regimes.gamma_a(0.25)) * float(routh_gain(1.0, 1.0, 2.0, 2.0))
    found = [assess(node_with(0.25, 1.3), IntegralLoop(gain), step).verdict for step in (1.0, 100.0)]
    assert found == [Verdict.LIMIT_CYCLE, Verdict.SETTLED]


@pytest.mark.parametrize(("gamma", "share"), [(1.02, 0.0012), (1.5, 0.031), (2.186, 0.073)])
def test_third_harmonic_grows_to_a_fourteenth_at_gamma_3_with_zeta_one_quarter(gamma: float, share: float) -> None:
    """5.5.1: the filter is poor.  With a square wave of friction the third harmonic is |G(3 j w)|/(3 |G(j w)|)."""
    gain, omega = gamma * float(routh_gain(1.0, 1.0, 2.0, 2.0)), 2.0
    first, third = (
        abs(complex(describing_function.friction_to_velocity(1j * n * omega, gain, 1.0, 1.0, 2.0, 2.0))) for n in (1, 3)
    )
    assert third / (3.0 * first) == pytest.approx(share, rel=0.03)
