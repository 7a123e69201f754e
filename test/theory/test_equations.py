"""No numbered equation is lost: each is a function that is tested, or says why not; errata have each correction."""

import importlib
import importlib.util
import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from wam_theory.equations import EQUATIONS

ROOT = Path(__file__).resolve().parents[2]
LAST = {2: 2, 3: 3, 4: 10, 5: 23, 6: 23}  # last equation of each chapter
ERRATA = (ROOT / "docs" / "errata.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def generate() -> Any:
    spec = importlib.util.spec_from_file_location("generate", ROOT / "docs" / "generate.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def public_functions() -> Iterator[tuple[str, Any]]:
    for path in sorted(ROOT.glob("wam_theory/*.py")):
        module = importlib.import_module(f"wam_theory.{path.stem}")
        for name, function in inspect.getmembers(module, inspect.isfunction):
            if function.__module__ == module.__name__ and not name.startswith("_"):
                yield f"{path.stem}.{name}", function


def test_every_number_in_the_ranges_is_in_the_table_once() -> None:
    expected = [f"{chapter}.{n}" for chapter, last in LAST.items() for n in range(1, last + 1)]
    assert [row.number for row in EQUATIONS] == expected
    assert [row.number for row in EQUATIONS if row.reason] == ["6.21"]


def test_every_equation_is_a_function_with_a_test_or_has_a_reason(generate: Any) -> None:
    citing, using = generate.citing(), generate.tests_by_function()
    assert set(citing) <= {row.number for row in EQUATIONS}, "a first line cites an equation that does not exist"
    for row in EQUATIONS:
        assert bool(citing.get(row.number)) is not bool(row.reason), f"({row.number})"
    for number, names in citing.items():
        for name in names:
            assert using.get(name.split(".")[1]), f"{name} is ({number}) and no equation test uses it"


def test_a_lost_citation_or_test_is_noticed(generate: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for folder in ("wam_theory", "test/theory"):
        (tmp_path / folder).mkdir(parents=True)
        for path in ROOT.glob(f"{folder}/*.py"):
            text = path.read_text(encoding="utf-8").replace("Strain of a strand, (6.1)", "Strain of a strand")
            (tmp_path / folder / path.name).write_text(text.replace(".slip_arc", ".other"), encoding="utf-8")
    monkeypatch.setattr(generate, "ROOT", tmp_path)
    assert "6.1" not in generate.citing()
    assert "6.2" in generate.citing()
    assert "slip_arc" not in generate.tests_by_function()


def test_every_argument_of_a_public_function_stands_in_its_docstring() -> None:
    for name, function in public_functions():
        text = function.__doc__ or ""
        parameters = text.partition("Parameters\n")[2]
        for argument in inspect.signature(function).parameters.values():
            if argument.kind is argument.VAR_KEYWORD or "arguments as in `" in text:
                continue
            assert re.search(rf"\b{argument.name}\b", parameters or text), f"{name}: {argument.name} is not explained"


def test_errata_have_every_corrected_equation() -> None:
    rows = [line for line in ERRATA.splitlines() if line.startswith("| ")]
    first_cells = " ".join(row.split("|")[1] for row in rows)
    for equation in EQUATIONS:
        if equation.correction:
            assert f"({equation.number})" in first_cells, f"({equation.number}) is corrected and not in errata.md"
