"""A bag for the Rerun viewer: the moving arm, the forces on it, and plots.

Rerun comes with the extra 'view' and is imported only when it is needed.
"""

import math
import os
import shutil
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wam_analysis.arm_picture import side_view
from wam_analysis.demo_traces import ForceSignal
from wam_analysis.drawing import BLOCK_COLOUR, COLOURS, PEDESTAL_COLOUR, TUBE_COLOURS, channels
from wam_analysis.findings.analysed_run import STAMPED, AnalysedRun
from wam_analysis.held_messages import by_names
from wam_analysis.recorded import RecordedArm, recorded_arm
from wam_analysis.thresholds import LAYOUT
from wam_bag.bag import JointColumns
from wam_description.arm import Arm
from wam_description.rigid_body import RigidBody

Numbers = NDArray[np.float64]
Times = NDArray[np.int64]

APPLICATION = "wam_stack"
PROGRAM = "rerun"
TIMELINE = "time"
# plots, each with the corner in which its legend covers no curve of the demonstration
LEGENDS = {"force": "RightTop", "position": "RightTop", "joints": "LeftBottom"}


class NoViewerError(OSError):
    """Rerun is not installed, or its program is not found."""


def viewer() -> str:
    """Path of Rerun's program: next to this Python, where its package puts it, else on the search path.

    Raises
    ------
    NoViewerError
        if it is in neither; the message states what to do.
    """
    own = Path(sys.executable).parent
    found = shutil.which(PROGRAM, path=str(own)) or shutil.which(PROGRAM)
    if found is None:
        raise NoViewerError(
            f"Rerun's program '{PROGRAM}' is neither in {own} nor on PATH; pip install 'wam_stack[view]', or write "
            "a file with --save and open it where the program is"
        )
    return found


def load_rerun() -> Any:
    """The module of Rerun.

    Raises
    ------
    NoViewerError
        if it is not installed; the message states how to install it.
    """
    try:
        import rerun
        import rerun.blueprint
    except ImportError as error:
        raise NoViewerError(f"Rerun is not installed ({error}); pip install 'wam_stack[view]', or rerun-sdk") from error
    return rerun


def view(recording: AnalysedRun, save: Path | None) -> str:
    """Send a recording to a file or to a viewer, which is opened.

    Parameters
    ----------
    recording : of a bag.
    save : .rrd file to write; None opens the viewer.

    Returns
    -------
    str
        what was logged, in a line.

    Raises
    ------
    NoViewerError
        if Rerun is not installed.
    ValueError
        if the bag has no joint states.
    """
    rerun = load_rerun()
    arm = recorded_arm(recording.run.parameters)
    joints = joint_motion(recording, arm.arm)
    if joints is None and not any(isinstance(c, JointColumns) for c in recording.bag.topics.values()):
        raise ValueError(f"{recording.bag.path} has no joint states; nothing can be shown")
    stream = rerun.RecordingStream(APPLICATION, recording_id=recording.bag.path.name)
    if save is None:
        os.environ["PATH"] = f"{Path(viewer()).parent}{os.pathsep}{os.environ.get('PATH', '')}"  # spawn looks there
        try:
            stream.spawn(default_blueprint=_blueprint(rerun, arm, joints))
        except RuntimeError as error:
            reason = str(error).strip().partition("\n")[0]
            raise NoViewerError(f"the viewer does not start ({reason}); --save writes a file for it") from error
    else:
        stream.save(save, default_blueprint=_blueprint(rerun, arm, joints))
    zero = _zero(recording)
    poses = 0
    if joints is not None:
        poses = _log_arm(rerun, stream, arm, joints, zero)
        _log_contacts(rerun, stream, recording, arm.arm, joints, zero)
    _log_plots(rerun, stream, recording, zero)
    _log_status(rerun, stream, recording, zero)
    stream.flush()
    return f"{poses} poses of the arm, {len(recording.summary.traces.stamp)} instants of its forces"


def joint_motion(recording: AnalysedRun, arm: Arm) -> tuple[Times, Numbers] | None:
    """Stamps and angles of the joints, from the best topic in the bag, `poses` per second."""
    for name in ("sim/joint_states", "joint_sensors", "joint_states"):
        columns = recording.run.joints(name)
        angles = None if columns is None else by_names(columns, "position", arm.joints.names)
        if columns is not None and angles is not None:
            good = np.flatnonzero(np.all(np.isfinite(angles), axis=1))
            steps = np.diff(columns.stamp_ns[good])
            period = float(np.median(steps)) / 1e9 if len(steps) else 1.0
            some = good[:: max(1, round(1.0 / (LAYOUT.poses * period)))]
            return columns.stamp_ns[some], angles[some]
    return None


def _zero(recording: AnalysedRun) -> int:
    topics = recording.bag.topics.values()
    return min((int(c.stamp_ns[0]) for c in topics if isinstance(c, STAMPED) and len(c.stamp_ns)), default=0)


def _blueprint(rerun: Any, recorded: RecordedArm, joints: tuple[Times, Numbers] | None) -> Any:
    """The arm on the left, from the side as in the other pictures; plots and status on the right."""
    show = rerun.blueprint
    eye = None
    if joints is not None and len(joints[1]):
        side = side_view(recorded.arm, joints[1][len(joints[1]) // 2].tolist(), recorded.obstacles, aspect=1.0)
        position = side.centre - LAYOUT.eye_distance * side.height * side.axes[2]
        eye = show.EyeControls3D(position=position, look_target=side.centre, eye_up=[0.0, 0.0, 1.0])
    plots = [
        show.TimeSeriesView(origin=f"/plots/{name}", name=name, plot_legend=show.PlotLegend(corner))
        for name, corner in LEGENDS.items()
    ]
    right = show.Vertical(*plots, show.TextLogView(origin="/status", name="status"), row_shares=LAYOUT.plot_heights)
    left = show.Spatial3DView(origin="/arm", name="arm", eye_controls=eye)
    return show.Blueprint(
        show.Horizontal(left, right), show.TimePanel(expanded=False, timeline=TIMELINE), collapse_panels=True
    )


def _times(rerun: Any, stamps: Times, zero: int) -> list[Any]:
    return [rerun.TimeColumn(TIMELINE, duration=(stamps - zero) / 1e9)]


def _log_arm(rerun: Any, stream: Any, recorded: RecordedArm, joints: tuple[Times, Numbers], zero: int) -> int:
    """Moving covers as capsules, and the obstacles; returns the number of poses."""
    arm, covers = recorded.arm, recorded.arm.covers
    stream.log("arm", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    body = RigidBody(arm)
    for i, cover in enumerate(covers.names):
        start, end = (np.array(point[3 * i : 3 * i + 3]) for point in (covers.start, covers.end))
        axis, angle = _turn(end - start)
        capsule = rerun.Capsules3D(
            lengths=[float(np.linalg.norm(end - start))],
            radii=[covers.radius[i]],
            translations=[start],
            rotation_axis_angles=[rerun.RotationAxisAngle(axis=axis, radians=angle)],
            colors=[channels(TUBE_COLOURS[i % len(TUBE_COLOURS)])],
            fill_mode="solid",
        )
        stream.log(f"arm/{cover}", capsule, static=True)
        poses = [body.cover_pose(q, cover) for q in joints[1].tolist()]
        columns = rerun.Transform3D.columns(
            translation=[pose.position for pose in poses], mat3x3=[pose.rotation for pose in poses]
        )
        stream.send_columns(f"arm/{cover}", _times(rerun, joints[0], zero), columns)
    _log_obstacles(rerun, stream, recorded)
    return len(joints[0])


def _log_obstacles(rerun: Any, stream: Any, recorded: RecordedArm) -> None:
    base = rerun.Cylinders3D(
        lengths=[-LAYOUT.floor],
        radii=[LAYOUT.pedestal],
        centers=[(0.0, 0.0, 0.5 * LAYOUT.floor)],
        colors=[channels(PEDESTAL_COLOUR)],
        fill_mode="solid",
    )
    stream.log("arm/world/base", base, static=True)
    obstacles = recorded.obstacles
    for i, (name, shape) in enumerate(zip(obstacles.names, obstacles.shapes, strict=True)):
        triple = slice(3 * i, 3 * i + 3)
        centre, sizes = obstacles.positions[triple], obstacles.sizes[triple]
        quaternion = rerun.Quaternion(xyzw=_quaternion(*obstacles.rotations[triple]))
        pose = {"centers": [centre], "quaternions": [quaternion], "colors": [channels(BLOCK_COLOUR)]}
        if shape == "cylinder":
            solid = rerun.Cylinders3D(lengths=[2.0 * sizes[1]], radii=[sizes[0]], fill_mode="solid", **pose)
        else:
            half = (*sizes[:2], sizes[2] if shape == "box" else 0.001)
            solid = rerun.Boxes3D(half_sizes=[half], fill_mode="solid", **pose)
        stream.log(f"arm/world/{name}", solid, static=True)


def _log_contacts(
    rerun: Any, stream: Any, recording: AnalysedRun, arm: Arm, joints: tuple[Times, Numbers], zero: int
) -> None:
    """Arrows of the contact force on the arm, true and estimated, in the frame of the cover in contact."""
    traces = recording.summary.traces
    if not len(traces.stamp):
        return
    rows = np.clip(np.searchsorted(traces.stamp, joints[0], side="right") - 1, 0, len(traces.stamp) - 1)
    for name, signal in (("true", traces.true), ("estimated", traces.estimated)):
        for cover in arm.covers.names:
            origins, vectors = _arrows(signal, rows, cover)
            if not np.any(vectors):
                continue
            path = f"arm/{cover}/{name}"
            stream.log(path, rerun.Arrows3D.from_fields(colors=[channels(COLOURS[name])], radii=[0.004]), static=True)
            columns = rerun.Arrows3D.columns(origins=origins, vectors=vectors)
            stream.send_columns(path, _times(rerun, joints[0], zero), columns)


def _arrows(signal: ForceSignal, rows: NDArray[np.intp], cover: str) -> tuple[Numbers, Numbers]:
    """Origin and vector of each arrow, m, in the cover's frame; zero without contact."""
    there = (signal.frame[rows] == cover) & signal.acts[rows] & np.isfinite(signal.position[rows])
    origins, vectors = np.zeros((len(rows), 3)), np.zeros((len(rows), 3))
    origins[there, 0] = signal.position[rows][there]
    vectors[there] = LAYOUT.metres_per_newton * signal.force[rows][there]
    return origins, vectors


def _log_plots(rerun: Any, stream: Any, recording: AnalysedRun, zero: int) -> None:
    for path, stamps, values in _series(recording):
        if np.any(np.isfinite(values)):  # NaN interrupts the line
            name = path.rsplit("/", 1)[-1]
            colours = {"colors": [channels(COLOURS[name])]} if name in COLOURS else {}
            stream.log(path, rerun.SeriesLines(names=[name], **colours), static=True)
            columns = rerun.Scalars.columns(scalars=values)
            stream.send_columns(path, _times(rerun, stamps, zero), columns)


def _series(recording: AnalysedRun) -> Iterator[tuple[str, Times, Numbers]]:
    """Path, stamps and values of each line."""
    traces = recording.summary.traces
    if len(traces.stamp):
        signals = {name: getattr(traces, name) for name in COLOURS}
        for name, signal in signals.items():
            yield f"plots/force/{name}", traces.stamp, signal.size
        for name in ("true", "estimated"):
            yield f"plots/position/{name}", traces.stamp, np.where(signals[name].acts, signals[name].position, math.nan)
    topics = [name for name, columns in recording.bag.topics.items() if isinstance(columns, JointColumns)]
    own = f"{recording.namespace}/joint_states"
    for topic in [own] if own in topics else topics:
        columns = recording.bag.topics[topic]
        if isinstance(columns, JointColumns) and columns.position.size:
            for i, name in enumerate(columns.names):
                yield f"plots/joints/{name}", columns.stamp_ns, columns.position[:, i]


def _log_status(rerun: Any, stream: Any, recording: AnalysedRun, zero: int) -> None:
    for stamp, status in recording.run.stamped_statuses():
        if stamp:
            stream.set_time(TIMELINE, duration=max((stamp - zero) / 1e9, 0.0))
            stream.log(f"status/{status.node}", rerun.TextLog(status.message))


def _turn(direction: Numbers) -> tuple[list[float], float]:
    """Axis and angle that turn z into a direction."""
    unit = direction / float(np.linalg.norm(direction))
    axis = np.cross([0.0, 0.0, 1.0], unit)
    size = float(np.linalg.norm(axis))
    if size < 1e-12:
        return [1.0, 0.0, 0.0], 0.0 if unit[2] > 0.0 else math.pi
    return (axis / size).tolist(), math.atan2(size, float(unit[2]))


def _quaternion(roll: float, pitch: float, yaw: float) -> Sequence[float]:
    """Quaternion x y z w of a turn about fixed x, then y, then z."""
    cr, sr, cp, sp, cy, sy = (f(a / 2.0) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )
