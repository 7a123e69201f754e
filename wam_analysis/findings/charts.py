"""Charts of an analysis that can be zoomed, drawn in the page by the embedded library uPlot (MIT)."""

import json
from collections.abc import Iterator
from importlib import resources
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.drawing import ESTIMATED, MEASURED, SHAFTS, TRUE
from wam_analysis.findings.analysis import Analysis
from wam_analysis.findings.signals import envelope, forces_over_time, moving, spectrum
from wam_analysis.thresholds import LAYOUT
from wam_bag.bag import JointColumns

Numbers = NDArray[np.float64]

INK = "ink"  # the colour of the page's text, for what was commanded: readable on light and dark


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
    logarithmic : whether the axis up is.
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
    """Every chart for which the recording has data."""
    traces = forces_over_time(analysis.recording)
    if traces is not None:
        time, forces = traces
        colours = {"commanded": INK, "measured": MEASURED, "true": TRUE, "estimated": ESTIMATED}
        lines = [ChartLine(name, colours[name], value, name == "commanded") for name, value in forces.items()]
        yield _thinned(Chart("happened", "Size of the forces.", "time [s]", "force [N]", time, tuple(lines), "time"))
    found = moving(analysis.recording)
    for name, columns in found.items():
        time = (columns.stamp_ns - columns.stamp_ns[0]) / 1e9
        if isinstance(columns, JointColumns):
            for i, joint in enumerate(columns.names):
                line = ChartLine(joint, SHAFTS[i % len(SHAFTS)], columns.position[:, i])
                title = f"Position of {joint} on {name}."
                yield _thinned(Chart("happened", title, "time [s]", "position [rad]", time, (line,), name))
        else:
            lines = [ChartLine(axis, SHAFTS[i], columns.force[:, i]) for i, axis in enumerate("xyz")]
            yield _thinned(Chart("happened", f"Force on {name}.", "time [s]", "force [N]", time, tuple(lines), name))
    for one in analysis.held:
        if len(one.time):
            level = np.full(len(one.time), one.hold.commanded)
            lines = [ChartLine("measured", MEASURED, one.measured), ChartLine("commanded", INK, level, True)]
            if len(one.true):
                lines.insert(0, ChartLine("true", TRUE, np.interp(one.time, one.time_true, one.true)))
            yield _thinned(Chart("force", f"{one.hold.name}.", "time [s]", "force [N]", one.time, tuple(lines)))
    for name, columns in found.items():
        if isinstance(columns, JointColumns) and len(columns.stamp_ns) >= 64:
            frequency, amplitude = spectrum(columns)
            lines = [ChartLine(n, SHAFTS[i % len(SHAFTS)], amplitude[:, i]) for i, n in enumerate(columns.names)]
            title = f"Spectrum of the positions on {name}: amplitude of each frequency, over the whole recording."
            up = "amplitude [rad]"
            yield Chart("stability", title, "frequency [Hz]", up, frequency, tuple(lines), logarithmic=True)


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
        "across": chart.across,
        "up": chart.up,
        "key": chart.key,
        "logarithmic": chart.logarithmic,
        "height": 240,
        "x": _numbers(chart.x),
        "series": [
            {"label": one.label, "colour": one.colour, "dashed": one.dashed, "y": _numbers(one.values)}
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
