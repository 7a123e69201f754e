"""Random forces on random surfaces: outcomes by class of task, true force against the commanded one."""

from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import NamedTuple

import numpy as np

from wam_description.parameters import parameter
from wam_studies.figures.panels import FEW, Panel, Panels, measured
from wam_studies.force_benchmark.outcome import OUTCOME, TaskEnd, TaskResult
from wam_studies.force_benchmark.tasks import POSES, RANGES, Task, draw, task_values
from wam_studies.force_benchmark.trial import FORCE_LOOP, ForceTaskCase, ForceTrial, play
from wam_studies.harness import Study
from wam_studies.scores import ANY, NONE_AT_ALL, Row, Scores, ScoreTable, by_group, exact, percent, share

SENSORS, MOTORS = "joint sensors", "motors with dither"


class TaskGrouping(NamedTuple):
    """A way to divide the tasks: its title, its classes in order, and the number of the class of a task."""

    title: str
    classes: Sequence[str]
    of: Callable[[Task], int]

    def name(self, task: Task) -> str:
        """The class of a task."""
        return self.classes[self.of(task)]

    def trials(self, every: Sequence[ForceTrial], name: str) -> list[ForceTrial]:
        """Trials of the tasks of a class."""
        return [trial for trial in every if self.name(trial.task) == name]

    def results(self, every: Sequence[ForceTrial]) -> dict[str, list[TaskResult]]:
        """Results of each class."""
        return {name: [trial.result for trial in self.trials(every, name)] for name in self.classes}


def _motion(task: Task) -> int:
    surface = task.surface
    is_across = surface.speed <= 1e-6 * surface.slide_speed  # apart from rounding
    return bool(surface.frequency) * (1 + is_across)


def _unknown(task: Task) -> int:
    return 3 if task.mistake else 1 if task.payload else 2 * bool(task.asymmetry)


FEEDBACK = TaskGrouping("feedback", (SENSORS, MOTORS), lambda task: task.is_dithered)
POSE = TaskGrouping("pose", list(POSES), lambda task: list(POSES).index(task.pose))
CONTACT = TaskGrouping(
    "contact",
    ("plane at the tip", "rod across the outer link", "rod across the inner link"),
    lambda task: 0 if task.surface.is_plane else 1 + (task.surface.cover in ("inner_link", "upper_arm")),
)
POSITION = TaskGrouping("contact position", ("pinned", "estimated"), lambda task: not task.is_pinned)
GROUPINGS = (
    FEEDBACK,
    TaskGrouping(
        "stiffness [N/m]",
        ("400 to 4000", "4000 to 40 000", "40 000 to 400 000"),
        lambda task: bisect_left((4e3, 4e4), task.surface.stiffness),
    ),
    POSE,
    TaskGrouping("force [N]", ("1 to 3", "3 to 10", "10 to 40"), lambda task: bisect_left((3.0, 10.0), task.force)),
    CONTACT,
    POSITION,
    TaskGrouping("tare", ("tared", "not tared"), lambda task: not task.is_tared),
    TaskGrouping("surface", ("at rest", "moves along the force", "moves across it"), _motion),
    TaskGrouping("forces", ("one", "two at once"), lambda task: bool(task.second)),
    TaskGrouping("command", ("step", "ramp"), lambda task: bool(task.ramp)),
    TaskGrouping(
        "course",
        ("one force", "another force first", "small force for long"),
        lambda task: 2 if task.longer > 1.0 else bool(task.before),
    ),
    TaskGrouping(
        "not known",
        (
            "masses, centres, friction, cables, constants",
            "a payload, too",
            "the law of friction, too",
            "the position, declared wrongly",
        ),
        _unknown,
    ),
)

# required and aim
ACCEPTED = {SENSORS: ((0.93, 1.0), (0.97, 1.0)), MOTORS: ((0.9, 1.0), (0.95, 1.0))}  # share of accepted tasks
OF_FEASIBLE = {SENSORS: ((0.6, 1.0), (0.85, 1.0)), MOTORS: ((0.4, 1.0), (0.7, 1.0))}  # share of the feasible ones
LEAST, MOST = 0.1, 10.0  # of the commanded force, drawn
KNOWN = 0.05  # error of a force, per force, up to which it can be known


@dataclass(frozen=True)
class ForceStudy(Study[ForceTaskCase, ForceTrial]):
    """Tasks, each drawn from the seed and its number alone."""

    title = "force control on random surfaces in random poses"
    page = "docs/experiments.md"
    seeds = (1,)
    count = 100

    seconds: float = parameter("time at the full force in each task", "s", low=1.0, default=RANGES.seconds)
    compare: bool = parameter("also run each task with other controllers; takes four times as long", default=False)

    def cases(self, seed: int) -> Iterator[ForceTaskCase]:
        """Tasks without end."""
        arm = self.configuration.shared.arm
        return (
            ForceTaskCase(self.configuration, seed, number, draw(arm, seed, number), self.seconds, self.compare)
            for number in count()
        )

    run = staticmethod(play)

    def own_values(self, case: ForceTaskCase) -> Collection[str]:
        """Parameters that the task of a case declares."""
        return task_values(case.configuration, case.task)

    def score(self, records: Sequence[ForceTrial]) -> Scores:
        """Shares of accepted tasks, what must not happen, outcomes by class, reasons."""
        rows = [*_accepted(records), *_of_feasible(records), *_of_all(records)]
        tables = [by_group("Outcomes", {"all": [trial.result for trial in records]}, _results)]
        tables += [by_group(f"Outcomes by {one.title}", one.results(records), _results) for one in GROUPINGS]
        return Scores(rows, [*_controllers(records), *tables, _reasons(records)])

    def failure(self, record: ForceTrial) -> str:
        """A wrong force that nothing reports, a force above the limit, an unreported cycle."""
        result = record.result
        faults = {
            "silent": result.outcome is TaskEnd.SILENT,
            "above the limit": result.is_over,
            "unreported cycle": result.cycles_silently,
        }
        what = [one.name(record.task) for one in (FEEDBACK, POSE, CONTACT, POSITION)]
        kinds = " and ".join(text for text, holds in faults.items() if holds)
        return f"{kinds}: {', '.join(what)}, {_numbers(record)}" if kinds else ""

    def panels(self, records: Sequence[ForceTrial]) -> Panels:
        """True force over the commanded one, up to `FEW` of each outcome, and peaks over stiffness."""
        peaks = [one for one in records if one.result.peak > 0.0][:FEW]
        stiffness = [one.task.surface.stiffness for one in peaks]
        over = [("", measured(stiffness, [one.result.peak / one.result.limit for one in peaks]))]
        return (
            *(_ratios(name, FEEDBACK.trials(records, name)) for name in FEEDBACK.classes),
            Panel("peaks", "stiffness of the surface [N/m]", "peak / (1.5 commanded + impact) [-]", over, "x"),
        )


def _ends(trials: Sequence[ForceTrial]) -> Counter[TaskEnd]:
    """How many trials ended in each way."""
    return Counter(trial.result.outcome for trial in trials)


def _accepted(trials: Sequence[ForceTrial]) -> Iterator[Row]:
    """How many accepted tasks end with the force, where the user makes no mistake."""
    for name, allowed in ACCEPTED.items():
        ends = _ends([trial for trial in FEEDBACK.trials(trials, name) if not trial.task.mistake])
        obeyed = ends.total() - ends[TaskEnd.REFUSED]
        title, done = f"accepted tasks within {OUTCOME.tolerance:.0%}, {name}", ends[TaskEnd.DONE]
        yield percent(title, share(done, obeyed - ends[TaskEnd.GIVEN_UP]), *allowed)
        yield percent(f"{title}, and those given up count as accepted", share(done, obeyed))


def _is_feasible(trial: ForceTrial) -> bool:
    """Whether the force can be known, or anything compared gets it right."""
    results = [trial.result, *trial.others.values()]
    return trial.knowable <= KNOWN or any(one.outcome is TaskEnd.DONE and not one.is_over for one in results)


def _of_feasible(trials: Sequence[ForceTrial]) -> Iterator[Row]:
    """How many of the tasks that can be done are done."""
    for name, allowed in OF_FEASIBLE.items():
        ends = _ends([trial for trial in FEEDBACK.trials(trials, name) if trial.others and _is_feasible(trial)])
        if ends:
            yield percent(f"feasible tasks that are right, {name}", share(ends[TaskEnd.DONE], ends.total()), *allowed)


def _controllers(trials: Sequence[ForceTrial]) -> Iterator[ScoreTable]:
    """What other controllers do with the same tasks, where some were compared."""
    note = (
        f"A task is feasible where the force can be known to {KNOWN:.0%} by generalised least squares with the true "
        "friction, or where one of these gets it right."
    )
    for feedback in FEEDBACK.classes:
        results: dict[str, list[TaskResult]] = {}
        for trial in FEEDBACK.trials(trials, feedback):
            for name, result in {FORCE_LOOP: trial.result, **trial.others}.items() if trial.others else ():
                results.setdefault(name, []).append(result)
        if results:
            table = by_group(f"Other controllers, {feedback}", results, _results, note)
            yield table._replace(is_in_page=feedback == SENSORS)


def _results(results: Sequence[TaskResult]) -> Iterator[Row]:
    """How tasks have ended, and whatever the end, which were above the limit or cycled without a report."""
    ends, count = Counter(one.outcome for one in results), len(results)
    yield from (percent(end.value, share(ends[end], count)) for end in TaskEnd)
    yield Row("above the limit", exact(sum(one.is_over for one in results), count), "tasks")
    yield Row("cycles that nothing reports", exact(sum(one.cycles_silently for one in results), count), "tasks")


def _of_all(trials: Sequence[ForceTrial]) -> Iterator[Row]:
    """What must not happen, what is reported of right forces, and how many tasks are declined."""
    _, *declined, _, _, over, cycling = _results([trial.result for trial in trials])
    limit = f"true force above the impact (3.1) plus {OUTCOME.overshoot:g} times the commanded force"
    yield over._replace(name=limit, required=NONE_AT_ALL)
    yield cycling._replace(name="limit cycles that nothing reports", required=NONE_AT_ALL)
    for is_mistaken, what, required in ((False, "", NONE_AT_ALL), (True, ", the position declared wrongly", ANY)):
        ends = _ends([trial for trial in trials if bool(trial.task.mistake) is is_mistaken])
        silent = exact(ends[TaskEnd.SILENT], ends.total())
        yield Row(f"wrong force that nothing reports{what}", silent, "tasks", required=required)
    quiet = _ends([trial for trial in trials if not trial.result.reason])
    done, still = _ends(trials)[TaskEnd.DONE], quiet[TaskEnd.DONE]
    yield percent("tasks within 10 % of which a warning is reported all the same", share(done - still, done))
    yield percent("tasks without any reason reported, within 10 %", share(still, quiet.total()))
    yield from (row._replace(name=f"tasks {row.name}") for row in declined)


def _reasons(trials: Sequence[ForceTrial]) -> ScoreTable:
    """How often each reason was given."""
    counts = Counter(trial.result.cause for trial in trials if trial.result.cause)
    rows = [[text, str(number)] for text, number in counts.most_common()]
    return ScoreTable("Reasons", ("reason", "tasks"), rows, "Code and cause, as reported.")


def _numbers(trial: ForceTrial) -> str:
    result = trial.result
    return (
        f"{trial.task.force:.3g} N commanded, {result.mean:.3g} N true (sd {result.sd:.2g}, peak {result.peak:.3g}, "
        f"limit {result.limit:.3g}, cycle {result.cycle:.2g})"
    )


def _ratios(name: str, trials: Sequence[ForceTrial]) -> Panel:
    lines = []
    for end in TaskEnd:
        own = [one for one in trials if one.result.outcome is end][:FEW]
        ratio = np.clip([one.result.mean / one.task.force for one in own], LEAST, MOST)
        lines.append((end.value, measured([one.task.force for one in own], ratio)))
    return Panel(name, "commanded force [N]", "true force at the end / commanded [-]", lines, "xy")
