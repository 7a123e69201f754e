"""A nearly straight arm that presses ahead and aside (docs/experiments.md)."""

import math
from itertools import product
from typing import Final

import numpy as np

from wam_analysis.table import markdown
from wam_control.force.stability_guard import triple
from wam_description.configuration import Configuration
from wam_description.rigid_body import RigidBody
from wam_studies.force_benchmark.surfaces import Surface
from wam_studies.force_benchmark.tasks import Task
from wam_studies.force_benchmark.trial import perform

STIFFNESS: Final = 4000.0  # N/m
FRICTION: Final = 0.3
FORCES: Final = (5.0, 15.0)  # N
SECONDS: Final = 3.0  # of the whole force


def elbow_table(base: Configuration) -> str:
    """Mean and peak of the true force of a nearly straight arm, N, in Markdown; with a star for a reason.

    The elbow is bent by 0 to 0.5 rad, against a wall ahead and a rod at its side.
    """
    arm = base.shared.arm
    body, cover, length = RigidBody(arm), arm.covers.names[-1], arm.covers.length[-1]
    lines = []
    for bend in [round(0.05 * k, 2) for k in range(11)]:
        q = (0.0, -1.0, 0.0, math.pi / 2.0 - bend)
        tip, aside = body.point(q, cover, (length, 0.0, 0.0)), body.cover_pose(q, cover).rotation[:, 2]
        wall = Surface(cover, length, triple(tip / np.linalg.norm(tip)), STIFFNESS, FRICTION, True)
        side = Surface(cover, 0.28, triple(aside), STIFFNESS, FRICTION, False)
        done = [perform(base, Task(q, surface, force), SECONDS) for surface, force in product((wall, side), FORCES)]
        lines.append([f"{bend:g}", *(f"{one.mean:.2f} ({one.peak:.2f})" + " *" * bool(one.reason) for one in done)])
    head = ["bend [rad]", *(f"{where} {force:g} N" for where, force in product(("radial", "lateral"), FORCES))]
    return markdown(head, lines)
