"""An analysis as text for a terminal, and as JSON for programs."""

import json
import math
import shutil
import textwrap
from typing import Any

from wam_analysis.findings.analysis import Analysis
from wam_analysis.findings.finding import Finding
from wam_analysis.findings.tabulated import LEGEND, MARK, Tabulated, tabulated
from wam_analysis.table import plain
from wam_analysis.thresholds import LAYOUT

SCHEMA = 3  # of the JSON; incremented when a key changes its name or meaning


def text(analysis: Analysis, width: int | None = None) -> str:
    """The analysis, verdict first, then section by section: sentences and a table.

    Parameters
    ----------
    width : columns; None takes those of the terminal, at most 100.
    """
    wide = shutil.get_terminal_size((LAYOUT.width, 24)).columns if width is None else width
    wide = min(max(wide, LAYOUT.narrowest), LAYOUT.width)
    lines: list[str] = []
    for section in analysis.sections:
        if not (section.sentences or section.findings or section.lacking):
            continue  # the page has charts there
        lines += ["", section.title, "─" * len(section.title)]
        for sentence in section.sentences:
            lines += _wrapped(sentence, wide)
        lines += table_lines(section.findings, wide)
        if section.lacking:
            lines += _wrapped(f"not in this bag: {', '.join(section.lacking)}", wide)
    lines += ["", "Provenance", "──────────"]
    lines += [line for key, value in analysis.provenance.items() for line in _wrapped(f"{key}: {value}", wide)]
    return "\n".join(lines).lstrip("\n")


def _wrapped(line: str, wide: int) -> list[str]:
    return textwrap.wrap(line, wide, initial_indent="  ", subsequent_indent="    ")


def table_lines(findings: tuple[Finding, ...], wide: int) -> list[str]:
    """Lines of the tables of some numbers, of so many columns; none without numbers."""
    lines: list[str] = []
    for table in tabulated(findings):
        for block in _blocks(table, wide):
            lines += ["", *(f"  {line}".rstrip() for line in block)]
    if any(MARK in line for line in lines):
        lines += _wrapped(LEGEND, wide)
    return lines


def _blocks(table: Tabulated, wide: int) -> list[list[str]]:
    """The table in blocks that fit, each with the names of the rows; a prediction stays with what it predicts."""
    names = max(
        LAYOUT.column, min(int(LAYOUT.name * wide), max(map(len, (table.columns[0], *(row[0] for row in table.rows)))))
    )
    words = [word for name in table.columns[1:] for word in name.split()]  # none is broken
    column = max(LAYOUT.column, *(len(text) for row in (words, *(row[1:] for row in table.rows)) for text in row))
    column = min(column, wide - 4 - names)
    fits = max(1, (wide - 2 - names) // (column + 2))
    groups: list[list[int]] = []
    for j in range(1, len(table.columns)):
        with_last = table.predicted[j] or (groups and j + 1 < len(table.columns) and not table.predicted[j + 1])
        room = bool(groups) and len(groups[-1]) + 1 + (j + 1 < len(table.columns) and table.predicted[j + 1]) <= fits
        if groups and (room or (table.predicted[j] and with_last)):
            groups[-1].append(j)
        else:
            groups.append([j])
    return [_block(table, names, column, group) for group in groups]


def _block(table: Tabulated, names: int, column: int, columns: list[int]) -> list[str]:
    heads = [[table.columns[0]], *(textwrap.wrap(table.columns[j], column) for j in columns)]
    height = max(map(len, heads))
    head = [*zip(*([""] * (height - len(one)) + one for one in heads), strict=True)]
    rows = [[row[0], *(row[j] for j in columns)] for row in table.rows]
    return plain(head, rows, first=names, least=column)


def document(analysis: Analysis) -> dict[str, Any]:
    """The analysis as plain values, see docs/analysis.md; an unknown number is None."""
    return {
        "schema": SCHEMA,
        "provenance": analysis.provenance,
        "duration": analysis.recording.duration,
        "sections": [
            {
                "key": section.key,
                "title": section.title,
                **{name: list(getattr(section, name)) for name in ("sentences", "shows", "wrong", "lacking")},
                "findings": [_finding(finding) for finding in section.findings],
            }
            for section in analysis.sections
        ],
    }


def _finding(finding: Finding) -> dict[str, Any]:
    numbers = {key: getattr(finding, key) for key in ("measured", "predicted", "error")}
    known = {key: value if math.isfinite(value) else None for key, value in numbers.items()}
    return {"name": finding.name, "unit": finding.unit, **known, "deviates": finding.deviates, "note": finding.note}


def json_text(analysis: Analysis) -> str:
    """`document` as JSON (RFC 8259, no NaN)."""
    return json.dumps(document(analysis), indent=1, allow_nan=False, ensure_ascii=False)
