"""The picture of an analysis that is no chart: the arm and the force on it."""

import io
import math

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from wam_analysis import arm_picture
from wam_analysis.contact_list import contact_rows
from wam_analysis.drawing import ESTIMATED, STYLE, TRUE
from wam_analysis.held_messages import joint_angles, row_at
from wam_analysis.recorded import recorded_arm
from wam_analysis.recording import AnalysedRecording
from wam_analysis.thresholds import LAYOUT
from wam_sim.reactions import steady_begin


def arm_plot(recording: AnalysedRecording) -> tuple[str, bytes] | None:
    """Caption and SVG of the arm in the pose of `_moment`; None without a pose."""
    recorded, traces = recorded_arm(recording.parameters), recording.traces
    arm = recorded.arm
    poses = None if recording.is_foreign else joint_angles(recording.run, arm)
    if poses is None or not len(traces.stamp):
        return None
    stamp = _moment(recording)
    row, q = row_at(traces.stamp, stamp), poses[1][row_at(poses[0], stamp)].tolist()
    arrows = []
    for signal, colour, label, width in (
        (traces.true, TRUE, "true", 4.2),  # visible under a correct estimate
        (traces.estimated, ESTIMATED, "estimated", 1.3),
    ):
        contact = signal.contact(row)
        if contact.cover in arm.covers.names and math.isfinite(contact.position):
            point, force = arm_picture.contact_on_surface(arm, q, contact)
            ends = np.array([point, point + LAYOUT.metres_per_newton * force])
            arrows.append((ends, colour, f"{label} {np.linalg.norm(force):.1f} N", width))
    shown = arm_picture.scene(arm, q, recorded.world)
    width, height = LAYOUT.arm
    view = arm_picture.side_view(shown, width / height, more=[ends[1] for ends, *_ in arrows])
    stream = io.BytesIO()
    with mpl.rc_context({**STYLE, "svg.fonttype": "path", "svg.hashsalt": "wam"}):
        figure = Figure(figsize=LAYOUT.arm)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        arm_picture.draw(axes, shown, view)
        for ends, colour, label, width in arrows:
            start, end = view.project(ends)
            arm_picture.arrow(axes, start, end, colour, width)
            axes.plot([], [], color=colour, lw=width, label=label)
        if arrows:
            axes.legend(loc="upper right", fontsize=13)  # readable on a narrow page
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    seconds = (stamp - traces.zero) / 1e9
    note = f" ({recorded.note})" if recorded.note else ""
    return f"The arm at {seconds:.1f} s, with the true and the estimated contact force.{note}", stream.getvalue()


def _moment(recording: AnalysedRecording) -> int:
    """Middle of the steady state of the hardest press, else of the first contact, else the end, ns."""
    traces, holds = recording.traces, recording.holds
    if holds:
        hardest = max(holds, key=lambda hold: hold.commanded)
        return (steady_begin(hardest.begin, hardest.end) + hardest.end) // 2
    contacts = contact_rows(traces.stamp, traces.true.acts) or contact_rows(traces.stamp, traces.estimated.acts)
    return int(traces.stamp[sum(contacts[0]) // 2 if contacts else -1])
