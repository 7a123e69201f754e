"""The force tasks by which the loop was first measured: the usual ones and those that went wrong.

A rod across the outer link, a plane at its end, poses in which its contact position cannot be observed; with the
position estimated and with it pinned.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from wam_analysis.table import markdown
from wam_description.configuration import Configuration
from wam_description.rigid_body import RigidBody
from wam_studies.force_benchmark.outcome import TaskEnd, TaskResult
from wam_studies.force_benchmark.surfaces import Surface
from wam_studies.force_benchmark.tasks import Task, triple
from wam_studies.force_benchmark.trial import perform


@dataclass(frozen=True)
class UsualSurface:
    """Pose of the demonstration, rad; stiffness, N/m, and friction of what is pressed."""

    pose: tuple[float, ...] = (0.0, -1.8, 0.0, 1.45)
    stiffness: float = 4000.0
    friction: float = 0.3


USUAL = UsualSurface()
FORCES = (5.0, 15.0)  # N, of the nearly straight arm


class ForceTaskRow(NamedTuple):
    """A task, with its position estimated and pinned."""

    name: str
    task: Task
    estimated: TaskResult
    pinned: TaskResult


def rod(base: Configuration, q: Sequence[float], place: float, force: float, friction: float = USUAL.friction) -> Task:
    """A rod across the outer link at a position, m, pressed in the plane of the links."""
    return _task(base, q, place, force, 0.0, friction)


def tip(base: Configuration, q: Sequence[float], force: float, lean: float) -> Task:
    """A plane at the end of the outer link, tilted by an angle, rad, from its normal."""
    return _task(base, q, base.shared.arm.covers.length[-1], force, lean, USUAL.friction)


def _task(base: Configuration, q: Sequence[float], place: float, force: float, lean: float, friction: float) -> Task:
    arm = base.shared.arm
    rotation = RigidBody(arm).cover_pose(q, arm.covers.names[-1]).rotation
    direction = triple(math.sin(lean) * rotation[:, 0] - math.cos(lean) * rotation[:, 1])
    return Task(tuple(q), Surface(arm.covers.names[-1], place, direction, USUAL.stiffness, friction, bool(lean)), force)


def tasks(base: Configuration) -> Iterator[tuple[str, Task]]:
    """Every task with its name."""
    for force in (1.0, 5.0, 10.0, 20.0, 40.0):
        yield f"rod at 0.28 m, {force:g} N", rod(base, USUAL.pose, 0.28, force)
    for place in (0.05, 0.1, 0.2, 0.35, 0.39):
        yield f"rod at {place:g} m, 15 N", rod(base, USUAL.pose, place, 15.0)
    for friction in (0.0, 0.8):
        yield f"rod at 0.28 m, 10 N, friction {friction:g}", rod(base, USUAL.pose, 0.28, 10.0, friction)
    yield "elbow at 90 deg, rod at 0.28 m, 10 N", rod(base, (0.0, -1.0, 0.0, 0.0), 0.28, 10.0)
    yield "theta2 = 0, rod at 0.28 m, 10 N", rod(base, (0.0, 0.0, 0.0, 0.6), 0.28, 10.0)
    for bend in (7.0, 33.0):
        q = (0.0, -1.0, 0.0, math.pi / 2.0 - math.radians(bend))
        for lean in (30.0, 40.0):
            yield (
                f"plane tilted {lean:g} deg, elbow {bend:g} deg from straight, 10 N",
                tip(base, q, 10.0, math.radians(lean)),
            )


def perform_all(base: Configuration, seconds: float = 3.0) -> Iterator[ForceTaskRow]:
    """Each task in simulation, one row at a time."""
    for name, task in tasks(base):
        sources = (perform(base, task, seconds, {"force_loop:contact_source": s}) for s in ("estimated", "pinned"))
        yield ForceTaskRow(name, task, *sources)


def table(rows: Sequence[ForceTaskRow]) -> str:
    """Error of the true force, and its peak, in per cent of the commanded one, in Markdown; a star for a reason."""
    lines = ["| task | position estimated | pinned |", "| --- | --- | --- |"]
    lines += [f"| {row.name} | {_cell(row.task, row.estimated)} | {_cell(row.task, row.pinned)} |" for row in rows]
    return "\n".join(lines)


def _cell(task: Task, result: TaskResult) -> str:
    if result.outcome is TaskEnd.REFUSED:
        return "refused"
    error, over = (100.0 * (force / task.force - 1.0) for force in (result.mean, result.peak))
    return f"{error:+.0f} ({over:+.0f})" + (" *" if result.reason else "")


def elbow_table(base: Configuration, seconds: float = 3.0) -> str:
    """Mean and peak of the true force of a nearly straight arm, N, in Markdown; with a star for a reason.

    The elbow is bent by 0 to 0.5 rad, against a wall ahead and a rod at its side.
    """
    arm = base.shared.arm
    body, cover, length = RigidBody(arm), arm.covers.names[-1], arm.covers.length[-1]
    lines = []
    for bend in [round(0.05 * k, 2) for k in range(11)]:
        q = (0.0, -1.0, 0.0, math.pi / 2.0 - bend)
        tip, aside = body.point(q, cover, (length, 0.0, 0.0)), body.cover_pose(q, cover).rotation[:, 2]
        wall = Surface(cover, length, triple(tip / np.linalg.norm(tip)), USUAL.stiffness, USUAL.friction, True)
        side = Surface(cover, 0.28, triple(aside), USUAL.stiffness, USUAL.friction, False)
        done = [perform(base, Task(q, surface, force), seconds) for surface, force in product((wall, side), FORCES)]
        lines.append([f"{bend:g}", *(f"{one.mean:.2f} ({one.peak:.2f})" + " *" * bool(one.reason) for one in done)])
    head = ["bend [rad]", *(f"{where} {force:g} N" for where, force in product(("radial", "lateral"), FORCES))]
    return markdown(head, lines)
