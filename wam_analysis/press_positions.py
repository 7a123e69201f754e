"""What the contact position is worth in a press: the force that the same torques are, taken at several positions."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.demo_traces import NAN, Mask, Traces
from wam_analysis.task_forces import arm_of
from wam_analysis.thresholds import TOUCH
from wam_bag.bag import BagError, TableColumns
from wam_control.force.force_axis import ForceAxes, PressedForce
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_description.rigid_body import RigidBody
from wam_sim.recording import RecordedRun


class PositionedForce(NamedTuple):
    """A force that is measured as if it acted at a position: m along the link, N along the commanded force."""

    position: float = NAN
    force: float = NAN


class PressPositions(NamedTuple):
    """What is measured at the configured position, at the estimated one, at the true one; NaN where it is unknown.

    `used` and `used_sd` are the position that the force loop measured with, and its standard deviation, m.
    """

    configured: PositionedForce = PositionedForce()
    estimated: PositionedForce = PositionedForce()
    true: PositionedForce = PositionedForce()
    used: float = NAN
    used_sd: float = NAN

    @property
    def forces(self) -> tuple[PositionedForce, ...]:
        """Those at the three positions."""
        return self.configured, self.estimated, self.true


NOWHERE = PressPositions()


def press_positions(run: RecordedRun, traces: Traces, steady: Mask, measured: float) -> PressPositions:
    """Forces of the steady state of a press.

    Parameters
    ----------
    steady : its instants.
    measured : force that the force loop measured, at the position that it used, N.
    """
    arm, torques = arm_of(run), run.joints("external_joint_torques")
    joints, used = run.joints("sim/joint_states") or run.joints("joint_states"), _used(run)
    try:
        own = run.parameters.part("force_loop", ForceLoopParameters)
    except BagError:
        return NOWHERE
    if arm is None or torques is None or joints is None or used is None or not torques.effort.size:
        return NOWHERE
    body = RigidBody(arm)
    axes = ForceAxes(arm, body, own.sensing)
    rows = np.flatnonzero(steady)
    rows = rows[np.linspace(0, len(rows) - 1, TOUCH.samples).round().astype(int)]
    covers = set(traces.commanded.frame[rows].tolist())
    cover = str(min(covers))
    if len(covers) > 1 or cover not in arm.covers.names:
        return NOWHERE
    stamps, order = traces.stamp[rows], [joints.names.index(name) for name in arm.joints.names]
    q = _at(stamps, joints.stamp_ns, joints.position[:, order])
    external = _at(stamps, torques.stamp_ns, torques.effort)
    present = _at(stamps, *used)

    def at(position: float) -> PositionedForce:
        if not 0.0 <= position <= arm.covers.length_of(cover):
            return PositionedForce()
        changes = []
        for pose, torque, there, command in zip(
            q, external, present.tolist(), traces.commanded.force[rows], strict=True
        ):
            size = float(np.linalg.norm(command))
            direction = body.cover_pose(pose, cover).rotation @ command / size
            here, before = (
                axes.axis(pose, PressedForce(cover, where, sd, direction, size)).sense
                for where, sd in ((position, 0.0), there)
            )
            changes.append(float((before - here) @ torque))  # of the world on the joints, so the sign is the other one
        return PositionedForce(position, measured + float(np.mean(changes)))

    def of(signal: NDArray[np.float64], frames: NDArray[np.str_]) -> float:
        known = signal[rows][(frames[rows] == cover) & ~np.isnan(signal[rows])]
        return float(np.mean(known)) if 2 * len(known) >= TOUCH.samples else NAN

    configured = own.contact_position if own.contact_cover == cover else NAN
    true, estimated = traces.true, traces.estimated
    places = (configured, of(estimated.position, estimated.frame), of(true.position, true.frame))
    used, used_sd = present.mean(0).tolist()
    configured_force, estimated_force, true_force = map(at, places)
    return PressPositions(configured_force, estimated_force, true_force, used, used_sd)


def _used(run: RecordedRun) -> tuple[NDArray[np.int64], NDArray[np.float64]] | None:
    """Stamps, ns, and the position at which the force loop measured with its standard deviation, (k, 2), m."""
    columns = run.bag.topics.get(f"{run.namespace}/force_axis")
    if not isinstance(columns, TableColumns) or not len(columns.row_stamp_ns):
        return None
    names = "position", "position_sd"
    if not set(names) <= set(columns.columns):
        return None
    return columns.row_stamp_ns, np.column_stack([columns.columns[name] for name in names])


def _at(stamps: NDArray[np.int64], of: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (k, n) at other times, ns."""
    return np.stack([np.interp(stamps, of, column) for column in values.T], axis=1)
