"""The unstable cycle of domain II against Fourier, matrices and the exact response."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from wam_theory import describing_function, regimes
from wam_theory.stick_slip import FrictionNode, IntegralLoop, Kind, Verdict, assess, simulate

QUARTER = (1.0, 1.0, 2.0, 2.0)  # J, b, k_tr, k_c: zeta = 0.25 and gamma = G_I


def test_describing_function_is_the_fundamental_of_the_friction_of_a_swinging_node() -> None:
    angle = (np.arange(20_000) + 0.5) * 2.0 * math.pi / 20_000
    friction = 0.7 * np.sign(np.sin(angle))
    fundamental = 2.0 * np.mean(friction * np.sin(angle))
    assert describing_function.coulomb_describing_function(0.7, 0.3) == pytest.approx(fundamental / 0.3, rel=1e-6)


def test_linear_block_is_that_of_the_state_matrices() -> None:
    gain, j, b, ktr, kc = 0.8, 0.7, 0.4, 2.0, 5.0
    a = np.array([[0.0, 1.0, 0.0], [-(ktr + kc) / j, -b / j, ktr / j], [-gain * kc, 0.0, 0.0]])
    for s in (0.5j, 3.0j, 0.2 + 2.0j):
        velocity = np.linalg.solve(s * np.eye(3) - a, [0.0, 1.0 / j, 0.0])[1]
        found = describing_function.friction_to_velocity(s, gain, j, b, ktr, kc)
        assert found == pytest.approx(velocity, rel=1e-12)


def test_predicted_cycle_solves_5_16() -> None:
    values = (1.9, 0.7, 0.4, 2.0, 5.0)
    cycle = describing_function.predicted_unstable_cycle(*values, 0.3)
    speed = float(cycle.force / 5.0 * cycle.frequency)
    block = describing_function.friction_to_velocity(1j * cycle.frequency, *values)
    n = describing_function.coulomb_describing_function(0.3, speed)
    assert 1.0 + block * n == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("gamma", "excess", "from_rest"), [(1.1, 0.007, 2.0), (1.5, 0.05, 1.42), (2.0, 0.18, 1.09)])
def test_exact_cycle_is_where_responses_linger_before_they_part(gamma: float, excess: float, from_rest: float) -> None:
    """Start as near the edge between settling and diverging as numbers allow: the peaks stay at the cycle."""
    node, loop = FrictionNode(*QUARTER, 1.0, 1.0), IntegralLoop(gamma)
    low, high = 0.1, 100.0
    for _ in range(60):
        middle = (low + high) / 2.0
        if assess(node, loop, middle).verdict is Verdict.DIVERGED:
            high = middle
        else:
            low = middle
    events = simulate(node, loop, low, 1e4, max_events=60).events
    turns = [(e.time, abs(low - e.contact_force)) for e in events if e.kind is Kind.REVERSE]
    sizes = np.array([size for _, size in turns])
    still = int(np.argmin(np.abs(np.diff(np.log(sizes)))))
    cycle = describing_function.unstable_cycle(gamma, *QUARTER, 1.0)
    assert cycle.force == pytest.approx(sizes[still], rel=1e-4)
    assert cycle.frequency == pytest.approx(math.pi / (turns[still + 1][0] - turns[still][0]), rel=1e-4)
    predicted = describing_function.predicted_unstable_cycle(gamma, *QUARTER, 1.0)
    assert predicted.force / cycle.force - 1.0 == pytest.approx(excess, abs=0.005)
    assert low / cycle.force == pytest.approx(from_rest, abs=0.01)


@pytest.mark.parametrize("zeta", [0.03, 0.25, 0.7, 1.3])
def test_exact_cycle_ends_at_gamma_3_in_the_slip_of_psi_one_and_the_predicted_one_does_not_end(zeta: float) -> None:
    third = float(regimes.gamma_3(zeta))
    values = (1.0, 4.0 * zeta, 2.0, 2.0)
    below, above = (
        describing_function.unstable_cycle(g * 4.0 * zeta, *values, 1.0) for g in (third * (1 - 1e-7), third * 1.0001)
    )
    assert below.force == pytest.approx(1.0 / regimes.point_b(zeta), rel=1e-3)
    assert above.force == 0.0
    assert math.isnan(above.frequency)
    assert describing_function.predicted_unstable_cycle(third * 1.1 * 4.0 * zeta, *values, 1.0).force > 0.0


def test_there_is_no_cycle_in_domain_one_and_prediction_and_exact_meet_at_its_end() -> None:
    for find in (describing_function.unstable_cycle, describing_function.predicted_unstable_cycle):
        cycle = find([0.5, 1.0], *QUARTER, 1.0)
        assert np.all(cycle.force == math.inf)
        assert np.all(np.isnan(cycle.frequency))
    exact = describing_function.unstable_cycle(1.0001, *QUARTER, 1.0)
    assert exact.force == pytest.approx(
        float(describing_function.predicted_unstable_cycle(1.0001, *QUARTER, 1.0).force), rel=1e-4
    )
    assert exact.frequency == pytest.approx(2.0, rel=1e-4)


def test_exact_cycle_of_another_node_has_its_own_units() -> None:
    """J = 0.5, b = 0.8, k_tr = 3, k_c = 5: near gamma = 1 F_c swings by 4 F k_c/(pi b (gamma - 1) omega)."""
    gain = 1.001 * 0.8 / 0.5 * (1.0 / 3.0 + 1.0 / 5.0)
    cycle = describing_function.unstable_cycle(gain, 0.5, 0.8, 3.0, 5.0, 0.3)
    assert cycle.frequency == pytest.approx(4.0, rel=1e-3)
    assert cycle.force == pytest.approx(4.0 * 0.3 * 5.0 / (math.pi * 0.8 * 0.001 * 4.0), rel=1e-3)


def test_cycle_grows_with_the_friction_and_arguments_broadcast() -> None:
    gains, friction = np.array([[1.2], [1.8]]), np.array([1.0, 2.0, 4.0])
    for find in (describing_function.unstable_cycle, describing_function.predicted_unstable_cycle):
        force = find(gains, *QUARTER, friction).force
        assert force.shape == (2, 3)
        np.testing.assert_allclose(force / force[:, :1], [[1.0, 2.0, 4.0]] * 2)


@pytest.mark.parametrize(
    ("call", "names"),
    [
        (lambda: describing_function.coulomb_describing_function(1.0, 0.0), "amplitude is 0"),
        (lambda: describing_function.friction_to_velocity(1j, 1.0, 0.0, 1.0, 1.0, 1.0), "inertia is 0"),
        (lambda: describing_function.predicted_unstable_cycle(1.0, *QUARTER, 0.0), "friction is 0"),
        (lambda: describing_function.unstable_cycle(1.0, 1.0, 0.0, 1.0, 1.0, 1.0), "damping is 0"),
    ],
)
def test_a_refusal_names_the_value(call: Callable[[], object], names: str) -> None:
    with pytest.raises(ValueError, match=names):
        call()
