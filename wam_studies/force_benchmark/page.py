"""The result of the benchmark as text: tables, failures with the command that repeats each, and the page."""

import re
from collections import Counter
from collections.abc import Callable, Sequence
from typing import NamedTuple

from wam_analysis.table import markdown, plain
from wam_studies.contact_benchmark.statistics import Interval, counted, share
from wam_studies.force_benchmark.evaluation import ForceTrial
from wam_studies.force_benchmark.outcome import OVERSHOOT, TOLERANCE, TaskEnd
from wam_studies.force_benchmark.surfaces import GAP
from wam_studies.force_benchmark.tasks import (
    ASYMMETRY,
    AT_REST,
    CABLES,
    CHANGES,
    DOUBLED,
    DOWN,
    FARTHEST,
    FIRST_HELD,
    FORCES,
    FREQUENCIES,
    FRICTION,
    FRICTIONS,
    FULL_FRICTION,
    LOADED,
    LONG,
    LONGER,
    MASS,
    MOVING,
    OTHERWISE,
    PAYLOADS,
    POSES,
    SECONDS,
    SMALL_FORCES,
    SOFT,
    SPEEDS,
    STEPPED,
    STIFFNESSES,
    TORQUE,
    Task,
)

SENSORS, MOTORS = "joint sensors", "motors with dither"
REQUIRED = {SENSORS: 0.95, MOTORS: 0.9}  # share of accepted tasks within the tolerance
STIFFNESS_ENDS = {"400 to 4000": 4e3, "4000 to 40 000": 4e4, "40 000 to 400 000": 4e5}  # N/m
FORCE_ENDS = {"1 to 3": 3.0, "3 to 10": 10.0, "10 to 40": 40.0}  # N
MOTIONS = ("at rest", "moves along the force", "moves across it")
UNKNOWNS = ("masses, friction, cables, constants", "a payload, too", "the law of friction, too")
COURSES = ("one force", "another force first", "small force for long")
STEADY = 1e-6  # m/s along the force, of a surface that moves across it
LISTED = 40  # failures of one kind
NUMBER = re.compile(r"(?:(?<!\+)[-+])?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
HEAD = ("", "tasks", "within 10 %", "refused", "given up", "ended", "silent", "above the limit", "cycles unreported")


class TaskGrouping(NamedTuple):
    """A way to divide the tasks: its title, its classes in order, and the class of a task."""

    title: str
    classes: Sequence[str]
    of: Callable[[Task], str]


def _below(ends: dict[str, float], value: float) -> str:
    return next((name for name, end in ends.items() if value <= end), list(ends)[-1])


def _contact(task: Task) -> str:
    if task.surface.is_plane:
        return "plane at the tip"
    return f"rod across the {task.surface.cover.replace('_', ' ')}"


def _motion(task: Task) -> str:
    surface = task.surface
    return MOTIONS[0] if not surface.frequency else MOTIONS[1] if surface.speed > STEADY else MOTIONS[2]


def _unknown(task: Task) -> str:
    conditions = task.conditions
    return UNKNOWNS[1] if conditions.payload else UNKNOWNS[2] if conditions.asymmetry else UNKNOWNS[0]


def _course(task: Task) -> str:
    return COURSES[2] if task.longer > 1.0 else COURSES[bool(task.before)]


GROUPINGS = (
    TaskGrouping("feedback", (SENSORS, MOTORS), lambda task: MOTORS if task.conditions.is_dithered else SENSORS),
    TaskGrouping("stiffness [N/m]", tuple(STIFFNESS_ENDS), lambda task: _below(STIFFNESS_ENDS, task.surface.stiffness)),
    TaskGrouping("pose", tuple(POSES), lambda task: task.pose),
    TaskGrouping("force [N]", tuple(FORCE_ENDS), lambda task: _below(FORCE_ENDS, task.force)),
    TaskGrouping("contact", ("plane at the tip", "rod across the outer link", "rod across the inner link"), _contact),
    TaskGrouping(
        "contact position", ("pinned", "estimated"), lambda task: "pinned" if task.conditions.is_pinned else "estimated"
    ),
    TaskGrouping("tare", ("tared", "not tared"), lambda task: "tared" if task.conditions.is_tared else "not tared"),
    TaskGrouping("surface", MOTIONS, _motion),
    TaskGrouping("forces", ("one", "two at once"), lambda task: "two at once" if task.second else "one"),
    TaskGrouping("command", ("step", "ramp"), lambda task: "ramp" if task.conditions.ramp else "step"),
    TaskGrouping("course", COURSES, _course),
    TaskGrouping("not known", UNKNOWNS, _unknown),
)


def of_class(trials: Sequence[ForceTrial], grouping: TaskGrouping, name: str) -> list[ForceTrial]:
    """The trials of a class."""
    return [trial for trial in trials if grouping.of(trial.task) == name]


def required(trials: Sequence[ForceTrial]) -> list[tuple[str, str, str, bool, int]]:
    """What is required: name, required and found value, whether it is met, and of how many tasks that is."""
    rows = []
    for name, least in REQUIRED.items():
        own = of_class(trials, GROUPINGS[0], name)
        title = f"accepted tasks within {TOLERANCE:.0%}, {name}"
        for more, needed, declined in (
            ("", f"at least {least:.0%}", (TaskEnd.REFUSED, TaskEnd.GIVEN_UP)),
            (", and those given up count as accepted", "", (TaskEnd.REFUSED,)),
        ):
            accepted = [trial for trial in own if trial.result.outcome not in declined]
            if accepted:
                found = share(sum(t.result.outcome is TaskEnd.DONE for t in accepted), len(accepted))
                rows.append((title + more, needed, _text(found), not needed or found.value >= least, len(accepted)))
    for title, count in (
        (f"true force above {OVERSHOOT:g} times the commanded plus the impact (3.1)", sum(map(_is_over, trials))),
        ("limit cycles that nothing reports", sum(trial.result.cycles_silently for trial in trials)),
        ("wrong force without a reason", len(silent(trials))),
    ):
        rows.append((title, "0", str(count), count == 0, len(trials)))
    done = [trial for trial in trials if trial.result.outcome is TaskEnd.DONE]
    warned = sum(bool(trial.result.reason) for trial in done)
    rows.append(
        (
            "tasks within 10 % of which a warning is reported all the same",
            "",
            f"{warned} of {len(done)}",
            True,
            len(done),
        )
    )
    believed = [t for t in trials if not t.result.reason]
    right = share(sum(t.result.outcome is TaskEnd.DONE for t in believed), max(len(believed), 1))
    rows.append(
        (f"of the tasks without any reason reported, within {TOLERANCE:.0%}", "", _text(right), True, len(believed))
    )
    for end in (TaskEnd.REFUSED, TaskEnd.GIVEN_UP):
        found = share(sum(trial.result.outcome is end for trial in trials), len(trials))
        rows.append((f"tasks {end.value}", "", f"{found.value:.1%} of {found.observed}", True, len(trials)))
    return rows


def _text(found: Interval) -> str:
    return f"{found.value:.1%} of {found.observed} ({found.low:.1%} to {found.high:.1%})"


def _is_over(trial: ForceTrial) -> bool:
    return trial.result.is_over


def silent(trials: Sequence[ForceTrial]) -> list[ForceTrial]:
    """Tasks with a wrong force and no reason."""
    return [trial for trial in trials if trial.result.outcome is TaskEnd.SILENT]


def _counts(name: str, trials: Sequence[ForceTrial]) -> list[str]:
    ends = Counter(trial.result.outcome for trial in trials)
    shares = [f"{ends[end] / len(trials):.0%}" if trials else "–" for end in TaskEnd]
    others = [sum(map(_is_over, trials)), sum(trial.result.cycles_silently for trial in trials)]
    return [name, str(len(trials)), *shares, *map(str, others)]


def _reasons(trials: Sequence[ForceTrial]) -> list[list[str]]:
    """How often each reason was given, without its numbers."""
    texts = [NUMBER.sub("#", trial.result.reason.split(";")[0])[:150] for trial in trials if trial.result.reason]
    return [[text, str(count)] for text, count in Counter(texts).most_common()]


def command(seed: int, number: int) -> str:
    """The command that does one task again."""
    return f"wam evaluate force --seed {seed} --only {number}"


def line(trial: ForceTrial) -> list[str]:
    """A task and its result in a row, as `LINE_HEAD`."""
    task, result = trial.task, trial.result
    surface, conditions = task.surface, task.conditions
    what = [grouping.of(task) for grouping in (GROUPINGS[0], GROUPINGS[2], GROUPINGS[4], GROUPINGS[5])]
    numbers = [task.force, result.mean, result.sd, result.peak, result.limit, result.cycle, surface.stiffness]
    tared = "tared" if conditions.is_tared else ""
    return [str(trial.number), *what, tared, *(f"{value:.3g}" for value in numbers), f"{surface.friction:.2f}"]


LINE_HEAD = (
    "task", "feedback", "pose", "contact", "position", "", "commanded [N]", "true [N]", "sd [N]", "peak [N]",
    "limit [N]", "cycle [N]", "k_c [N/m]", "friction",
)  # fmt: skip


def report(seed: int, code: str, trials: Sequence[ForceTrial]) -> str:
    """The output of the command: what is required, shares, and the failures with their commands."""
    lines = [f"code and configuration: {code}"]
    lines += [
        f"{title}: {found}" + (f"; required {needed}" if needed else "")
        for title, needed, found, *_ in required(trials)
    ]
    lines += ["", *plain([HEAD], [_counts("all", trials)])]
    failures = [t for t in trials if t.result.outcome is TaskEnd.SILENT or t.result.is_over or t.result.cycles_silently]
    for trial in failures[:LISTED]:
        lines.append(f"{_what(trial)}: {', '.join(cell for cell in line(trial)[1:6] if cell)}, {_numbers(trial)}")
        lines.append(f"    {command(seed, trial.number)}")
    if len(failures) > LISTED:
        lines.append(f"{len(failures) - LISTED} more failures")
    return "\n".join(lines)


def _what(trial: ForceTrial) -> str:
    result = trial.result
    parts = ("silent", result.outcome is TaskEnd.SILENT), ("above the limit", result.is_over)
    return " and ".join(text for text, holds in (*parts, ("unreported cycle", result.cycles_silently)) if holds)


def _numbers(trial: ForceTrial) -> str:
    result = trial.result
    return (
        f"{trial.task.force:.3g} N commanded, {result.mean:.3g} N true (sd {result.sd:.2g}, peak {result.peak:.3g}, "
        f"limit {result.limit:.3g}, cycle {result.cycle:.2g})"
    )


def details(seed: int, trial: ForceTrial) -> str:
    """One task and its result in full."""
    task, result = trial.task, trial.result
    surface, conditions = task.surface, task.conditions
    place = f"{surface.position:.3f} m of {surface.cover}, along ({', '.join(f'{x:.3f}' for x in surface.direction)})"
    lines = [
        f"task {trial.number} of seed {seed}: {result.outcome.value}; {_numbers(trial)}",
        f"  pose ({', '.join(f'{angle:.3f}' for angle in task.q)}) rad, {task.pose}; {_contact(task)}: {place}",
        f"  surface of {surface.stiffness:.4g} N/m, friction {surface.friction:.2f}; ramp of {conditions.ramp:.2g} s",
        f"  {_course(task)}{f': {task.before:.3g} N' if task.before else ''}; not known: {_unknown(task)}",
        f"  feedback from {GROUPINGS[0].of(task)}; contact position {GROUPINGS[5].of(task)}; {GROUPINGS[6].of(task)}",
        f"  force gain {result.gain:.3g} m/s/N",
    ]
    return "\n".join([*lines, f"  reason: {result.reason}"] if result.reason else lines)


def page(trials: Sequence[ForceTrial], seed: int, code: str, repeat: str, picture: str) -> str:
    """The page of the documentation.

    Parameters
    ----------
    trials : of the benchmark.
    seed : of all of them.
    code : hash of what they are a result of.
    repeat : command that writes this page.
    picture : the figure's path relative to the page.
    """
    rows = [
        [title, needed, found, counted("" if not needed else "met" if is_met else "**MISSED**", number)]
        for title, needed, found, is_met, number in required(trials)
    ]
    parts = [
        PREFACE.format(command=repeat, count=len(trials), code=code),
        f"![True against commanded force, outcomes by class, peaks]({picture})",
        "",
        markdown(("", "required", "found", ""), rows),
        "## Outcomes",
        "",
        "Fractions of all tasks of a class; the last two columns are numbers of tasks, whatever their outcome.",
        "",
    ]
    for grouping in GROUPINGS:
        head = (grouping.title, *HEAD[1:])
        tally = [_counts(name, of_class(trials, grouping, name)) for name in grouping.classes]
        parts += [markdown(head, [*tally, _counts("all", trials)])]
    parts += [
        "## Reasons",
        "",
        "As reported, without their numbers.",
        "",
        markdown(("reason", "tasks"), _reasons(trials)),
    ]
    failures = (
        ("Silent failures", silent(trials)),
        ("Above the limit", [trial for trial in trials if trial.result.is_over]),
        ("Unreported cycles", [trial for trial in trials if trial.result.cycles_silently]),
    )
    for title, found in failures:
        if found:
            more = f", the first {LISTED} of {len(found)}" if len(found) > LISTED else ""
            parts += [f"## {title}", "", f"`{command(seed, found[0].number)}` repeats one{more}.", ""]
            parts += [markdown(LINE_HEAD, map(line, found[:LISTED]))]
    return "\n".join([*parts, RULES])


PREFACE = f"""# Benchmark of force control

Written by `{{command}}`; nothing here is written by hand.

{{count}} tasks, each drawn from the seed and its number alone: pose, contact, force, friction of the surface,
feedback, ramp, motion of the surface, and a true arm that differs from the configured one, uniformly distributed:
masses by up to {MASS:.0%}, friction by {FRICTION:.0%}, cable stiffness by {CABLES:.0%}, motor constants by
{TORQUE:.0%}. Forces are {FORCES[0]:g} to {FORCES[1]:g} N, surfaces {STIFFNESSES[0]:.0f} to {STIFFNESSES[1]:.0f} N/m
with friction {FRICTIONS[0]:g} to {FRICTIONS[1]:g}.

A task is *accepted* where it is neither refused before the arm moves, nor given up before the true force was above the
commanded one. An accepted task that ends with a wrong force counts against the fractions below, whatever was reported.

Code and configuration: `{{code}}`, a hash of the packages that control and simulate, of the tasks and how they are
evaluated, and of the configuration. The command prints that of the code it runs.
"""
RULES = f"""## Method

* The arm is released {1e3 * GAP:g} mm from the surface; half of the tasks tare then. The force is commanded at once
  or as a ramp, and held for {SECONDS:g} s. The mean of the true force along the command over the last 0.48 s is
  compared with the commanded one.
* The user declares the stiffness of the surface and the pose, and takes the largest `force_gain` that the guard
  accepts, at most the configured one. A pinned contact position is the true one; with an estimated one the
  configuration stays as it is.
* Refused: the loop reports a reason and neither moves nor touches anything, or the stack does not start. Given up:
  the arm has moved or touched, then holds with a reason, and the true force was never above the commanded one, as
  where another link is touched than commanded. Ended: the force is not within 10 %, or the arm is held, and a reason
  is reported. Silent: the force is wrong and nothing is reported.
* Above the limit: at some time the true force is above {OVERSHOOT:g} times the commanded plus the impact of (3.1), for
  which all kinetic energy of links and rotors at the first touch goes into the surface.
* A cycle is a motion of the force that repeats in the last 2 s, above 10 % of the commanded force peak to peak. It
  counts as reported if the loop gives a reason, or the guard predicts at least half of its size.
* {MOVING:.0%} of the surfaces move, as a sine after {AT_REST:g} s of the whole force, half of them along it: with
  {1e3 * SPEEDS[0]:g} to {1e3 * SPEEDS[1]:g} mm/s, at {FREQUENCIES[0]:g} to {FREQUENCIES[1]:g} Hz, by
  {1e3 * FARTHEST:g} mm at most. The user declares the speed along the force (`limits.surface_speed`) and across it
  (`limits.slide_speed`), a friction of {FULL_FRICTION:g}, which is there in full (`sensing.friction`), and how far a
  pinned position moves along the link (`contact_position_sd`).
* {DOUBLED:.0%} of the tasks have a second force elsewhere, commanded at the same time by a task frame of two axes at
  known positions. Such a task has ended as the force with the greater failure.
* Of the other tasks {STEPPED:.0%} command another force first, for {FIRST_HELD:g} s: {CHANGES[0]:g} to {CHANGES[1]:g}
  times the force that is assessed in {DOWN:.0%} of them, else as much less. The largest force allowed is that of the
  larger command, and at the end that of the last one. Where the first command was obeyed and the second one is
  declined with a reason, the task is given up if the true force is not above the second. {LONG:.0%} are
  {SMALL_FORCES[0]:g} to {SMALL_FORCES[1]:g} N for {LONGER:g} times as long, {LONGER * SECONDS:g} s, at a pinned
  position of a surface of up to {SOFT:g} N/m.
* {LOADED:.0%} of the arms carry an undeclared {PAYLOADS[0]:g} to {PAYLOADS[1]:g} kg, and in {OTHERWISE:.0%}
  friction falls with the speed as Stribeck's and is up to {ASYMMETRY:.0%} larger in one direction.
"""
