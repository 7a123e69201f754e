"""The picture of a demonstration: the arm while it presses, forces and contact positions over time."""

import math
import os
import textwrap
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from wam_analysis import arm_picture
from wam_analysis.demo_summary import DemoSummary
from wam_analysis.demo_traces import ForceSignal, Numbers
from wam_analysis.drawing import COMMANDED, ESTIMATED, MEASURED, STYLE, TRUE
from wam_analysis.recorded import RecordedArm
from wam_analysis.thresholds import LAYOUT
from wam_description.arm import Arm
from wam_description.signals import Contact
from wam_sim.recording import RecordedStep


def save(path: Path, summary: DemoSummary, recorded: RecordedArm, gl: Sequence[str] | None = None) -> tuple[str, ...]:
    """Draw the picture into a PNG file.

    Parameters
    ----------
    path : file to write.
    summary : what the bag shows.
    recorded : the arm and what it touches.
    gl : values of MUJOCO_GL to try; () draws with matplotlib; None for all that need no display.

    Returns
    -------
    tuple of str
        notes about the picture.
    """
    if gl is None:
        commanded = os.environ.get("MUJOCO_GL", "").lower()
        gl = sorted(arm_picture.GL, key=lambda name: name != commanded)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=LAYOUT.size, dpi=LAYOUT.dpi)
        FigureCanvasAgg(figure)
        grid = figure.add_gridspec(
            2, 2, width_ratios=(1.1, 1.3), height_ratios=(1.5, 1.0),
            left=0.005, right=0.985, bottom=0.11, top=0.93, wspace=0.15, hspace=0.09,
        )  # fmt: skip
        draw_arm(figure.add_subplot(grid[:, 0]), summary, recorded, gl)
        above = figure.add_subplot(grid[0, 1])
        below = figure.add_subplot(grid[1, 1], sharex=above)
        draw_forces(above, summary)
        draw_positions(below, summary, recorded.arm)
        figure.savefig(path, metadata={"Software": None})
    return (recorded.note,) if recorded.note else ()


# the arm


def draw_arm(
    axes: Axes, summary: DemoSummary, recorded: RecordedArm, gl: Sequence[str], letter: str | None = "(a) "
) -> None:
    """The arm in the pose of the summary's moment, and the force on it.

    Parameters
    ----------
    axes : to draw into; its size in the figure gives the aspect of the view.
    summary : what the bag shows.
    recorded : the arm and what it touches.
    gl : values of MUJOCO_GL to try; () draws with matplotlib.
    letter : before the title; None for no title.
    """
    axes.set_axis_off()
    arm, obstacles, moment = recorded.arm, recorded.obstacles, summary.moment
    if moment is None or set(arm.joints.names) - set(moment.names):
        axes.text(0.5, 0.5, "no pose of the arm was recorded", ha="center", transform=axes.transAxes)
        return
    q = [float(moment.q[moment.names.index(name)]) for name in arm.joints.names]
    if not np.all(np.isfinite(q)):
        axes.text(0.5, 0.5, "the recorded pose is not finite", ha="center", transform=axes.transAxes)
        return
    box = axes.get_window_extent()
    forces = _contact_forces(summary, arm, q)
    tips = [
        point + force * (LAYOUT.metres_per_newton + LAYOUT.labels / max(float(np.linalg.norm(force)), 1e-9))
        for point, force, *_ in forces
    ]
    view = arm_picture.side_view(arm, q, obstacles, aspect=float(box.width / box.height), more=tips)
    axes.set_xlim(-view.width / 2.0, view.width / 2.0)
    axes.set_ylim(-view.height / 2.0, view.height / 2.0)
    axes.set_aspect("equal")
    pixels = arm_picture.render(arm, q, obstacles, view, gl) if gl else None
    if pixels is None:
        arm_picture.draw(axes, arm, q, obstacles, view)
    else:
        axes.imshow(pixels, extent=(*axes.get_xlim(), *axes.get_ylim()), interpolation="lanczos", zorder=0)
    _draw_contacts(axes, forces, view)
    if letter is not None:
        title = f"{letter}the arm at {seconds_at(summary, moment.stamp):.1f} s, magnitude of the force on it"
        axes.text(0.02, 1.0, title, va="bottom", transform=axes.transAxes, fontsize=10)


def _contact_forces(summary: DemoSummary, arm: Arm, q: Sequence[float]) -> list[tuple[Numbers, Numbers, str, str]]:
    """Of each known contact: point and force on the arm, base frame, m and N; colour; label."""
    assert summary.moment is not None
    traces, found = summary.traces, []
    for signal, colour, label in ((traces.true, TRUE, "true"), (traces.estimated, ESTIMATED, "estimated")):
        contact = _contact(signal, summary.moment.row)
        if contact.cover in arm.covers.names and math.isfinite(contact.position):
            point, force = arm_picture.contact_on_surface(arm, q, contact)
            found.append((point, force, colour, f"{label} {np.linalg.norm(force):.1f} N"))
    return found


def _draw_contacts(axes: Axes, forces: Sequence[tuple[Numbers, Numbers, str, str]], view: arm_picture.View) -> None:
    """Arrows of the contact force on the arm, labelled with its magnitude."""
    arrows = []
    for point, force, colour, label in forces:
        start, end = view.project(np.array([point, point + LAYOUT.metres_per_newton * force]))
        arrows.append((start, end, colour, label))
    for i, (start, end, colour, _) in enumerate(arrows):
        width = 4.2 if colour is TRUE else 1.3  # so that the true force is visible under a correct estimate
        head = f"-|>,head_width={0.14 + 0.05 * width:.2f},head_length={0.4 + 0.07 * width:.2f}"
        style = {"arrowstyle": head, "color": colour, "linewidth": width, "joinstyle": "miter"}
        arrow = axes.annotate("", end, start, arrowprops={**style, "shrinkA": 0, "shrinkB": 0}, zorder=20 + i)
        if arrow.arrow_patch is not None:
            arrow.arrow_patch.set_path_effects([patheffects.withStroke(linewidth=width + 1.4, foreground="white")])
        axes.plot(
            *start,
            "o",
            color=colour,
            markersize=3.0 + width,
            markeredgecolor="white",
            markeredgewidth=0.8,
            zorder=20 + i,
        )
    if not arrows:
        return
    tips = np.array([end for _, end, _, _ in arrows])
    is_up = bool(tips[:, 1].mean() >= np.mean([start[1] for start, *_ in arrows]))
    x = min(float(tips[:, 0].max()) + 0.15, view.width / 2.0 - 0.01)
    y = float(tips[:, 1].max()) + 0.03 if is_up else float(tips[:, 1].min()) - 0.03
    for i, (_, _, colour, label) in enumerate(arrows):
        line = (len(arrows) - 1 - i if is_up else -i) * 13.0  # points
        axes.annotate(
            label, (x, y), (0.0, line), textcoords="offset points", color=colour, ha="right", zorder=40,
            va="bottom" if is_up else "top", path_effects=[patheffects.withStroke(linewidth=3.0, foreground="white")],
        )  # fmt: skip


def _contact(signal: ForceSignal, row: int) -> Contact:
    x, y, z = signal.force[row].tolist()
    return Contact(str(signal.frame[row]) if signal.acts[row] else "", float(signal.position[row]), (x, y, z))


# time


def _zero(summary: DemoSummary) -> int:
    """Start of the scenario, or of the recording, ns."""
    if summary.steps:
        return summary.steps[0].begin
    return int(summary.traces.stamp[0]) if len(summary.traces.stamp) else 0


def seconds_at(summary: DemoSummary, stamp: int) -> float:
    """Time axis of the pictures, s, of a stamp, ns."""
    return (stamp - _zero(summary)) / 1e9


def _seconds(summary: DemoSummary) -> Numbers:
    seconds: Numbers = (summary.traces.stamp - _zero(summary)) / 1e9
    return seconds


def draw_forces(axes: Axes, summary: DemoSummary, letter: str = "(b)", room: int = 76) -> None:
    """Components along the commanded force; magnitudes if none is commanded.

    Parameters
    ----------
    axes : to draw into.
    summary : what the bag shows.
    letter : label of the axes.
    room : characters that fit into its width for the names of the steps, 0 for none.
    """
    traces, time = summary.traces, _seconds(summary)
    pressed = traces.commanded.acts

    def shown(signal: ForceSignal, sign: float) -> Numbers:
        values: Numbers = np.where(pressed, traces.along(signal, sign), signal.size)
        return values

    commanded = np.where(pressed, traces.commanded.size, np.nan)
    axes.plot(time, shown(traces.true, -1.0), color=TRUE, lw=1.6, label="true", zorder=3)
    measured = np.where(pressed, traces.along(traces.measured), np.nan)
    axes.plot(time, measured, color=MEASURED, lw=1.1, ls=(0, (4, 2)), label="measured", zorder=6)
    estimated = shown(traces.estimated, -1.0)
    bound = np.where(traces.estimated.is_lower_bound, estimated, np.nan)
    axes.plot(time, np.where(np.isnan(bound), estimated, np.nan), color=ESTIMATED, lw=1.0, label="estimated", zorder=5)
    if np.any(np.isfinite(bound)):
        axes.plot(time, bound, color=ESTIMATED, lw=1.6, ls=(0, (0.6, 2.0)), label="at least", zorder=5)
    axes.plot(time, commanded, color=COMMANDED, lw=1.1, ls=(0, (1.2, 1.2)), label="commanded", zorder=7)
    axes.set_ylabel("force, along\ncommand [N]" if np.any(pressed) else "force [N]")
    axes.tick_params(labelbottom=False)
    highest = [
        np.nanmax(values, initial=1.0)
        for values in (shown(traces.true, -1.0), shown(traces.estimated, -1.0), commanded)
    ]
    axes.set_ylim(min(0.0, -0.02 * max(highest)), 1.38 * float(max(highest)))
    handles, labels = axes.get_legend_handles_labels()
    order = [labels.index("commanded"), *(i for i, label in enumerate(labels) if label != "commanded")]
    axes.legend(
        [handles[i] for i in order], [labels[i] for i in order], loc="lower center", bbox_to_anchor=(0.5, 1.0),
        ncols=len(order) if room > 60 else 2, handlelength=1.8, columnspacing=1.0, borderaxespad=0.2,
    )  # fmt: skip
    _frame(axes, summary, letter)
    _name_steps(axes, summary, room)


def draw_positions(axes: Axes, summary: DemoSummary, arm: Arm, letter: str = "(c)") -> None:
    """Contact position along the link, true and estimated; arguments as in `draw_forces`."""
    traces, time = summary.traces, _seconds(summary)
    length = max(arm.covers.length) * 100.0
    for signal, colour, width in ((traces.true, TRUE, 1.6), (traces.estimated, ESTIMATED, 1.0)):
        position = np.where(signal.acts, 100.0 * signal.position, np.nan)
        axes.plot(time, position, color=colour, lw=width, zorder=4)
    for contact in summary.contacts:
        if contact.estimate.is_lower_bound:
            middle = (contact.begin + contact.end) / 2.0 - (_zero(summary) - traces.zero) / 1e9
            axes.text(
                middle, 0.07 * length, "not\nobservable", ha="center", fontsize=7.5, color=ESTIMATED, linespacing=0.95
            )
    axes.set_ylim(0.0, 1.12 * length)
    axes.set_ylabel("position [cm]")
    axes.set_xlabel("time [s]")
    _frame(axes, summary, letter)


def _frame(axes: Axes, summary: DemoSummary, letter: str) -> None:
    zero = _zero(summary)
    if summary.steps:
        first = int(summary.traces.stamp[0]) if len(summary.traces.stamp) else zero
        begin = max(first - zero, 0) / 1e9  # a recording may begin later than its scenario
        axes.set_xlim(begin, max((summary.steps[-1].end - zero) / 1e9, begin + 1e-3))
    touched = {one.step for one in summary.contacts} | {one.step for one in summary.missed}
    busy = {step.begin: "#e7f0f7" for step in summary.steps if step.name in touched}
    pressed = [step for step in summary.steps if any(step.begin < one.end <= step.end for one in summary.holds)]
    busy |= {step.begin: "#faeee2" for step in pressed}
    for step in summary.steps:
        begin, end = (step.begin - zero) / 1e9, (step.end - zero) / 1e9
        axes.axvspan(begin, end, facecolor=busy.get(step.begin, "white"), edgecolor="none", zorder=0)
        axes.axvline(begin, color="#b9bfc6", lw=0.5, zorder=1)
    axes.text(-0.085, 1.0, letter, transform=axes.transAxes, va="top", ha="center", fontsize=10)
    axes.spines[["top", "right"]].set_visible(False)


def _middle(summary: DemoSummary, step: RecordedStep) -> float:
    return ((step.begin + step.end) / 2.0 - _zero(summary)) / 1e9


def _name_steps(axes: Axes, summary: DemoSummary, letters: int) -> None:
    """Names of the steps at the top, wrapped to the width of each; narrow steps get none."""
    first, last = axes.get_xlim()
    for step in summary.steps:
        room = round(letters * (step.end - step.begin) / 1e9 / (last - first))
        if room >= 6 and first <= _middle(summary, step) <= last:
            lines = textwrap.wrap(step.name, room, break_long_words=False)
            if len(lines) > LAYOUT.name_lines:
                word = lines[LAYOUT.name_lines - 1]
                lines = [*lines[: LAYOUT.name_lines - 1], f"{word}…" if len(word) < room - 1 else word]
            axes.text(
                _middle(summary, step), 0.985, "\n".join(lines), transform=axes.get_xaxis_transform(), ha="center",
                va="top", fontsize=7.5, linespacing=1.1, color="#555555", zorder=7,
            )  # fmt: skip
