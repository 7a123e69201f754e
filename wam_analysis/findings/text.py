"""An analysis as text for a terminal, and as JSON for programs."""

import json
import math
import shutil
import textwrap
from collections.abc import Iterator, Sequence
from typing import Any

from wam_analysis.findings.analysis import Analysis
from wam_analysis.findings.finding import Finding
from wam_analysis.findings.tabulated import Table, legends, tabulated
from wam_analysis.table import plain
from wam_analysis.thresholds import LAYOUT

SCHEMA = 5  # of the JSON; incremented when a key changes its name or meaning


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
        if not (section.sentences or section.findings):
            continue  # the page has charts there
        lines += ["", section.title, "─" * len(section.title)]
        for sentence in section.sentences:
            lines += _wrapped(sentence, wide)
        lines += _table_lines(section.findings, wide)
    lines += ["", "Provenance", "──────────"]
    lines += [line for key, value in analysis.provenance.items() for line in _wrapped(f"{key}: {value}", wide)]
    return "\n".join(lines).lstrip("\n")


def _wrapped(line: str, wide: int) -> list[str]:
    return textwrap.wrap(line, wide, initial_indent="  ", subsequent_indent="    ")


def _table_lines(findings: Sequence[Finding], wide: int) -> list[str]:
    """Lines of the tables of some numbers, of so many columns; none without numbers."""
    tables = tabulated(findings)
    blocks = [block for table in tables for block in _blocks(table, wide)]
    lines = [line for block in blocks for line in ("", *(f"  {line}".rstrip() for line in block))]
    return [line for legend in legends(tables) for line in _wrapped(legend, wide)] + lines


def _blocks(table: Table, wide: int) -> Iterator[list[str]]:
    """The table in blocks that fit, each with the names of the rows."""
    head, *rows = table
    names = max(LAYOUT.column, min(int(LAYOUT.name * wide), max(len(row[0]) for row in table)))
    words = [word for name in head[1:] for word in name.split()]  # none is broken
    column = min(max(LAYOUT.column, *map(len, [*words, *(cell for row in rows for cell in row[1:])])), wide - 4 - names)
    fits = max(1, (wide - 2 - names) // (column + 2))
    for first in range(1, len(head), fits):
        part = slice(first, first + fits)
        heads = [[head[0]], *(textwrap.wrap(name, column) for name in head[part])]
        height = max(map(len, heads))
        above = [*zip(*([""] * (height - len(one)) + one for one in heads), strict=True)]
        yield plain(above, [[row[0], *row[part]] for row in rows], first=names, least=column)


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
                **{name: list(getattr(section, name)) for name in ("sentences", "shows", "wrong")},
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
