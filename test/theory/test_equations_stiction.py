"""The nearly inertialess node of section 5.4 against small steps and the exact response."""

import math
from itertools import pairwise

import numpy as np
import pytest

from wam_theory import linear_loop, stiction
from wam_theory.stick_slip import FrictionNode, IntegralLoop, Kind, Verdict, assess, simulate


def test_breakaway_delay_is_the_stick_time_of_the_exact_response() -> None:
    node = FrictionNode(1.0, 1.0, 2.0, 3.0, 0.8, 1.1)
    events = simulate(node, IntegralLoop(0.7), 4.0, 40.0).events
    checked = 0
    for before, after in pairwise(events):
        if before.sign == 0:
            spring = 2.0 * (before.x_m - before.x) - 3.0 * before.x
            delay = stiction.breakaway_delay(0.7, 2.0, 1.1, 4.0 - 3.0 * before.x, spring)
            assert float(delay) == pytest.approx(after.time - before.time, rel=1e-9)
            checked += 1
    assert checked > 3
    assert stiction.breakaway_delay(0.7, 2.0, 1.1, 4.0) == pytest.approx(1.1 / (0.7 * 2.0 * 4.0))  # as printed
    assert stiction.breakaway_delay(0.7, 2.0, 1.1, 0.0) == math.inf


def test_numbers_of_5_4_and_5_11_compare_two_frequencies() -> None:
    # G_I K = 0.5 * 2 = 1 rad/s against sqrt(9/4) = 1.5 rad/s; b = 0.6 * 2 sqrt(9 * 4)
    assert stiction.inertia_number(0.5, 4.0, 3.0, 6.0) == pytest.approx(1.0 / 1.5)
    assert linear_loop.damping_ratio(4.0, 7.2, 3.0, 6.0) == pytest.approx(0.6)
    assert stiction.stiction_cycle_number(0.5, 4.0, 7.2, 3.0, 6.0) == pytest.approx(1.0 / 1.5 / 0.8)
    assert stiction.stiction_cycle_number(0.5, 4.0, 12.0, 3.0, 6.0) == math.inf


def test_stuck_motor_runs_at_the_speed_of_5_5() -> None:
    node, times = FrictionNode(1.0, 1.0, 2.0, 3.0, 0.8, 1.1), [0.05, 0.15]
    early, late = simulate(node, IntegralLoop(0.7), -4.0, 1.0).at(times).x_m
    assert stiction.stuck_motor_speed(0.7, -4.0) == pytest.approx((late - early) / 0.1, rel=1e-12)


def test_slip_overshoot_is_one_swing_of_the_damped_node() -> None:
    for zeta in (0.01, 0.25, 0.7, 0.95):
        rest = slip_of_still_motor(zeta)
        assert stiction.slip_overshoot(zeta) == pytest.approx(rest, rel=1e-4)
    assert stiction.slip_overshoot([0.0, 1.0, 3.0]).tolist() == [2.0, 1.0, 1.0]


def slip_of_still_motor(zeta: float) -> float:
    """Travel to the first standstill of x'' + 2 zeta x' + x = 1 from rest, by small midpoint steps."""
    x, v, h = 0.0, 1e-12, 2e-4
    while v > 0.0:
        vm = v + h / 2 * (1.0 - x - 2.0 * zeta * v)
        x, v = x + h * vm, v + h * (1.0 - (x + h / 2 * v) - 2.0 * zeta * vm)
    return x


@pytest.mark.parametrize("damping", [0.0, 1.2])
def test_slip_force_is_the_swing_of_a_node_between_two_springs(damping: float) -> None:
    """J = 0.5, k_tr = 3, k_c = 6, dF = 0.4, by small midpoint steps."""
    x, v, h, t = 0.0, 0.0, 1e-4, 0.0
    while v >= 0.0:
        if round(t / h) % 1000 == 0:
            expected = stiction.slip_force(t, 0.5, damping, 3.0, 6.0, 0.4)
            assert expected == pytest.approx(6.0 * x, abs=1e-5)
        vm = v + h / 2 * (0.4 - 9.0 * x - damping * v) / 0.5
        x, v, t = x + h * vm, v + h * (0.4 - 9.0 * (x + h / 2 * v) - damping * vm) / 0.5, t + h
    assert stiction.slip_force([t, 3.0 * t], 0.5, damping, 3.0, 6.0, 0.4) == pytest.approx([6.0 * x] * 2, abs=1e-5)
    undamped = 0.4 * 6.0 / 9.0 * (1.0 - math.cos(math.sqrt(9.0 / 0.5) * 0.3))  # as printed
    damped = float(stiction.slip_force(0.3, 0.5, damping, 3.0, 6.0, 0.4))
    assert (abs(damped / undamped - 1.0) < 1e-9) is (damping == 0.0)
    assert stiction.slip_force(0.3, 0.5, damping, 3.0, 6.0, -0.4) == -stiction.slip_force(
        0.3, 0.5, damping, 3.0, 6.0, 0.4
    )


@pytest.mark.parametrize("zeta", [0.05, 0.25, 0.6])
def test_stiction_cycle_of_a_slow_loop(zeta: float) -> None:
    ktr, kc, fs, fd, gain = 3.0, 1.5, 1.3, 1.0, 1e-3
    node = FrictionNode(1.0, 2.0 * zeta * math.sqrt(4.5), ktr, kc, fd, fs)
    assert stiction.stiction_cycle_number(gain, 1.0, node.damping, ktr, kc) < 7e-4
    exact = assess(node, IntegralLoop(gain), 0.4, tolerance=1e-6)
    assert exact.verdict is Verdict.LIMIT_CYCLE
    assert stiction.stiction_cycle_force(ktr, kc, fs, fd, zeta) == pytest.approx(exact.peak_to_peak, rel=1e-3)
    assert stiction.stiction_cycle_period(gain, ktr, kc, fs, fd, zeta) == pytest.approx(exact.period, rel=2e-3)
    omega = float(stiction.slip_overshoot(zeta))
    printed = omega * 4.0 / (gain * ktr) * (ktr + kc) / kc * (2.0 * fs / (fs - fd) - 1.0)
    assert printed > 1.15 * exact.period  # errata: wrong unless Omega = 1


def test_coulomb_friction_has_no_stiction_cycle() -> None:
    assert stiction.stiction_cycle_force(2.0, 2.0, 1.0, 1.0, 0.25) == 0.0
    assert stiction.stiction_cycle_period(1.0, 2.0, 2.0, 1.0, 1.0, 0.25) == math.inf


def first_slip(gain: float, step: float) -> tuple[float, float]:
    """Travel of motor and of F_c in the first slip of a lightly damped node, J = 2, k_tr = 3, k_c = 1.5."""
    events = simulate(FrictionNode(2.0, 0.2, 3.0, 1.5, 1.0, 1.3), IntegralLoop(gain), step, 1e5, max_events=4).events
    assert [e.kind for e in events[1:3]] == [Kind.SLIP, Kind.STICK]
    return events[2].x_m - events[1].x_m, events[2].contact_force - events[1].contact_force


def test_number_of_5_13_is_the_travel_of_the_motor_over_that_of_the_node() -> None:
    zeta = 0.1 / math.sqrt(9.0)
    size = float(stiction.stiction_cycle_force(3.0, 1.5, 1.3, 1.0, zeta))
    for gain in (1e-4, 1e-3):  # F_c rises by 2 % of the error in the slip
        motor, force = first_slip(gain, 6.0)
        number = stiction.staircase_number(gain, 6.0, 2.0, 0.2, 3.0, 1.5, 0.3)
        assert number == pytest.approx(motor / (0.3 / 4.5), rel=0.02)
        assert force == pytest.approx(size, rel=float(number))
    assert stiction.staircase_number(1e-3, 6.0, 2.0, 0.2, 3.0, 1.5, 0.0) == math.inf
    assert stiction.staircase_number(1e-3, 6.0, 1.0, 5.0, 3.0, 1.5, 0.3) == math.inf


def test_small_number_of_5_13_makes_a_staircase_of_5_8_and_a_large_one_does_not() -> None:
    node = FrictionNode(1.0, 0.2, 3.0, 1.5, 1.0, 1.3)
    size = float(stiction.stiction_cycle_force(3.0, 1.5, 1.3, 1.0, 0.1 / math.sqrt(4.5)))
    for gain, equal in ((2e-4, True), (0.05, False)):
        assert bool(stiction.staircase_number(gain, 6.0, 1.0, 0.2, 3.0, 1.5, 0.3) < 0.1) is equal
        sticks = [e for e in simulate(node, IntegralLoop(gain), 6.0, 1e6, max_events=12).events if e.kind is Kind.STICK]
        steps = [after.contact_force - before.contact_force for before, after in pairwise(sticks)]
        assert bool(np.all(np.abs(np.array(steps[:4]) / size - 1.0) < 0.05)) is equal


def test_drop_is_the_difference_of_the_frictions_and_half_the_cycle_is_its_deadband() -> None:
    assert stiction.friction_drop([1.3, 1.0], 1.0) == pytest.approx([0.3, 0.0])
    zeta = 0.25
    node = FrictionNode(1.0, 4.0 * zeta, 2.0, 2.0, 1.0, 1.5)
    size = stiction.stiction_cycle_force(2.0, 2.0, 1.5, 1.0, zeta)
    deadband = size / 2.0
    for share, cycles in ((0.5, True), (1.02, False)):
        loop = IntegralLoop(0.02, deadband=share * deadband)
        verdicts = {assess(node, loop, 1.5 + 0.03 * n).verdict for n in range(12)}
        assert (Verdict.LIMIT_CYCLE in verdicts) is cycles
