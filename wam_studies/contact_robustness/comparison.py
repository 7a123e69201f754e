"""The first benchmark next to this one, on the same seeds: an arm as the estimator states it, contacts of its prior."""

from collections.abc import Sequence
from typing import Final

from wam_analysis.table import markdown
from wam_description.arm import Arm
from wam_description.configuration import Configuration
from wam_studies.contact_benchmark.evaluation import BenchmarkExtent, ScenarioTask, scenarios
from wam_studies.contact_benchmark.page import number
from wam_studies.contact_benchmark.scenarios import dither_values
from wam_studies.contact_benchmark.score import ScenarioScore, required_metrics
from wam_studies.contact_robustness.requirements import RequiredRow
from wam_studies.scores import Interval, events

EXTENT: Final = BenchmarkExtent(contacts=24, resting=6, free=36.0)  # of one seed
# how the name of a row begins, and of the quantity of the first benchmark that is the same
ALIKE: Final = (
    ("5 N detected within 30 ms", "5 N on the outer link detected within 30 ms"),
    *(
        (f"position on the outer link, moving, {force} N, median", f"position on the outer link at {force} N, median")
        for force in (5, 10, 20)
    ),
    ("contacts with a reported sd below 2 cm",) * 2,
    ("90 % set contains the truth at 20 N, mu 0.8",) * 2,
    ("wrong link where p > 0.95", "wrong link with a probability above 0.95"),
)


def first_tasks(configuration: Configuration, seeds: Sequence[int]) -> list[ScenarioTask]:
    """The scenarios of the first benchmark."""
    dither = dither_values(configuration)
    found = (one for seed in seeds for one in scenarios(configuration, seed, EXTENT, dither=dither))
    return [ScenarioTask(configuration, scenario) for scenario in found]


def comparison_table(first: Sequence[ScenarioScore], arm: Arm, rows: Sequence[RequiredRow]) -> str:
    """Markdown table of the quantities that both benchmarks have: the first one, then this one."""
    cells = [_alarms(first, rows)]
    for begin, other in ALIKE:
        row = next(row for row in rows if row.name.startswith(begin))
        found = (metric for metric in required_metrics(arm) if metric.name.startswith(other))
        own = [row.name, row.unit], _shown(row.found, row.scale)
        cells += [[*own[0], *_shown(metric.of(first), row.scale), *own[1], row.of] for metric in found]
    head = ("quantity", "unit", "first benchmark", "95 %", "n", "here", "95 %", "n", "of")
    return markdown(head, cells)


def _alarms(first: Sequence[ScenarioScore], rows: Sequence[RequiredRow]) -> list[str]:
    spans = [one.contact_free for one in first]
    seconds = sum(span.seconds for span in spans)
    found = events(sum(span.alarms for span in spans), seconds)
    value, low, high = (each / max(seconds, 1e-9) for each in (found.value, found.low, found.high))
    (row,) = (row for row in rows if row.name.startswith("the same, realistic mix") and row.of.endswith("identified"))
    return [
        "false alarms",
        row.unit,
        *_shown(Interval(value, low, high, found.observed), row.scale),
        *_shown(row.found, row.scale),
        row.of,
    ]


def _shown(found: Interval, scale: float) -> list[str]:
    return [
        number(found.value, scale),
        f"{number(found.low, scale)} to {number(found.high, scale)}",
        str(found.observed),
    ]
