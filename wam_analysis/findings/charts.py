"""Charts of an analysis: what is drawn, as numbers, for the page's uPlot."""

import json
from collections.abc import Iterator
from importlib import resources
from typing import Any, NamedTuple

import numpy as np

from wam_analysis.drawing import COLOURS, COMMANDED, LIKELY, SHAFTS
from wam_analysis.findings.analysis import Analysis
from wam_analysis.findings.repetition import held as held_command
from wam_analysis.foreign.source import Source
from wam_analysis.recording import AnalysedRecording
from wam_analysis.thresholds import LAYOUT, STREAM
from wam_analysis.traces import Traces
from wam_bag.arrays import Numbers

FORCES = {**COLOURS, "at least": LIKELY}
TIME, FORCE, FIRST, SIGNALS = "time [s]", "force [N]", "happened", "signals"


class ChartLine(NamedTuple):
    """A line: its label, colour and values, (n,)."""

    label: str
    colour: str
    values: Numbers
    dashed: bool = False


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
    """

    section: str
    title: str
    across: str
    up: str
    x: Numbers
    series: tuple[ChartLine, ...]
    key: str = ""


def charts(analysis: Analysis) -> Iterator[Chart]:
    """Every chart for which the recording has data; those of `FIRST` fill a screen at most."""
    for i, chart in enumerate(_over_time(analysis.recording)):
        yield _thinned(chart._replace(section=FIRST if i < LAYOUT.first_charts else SIGNALS))
    yield from map(_thinned, _positions(analysis.recording.traces))


def _over_time(recording: AnalysedRecording) -> Iterator[Chart]:
    """Forces and motions, each with what was commanded."""
    yield from _forces_over_time(recording.traces)
    for one in _shown(recording):
        quantities = [q for q in one.values if not q.startswith("torque")][: 1 if one.is_joint else 3]
        if not quantities:
            continue  # none was a number
        command = recording.command_of(one)
        lines = [ChartLine(q, SHAFTS[i % len(SHAFTS)], one.values[q]) for i, q in enumerate(quantities)]
        if command is not None:
            held = [(q, held_command(command, q, one.time)) for q in quantities if q in command.values]
            lines += [ChartLine(f"{q} commanded", COMMANDED, value, True) for q, value in held]
        up = f"{quantities[0] if one.is_joint else 'force'} [{one.units[quantities[0]]}]"
        yield Chart(SIGNALS, f"{one.label} over time.", TIME, up, one.time, tuple(lines), one.topic)


def _shown(recording: AnalysedRecording) -> list[Source]:
    """What was measured, of each topic what moved most first; of this stack the joints, else the motors."""
    states = [one for one in recording.states if len(one.time) >= STREAM.shown]
    motors = [] if recording.is_foreign else [one for one in states if one.topic.endswith("/motor_states")]
    shown = motors if len(motors) == len(states) else [one for one in states if one not in motors]
    topics = [one.topic for one in shown]
    return sorted(shown, key=lambda one: (topics.index(one.topic), -_extent(one)))


def _extent(one: Source) -> float:
    """How far a source moved."""
    values = next(iter(one.values.values()), np.empty(0))
    known = values[np.isfinite(values)]
    return float(np.ptp(known)) if len(known) else 0.0


def _forces_over_time(traces: Traces) -> Iterator[Chart]:
    """The size of each force that was recorded; none if there is nothing to compare the commanded one with."""
    signals = {name: getattr(traces, name) for name in COLOURS}
    found = {name: signal.size for name, signal in signals.items() if np.any(signal.acts)}
    if not found.keys() - {"commanded"}:
        return
    if np.any(bound := traces.estimated.is_lower_bound):
        found |= {"at least": np.where(bound, found["estimated"], np.nan)}
        found["estimated"] = np.where(bound, np.nan, found["estimated"])
    rising = np.diff(traces.stamp, prepend=-1) > 0
    lines = (ChartLine(name, FORCES[name], value[rising], name == "commanded") for name, value in found.items())
    time = (traces.stamp - traces.stamp[0])[rising] / 1e9
    yield Chart(FIRST, "Size of the forces.", TIME, FORCE, time, tuple(lines), "time")


def _positions(traces: Traces) -> Iterator[Chart]:
    """Where the arm was touched."""
    touched = {name: getattr(traces, name) for name in ("true", "estimated")}
    positions = {name: np.where(one.acts, 100.0 * one.position, np.nan) for name, one in touched.items()}
    lines = [ChartLine(name, COLOURS[name], position) for name, position in positions.items()]
    if any(np.any(np.isfinite(line.values)) for line in lines):
        time = (traces.stamp - traces.stamp[0]) / 1e9
        yield Chart("contact", "Position of the contact along the link.", TIME, "position [cm]", time, tuple(lines))


def _thinned(chart: Chart) -> Chart:
    """The chart with at most `points` points, which looks the same: minimum and maximum of each interval."""
    if len(chart.x) <= LAYOUT.points:
        return chart
    edges = np.linspace(0, len(chart.x), LAYOUT.points // 2 + 1).astype(np.int64)
    lines = []
    for one in chart.series:
        filled = np.where(np.isfinite(one.values), one.values, np.nan)
        ends = [extreme.reduceat(filled, edges[:-1]) for extreme in (np.fmin, np.fmax)]
        lines.append(one._replace(values=np.column_stack(ends).ravel()))
    return chart._replace(x=np.repeat(chart.x[(edges[:-1] + edges[1:] - 1) // 2], 2), series=tuple(lines))


def data(found: list[Chart]) -> str:
    """The charts as JSON for charts.js, which cannot end a script element."""
    return json.dumps([_plain(chart) for chart in found], separators=(",", ":"), allow_nan=False).replace(
        "<", "\\u003c"
    )


def _plain(chart: Chart) -> dict[str, Any]:
    return {
        **{name: getattr(chart, name) for name in ("across", "up", "key")},
        "height": 240,
        "x": _numbers(chart.x),
        "series": [
            {
                "label": one.label,
                "dashed": one.dashed,
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
