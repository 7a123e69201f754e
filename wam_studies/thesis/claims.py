"""What the thesis claims and where it is shown: rows of docs/thesis.yaml, checked, and as tables."""

import importlib
import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import yaml

from wam_analysis.table import markdown
from wam_studies.figures.catalogue import FIGURES
from wam_studies.plant.effects import STUDIES

PLACE = re.compile(r"\{(figure|effect|experiment)\}")


class Claim(NamedTuple):
    """One claim of the thesis.

    Attributes
    ----------
    section : of the thesis.
    text : what is claimed.
    shown : references, see `unresolved`; none if nothing shows it.
    near : agreement with the thesis, in words; `{figure}`, `{effect}` or `{experiment}` stands for the greatest
        distance that was measured for those that `shown` names, see `near_of`.
    missing : what is not shown, and why; empty if nothing is missing.
    """

    section: str
    text: str
    shown: tuple[str, ...]
    near: str
    missing: str


def load(file: Path) -> dict[str, tuple[Claim, ...]]:
    """Claims of each chapter.

    Raises
    ------
    ValueError
        if a row has not five cells, or neither shows anything nor states why not.
    """
    chapters: Mapping[str, list[list[object]]] = yaml.safe_load(file.read_text(encoding="utf-8"))
    return {title: tuple(_claim(row) for row in rows) for title, rows in chapters.items()}


def _claim(row: list[object]) -> Claim:
    if len(row) != 5:
        raise ValueError(f"{row} has {len(row)} cells; a claim has section, text, shown, near and missing")
    section, text, shown, near, missing = map(str, row)
    claim = Claim(section, text, tuple(filter(None, (name.strip() for name in shown.split(";")))), near, missing)
    if not claim.shown and not missing:
        raise ValueError(f"{section}, '{text}': it names nothing that shows it and no reason")
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
        "effect": name in STUDIES,
    }
    if kind in known:
        return "" if known[kind] else f"there is no {kind} '{name}'"
    if kind == "test":
        file, _, test = name.partition(".")
        path = next(root.glob(f"test/*/{file}.py"), None)
        there = path is not None and re.search(
            rf"^def {re.escape(test)}\(", path.read_text(encoding="utf-8"), re.MULTILINE
        )
        return "" if there else f"there is no test '{name}'"
    if "/" in reference:
        return "" if (root / reference).is_file() else f"there is no file '{reference}'"
    return "" if _importable(reference) else f"'{reference}' cannot be imported"


def _importable(name: str) -> bool:
    """Whether a dotted name is a module, or a name of one."""
    module, _, attribute = name.rpartition(".")
    try:
        return hasattr(importlib.import_module(module), attribute) or bool(importlib.import_module(name))
    except (ImportError, ValueError):
        return False


def near_of(claim: Claim, measured: Mapping[str, Mapping[str, str]]) -> str:
    """How near, with the measured distances in their places.

    Parameters
    ----------
    claim : of the page.
    measured : of each kind, figure, effect and experiment, the greatest distance of each name, as "0.3 %".

    Raises
    ------
    ValueError
        if nothing of the kind is shown, or it has no distance.
    """

    def worst(kind: re.Match[str]) -> str:
        names = [name for found, _, name in (one.partition(" ") for one in claim.shown) if found == kind[1]]
        texts = [measured[kind[1]][name] for name in names if name in measured[kind[1]]]
        if not texts:
            raise ValueError(f"{claim.section}, '{claim.text}': no {kind[1]} that it shows has a distance")
        return max(texts, key=percent)

    return PLACE.sub(worst, claim.near)


def percent(text: str) -> float:
    """The number of a distance, as 0.3 of "0.3 %" or "below 0.3 %"."""
    return abs(float(text.split()[-2]))


def distances_in(table_text: str) -> dict[str, str]:
    """Greatest distance of each name in a Markdown table, names in its first column and distances in its last."""
    found: dict[str, str] = {}
    for line in table_text.splitlines():
        cells = [cell.strip() for cell in line.strip("| ").split("|")]
        if cells[-1].endswith("%"):
            found[cells[0]] = max(found.get(cells[0], cells[-1]), cells[-1], key=percent)
    return found


def deviations_in(page: str) -> dict[str, str]:
    """Greatest deviation with a bound of each experiment on docs/experiments.md."""
    found = {}
    for name, block in re.findall(r"<!-- experiment: (\S+) -->\n(.*?)<!-- end -->", page, re.DOTALL):
        rows = [[cell.strip() for cell in line.strip("| ").split("|")] for line in block.splitlines()]
        bounded = [
            row[4].lstrip("+-") for row in rows if len(row) > 5 and row[4].endswith("%") and row[5].endswith("%")
        ]
        if bounded:
            found[name] = max(bounded, key=percent)
    return found


def table(claims: tuple[Claim, ...], measured: Mapping[str, Mapping[str, str]]) -> str:
    """Claims as Markdown, with the distances that were measured, see `near_of`."""
    head = ("section", "claimed", "shown by", "agreement", "not shown, because")
    rows = [(c.section, c.text, "; ".join(map(_cell, c.shown)), near_of(c, measured), c.missing) for c in claims]
    return markdown(head, rows)


def _cell(reference: str) -> str:
    kind, _, name = reference.partition(" ")
    where = {"experiment": f"experiments.md#{name}", "task": "tasks.md", "figure": "figures.md", "effect": "plant.md"}
    if kind in where:
        return f"{kind} [{name}]({where[kind].split('#')[0]})"
    return f"`{name if kind == 'test' else reference}`"
