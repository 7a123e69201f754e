"""No program compares with text that is made for people: what happened is an event, with a code and values."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXTS = {"message", "fault", "reason", "failure"}  # attributes that hold sentences
PARTING = {"startswith", "endswith", "split", "rsplit", "partition", "rpartition", "find", "index", "count"}
REGULAR = {"search", "match", "fullmatch", "findall", "finditer", "split", "sub"}


def texts(tree: ast.AST) -> set[ast.AST]:
    """Expressions that are texts: attributes, str() of an exception that was caught, and names of either."""
    found = {one for one in ast.walk(tree) if isinstance(one, ast.Attribute) and one.attr in TEXTS}
    for function in [one for one in ast.walk(tree) if isinstance(one, ast.FunctionDef)] or [tree]:
        inside = list(ast.walk(function))
        caught = {one.name for one in inside if isinstance(one, ast.ExceptHandler)}
        found |= {one for one in inside if isinstance(one, ast.Call) and is_str_of(one, caught)}
        given = [one for one in inside if isinstance(one, ast.Assign | ast.NamedExpr) and one.value in found]
        names = {to.id for one in given for to in ast.walk(one) if isinstance(to, ast.Name) and is_set(to)}
        found |= {one for one in inside if isinstance(one, ast.Name) and one.id in names and not is_set(one)}
    return found


def is_set(node: ast.Name) -> bool:
    return isinstance(node.ctx, ast.Store)


def is_str_of(call: ast.Call, caught: set[str | None]) -> bool:
    names = {one.id for one in [call.func, *call.args] if isinstance(one, ast.Name)}
    return "str" in names and bool(names & caught)


def is_word(node: ast.AST) -> bool:
    """Whether this is a text that is not empty, or a constant that may be one."""
    if isinstance(node, ast.Constant):
        return isinstance(node.value, str) and bool(node.value)
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Name) and node.id.isupper())


def readings(source: str) -> Iterator[int]:
    """Lines on which a text made for people is compared, searched or taken apart."""
    tree = ast.parse(source)
    is_text = texts(tree).__contains__
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            operands = [node.left, *node.comparators]
            searches = [type(one) in (ast.In, ast.NotIn) for one in node.ops]
            searched = any(found and is_text(one) for found, one in zip(searches, node.comparators, strict=True))
            if searched or (any(map(is_text, operands)) and any(map(is_word, operands))):
                yield node.lineno
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            words = any(not isinstance(one, ast.Constant) or str(one.value).strip() for one in node.args)
            parted = node.func.attr in PARTING and words and is_text(node.func.value)
            if parted or (node.func.attr in REGULAR and any(map(is_text, node.args))):
                yield node.lineno


@pytest.mark.parametrize("source", [
    "'stop' in status.message",
    "status.message == DONE",
    "safety.fault != 'stopped'",
    "one.reason.partition(';')",
    "re.search('x', answer.message)",
    "NUMBERS.sub('', why.reason)",
    "def f():\n try: g()\n except ValueError as error: return 'name' in str(error)",
    "def f(status):\n text = status.message\n return text.split(';')",
])  # fmt: skip
def test_a_reading_of_a_text_is_found_and_nothing_else(source: str) -> None:
    assert list(readings(source)) == [len(source.splitlines())]
    others = "not status.fault; columns.message == at; status.message == before.message; status.message.split()"
    assert not list(readings(others))


def test_no_program_reads_text_that_is_made_for_people() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{line}"
        for path in sorted(ROOT.glob("wam_*/**/*.py"))
        for line in readings(path.read_text(encoding="utf-8"))
    ]
    assert found == []
