"""docs/thesis.md: every item leads to what shows it, or says why nothing does; no section is left out."""

import re
from pathlib import Path

import pytest

from wam_studies.thesis.claims import PLACE, Claim, Status, count, load, table, unresolved

ROOT = Path(__file__).resolve().parents[2]
CLAIMS = [claim for rows in load(ROOT / "docs" / "thesis.yaml").values() for claim in rows]
# those that claim something
SECTIONS = """
1.1.1 2.1.1 2.1.2 2.2 2.3 3.1 3.1.2 3.2.1 3.2.2 3.2.3 3.2.4 3.2.5 3.2.6 4.1.1 4.1.2 4.2 4.3.1 4.3.2
4.4 5.1.2 5.2 5.3 5.4 5.5 5.5.1 5.5.2 5.5.3 5.5.4 5.6 5.7 6.2.2 6.2.3 6.2.4 6.2.5 6.3.1 6.3.2 6.4.1
6.4.2 6.4.3 6.4.4 6.4.5 6.5 7.2.1 7.2.2 7.3
"""


def test_every_reference_leads_somewhere() -> None:
    found = [(c.section, why) for c in CLAIMS for name in c.shown if (why := unresolved(name, ROOT))]
    assert not found


def test_every_section_that_claims_something_has_a_row() -> None:
    named = {number for claim in CLAIMS for number in re.findall(r"\d(?:\.\d)+", claim.section)}
    assert set(SECTIONS.split()) <= named


@pytest.mark.parametrize("reference", [
    "experiment nothing", "task nothing", "figure 9.9", "effect nothing", "test test_scorecard.test_nothing",
    "test test_nothing.test_nothing", "docs/nothing.md", "wam_theory.stiction.nothing", "wam_theory.nothing",
])  # fmt: skip
def test_a_reference_that_leads_nowhere_is_named(reference: str) -> None:
    assert reference.split()[-1] in unresolved(reference, ROOT)


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("{section: 5.2, claim: text, status: plant}", "give it 'shown'"),
        ("{section: 5.2, claim: text, status: plant, shown: [docs/a.md]}", "give it 'shown'"),
        ("{section: 5.2, claim: text, status: not shown}", "'open' must state why"),
        ("{section: 5.2, claim: text, status: perhaps}", "perhaps"),
        ("{section: 5.2, claim: text, status: plant, near: 1 %}", "near"),
        ("{section: 5.2, claim: text, status: plant, shown: docs/a.md}", "must be a list"),
    ],
)
def test_an_item_without_what_its_status_needs_is_refused(tmp_path: Path, row: str, message: str) -> None:
    file = tmp_path / "claims.yaml"
    file.write_text(f"Chapter:\n- {row}\n", encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        load(file)


def test_every_distance_that_an_item_gives_is_that_of_something_it_shows() -> None:
    """The plant or an own computation; what is theory or was put in has no recording."""
    for claim in CLAIMS:
        for kind, name in PLACE.findall(claim.agreement):
            assert f"{kind} {name}" in claim.shown, claim
        kinds = {reference.partition(" ")[0] for reference in claim.shown}
        assert not (claim.status is Status.THEORY and "experiment" in kinds), claim
        of_plant = {"experiment", "task", "figure", "effect", "test"} & kinds or "wam_studies" in str(claim.shown)
        assert claim.status is not Status.PLANT or of_plant, claim


def test_the_tables_have_every_item_with_its_status_what_shows_it_and_what_is_open() -> None:
    shown = Claim(
        "5.2", "text", Status.PLANT, "plant with law: {figure a}", ("figure a", "wam_theory.cable.creep"), "b"
    )
    missing = Claim("5.3", "other", Status.NOT_SHOWN, open="why")
    assert "| One | 1 | 0 | 0 | 1 |\n| all | 1 | 0 | 0 | 1 |" in count({"One": [shown, missing]})
    text = table([shown, missing], {"figure a": "3 %"})
    assert text.splitlines()[1:] == [
        "5.2,text,plant,[a](figures/figure-a.png),Plant with law: 3 %. B",
        "5.3,other,not shown,,Why",
    ]
