"""The harness: seeds, resume, marks, the page, and a study of a newcomer in one file."""

import importlib.util
import math
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import ClassVar, NamedTuple

import pytest
from arms import CONFIGURATION

from wam_analysis.table import markdown
from wam_cli.main import main
from wam_description.configuration import Configuration, packaged
from wam_description.parameters import parameter
from wam_studies.harness import STUDIES, Measurement, Study, chosen_cases, evaluate, load
from wam_studies.page import block, kept_rows, report, section_of, with_section
from wam_studies.scores import (
    ANY,
    FEW,
    MARGINAL,
    MET,
    MISSED,
    MISSED_MARGINAL,
    NONE_AT_ALL,
    TARGET_MET,
    TARGET_MISSED,
    Bound,
    Interval,
    Row,
    Scores,
    ScoreTable,
    events,
    exact,
    quantile,
    share,
)

ROOT = Path(__file__).resolve().parents[2]
run_cases: list[tuple[int, int]] = []


class Square(NamedTuple):
    """A number of a seed, and its square."""

    seed: int
    number: int
    value: float


def squared(case: tuple[int, int]) -> Square:
    run_cases.append(case)
    return Square(*case, float(case[1]) ** 2)


@dataclass(frozen=True)
class SquareStudy(Study[tuple[int, int], Square]):
    """Squares of the numbers from a seed on, without end."""

    title: ClassVar[str] = "squares"
    count: ClassVar[int | None] = 3
    limit: float = parameter("largest square allowed", low=1.0, default=5.0)
    run = staticmethod(squared)

    def cases(self, seed: int) -> Iterator[tuple[int, int]]:
        number = 0
        while True:
            yield seed, number
            number += 1

    def score(self, records: Sequence[Square]) -> Scores:
        largest = exact(max(r.value for r in records), len(records))
        rows = [Row("largest", largest, "m", required=(0.0, self.limit))]
        return Scores(rows, [ScoreTable("Numbers", ("n",), [[str(r.number)] for r in records])])

    def failure(self, record: Square) -> str:
        return f"{record.value:g}" if record.value > self.limit else ""


def measured(file: Path | None = None, seeds: Sequence[int] = (1, 2), count: int | None = None) -> Measurement:
    study = SquareStudy(CONFIGURATION)
    with ThreadPoolExecutor(1) as executor:
        return evaluate(study, {seed: chosen_cases(study, seed, count) for seed in seeds}, executor, file)


def test_records_are_by_seed_in_the_order_of_the_cases() -> None:
    found = measured()
    assert {seed: [r.number for r in own] for seed, own in found.records.items()} == {1: [0, 1, 2], 2: [0, 1, 2]}
    assert [r.seed for r in found.total] == [1, 1, 1, 2, 2, 2]
    study = SquareStudy(CONFIGURATION)
    assert chosen_cases(study, 7, numbers=[5, 0]) == [(7, 5), (7, 0)]


def test_a_study_that_was_stopped_goes_on_from_its_file(tmp_path: Path) -> None:
    run_cases.clear()
    first = measured(tmp_path / "r.jsonl", [1])
    again = measured(tmp_path / "r.jsonl", [1, 2], 4)
    assert again.records[1][:3] == first.records[1]
    assert run_cases == [(1, 0), (1, 1), (1, 2), (1, 3), (2, 0), (2, 1), (2, 2), (2, 3)]


def test_a_missed_value_and_each_failed_case_with_its_command_are_printed() -> None:
    found = measured(count=4)
    assert found.scores.missed == ["largest: 9 m, required ≤5"]
    text = report(found, "wam evaluate square")
    assert "| largest | m | ≤5 |  | 9 | 9 | 9 |  | 8 | **MISSED** |" in text
    assert "* seed 2, case 3: 9\n  `wam evaluate square --seeds 2 --only 3`" in text
    assert "## Numbers" in text


def test_a_page_keeps_what_is_around_the_section(tmp_path: Path) -> None:
    file = tmp_path / "page.md"
    text = block(measured(), "wam evaluate square --write page.md", "page/square.png")
    file.write_text(with_section(file, "square", text, "Squares"))
    assert file.read_text().startswith("# Squares\n")
    file.write_text(file.read_text() + "\n## Method\n\nBy hand.\n")
    file.write_text(with_section(file, "square", "nothing"))
    assert section_of(file, "square") == "nothing\n"
    assert kept_rows("nothing") == {}
    assert kept_rows(markdown(("row", "b"), [("|F|", "1 | 2")])) == {"|F|": ["|F|", "1 | 2"]}
    assert kept_rows(text)["largest"][:4] == ["largest", "m", "≤5", ""]
    assert file.read_text().endswith("## Method\n\nBy hand.\n")
    with pytest.raises(ValueError, match="has no line '<!-- written: other -->'"):
        with_section(file, "other", "")
    for words in ("`wam evaluate square --write page.md`: 6 cases", "![squares](page/square.png)", "Every required"):
        assert words in text
    assert "| largest | m | ≤5 |  | 4 |" in text
    assert "## Numbers" not in text


@pytest.mark.parametrize("name", STUDIES)
def test_every_study_names_a_page_that_has_its_section(name: str) -> None:
    kind = load(name)
    assert kind.page.startswith("docs/"), f"give {kind.__name__} the page of its result: page = 'docs/PAGE.md'"
    assert section_of(ROOT / kind.page, name), f"missing: wam evaluate {name} --write {kind.page} makes it"


TO_TWO, TO_ONE = (0.0, 2.0), (0.0, 1.0)


@pytest.mark.parametrize(("required", "target", "found", "mark"), [
    (TO_TWO, TO_ONE, Interval(0.9, 0.8, 1.4, 50), TARGET_MET), (TO_TWO, TO_ONE, Interval(1.5, 1.2, 1.9, 50), MET),
    (TO_TWO, TO_ONE, Interval(1.5, 1.2, 2.1, 50), MARGINAL), (TO_TWO, TO_ONE, Interval(2.5, 2.2, 3.1, 50), MISSED),
    (TO_TWO, TO_ONE, Interval(2.5, 1.2, 3.1, 50), MISSED_MARGINAL), (TO_TWO, TO_ONE, quantile([0.5], 0.5), FEW),
    (TO_TWO, TO_ONE, Interval(math.nan, math.nan, math.nan, 0), "no data"),
    (ANY, TO_ONE, Interval(1.5, 1.2, 1.9, 50), TARGET_MISSED), (ANY, ANY, share(1, 2), ""),
    (NONE_AT_ALL, NONE_AT_ALL, events(0, 60.0), FEW), (NONE_AT_ALL, NONE_AT_ALL, events(0, 130.0), MET),
    (NONE_AT_ALL, NONE_AT_ALL, events(0, 700.0), TARGET_MET), (NONE_AT_ALL, NONE_AT_ALL, events(1, 700.0), MISSED),
])  # fmt: skip
def test_a_mark_compares_value_and_interval_with_what_is_allowed(
    required: Bound, target: Bound, found: Interval, mark: str
) -> None:
    assert Row("x", found, required=required, target=target, enough=(120.0, 600.0)).mark == mark


@pytest.mark.parametrize(
    ("found", "bound", "few"),
    [(exact(1.0, 3), TO_TWO, ""), (share(3, 3), TO_TWO, " (n=3: too few)"), (share(30, 30), TO_TWO, "")],
)
def test_a_greatest_value_of_three_cases_is_certain_and_a_share_is_not(found: Interval, bound: Bound, few: str) -> None:
    assert Row("x", found, required=bound).verdict == f"{MET}{few}"
    assert Row("x", exact(0.0, 3), required=NONE_AT_ALL).verdict == f"{MET} (n=3: too few)"


@pytest.fixture
def example(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The study of a newcomer."""
    spec = importlib.util.spec_from_file_location("study", ROOT / "examples" / "study.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "study", module)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_a_newcomer_adds_a_study_of_three_cases_in_one_file_of_60_lines(example: ModuleType) -> None:
    assert len((ROOT / "examples" / "study.py").read_text().splitlines()) <= 60
    study = example.PressStudy(Configuration.load(packaged("testbed")))
    with ThreadPoolExecutor(1) as executor:
        found = evaluate(study, {1: chosen_cases(study, 1)}, executor)
    assert len(found.total) == 3
    assert found.scores.missed == []


def test_the_options_of_a_study_are_those_of_the_harness_and_its_fields(
    example: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from wam_cli.commands.evaluate import program

    monkeypatch.setattr(sys, "argv", ["study.py", "--seconds", "0.5"])
    with pytest.raises(SystemExit):
        program("press", example.PressStudy)
    assert "argument --seconds: '0.5' is not allowed; give a number from 1 to 1e+09" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ("--only -3", "argument --only: '-3' is not allowed"),
        ("--set timing.mode=realtime", "--set timing.mode has no effect in runs without ROS"),
        ("--set force_loop:contact_source=pinned", "has no effect here: each case sets it"),
    ],
)
def test_a_wrong_option_is_refused_in_a_sentence(
    words: str, reason: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    with pytest.raises(SystemExit) as end:
        main(["evaluate", "force", "--results", str(tmp_path / "results.jsonl"), *words.split()])
    assert end.value.code in (1, 2)
    assert reason in capsys.readouterr().err
