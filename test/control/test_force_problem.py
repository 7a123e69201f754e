"""The problem of one period against its own definition: nothing that is allowed is better."""

import math
from typing import NamedTuple

import numpy as np
import pytest
import quadprog
from numpy.typing import NDArray

from wam_control.force.problem import PUSHED, RANK, VelocityRow, linear, solve, unlimited
from wam_description.small_matrices import solution

Array = NDArray[np.float64]
N = 4
NEAR = 1e-4  # rad/s


class Case(NamedTuple):
    """A random problem."""

    rows: list[VelocityRow]
    posture: Array
    least: list[VelocityRow]
    low: Array
    high: Array


def random_case(seed: int, rows: int | None = None, pushes: int | None = None) -> Case:
    random = np.random.default_rng(seed)

    def some(count: int) -> list[VelocityRow]:
        return [
            VelocityRow(random.normal(size=N) * 10.0 ** random.uniform(-2, 0), random.normal()) for _ in range(count)
        ]

    many, few = random.integers(0, 4) if rows is None else rows, random.integers(0, 3) if pushes is None else pushes
    low, high = np.sort(random.uniform(-1.5, 1.5, (2, N)), axis=0)
    return Case(some(many), random.normal(size=N), some(few), low, high)


def cost(case: Case, v: Array) -> float:
    off = sum((row.along @ v - row.speed) ** 2 / row.size**2 for row in case.rows)
    short = sum(max(0.0, row.speed - row.along @ v) ** 2 / row.size**2 for row in case.least)
    free = unlimited(case.rows, case.posture)
    rank = PUSHED if any(row.along @ free < row.speed for row in case.least) else RANK
    return float((v - case.posture) @ (v - case.posture) + rank * (off + short))


@pytest.mark.parametrize("seed", range(12))
def test_the_bounds_hold_and_no_velocity_within_them_is_better(seed: int) -> None:
    case, random = random_case(seed), np.random.default_rng(seed)
    found, _ = solve(*case)
    assert (found >= case.low).all()
    assert (found <= case.high).all()
    best = cost(case, found) * (1.0 + 1e-6) + 1e-6
    others = [random.uniform(case.low, case.high) for _ in range(100)]
    others += [found + random.normal(size=N) * 10.0 ** random.uniform(-6, 0) for _ in range(400)]
    assert all(cost(case, np.clip(other, case.low, case.high)) >= best * (1.0 - 1e-5) - 2e-6 for other in others)


@pytest.mark.parametrize("seed", range(12))
def test_the_closed_form_is_the_solution_of_the_whole_quadratic_program(seed: int) -> None:
    case, far = random_case(seed, rows=seed % 4, pushes=0), np.full(N, 1e9)
    found, unlimited = solve(case.rows, case.posture, [], -far, far)
    assert found is unlimited
    matrix, right = np.eye(N), case.posture
    for along, speed in case.rows:
        matrix = matrix + np.outer(along, along) * RANK / float(along @ along)
        right = right + along * speed * RANK / float(along @ along)
    assert found == pytest.approx(quadprog.solve_qp(matrix, right)[0], abs=NEAR)
    assert (solution(matrix, right) == np.linalg.solve(matrix, right)).all()
    with pytest.raises(np.linalg.LinAlgError), np.errstate(invalid="ignore"):
        solution(0.0 * matrix, right)
    if not case.rows:
        return
    drive, hold = linear([row.along for row in case.rows], N)
    linearly = drive @ np.array([row.speed for row in case.rows]) + hold @ case.posture
    assert found == pytest.approx(linearly, abs=NEAR), "the guard judges what is commanded"


@pytest.mark.parametrize("seed", range(5))
def test_limits_that_are_not_reached_change_no_bit(seed: int) -> None:
    case, far = random_case(seed, rows=1, pushes=0), np.full(N, 1e9)
    free, _ = solve(case.rows, case.posture, [], -far, far)
    slack = [VelocityRow(row.along, float(row.along @ free) - 0.1) for row in random_case(seed + 99, pushes=2).least]
    found, unlimited = solve(case.rows, case.posture, slack, free - 0.1, free + 0.1)
    assert found is unlimited
    assert (found == free).all()
    (row,) = case.rows
    assert row.along @ free == pytest.approx(row.speed, abs=1e-12)


def test_a_row_comes_before_the_posture_and_a_push_as_high_as_a_row() -> None:
    along, aside = np.array([0.3, 0.4, 0.0, 0.0]), np.array([0.4, -0.3, 0.0, 0.0])
    posture, far = np.array([1.0, 0.0, 0.5, 0.0]), np.full(N, 9.0)
    found, _ = solve([VelocityRow(along, 0.1)], posture, [], -far, far)
    assert along @ found == pytest.approx(0.1)
    assert aside @ found == pytest.approx(aside @ posture), "what is left belongs to the posture"
    pushed, _ = solve([VelocityRow(along, 0.1)], posture, [VelocityRow(along, 0.3)], -far, far)
    expected = (along @ posture + PUSHED * (0.1 + 0.3)) / (1.0 + 2.0 * PUSHED)
    assert along @ pushed == pytest.approx(expected, abs=1e-4), "half of what contradicts each other"
    apart, _ = solve([VelocityRow(along, 0.1)], posture, [VelocityRow(aside, 0.7)], -far, far)
    assert along @ apart == pytest.approx((along @ posture + PUSHED * 0.1) / (1.0 + PUSHED), abs=1e-4)
    assert aside @ apart == pytest.approx((aside @ posture + PUSHED * 0.7) / (1.0 + PUSHED), abs=1e-4)


@pytest.mark.parametrize("angle", [0.0, 1e-3, 1e-2, 0.1, 0.3])
def test_a_push_that_is_nearly_along_a_row_moves_the_arm_slowly_across_it(angle: float) -> None:
    far, turned = np.full(N, 99.0), np.array([math.cos(angle), math.sin(angle), 0.0, 0.0])
    found, _ = solve([VelocityRow(np.eye(N)[0], 0.0)], np.zeros(N), [VelocityRow(turned, 0.1)], -far, far)
    assert np.linalg.norm(found) <= 0.05 * math.sqrt(PUSHED)


@pytest.mark.parametrize("along", [np.zeros(N), np.full(N, 1e-12)])
def test_a_row_without_a_lever_moves_nothing(along: Array) -> None:
    posture, far = np.full(N, 0.2), np.full(N, 1.0)
    found, _ = solve([VelocityRow(along, 1.0)], posture, [VelocityRow(along, 1.0)], -far, far)
    assert (found == posture).all()
    assert not linear([along], N)[0].any()


@pytest.mark.parametrize("fixed", range(N + 1))
def test_a_joint_that_may_move_at_one_velocity_alone_does_so_whatever_is_asked(fixed: int) -> None:
    for seed in range(100):
        case = random_case(seed)
        low = np.where(np.arange(N) < fixed, case.high, case.low)
        fast = [[row._replace(speed=30.0 * row.speed) for row in rows] for rows in (case.rows, case.least)]
        found, _ = solve(fast[0], case.posture, fast[1], low, case.high)
        assert ((found >= low) & (found <= case.high)).all()
