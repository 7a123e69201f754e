"""The linear loop of chapter 5 against state matrices, polynomial roots and the exact response."""

import math

import numpy as np
import pytest

from wam_theory import linear_loop
from wam_theory.stick_slip import FrictionNode, IntegralLoop, Verdict, assess, simulate
from wam_theory.zero_order_hold import zero_order_hold


def state_matrices(
    gain: float, j: float, b: float, ktr: float, kc: float, proportional: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x, v and the integral of the error, for x_m = G_I integral + G_P error; F_c is the output."""
    a = np.array(
        [[0.0, 1.0, 0.0], [-(ktr + kc + ktr * proportional * kc) / j, -b / j, ktr * gain / j], [-kc, 0.0, 0.0]]
    )
    return a, np.array([0.0, ktr * proportional / j, 1.0]), np.array([kc, 0.0, 0.0])


def test_proportional_error_is_where_force_and_motor_agree() -> None:
    # F_c = K x_m and x_m = G_P (F_des - F_c): 0.3 (10 - 7.5) = 0.75, times 10 is 7.5
    assert linear_loop.proportional_error(10.0, 0.3, 10.0) == pytest.approx(2.5)
    assert linear_loop.proportional_error(10.0, 0.0, 10.0) == 10.0


def test_integral_time_constant_is_that_of_a_fast_node() -> None:
    node, gain = FrictionNode(1e-8, 1e-4, 3.0, 6.0, 0.0, 0.0), 0.25
    tau = float(linear_loop.integral_time_constant(gain, linear_loop.series_stiffness(3.0, 6.0)))
    assert tau == pytest.approx(2.0)
    force = simulate(node, IntegralLoop(gain), 5.0, 10.0).at([tau]).contact_force[0]
    assert force == pytest.approx(5.0 * (1.0 - math.exp(-1.0)), rel=1e-3)


@pytest.mark.parametrize("proportional", [0.0, 0.4])
def test_closed_loop_is_that_of_the_state_matrices_and_the_printed_one_is_not(proportional: float) -> None:
    values = (0.3, 0.7, 0.9, 2.0, 5.0, proportional)
    a, inlet, outlet = state_matrices(*values)
    for s in (0.02j, 1.3j, 0.4 + 2.0j, -0.1 + 5.0j):
        expected = outlet @ np.linalg.solve(s * np.eye(3) - a, inlet)
        assert linear_loop.closed_loop(s, *values) == pytest.approx(expected, rel=1e-12)
        printed = (0.3 + proportional / s) * 10.0 / np.polyval(linear_loop.characteristic_polynomial(*values), s)
        assert bool(abs(printed / expected - 1.0) > 0.05) is (proportional > 0.0)
    np.testing.assert_allclose(linear_loop.characteristic_polynomial(*values) / 0.7, np.poly(a), rtol=1e-12)
    assert linear_loop.closed_loop(0.0, *values) == 1.0  # no steady error


@pytest.mark.parametrize("proportional", [0.0, 0.4])
def test_routh_gain_puts_two_roots_of_5_14_on_the_axis(proportional: float) -> None:
    j, b, ktr, kc = 0.7, 0.9, 2.0, 5.0
    gain = float(linear_loop.routh_gain(j, b, ktr, kc, proportional))
    for factor, stable in ((0.999, True), (1.001, False)):
        roots = np.roots([j, b, ktr + kc + proportional * ktr * kc, factor * gain * ktr * kc])
        assert bool(roots.real.max() < 0.0) is stable
        assert linear_loop.gain_ratio(factor * gain, j, b, ktr, kc, proportional) == pytest.approx(factor)


@pytest.mark.parametrize("delay", [0, 5, 24, 40, 80])
def test_sampled_margin_is_where_an_eigenvalue_leaves_the_circle_also_after_a_long_delay(delay: int) -> None:
    period = 0.002
    margin = linear_loop.sampled_margin(*TESTBED, period, delay)
    inertia, damping, ktr, kc = TESTBED
    rate = np.array([[0.0, 1.0, 0.0], [-(ktr + kc) / inertia, -damping / inertia, ktr / inertia], [0.0, 0.0, 0.0]])
    held, inlet = zero_order_hold(rate, np.array([[0.0], [0.0], [1.0]]), period)
    largest = []
    for factor in (0.99, 1.01):
        feedback = np.array([[-factor * margin.gain * kc, 0.0, 0.0]])
        if delay:  # x, v, x_m, then the commands under way
            system = np.zeros((3 + delay, 3 + delay))
            system[:3, :3], system[:3, 3:4] = held, inlet
            system[3:-1, 4:] = np.eye(delay - 1)
            system[-1:, :3] = feedback
        else:
            system = held + inlet @ feedback
        largest.append(np.abs(np.linalg.eigvals(system)).max())
    assert largest[0] < 1.0 < largest[1]


TESTBED = (4.0, 33.10755, 14443.0, 12960.0)  # J, b, k_tr, k_c in pounds and inches; zeta 0.05


def verdict(gain: float, step: float, delay: int) -> Verdict:
    """Of the testbed with 8.4 lb-in of friction at 50 Hz."""
    loop = IntegralLoop(gain, sample_period=0.02, delay_samples=delay)
    return assess(FrictionNode(*TESTBED, 8.4, 8.4), loop, step).verdict


def test_at_one_and_a_half_times_the_margin_8_18_lb_settle_and_8_19_diverge() -> None:
    gain = 1.5 * linear_loop.sampled_margin(*TESTBED, 0.02).gain
    assert verdict(gain, 8.18 * 36.0, 0) is Verdict.SETTLED
    assert verdict(gain, 8.19 * 36.0, 0) is Verdict.DIVERGED
