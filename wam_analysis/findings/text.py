"""An analysis as text for a terminal, and as JSON for programs."""

import json
import math
import textwrap
from typing import Any

from wam_analysis.findings.analysis import Analysis
from wam_analysis.findings.finding import Finding, Section, shown

WIDTH = 100
COLUMN = 18  # of the table at least, with two blanks between a number and the next
SCHEMA = 1  # of the JSON; a number that changes when a key changes its meaning


def text(analysis: Analysis) -> str:
    """What happened, section by section: sentences, then numbers measured and predicted."""
    lines: list[str] = []
    for section in analysis.sections:
        lines += ["", section.title, "─" * len(section.title)]
        for sentence in section.said:
            lines += textwrap.wrap(sentence, WIDTH, initial_indent="  ", subsequent_indent="    ")
        lines += _table(section)
        if section.lacking:
            lines += _wrapped(f"not in this bag: {', '.join(section.lacking)}")
    lines += ["", "Provenance", "──────────"]
    lines += [line for key, value in analysis.provenance.items() for line in _wrapped(f"{key}: {value}")]
    return "\n".join(lines).lstrip("\n")


def _wrapped(line: str) -> list[str]:
    return textwrap.wrap(line, WIDTH, initial_indent="  ", subsequent_indent="    ")


def _table(section: Section) -> list[str]:
    """Numbers in columns; a section without any has no table."""
    if not section.findings:
        return []
    numbers = [[shown(value, one.unit) for value in (one.measured, one.predicted)] for one in section.findings]
    column = max(COLUMN, 2 + max(len(number) for pair in numbers for number in pair))
    left = WIDTH - 2 - 2 * column
    lines = ["", f"  {'':<{left}}{'measured':>{column}}{'predicted':>{column}}"]
    for finding, (measured, predicted) in zip(section.findings, numbers, strict=True):
        name = textwrap.wrap(finding.name, left - 2) or [""]
        lines.append(f"  {name[0]:<{left}}{measured:>{column}}{predicted:>{column}}")
        lines += [f"    {more}" for more in name[1:]]
    return lines


def document(analysis: Analysis) -> dict[str, Any]:
    """The analysis as plain values, see docs/analysis.md; a number that is not known is None."""
    return {
        "schema": SCHEMA,
        "provenance": analysis.provenance,
        "duration": analysis.duration,
        "sections": [
            {
                "key": section.key,
                "title": section.title,
                "said": list(section.said),
                "findings": [_finding(finding) for finding in section.findings],
                "lacking": list(section.lacking),
            }
            for section in analysis.sections
        ],
    }


def _finding(finding: Finding) -> dict[str, Any]:
    return {
        "name": finding.name,
        "unit": finding.unit,
        "measured": finding.measured if math.isfinite(finding.measured) else None,
        "predicted": finding.predicted if math.isfinite(finding.predicted) else None,
        "note": finding.note,
    }


def json_text(analysis: Analysis) -> str:
    """`document` as JSON (RFC 8259, no NaN)."""
    return json.dumps(document(analysis), indent=1, allow_nan=False, ensure_ascii=False)
