"""Friction of motors and joints, as far as a recording has their torques."""

import math
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from wam_analysis.findings.finding import shown
from wam_analysis.findings.transmission_signals import CABLE, TransmissionSignals, transmission_signals
from wam_analysis.measures.friction import UNKNOWN, Friction, identify_friction
from wam_analysis.recorded import PredictionParameters
from wam_analysis.thresholds import SHAFT
from wam_bag.arrays import Numbers
from wam_description.arm import Arm
from wam_sim.recorded_run import RecordedRun


class TransmissionFindings(NamedTuple):
    """Friction of each joint and motor, by name.

    Attributes
    ----------
    arm : of the recording, its motors without cogging; None if the bag has none.
    signals : None where friction and power cannot be evaluated.
    joints, friction : none of the motors where `drowned` states why.
    drowned : why the motors' torque shows nothing about losses, '' if it does.
    """

    arm: Arm | None
    signals: TransmissionSignals | None = None
    joints: Mapping[str, Friction] = MappingProxyType({})
    friction: Mapping[str, Friction] = MappingProxyType({})
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
    return TransmissionFindings(arm, signals, joints, _friction_of_motors(signals, arm, parameters))


def _drowned(signals: TransmissionSignals, arm: Arm) -> str:
    """Why the motors' torque shows nothing about losses, '' if it does.

    Motors modelled as velocity sources have a huge inertia: friction would be the difference of two huge torques.
    """
    accelerates = np.abs(np.array(arm.motors.inertia) * np.gradient(signals.velocity, signals.time, axis=0))
    rotors, cables = float(np.max(accelerates)), float(np.max(np.abs(signals.load)))
    if rotors <= SHAFT.drowned * cables:
        return ""
    return (
        "Friction and efficiency of the motors were not measured: the rotors need up to "
        f"{shown(rotors, 'N m')} to accelerate, but the cables carry only {shown(cables, 'N m')}. So the motors "
        "of this recording are velocity sources, and their torque does not show the losses."
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
