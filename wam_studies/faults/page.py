"""The results as text: the table, the list of escapes, and the page docs/safety.md."""

import math
from collections.abc import Sequence

from wam_analysis.table import markdown, plain
from wam_studies.faults.trials import KindResult
from wam_studies.page import kept_rows

HEAD = (
    "kind",
    "tried",
    "escaped",
    "largest motion [rad]",
    "largest force [N]",
    "zero current after [ms]",
    "seed",
    "time [s]",
)
INTERRUPTIONS = "interruptions"  # the kind with a section of its own
LISTED = 10  # escapes of one kind that are printed


def _rows(results: Sequence[KindResult]) -> list[list[str]]:
    return [
        [
            result.kind,
            f"{result.tried} {result.unit}",
            str(len(result.escaped)),
            _number(result.worst("motion"), 1.0, 4),
            _number(result.worst("force"), 1.0, 1),
            _number(result.worst("delay"), 1e3, 0),
            str(result.seed),
            f"{result.seconds:.0f}",
        ]
        for result in results
    ]


def _number(value: float, factor: float, digits: int) -> str:
    return "–" if math.isnan(value) else f"{value * factor:.{digits}f}"


def _chosen(kind: str) -> str:
    """Options for one trial of a kind."""
    return "--ctrl-c 1" if kind == INTERRUPTIONS else f"--only {kind} --count 1"


def report(results: Sequence[KindResult]) -> str:
    """The output of the command: the table, then the first escapes of each kind."""
    lines = plain([HEAD], _rows(results), left=(0, 1))
    for result in results:
        for trial in result.escaped[:LISTED]:
            lines += [f"{result.kind} {trial.number}: {trial.name}: {'; '.join(trial.escapes)}"]
            lines += [f"    wam evaluate faults {_chosen(result.kind)} --seed {result.seed} --first {trial.number}"]
        if len(result.escaped) > LISTED:
            lines.append(f"{result.kind}: {len(result.escaped) - LISTED} more escapes")
    return "\n".join(lines)


def faults_section(results: Sequence[KindResult], command: str, before: str) -> str:
    """A section of the page on faults: the kinds that were played, then the rows of others in the text `before` it."""
    rows = {row[0]: row for row in _rows(results)}
    rows |= {name: row for name, row in kept_rows(before).items() if name not in rows}
    return "\n".join([f"Written by `{command}`, kind by kind.", "", markdown(HEAD, list(rows.values())).rstrip()])
