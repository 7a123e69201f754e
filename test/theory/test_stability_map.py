"""The stability map of figure 5.8 against exact responses and the errata's numbers."""

import math

import numpy as np
import pytest

from wam_theory.regimes import gamma_3, point_b
from wam_theory.stability_map import largest_stable_steps
from wam_theory.stick_slip import FrictionNode, IntegralLoop, Verdict, assess

CLOSE = 5e-3  # of a boundary


def random_points(count: int, seed: int) -> np.ndarray:
    """gamma, zeta, k_tr/k_c and stiction of points on both sides of gamma_III, half of them with stiction, (4, n)."""
    rng = np.random.default_rng(seed)
    stiction = np.where(rng.random(count) < 0.5, 1.0, 1.0 + 10.0 ** rng.uniform(-3.0, 0.7, count))
    gamma, zeta = 1.0 + 10.0 ** rng.uniform(-1.7, 0.3, count), 10.0 ** rng.uniform(-1.5, 0.4, count)
    return np.array([gamma, zeta, 10.0 ** rng.uniform(-1.0, 1.0, count), stiction])


def loop_of(gamma: float, zeta: float, ratio: float, stiction: float) -> tuple[FrictionNode, IntegralLoop]:
    """A node with J = 2, k_c = 3, F_dynamic = 0.7, and the loop of these coordinates."""
    inertia, kc, friction = 2.0, 3.0, 0.7
    ktr = ratio * kc
    damping = 2.0 * zeta * math.sqrt(inertia * (ktr + kc))
    node = FrictionNode(inertia, damping, ktr, kc, friction, friction * stiction)
    return node, IntegralLoop(gamma * damping / inertia * (1.0 / ktr + 1.0 / kc))


@pytest.mark.slow
def test_boundaries_part_steps_that_diverge_from_those_that_do_not() -> None:
    points = random_points(60, 58)
    found = largest_stable_steps(*points)
    for (gamma, zeta, ratio, stiction), step in zip(points.T.tolist(), found.tolist(), strict=True):
        node, loop = loop_of(gamma, zeta, ratio, stiction)
        for share, diverges in ((1.0 - CLOSE, False), (1.0 + CLOSE, True)):
            tried = share * max(step, 1e-3) * node.dynamic_friction
            found_end = assess(node, loop, tried).verdict is Verdict.DIVERGED
            assert found_end is (diverges or not step), (gamma, zeta, ratio, stiction)
    assert 30 < np.count_nonzero(found) < 60


def test_domain_one_has_no_largest_step_and_domain_three_none_at_all() -> None:
    steps = largest_stable_steps([[0.4, 0.97, 1.0], [2.19, 2.5, 40.0]], 0.25)
    np.testing.assert_array_equal(steps, [[math.inf] * 3, [0.0] * 3])
    assert largest_stable_steps(2.18, 0.25) > 0.7
    near, nearer = largest_stable_steps([1.0 + 1e-6, 1.0 + 1e-9], 0.25)  # in proportion to 1/(gamma - 1), (5.16)
    assert nearer / near == pytest.approx(1e3, rel=1e-3)


def test_boundary_ends_in_point_b() -> None:
    zeta = np.geomspace(0.03, 3.0, 12)
    for ratio in (0.3, 1.0, 4.0):
        below = largest_stable_steps(gamma_3(zeta) * (1.0 - 1e-9), zeta, ratio)
        np.testing.assert_allclose(below, 1.0 / point_b(zeta, ratio, 1.0), rtol=CLOSE)
        assert not largest_stable_steps(gamma_3(zeta) * (1.0 + 1e-9), zeta, ratio).any()
