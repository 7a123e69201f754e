"""Chapter 4 against the two masses as matrices and against the numbers of sections 4.3 and 4.4."""

import math

import numpy as np
import pytest
from arms import eigenvalues

from wam_theory import resonance
from wam_theory.cable import stiffness_with_reducer
from wam_theory.resonance import force_resonances

TESTBED = {"motor_inertia": 4.067e-5, "link_inertia": 0.452, "transmission_stiffness": 8.33, "ratio": 14.0}


def test_resonances_are_the_eigenvalues_of_the_two_masses() -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        jm, jl, ktr, kc, n = np.array([4e-5, 0.4, 10.0, 1e3, 15.0]) * 10.0 ** rng.uniform(-1, 1, 5)
        lower, upper = force_resonances(jm, jl, ktr, kc, n)
        np.testing.assert_allclose([lower, upper], eigenvalues(jm, jl, ktr, kc, n), rtol=1e-6)
        at_corner = force_resonances(jm, jl, ktr, ktr * jl / jm, 1e-9)  # of (4.7), where both are equal
        np.testing.assert_allclose(at_corner, math.sqrt(ktr / jm), rtol=1e-8)


def test_soft_contact_keeps_its_digits() -> None:
    """Lower root as the contact vanishes: the link and the reflected rotor on k_c."""
    jm, jl, n = TESTBED["motor_inertia"], TESTBED["link_inertia"], TESTBED["ratio"]
    lower = force_resonances(**TESTBED, contact_stiffness=1e-9).lower
    assert float(lower) == pytest.approx(np.sqrt(1e-9 / (jl + n * n * jm)), rel=1e-12)
    b = 1e-9 / jl + 8.33 / jm + n * n * 8.33 / jl
    printed = np.sqrt((b - np.sqrt(b * b - 4 * 8.33 * 1e-9 / (jm * jl))) / 2)
    assert abs(printed / lower - 1) > 1e-3


JM, JL, KTR, KC, N = 0.002, 0.7, 9.0, 400.0, 6.0


def two_masses(s: complex, jm: float, jl: float, ktr: float, kc: float, n: float) -> np.ndarray:
    """Dynamic stiffness of rotor and link."""
    return np.array([[jm * s * s + ktr, -n * ktr], [-n * ktr, jl * s * s + n * n * ktr + kc]])


@pytest.mark.parametrize("s", [0.3j, 12.0j, 2.0 - 20.0j, -1.0 + 55.0j])
def test_transfers_solve_the_equations_of_motion(s: complex) -> None:
    link = np.linalg.solve(two_masses(s, JM, JL, KTR, KC, N), [1.0, 0.0])[1]
    assert resonance.force_transfer(s, JM, JL, KTR, KC, N) == pytest.approx(KC * link, rel=1e-12)
    # link alone, moved by the rotor's end of the cable
    moved = N * KTR / (JL * s * s + N * N * KTR)
    assert two_masses(s, JM, JL, KTR, 0.0, N)[1] @ [1.0, moved] == pytest.approx(0.0, abs=1e-9)
    assert resonance.position_transfer(s, JL, KTR, N) == pytest.approx(moved, rel=1e-12)


def test_slow_motion_is_geared_down_and_slow_force_up_unlike_in_print() -> None:
    assert resonance.position_transfer(0.0, JL, KTR, N) == pytest.approx(1.0 / N)  # printed: 1
    assert resonance.force_transfer(0.0, JM, JL, KTR, KC, N) == pytest.approx(N)  # printed: 1
    assert resonance.position_transfer(0.0, JL, KTR, 1.0) == 1.0


def test_position_bandwidth_is_the_pole_of_its_transfer() -> None:
    for ratio in (1.0, 6.0):
        pole = float(resonance.position_bandwidth(JL, KTR, ratio))
        size = np.abs(resonance.position_transfer(1j * pole * np.array([0.999, 1.0 - 1e-9, 1.001]), JL, KTR, ratio))
        assert size[1] > 1e5 * size[0]
        assert size[1] > 1e5 * size[2]


def test_reducer_at_the_joint_gives_root_n_at_constant_stress_and_n_for_equal_lines() -> None:
    ratio, length = 14.0, 0.9
    at_joint, at_motor = (stiffness_with_reducer(1e4, length, ratio, place) for place in (length, 0.0))
    assert math.sqrt(at_joint / at_motor) == pytest.approx(math.sqrt(ratio), rel=1e-12)
    equal = resonance.position_bandwidth(JL, KTR, ratio) / resonance.position_bandwidth(JL, KTR, 1.0)
    assert equal == pytest.approx(ratio)


def test_limits_are_those_of_the_eigenvalues() -> None:
    rigid, lower = math.sqrt(1e-7 / (JL + N * N * JM)), eigenvalues(JM, JL, KTR, 1e-3, N)[0]
    assert resonance.soft_contact_bandwidth(JM, JL, 1e-7, N) == pytest.approx(rigid, rel=1e-12)
    assert resonance.soft_contact_bandwidth(JM, JL, 1e-3, N) == pytest.approx(lower, rel=1e-4)
    assert resonance.hard_contact_bandwidth(JM, KTR) == pytest.approx(eigenvalues(JM, JL, KTR, 1e9, N)[0], rel=1e-5)
    small = resonance.small_ratio_resonances(JM, JL, KTR, KC)
    assert sorted(map(float, small)) == pytest.approx(eigenvalues(JM, JL, KTR, KC, 1e-4).tolist(), rel=1e-6)
    assert resonance.large_ratio_bandwidth(JM, KC, 1e4) == pytest.approx(eigenvalues(JM, JL, KTR, KC, 1e4)[0], rel=1e-4)
    for kc, lower in ((400.0, "link_on_contact"), (4e4, "rotor_on_cable")):  # (4.7) has its corner at 3150
        curves = resonance.small_ratio_resonances(JM, JL, KTR, kc)
        assert getattr(curves, lower) == min(curves)
        assert min(curves) == pytest.approx(eigenvalues(JM, JL, KTR, kc, 1e-4)[0], rel=1e-5)


INCHES = {"motor_inertia": 0.0057 / 16.0, "link_inertia": 4.0, "transmission_stiffness": 2.0 * 262.0 * 0.375**2}


def test_best_contact_stiffness_of_the_testbed_is_638_pounds_an_inch() -> None:
    """Pounds and inches: the print has N_m = 104, 9e5 lb-in/rad and 650 lb/in."""
    best = float(resonance.best_contact_stiffness(**INCHES))
    assert resonance.matched_ratio(INCHES["motor_inertia"], INCHES["link_inertia"]) == pytest.approx(105.96, abs=0.005)
    assert best == pytest.approx(8.27e5, abs=500)
    assert best / 36.0**2 == pytest.approx(638, abs=0.5)
    asymptote = math.sqrt(INCHES["transmission_stiffness"] / INCHES["motor_inertia"])
    at_nine = eigenvalues(*(INCHES[k] for k in INCHES), 9e5, 14.0)[0] / asymptote
    assert at_nine == pytest.approx(0.954, abs=5e-4)
    assert resonance.best_transmission_stiffness(INCHES["motor_inertia"], 4.0, best) == pytest.approx(
        INCHES["transmission_stiffness"]
    )
