"""No program compares with text that is made for people: what happened is an event, with a code and values."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXTS = {"message", "fault", "reason", "failure"}  # attributes that hold sentences
PARTING = {"startswith", "endswith", "split", "rsplit", "partition", "rpartition", "find", "index", "count"}
REGULAR = {"search", "match", "fullmatch", "findall", "finditer", "split", "sub"}


def is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Attribute) and node.attr in TEXTS


def is_word(node: ast.AST) -> bool:
    """Whether this is a text that is not empty, or a constant that may be one."""
    if isinstance(node, ast.Constant):
        return isinstance(node.value, str) and bool(node.value)
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Name) and node.id.isupper())


def readings(source: str) -> Iterator[int]:
    """Lines on which a text made for people is compared, searched or taken apart."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Compare):
            operands = [node.left, *node.comparators]
            searches = [type(one) in (ast.In, ast.NotIn) for one in node.ops]
            searched = any(found and is_text(one) for found, one in zip(searches, node.comparators, strict=True))
            if searched or (any(map(is_text, operands)) and any(map(is_word, operands))):
                yield node.lineno
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            parted = node.func.attr in PARTING and is_text(node.func.value)
            if parted or (node.func.attr in REGULAR and any(map(is_text, node.args))):
                yield node.lineno


@pytest.mark.parametrize(
    "source",
    [
        "'stop' in status.message",
        "status.message == DONE",
        "safety.fault != 'stopped'",
        "one.reason.partition(';')",
        "re.search('x', answer.message)",
        "NUMBERS.sub('', why.reason)",
    ],
)
def test_a_reading_of_a_text_is_found(source: str) -> None:
    assert list(readings(source)) == [1]


@pytest.mark.parametrize("source", ["not status.fault", "columns.message == at", "status.message == before.message"])
def test_what_does_not_read_the_words_is_not(source: str) -> None:
    assert not list(readings(source))


def test_no_program_reads_text_that_is_made_for_people() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{line}"
        for path in sorted(ROOT.glob("wam_*/**/*.py"))
        for line in readings(path.read_text(encoding="utf-8"))
    ]
    assert found == []
