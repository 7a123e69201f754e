"""Friction and ripple of motors and joints, as far as a recording has their torques."""

import math
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from wam_analysis.findings.finding import shown
from wam_analysis.findings.transmission_signals import CABLE, GRAVITY, TransmissionSignals, transmission_signals
from wam_analysis.measures.friction import UNKNOWN, Friction, identify_friction
from wam_analysis.measures.ripple import Ripple, ripple_spectrum
from wam_analysis.recorded import PredictionParameters
from wam_analysis.thresholds import SHAFT
from wam_bag.arrays import Mask, Numbers
from wam_description.arm import Arm
from wam_sim.recording import RecordedRun


class TransmissionFindings(NamedTuple):
    """Friction of each joint and motor and ripple of each motor, by name.

    Attributes
    ----------
    arm : of the recording, its motors without cogging, which is a ripple; None if the bag has none.
    signals : None where friction, ripple and power cannot be evaluated.
    joints, friction, ripple : none of the motors where `drowned` states why.
    drowned : why the motors' torque shows nothing about losses, '' if it does.
    """

    arm: Arm | None
    signals: TransmissionSignals | None = None
    joints: Mapping[str, Friction] = MappingProxyType({})
    friction: Mapping[str, Friction] = MappingProxyType({})
    ripple: Mapping[str, Ripple] = MappingProxyType({})
    drowned: str = ""


def transmission_findings(run: RecordedRun, parameters: PredictionParameters) -> TransmissionFindings:
    """What a recording shows of motors, cables and joints."""
    arm, effects = parameters.arm, parameters.effects
    if arm is not None and effects is not None:
        arm = replace(arm, motors=effects.smooth(arm))
    signals = None if arm is None else transmission_signals(run, arm)
    if arm is None or signals is None or len(signals.time) < 100:
        return TransmissionFindings(arm)
    joints = _friction_of_joints(signals, arm)
    if drowned := _drowned(signals, arm):
        return TransmissionFindings(arm, signals, joints, drowned=drowned)
    friction = _friction_of_motors(signals, arm, parameters)
    return TransmissionFindings(arm, signals, joints, friction, _ripples(signals, arm, friction))


def _drowned(signals: TransmissionSignals, arm: Arm) -> str:
    """Why the motors' torque shows nothing about losses, '' if it does.

    Motors modelled as velocity sources have a huge inertia: friction would be the difference of two huge torques.
    """
    accelerates = np.abs(np.array(arm.motors.inertia) * np.gradient(signals.velocity, signals.time, axis=0))
    rotors, cables = float(np.max(accelerates)), float(np.max(np.abs(signals.load)))
    if rotors <= SHAFT.drowned * cables:
        return ""
    return (
        "Friction, ripple and efficiency of the motors were not measured: to accelerate the rotors takes up to "
        f"{shown(rotors, 'N m')}, the cables carry {shown(cables, 'N m')}. The motors of this recording are velocity "
        "sources, whose torque does not show what is lost."
    )


def _friction_of_motors(
    signals: TransmissionSignals, arm: Arm, parameters: PredictionParameters
) -> dict[str, Friction]:
    """Of the motors; what only the size is known of may be part of what was measured, and adds to the errors.

    Their torque is that of the period that ends at its stamp, and so is their velocity here.
    """
    free = signals.torque - signals.load
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
                waves=np.hstack([_waves(signals, i, name, parameters), _unrecorded(signals, i)]),
            )
        )
        for i, name in enumerate(arm.motors.names)
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


def _unrecorded(signals: TransmissionSignals, motor: int) -> Numbers:
    """What a motor's load may differ by from the recorded one, (k, 2), N m: within a period, and between its samples.

    It is that of an instant within half a period of the middle of one. A straight line is off a curve by a twelfth of
    the curvature times the squared interval, in the mean.
    """
    period = float(np.median(np.diff(signals.time)))
    interval = period / max(float(np.mean(signals.sampled)), period)
    rate = np.gradient(signals.load[:, motor], signals.time)
    return np.column_stack([0.5 * period * rate, interval**2 / 12.0 * np.gradient(rate, signals.time)])


def _friction_of_joints(signals: TransmissionSignals, arm: Arm) -> dict[str, Friction]:
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
        for i, name in enumerate(arm.joints.names)
    }


def _possible(found: Friction) -> Friction:
    """The friction, without its numbers where one is surely below zero: then the torque holds more than friction."""
    if not (found.dynamic.is_negative or found.viscous.is_negative):
        return found
    return found._replace(static=UNKNOWN, dynamic=UNKNOWN, viscous=UNKNOWN, inertia=UNKNOWN)


def _ripples(signals: TransmissionSignals, arm: Arm, friction: dict[str, Friction]) -> dict[str, Ripple]:
    """Ripple of each motor over its own angle, without friction and inertia; none where the load is only computed.

    The cables take most of a fast ripple, and what accelerates the links, as a push does, would be a slow one.
    """
    if signals.load_from == GRAVITY:
        return {}
    found = {}
    for i, name in enumerate(arm.motors.names):
        known = friction[name]
        velocity = signals.velocity[:, i]
        rows = turning(signals, i)
        if not math.isfinite(known.dynamic.value) or not np.any(rows):
            continue
        rest = signals.torque[:, i] - signals.load[:, i] - known.dynamic.value * np.sign(velocity)
        rest = rest - np.nan_to_num(known.viscous.value) * velocity
        rest = rest - arm.motors.inertia[i] * np.gradient(velocity, signals.time)
        rows &= np.abs(rest) < 10.0 * float(np.median(np.abs(rest[rows]))) + 1e-12
        found[name] = ripple_spectrum(signals.angle[rows, i], rest[rows], SHAFT.orders)
    return found


def turning(signals: TransmissionSignals, motor: int) -> Mask:
    """The samples in which a motor turns."""
    return (np.abs(signals.velocity[:, motor]) > SHAFT.motor_rest) & signals.use & signals.sampled
