"""What the thesis claims and what shows it: items of docs/thesis.yaml, checked, and as tables."""

import importlib
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

import yaml

from wam_analysis.table import markdown
from wam_studies.figures.catalogue import FIGURES
from wam_studies.plant.table import EFFECTS

PLACE = re.compile(r"\{(figure|effect) ([^}]+)\}")
PAGES = {"experiment": "experiments.md", "task": "tasks.md", "figure": "figures.md", "effect": "plant.md"}


class Status(StrEnum):
    """How an item is shown."""

    PLANT = "plant"
    THEORY = "theory"
    CONSTRUCTION = "construction"
    NOT_SHOWN = "not shown"


class Claim(NamedTuple):
    """One item of the thesis.

    Attributes
    ----------
    section : of the thesis.
    claim : in plain words.
    status : how it is shown.
    agreement : of what with what; `{figure NAME}` or `{effect NAME}` is the greatest distance that was measured.
    shown : references, see `unresolved`.
    open : what is not shown, and why; empty if nothing is missing.
    """

    section: str
    claim: str
    status: Status
    agreement: str = ""
    shown: tuple[str, ...] = ()
    open: str = ""


def load(file: Path) -> dict[str, tuple[Claim, ...]]:
    """Items of each chapter.

    Raises
    ------
    ValueError
        if an item has an unknown field or status, is shown by nothing, or is not shown without a reason.
    """
    chapters: Mapping[str, list[dict[str, object]]] = yaml.safe_load(file.read_text(encoding="utf-8"))
    return {title: tuple(map(_claim, rows)) for title, rows in chapters.items()}


def _claim(row: dict[str, object]) -> Claim:
    unknown = set(row) - set(Claim._fields)
    if unknown:
        raise ValueError(f"{row} has {', '.join(sorted(unknown))}; an item has {', '.join(Claim._fields)}")
    shown = row.get("shown") or []
    if not isinstance(shown, list):
        raise ValueError(f"{row}: 'shown' must be a list")
    texts = {key: str(value) for key, value in row.items() if key not in ("shown", "status")}
    claim = Claim(**texts, status=Status(str(row["status"])), shown=tuple(map(str, shown)))
    is_shown = claim.status is not Status.NOT_SHOWN
    if is_shown and not (claim.shown and claim.agreement):
        raise ValueError(f"{claim.section}, '{claim.claim}': give it 'shown' and 'agreement', or status 'not shown'")
    if not is_shown and not claim.open:
        raise ValueError(f"{claim.section}, '{claim.claim}': it is not shown; 'open' must state why")
    return claim


def unresolved(reference: str, root: Path) -> str:
    """Why a reference leads nowhere; empty if it does not.

    Parameters
    ----------
    reference : dotted name of Python, `experiment NAME`, `task NAME`, `figure NAME`, `effect NAME`,
        `test FILE.NAME`, or a file.
    root : of the repository.
    """
    kind, _, name = reference.partition(" ")
    known: dict[str, bool] = {
        "experiment": (root / "config" / "experiments" / f"{name}.yaml").is_file(),
        "task": (root / "config" / "tasks" / f"{name}.yaml").is_file(),
        "figure": name in FIGURES,
        "effect": name in EFFECTS,
        "test": _is_test(root, *name.partition(".")[::2]),
    }
    if kind in known:
        return "" if known[kind] else f"there is no {kind} '{name}'"
    if "/" in reference:
        return "" if (root / reference).is_file() else f"there is no file '{reference}'"
    return "" if _importable(reference) else f"'{reference}' cannot be imported"


def _is_test(root: Path, file: str, test: str) -> bool:
    path = next(root.glob(f"test/*/{file}.py"), None) if file else None
    return path is not None and f"\ndef {test}(" in path.read_text(encoding="utf-8")


def _importable(name: str) -> bool:
    """Whether a dotted name is a module, or a name of one."""
    module, _, attribute = name.rpartition(".")
    try:
        return hasattr(importlib.import_module(module), attribute) or bool(importlib.import_module(name))
    except (ImportError, ValueError):
        return False


def count(claims: Iterable[Claim]) -> str:
    """How many items have each status, as Markdown."""
    found = Counter(claim.status for claim in claims)
    rows = [(status.value, str(found[status])) for status in Status]
    return markdown(("status", "items"), [*rows, ("all", str(found.total()))])


def table(claims: Iterable[Claim], measured: Mapping[str, Mapping[str, float]]) -> str:
    """Items as Markdown.

    Parameters
    ----------
    claims : of a chapter.
    measured : the greatest distance of each figure and of each effect.

    Raises
    ------
    KeyError
        for a place of a name that has no distance.
    """
    head = ("section", "claimed", "status", "agreement", "shown by", "not shown")
    rows = []
    for c in claims:
        agreement = PLACE.sub(lambda place: _percent(measured[place[1]][place[2]]), c.agreement)
        rows.append((c.section, c.claim, c.status, agreement, _links(c), c.open))
    return markdown(head, rows)


def _links(claim: Claim) -> str:
    """Links to what shows an item; names of tests are not of interest to a reader."""
    named = dict.fromkeys("tests" if name.startswith("test ") else name for name in claim.shown)
    cells = (reference.partition(" ") for reference in named)
    return "; ".join(
        f"{kind} [{name}]({PAGES[kind]})" if kind in PAGES else "tests" if kind == "tests" else f"`{kind}`"
        for kind, _, name in cells
    )


def _percent(distance: float) -> str:
    return "below 0.01 %" if distance < 1e-4 else f"{100.0 * distance:.2g} %"
