"""The signals of a recording that its pictures show."""

import numpy as np
from numpy.typing import NDArray

from wam_analysis.findings.analysed_run import AnalysedRun
from wam_analysis.foreign.reading import COMMAND
from wam_analysis.thresholds import LAYOUT, STREAM
from wam_bag.bag import JointColumns, WrenchColumns
from wam_bag.columns import AXES

Numbers = NDArray[np.float64]

ORDER = ("joint_sensors", "joint_states", "sim/joint_states", "motor_states")  # where motion is best seen
COMMANDS = ("/force_command", "/sim/disturbance")  # forces that were commanded


def forces_over_time(recording: AnalysedRun) -> tuple[Numbers, dict[str, Numbers]] | None:
    """Time, (k,), s, and size of each force that was recorded, (k,), N; None if there is none."""
    traces = recording.summary.traces
    signals = {"commanded": traces.commanded, "true": traces.true, "measured": traces.measured}
    signals["estimated"] = traces.estimated
    found = {
        name: np.where(signal.is_known, signal.size, np.nan)
        for name, signal in signals.items()
        if len(traces.stamp) and np.any(signal.is_known) and np.any(signal.size[signal.is_known] > 0.0)
    }
    if not found or list(found) == ["commanded"]:
        return None  # nothing to compare the command with
    if np.any(bound := traces.estimated.is_lower_bound):
        found |= {"at least": np.where(bound, found["estimated"], np.nan)}
        found["estimated"] = np.where(bound, np.nan, found["estimated"])
    rising = np.concatenate(([True], np.diff(traces.stamp) > 0))
    time = (traces.stamp - traces.stamp[0])[rising] / 1e9
    return time, {name: value[rising] for name, value in found.items()}


def moving(recording: AnalysedRun) -> dict[str, JointColumns | WrenchColumns]:
    """The joints in which the motion is best seen, of another robot every one, and its forces, by topic."""
    topics = {
        name: columns
        for name, columns in sorted(recording.bag.topics.items())
        if isinstance(columns, (JointColumns, WrenchColumns))
        and len(columns.stamp_ns) >= STREAM.shown
        and recording.bag.types.get(name) != COMMAND
    }
    joints = {n: c for n, c in topics.items() if isinstance(c, JointColumns) and c.position.size}
    own = [name for name in (f"{recording.namespace}/{seen}" for seen in ORDER) if name in joints]
    own = [] if recording.is_foreign else own
    shown: dict[str, JointColumns | WrenchColumns] = dict(joints) if not own else {own[0]: joints[own[0]]}
    if forces_over_time(recording) is None:
        wrenches = {n: c for n, c in topics.items() if isinstance(c, WrenchColumns) and np.any(c.force != 0.0)}
        shown |= {n: c for n, c in wrenches.items() if not n.endswith(COMMANDS)}
    return {name: columns for name, columns in shown.items() if bool(np.all(np.diff(columns.stamp_ns) > 0))}


def commanded(recording: AnalysedRun, columns: JointColumns | WrenchColumns) -> dict[str, Numbers]:
    """What another robot was commanded at the stamps of a topic, by joint or axis, (n,): the last one before each."""
    found: dict[str, Numbers] = {}
    for name, command in recording.bag.topics.items():
        is_command = recording.bag.types.get(name) == COMMAND and type(command) is type(columns)
        if not (is_command and isinstance(command, (JointColumns, WrenchColumns))):
            continue
        rows = np.searchsorted(command.stamp_ns, columns.stamp_ns, side="right") - 1
        values = command.position if isinstance(command, JointColumns) else command.force
        names = command.names if isinstance(command, JointColumns) else AXES
        if values.size and np.all(np.diff(command.stamp_ns) >= 0):
            held = np.where(rows[:, np.newaxis] >= 0, values[np.maximum(rows, 0)], np.nan)
            found |= dict(zip(names, held.T, strict=True))
    return found


def spectrum(columns: JointColumns) -> tuple[Numbers, Numbers]:
    """Frequencies, (f,), Hz, and amplitude of each position, (f, n), rad, of a Hann window over the whole recording."""
    position = np.nan_to_num(columns.position)
    n = len(position)
    steps = np.linspace(-1.0, 1.0, n)[:, np.newaxis]
    flat = position - position.mean(axis=0)
    flat = flat - steps * (steps.T @ flat) / float(steps[:, 0] @ steps[:, 0])
    window = np.hanning(n)[:, np.newaxis]
    amplitude = 2.0 * np.abs(np.fft.rfft(flat * window, axis=0)) / float(window.sum())
    frequency = np.fft.rfftfreq(n, float(columns.stamp_ns[-1] - columns.stamp_ns[0]) / 1e9 / (n - 1))
    shown: Numbers = np.maximum(amplitude[1:], LAYOUT.amplitude).astype(np.float64)
    return frequency[1:].astype(np.float64), shown


def envelope(time: Numbers, value: Numbers, most: int) -> tuple[Numbers, Numbers]:
    """A line with at most so many points that looks the same: minimum and maximum of each interval.

    Parameters
    ----------
    time, value : (n,).
    most : points, an even number.
    """
    n = len(time)
    if n <= most:
        return time, value
    edges = np.linspace(0, n, most // 2 + 1).astype(np.int64)
    filled = np.where(np.isfinite(value), value, np.nan)
    low = np.fmin.reduceat(filled, edges[:-1])
    high = np.fmax.reduceat(filled, edges[:-1])
    at = time[(edges[:-1] + edges[1:] - 1) // 2]
    return np.repeat(at, 2), np.column_stack([low, high]).ravel()
