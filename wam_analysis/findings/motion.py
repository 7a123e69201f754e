"""Sections about the transmission: stick and slip, friction, ripple."""

import cmath
import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.findings.analysed_run import AnalysedRun
from wam_analysis.findings.finding import Finding, Section, deviations, shown
from wam_analysis.findings.frequency import frequency_section
from wam_analysis.findings.power import power_section
from wam_analysis.findings.transmission_signals import CABLE, GRAVITY, TransmissionSignals, transmission_signals
from wam_analysis.measures.friction import Friction, identify_friction
from wam_analysis.measures.ripple import Ripple, ripple_spectrum
from wam_analysis.recorded import PredictionParameters
from wam_analysis.thresholds import SHAFT
from wam_description.arm import Arm

Numbers = NDArray[np.float64]

NOT_IDENTIFIABLE = "not identifiable"
ONE_WAY = "of one direction, with any offset"
MORE = "record motions that do not repeat each other, slow and fast, both ways, over a turn or more of the motors"


class MotionFindings(NamedTuple):
    """Sections about the transmission, and what their pictures need."""

    sections: tuple[Section, ...]
    signals: TransmissionSignals | None
    friction: dict[str, Friction]
    ripple: dict[str, Ripple]


def motion_sections(recording: AnalysedRun) -> MotionFindings:
    """All sections about motors and joints."""
    arm, effects = recording.parameters.arm, recording.parameters.effects
    if arm is not None and effects is not None:
        arm = replace(arm, motors=effects.smooth(arm))  # cogging is a ripple, below
    lacking = recording.lacking("motor_states", "joint_sensors", "sim/joint_states", "gravity_effort")
    signals = None if arm is None else transmission_signals(recording, arm)
    if arm is None or signals is None or len(signals.time) < 100:
        why = "no parameters of the arm" if arm is None else "no motor_states with a load"
        sentences = (f"Friction, ripple and power cannot be evaluated: {why} in this bag.",)
        return MotionFindings((Section("friction", "Friction", sentences, (), lacking),), None, {}, {})
    joints = _friction_of_joints(signals, arm)
    drowned = _drowned(signals, arm)
    if drowned:
        about = _friction_section(recording, arm, signals, {}, joints)
        about = about._replace(sentences=(drowned, *about.sentences))
        return MotionFindings((about, frequency_section(recording, arm)), None, {}, {})
    friction = _friction_of_motors(signals, arm, recording.parameters)
    ripple = _ripples(signals, arm, friction)
    sections = (
        _friction_section(recording, arm, signals, friction, joints),
        _ripple_section(signals, ripple, friction, recording.parameters),
        power_section(arm, signals, friction, joints),
        frequency_section(recording, arm),
    )
    return MotionFindings(sections, signals, friction, ripple)


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


# friction


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
    known = ((found.dynamic, found.dynamic_error), (found.viscous, found.viscous_error))
    if not any(value < -SHAFT.below_zero * error for value, error in known):
        return found
    nan = math.nan
    return found._replace(static=nan, dynamic=nan, viscous=nan, inertia=nan)


def _friction_section(
    recording: AnalysedRun,
    arm: Arm,
    signals: TransmissionSignals,
    friction: dict[str, Friction],
    joints: dict[str, Friction],
) -> Section:
    alone = signals.load_from == CABLE
    note = (
        f"load from the {signals.load_from}"
        if alone
        else f"with the joint's friction; load from the {signals.load_from}"
    )
    findings = []
    for i, (name, found) in enumerate(friction.items()):
        findings += _friction_findings(name, found, _of_motor(arm, i, alone), note)
    for i, (name, found) in enumerate(joints.items()):
        bearing = arm.joints
        configured = (bearing.static_friction[i], bearing.dynamic_friction[i], bearing.viscous_friction[i])
        findings += _friction_findings(name, found, configured, "cable torque less strain")
    seen = [name for name, found in {**friction, **joints}.items() if math.isfinite(found.dynamic)]
    sentences = [
        f"{name}: dry friction {_known(found.dynamic, found.dynamic_error, 'N m')}, {_breakaway(found)}, "
        f"viscous {_known(found.viscous, found.viscous_error, 'N m s/rad')}."
        for name, found in {**friction, **joints}.items()
        if name in seen
    ]
    unsure = [
        _named(name, kind)
        for name, found in {**friction, **joints}.items()
        for kind, _, value, error in _numbers(found)
        if not _is_identified(value, error)
    ]
    if unsure:
        sentences.append(f"Not determined by this recording: {', '.join(unsure)}; {MORE}.")
    still = [name for name in {**friction, **joints} if name not in seen]
    if still:
        sentences.append(f"Too little motion, or more than friction in the torque, for that of {', '.join(still)}.")
    lacking = recording.lacking("joint_sensors", "sim/joint_states")
    flagged = deviations(tuple(findings))
    return Section(
        "friction", "Friction", (*signals.caveats, *sentences, *flagged), tuple(findings), lacking, (), flagged
    )


def _breakaway(found: Friction) -> str:
    if not math.isfinite(found.static):
        return "no breakaway"
    return f"breakaway {_known(found.static, found.static_error, 'N m')}"


def _known(value: float, error: float, unit: str) -> str:
    """A value with its standard error, or that it is not identifiable."""
    if math.isnan(error):
        return shown(value, unit)
    if math.isinf(error):
        return NOT_IDENTIFIABLE
    if not _is_identified(value, error):
        return f"{NOT_IDENTIFIABLE} ({shown(value)} +- {shown(error, unit)})"
    return f"{shown(value)} +- {shown(error, unit)}"


def _is_identified(value: float, error: float) -> bool:
    return not error > SHAFT.unsure * abs(value)


def _of_motor(arm: Arm, i: int, alone: bool) -> tuple[float, float, float]:
    """Configured static, dynamic and viscous friction, with the joint's if it is part of the measured one."""
    motors, joints = arm.motors, arm.joints
    own = [motors.static_friction[i], motors.dynamic_friction[i], motors.viscous_friction[i]]
    column = np.reshape(arm.joint_from_motor, (len(joints.names), len(motors.names)))[:, i]
    if not alone and int(np.count_nonzero(column)) == 1:
        own[0] += float(np.abs(column) @ np.array(joints.static_friction))
        own[1] += float(np.abs(column) @ np.array(joints.dynamic_friction))
        own[2] += float(column**2 @ np.array(joints.viscous_friction))
    elif not alone:
        own = [math.nan] * 3
    return own[0], own[1], own[2]


def _numbers(found: Friction) -> tuple[tuple[str, str, float, float], ...]:
    """Kind, unit, value and standard error of each friction of a shaft."""
    return (
        ("static", "N m", found.static, found.static_error),
        ("dynamic", "N m", found.dynamic, found.dynamic_error),
        ("viscous", "N m s/rad", found.viscous, found.viscous_error),
    )


def _named(shaft: str, kind: str) -> str:
    return f"{shaft}: {kind} friction"


def _friction_findings(name: str, found: Friction, configured: tuple[float, float, float], note: str) -> list[Finding]:
    """Of one shaft."""
    about = {"static": f"{found.breakaways} breakaways"}
    if math.isnan(found.offset) and math.isfinite(found.dynamic):
        about["dynamic"] = ONE_WAY
    findings = []
    for (kind, unit, value, error), predicted in zip(_numbers(found), configured, strict=True):
        identified = _is_identified(value, error)
        deviation = f"+-{shown(error)}" if math.isfinite(error) else ""
        if not identified:
            deviation = f"{NOT_IDENTIFIABLE}: {shown(value)} {deviation}" if deviation else NOT_IDENTIFIABLE
        text = "; ".join(filter(None, (about.get(kind), deviation, note)))
        stated = (value, error) if identified else (math.nan, math.nan)
        findings.append(Finding(_named(name, kind), unit, stated[0], predicted, text, stated[1]))
    return findings


# ripple


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
        rows = _turning(signals, i)
        if not math.isfinite(known.dynamic) or not np.any(rows):
            continue
        rest = signals.torque[:, i] - signals.load[:, i] - known.dynamic * np.sign(velocity)
        rest = rest - np.nan_to_num(known.viscous) * velocity
        rest = rest - arm.motors.inertia[i] * np.gradient(velocity, signals.time)
        rows &= np.abs(rest) < 10.0 * float(np.median(np.abs(rest[rows]))) + 1e-12
        found[name] = ripple_spectrum(signals.angle[rows, i], rest[rows], SHAFT.orders)
    return found


def _turning(signals: TransmissionSignals, motor: int) -> NDArray[np.bool_]:
    """The samples in which a motor turns."""
    return (np.abs(signals.velocity[:, motor]) > SHAFT.motor_rest) & signals.use & signals.sampled


def _ripple_section(
    signals: TransmissionSignals,
    ripple: dict[str, Ripple],
    friction: dict[str, Friction],
    parameters: PredictionParameters,
) -> Section:
    sentences, findings = [], []
    for name, found in ripple.items():
        if not len(found.order):
            why = "too few" if found.turns < SHAFT.enough_turns else "with too large gaps"
            sentences.append(f"{name} made {found.turns:.2f} turns, {why} to identify its ripple.")
            continue
        top = int(np.argmax(found.amplitude))
        order, amplitude = int(found.order[top]), float(found.amplitude[top])
        configured = _configured_ripple(parameters, signals, name, order)
        findings.append(
            Finding(
                f"{name}: largest ripple",
                "N m",
                amplitude,
                configured,
                f"{order} cycles per turn, {found.turns:.1f} turns",
            )
        )
        clear = (
            amplitude > SHAFT.faint_ripple * float(np.median(found.amplitude))
            and amplitude > SHAFT.slight_ripple * friction[name].dynamic
        )
        sentences.append(
            f"{name}: {shown(amplitude, 'N m')} at {order} cycles per turn."
            if clear
            else f"{name}: no significant ripple; the largest order has {shown(amplitude, 'N m')}."
        )
    if signals.load_from == GRAVITY:
        sentences.append("Ripple was not measured: of the motors' load only that of gravity is known in this bag.")
    elif not ripple:
        sentences.append("No motor turned enough to identify its ripple.")
    return Section("ripple", "Torque ripple by pulley angle", tuple(sentences), tuple(findings))


def _configured_ripple(parameters: PredictionParameters, signals: TransmissionSignals, shaft: str, order: int) -> float:
    """Amplitude of this order on a motor, N m: ripple of its shaft, and of its amplifier at the mean torque."""
    if parameters.arm is None or parameters.effects is None:
        return math.nan
    ripples, motor = parameters.effects.ripples, parameters.arm.motors.names.index(shaft)
    torque = float(np.mean(signals.torque[_turning(signals, motor), motor]))
    rows = zip(ripples.shafts, ripples.ratio, ripples.amplitude, ripples.cycles, ripples.phase, strict=True)
    waves = [
        ratio * amplitude * cmath.exp(1j * phase)
        for name, ratio, amplitude, cycles, phase in rows
        if name == shaft and round(cycles * ratio) == order
    ]
    waves += [fraction * torque for fraction, cycles in parameters.commutation[motor : motor + 1] if cycles == order]
    return abs(sum(waves))
