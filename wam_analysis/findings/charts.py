"""Charts of an analysis: what is drawn, as numbers, for the page's uPlot."""

import json
import math
from collections.abc import Iterator
from importlib import resources
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.drawing import COLOURS, COMMANDED, ESTIMATED, LIKELY, MEASURED, SHAFTS, TRUE
from wam_analysis.findings.analysis import Analysis
from wam_analysis.findings.signals import commanded, envelope, forces_over_time, moving, spectrum
from wam_analysis.measures.loop_timing import latency
from wam_analysis.thresholds import LAYOUT, STREAM
from wam_bag.bag import JointColumns

Numbers = NDArray[np.float64]

FORCES = {**COLOURS, "at least": LIKELY}
TIME, FORCE, FIRST, SIGNALS = "time [s]", "force [N]", "happened", "signals"


class ChartLine(NamedTuple):
    """A line, or dots: its label, colour and values, (n,)."""

    label: str
    colour: str
    values: Numbers
    dashed: bool = False
    dots: bool = False


class Chart(NamedTuple):
    """Lines over one axis.

    Attributes
    ----------
    section : key of the section to which it belongs.
    title : caption.
    across, up : names of the axes with their units.
    x : (n,), rising.
    series : one line each.
    key : charts with the same one share the cursor; '' for none.
    logarithmic : whether both axes are.
    """

    section: str
    title: str
    across: str
    up: str
    x: Numbers
    series: tuple[ChartLine, ...]
    key: str = ""
    logarithmic: bool = False


def charts(analysis: Analysis) -> Iterator[Chart]:
    """Every chart for which the recording has data; those of `FIRST` fill a screen at most."""
    over_time = list(_over_time(analysis))
    for i, chart in enumerate(over_time):
        yield chart._replace(section=FIRST if i < LAYOUT.first_charts else SIGNALS)
    yield from map(_thinned, (*_holds(analysis), *_positions(analysis)))
    for name, columns in moving(analysis.recording).items():
        if isinstance(columns, JointColumns):
            yield from _of_motion(name, columns)
    yield from _friction(analysis)
    ripples = {name: found for name, found in analysis.recording.motion.ripple.items() if len(found.order)}
    for i, (name, found) in enumerate(ripples.items()):
        line = ChartLine(name, SHAFTS[i % len(SHAFTS)], 1e3 * found.amplitude)
        order = found.order.astype(np.float64)
        yield Chart("ripple", f"Torque ripple of {name}.", "cycles per turn", "amplitude [mN m]", order, (line,))
    yield from _timing(analysis)


def _over_time(analysis: Analysis) -> Iterator[Chart]:
    """Forces and motions, each with what was commanded."""
    traces = forces_over_time(analysis.recording)
    if traces is not None:
        time, forces = traces
        lines = [ChartLine(name, FORCES[name], value, name == "commanded") for name, value in forces.items()]
        yield _thinned(Chart(FIRST, "Size of the forces.", TIME, FORCE, time, tuple(lines), "time"))
    for name, columns in moving(analysis.recording).items():
        time = (columns.stamp_ns - columns.stamp_ns[0]) / 1e9
        desired = commanded(analysis.recording, columns)
        if isinstance(columns, JointColumns):
            for i, joint in enumerate(columns.names):
                lines = [ChartLine(joint, SHAFTS[i % len(SHAFTS)], columns.position[:, i]), *_dashed(joint, desired)]
                title = f"Position of {joint} on {name}."
                yield _thinned(Chart(SIGNALS, title, TIME, "position [rad]", time, tuple(lines), name))
        else:
            lines = [ChartLine(axis, SHAFTS[i], columns.force[:, i]) for i, axis in enumerate("xyz")]
            lines += [line for axis in "xyz" for line in _dashed(axis, desired)]
            yield _thinned(Chart(SIGNALS, f"Force on {name}.", TIME, FORCE, time, tuple(lines), name))


def _dashed(name: str, desired: dict[str, Numbers]) -> list[ChartLine]:
    return [ChartLine(f"{name} commanded", COMMANDED, desired[name], True)] if name in desired else []


def _holds(analysis: Analysis) -> Iterator[Chart]:
    for one in analysis.recording.held:
        if len(one.time):
            level = np.full(len(one.time), one.hold.commanded)
            lines = [ChartLine("measured", MEASURED, one.measured), ChartLine("commanded", COMMANDED, level, True)]
            if len(one.true):
                lines.insert(0, ChartLine("true", TRUE, np.interp(one.time, one.time_true, one.true)))
            yield Chart("force", f"{one.hold.name}.", TIME, FORCE, one.time, tuple(lines))


def _positions(analysis: Analysis) -> Iterator[Chart]:
    """Where the arm was touched."""
    traces = analysis.recording.summary.traces
    signals = {"true": traces.true, "estimated": traces.estimated}
    lines = [
        ChartLine(name, COLOURS[name], np.where(signal.acts, 100.0 * signal.position, np.nan))
        for name, signal in signals.items()
    ]
    if any(np.any(np.isfinite(line.values)) for line in lines):
        time = (traces.stamp - traces.stamp[0]) / 1e9
        yield Chart("contact", "Position of the contact along the link.", TIME, "position [cm]", time, tuple(lines))


def _of_motion(name: str, columns: JointColumns) -> Iterator[Chart]:
    """Spectrum, and velocity over position: a cycle is a closed curve."""
    if len(columns.stamp_ns) >= STREAM.transformed:
        frequency, amplitude = spectrum(columns)
        lines = [ChartLine(n, SHAFTS[i % len(SHAFTS)], amplitude[:, i]) for i, n in enumerate(columns.names)]
        title = f"Spectrum of the positions on {name}: amplitude of each frequency, over the whole recording."
        yield Chart("stability", title, "frequency [Hz]", "amplitude [rad]", frequency, tuple(lines), logarithmic=True)
    for i, joint in enumerate(columns.names if columns.velocity.shape == columns.position.shape else ()):
        rows = np.unique(np.linspace(0, len(columns.stamp_ns) - 1, LAYOUT.dots).astype(np.int64))
        rows = rows[np.argsort(columns.position[rows, i], kind="stable")]
        line = ChartLine(joint, SHAFTS[i % len(SHAFTS)], columns.velocity[rows, i], dots=True)
        title = f"Velocity over position of {joint} on {name}; a cycle is a closed curve."
        yield Chart("stick_slip", title, "position [rad]", "velocity [rad/s]", columns.position[rows, i], (line,))


def _friction(analysis: Analysis) -> Iterator[Chart]:
    signals, arm = analysis.recording.motion.signals, analysis.recording.parameters.arm
    if signals is None or arm is None or not analysis.recording.motion.friction:
        return
    some = np.flatnonzero(signals.use)
    some = some[:: max(1, len(some) // LAYOUT.dots)]
    for i, name in enumerate(arm.motors.names):
        rows = some[np.argsort(signals.velocity[some, i], kind="stable")]
        speed, torque = signals.velocity[rows, i], 1e3 * (signals.torque - signals.load)[rows, i]
        found, motors = analysis.recording.motion.friction[name], arm.motors
        of_config = (motors.dynamic_friction[i], motors.viscous_friction[i])
        lines = [ChartLine("torque less load", LAYOUT.grey, torque, dots=True)]
        for label, colour, (dry, viscous) in (
            ("identified", ESTIMATED, (found.dynamic, np.nan_to_num(found.viscous))),
            ("configured", COMMANDED, of_config),
        ):
            lines.append(
                ChartLine(label, colour, 1e3 * (dry * np.sign(speed) + viscous * speed), label == "configured")
            )
        title = f"Friction torque of {name} over its velocity."
        yield Chart("friction", title, "velocity [rad/s]", "torque [mN m]", speed, tuple(lines))


def _timing(analysis: Analysis) -> Iterator[Chart]:
    """Reception intervals and latency of a recording in realtime."""
    recording = analysis.recording
    states, answers = recording.run.joints("motor_states"), recording.run.joints("motor_current_command")
    if recording.mode != "realtime" or states is None or len(states.stamp_ns) < STREAM.shown:
        return
    intervals = np.diff(np.sort(states.log_time_ns)) / 1e6
    last = max(float(np.percentile(intervals, 99.9)), 1e-3)
    counts, edges = np.histogram(np.clip(intervals, 0.0, last), LAYOUT.bars, (0.0, last))
    title = "Time between two motor_states at the recorder."
    if answers is not None:
        found = latency(states.stamp_ns, states.log_time_ns, answers.stamp_ns, answers.log_time_ns)
        if found.answered:
            title += f" Latency to the current command: {1e3 * found.p50:.2f} ms in the median."
    number = np.where(counts > 0, counts, math.nan)
    line = ChartLine("messages", TRUE, number, dots=True)
    middles = 0.5 * (edges[1:] + edges[:-1])
    yield Chart("timing", title, "interval [ms]", "messages", middles, (line,), logarithmic=True)


def _thinned(chart: Chart) -> Chart:
    """The chart with at most `points` points, which looks the same."""
    if len(chart.x) <= LAYOUT.points:
        return chart
    lines = [one._replace(values=envelope(chart.x, one.values, LAYOUT.points)[1]) for one in chart.series]
    return chart._replace(x=envelope(chart.x, chart.x, LAYOUT.points)[0], series=tuple(lines))


def data(found: list[Chart]) -> str:
    """The charts as JSON for charts.js, which cannot end a script element."""
    return json.dumps([_plain(chart) for chart in found], separators=(",", ":"), allow_nan=False).replace(
        "<", "\\u003c"
    )


def _plain(chart: Chart) -> dict[str, Any]:
    return {
        **{name: getattr(chart, name) for name in ("across", "up", "key", "logarithmic")},
        "height": 240,
        "x": _numbers(chart.x),
        "series": [
            {
                "label": one.label,
                "dashed": one.dashed,
                "dots": one.dots,
                "colour": "ink" if one.colour == COMMANDED else one.colour,  # readable on light and dark
                "y": _numbers(one.values),
            }
            for one in chart.series
        ],
    }


def _numbers(values: Numbers) -> list[float | None]:
    return [float(f"{value:.{LAYOUT.digits}g}") if np.isfinite(value) else None for value in values.tolist()]


def scripts() -> tuple[str, str, str]:
    """The library with its license, the script that uses it, and the library's styles."""
    here = resources.files("wam_analysis.findings")
    library, license_text, styles = (
        here.joinpath("uplot", name).read_text(encoding="utf-8")
        for name in ("uPlot.iife.min.js", "LICENSE", "uPlot.min.css")
    )
    return f"/*! {license_text.strip()} */\n{library}", here.joinpath("charts.js").read_text(encoding="utf-8"), styles
