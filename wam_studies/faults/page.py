"""The results as text: the table, the list of escapes, and the page docs/reliability.md."""

import math
import re
from collections.abc import Sequence
from pathlib import Path

from wam_analysis.table import markdown, plain
from wam_studies.faults.trials import FORCE, HELD_MOTION, MOTION, ZERO_CURRENT, KindResult

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
    rows = _rows(results)
    played = {HEAD[0], *(row[0] for row in rows)}
    table = [[cell.strip() for cell in line.strip("| ").split("|")] for line in before.splitlines() if line[:2] == "| "]
    rows += [row for row in table if row[0] not in played and not row[0].startswith("---")]
    return "\n".join([f"Written by `{command}`, kind by kind.", "", markdown(HEAD, rows).rstrip()])


def section_of(file: Path, name: str) -> str:
    """What a section of the page holds, '' where there is no page."""
    page = file.read_text(encoding="utf-8") if file.exists() else ""
    return page.partition(f"<!-- written: {name} -->")[2].partition("<!-- end of what is written -->")[0]


def with_section(file: Path, name: str, text: str) -> str:
    """The page with one of its sections replaced; a new page where there is none."""
    page = file.read_text(encoding="utf-8") if file.exists() else PAGE
    begin, end = f"<!-- written: {name} -->\n", "<!-- end of what is written -->"
    pattern = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
    if not pattern.search(page):
        raise ValueError(f"{file} has no line '{begin.strip()}'; remove the file, or write into another one")
    return pattern.sub(lambda found: f"{begin}{text}\n{end}", page)


PAGE = f"""# Reliability

What happens when messages are wrong, nodes end or freeze, disks fill and the machine is busy. Every table on this
page is written by the command that it names; the text around the tables is part of that command, too.

## Faults

<!-- written: faults -->
Not yet measured: `wam evaluate faults --write docs/reliability.md`.
<!-- end of what is written -->

A trial escapes if one of these is measured. The measures do not come from the node under test: motion and force are
those of the simulated plant, currents and texts those that arrive over topics.

* A joint moves by more than {MOTION:g} rad, or the arm presses with more than {FORCE:g} N, without a legitimate
  command. A wrong number from the node whose command it is, with a stamp of the present, is a command until it is too
  old: {HELD_MOTION:g} rad are allowed for it. The simulated hand, `sim/disturbance`, may push with up to its limit.
* A node ends, or raises an exception.
* A number in any output is not finite, or a current is above the peak of its motor.
* The loss of a node is not reported by its name, or a current is not zero {ZERO_CURRENT * 1e3:g} ms of the arm's time
  after it.
* The arm's time is at rest without a fault, or an operator cannot enable the arm again.
* A refused set of parameters changes a value, a wrong one is accepted, or an accepted one makes the arm unstable.
* A second publisher of a command or of feedback is not a fault that names the topic.
* A full or removed disk is not reported, or a broken bag gives a wrong value that its checksums cover.

`messages` are published on every topic that a node takes, by the topic's own publisher and by a second one.
`-realtime` is the contract of a real driver; there, and in lockstep, the nodes of all kinds but `losses` are in one
process, on a clock that waits for the answers, so a busy machine is slower and not different. `losses` are real
processes: each is killed, ended or frozen, and started again by an operator.

Each trial depends on its kind, seed and number alone. An escape is repeated with the line that the command prints
for it, `wam evaluate faults --only KIND --count 1 --seed SEED --first NUMBER`.

## Interruption

<!-- written: interruptions -->
Not yet measured: `wam evaluate faults --ctrl-c 100 --write docs/reliability.md`.
<!-- end of what is written -->

After each Ctrl-C no process is left, no traceback is printed, and the bag, if there is one, can be read whole.

## Soak

<!-- written: soak -->
Not yet measured: `make soak`.
<!-- end of what is written -->

`make soak` runs the nodes with the recorder and a moving arm for ten minutes (`SOAK_SECONDS`), paced. The memory is
that of the process after a tenth of the run and at its end; lost messages are those that publishers have numbered
and the bag does not have.
"""
