"""Forces and contacts of a recorded run on one time base."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wam_analysis.held_messages import held_of, held_rows, joint_angles, with_holes
from wam_analysis.holds import Hold
from wam_analysis.measures.runs import interpolated, median_step
from wam_analysis.thresholds import TOUCH
from wam_bag.arrays import Mask, Numbers, Texts, Times
from wam_description.arm import Arm
from wam_description.rigid_body import RigidBody
from wam_description.signals import BASE, NO_CONTACT, Contact
from wam_sim.recorded_run import RecordedRun

NAN = float("nan")
CLOCK = 10**16  # ns, above which a stamp is of the clock of a system, which does not begin with the run

HYPOTHESIS = ("probability", "position", "position_sd", "force_sd", "reasons")  # columns that are read


class ForceSignal(NamedTuple):
    """Forces over the k instants of a time base; NaN where nothing was recorded.

    Attributes
    ----------
    frame : (k,), frame of each force.
    force : (k, 3), N.
    position : (k,), distance along the frame's x, m; NaN also where it is not known.
    is_placed : (k,), whether a position was recorded, be it NaN.
    """

    frame: Texts
    force: Numbers
    position: Numbers
    is_placed: Mask

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

    @property
    def is_lower_bound(self) -> Mask:
        """Whether an estimated force is the least one that explains the torques, (k,): its position is unknown."""
        return self.acts & self.is_placed & np.isnan(self.position)

    def contact(self, row: int) -> Contact:
        """The force at an instant on its link; none where it is not known, or has no link."""
        force = self.force[row]
        if not np.all(np.isfinite(force)) or not np.any(force) or self.frame[row] in ("", BASE):
            return NO_CONTACT
        x, y, z = force.tolist()
        return Contact(str(self.frame[row]), float(self.position[row]), (x, y, z))

    def unknown(self, rows: Mask) -> "ForceSignal":
        """The same without its values in some rows, (k,)."""
        return self._replace(
            force=np.where(rows[:, np.newaxis], NAN, self.force), position=np.where(rows, NAN, self.position)
        )


class Traces(NamedTuple):
    """A run over time: k instants, ns of the arm's time.

    Attributes
    ----------
    commanded, measured : force of the arm on the world; of a task only where it has one force.  One in the base frame
        is given in that of the link on which it acts, once that is touched.
    true, estimated : contact according to the simulator and to the estimator, force of the world on the arm.
    push : disturbance that the scenario commanded, exerted by the simulator.
    """

    stamp: Times
    commanded: ForceSignal
    measured: ForceSignal
    true: ForceSignal
    estimated: ForceSignal
    push: ForceSignal

    def along(self, signal: ForceSignal) -> Numbers:
        """Component of the reaction to a force along the commanded one, (k,), N.

        NaN if none is commanded or the link is another one.

        Parameters
        ----------
        signal : force of the world on the arm, one of these traces.
        """
        size = self.commanded.size
        direction = self.commanded.force / np.where(size > 0.0, size, NAN)[:, np.newaxis]
        component = -np.sum(signal.force * direction, axis=1)
        component[signal.acts & (signal.frame != self.commanded.frame)] = NAN
        return component

    @property
    def zero(self) -> int:
        """From which times are counted, ns: 0, as the arm's time begins with the run, unless it is a system's clock."""
        return int(self.stamp[0]) if len(self.stamp) and self.stamp[0] > CLOCK else 0

    @property
    def period(self) -> float:
        """Time between two instants, s."""
        return median_step(self.stamp) / 1e9

    @property
    def is_compared(self) -> Mask:
        """Whether both the true and the estimated contact are known, (k,)."""
        return self.true.is_known & self.estimated.is_known

    @property
    def is_false(self) -> Mask:
        """Whether a contact is estimated and there is none, (k,)."""
        return self.is_compared & ~self.true.acts & self.estimated.acts

    @property
    def false_seconds(self) -> float:
        """For how long, s."""
        return float(np.count_nonzero(self.is_false)) * self.period

    @property
    def false_percent(self) -> float:
        """In how much of the time without contact one is estimated, %; NaN where there is no such time."""
        free = np.count_nonzero(self.is_compared & ~self.true.acts)
        return 100.0 * np.count_nonzero(self.is_false) / free if free else NAN

    def during(self, begin: int, end: int) -> Mask:
        """The instants from begin up to end, ns."""
        return (self.stamp >= begin) & (self.stamp < end)


def traces_of(run: RecordedRun, arm: Arm | None, tasks: Sequence[Hold]) -> Traces:
    """All signals at the stamps of the simulator's contact force, or of the next best topic that was recorded.

    That is the estimated one, which has a message in every outer period; a program need not command a force in all.

    Parameters
    ----------
    run : the run.
    arm : None if it is not known; forces in the base frame then stay there.
    tasks : forces that tasks command in it.
    """

    def signal(wrench: str, point: str = "") -> ForceSignal:
        forces = run.wrench(wrench)
        position, is_placed = np.full(len(base), NAN), np.zeros(len(base), bool)
        if forces is None:
            return ForceSignal(np.full(len(base), "", object), np.full((len(base), 3), NAN), position, is_placed)
        row, known = held_rows(forces.stamp_ns, base, held_of(run, wrench))
        force = np.where(known[:, np.newaxis], forces.force[row], NAN)
        if (placed := _positions(run, point)) is not None:
            at, is_there = held_rows(placed[0], base)
            is_placed = is_there & known & (placed[0][at] == forces.stamp_ns[row])
            position[is_placed] = placed[1][at[is_placed]]
        return ForceSignal(np.array(forces.frames, object)[row], force, position, is_placed)

    base = np.empty(0, np.int64)
    for name in ("sim/contact/wrench", "contact/wrench", "force_command"):
        if (columns := run.wrench(name)) is not None:
            base = with_holes(columns.stamp_ns, held_of(run, name))
            break
    commanded, measured = signal("force_command"), signal("force_measured")
    true = signal("sim/contact/wrench", "sim/contact/point")
    true = true._replace(force=np.where(true.size[:, np.newaxis] < TOUCH.least_force, 0.0, true.force))
    estimated = signal("contact/wrench", "contact/point")
    covers = _controlled(run, base, np.where(estimated.acts & ~true.acts, estimated.frame, true.frame))
    for task in tasks:
        rows = (base >= task.begin) & (base < task.end) & (task.axis < 0)
        frames, forces = commanded.frame.copy(), commanded.force.copy()
        frames[rows], forces[rows], covers[rows] = task.frame, task.force, task.cover
        commanded = commanded._replace(frame=frames, force=forces)
    if arm is not None:
        commanded, measured = _on_links(run, arm, base, (commanded, measured), covers)
    return Traces(base, commanded, measured, true, estimated, signal("sim/disturbance"))


def _positions(run: RecordedRun, topic: str) -> tuple[Times, Numbers] | None:
    """Stamps, ns, and positions along a link, m, of a topic, (k,); `contact/point` has those of the hypotheses."""
    if (columns := run.points(topic)) is not None:
        return columns.stamp_ns, columns.point[:, 0]
    if topic == "contact/point" and (hypotheses := most_probable(run)) is not None:
        return hypotheses[0], hypotheses[1]["position"]
    return None


def most_probable(run: RecordedRun) -> tuple[Times, dict[str, Numbers]] | None:
    """The most probable hypothesis of each message of `contact/hypotheses`, which is the contact that is published.

    Returns
    -------
    tuple or None
        stamps, (k,), ns, and columns by their names, (k,); None without a table of hypotheses.
    """
    columns = run.table("contact/hypotheses")
    if columns is None or not len(columns.message) or not {*HYPOTHESIS} <= {*columns.columns}:
        return None
    _, first = np.unique(columns.message, return_index=True)
    return columns.row_stamp_ns[first], {name: columns.columns[name][first] for name in HYPOTHESIS}


def _controlled(run: RecordedRun, base: Times, touched: Texts) -> Texts:
    """The cover on which the force loop controls the force at each instant, (k,); where unknown, what is touched."""
    columns = run.table("force_axis")
    if columns is None:
        return touched
    row, known = held_rows(columns.stamp_ns, base)
    frames = np.array(columns.frames, object)[row]
    return np.where(known & (frames != BASE), frames, touched)


def _on_links(
    run: RecordedRun, arm: Arm, base: Times, signals: tuple[ForceSignal, ForceSignal], covers: Texts
) -> tuple[ForceSignal, ForceSignal]:
    """Signals whose forces in the base frame are given in those of some covers, (k,), if the first signal acts."""
    rows = np.flatnonzero((signals[0].frame == BASE) & signals[0].acts)
    poses = joint_angles(run, arm)
    if not len(rows) or poses is None:
        return signals
    rows = rows[np.isin(covers[rows], arm.covers.names)]
    q = interpolated(base[rows], *poses)
    body = RigidBody(arm)
    rotations = [body.cover_pose(one, cover).rotation.T for one, cover in zip(q, covers[rows].tolist(), strict=True)]
    found: list[ForceSignal] = []
    for signal in signals:
        frame, force = signal.frame.copy(), signal.force.copy()
        of_base = signal.frame[rows] == BASE
        turned = np.einsum("kij,kj->ki", np.reshape(rotations, (-1, 3, 3)), signal.force[rows])
        frame[rows[of_base]], force[rows[of_base]] = covers[rows[of_base]], turned[of_base]
        found.append(signal._replace(frame=frame, force=force))
    return found[0], found[1]
