"""The figures' numbers: the plant on the lines, the lines recomputed by hand.

Some 15 s, once: pieces that docs/figures.md has needed are taken from where it keeps them.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wam_cli.main import main
from wam_sim.batch import processes
from wam_sim.pieces import default_file
from wam_studies.figures.catalogue import FIGURES, file_of, numbers, table
from wam_studies.figures.series import Series

ROOT = Path(__file__).resolve().parents[2]
# the testbed at its joint, SI: 64 oz-in-s^2 of link; 8.33 N m/rad at the motor, N = 14
INERTIA, K_TR, K_C = 64.0 / 16.0 * 0.1129848, 14.0**2 * 8.33, 1464.28


@pytest.fixture(scope="module")
def found() -> dict[str, Any]:
    with processes() as executor:
        return numbers(list(FIGURES), executor, default_file("figures"))


@pytest.mark.slow
@pytest.mark.parametrize("name", FIGURES)
def test_points_of_the_plant_lie_on_the_lines(found: dict[str, Any], name: str) -> None:
    distance = FIGURES[name].distance(found[name])
    assert all(value < 0.02 for value in distance.values()), distance
    assert distance or name in ("2.1.1", "3.1", "3.2.6")  # bounds, geometry and inertia


def test_a_point_beside_the_line_is_noticed() -> None:
    x = np.linspace(1.0, 11.0, 50)
    series = Series(x, 4.0 * x, x[::7], 4.0 * x[::7])
    assert series.distance == pytest.approx(0.0, abs=1e-12)
    assert series.relative_distance == pytest.approx(0.0, abs=1e-12)
    moved = series._replace(plant_y=series.plant_y + np.eye(1, len(series.plant_x), 3)[0] * 4.0)
    assert moved.distance == pytest.approx(0.1 / math.sqrt(2.0), rel=1e-6)  # across a line at 45 degrees
    assert moved.relative_distance == pytest.approx(1.0 / x[21])


@pytest.mark.slow  # its fixture: of all figures, where a source has changed
def test_grasp_by_hand(found: dict[str, Any]) -> None:
    grasp = found["3.1"]
    # mu = 0.4, L/W = 10: L' = 1 - 0.05/0.4, D = 0.8 - 0.1; mu = 0.2, L/W = 2: nothing
    at = [np.interp(10.0, grasp.aspect_ratio, rows[1]) for rows in (grasp.length, grasp.diameter)]
    assert at == pytest.approx([0.875, 0.7], abs=1e-3)
    assert np.interp(2.0, grasp.aspect_ratio, grasp.length[0]) == 0.0


@pytest.mark.slow  # its fixture: of all figures, where a source has changed
def test_breakpoints_are_those_of_two_masses_on_two_springs(found: dict[str, Any]) -> None:
    numbers_ = found["4.9"]
    rotor = 0.0057 / 16.0 * 0.1129848
    for i in (20, 150, 280):
        kc = numbers_.lower.x[i]
        stiffness = np.array([[8.33, -14.0 * 8.33], [-14.0 * 8.33, K_TR + kc]])
        squares = np.sort(np.linalg.eigvals(np.linalg.solve(np.diag([rotor, INERTIA]), stiffness)).real)
        assert [numbers_.lower.y[i], numbers_.upper.y[i]] == pytest.approx(np.sqrt(squares), rel=3e-3)
    assert numbers_.matched == pytest.approx(105.96, abs=0.05)
    assert numbers_.crossover == pytest.approx(8.27e5 * 0.1129848, rel=5e-3)


@pytest.mark.slow  # its fixture: of all figures, where a source has changed
def test_simple_responses_by_hand(found: dict[str, Any]) -> None:
    simple = found["5.3"]
    assert simple.steady_error == pytest.approx(20.0 / 4.0)  # G_P K = 3
    assert simple.time_constant == pytest.approx(0.2)
    assert np.interp(0.2, simple.integral.x, simple.integral.y) == pytest.approx(
        20.0 * (1.0 - math.exp(-1.0)), abs=0.01
    )


@pytest.mark.slow  # its fixture: of all figures, where a source has changed
def test_stairs_are_as_high_as_5_8_says(found: dict[str, Any]) -> None:
    stairs = found["5.5"]
    zeta = 24.0 / (2.0 * math.sqrt((K_TR + K_C) * INERTIA))
    jump = (1.0 + math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta**2))) * 3.0 * K_C / (K_TR + K_C)
    heights = np.abs(np.diff(stairs.jumps[1]))
    np.testing.assert_allclose(heights[heights > 0.0], jump, rtol=2e-3)
    late = stairs.force.plant_y[len(stairs.force.plant_y) // 2 :]
    assert np.ptp(late) == pytest.approx(jump, rel=0.03)  # the exact slip has the motor moving on
    assert len(heights[heights > 0.0]) > 5


@pytest.mark.slow  # its fixture: of all figures, where a source has changed
def test_describing_function_is_the_transfer_of_the_state_equations(found: dict[str, Any]) -> None:
    curves = found["5.7"]
    for gamma, curve in zip((0.6, 1.5), curves.curves, strict=True):
        a = np.array([[0.0, 1.0, 0.0], [-4.0, -1.0, 2.0], [-2.0 * gamma, 0.0, 0.0]])  # J = b = K = 1, k_tr = k_c = 2
        for omega in (0.6, 2.0, 2.5):
            value = np.linalg.solve(1j * omega * np.eye(3) - a, [0.0, 1.0, 0.0])[1]
            away = np.abs(curve.x + 1j * curve.y - value).min()
            assert away < 0.01, (gamma, omega)
    assert curves.crossing == pytest.approx(-2.0)


@pytest.mark.slow  # its fixture: of all figures, where a source has changed
def test_bound_has_the_numbers_of_the_errata(found: dict[str, Any]) -> None:
    map_ = found["5.8"]
    heights = np.interp([1.1, 1.5, 2.0], map_.bound.x, map_.bound.y)
    assert heights == pytest.approx([1 / 25.3, 1 / 3.45, 1 / 1.17], rel=5e-3)
    assert (map_.gamma_3, map_.point_b) == pytest.approx((2.186, 1.356), abs=1e-3)
    assert map_.bound.y[-1] == pytest.approx(1.356, rel=5e-3)
    assert map_.with_stiction[0][-1] < map_.gamma_3  # point B moves to the left


@pytest.mark.slow  # its fixture: of all figures, where a source has changed
def test_half_cycles_shrink_by_psi_and_the_motor_goes_on(found: dict[str, Any]) -> None:
    response = found["5.9"]
    force = response.force
    flat = force.y[1:][np.abs(np.diff(force.y)) < 1e-12]  # stuck
    levels = np.abs(flat[np.insert(np.abs(np.diff(flat)) > 1e-3, 0, True)] - 20.0)
    np.testing.assert_allclose(levels, 20.0 * 0.675704607 ** np.arange(levels.size), rtol=1e-6)
    assert levels.size > 5
    # (5.20), which the slip itself, with the motor moving on, still exceeds a little
    late = response.motor.y[response.motor.x > 1.0]
    assert np.ptp(late) == pytest.approx(2.0 * 18.5 / K_TR, rel=0.03)
    assert found["5.11"].gamma == 1.5


@pytest.mark.slow  # its fixture: of all figures, where a source has changed
def test_lost_contact_closes_its_cycle(found: dict[str, Any]) -> None:
    cycle = found["5.10"].cycle
    assert cycle.x[0] == pytest.approx(cycle.x[-1], abs=1e-6 * np.ptp(cycle.x))
    assert cycle.y[0] == pytest.approx(cycle.y[-1], rel=1e-3)
    assert cycle.x.min() < -20.0 < 20.0 < cycle.x.max()


@pytest.mark.slow  # its fixture: of all figures, where a source has changed
def test_cables_by_hand(found: dict[str, Any]) -> None:
    efficiency, creep = found["6-efficiency"], found["6-creep"]
    # section 6.4.5: 60 in-lb, two stages
    assert np.interp(60.0 * 0.1129848, efficiency.testbed.x, efficiency.testbed.y) == pytest.approx(0.966, abs=1e-3)
    assert efficiency.equal_stages[2, -1] == pytest.approx(0.97**3)
    assert np.interp(creep.reversal, creep.creep.x, creep.creep.y) == pytest.approx(0.5 * creep.creep.y[-1], rel=1e-6)


@pytest.mark.slow
def test_every_picture_is_in_the_docs_and_can_be_drawn(found: dict[str, Any], tmp_path: Path) -> None:
    page = (ROOT / "docs" / "figures.md").read_text(encoding="utf-8")
    for name, values in found.items():
        kept = file_of(name, ROOT / "docs" / "figures")
        assert kept.is_file(), "run 'make docs'"
        assert f"figures/{kept.name}" in page
        FIGURES[name].draw(values, file_of(name, tmp_path))
        assert file_of(name, tmp_path).stat().st_size > 20_000
    assert table(found).count("\n") > len(FIGURES)


@pytest.mark.slow
def test_command_draws_what_is_named_and_refuses_what_is_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--fresh", "--jobs", "1", "--to", str(tmp_path)]
    with pytest.raises(SystemExit) as ended:
        main(["evaluate", "figures", *options, "3.1"])
    assert ended.value.code == 0
    assert [path.name for path in tmp_path.iterdir()] == ["figure-3.1.png"]
    assert capsys.readouterr().err.endswith("figures: 1 of 1\n")
    with pytest.raises(SystemExit) as ended:
        main(["evaluate", "figures", *options, "5.4"])
    assert ended.value.code == 1
    assert "no figure 5.4; choose from 1.1, 2.1.1, 2.1.2, 3.1" in capsys.readouterr().err
