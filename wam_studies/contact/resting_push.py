"""Pushes at rest, estimated from the motors, with dither, and from joint sensors: a figure and a table."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from wam_analysis import arm_picture
from wam_analysis.drawing import ESTIMATED, LIKELY, TRUE
from wam_control.contact.contact_estimator import ContactEstimate
from wam_control.task.scenario import Push, ScenarioStep
from wam_description.arm import Arm
from wam_description.configuration import Configuration
from wam_description.event_text import reasons_in_words
from wam_description.rigid_body import RigidBody
from wam_description.signals import Contact
from wam_description.world import Obstacles
from wam_sim.simulation import Simulation

Triple = tuple[float, float, float]
NOWHERE = Obstacles((), (), (), (), (), (), (), (), ())


@dataclass(frozen=True)
class PushPlan:
    """How the resting arm is pushed, and how it is drawn."""

    pose: tuple[float, ...] = (0.1, -0.9, 0.2, 0.9)  # rad
    position: float = 0.28  # m along the outer link
    force: Triple = (0.0, 6.0, 8.0)  # N, of the figure
    sizes: tuple[float, ...] = (5.0, 10.0, 20.0)  # N, of the table
    cycle: int = 40  # periods of the dither: 25 Hz
    begins: float = 0.45  # s after power-up
    early: float = 0.4  # s after the start of a push
    late: float = 2.0  # s
    before: tuple[int, int] = (60, 90)  # outer periods between release and push
    figure: tuple[float, float] = (11.0, 4.6)  # in
    metres_per_newton: float = 0.02  # of an arrow


PLAN = PushPlan()
SENSING = {
    "motors": {"timing.dither_cycle": 0, "contact_estimator:use_joint_sensors": False},
    "motors, dither": {"timing.dither_cycle": PLAN.cycle, "contact_estimator:use_joint_sensors": False},
    "joint sensors": {"timing.dither_cycle": 0, "contact_estimator:use_joint_sensors": True},
}
TITLES = ("(a) at rest: the motors alone", "(b) at rest, with dither")
DIRECTIONS: tuple[Triple, ...] = ((0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0))  # of the link


def save(path: Path, configuration: Configuration) -> list[str]:
    """Draw a push at rest and its estimate from the motors, without and with dither; a line of numbers for each."""
    figure = Figure(figsize=PLAN.figure)
    FigureCanvasAgg(figure)
    lines = []
    for i, (title, values) in enumerate(zip(TITLES, SENSING.values(), strict=False)):
        run, arm = _pushed(configuration, PLAN.force, values, PLAN.pose, PLAN.early), configuration.shared.arm
        axes = figure.add_axes((0.5 * i, 0.0, 0.5, 1.0))
        estimate, q = run.estimate, run.driver.true_joint_state.position
        draw(axes, arm, q, estimate, Contact("outer_link", PLAN.position, PLAN.force))
        axes.text(0.03, 0.97, title, va="top", transform=axes.transAxes, fontsize=11)
        lines.append(f"{title}: {_numbers(estimate)}")
    figure.savefig(path, dpi=110)
    return lines


def draw(axes: Axes, arm: Arm, q: Sequence[float], estimate: ContactEstimate, true: Contact) -> None:
    """The arm in pose q, rad, with the estimated and the true contact."""
    view = arm_picture.side_view(arm, q, NOWHERE, aspect=0.5 * PLAN.figure[0] / PLAN.figure[1])
    axes.set_axis_off()
    axes.set_xlim(-view.width / 2.0, view.width / 2.0)
    axes.set_ylim(-view.height / 2.0, view.height / 2.0)
    axes.set_aspect("equal")
    arm_picture.draw(axes, arm, q, NOWHERE, view)
    body, covers = RigidBody(arm), arm.covers
    for hypothesis in estimate.hypotheses:
        if hypothesis.low < hypothesis.high:
            i = covers.names.index(hypothesis.cover)
            begin, end = (np.array(points[3 * i : 3 * i + 3]) for points in (covers.start, covers.end))
            fractions = [(x - begin[0]) / (end[0] - begin[0]) for x in (hypothesis.low, hypothesis.high)]
            ends = [body.point(q, hypothesis.cover, begin + fraction * (end - begin)) for fraction in fractions]
            axes.plot(*view.project(np.array(ends)).T, color=LIKELY, linewidth=9.0, alpha=0.75, zorder=18)
    _arrow(axes, arm, q, view, true, TRUE, 4.2)
    if estimate.link and math.isfinite(estimate.position):
        _arrow(axes, arm, q, view, Contact(estimate.link, estimate.position, estimate.force), ESTIMATED, 1.6)
    axes.text(0.03, 0.9, _numbers(estimate), va="top", transform=axes.transAxes, fontsize=9, color=ESTIMATED)
    size = math.hypot(*true.force)
    axes.text(
        0.03,
        0.84,
        f"true: {true.cover}, {true.position:.2f} m, {size:.1f} N",
        va="top",
        transform=axes.transAxes,
        fontsize=9,
        color=TRUE,
    )


def _arrow(
    axes: Axes, arm: Arm, q: Sequence[float], view: arm_picture.View, contact: Contact, colour: str, width: float
) -> None:
    point, force = arm_picture.contact_on_surface(arm, q, contact)
    tail, tip = view.project(np.array([point - PLAN.metres_per_newton * force, point]))
    style = {"arrowstyle": "-|>,head_width=0.35,head_length=0.7", "color": colour, "linewidth": width}
    axes.annotate("", tip, tail, arrowprops={**style, "shrinkA": 0, "shrinkB": 0}, zorder=20 + int(width < 2.0))


def _numbers(estimate: ContactEstimate) -> str:
    if not estimate.in_contact:
        return f"estimated: {reasons_in_words(estimate.reasons) or 'no contact'}"
    force = math.hypot(*estimate.force)
    if math.isnan(estimate.position):
        return f"estimated: {estimate.link}, position unknown, at least {force:.1f} N"
    position = f"{estimate.position:.2f} m (sd {100.0 * estimate.position_sd:.1f} cm)"
    return f"estimated: {estimate.link} ({estimate.probability:.2f}), {position}, {force:.1f} N"


class RestingPush(NamedTuple):
    """Estimate of one push.

    Attributes
    ----------
    sensing, newtons, pose : which.
    early : N, size of the estimated force `PLAN.early` after the start of the push; 0 where it is missed.
    estimate : `PLAN.late` after the start of the push.
    tip_motion : m, peak to peak, of the tool before the push.
    """

    sensing: str
    newtons: float
    pose: tuple[float, ...]
    early: float
    estimate: ContactEstimate
    tip_motion: float

    @property
    def late(self) -> float:
        """N, size of the force that is estimated at the end, 0 where it is missed."""
        return math.hypot(*self.estimate.force) if self.estimate.in_contact else 0.0


def poses(configuration: Configuration) -> tuple[tuple[float, ...], ...]:
    """Joint angles in which the arm is pushed, rad: that in which it starts, and one that is bent and turned."""
    return configuration.shared.arm.joints.start, PLAN.pose


def study(configuration: Configuration) -> list[RestingPush]:
    """Push the resting arm with each force, in each pose and direction, and estimate it with each kind of sensing."""
    found, body, n = [], RigidBody(configuration.shared.arm), len(PLAN.pose)
    for (sensing, values), newtons in product(SENSING.items(), PLAN.sizes):
        for pose, (x, y, z) in product(poses(configuration), DIRECTIONS):
            force = (newtons * x, newtons * y, newtons * z)
            run = _pushed(configuration, force, values, pose, PLAN.late)
            tips = [
                body.tool_pose(row.values[:n]).position for row in run.rows["sim/joint_states"][slice(*PLAN.before)]
            ]
            rows = run.rows["contact/wrench"]
            early = min(rows, key=lambda row: abs(row.stamp / 1e9 - PLAN.begins - PLAN.early)).values[:3]
            moved = float(np.linalg.norm(np.ptp(tips, axis=0)))
            found.append(RestingPush(sensing, newtons, pose, math.hypot(*early), run.estimate, moved))
    return found


def _pushed(
    configuration: Configuration, force: Triple, own: Mapping[str, object], pose: Sequence[float], seconds: float
) -> Simulation:
    values = {
        **own,
        "arm.joints.start": pose,
        "driver:world.obstacles.positions": [5.0] * 3,
    }
    steps = [
        ScenarioStep("release", 0.05, request="enable"),
        ScenarioStep("settle", PLAN.begins - 0.05),
        ScenarioStep("rest", seconds, push=Push("outer_link", PLAN.position, force, 0.0, seconds)),
    ]
    run = Simulation(configuration.with_values(values), steps)
    if failure := run.play():
        raise ValueError(failure)
    return run
