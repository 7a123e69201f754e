"""The unstable cycle of domain II against Fourier, matrices and the exact response."""

import math

import numpy as np
import pytest

from wam_theory import describing_function
from wam_theory.stick_slip import FrictionNode, IntegralLoop, Kind, Verdict, assess, simulate

QUARTER = (1.0, 1.0, 2.0, 2.0)  # J, b, k_tr, k_c: zeta = 0.25 and gamma = G_I


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
    predicted = describing_function.predicted_unstable_cycle(gamma, *QUARTER, 1.0)
    assert predicted.force / sizes[still] - 1.0 == pytest.approx(excess, abs=0.005)
    assert low / sizes[still] == pytest.approx(from_rest, abs=0.01)


def test_no_cycle_is_predicted_in_domain_one() -> None:
    cycle = describing_function.predicted_unstable_cycle([0.5, 1.0], *QUARTER, 1.0)
    assert np.all(cycle.force == math.inf)
    assert np.all(np.isnan(cycle.frequency))
