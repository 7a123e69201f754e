"""Draws docs/demo.webp: the demonstration as a moving picture, the arm above its forces over time.

Needs neither a display nor a browser.  `make docs` draws it from the recording that docs/demo.txt reports.
"""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from wam_analysis import arm_picture
from wam_analysis.drawing import COLOURS, ESTIMATED, STYLE, TRUE
from wam_analysis.findings.analysis import TOPICS_READ
from wam_analysis.held_messages import row_at
from wam_analysis.recorded import RecordedArm, recorded_arm
from wam_analysis.recording import AnalysedRecording
from wam_analysis.thresholds import LAYOUT
from wam_analysis.traces import ForceSignal
from wam_bag.bag import JointColumns, read
from wam_description.signals import Contact

SIZE, DPI = (6.4, 6.4), 110
FRAMES_PER_SECOND, SPEED = 8, 1.5
LARGEST = 1_000_000  # bytes
QUALITY = 70


def frames(recording: AnalysedRecording, recorded: RecordedArm, joints: JointColumns) -> list[Image.Image]:
    """One picture for each instant shown."""
    begin, end = recording.steps[0].begin, recording.steps[-1].end
    stamps = np.arange(begin, end, round(1e9 * SPEED / FRAMES_PER_SECOND))
    order = [joints.names.index(name) for name in recorded.arm.joints.names]
    poses = [joints.position[row_at(joints.stamp_ns, stamp)][order].tolist() for stamp in stamps]
    with mpl.rc_context({**STYLE, "font.size": 11.0}):
        figure = Figure(figsize=SIZE, dpi=DPI)
        FigureCanvasAgg(figure)
        grid = figure.add_gridspec(2, 1, height_ratios=(1.7, 1.0), left=0.13, right=0.98, bottom=0.08, top=0.95)
        axes, forces = figure.add_subplot(grid[0]), figure.add_subplot(grid[1])
        for name, colour in COLOURS.items():
            size = getattr(recording.traces, name).size
            forces.plot((recording.traces.stamp - begin) / 1e9, size, color=colour, label=name)
        forces.set(xlabel="time [s]", ylabel="force [N]", xlim=(0.0, (end - begin) / 1e9), ylim=(0.0, None))
        forces.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=len(COLOURS))
        now = forces.axvline(0.0, color="#222222", linewidth=1.0, zorder=9)
        box = axes.get_window_extent()
        scenes = [arm_picture.scene(recorded.arm, q, recorded.world) for q in poses]
        views = [arm_picture.side_view(scene, float(box.width / box.height)) for scene in scenes]
        view = max(views, key=lambda view: view.width)  # does not move
        return [
            frame(figure, axes, now, recording, recorded, scene, q, view, int(stamp))
            for stamp, q, scene in zip(stamps, poses, scenes, strict=True)
        ]


def frame(figure, axes, now, recording, recorded, scene, q, view, stamp) -> Image.Image:  # type: ignore[no-untyped-def]
    """The picture of one instant."""
    axes.clear()
    arm_picture.draw(axes, scene, view)
    row = row_at(recording.traces.stamp, stamp)
    for signal, colour, width in ((recording.traces.true, TRUE, 5.0), (recording.traces.estimated, ESTIMATED, 2.0)):
        contact = contact_at(signal, row)
        if contact.cover in recorded.arm.covers.names and np.isfinite(contact.position):
            point, force = arm_picture.contact_on_surface(recorded.arm, q, contact)
            start, end = view.project(np.array([point, point + LAYOUT.metres_per_newton * force]))
            arm_picture.arrow(axes, start, end, colour, width)
    step = next((step.name for step in recording.steps if step.begin <= stamp < step.end), "")
    axes.text(0.02, 0.98, step, transform=axes.transAxes, va="top", fontsize=14)
    now.set_xdata([(stamp - recording.steps[0].begin) / 1e9] * 2)
    figure.canvas.draw()
    return Image.fromarray(np.asarray(figure.canvas.buffer_rgba())).convert("RGB")


def contact_at(signal: ForceSignal, row: int) -> Contact:
    """The contact at a row, none where no force acts."""
    x, y, z = signal.force[row].tolist()
    return Contact(str(signal.frame[row]) if signal.acts[row] else "", float(signal.position[row]), (x, y, z))


def save(bag: Path, file: Path) -> None:
    """Draw a recording into an animated WebP file, as good as its size allows."""
    recording = AnalysedRecording(read(bag, TOPICS_READ, may_lack=True))
    joints = recording.run.joints("sim/joint_states")
    assert joints is not None, f"{bag} has no sim/joint_states"
    first, *others = frames(recording, recorded_arm(recording.parameters), joints)
    duration = round(1000 / FRAMES_PER_SECOND)
    first.save(file, save_all=True, append_images=others, duration=duration, loop=0, quality=QUALITY, method=4)
    if file.stat().st_size > LARGEST:
        raise SystemExit(f"{file} has {file.stat().st_size} bytes, more than {LARGEST}: lower QUALITY")
