"""The numbers of a section as tables: subjects by quantities, and a list of the rest."""

from collections.abc import Sequence

import numpy as np

from wam_analysis.findings.finding import Finding, shown

MARK = " !"  # after a number more than three standard errors from its prediction
BESIDE = " +- "  # before its standard error
PREDICTED = " | "  # before its prediction
LEGENDS = {
    BESIDE: "+-: one standard deviation",
    PREDICTED: "measured | predicted",
    MARK: "! more than three standard errors from its prediction",
}

Table = Sequence[Sequence[str]]  # its first row has the titles; '' where nothing belongs, '-' where nothing is known


def tabulated(findings: Sequence[Finding]) -> list[Table]:
    """Tables of some numbers: one of those whose subjects share quantities, and one of those without a subject.

    What was neither measured nor predicted for any subject is left out.
    """
    known = [one for one in findings if np.isfinite(one.measured) or not np.isnan(one.predicted)]
    alone = [one for one in known if not one.subject]
    cells = {(one.subject, one.title): _cell(one) for one in findings}
    return [_table(part, cells) for part in (*_alike([one for one in known if one.subject]), alone) if part]


def legends(tables: Sequence[Table]) -> list[str]:
    """What the marks in some tables mean."""
    return [
        text for mark, text in LEGENDS.items() if any(mark in cell for rows in tables for row in rows for cell in row)
    ]


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


def _table(findings: list[Finding], cells: dict[tuple[str, str], str]) -> Table:
    """The table of some numbers; its longer axis runs down."""
    subjects = list(dict.fromkeys(one.subject for one in findings))
    titles = list(dict.fromkeys(one.title for one in findings))
    grid = [[cells.get((subject, title), "") for title in titles] for subject in subjects]
    if len(subjects) <= len(titles):
        return [
            ["quantity", *(subject or "measured" for subject in subjects)],
            *map(list, zip(titles, *grid, strict=True)),
        ]
    return [["", *titles], *([subject, *row] for subject, row in zip(subjects, grid, strict=True))]


def _cell(one: Finding) -> str:
    measured = ">=" * one.is_lower_bound + shown(one.measured)
    if np.isfinite(one.error) and np.isfinite(one.measured):
        measured += f"{BESIDE}{shown(one.error)}"
    predicted = "" if np.isnan(one.predicted) else f"{PREDICTED}{shown(one.predicted)}"
    return measured + MARK * one.deviates + predicted
