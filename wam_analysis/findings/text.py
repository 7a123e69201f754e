"""An analysis as text for a terminal, and as JSON for programs."""

import json
import math
import textwrap
from typing import Any

from wam_analysis.findings.analysis import Analysis
from wam_analysis.findings.finding import Finding, Section, shown
from wam_analysis.table import plain

WIDTH = 100
NAME, COLUMN = 60, 16  # widths in the table: of a name at most, of a number at least
SCHEMA = 2  # of the JSON; incremented when a key changes its name or meaning


def text(analysis: Analysis) -> str:
    """The analysis, section by section: sentences, then measured and predicted numbers."""
    lines: list[str] = []
    for section in analysis.sections:
        lines += ["", section.title, "─" * len(section.title)]
        for sentence in section.sentences:
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
    """Lines of the table of a section; none without numbers."""
    if not section.findings:
        return []
    rows = [(one.name, shown(one.measured, one.unit), shown(one.predicted, one.unit)) for one in section.findings]
    return ["", *(f"  {line}" for line in plain([("", "measured", "predicted")], rows, first=NAME, least=COLUMN))]


def document(analysis: Analysis) -> dict[str, Any]:
    """The analysis as plain values, see docs/analysis.md; an unknown number is None."""
    return {
        "schema": SCHEMA,
        "provenance": analysis.provenance,
        "duration": analysis.duration,
        "sections": [
            {
                "key": section.key,
                "title": section.title,
                "sentences": list(section.sentences),
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
