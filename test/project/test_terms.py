"""Texts for users are written in the field's terms: the dictionary of what not to write, and what instead."""

import ast
import re
import tokenize
from collections.abc import Iterator
from io import StringIO
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# what is not written, as a regular expression between word boundaries -> what to write
TERMS = {
    r"feel|feels|felt|feeling": "detect, estimate; detected, estimated; 'felt after' is the detection latency",
    r"told": "reported, known, identified",
    r"said": "reported, published, printed",
    r"asked|asks for": "commanded, desired, requested",
    r"say(?! :)|says|saying": "report, state, print, show, mean",  # 'say :' is a parameter of a function
    r"tell(?! :)|tells|telling": "show, report, name; tell apart is distinguish",
    r"remember|remembers|remembered": "keep; state",
    r"(?:contact|estimated|pinned|commanded|configured|given|true|touched|pressed|last certain|which) places?"
    r"|pins? (?:the|a) place|(?:direction|load) (?:and|or) place"
    r"|(?<!in )(?<!takes the )places? of (?:the|a|one) (?:contact|force|push)"
    r"|(?:one|a|the same) place (?:of|on|along) (?:the|a) (?:arm|link|cover)|place along|at the place x"
    r"|(?:NaN with|error dx of) the place|press in \w+ places": "contact position along the link",
    r"applied by the simulator|(?:the|an) applied (?:force|contact|push|position|link)": "true (in the simulator)",
    r"(?:force|torque|joint|motor)s? miss(?:es)?": "tangential component, moment-arm offset; lacks",
    r"periods? late|come late|share of the (?:torque|dry friction|limit)": "extra delay in periods; fraction of",
    r"rooms?(?! :)": "margin; package",
    r"anew": "again",
    r"for ever": "indefinitely",
    r"to and fro": "back and forth",
    r"whoever": "the subject: which program, which node, who",
    r"dead zones?": "deadband",
    r"clockwork": "timing",
    r"does not mind|do not mind|minds": "is not affected",
    r"forsaken": "stale (command_stale)",
    r"doubtful": "rejected, uncertain (contact_rejected)",
    r"departures?|departs?": "model mismatch; the true plant differs by",
    r"rub|rubs|rubbed|rubbing": "added Coulomb friction",
    r"battery|batteries": "benchmark",
    r"judges?|judged|judging": "evaluate, assess",
    r"map of the house": "repository layout, architecture",
    r"counts? as endless|endless": "infinite",
    r"(?:gives?|giving) no way(?: at all)?": "zero compliance",
    r"(?:thin|its|node's|of the|nobody imports a) shells?": "node, ROS adapter (what wraps a controller)",
    r"the same machines?|machines that step": "controller, estimator, plant: what it is",
    r"beside": "next to, compared with, with",
    r"one YAML a \w+|(?:one|a) \w+ a configuration": "one YAML per configuration",
    r"stood|stands(?! for)|stand still|stands still": "was, is; at rest",
    r"(?:a|the|its|each) begin": "start",
    r"spreads?": "uncertainty, standard deviation, covariance",
    r"goes over from": "bumpless transfer",
    r"nobody knows of": "unmodelled payload",
    r"held against|hold .{0,20}verdicts against": "validated by, compared with",
    r"counts as told": "identified",
    r"force leans|leans": "tangential component",
}
PATTERNS = {re.compile(rf"\b(?:{words})\b", re.IGNORECASE): instead for words, instead in TERMS.items()}
NAMES = re.compile(r"(?:^|_)(?:felt|told|tells?|said|says?|asked|judged|anew|beside|stood|stands|leans)(?:_|$)")
ANY = re.compile(rf"\b(?:{'|'.join(f'(?:{words})' for words in TERMS)})\b", re.IGNORECASE)  # fast where all is well
PAGES = ("*.md", "docs/*.md", "bags/*.md", "benchmarks/*.md")
VALUES = ("config/**/*.yaml", "docs/*.yaml", "examples/*.yaml", "pyproject.toml")
MODULES = ("wam_*/**/*.py", "launch/*.py", "examples/*.py", "benchmarks/*.py", "docs/*.py")
CODE = re.compile(r"^```.*?^```|`[^`\n]*`|\]\([^)]*\)", re.DOTALL | re.MULTILINE)


def texts_of_a_page(page: str) -> Iterator[tuple[int, str]]:
    """Line and text of a page without what is code or a link's target."""
    kept = CODE.sub(lambda found: "\n" * found[0].count("\n"), page)
    yield from enumerate(kept.splitlines(), start=1)


def texts_of_a_module(source: str) -> Iterator[tuple[int, str]]:
    """Line and text of every string in a module, docstrings among them; keys of one word and code are left out."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
            for number, line in enumerate(CODE.sub("", node.value).splitlines()):
                yield node.lineno + number, line


def names_of_a_module(source: str) -> Iterator[tuple[int, str]]:
    """Line and words of every name that a module uses; those in f-strings, too."""
    for node in ast.walk(ast.parse(source)):
        for field in ("id", "arg", "attr", "name"):
            if isinstance(name := getattr(node, field, None), str):
                yield getattr(node, "lineno", 0), name


def texts_of_comments(source: str) -> Iterator[tuple[int, str]]:
    """Line and text of every comment in a module."""
    for token in tokenize.generate_tokens(StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], token.string


def found_in(texts: Iterator[tuple[int, str]], where: object) -> Iterator[str]:
    """A line for each term that is not the field's."""
    for number, text in texts:
        for pattern, instead in PATTERNS.items() if ANY.search(text) else ():
            for found in pattern.finditer(text):
                yield f"{where}:{number}: '{found[0]}', write: {instead}"


def complaints(root: Path) -> list[str]:
    """Every wrong term in the texts under root."""
    found: list[str] = []
    for path in sorted(path for pattern in PAGES for path in root.glob(pattern)):
        found += found_in(texts_of_a_page(path.read_text(encoding="utf-8")), path.relative_to(root))
    for path in sorted(path for pattern in VALUES for path in root.glob(pattern)):
        found += found_in(enumerate(path.read_text(encoding="utf-8").splitlines(), start=1), path.relative_to(root))
    for path in sorted(path for pattern in MODULES for path in root.glob(pattern)):
        source = path.read_text(encoding="utf-8")
        found += found_in(texts_of_a_module(source), path.relative_to(root))
        found += found_in(texts_of_comments(source), path.relative_to(root))
        names = names_of_a_module(source)
        found += [f"{path.relative_to(root)}:{line}: the name {name}" for line, name in names if NAMES.search(name)]
    found += found_in(enumerate((root / "Makefile").read_text(encoding="utf-8").splitlines(), start=1), "Makefile")
    return found


@pytest.mark.slow
def test_texts_are_in_the_terms_of_the_field() -> None:
    found = complaints(ROOT)
    assert not found, f"{len(found)} terms:\n" + "\n".join(found)


@pytest.mark.parametrize("text", [
    "The push is felt.", "The message says why", "the estimated place", "pin the place", "delayed, or 2 periods late",
    "held for ever", "Departures of the arm", "one YAML a configuration", "a dead zone of 2 N",
])  # fmt: skip
def test_a_wrong_term_is_found_where_a_user_reads_it(text: str) -> None:
    assert list(found_in(texts_of_a_page(text), "page"))
    assert list(found_in(texts_of_a_module(f'def f():\n    """{text}"""'), "docstring"))
    assert list(found_in(texts_of_a_module(f'raise ValueError(f"{{1}} {text}")'), "message"))
    assert list(found_in(texts_of_comments(f"x = 1  # {text}"), "comment"))


@pytest.mark.parametrize("text", [
    "The deadband is 2 N; besides, it is known.", "It takes the place of that, in one place.", "`felt`",
    "```\nfelt\n```",
])  # fmt: skip
def test_right_terms_and_code_are_not(text: str) -> None:
    assert not list(found_in(texts_of_a_page(text), "page"))
