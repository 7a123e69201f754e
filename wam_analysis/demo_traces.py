"""Forces and contacts of a recorded run on one time base."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_sim.recording import RecordedRun

Numbers = NDArray[np.float64]
Names = NDArray[np.str_]
Times = NDArray[np.int64]
Mask = NDArray[np.bool_]

NAN = float("nan")
HELD = 100_000_000  # ns for which a message is held; after that the signal is unknown

RECORDED = (
    "force_command", "force_measured", "contact/wrench", "contact/point", "sim/contact/wrench", "sim/contact/point",
    "sim/disturbance", "sim/joint_states",
)  # fmt: skip
TOPICS_READ = (*RECORDED, "joint_states", "contact/hypotheses", "status", "/diagnostics")


class ForceSignal(NamedTuple):
    """Forces over the k instants of a time base; NaN where nothing was recorded.

    Attributes
    ----------
    frame : (k,), frame of each force.
    force : (k, 3), N.
    position : (k,), distance along the frame's x, m; NaN also where it is not known.
    """

    frame: Names
    force: Numbers
    position: Numbers

    @property
    def size(self) -> Numbers:
        """Magnitude of each force, (k,), N."""
        return np.linalg.norm(self.force, axis=1)

    @property
    def acts(self) -> Mask:
        """Whether there is a force, (k,)."""
        return self.size > 0.0

    @property
    def is_known(self) -> Mask:
        """Whether it was recorded, (k,)."""
        return ~np.isnan(self.size)


class Traces(NamedTuple):
    """A run over time: k instants, ns of the arm's time.

    Attributes
    ----------
    commanded, measured : force of the arm on the world.
    true, estimated : contact according to the simulator and to the estimator, force of the world on the arm.
    push : disturbance that the scenario commanded, exerted by the simulator.
    """

    stamp: Times
    commanded: ForceSignal
    measured: ForceSignal
    true: ForceSignal
    estimated: ForceSignal
    push: ForceSignal

    def along(self, signal: ForceSignal, sign: float = 1.0) -> Numbers:
        """Component along the commanded force, (k,), N; NaN if none is commanded or the link is another one.

        Parameters
        ----------
        signal : one of these traces.
        sign : -1 for a force of the world on the arm, to make it one of the arm on the world.
        """
        size = self.commanded.size
        direction = self.commanded.force / np.where(size > 0.0, size, NAN)[:, np.newaxis]
        component: Numbers = sign * np.sum(signal.force * direction, axis=1)
        component[signal.acts & (signal.frame != self.commanded.frame)] = NAN
        return component

    def during(self, begin: int, end: int) -> Mask:
        """The instants from begin up to end, ns."""
        return (self.stamp >= begin) & (self.stamp < end)


def traces_of(run: RecordedRun) -> Traces:
    """All signals at the stamps of the simulator's contact force, or of the next best topic that was recorded."""

    def signal(wrench: str, point: str = "") -> ForceSignal:
        forces, points = run.wrench(wrench), run.points(point)
        if forces is None:
            return ForceSignal(np.full(len(base), ""), np.full((len(base), 3), NAN), np.full(len(base), NAN))
        row, known = _held(forces.stamp_ns, base)
        force = np.where(known[:, np.newaxis], forces.force[row], NAN)
        position = np.full(len(base), NAN)
        if points is not None:
            at, is_there = _held(points.stamp_ns, base)
            same = is_there & known & (points.stamp_ns[at] == forces.stamp_ns[row])
            position[same] = points.point[at[same], 0]
        return ForceSignal(np.array(forces.frames, np.str_)[row], force, position)

    base = np.empty(0, np.int64)
    for name in ("sim/contact/wrench", "force_command", "contact/wrench"):
        if (columns := run.wrench(name)) is not None:
            base = columns.stamp_ns
            break
    return Traces(
        stamp=base,
        commanded=signal("force_command"),
        measured=signal("force_measured"),
        true=signal("sim/contact/wrench", "sim/contact/point"),
        estimated=signal("contact/wrench", "contact/point"),
        push=signal("sim/disturbance"),
    )


def _held(stamps: Times, base: Times) -> tuple[NDArray[np.intp], Mask]:
    """Row of the last message at or before each instant, and whether there is one and it is still held."""
    row = np.searchsorted(stamps, base, side="right") - 1
    known = row >= 0
    row = np.maximum(row, 0)
    return row, known & (base - stamps[row] <= HELD)
