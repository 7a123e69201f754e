"""Chapter 5's closed forms against numbers found another way: by hand, by matrices, by simulation."""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from wam_theory import limit_cycles as lc
from wam_theory.stick_slip import ForceLoop, FrictionNode, Kind, Verdict, assess, simulate


def slip_by_matrix(gamma: float, zeta: float, samples: int = 400) -> tuple[float, float] | None:
    """Error and acceleration when a slip from error 1 stops, by stepping the matrix of (5.14).

    None where it has not stopped when its error is below 1e-9.
    """
    system = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-2.0 * zeta * gamma, -1.0, -2.0 * zeta]])

    def over(time: float) -> np.ndarray:
        squarings = 10
        x = system * time / 2**squarings
        m = np.eye(3) + x @ (np.eye(3) + x @ (np.eye(3) + x @ (np.eye(3) + x @ (np.eye(3) + x / 5) / 4) / 3) / 2)
        for _ in range(squarings):
            m = m @ m
        return m

    state, h = np.array([1.0, 0.0, 0.0]), 2.0 * math.pi / samples
    step = over(h)
    while abs(state[0]) > 1e-9 or abs(state[1]) > 1e-9:
        after = step @ state
        if after[1] > 0.0:
            low, high = 0.0, h
            for _ in range(45):
                middle = (low + high) / 2.0
                if (over(middle) @ state)[1] > 0.0:
                    high = middle
                else:
                    low = middle
            error, _, acceleration = over(low) @ state
            return float(error), float(acceleration)
        state = after
    return None


# --------------------------------------------------------------------------------- no friction, (5.3)
def test_proportional_error_is_where_force_and_motor_agree() -> None:
    # F_c = K x_m and x_m = G_P (F_des - F_c): 0.3 (10 - 7.5) = 0.75, times 10 is 7.5
    assert lc.proportional_error(10.0, 0.3, 10.0) == pytest.approx(2.5)
    assert lc.proportional_error(10.0, 0.0, 10.0) == 10.0


def test_integral_time_constant_is_that_of_a_fast_node() -> None:
    node, gain = FrictionNode(1e-8, 1e-4, 3.0, 6.0, 0.0, 0.0), 0.25
    tau = float(lc.integral_time_constant(gain, lc.series_stiffness(3.0, 6.0)))
    assert tau == pytest.approx(2.0)
    force = simulate(node, ForceLoop(gain), 5.0, 10.0).at([tau]).contact_force[0]
    assert force == pytest.approx(5.0 * (1.0 - math.exp(-1.0)), rel=1e-3)


# ----------------------------------------------------------------------------------- stuck node, (5.3)
def test_breakaway_delay_is_the_stick_time_of_the_exact_response() -> None:
    node = FrictionNode(1.0, 1.0, 2.0, 3.0, 0.8, 1.1)
    events = simulate(node, ForceLoop(0.7), 4.0, 40.0).events
    checked = 0
    for before, after in pairwise(events):
        if before.sign == 0:
            spring = 2.0 * (before.x_m - before.x) - 3.0 * before.x
            delay = lc.breakaway_delay(0.7, 2.0, 1.1, 4.0 - 3.0 * before.x, spring)
            assert float(delay) == pytest.approx(after.time - before.time, rel=1e-9)
            checked += 1
    assert checked > 3
    assert lc.breakaway_delay(0.7, 2.0, 1.1, 4.0) == pytest.approx(1.1 / (0.7 * 2.0 * 4.0))  # as printed
    assert lc.breakaway_delay(0.7, 2.0, 1.1, 0.0) == math.inf


def test_numbers_of_5_4_and_5_11_compare_two_frequencies() -> None:
    # G_I K = 0.5 * 2 = 1 rad/s against sqrt(9/4) = 1.5 rad/s; b = 0.6 * 2 sqrt(9 * 4)
    assert lc.inertia_number(0.5, 4.0, 3.0, 6.0) == pytest.approx(1.0 / 1.5)
    assert lc.damping_ratio(4.0, 7.2, 3.0, 6.0) == pytest.approx(0.6)
    assert lc.stiction_cycle_number(0.5, 4.0, 7.2, 3.0, 6.0) == pytest.approx(1.0 / 1.5 / 0.8)
    assert lc.stiction_cycle_number(0.5, 4.0, 12.0, 3.0, 6.0) == math.inf


# ------------------------------------------------------------------------------- stiction cycle, (5.4)
def test_slip_overshoot_is_one_swing_of_the_damped_node() -> None:
    for zeta in (0.01, 0.25, 0.7, 0.95):
        rest = slip_of_still_motor(zeta)
        assert lc.slip_overshoot(zeta) == pytest.approx(rest, rel=1e-4)
    assert lc.slip_overshoot([0.0, 1.0, 3.0]).tolist() == [2.0, 1.0, 1.0]


def slip_of_still_motor(zeta: float) -> float:
    """Travel to the first standstill of x'' + 2 zeta x' + x = 1 from rest, by small midpoint steps."""
    x, v, h = 0.0, 1e-12, 2e-4
    while v > 0.0:
        vm = v + h / 2 * (1.0 - x - 2.0 * zeta * v)
        x, v = x + h * vm, v + h * (1.0 - (x + h / 2 * v) - 2.0 * zeta * vm)
    return x


@pytest.mark.parametrize("zeta", [0.05, 0.25, 0.6])
def test_stiction_cycle_of_a_slow_loop(zeta: float) -> None:
    ktr, kc, fs, fd, gain = 3.0, 1.5, 1.3, 1.0, 1e-3
    node = FrictionNode(1.0, 2.0 * zeta * math.sqrt(4.5), ktr, kc, fd, fs)
    assert lc.stiction_cycle_number(gain, 1.0, node.damping, ktr, kc) < 7e-4
    exact = assess(node, ForceLoop(gain), 0.4, tolerance=1e-6)
    assert exact.verdict is Verdict.LIMIT_CYCLE
    assert lc.stiction_cycle_force(ktr, kc, fs, fd, zeta) == pytest.approx(exact.peak_to_peak, rel=1e-3)
    assert lc.stiction_cycle_period(gain, ktr, kc, fs, fd, zeta) == pytest.approx(exact.period, rel=2e-3)
    omega = float(lc.slip_overshoot(zeta))
    printed = omega * 4.0 / (gain * ktr) * (ktr + kc) / kc * (2.0 * fs / (fs - fd) - 1.0)
    assert printed > 1.15 * exact.period  # errata: wrong unless Omega = 1


def test_coulomb_friction_has_no_stiction_cycle() -> None:
    assert lc.stiction_cycle_force(2.0, 2.0, 1.0, 1.0, 0.25) == 0.0
    assert lc.stiction_cycle_period(1.0, 2.0, 2.0, 1.0, 1.0, 0.25) == math.inf


# ------------------------------------------------------------------------------- Routh, (5.15), (5.23)
@pytest.mark.parametrize("proportional", [0.0, 0.4])
def test_routh_gain_puts_two_roots_of_5_14_on_the_axis(proportional: float) -> None:
    j, b, ktr, kc = 0.7, 0.9, 2.0, 5.0
    gain = float(lc.routh_gain(j, b, ktr, kc, proportional))
    for factor, stable in ((0.999, True), (1.001, False)):
        roots = np.roots([j, b, ktr + kc + proportional * ktr * kc, factor * gain * ktr * kc])
        assert bool(roots.real.max() < 0.0) is stable
        assert lc.gain_ratio(factor * gain, j, b, ktr, kc, proportional) == pytest.approx(factor)


def test_testbed_gains_of_section_5_6() -> None:
    j, ktr, kc = 4.0, 14443.0, 12960.0
    b = 0.05 * 2.0 * math.sqrt(j * (ktr + kc))
    assert math.sqrt((ktr + kc) / j) / (2.0 * math.pi) == pytest.approx(13.2, abs=0.05)
    assert lc.routh_gain(j, b, ktr, kc) == pytest.approx(1.21e-3, rel=0.003)
    assert lc.sampled_margin(j, b, ktr, kc, 0.02).gain == pytest.approx(1.73e-3, rel=0.003)
    assert lc.sampled_margin(j, b, ktr, kc, 1e-5).gain == pytest.approx(float(lc.routh_gain(j, b, ktr, kc)), rel=1e-4)


@pytest.mark.parametrize("delay", [0, 1, 2, 5])
@pytest.mark.parametrize("period", [0.02, 0.3, 2.0])
def test_sampled_margin_is_where_the_exact_response_begins_to_grow(delay: int, period: float) -> None:
    values = (1.3, 0.8, 2.0, 3.0)
    margin = lc.sampled_margin(*values, period, delay)
    node = FrictionNode(*values, 0.0, 0.0)
    sizes = []
    for factor in (0.97, 1.03):
        loop = ForceLoop(factor * margin.gain, sample_period=period, delay_samples=delay)
        times = np.arange(0.0, 300.0 * math.pi / margin.frequency, 0.1 / margin.frequency)
        error = np.abs(1.0 - simulate(node, loop, 1.0, times[-1] + 1.0).at(times).contact_force)
        third = len(times) // 3
        sizes.append(error[-third:].max() / error[third : 2 * third].max())
    assert sizes[0] < 1.0 < sizes[1]


def test_sampled_margin_has_a_pole_on_the_circle_at_its_frequency() -> None:
    margin = lc.sampled_margin(1.0, 1.0, 2.0, 2.0, 0.2, 1)
    # the held loop's states x, v, x_m and the command under way, over one period by small steps
    system = np.array([[0, 1, 0, 0], [-4, -1, 2, 0], [0, 0, 0, 1], [0, 0, 0, 0]], dtype=float)
    over = np.linalg.matrix_power(np.eye(4) + system * 1e-6 + system @ system * 5e-13, 200_000)
    over[3] = [-2.0 * margin.gain, 0.0, 0.0, 0.0]
    poles = np.linalg.eigvals(over)
    nearest = poles[np.argmin(np.abs(np.abs(np.angle(poles)) - margin.frequency * 0.2))]
    assert abs(nearest) == pytest.approx(1.0, abs=1e-5)
    assert np.abs(poles).max() == pytest.approx(1.0, abs=1e-5)


# --------------------------------------------------------------------------- regimes of the inertial node
@pytest.mark.parametrize("zeta", [0.03, 0.25, 0.7, 0.95, 1.4])
def test_psi_is_the_ratio_that_matrix_steps_find(zeta: float) -> None:
    for gamma in (0.5, 0.9, 1.0, 1.2, 2.0):
        stopped = slip_by_matrix(gamma, zeta)
        assert stopped is not None
        assert lc.psi(gamma, zeta) == pytest.approx(-stopped[0], abs=1e-7)


def test_psi_is_the_ratio_of_errors_at_successive_standstills() -> None:
    zeta, gamma = 0.25, 0.9
    node = FrictionNode(1.0, 1.0, 2.0, 2.0, 1.0, 1.0)
    sticks = [e for e in simulate(node, ForceLoop(gamma), 1.0, 1e4).events if e.kind is Kind.STICK]
    errors = [1.0 - e.contact_force for e in sticks[:6]]
    ratios = [-late / early for early, late in pairwise(errors)]
    assert ratios == pytest.approx([float(lc.psi(gamma, zeta))] * len(ratios), rel=1e-6)


@pytest.mark.parametrize("zeta", [0.05, 0.25, 0.6, 0.86, 0.88, 1.0, 1.5])
def test_slips_never_stop_below_gamma_a_and_do_above(zeta: float) -> None:
    bound = float(lc.gamma_a(zeta))
    assert lc.psi(0.999 * bound, zeta) == 0.0
    assert slip_by_matrix(0.97 * bound, zeta) is None
    node = FrictionNode(1.0, 4.0 * zeta, 2.0, 2.0, 1.0, 1.0)
    for factor, stops in ((0.999, False), (1.02, True)):
        kinds = [e.kind for e in simulate(node, ForceLoop(factor * bound * 4.0 * zeta), 1.0, 1e6, max_events=5).events]
        assert (Kind.STICK in kinds) is stops


def test_regimes_of_zeta_one_quarter() -> None:
    assert lc.gamma_a(0.25) == pytest.approx(1.0 / 3.0 - 8.0 / (27.0 * 16.0), rel=1e-12)
    assert lc.gamma_b(0.25) == pytest.approx(0.597, abs=0.0005)
    assert lc.gamma_3(0.25) == pytest.approx(2.186, abs=0.0005)
    assert lc.point_b(0.25) == pytest.approx(1.356, abs=0.0005)


@pytest.mark.parametrize(
    ("zeta", "ratio"), [(0.05, 0.0), (0.25, 0.0), (0.8, 0.0), (0.05, 1.0), (0.25, 1.0), (1.3, 1.0)]
)
def test_regime_bounds_lie_where_matrix_steps_find_the_ratio(zeta: float, ratio: float) -> None:
    bound = float(lc.gamma_3(zeta) if ratio else lc.gamma_b(zeta))
    above, below = slip_by_matrix(1.01 * bound, zeta), slip_by_matrix(0.99 * bound, zeta)
    assert above is not None
    assert -above[0] > ratio
    assert below is None or -below[0] < ratio


def test_lightly_damped_nodes_overshoot_only_beyond_the_routh_limit() -> None:
    assert lc.gamma_b(0.137) > 1.0 > lc.gamma_b(0.138)
    assert lc.gamma_b(1.2) == lc.gamma_a(1.2)


@pytest.mark.parametrize(("ktr", "kc"), [(2.0, 2.0), (4.0, 1.0), (1.0, 3.0)])
def test_point_b_parts_first_slips_that_stick_from_those_that_reverse(ktr: float, kc: float) -> None:
    zeta, j = 0.25, 0.8
    b = 2.0 * zeta * math.sqrt(j * (ktr + kc))
    gain = float(lc.gamma_3(zeta) * lc.routh_gain(j, b, ktr, kc))
    ratio = float(lc.point_b(zeta, ktr, kc))
    for factor, kind in ((1.001, Kind.STICK), (0.999, Kind.REVERSE)):
        node = FrictionNode(j, b, ktr, kc, factor * ratio, factor * ratio)
        assert simulate(node, ForceLoop(gain), 1.0, 1e3).events[2].kind is kind


# ------------------------------------------------------------------------------ actuator cycle, (5.5.3)
def actuator_range(gamma: float, step: float) -> float:
    """Peak to peak of x_m between the last breakaways of a response of zeta = 0.25, F_friction = 1.5."""
    node = FrictionNode(1.0, 1.0, 2.0, 2.0, 1.5, 1.5)
    events = simulate(node, ForceLoop(gamma), step, 1e300, max_events=40).events
    motor = [e.x_m for e in events if e.kind is Kind.SLIP][-4:]
    return max(motor) - min(motor)


@pytest.mark.parametrize("gamma", [0.65, 0.9, 1.4])
def test_actuator_cycles_by_twice_the_friction_over_the_stiffness(gamma: float) -> None:
    assert lc.actuator_cycle(1.5, 2.0, gamma, 0.25) == pytest.approx(1.5)
    assert actuator_range(gamma, 1.0) == pytest.approx(1.5, rel=2e-3)


def test_actuator_cycle_exists_only_from_gamma_b_to_gamma_3() -> None:
    found = lc.actuator_cycle(1.5, 2.0, [0.2, 0.5, 0.59, 0.60, 2.18, 2.19], 0.25)
    assert found.tolist() == [0.0, 0.0, 0.0, 1.5, 1.5, math.inf]
    assert actuator_range(0.5, 1.0) < 1e-6


def test_actuator_power_is_its_work_over_the_time_of_the_exact_half_cycle() -> None:
    gamma, friction = 0.9, 1.5
    node = FrictionNode(1.0, 1.0, 2.0, 2.0, friction, friction)
    events = simulate(node, ForceLoop(gamma), 1.0, 1e300, max_events=60).events
    breaks = [e for e in events if e.kind is Kind.SLIP][-2:]
    error = abs(1.0 - breaks[1].contact_force)
    time = breaks[1].time - breaks[0].time
    assert lc.actuator_cycle_power(gamma, error, friction) * time == pytest.approx(
        float(lc.actuator_cycle_work(friction, 2.0)), rel=1e-3
    )
    # the spring's energy at breakaway, which its unloading by the motor gives away
    stretch = friction / 2.0
    assert lc.actuator_cycle_work(friction, 2.0) == pytest.approx(0.5 * 2.0 * stretch**2)


# ------------------------------------------------------------------------------------ arrays, refusals
def test_arguments_broadcast() -> None:
    column, row = np.array([[0.1], [0.3]]), np.array([0.5, 1.0, 2.0])
    assert lc.psi(row, column).shape == (2, 3)
    assert lc.psi(row, column)[1, 2] == lc.psi(2.0, 0.3)
    assert lc.gamma_b([0.2, 0.4]).shape == (2,)
    assert lc.point_b(0.25, row, column).shape == (2, 3)
    assert lc.actuator_cycle(row, 2.0, 0.9, column).shape == (2, 3)
    assert lc.breakaway_delay(1.0, 2.0, row, column).shape == (2, 3)
    assert lc.stiction_cycle_period(row, 2.0, 2.0, 1.3, 1.0, column).shape == (2, 3)


@pytest.mark.parametrize(
    ("call", "names"),
    [
        (lambda: lc.series_stiffness(0.0, 1.0), "transmission_stiffness is 0"),
        (lambda: lc.proportional_error(1.0, -1.0, 1.0), "proportional_gain is -1"),
        (lambda: lc.integral_time_constant([1.0, -2.0], 1.0), r"gain is \[1.0, -2.0\]"),
        (lambda: lc.breakaway_delay(1.0, 1.0, 1.0, 1.0, 1.5), "spring_force is 1.5"),
        (lambda: lc.slip_overshoot(-0.1), "zeta is -0.1"),
        (lambda: lc.stiction_cycle_force(1.0, 1.0, 0.9, 1.0, 0.1), "static_friction is 0.9"),
        (lambda: lc.routh_gain(1.0, math.nan, 1.0, 1.0), "damping is nan"),
        (lambda: lc.psi(1.0, 0.0), "zeta is 0"),
        (lambda: lc.gamma_b(math.inf), "zeta is inf"),
        (lambda: lc.sampled_margin(1.0, 1.0, 1.0, 1.0, 0.0), "sample_period is 0"),
        (lambda: lc.sampled_margin(1.0, 1.0, 1.0, 1.0, 0.1, -1), "delay_samples is -1"),
        (lambda: lc.actuator_cycle_power(1.0, 1.0, -1.0), "friction is -1"),
    ],
)
def test_a_refusal_names_the_value(call: Callable[[], object], names: str) -> None:
    with pytest.raises(ValueError, match=names):
        call()
