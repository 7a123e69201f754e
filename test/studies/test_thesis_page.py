"""docs/thesis.md: every row leads to what shows it, or says why nothing does; no section is left out."""

import re
from pathlib import Path

import pytest

from wam_studies.thesis.claims import Claim, deviations_in, distances_in, load, near_of, unresolved

ROOT = Path(__file__).resolve().parents[2]
CLAIMS = [claim for rows in load(ROOT / "docs" / "thesis.yaml").values() for claim in rows]
SECTIONS = [
    "1.1.1",
    "2.1.1",
    "2.1.2",
    "2.2",
    "2.3",
    "3.1",
    "3.1.2",
    "3.2.1",
    "3.2.2",
    "3.2.3",
    "3.2.4",
    "3.2.5",
    "3.2.6",
    "4.1.1",
    "4.1.2",
    "4.2",
    "4.3.1",
    "4.3.2",
    "4.4",
    "5.1.2",
    "5.2",
    "5.3",
    "5.4",
    "5.5",
    "5.5.1",
    "5.5.2",
    "5.5.3",
    "5.5.4",
    "5.6",
    "5.7",
    "6.2.2",
    "6.2.3",
    "6.2.4",
    "6.2.5",
    "6.3.1",
    "6.3.2",
    "6.4.1",
    "6.4.2",
    "6.4.3",
    "6.4.4",
    "6.4.5",
    "6.5",
    "7.2.1",
    "7.2.2",
    "7.3",
]  # those that claim something


def test_every_reference_leads_somewhere() -> None:
    found = [(c.section, why) for c in CLAIMS for name in c.shown if (why := unresolved(name, ROOT))]
    assert not found


def test_every_section_that_claims_something_has_a_row() -> None:
    named = {number for claim in CLAIMS for number in re.findall(r"\d(?:\.\d)+", claim.section)}
    assert set(SECTIONS) <= named


@pytest.mark.parametrize(
    "reference",
    [
        "experiment nothing",
        "task nothing",
        "figure 9.9",
        "effect nothing",
        "test test_scorecard.test_nothing",
        "test test_nothing.test_nothing",
        "docs/nothing.md",
        "wam_theory.stiction.nothing",
        "wam_theory.nothing",
    ],
)
def test_a_reference_that_leads_nowhere_is_named(reference: str) -> None:
    assert reference.split()[-1] in unresolved(reference, ROOT)


@pytest.mark.parametrize(
    ("row", "message"), [('[5.2, text, "", "", ""]', "no reason"), ("[5.2, text, a]", "has 3 cells")]
)
def test_a_row_without_reference_and_reason_is_refused(tmp_path: Path, row: str, message: str) -> None:
    file = tmp_path / "claims.yaml"
    file.write_text(f"Chapter:\n- {row}\n", encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        load(file)


def test_references_are_separated_by_semicolons(tmp_path: Path) -> None:
    file = tmp_path / "claims.yaml"
    file.write_text("Chapter:\n- [5.2, text, docs/a.md; figure 5.8, 1 %, why]\n", encoding="utf-8")
    assert load(file)["Chapter"] == (Claim("5.2", "text", ("docs/a.md", "figure 5.8"), "1 %", "why"),)


def test_every_distance_that_a_row_gives_is_that_of_something_it_shows() -> None:
    figures = distances_in((ROOT / "docs" / "figures.md").read_text(encoding="utf-8"))
    effects = distances_in((ROOT / "docs" / "plant.md").read_text(encoding="utf-8"))
    experiments = deviations_in((ROOT / "docs" / "experiments.md").read_text(encoding="utf-8"))
    measured = {"figure": figures, "effect": effects, "experiment": experiments}
    assert sum(near_of(claim, measured) != claim.near for claim in CLAIMS) > 20


def test_the_greatest_distance_counts() -> None:
    claim = Claim("5.2", "text", ("figure a", "figure b", "effect a"), "{figure} and {effect}", "")
    figures = distances_in("| a | x | 0.1 % |\n| a | y | 2 % |\n| b | z | below 0.5 % |\n| c | z | 9 % |")
    assert near_of(claim, {"figure": figures, "effect": {"a": "3 %"}}) == "2 % and 3 %"
    page = "<!-- experiment: e -->\n| q | 1 | 2 | N | -0.30 % | 2 % | |\n| r | 1 | 2 | N | +9 % |  | |\n<!-- end -->"
    assert deviations_in(page) == {"e": "0.30 %"}
    with pytest.raises(ValueError, match="no experiment that it shows"):
        near_of(claim._replace(near="{experiment}"), {"experiment": {}})
