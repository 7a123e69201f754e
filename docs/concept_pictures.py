"""Draws the pictures of docs/concepts.md into docs/concepts/.

python docs/concept_pictures.py
"""

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch, Polygon

from wam_analysis.drawing import INK, SHAFTS
from wam_description.configuration import Configuration, packaged
from wam_description.transmission_map import TransmissionMap
from wam_studies.figures.style import GREY, picture
from wam_theory.linear_loop import routh_gain
from wam_theory.stability_map import largest_stable_steps
from wam_theory.stick_slip import FrictionNode, IntegralLoop, simulate

FOLDER = Path(__file__).resolve().parent / "concepts"
ZETA, GAMMA = 0.25, 1.5  # of figure 5.8: domain II
NODE = FrictionNode(1.0, 1.0, 2.0, 2.0, 1.0, 1.0)  # with this zeta, forces in units of the friction
INNER, OUTER, THIRD = SHAFTS[:3]


def motor_space(file: Path) -> None:
    """What the two motors of the differential can give, at the motors and at joints 2 and 3."""
    arm = Configuration.load(packaged("wam")).shared.arm
    change = TransmissionMap.of(arm).motor_from_joint[1:3, 1:3].T  # joint torques from motor torques
    square = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    peak, friction = (np.array(values[1:3]) for values in (arm.motors.peak_torque, arm.motors.static_friction))
    with picture(FOLDER / file, 7.2, 3.4) as figure:
        left, right = figure.subplots(1, 2)
        for axes, limits, name in ((left, peak, "peak torque"), (right, friction, "static friction")):
            colour = INNER if axes is left else OUTER
            corners = square * limits @ change.T
            axes.add_patch(Polygon(corners, facecolor=colour, alpha=0.15, edgecolor="none"))
            axes.add_patch(Polygon(corners, fill=False, edgecolor=colour, linewidth=1.6))
            box = np.abs(corners).max(axis=0)
            axes.add_patch(Polygon(square * box, fill=False, edgecolor=GREY, linewidth=0.9, linestyle="--"))
            for i, side in ((0, "right"), (1, "left")):
                tip = change @ (np.eye(2)[i] * limits[i])
                axes.annotate("", tip, (0.0, 0.0), arrowprops={"arrowstyle": "-|>", "color": INK})
                axes.annotate(f"motor {i + 2}", tip, (0, -12), textcoords="offset points", fontsize=8, ha=side)
            axes.set(xlim=(-1.35 * box[0], 1.35 * box[0]), ylim=(-1.35 * box[1], 1.35 * box[1]), title=name)
            axes.set(xlabel="torque at joint 2 [N m]", ylabel="torque at joint 3 [N m]")


def box(axes: Axes, x: float, y: float, text: str, colour: str, width: float = 1.5, height: float = 0.62) -> None:
    """A box of a diagram with its middle at x, y."""
    corner = (x - width / 2.0, y - height / 2.0)
    axes.add_patch(
        FancyBboxPatch(corner, width, height, boxstyle="round,pad=0.02", facecolor="white", edgecolor=colour, lw=1.5)
    )
    axes.text(x, y, text, ha="center", va="center", fontsize=8.0)


def arrow(axes: Axes, *points: tuple[float, float], colour: str = INK) -> None:
    """A path of straight lines with a head at its end."""
    for start, end in pairwise(points[:-1]):
        axes.plot(*zip(start, end, strict=True), color=colour, linewidth=1.2)
    axes.annotate("", points[-1], points[-2], arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.2})


def loops(file: Path) -> None:
    """The two loops of the stack."""
    with picture(FOLDER / file, 7.4, 2.9) as figure:
        axes = figure.subplots()
        axes.set(xlim=(0.0, 10.6), ylim=(-0.1, 3.3))
        axes.set_axis_off()
        for x, text, colour in (
            (2.2, "force law\n200 Hz", OUTER),
            (4.4, "velocity loop of\neach motor, 1 kHz", INNER),
            (6.6, "motor, with\nits friction", GREY),
            (8.6, "cables, links,\ncontact", GREY),
        ):
            box(axes, x, 1.9, text, colour, 1.75)
        axes.text(0.05, 1.98, "force\ncommand", fontsize=8.5, va="center")
        for x in ((0.95, 1.3), (3.1, 3.5), (5.3, 5.7), (7.5, 7.7), (9.5, 10.3)):
            arrow(axes, (x[0], 1.9), (x[1], 1.9))
        axes.text(3.3, 2.45, "velocity", fontsize=8, ha="center")
        axes.text(5.5, 2.45, "torque", fontsize=8, ha="center")
        axes.text(10.0, 2.05, "force", fontsize=8, ha="center")
        arrow(axes, (7.1, 1.57), (7.1, 1.0), (4.4, 1.0), (4.4, 1.57), colour=INNER)
        axes.text(5.75, 0.74, "motor velocity, measured at the shaft", fontsize=8, color=INNER, ha="center")
        arrow(axes, (9.9, 1.9), (9.9, 0.3), (2.2, 0.3), (2.2, 1.57), colour=OUTER)
        axes.text(
            6.0, 0.38, "measured force: from the far end of the transmission", fontsize=8, color=OUTER, ha="center"
        )
        arrow(axes, (6.6, 2.95), (6.6, 2.25), colour=GREY)
        axes.text(6.72, 2.75, "friction, ripple: corrected by the inner loop", fontsize=8, color=GREY)


def saturation(file: Path) -> None:
    """Three steps in domain II: small, large, large with the error saturated; exact responses."""
    largest = float(largest_stable_steps(GAMMA, ZETA))
    gain = GAMMA * float(routh_gain(NODE.inertia, NODE.damping, NODE.transmission_stiffness, NODE.contact_stiffness))
    limit = 0.5 * largest
    cases = (
        (0.6 * largest, math.inf, "small step", THIRD),
        (1.8 * largest, math.inf, "large step", OUTER),
        (1.8 * largest, limit, "large step, F_error saturated", INNER),
    )
    times = np.linspace(0.0, 60.0, 3000)
    with picture(FOLDER / file, 7.4, 2.5) as figure:
        for axes, (force, bound, title, colour) in zip(figure.subplots(1, 3, sharey=True), cases, strict=True):
            motion = simulate(NODE, IntegralLoop(gain, bound), force, float(times[-1])).at(times)
            axes.axhline(force, color=INK, linestyle=":", linewidth=1.1)
            axes.plot(times, motion.contact_force, color=colour)
            axes.set(title=title, xlabel="time [s]", xlim=(0.0, times[-1]), ylim=(-2.0 * largest, 5.0 * largest))
            axes.set_xticks([0, 20, 40, 60])
        figure.axes[0].set_ylabel("contact force / friction")


def lockstep(file: Path) -> None:
    """Who waits for whom when a node is late."""
    with picture(FOLDER / file, 7.4, 3.0) as figure:
        for axes, title, waits in zip(figure.subplots(1, 2), ("lockstep", "realtime"), (True, False), strict=True):
            axes.set(xlim=(-1.3, 7.4), ylim=(-0.55, 1.6), title=title, xlabel="wall clock")
            axes.set_yticks([0.0, 1.0], ["control", "driver"])
            axes.set_xticks([])
            axes.spines[["left", "bottom"]].set_visible(False)
            for y in (0.0, 1.0):
                axes.axhline(y, color=GREY, linewidth=0.8)
            late = 2
            states = [0.0, 1.0, 2.0, 5.0, 6.0] if waits else [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
            for k, at in enumerate(states):
                arrow(axes, (at, 1.0), (at + 0.3, 0.0), colour=INNER)
                axes.text(at, 1.1, f"t{k + 1}", ha="center", fontsize=8, color=INNER)
                answer = 4.5 if k == late else at + 0.45
                if waits or k in (0, 1, late, 5, 6):
                    arrow(axes, (answer, 0.0), (answer + 0.3, 1.0), colour=OUTER)
            axes.plot([2.3, 4.5], [-0.08, -0.08], color=OUTER, linewidth=5, solid_capstyle="butt")
            axes.text(3.4, -0.35, "this node is late", ha="center", fontsize=8, color=OUTER)
            caption = "the arm's time waits" if waits else "t4 to t6: the last command is held"
            axes.text(3.6 if waits else 4.0, 1.36, caption, ha="center", fontsize=8, color=INK)


def main() -> None:
    """Draw every picture."""
    FOLDER.mkdir(exist_ok=True)
    for draw in (motor_space, loops, saturation, lockstep):
        file = Path(f"{draw.__name__.replace('_', '-')}.png")
        draw(file)
        print(f"docs/concepts/{file}")


if __name__ == "__main__":
    main()
