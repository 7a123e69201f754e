"""(4.4) against the eigenvalues of the two masses and against the numbers of sections 4.3 and 4.4."""

import numpy as np
import pytest

from wam_theory.resonance import force_resonances

TESTBED = {"motor_inertia": 4.067e-5, "link_inertia": 0.452, "transmission_stiffness": 8.33, "ratio": 14.0}


def eigenvalues(jm: float, jl: float, ktr: float, kc: float, n: float) -> np.ndarray:
    """Natural frequencies, rad/s, of rotor and link as two masses on two springs."""
    stiffness = np.array([[ktr, -n * ktr], [-n * ktr, n * n * ktr + kc]])
    scale = np.diag([jm**-0.5, jl**-0.5])
    return np.sqrt(np.linalg.eigvalsh(scale @ stiffness @ scale))


def test_resonances_are_the_eigenvalues_of_the_two_masses() -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        jm, jl, ktr, kc, n = np.array([4e-5, 0.4, 10.0, 1e3, 15.0]) * 10.0 ** rng.uniform(-1, 1, 5)
        lower, upper = force_resonances(jm, jl, ktr, kc, n)
        np.testing.assert_allclose([lower, upper], eigenvalues(jm, jl, ktr, kc, n), rtol=1e-6)


def test_soft_contact_keeps_its_digits() -> None:
    """Lower root as the contact vanishes: the link and the reflected rotor on k_c."""
    jm, jl, n = TESTBED["motor_inertia"], TESTBED["link_inertia"], TESTBED["ratio"]
    lower = force_resonances(**TESTBED, contact_stiffness=1e-9).lower
    assert float(lower) == pytest.approx(np.sqrt(1e-9 / (jl + n * n * jm)), rel=1e-12)
    b = 1e-9 / jl + 8.33 / jm + n * n * 8.33 / jl
    printed = np.sqrt((b - np.sqrt(b * b - 4 * 8.33 * 1e-9 / (jm * jl))) / 2)
    assert abs(printed / lower - 1) > 1e-3


def test_hard_contact_leaves_the_rotor_on_its_cable() -> None:
    """The asymptote of section 4.4 is sqrt(k_tr/J_m): 72 Hz for the testbed."""
    lower = force_resonances(**TESTBED, contact_stiffness=1e9).lower
    assert float(lower) == pytest.approx(np.sqrt(8.33 / 4.067e-5), rel=1e-4)
    assert float(lower) / (2 * np.pi) == pytest.approx(72.0, abs=0.5)


def test_arguments_broadcast() -> None:
    found = force_resonances(**TESTBED, contact_stiffness=np.array([100.0, 1000.0]))
    assert found.lower.shape == (2,)
    assert float(found.upper[1]) == float(force_resonances(**TESTBED, contact_stiffness=1000.0).upper)


@pytest.mark.parametrize("name", [*TESTBED, "contact_stiffness"])
def test_argument_that_is_not_above_zero_is_refused_by_name(name: str) -> None:
    for bad in (0.0, -1.0, float("nan")):
        with pytest.raises(ValueError, match=name):
            force_resonances(**(TESTBED | {"contact_stiffness": 1000.0} | {name: bad}))
