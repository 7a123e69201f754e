"""The classes into which the tasks are divided, in the page and the picture."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from wam_studies.force_benchmark.tasks import RANGES, Task
from wam_studies.force_benchmark.trial import ForceTrial

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
    conditions = task.conditions
    if task.mistake:
        return UNKNOWNS[3]
    return UNKNOWNS[1] if conditions.payload else UNKNOWNS[2] if conditions.asymmetry else UNKNOWNS[0]


def course_of(task: Task) -> str:
    """The forces of a task, one after the other."""
    return COURSES[2] if task.longer > 1.0 else COURSES[bool(task.before)]


FEEDBACK = TaskGrouping("feedback", (SENSORS, MOTORS), lambda task: MOTORS if task.conditions.is_dithered else SENSORS)
STIFFNESS = TaskGrouping(
    "stiffness [N/m]", tuple(STIFFNESS_ENDS), lambda task: _below(STIFFNESS_ENDS, task.surface.stiffness)
)
POSE = TaskGrouping("pose", tuple(RANGES.poses), lambda task: task.pose)
FORCE = TaskGrouping("force [N]", tuple(FORCE_ENDS), lambda task: _below(FORCE_ENDS, task.force))
POSITION = TaskGrouping(
    "contact position", ("pinned", "estimated"), lambda task: "pinned" if task.conditions.is_pinned else "estimated"
)
TARE = TaskGrouping("tare", ("tared", "not tared"), lambda task: "tared" if task.conditions.is_tared else "not tared")
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
    TaskGrouping("command", ("step", "ramp"), lambda task: "ramp" if task.conditions.ramp else "step"),
    TaskGrouping("course", COURSES, course_of),
    TaskGrouping("not known", UNKNOWNS, unknown_of),
)
