"""Random forces on random surfaces: outcomes by class of task, true force against the commanded one."""

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import NamedTuple

import numpy as np

from wam_studies.figures.panels import FEW, Panel, Panels, measured
from wam_studies.force_benchmark.outcome import OUTCOME, TaskEnd, TaskResult
from wam_studies.force_benchmark.tasks import RANGES, Task, draw, task_values
from wam_studies.force_benchmark.trial import ForceTaskCase, ForceTrial, play
from wam_studies.harness import Study, option
from wam_studies.scores import NONE_AT_ALL, Row, Scores, ScoreTable, exact, share

SENSORS, MOTORS = "joint sensors", "motors with dither"
STIFFNESS_ENDS = {"400 to 4000": 4e3, "4000 to 40 000": 4e4, "40 000 to 400 000": 4e5}  # N/m
FORCE_ENDS = {"1 to 3": 3.0, "3 to 10": 10.0, "10 to 40": 40.0}  # N
MOTIONS = ("at rest", "moves along the force", "moves across it")
UNKNOWNS = (
    "masses, centres, friction, cables, constants",
    "a payload, too",
    "the law of friction, too",
    "the position, declared wrongly",
)
COURSES = ("one force", "another force first", "small force for long")


class TaskGrouping(NamedTuple):
    """A way to divide the tasks: its title, its classes in order, and the class of a task."""

    title: str
    classes: Sequence[str]
    of: Callable[[Task], str]

    def trials(self, every: Sequence[ForceTrial], name: str) -> list[ForceTrial]:
        """Those of a class."""
        return [trial for trial in every if self.of(trial.task) == name]


def _below(ends: dict[str, float], value: float) -> str:
    return next((name for name, end in ends.items() if value <= end), list(ends)[-1])


def contact_of(task: Task) -> str:
    """What the link touches."""
    if task.surface.is_plane:
        return "plane at the tip"
    return f"rod across the {task.surface.cover.replace('_', ' ')}"


def _motion(task: Task) -> str:
    surface = task.surface
    is_across = surface.speed <= 1e-6 * surface.slide_speed  # apart from rounding
    return MOTIONS[0] if not surface.frequency else MOTIONS[2] if is_across else MOTIONS[1]


def unknown_of(task: Task) -> str:
    """What the controllers do not know."""
    if task.mistake:
        return UNKNOWNS[3]
    return UNKNOWNS[1] if task.payload else UNKNOWNS[2] if task.asymmetry else UNKNOWNS[0]


def course_of(task: Task) -> str:
    """The forces of a task, one after the other."""
    return COURSES[2] if task.longer > 1.0 else COURSES[bool(task.before)]


FEEDBACK = TaskGrouping("feedback", (SENSORS, MOTORS), lambda task: MOTORS if task.is_dithered else SENSORS)
STIFFNESS = TaskGrouping(
    "stiffness [N/m]", tuple(STIFFNESS_ENDS), lambda task: _below(STIFFNESS_ENDS, task.surface.stiffness)
)
POSE = TaskGrouping("pose", tuple(RANGES.poses), lambda task: task.pose)
FORCE = TaskGrouping("force [N]", tuple(FORCE_ENDS), lambda task: _below(FORCE_ENDS, task.force))
POSITION = TaskGrouping(
    "contact position", ("pinned", "estimated"), lambda task: "pinned" if task.is_pinned else "estimated"
)
TARE = TaskGrouping("tare", ("tared", "not tared"), lambda task: "tared" if task.is_tared else "not tared")
GROUPINGS = (
    FEEDBACK,
    STIFFNESS,
    POSE,
    FORCE,
    TaskGrouping("contact", ("plane at the tip", "rod across the outer link", "rod across the inner link"), contact_of),
    POSITION,
    TARE,
    TaskGrouping("surface", MOTIONS, _motion),
    TaskGrouping("forces", ("one", "two at once"), lambda task: "two at once" if task.second else "one"),
    TaskGrouping("command", ("step", "ramp"), lambda task: "ramp" if task.ramp else "step"),
    TaskGrouping("course", COURSES, course_of),
    TaskGrouping("not known", UNKNOWNS, unknown_of),
)

ACCEPTED = {SENSORS: (0.93, 0.97), MOTORS: (0.9, 0.95)}  # share of accepted tasks that is right: required, aim
OF_FEASIBLE = {SENSORS: (0.6, 0.85), MOTORS: (0.4, 0.7)}  # share of the feasible ones: the same
LEAST, MOST = 0.1, 10.0  # of the commanded force, drawn
KNOWN = 0.05  # error of a force, per force, up to which it can be known


@dataclass(frozen=True)
class ForceStudy(Study[ForceTaskCase, ForceTrial]):
    """Tasks, each drawn from the seed and its number alone."""

    title = "force control on random surfaces in random poses"
    page = "docs/force.md"
    seeds = (1,)
    count = 100

    seconds: float = option(RANGES.seconds, "time at the full force in each task, s", 1.0)
    compare: bool = option(False, "also run each task with other controllers; takes four times as long")

    def cases(self, seed: int) -> Iterator[ForceTaskCase]:
        """Tasks without end."""
        arm = self.configuration.shared.arm
        return (
            ForceTaskCase(self.configuration, seed, number, draw(arm, seed, number), self.seconds, self.compare)
            for number in count()
        )

    run = staticmethod(play)

    def own_values(self, case: ForceTaskCase) -> Collection[str]:
        """What the task declares."""
        return task_values(case.configuration, case.task)

    def score(self, records: Sequence[ForceTrial]) -> Scores:
        """Shares of accepted tasks, what must not happen, outcomes by class, reasons."""
        rows = [*_accepted(records), *_of_feasible(records), *_forbidden(records), *_further(records)]
        compared = [_controllers(records)] if any(trial.others for trial in records) else []
        return Scores(rows, [*compared, _outcomes(records), _reasons(records)])

    def failure(self, record: ForceTrial) -> str:
        """A wrong force without a reason, a force above the limit, an unreported cycle."""
        task = record.task
        what = FEEDBACK.of(task), POSE.of(task), contact_of(task), POSITION.of(task)
        kinds = " and ".join(_kinds(record))
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

    def details(self, record: ForceTrial) -> str:
        """A task and its result in full."""
        task, result = record.task, record.result
        surface, ramp = task.surface, task.ramp
        along = ", ".join(f"{x:.3f}" for x in surface.direction)
        first = f": {task.before:.3g} N" if task.before else ""
        lines = [
            f"task {record.number} of seed {record.seed}: {result.outcome.value}; {_numbers(record)}",
            f"  pose ({', '.join(f'{angle:.3f}' for angle in task.q)}) rad, {task.pose}",
            f"  {contact_of(task)}: {surface.position:.3f} m of {surface.cover}, along ({along})",
            f"  surface of {surface.stiffness:.4g} N/m, friction {surface.friction:.2f}; ramp of {ramp:.2g} s",
            f"  {course_of(task)}{first}; not known: {unknown_of(task)}",
            f"  feedback from {FEEDBACK.of(task)}; contact position {POSITION.of(task)}; {TARE.of(task)}",
        ]
        return "\n".join([*lines, f"  reason: {result.reason}"] if result.reason else lines)


def _of_end(trials: Sequence[ForceTrial], *ends: TaskEnd) -> int:
    return sum(trial.result.outcome in ends for trial in trials)


def _accepted(trials: Sequence[ForceTrial]) -> Iterator[Row]:
    """How many accepted tasks end with the force, where the user makes no mistake."""
    for name, (least, aim) in ACCEPTED.items():
        own = [trial for trial in FEEDBACK.trials(trials, name) if not trial.task.mistake]
        done, refused = _of_end(own, TaskEnd.DONE), _of_end(own, TaskEnd.REFUSED)
        title = f"accepted tasks within {OUTCOME.tolerance:.0%}, {name}"
        accepted = len(own) - refused - _of_end(own, TaskEnd.GIVEN_UP)
        yield Row(title, share(done, accepted), "%", 100.0, (least, 1.0), (aim, 1.0))
        yield Row(f"{title}, and those given up count as accepted", share(done, len(own) - refused), "%", 100.0)


def _is_feasible(trial: ForceTrial) -> bool:
    """Whether the force can be known, or anything compared gets it right."""
    results = [trial.result, *trial.others.values()]
    return trial.knowable <= KNOWN or any(one.outcome is TaskEnd.DONE and not one.is_over for one in results)


def _of_feasible(trials: Sequence[ForceTrial]) -> Iterator[Row]:
    """How many of the tasks that can be done are done."""
    for name, (least, aim) in OF_FEASIBLE.items():
        own = [trial for trial in FEEDBACK.trials(trials, name) if trial.others and _is_feasible(trial)]
        if own:
            found = share(_of_end(own, TaskEnd.DONE), len(own))
            yield Row(f"right, of the feasible, {name}", found, "%", 100.0, (least, 1.0), (aim, 1.0))


def _controllers(trials: Sequence[ForceTrial]) -> ScoreTable:
    """What other controllers do with the same tasks."""
    compared = [trial for trial in trials if trial.others]
    names = list(dict.fromkeys(name for trial in compared for name in trial.others))
    rows = []
    for feedback in FEEDBACK.classes:
        own = FEEDBACK.trials(compared, feedback)
        results = {"force loop": [trial.result for trial in own]}
        results |= {name: [trial.others[name] for trial in own if name in trial.others] for name in names}
        rows += [[feedback, name, *map(str, _counted(found))] for name, found in results.items()]
    note = (
        f"A task is feasible where the force can be known to {KNOWN:.0%} by generalised least squares with the true "
        "friction, or where one of these gets it right."
    )
    head = ("feedback", "controller", "tasks", "within 10 %", "wrong", "above the limit")
    return ScoreTable("Other controllers", head, rows, note)


def _counted(results: Sequence[TaskResult]) -> tuple[int, int, int, int]:
    """Tasks, those that are right, those that are wrong and not declined, those above the limit."""
    ends = Counter(one.outcome for one in results)
    wrong = ends[TaskEnd.ENDED] + ends[TaskEnd.SILENT]
    return len(results), ends[TaskEnd.DONE], wrong, sum(one.is_over for one in results)


def _forbidden(trials: Sequence[ForceTrial]) -> Iterator[Row]:
    """What must not happen."""
    over = f"true force above the impact (3.1) plus {OUTCOME.overshoot:g} times the commanded force"
    own = [trial for trial in trials if not trial.task.mistake]
    mistaken = [trial for trial in trials if trial.task.mistake]
    for title, number, of in (
        (over, sum(trial.result.is_over for trial in trials), trials),
        ("limit cycles that nothing reports", sum(trial.result.cycles_silently for trial in trials), trials),
        ("wrong force without a reason", _of_end(own, TaskEnd.SILENT), own),
    ):
        yield Row(title, exact(number, len(of)), "tasks", required=NONE_AT_ALL)
    silent = exact(_of_end(mistaken, TaskEnd.SILENT), len(mistaken))
    yield Row("wrong force without a reason, the position declared wrongly", silent, "tasks")


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


def _ratios(name: str, trials: Sequence[ForceTrial]) -> Panel:
    lines = []
    for end in TaskEnd:
        own = [one for one in trials if one.result.outcome is end][:FEW]
        ratio = np.clip([one.result.mean / one.task.force for one in own], LEAST, MOST)
        lines.append((end.value.partition(":")[0], measured([one.task.force for one in own], ratio)))
    return Panel(name, "commanded force [N]", "true force at the end / commanded [-]", lines, "xy")
