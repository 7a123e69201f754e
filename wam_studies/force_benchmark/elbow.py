"""A wall ahead and a rod at the side of a nearly straight arm: the table of docs/force.md."""

import math
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from wam_analysis.table import markdown
from wam_description.configuration import Configuration
from wam_description.rigid_body import RigidBody
from wam_studies.force_benchmark.outcome import TaskResult
from wam_studies.force_benchmark.surfaces import Surface
from wam_studies.force_benchmark.tasks import Task, triple
from wam_studies.force_benchmark.trial import perform

FORCES = (5.0, 15.0)  # N


class ElbowRow(NamedTuple):
    """A force on a surface in front of or at the side of a nearly straight arm."""

    bend: float  # rad
    is_radial: bool
    force: float  # N, commanded
    result: TaskResult


def elbow(base: Configuration, seconds: float = 3.0) -> list[ElbowRow]:
    """Forces of 5 and 15 N, the elbow bent by 0 to 0.5 rad, against a wall ahead and a rod at its side."""
    arm = base.shared.arm
    body, cover, length = RigidBody(arm), arm.covers.names[-1], arm.covers.length[-1]
    rows = []
    for is_radial in (True, False):
        for bend in [round(0.05 * k, 2) for k in range(11)]:
            q = (0.0, -1.0, 0.0, math.pi / 2.0 - bend)
            tip, rotation = body.point(q, cover, (length, 0.0, 0.0)), body.cover_pose(q, cover).rotation
            direction = triple(tip / np.linalg.norm(tip) if is_radial else rotation[:, 2])
            surface = Surface(cover, length if is_radial else 0.28, direction, 4000.0, 0.3, is_radial)
            rows += [ElbowRow(bend, is_radial, f, perform(base, Task(q, surface, f), seconds)) for f in FORCES]
    return rows


def elbow_table(rows: Sequence[ElbowRow]) -> str:
    """Mean and peak of the true force, N, in Markdown; with a star where the loop reports that it cannot do it."""
    lines = []
    for bend in sorted({row.bend for row in rows}):
        cells = [f"{bend:g}"]
        for is_radial, force in product((True, False), FORCES):
            (found,) = (r.result for r in rows if (r.bend, r.is_radial, r.force) == (bend, is_radial, force))
            cells.append(f"{found.mean:.2f} ({found.peak:.2f})" + " *" * bool(found.reason))
        lines.append(cells)
    head = ["bend [rad]", *(f"{side} {force:g} N" for side, force in product(("radial", "lateral"), FORCES))]
    return markdown(head, lines)
