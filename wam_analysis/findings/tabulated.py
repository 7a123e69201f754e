"""The numbers of a section as tables: subjects by quantities, and a list of the rest."""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from wam_analysis.findings.finding import Finding, shown

MARK = " !"  # after a number more than three standard errors from its prediction
BESIDE = " +- "  # before its standard error
LEGENDS = {BESIDE: "+-: one standard deviation", MARK: "! more than three standard errors from its prediction"}


class Tabulated(NamedTuple):
    """A table of text.

    Attributes
    ----------
    columns : titles; the first is that of the rows.
    predicted : whether each column, the first included, holds predictions for the one before.
    rows : cells, as many as columns; '' where nothing belongs, '-' where it could not be measured.
    """

    columns: tuple[str, ...]
    predicted: tuple[bool, ...]
    rows: tuple[tuple[str, ...], ...]


def tabulated(findings: Sequence[Finding]) -> tuple[Tabulated, ...]:
    """Tables of some numbers: one of those whose subjects share quantities, and one of those without a subject.

    What was neither measured nor predicted for any subject is left out; a column of predictions is there only if there
    is one.  The longer axis runs down.
    """
    known = [one for one in findings if np.isfinite(one.measured) or not np.isnan(one.predicted)]
    having = [one for one in known if one.subject]
    alone = [one for one in known if not one.subject]
    every = {one.name for one in findings}
    return tuple(_table(part, every) for part in (*_alike(having), alone) if part)


def _alike(findings: list[Finding]) -> list[list[Finding]]:
    """The numbers of subjects that share a quantity together."""
    groups: list[list[Finding]] = []
    for subject in dict.fromkeys(one.subject for one in findings):
        own = [one for one in findings if one.subject == subject]
        names = {one.quantity for one in own}
        group = next((group for group in groups if names & {one.quantity for one in group}), None)
        if group is None:
            groups.append(own)
        else:
            group += own
    return groups


def _table(findings: list[Finding], every: Collection[str]) -> Tabulated:
    """The table of some numbers; `every` has all names, also of what could not be measured."""
    subjects = list(dict.fromkeys(one.subject for one in findings))
    quantities = list(dict.fromkeys((one.quantity, one.unit) for one in findings))
    cells = {(one.subject, (one.quantity, one.unit)): one for one in findings}
    downwards = len(subjects) <= len(quantities)
    titles = [f"{quantity} [{unit}]" if unit else quantity for quantity, unit in quantities]
    grid = [[cells.get((subject, one)) or _unknown(subject, one, every) for one in quantities] for subject in subjects]
    columned = grid if downwards else zip(*grid, strict=True)
    columns = [("quantity" if downwards else "", False, titles if downwards else subjects)]
    for head, found in zip(subjects if downwards else titles, columned, strict=True):
        columns.append((head or "measured", False, ["" if one is None else _measured(one) for one in found]))
        expected = ["" if one is None or np.isnan(one.predicted) else shown(one.predicted) for one in found]
        if any(expected):
            columns.append(("predicted", True, expected))
    heads, predicted, rows = zip(*columns, strict=True)
    return Tabulated(heads, predicted, tuple(zip(*rows, strict=True)))


def _unknown(subject: str, quantity: tuple[str, str], every: Collection[str]) -> Finding | None:
    """What could not be measured of a subject; None where it does not belong."""
    name = f"{subject}: {quantity[0]}"
    return Finding(name, quantity[1], np.nan) if name in every else None


def _measured(one: Finding) -> str:
    error = f"{BESIDE}{shown(one.error)}" if np.isfinite(one.error) and np.isfinite(one.measured) else ""
    return ">=" * one.is_lower_bound + shown(one.measured) + error + MARK * one.deviates
