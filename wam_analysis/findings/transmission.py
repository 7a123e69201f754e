"""Friction of motors and joints, as far as a recording shows it."""

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
from wam_sim.recorded_run import RecordedRun

LACKING = "Friction and efficiency cannot be evaluated: {} in this bag."


class TransmissionFriction(NamedTuple):
    """Friction of each motor and joint, by name.

    Attributes
    ----------
    signals : from which it is; None where the bag lacks them.
    motors, joints : of the motors only where their losses are known.
    unknown : why the losses of the motors are not known, as a sentence; '' where they are.
    """

    signals: TransmissionSignals | None
    motors: Mapping[str, Friction] = MappingProxyType({})
    joints: Mapping[str, Friction] = MappingProxyType({})
    unknown: str = ""

    @property
    def with_losses(self) -> TransmissionSignals | None:
        """The signals where they show the losses of the motors."""
        return None if self.unknown else self.signals


def transmission_friction(run: RecordedRun, parameters: PredictionParameters) -> TransmissionFriction:
    """What a recording shows of the friction of motors and joints."""
    arm, effects = parameters.arm, parameters.effects
    if arm is None:
        return TransmissionFriction(None, unknown=LACKING.format("no parameters of the arm"))
    if effects is not None:
        arm = replace(arm, motors=effects.smooth(arm))
    signals = transmission_signals(run, arm)
    if signals is None or len(signals.time) < SHAFT.fewest_signals:
        return TransmissionFriction(None, unknown=LACKING.format("no motor_states with a load"))
    joints = _friction_of_joints(signals)
    if hidden := _hidden(signals):
        return TransmissionFriction(signals, joints=joints, unknown=hidden)
    return TransmissionFriction(signals, _friction_of_motors(signals, parameters), joints)


def _hidden(signals: TransmissionSignals) -> str:
    """Why the motors' torque does not show their losses, '' if it does.

    Motors modelled as velocity sources have a huge inertia: friction would be the difference of two huge torques.
    """
    accelerates = np.abs(np.array(signals.arm.motors.inertia) * np.gradient(signals.velocity, signals.time, axis=0))
    rotors, cables = float(np.max(accelerates)), float(np.max(np.abs(signals.load)))
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


def _unrecorded(signals: TransmissionSignals, motor: int) -> Numbers:
    """What a motor's load may differ by from the recorded one, (k, 2), N m: within a period, and between its samples.

    It is that of an instant within half a period of the middle of one. A straight line is off a curve by a twelfth of
    the curvature times the squared interval, in the mean.
    """
    period = float(np.median(np.diff(signals.time)))
    interval = period / max(float(np.mean(signals.sampled)), period)
    rate = np.gradient(signals.load[:, motor], signals.time)
    return np.column_stack([0.5 * period * rate, interval**2 / 12.0 * np.gradient(rate, signals.time)])


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
