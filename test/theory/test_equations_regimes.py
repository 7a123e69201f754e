"""Regimes of an inertial node (section 5.5) against matrix steps and the exact response."""

import math
from itertools import pairwise

import numpy as np
import pytest

from wam_theory import linear_loop, regimes
from wam_theory.stick_slip import FrictionNode, IntegralLoop, Kind, half_cycle, simulate


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


@pytest.mark.parametrize("zeta", [0.03, 0.25, 0.7, 0.95, 1.4])
def test_psi_is_the_ratio_that_matrix_steps_find(zeta: float) -> None:
    for gamma in (0.5, 0.9, 1.0, 1.2, 2.0):
        stopped = slip_by_matrix(gamma, zeta)
        assert stopped is not None
        assert regimes.psi(gamma, zeta) == pytest.approx(-stopped[0], abs=1e-7)


@pytest.mark.parametrize(("gamma", "zeta"), [(0.7, 0.25), (1.8, 0.25), (1.2, 1.1)])
def test_half_cycle_ends_where_matrix_steps_of_5_14_do(gamma: float, zeta: float) -> None:
    stopped = slip_by_matrix(gamma, zeta)
    assert stopped is not None
    slip = half_cycle(gamma, zeta)
    assert (slip.error, slip.acceleration) == pytest.approx(stopped, abs=1e-7)


def test_psi_is_the_ratio_of_errors_at_successive_standstills() -> None:
    zeta, gamma = 0.25, 0.9
    node = FrictionNode(1.0, 1.0, 2.0, 2.0, 1.0, 1.0)
    sticks = [e for e in simulate(node, IntegralLoop(gamma), 1.0, 1e4).events if e.kind is Kind.STICK]
    errors = [1.0 - e.contact_force for e in sticks[:6]]
    ratios = [-late / early for early, late in pairwise(errors)]
    assert ratios == pytest.approx([float(regimes.psi(gamma, zeta))] * len(ratios), rel=1e-6)


@pytest.mark.parametrize("zeta", [0.05, 0.25, 0.6, 0.86, 0.88, 1.0, 1.5])
def test_slips_never_stop_below_gamma_a_and_do_above(zeta: float) -> None:
    bound = float(regimes.gamma_a(zeta))
    assert regimes.psi(0.999 * bound, zeta) == 0.0
    assert slip_by_matrix(0.97 * bound, zeta) is None
    node = FrictionNode(1.0, 4.0 * zeta, 2.0, 2.0, 1.0, 1.0)
    for factor, stops in ((0.999, False), (1.02, True)):
        loop = IntegralLoop(factor * bound * 4.0 * zeta)
        kinds = [event.kind for event in simulate(node, loop, 1.0, 1e6, max_events=5).events]
        assert (Kind.STICK in kinds) is stops


def test_regimes_of_zeta_one_quarter() -> None:
    assert regimes.gamma_a(0.25) == pytest.approx(1.0 / 3.0 - 8.0 / (27.0 * 16.0), rel=1e-12)
    assert regimes.gamma_b(0.25) == pytest.approx(0.597, abs=0.0005)
    assert regimes.gamma_3(0.25) == pytest.approx(2.186, abs=0.0005)
    assert regimes.point_b(0.25) == pytest.approx(1.356, abs=0.0005)


@pytest.mark.parametrize(
    ("zeta", "ratio"), [(0.05, 0.0), (0.25, 0.0), (0.8, 0.0), (0.05, 1.0), (0.25, 1.0), (1.3, 1.0)]
)
def test_regime_bounds_lie_where_matrix_steps_find_the_ratio(zeta: float, ratio: float) -> None:
    bound = float(regimes.gamma_3(zeta) if ratio else regimes.gamma_b(zeta))
    above, below = slip_by_matrix(1.01 * bound, zeta), slip_by_matrix(0.99 * bound, zeta)
    assert above is not None
    assert -above[0] > ratio
    assert below is None or -below[0] < ratio


def test_order_of_the_regimes_holds_above_zeta_0_1372_alone() -> None:
    assert regimes.gamma_b(0.13715) > 1.0 > regimes.gamma_b(0.13725)
    assert regimes.gamma_b(1.2) == regimes.gamma_a(1.2)
    assert regimes.gamma_b(0.05) == pytest.approx(2.51, abs=0.005)
    assert regimes.gamma_3(0.05) == pytest.approx(7.85, abs=0.005)
    # 2 zeta s^2 + s + 2 zeta gamma of a heavily damped node has equal roots at 1/(16 zeta^2)
    assert regimes.gamma_a([1e4, 1e8]) == pytest.approx([1.0 / 16e8, 1.0 / 16e16], rel=1e-7)
    assert regimes.gamma_3(1e4) == pytest.approx(1.0 + 0.5e-4 / math.pi, rel=1e-7)
    zeta = np.array([0.02, 0.05, 0.1372, 0.25, 0.6, 0.86, 0.9, 1.5, 3.0])
    a, b, third = regimes.gamma_a(zeta), regimes.gamma_b(zeta), regimes.gamma_3(zeta)
    assert np.all((a <= b) & (b < third) & (third > 1.0))
    assert np.array_equal(a == b, zeta > math.sqrt(0.75))


@pytest.mark.parametrize(("ktr", "kc"), [(2.0, 2.0), (4.0, 1.0), (1.0, 3.0)])
def test_point_b_parts_first_slips_that_stick_from_those_that_reverse(ktr: float, kc: float) -> None:
    zeta, j = 0.25, 0.8
    b = 2.0 * zeta * math.sqrt(j * (ktr + kc))
    gain = float(regimes.gamma_3(zeta) * linear_loop.routh_gain(j, b, ktr, kc))
    ratio = float(regimes.point_b(zeta, ktr, kc))
    for factor, kind in ((1.001, Kind.STICK), (0.999, Kind.REVERSE)):
        node = FrictionNode(j, b, ktr, kc, factor * ratio, factor * ratio)
        assert simulate(node, IntegralLoop(gain), 1.0, 1e3).events[2].kind is kind


@pytest.mark.parametrize("gamma", [0.45, 0.9])
def test_spin_up_is_the_time_stuck_of_the_exact_response(gamma: float) -> None:
    """Zeta = 0.25, friction 5: stairs of equal times below gamma_b = 0.597, times without bound above."""
    node = FrictionNode(1.0, 1.25, 2.0, 4.25, 5.0, 5.0)
    gain = gamma * float(linear_loop.routh_gain(1.0, 1.25, 2.0, 4.25))
    events = simulate(node, IntegralLoop(gain), 1.0, 1e300, max_events=24).events[1:]
    stuck = []
    for slip, stick, after in zip(events[::2], events[1::2], events[2::2], strict=False):
        assert (slip.kind, stick.kind) == (Kind.SLIP, Kind.STICK)
        found = regimes.spin_up_time(gain, 2.0, 4.25, 5.0, 1.0 - slip.contact_force, gamma, 0.25)
        assert found == pytest.approx(after.time - stick.time, rel=1e-6)
        stuck.append(float(found))
    if gamma < 0.597:
        assert stuck == pytest.approx([stuck[0]] * len(stuck), rel=1e-6)  # (5.19) does not hold here
    else:
        ratio = float(regimes.psi(gamma, 0.25))
        assert stuck[-1] / stuck[-2] == pytest.approx(1.0 / ratio, rel=0.01)  # without bound


def test_no_time_is_stuck_where_the_slip_is_too_hard_and_all_where_it_creeps() -> None:
    assert regimes.spin_up_time(1.0, 2.0, 2.0, 1.0, 100.0, 1.5, 0.25) == 0.0
    assert regimes.spin_up_time(1.0, 2.0, 2.0, 1.0, 1.0, 0.2, 0.25) == math.inf


def actuator_range(gamma: float, step: float) -> float:
    """Peak to peak of x_m between the last breakaways of a response of zeta = 0.25, F_friction = 1.5."""
    node = FrictionNode(1.0, 1.0, 2.0, 2.0, 1.5, 1.5)
    events = simulate(node, IntegralLoop(gamma), step, 1e300, max_events=40).events
    motor = [e.x_m for e in events if e.kind is Kind.SLIP][-4:]
    return max(motor) - min(motor)


@pytest.mark.parametrize("gamma", [0.65, 0.9, 1.4])
def test_actuator_cycles_by_twice_the_friction_over_the_stiffness(gamma: float) -> None:
    assert regimes.actuator_cycle(1.5, 2.0, gamma, 0.25) == pytest.approx(1.5)
    assert actuator_range(gamma, 1.0) == pytest.approx(1.5, rel=2e-3)


def test_actuator_cycle_exists_only_from_gamma_b_to_gamma_3() -> None:
    found = regimes.actuator_cycle(1.5, 2.0, [0.2, 0.5, 0.59, 0.60, 2.18, 2.19], 0.25)
    assert found.tolist() == [0.0, 0.0, 0.0, 1.5, 1.5, math.inf]
    assert actuator_range(0.5, 1.0) < 1e-6


def test_actuator_power_is_its_work_over_the_time_of_the_exact_half_cycle() -> None:
    gamma, friction = 0.9, 1.5
    node = FrictionNode(1.0, 1.0, 2.0, 2.0, friction, friction)
    events = simulate(node, IntegralLoop(gamma), 1.0, 1e300, max_events=60).events
    breaks = [e for e in events if e.kind is Kind.SLIP][-2:]
    error = abs(1.0 - breaks[1].contact_force)
    time = breaks[1].time - breaks[0].time
    work = float(regimes.actuator_cycle_work(friction, 2.0))
    assert regimes.actuator_cycle_power(gamma, error, friction) * time == pytest.approx(work, rel=1e-3)
    assert work == pytest.approx(0.5 * 2.0 * (friction / 2.0) ** 2)  # of the spring at breakaway, lost as it unloads
