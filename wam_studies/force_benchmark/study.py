"""Random forces on random surfaces: outcomes by class of task, true force against the commanded one."""

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import ClassVar

from wam_studies.force_benchmark.groupings import (
    FEEDBACK,
    GROUPINGS,
    MOTORS,
    POSE,
    POSITION,
    SENSORS,
    TARE,
    contact_of,
    course_of,
    unknown_of,
)  # fmt: skip
from wam_studies.force_benchmark.outcome import OUTCOME, TaskEnd
from wam_studies.force_benchmark.tasks import RANGES, draw, task_values
from wam_studies.force_benchmark.trial import ForceTaskCase, ForceTrial, play
from wam_studies.harness import Study, option
from wam_studies.scores import NONE_AT_ALL, Row, Scores, ScoreTable, exact, share

REQUIRED = {SENSORS: 0.95, MOTORS: 0.9}  # share of accepted tasks within the tolerance


@dataclass(frozen=True)
class ForceStudy(Study[ForceTaskCase, ForceTrial]):
    """Tasks, each drawn from the seed and its number alone."""

    title: ClassVar[str] = "force control on random surfaces in random poses"
    page: ClassVar[str] = "docs/force-benchmark.md"
    seeds: ClassVar[tuple[int, ...]] = (1,)
    count: ClassVar[int | None] = 100

    seconds: float = option(RANGES.seconds, "time of the whole force in each task", 1.0)

    def cases(self, seed: int) -> Iterator[ForceTaskCase]:
        """Tasks without end."""
        arm = self.configuration.shared.arm
        return (
            ForceTaskCase(self.configuration, seed, number, draw(arm, seed, number), self.seconds) for number in count()
        )

    run = staticmethod(play)

    def own_values(self, case: ForceTaskCase) -> Collection[str]:
        """What the task declares."""
        return task_values(case.configuration, case.task)

    def score(self, records: Sequence[ForceTrial]) -> Scores:
        """Shares of accepted tasks, what must not happen, outcomes by class, reasons."""
        rows = [*_accepted(records), *_forbidden(records), *_further(records)]
        return Scores(rows, [_outcomes(records), _reasons(records)])

    def failure(self, record: ForceTrial) -> str:
        """A wrong force without a reason, a force above the limit, an unreported cycle."""
        task = record.task
        what = FEEDBACK.of(task), POSE.of(task), contact_of(task), POSITION.of(task)
        kinds = " and ".join(_kinds(record))
        return f"{kinds}: {', '.join(what)}, {_numbers(record)}" if kinds else ""

    def picture(self, records: Sequence[ForceTrial], file: Path) -> bool:
        """True against commanded force, outcomes by class, peaks."""
        from wam_studies.force_benchmark.picture import draw as draw_picture  # matplotlib is slow to import

        draw_picture(records, file)
        return True

    def details(self, record: ForceTrial) -> str:
        """A task and its result in full."""
        task, result = record.task, record.result
        surface, ramp = task.surface, task.conditions.ramp
        along = ", ".join(f"{x:.3f}" for x in surface.direction)
        first = f": {task.before:.3g} N" if task.before else ""
        lines = [
            f"task {record.number} of seed {record.seed}: {result.outcome.value}; {_numbers(record)}",
            f"  pose ({', '.join(f'{angle:.3f}' for angle in task.q)}) rad, {task.pose}",
            f"  {contact_of(task)}: {surface.position:.3f} m of {surface.cover}, along ({along})",
            f"  surface of {surface.stiffness:.4g} N/m, friction {surface.friction:.2f}; ramp of {ramp:.2g} s",
            f"  {course_of(task)}{first}; not known: {unknown_of(task)}",
            f"  feedback from {FEEDBACK.of(task)}; contact position {POSITION.of(task)}; {TARE.of(task)}",
            f"  force gain {result.gain:.3g} m/s/N",
        ]
        return "\n".join([*lines, f"  reason: {result.reason}"] if result.reason else lines)


def _of_end(trials: Sequence[ForceTrial], *ends: TaskEnd) -> int:
    return sum(trial.result.outcome in ends for trial in trials)


def _accepted(trials: Sequence[ForceTrial]) -> Iterator[Row]:
    """How many accepted tasks end with the force."""
    for name, least in REQUIRED.items():
        own = FEEDBACK.trials(trials, name)
        done, refused = _of_end(own, TaskEnd.DONE), _of_end(own, TaskEnd.REFUSED)
        title = f"accepted tasks within {OUTCOME.tolerance:.0%}, {name}"
        accepted = len(own) - refused - _of_end(own, TaskEnd.GIVEN_UP)
        yield Row(title, share(done, accepted), "%", 100.0, (least, 1.0))
        yield Row(f"{title}, and those given up count as accepted", share(done, len(own) - refused), "%", 100.0)


def _forbidden(trials: Sequence[ForceTrial]) -> Iterator[Row]:
    """What must not happen."""
    for title, number in (
        (
            f"true force above {OUTCOME.overshoot:g} times the commanded plus the impact (3.1)",
            sum(trial.result.is_over for trial in trials),
        ),
        ("limit cycles that nothing reports", sum(trial.result.cycles_silently for trial in trials)),
        ("wrong force without a reason", _of_end(trials, TaskEnd.SILENT)),
    ):
        yield Row(title, exact(number, len(trials)), "tasks", required=NONE_AT_ALL)


def _further(trials: Sequence[ForceTrial]) -> Iterator[Row]:
    """What is reported of right forces, and how many tasks are declined."""
    done = [trial for trial in trials if trial.result.outcome is TaskEnd.DONE]
    quiet = [trial for trial in trials if not trial.result.reason]
    warned = sum(bool(trial.result.reason) for trial in done)
    for title, hits, of in (
        ("tasks within 10 % of which a warning is reported all the same", warned, len(done)),
        ("tasks without any reason reported, within 10 %", _of_end(quiet, TaskEnd.DONE), len(quiet)),
        (f"tasks {TaskEnd.REFUSED.value}", _of_end(trials, TaskEnd.REFUSED), len(trials)),
        (f"tasks {TaskEnd.GIVEN_UP.value}", _of_end(trials, TaskEnd.GIVEN_UP), len(trials)),
    ):
        yield Row(title, share(hits, of), "%", 100.0)


def _outcomes(trials: Sequence[ForceTrial]) -> ScoreTable:
    """Outcomes of each class of tasks."""
    head = ("tasks", "", "n", *(end.value.split(":")[0] for end in TaskEnd), "above the limit", "cycles unreported")
    rows = [
        _counts(grouping.title, name, grouping.trials(trials, name))
        for grouping in GROUPINGS
        for name in grouping.classes
    ]
    note = "Fractions of all tasks of a class; the last two columns are numbers of tasks, whatever their outcome."
    return ScoreTable("Outcomes", head, [_counts("all", "", trials), *rows], note)


def _counts(title: str, name: str, trials: Sequence[ForceTrial]) -> list[str]:
    shares = [f"{_of_end(trials, end) / len(trials):.0%}" if trials else "–" for end in TaskEnd]
    others = sum(trial.result.is_over for trial in trials), sum(trial.result.cycles_silently for trial in trials)
    return [title, name, str(len(trials)), *shares, *map(str, others)]


def _reasons(trials: Sequence[ForceTrial]) -> ScoreTable:
    """How often each reason was given."""
    texts = [trial.result.cause for trial in trials if trial.result.cause]
    rows = [[text, str(number)] for text, number in Counter(texts).most_common()]
    return ScoreTable("Reasons", ("reason", "tasks"), rows, "Code and cause, as reported.")


def _kinds(trial: ForceTrial) -> list[str]:
    """What is wrong with a result."""
    result = trial.result
    kinds = (
        ("silent", result.outcome is TaskEnd.SILENT),
        ("above the limit", result.is_over),
        ("unreported cycle", result.cycles_silently),
    )
    return [text for text, holds in kinds if holds]


def _numbers(trial: ForceTrial) -> str:
    result = trial.result
    return (
        f"{trial.task.force:.3g} N commanded, {result.mean:.3g} N true (sd {result.sd:.2g}, peak {result.peak:.3g}, "
        f"limit {result.limit:.3g}, cycle {result.cycle:.2g})"
    )
