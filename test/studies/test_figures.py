"""The figures' numbers: the plant on the lines, the lines recomputed by hand.

Some 15 s, once: pieces that docs/figures.md has needed are taken from where it keeps them.
"""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from wam_cli.main import main
from wam_sim.batch import processes
from wam_sim.pieces import default_file
from wam_studies.figures.catalogue import FIGURES, file_of, numbers, table
from wam_studies.figures.panels import Mark, Panel, Panels, Series, distances
from wam_studies.figures.style import draw_panels

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def found() -> dict[str, Panels]:
    with processes() as executor:
        return numbers(list(FIGURES), executor, default_file("figures"))


@pytest.mark.slow
@pytest.mark.parametrize("name", FIGURES)
def test_points_of_the_plant_lie_on_the_lines(found: dict[str, Panels], name: str) -> None:
    distance = distances(found[name])
    assert all(value < 0.02 for value in distance.values()), distance
    assert distance or name in ("2.1.1", "3.1", "3.2.6")  # bounds, geometry and inertia


def test_a_point_beside_the_line_is_noticed() -> None:
    x = np.linspace(1.0, 11.0, 50)
    series = Series(x, 4.0 * x, x[::7], 4.0 * x[::7])
    assert [series.distance, series.relative_distance(True)] == pytest.approx([0.0, 0.0], abs=1e-12)
    moved = series._replace(plant_y=series.plant_y + np.eye(1, len(series.plant_x), 3)[0] * 4.0)
    assert moved.distance == pytest.approx(0.1 / math.sqrt(2.0), rel=1e-6)  # across a line at 45 degrees
    assert moved.relative_distance(False) == moved.relative_distance(True) == pytest.approx(1.0 / x[21])


# figure, panel, line; x; y, and its tolerance
BY_HAND = [
    ("3.1", 0, "μ = 0.4", 10.0, 0.875, 1e-3),  # 1 - 0.05/0.4
    ("3.1", 1, "μ = 0.4", 10.0, 0.7, 1e-3),  # 0.8 - 0.1
    ("3.1", 0, "μ = 0.2", 2.0, 0.0, 1e-12),
    ("5.3", 0, "(5.1)", 1.0, 20.0 - 20.0 / 4.0, 1e-9),  # G_P K = 3
    ("5.3", 1, "(5.2)", 0.2, 20.0 * (1.0 - math.exp(-1.0)), 0.01),
    ("5.8", 0, "ζ = 0.25, Coulomb friction", 1.1, 1.0 / 25.3, 2e-4),
    ("5.8", 0, "ζ = 0.25, Coulomb friction", 1.5, 1.0 / 3.45, 1.5e-3),
    ("5.8", 0, "ζ = 0.25, Coulomb friction", 2.0, 1.0 / 1.17, 4e-3),
    ("6-efficiency", 0, "(6.15)", 60.0 * 0.1129848, 0.966, 1e-3),  # 6.4.5: 60 in-lb, two stages
    ("6-efficiency", 1, "n = 3", 3.0, 0.97**3, 1e-6),
]


@pytest.mark.slow  # its fixture: of all figures, where a source has changed
@pytest.mark.parametrize(("name", "panel", "label", "x", "y", "within"), BY_HAND)
def test_line_is_that_of_a_computation_by_hand(
    found: dict[str, Panels], name: str, panel: int, label: str, x: float, y: float, within: float
) -> None:
    line = found[name][panel].line(label)
    assert np.interp(x, line.x, line.y) == pytest.approx(y, abs=within)


def mark_of(panel: Panel, text: str) -> Mark:
    return next(mark for mark in panel.marks if mark.text.startswith(text))


# figure; mark; x and y
MARKED = [
    ("4.9", "(4.9)", 8.27e5 * 0.1129848, math.nan),
    ("5.3", "F_des", math.nan, 20.0),
    ("5.7", "unstable limit cycle", -2.0, 0.0),
    ("5.8", "B", 2.186, 1.356),
]


@pytest.mark.slow  # its fixture: of all figures, where a source has changed
@pytest.mark.parametrize(("name", "text", "x", "y"), MARKED)
def test_mark_is_where_the_thesis_or_the_errata_have_it(
    found: dict[str, Panels], name: str, text: str, x: float, y: float
) -> None:
    mark = mark_of(found[name][0], text)
    assert (mark.x, mark.y) == pytest.approx((x, y), rel=5e-3, abs=1e-9, nan_ok=True)


@pytest.mark.slow  # its fixture: of all figures, where a source has changed
def test_point_b_moves_to_the_left_with_stiction(found: dict[str, Panels]) -> None:
    (panel,) = found["5.8"]
    assert mark_of(panel, "B with").x < mark_of(panel, "B").x
    assert panel.lines[0][1].y[-1] == pytest.approx(1.356, rel=5e-3)


@pytest.mark.slow
def test_every_picture_is_in_the_docs_and_can_be_drawn(found: dict[str, Panels], tmp_path: Path) -> None:
    page = (ROOT / "docs" / "figures.md").read_text(encoding="utf-8")
    for name, values in found.items():
        kept = file_of(name, ROOT / "docs" / "figures")
        assert kept.is_file(), "run 'make docs'"
        assert f"figures/{kept.name}" in page
        draw_panels(values, file_of(name, tmp_path))
        assert file_of(name, tmp_path).stat().st_size > 20_000
        assert all(re.search(r"\[.+\]", axis) for panel in values for axis in (panel.x, panel.y)), name
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
