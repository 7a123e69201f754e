"""Motors, cables and joints on one time base, and their friction, as far as a recording shows it."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wam_analysis.findings.finding import shown
from wam_analysis.held_messages import by_names
from wam_analysis.measures.friction import UNKNOWN, Friction, identify_friction
from wam_analysis.measures.runs import after_gaps, interpolated, median_step
from wam_analysis.recorded import PredictionParameters
from wam_analysis.thresholds import SHAFT
from wam_bag.arrays import Mask, Numbers, Times
from wam_description.arm import Arm
from wam_sim.recorded_run import RecordedRun

LACKING = "Friction and efficiency cannot be evaluated: {} in this bag."
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

    @property
    def rotors(self) -> Numbers:
        """Torque that accelerates the rotors, (k, n), N m."""
        return np.array(self.arm.motors.inertia) * np.gradient(self.velocity, self.time, axis=0)


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
    loads = {CABLE: cable, STRAIN: strain, GRAVITY: _of(run, "gravity_effort", "effort", joints, stamps)}
    simulated = run.joints("sim/joint_states")
    if simulated is not None and median_step(simulated.stamp_ns) / 1e9 > SHAFT.slowest_period:
        del loads[CABLE]
    load_from = next((name for name, (load, _) in loads.items() if np.any(np.isfinite(load))), "")
    if not load_from:
        return None
    at_joints, sampled = loads[load_from]
    forward = np.diff(np.maximum.accumulate(stamps), prepend=-1) > 0  # time that a reset repeats
    rows = np.flatnonzero(np.all(np.isfinite(at_joints), axis=1) & forward)
    matrix = arm.transmission.joint_from_motor
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
        result[inside] = interpolated(stamps[inside], columns.stamp_ns, values)
    return result, recorded


class TransmissionFriction(NamedTuple):
    """Friction of each motor and joint, by name.

    Attributes
    ----------
    signals : from which it is; None where the bag lacks them.
    motors, joints : of the motors only where their losses are known.
    unknown : why the losses of the motors are not known, as a sentence; '' where they are.
    """

    signals: TransmissionSignals | None
    motors: Mapping[str, Friction] = {}
    joints: Mapping[str, Friction] = {}
    unknown: str = ""


def transmission_friction(run: RecordedRun, parameters: PredictionParameters) -> TransmissionFriction:
    """What a recording shows of the friction of motors and joints."""
    arm, effects = parameters.arm, parameters.effects
    if arm is None:
        return TransmissionFriction(None, unknown=LACKING.format("no parameters of the arm"))
    if effects is not None:
        arm = replace(arm, motors=effects.smooth(arm))
    signals = transmission_signals(run, arm)
    if signals is None or len(signals.time) < SHAFT.fewest_signals:
        return TransmissionFriction(None, unknown=LACKING.format("no motor_states, or no torques of the joints"))
    joints = _friction_of_joints(signals)
    if hidden := _hidden(signals):
        return TransmissionFriction(signals, joints=joints, unknown=hidden)
    return TransmissionFriction(signals, _friction_of_motors(signals, parameters), joints)


def _hidden(signals: TransmissionSignals) -> str:
    """Why the motors' torque does not show their losses, '' if it does.

    Motors modelled as velocity sources have a huge inertia: friction would be the difference of two huge torques.
    """
    rotors, cables = (float(np.max(np.abs(torque))) for torque in (signals.rotors, signals.load))
    if rotors <= SHAFT.hidden * cables:
        return ""
    return (
        "Friction and efficiency of the motors were not measured: the rotors need up to "
        f"{shown(rotors, 'N m')} to accelerate, but the cables carry only {shown(cables, 'N m')}. So the motors "
        "of this recording are velocity sources, and their torque does not show the losses."
    )


def _friction_of_motors(signals: TransmissionSignals, parameters: PredictionParameters) -> dict[str, Friction]:
    """Of the motors; what only the size is known of may be part of what was measured, and adds to the errors.

    Their torque is that of the period that ends at its stamp, and so is their velocity here.
    """
    free, unrecorded = signals.torque - signals.load, _unrecorded(signals)
    velocity = signals.velocity.copy()
    velocity[1:] = 0.5 * (signals.velocity[1:] + signals.velocity[:-1])
    return {
        name: _possible(
            identify_friction(
                signals.time,
                velocity[:, i],
                free[:, i],
                SHAFT.motor_rest,
                SHAFT.window,
                signals.use,
                waves=np.hstack([_waves(signals, i, name, parameters), unrecorded[:, i]]),
            )
        )
        for i, name in enumerate(signals.arm.motors.names)
    }


def _waves(signals: TransmissionSignals, motor: int, shaft: str, parameters: PredictionParameters) -> Numbers:
    """Both quadratures of each configured ripple of a motor and its amplifier, (k, 2 w), N m, rms over the phases."""
    angle, torque, effects = signals.angle[:, motor], signals.torque[:, motor], parameters.effects
    waves: list[tuple[Numbers | float, float]] = [
        (fraction * torque, cycles) for fraction, cycles in parameters.commutation[motor : motor + 1]
    ]
    if effects is not None:
        ripples = effects.ripples
        every = zip(ripples.shafts, ripples.ratio, ripples.amplitude, ripples.cycles, strict=True)
        waves += [(ratio * amplitude, ratio * cycles) for name, ratio, amplitude, cycles in every if name == shaft]
    both = [size / math.sqrt(2.0) * wave(cycles * angle) for size, cycles in waves for wave in (np.sin, np.cos)]
    return np.column_stack(both) if both else np.empty((len(angle), 0))


def _unrecorded(signals: TransmissionSignals) -> Numbers:
    """What loads may differ by from the recorded ones, (k, n, 3), N m: within a period, between samples, in the joints.

    They are those of an instant within half a period of the middle of one. Between their samples, a motor's torque
    less that of its rotor shows what a straight line misses: cables swing in time with commands that are as far apart.
    The viscous friction of a joint counts as its motor's, but the cables let it move otherwise than its motor.
    """
    time, rows = signals.time, np.unique([0, *np.flatnonzero(signals.sampled)])
    passed = signals.torque - signals.rotors
    straight = interpolated(time, time[rows], passed[rows])
    late = 0.5 * median_step(time) * np.gradient(signals.load, time, axis=0)
    matrix = signals.arm.transmission.joint_from_motor
    apart = np.nan_to_num(signals.joint_velocity - signals.velocity @ matrix.T) * (signals.load_from != CABLE)
    return np.stack([late, passed - straight, apart * signals.arm.joints.viscous_friction @ matrix], axis=2)


def _friction_of_joints(signals: TransmissionSignals) -> dict[str, Friction]:
    """Of the joints: torque of the cables less that on the links, at the instants at which the former was recorded.

    Between these it is interpolated and lacks what the cables swing by, which is more than friction changes by.
    """
    rows = signals.sampled
    time, velocity, use = signals.time[rows], signals.joint_velocity[rows], signals.use[rows]
    free = signals.cable_torque[rows] - signals.strain[rows]
    if signals.load_from != CABLE or not np.any(np.isfinite(free)):
        return {}
    return {
        name: _possible(identify_friction(time, velocity[:, i], free[:, i], SHAFT.joint_rest, SHAFT.window, use))
        for i, name in enumerate(signals.arm.joints.names)
    }


def _possible(found: Friction) -> Friction:
    """The friction, without its numbers where one is surely below zero: then the torque holds more than friction."""
    if not (found.dynamic.is_negative or found.viscous.is_negative):
        return found
    return found._replace(static=UNKNOWN, dynamic=UNKNOWN, viscous=UNKNOWN, inertia=UNKNOWN)
