"""What the thesis claims and what shows it: items of docs/thesis.yaml, checked, and as tables."""

import csv
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum
from io import StringIO
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, NamedTuple

import yaml

from wam_analysis.table import markdown
from wam_control.task.scenario_values import known
from wam_description.parameters import require
from wam_studies.figures.catalogue import FIGURES
from wam_studies.plant.effects import EFFECTS
from wam_studies.thesis.definition import names, tasks

PLACE = re.compile(r"\{(figure|effect) ([^}]+)\}")


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
    chapters: Mapping[str, list[dict[str, Any]]] = yaml.safe_load(file.read_text(encoding="utf-8"))
    return {title: tuple(map(_claim, rows)) for title, rows in chapters.items()}


def _claim(row: dict[str, Any]) -> Claim:
    known("item", row, Claim._fields, ("section", "claim", "status"))
    shown = row.get("shown", [])
    require(isinstance(shown, list), f"{row}: 'shown' must be a list")
    claim = Claim(**{**row, "status": Status(str(row["status"])), "shown": tuple(shown)})
    if claim.status is Status.NOT_SHOWN:
        require(bool(claim.open), f"{claim.section}, '{claim.claim}': it is not shown; 'open' must state why")
    else:
        given = bool(claim.shown and claim.agreement)
        require(given, f"{claim.section}, '{claim.claim}': give it 'shown' and 'agreement', or status 'not shown'")
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
    there: dict[str, bool] = {
        "experiment": name in names(),
        "task": name in tasks(),
        "figure": name in FIGURES,
        "effect": name in EFFECTS,
        "test": _is_test(root, *name.partition(".")[::2]),
    }
    if kind in there:
        return "" if there[kind] else f"there is no {kind} '{name}'"
    if "/" in reference:
        return "" if (root / reference).is_file() else f"there is no file '{reference}'"
    try:
        resolve_name(reference)
    except (ImportError, AttributeError, ValueError):
        return f"'{reference}' cannot be imported"
    return ""


def _is_test(root: Path, file: str, test: str) -> bool:
    path = next(root.glob(f"test/*/{file}.py"), None) if file else None
    return path is not None and f"\ndef {test}(" in path.read_text(encoding="utf-8")


def count(chapters: Mapping[str, Sequence[Claim]]) -> str:
    """How many items of each chapter have each status, as Markdown."""
    found = {title: Counter(claim.status for claim in rows) for title, rows in chapters.items()}
    found["all"] = Counter(claim.status for rows in chapters.values() for claim in rows)
    rows = [(title, *(str(own[status]) for status in Status)) for title, own in found.items()]
    return markdown(("chapter", *(status.value for status in Status)), rows)


def table(claims: Iterable[Claim], measured: Mapping[str, str]) -> str:
    """The items with what shows each, as CSV whose cells are Markdown; agreement of what the plant shows.

    Parameters
    ----------
    measured : greatest distance of each figure and effect, by the name that an agreement has in braces.
    """
    text = StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(("section", "claim", "status", "shown by", "agreement; what is open"))
    for claim in claims:
        agreement = PLACE.sub(lambda found: measured[found[0][1:-1]], claim.agreement)
        links = dict.fromkeys(filter(None, map(_link, claim.shown)))
        found = agreement if claim.status is Status.PLANT else ""
        remark = ". ".join(f"{one[0].upper()}{one[1:]}" for one in (found, claim.open) if one)
        rows.writerow((claim.section, claim.claim, claim.status, " ".join(links), remark))
    return text.getvalue()


def _link(reference: str) -> str:
    """Where the page leads for a reference; '' for a function or test."""
    kind, _, name = reference.partition(" ")
    folder = {"figure": "figures/figure-", "experiment": "experiments/", "task": "tasks/"}.get(kind)
    return f"[{name}]({folder}{name}.png)" if folder else "[effects](plant.md)" * (kind == "effect")
