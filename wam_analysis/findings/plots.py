"""The pictures of an analysis, each drawn for a wide and for a narrow page."""

import io
import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wam_analysis import arm_picture
from wam_analysis.demo_figure import (
    draw_arm,
    draw_forces,
    draw_positions,
    seconds_at,
)
from wam_analysis.drawing import COMMANDED, ESTIMATED, MEASURED, SHAFTS, STYLE, TRUE, widen_flat
from wam_analysis.findings.analysis import Analysis
from wam_analysis.findings.signals import envelope, forces_over_time, moving
from wam_analysis.measures.loop_timing import latency
from wam_analysis.recorded import recorded_arm
from wam_analysis.thresholds import LAYOUT
from wam_bag.bag import JointColumns, WrenchColumns

Numbers = NDArray[np.float64]

MOST = {LAYOUT.wide: 3000, LAYOUT.narrow: 1200}  # points of a line
PAGE_STYLE: Any = {
    **STYLE,
    "font.size": 10.0,
    "axes.titlesize": 10.0,
    "axes.grid": True,
    "grid.color": "#e6e8eb",
    "legend.fontsize": 9.0,
    "svg.fonttype": "path",
    "svg.hashsalt": "wam",
    "path.simplify": True,
    "path.simplify_threshold": 0.5,
}


class Plot(NamedTuple):
    """A picture in two widths.

    Attributes
    ----------
    section : key of the section to which it belongs.
    title : caption.
    kind : 'svg+xml' or 'png'.
    wide, narrow : its bytes.
    has_chart : whether a chart of the page shows the same, which can be zoomed; then it is for print.
    """

    section: str
    title: str
    kind: str
    wide: bytes
    narrow: bytes
    has_chart: bool = False


Draw = Callable[[Figure, float], None]


def plots(analysis: Analysis) -> Iterator[Plot]:
    """Every picture for which the recording has data."""
    summary, recording = analysis.recording.summary, analysis.recording
    if summary.moment is not None:
        yield _arm(analysis)
    if forces_over_time(recording) is not None:
        title = "Forces and contact position over the whole recording."
        yield _svg("happened", title, lambda figure, width: _story(figure, width, analysis), 4.6, 5.4)
    for name, columns in moving(recording).items():
        if isinstance(columns, JointColumns):
            yield from _motion_plots(name, columns)
        else:
            draw = partial(_wrench, columns=columns)
            yield _svg("happened", f"Force on {name}.", draw, 2.8, 3.2)._replace(has_chart=True)
    if any(len(one.time) for one in analysis.held):
        title = "Each commanded force from its start: measured by the force loop, and true."
        rows = sum(len(one.time) > 0 for one in analysis.held[:6])
        wide, narrow = 2.6 * math.ceil(rows / 3), 2.1 * rows
        picture = _svg("force", title, lambda figure, width: _holds(figure, width, analysis), wide, narrow)
        yield picture._replace(has_chart=True)
    if analysis.motion.signals is not None:
        title = "Friction torque of each motor over its velocity; lines: identified (solid), configured (dashed)."
        n = analysis.motion.signals.torque.shape[1]
        wide, narrow = 2.5 * math.ceil(n / 2), 2.2 * n
        yield _svg("friction", title, lambda figure, width: _friction(figure, width, analysis), wide, narrow)
    if any(len(found.order) for found in analysis.motion.ripple.values()):
        title = "Torque ripple of each motor by the order of its angle."
        yield _svg("ripple", title, lambda figure, width: _ripple(figure, analysis), 2.6, 3.0)
    yield from timing_plots(analysis)


def _motion_plots(name: str, columns: JointColumns) -> Iterator[Plot]:
    n = columns.position.shape[1]
    draw = partial(_positions, columns=columns)
    yield _svg("happened", f"Positions on {name}.", draw, 0.8 + 1.3 * n, 0.8 + 1.4 * n)._replace(has_chart=True)
    if columns.velocity.shape[1] == n:
        title, rows = f"Velocity over position on {name}; a cycle is a closed curve.", math.ceil(n / 2)
        yield _svg("stick_slip", title, partial(_phases, columns=columns), 2.8 * rows, 2.6 * n)


def _figure(width: float, height: float, draw: Draw) -> Figure:
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    draw(figure, width)
    return figure


def _svg(section: str, title: str, draw: Draw, wide: float, narrow: float) -> Plot:
    pictures = []
    with mpl.rc_context(PAGE_STYLE):
        for width, height in ((LAYOUT.wide, wide), (LAYOUT.narrow, narrow)):
            stream = io.BytesIO()
            _figure(width, height, draw).savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
            pictures.append(stream.getvalue())
    return Plot(section, title, "svg+xml", pictures[0], pictures[1])


def _arm(analysis: Analysis) -> Plot:
    """The arm, rendered by MuJoCo or drawn, the same for both widths."""
    recording = analysis.recording
    recorded = recorded_arm(recording.run.parameters)
    figure = Figure(figsize=(5.6, 4.2), dpi=LAYOUT.png_dpi)
    FigureCanvasAgg(figure)
    stream = io.BytesIO()
    with mpl.rc_context(PAGE_STYLE):
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        draw_arm(axes, recording.summary, recorded, arm_picture.GL, letter=None)
        figure.savefig(stream, format="png", metadata={"Software": None})
    moment = recording.summary.moment
    seconds = seconds_at(recording.summary, moment.stamp) if moment is not None else 0.0
    title = f"The arm after {seconds:.1f} s, with the true and the estimated contact force."
    title += f" ({recorded.note})" if recorded.note else ""
    return Plot("happened", title, "png", stream.getvalue(), stream.getvalue())


def _story(figure: Figure, width: float, analysis: Analysis) -> None:
    summary = analysis.recording.summary
    arm = analysis.recording.parameters.arm or recorded_arm(analysis.recording.run.parameters).arm
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1.6, 1.0))
    is_wide = width > LAYOUT.narrow
    draw_forces(above, summary, letter="", room=105 if is_wide else 0, most=MOST[width])
    draw_positions(below, summary, arm, letter="", most=MOST[width])


def _positions(figure: Figure, width: float, columns: JointColumns) -> None:
    """Each joint on axes of its own: their ranges differ by orders of magnitude."""
    rows = figure.subplots(columns.position.shape[1], 1, sharex=True, squeeze=False)[:, 0]
    time = (columns.stamp_ns - columns.stamp_ns[0]) / 1e9
    for i, (axes, name) in enumerate(zip(rows, columns.names, strict=True)):
        axes.plot(*envelope(time, columns.position[:, i], MOST[width]), color=SHAFTS[i % len(SHAFTS)], lw=1.2)
        axes.set(ylabel=f"{name} [rad]")
        widen_flat(axes)
    rows[-1].set_xlabel("time [s]")
    figure.align_ylabels()


def _phases(figure: Figure, width: float, columns: JointColumns) -> None:
    """Velocity over position of each joint: a cycle is a closed curve."""
    n = columns.position.shape[1]
    across = min(2, n) if width > LAYOUT.narrow else 1
    grid = figure.subplots(math.ceil(n / across), across, squeeze=False)
    every = max(1, len(columns.stamp_ns) // MOST[width])
    for i, (axes, name) in enumerate(zip(grid.flat, columns.names, strict=False)):
        position, velocity = columns.position[::every, i], columns.velocity[::every, i]
        axes.plot(position, velocity, color=SHAFTS[i % len(SHAFTS)], lw=0.8)
        axes.set(xlabel=f"{name} [rad]", ylabel="velocity [rad/s]")
        widen_flat(axes)
        axes.locator_params(axis="x", nbins=LAYOUT.ticks)
    for axes in list(grid.flat)[n:]:
        axes.set_axis_off()


def _wrench(figure: Figure, width: float, columns: WrenchColumns) -> None:
    axes = figure.subplots()
    time = (columns.stamp_ns - columns.stamp_ns[0]) / 1e9
    for i, name in enumerate("xyz"):
        axes.plot(*envelope(time, columns.force[:, i], MOST[width]), color=SHAFTS[i], lw=1.2, label=name)
    axes.set(xlabel="time [s]", ylabel="force [N]")
    widen_flat(axes)
    _legend(axes, width)


def _legend(axes: Axes, width: float) -> None:
    columns = 8 if width > LAYOUT.narrow else 4
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=columns, handlelength=1.4, columnspacing=1.0)


def _holds(figure: Figure, width: float, analysis: Analysis) -> None:
    held = [one for one in analysis.held if len(one.time)][:6]
    across = min(3, len(held)) if width > LAYOUT.narrow else 1
    grid = figure.subplots(math.ceil(len(held) / across), across, squeeze=False)
    for axes, one in zip(grid.flat, held, strict=False):
        most = MOST[width] // across
        if len(one.true):
            axes.plot(*envelope(one.time_true, one.true, most), color=TRUE, lw=1.6, label="true")
        axes.plot(*envelope(one.time, one.measured, most), color=MEASURED, lw=1.0, ls=(0, (4, 2)), label="measured")
        axes.axhline(one.hold.commanded, color=COMMANDED, lw=0.9, ls=(0, (1.2, 1.2)), label="commanded")
        widen_flat(axes)
        axes.set_title(one.hold.name if len(one.hold.name) < 34 else f"{one.hold.name[:32]}…")
        axes.set_xlabel("time [s]")
    for row in grid:
        row[0].set_ylabel("force [N]")
    for axes in list(grid.flat)[len(held) :]:
        axes.set_axis_off()
    grid.flat[0].legend(loc="best")


def _friction(figure: Figure, width: float, analysis: Analysis) -> None:
    signals, arm = analysis.motion.signals, analysis.recording.parameters.arm
    if signals is None or arm is None:
        return
    n = signals.torque.shape[1]
    across = min(2, n) if width > LAYOUT.narrow else 1
    grid = figure.subplots(math.ceil(n / across), across, squeeze=False)
    some = np.flatnonzero(signals.use)
    some = some[:: max(1, len(some) // (MOST[width] // 2))]
    for i, (axes, name) in enumerate(zip(grid.flat, arm.motors.names, strict=False)):
        speed, torque = signals.velocity[some, i], 1e3 * (signals.torque - signals.load)[some, i]
        axes.plot(speed, torque, ".", color="#9aa3ad", ms=2.0, zorder=2, rasterized=False)
        found, motors = analysis.motion.friction[name], arm.motors
        end = max(float(np.max(np.abs(speed), initial=0.0)), 1e-3)
        for dry, viscous, style, colour in (
            (found.dynamic, found.viscous, "-", ESTIMATED),
            (motors.dynamic_friction[i], motors.viscous_friction[i], "--", COMMANDED),
        ):
            for sign in (-1.0, 1.0):
                ends = np.array([0.0, sign * end])
                axes.plot(ends, 1e3 * (sign * dry + viscous * ends), style, color=colour, lw=1.2, zorder=4)
        limit = 3.0e3 * max(motors.static_friction[i], found.dynamic if math.isfinite(found.dynamic) else 0.0, 1e-4)
        axes.set_ylim(-limit, limit)
        axes.set_title(name)
        axes.set_xlabel("speed [rad/s]")
        axes.locator_params(axis="x", nbins=LAYOUT.ticks)
    for row in grid:
        row[0].set_ylabel("torque [mN m]")
    for axes in list(grid.flat)[n:]:
        axes.set_axis_off()


def _ripple(figure: Figure, analysis: Analysis) -> None:
    axes = figure.subplots()
    for i, (name, found) in enumerate(analysis.motion.ripple.items()):
        if len(found.order):
            axes.plot(found.order, 1e3 * found.amplitude, "o-", color=SHAFTS[i], ms=3.0, lw=0.8, label=name)
    axes.set(xlabel="cycles per turn of the motor", ylabel="amplitude [mN m]", ylim=(0.0, None))
    axes.legend()


def timing_plots(analysis: Analysis) -> Iterator[Plot]:
    """Reception intervals and latencies of a recording in realtime."""
    recording = analysis.recording
    states, answers = recording.run.joints("motor_states"), recording.run.joints("motor_current_command")
    if recording.mode != "realtime" or states is None or len(states.stamp_ns) < 3:
        return
    intervals = np.diff(np.sort(states.log_time_ns)) / 1e6
    name = "Time between two motor_states at the recorder."

    def draw(figure: Figure, width: float) -> None:
        axes = figure.subplots()
        bars = 80 if width > LAYOUT.narrow else 40
        last = max(float(np.percentile(intervals, 99.9)), 1e-3)
        axes.hist(np.clip(intervals, 0.0, last), bars, range=(0.0, last), color=TRUE)
        axes.set(xlabel="interval [ms]", ylabel="messages", yscale="log")

    yield _svg("timing", name + _latency_words(states, answers), draw, 2.6, 2.8)


def _latency_words(states: JointColumns, answers: JointColumns | None) -> str:
    if answers is None:
        return ""
    found = latency(states.stamp_ns, states.log_time_ns, answers.stamp_ns, answers.log_time_ns)
    return f" Latency to the current command: {1e3 * found.p50:.2f} ms in the median." if found.answered else ""
