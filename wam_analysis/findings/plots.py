"""The pictures of an analysis, each drawn for a wide and for a narrow page."""

import io
from typing import Any, NamedTuple

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from wam_analysis import arm_picture
from wam_analysis.demo_figure import draw_arm, seconds_at
from wam_analysis.drawing import STYLE, widen_flat
from wam_analysis.findings.analysis import Analysis
from wam_analysis.findings.charts import Chart
from wam_analysis.findings.signals import envelope
from wam_analysis.recorded import recorded_arm
from wam_analysis.thresholds import LAYOUT

PAGE_STYLE: Any = {
    **STYLE,
    "font.size": 10.0,
    "axes.grid": True,
    "grid.color": "#e6e8eb",
    "legend.fontsize": 9.0,
    "svg.fonttype": "path",
    "svg.hashsalt": "wam",
    "path.simplify": True,
    "path.simplify_threshold": 0.5,
}


class Plot(NamedTuple):
    """A picture in two widths: its caption, 'svg+xml' or 'png', and its bytes."""

    title: str
    kind: str
    wide: bytes
    narrow: bytes


def still(chart: Chart) -> Plot:
    """A chart as a picture, for print and where no script runs."""
    with mpl.rc_context(PAGE_STYLE):
        wide, narrow = (_drawn(chart, width) for width in (LAYOUT.wide, LAYOUT.narrow))
    return Plot(chart.title, "svg+xml", wide, narrow)


def _drawn(chart: Chart, width: float) -> bytes:
    figure = Figure(figsize=(width, LAYOUT.still_height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    most = round(LAYOUT.points_per_inch * width)
    for one in chart.series:
        x, y = (chart.x, one.values) if one.dots else envelope(chart.x, one.values, most)
        style = {"ls": "none", "marker": ".", "ms": 2.0} if one.dots else {"ls": "--" if one.dashed else "-", "lw": 1.2}
        axes.plot(x, y, color=one.colour, label=one.label, **style)
    axes.set(xlabel=chart.across, ylabel=chart.up)
    if chart.logarithmic:
        axes.set(xscale="log", yscale="log")
    else:
        widen_flat(axes)
    if len(chart.series) > 1:
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, handlelength=1.4, columnspacing=1.0)
    stream = io.BytesIO()
    figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    return stream.getvalue()


def arm_plot(analysis: Analysis) -> Plot | None:
    """The arm, rendered by MuJoCo or drawn, the same for both widths; None without a pose."""
    recording = analysis.recording
    moment = recording.summary.moment
    if moment is None:
        return None
    recorded = recorded_arm(recording.run.parameters)
    figure = Figure(figsize=(5.6, 4.2), dpi=LAYOUT.png_dpi)
    FigureCanvasAgg(figure)
    stream = io.BytesIO()
    with mpl.rc_context(PAGE_STYLE):
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        draw_arm(axes, recording.summary, recorded, arm_picture.GL, letter=None)
        figure.savefig(stream, format="png", metadata={"Software": None})
    seconds = seconds_at(recording.summary, moment.stamp)
    title = f"The arm after {seconds:.1f} s, with the true and the estimated contact force."
    title += f" ({recorded.note})" if recorded.note else ""
    return Plot(title, "png", stream.getvalue(), stream.getvalue())
