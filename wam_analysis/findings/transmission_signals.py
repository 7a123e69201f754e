"""Torques and velocities of motors, cables and joints on one time base."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from wam_analysis.held_messages import by_names
from wam_analysis.measures.runs import after_gaps
from wam_analysis.thresholds import SHAFT
from wam_bag.arrays import Mask, Numbers, Times
from wam_description.arm import Arm
from wam_description.transmission_map import TransmissionMap
from wam_sim.recorded_run import RecordedRun

CABLE = "cable torque of the simulator"
STRAIN = "strain gauges"
GRAVITY = "gravity alone, while nothing touches"
TOUCHES = ("contact/wrench", "sim/disturbance")  # the second is of a simulated arm


class TransmissionSignals(NamedTuple):
    """k instants at a constant rate, but for gaps, n motors and joints.

    Attributes
    ----------
    arm : of the recording, its motors without cogging.
    time : (k,), s.
    angle, velocity, torque : (k, n), of the motors, rad, rad/s, N m.
    load : (k, n), torque that each motor passes on, N m.
    load_from : source of the load: `CABLE`, `STRAIN` or `GRAVITY`.
    use : (k,), instants at which the load is known.
    sampled : (k,), instants at which it was recorded; between them it is interpolated.
    joint_velocity : (k, n), rad/s; NaN if not recorded.
    cable_torque : (k, n), of the cables on the joints, N m; NaN if not recorded.
    strain : (k, n), torque on the link side of the joints' friction, N m; NaN if not recorded.
    caveats : what else the motors' friction holds, or may hold, a sentence each.
    """

    arm: Arm
    time: Numbers
    angle: Numbers
    velocity: Numbers
    torque: Numbers
    load: Numbers
    load_from: str
    use: Mask
    sampled: Mask
    joint_velocity: Numbers
    cable_torque: Numbers
    strain: Numbers
    caveats: tuple[str, ...]


def transmission_signals(run: RecordedRun, arm: Arm) -> TransmissionSignals | None:
    """The signals of a recording; None if it has no motor states or no load."""
    motors, joints = run.joints("motor_states"), arm.joints.names
    angle, velocity, torque = (by_names(motors, q, arm.motors.names) for q in ("position", "velocity", "effort"))
    if motors is None or angle is None or velocity is None or torque is None:
        return None
    stamps = motors.stamp_ns
    cable = _of(run, "sim/joint_states", "effort", joints, stamps)
    strain = _of(run, "joint_sensors", "effort", joints, stamps)
    speed, _ = _of(run, "joint_sensors", "velocity", joints, stamps)
    if not np.any(np.isfinite(speed)):
        speed, _ = _of(run, "sim/joint_states", "velocity", joints, stamps)
    gravity = _of(run, "gravity_effort", "effort", joints, stamps)
    at_joints, sampled, load_from = next(
        (
            (*one, name)
            for one, name in ((cable, CABLE), (strain, STRAIN), (gravity, GRAVITY))
            if np.any(np.isfinite(one[0])) and (name != CABLE or _period(run) <= SHAFT.slowest_period)
        ),
        (*cable, ""),
    )
    if not load_from:
        return None
    forward = np.concatenate(([True], stamps[1:] > np.maximum.accumulate(stamps)[:-1]))  # time that a reset repeats
    rows = np.flatnonzero(np.all(np.isfinite(at_joints), axis=1) & forward)
    matrix = TransmissionMap.of(arm).joint_from_motor
    use = ~run.braked(stamps[rows], SHAFT.release)  # not before the cables have taken the load
    caveats: tuple[str, ...] = ()
    if load_from == GRAVITY:
        touched = _touched(run, stamps[rows])
        caveats = tuple(_caveats(run, float(np.mean(touched[use])) if np.any(use) else 0.0))
        use &= ~touched
    return TransmissionSignals(
        arm=arm,
        time=stamps[rows] / 1e9,
        angle=angle[rows],
        velocity=velocity[rows],
        torque=torque[rows],
        load=at_joints[rows] @ matrix,
        load_from=load_from,
        use=use,
        sampled=sampled[rows],
        joint_velocity=speed[rows],
        cable_torque=cable[0][rows],
        strain=strain[0][rows],
        caveats=caveats,
    )


def _touched(run: RecordedRun, stamps: Times) -> Mask:
    """Whether something pushes or touches the arm, or does shortly before or after."""
    touched = np.zeros(len(stamps), dtype=np.bool_)
    for topic in TOUCHES:
        forces = run.wrench(topic)
        if forces is None:
            continue
        acting = forces.stamp_ns[np.any(forces.force != 0.0, axis=1)]
        near = np.searchsorted(acting, [stamps - SHAFT.around_contact, stamps + SHAFT.around_contact])
        touched |= near[1] > near[0]
    return touched


def _caveats(run: RecordedRun, left_out: float) -> Iterator[str]:
    """About a load from gravity alone; `left_out` is the fraction of the time in which something touched the arm."""
    yield "Only gravity is known as a load of the motors: their friction includes what accelerates the links."
    if left_out > 0.0:
        yield f"{100.0 * left_out:.0f} % of the time is left out, because something pushed or touched the arm."
    unknown = run.lacking(*TOUCHES[: 1 + run.is_simulated])
    if unknown:
        yield (
            f"It was not recorded whether something pushed or touched the arm ({', '.join(unknown)}). "
            "If it did, their friction includes it."
        )


def _period(run: RecordedRun) -> float:
    """Period of the simulator's joint states, s."""
    columns = run.joints("sim/joint_states")
    return float(np.median(np.diff(columns.stamp_ns))) / 1e9 if columns is not None else 0.0


def _of(run: RecordedRun, topic: str, field: str, names: tuple[str, ...], stamps: Times) -> tuple[Numbers, Mask]:
    """A field of another topic at some stamps, (k, n), interpolated, and where it was recorded, (k,).

    It is NaN outside of the messages and in their gaps.
    """
    result, recorded = np.full((len(stamps), len(names)), np.nan), np.zeros(len(stamps), np.bool_)
    columns = run.joints(topic)
    values = by_names(columns, field, names)
    if columns is not None and values is not None and len(columns.stamp_ns) > 1:
        inside = (stamps >= columns.stamp_ns[0]) & (stamps <= columns.stamp_ns[-1])
        row = np.minimum(np.searchsorted(columns.stamp_ns, stamps), len(columns.stamp_ns) - 1)
        recorded = stamps == columns.stamp_ns[row]
        inside &= ~after_gaps(columns.stamp_ns)[row] | recorded
        for i in range(len(names)):
            result[inside, i] = np.interp(stamps[inside], columns.stamp_ns, values[:, i])
    return result, recorded
