"""The friction node and the force loop of chapter 5, as far as a recording shows them."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from wam_analysis.findings.analysis import Analysis, analyse
from wam_analysis.findings.effort import friction
from wam_analysis.findings.finding import shown
from wam_analysis.findings.guarded import sentence
from wam_analysis.findings.held_force import Theory, theory_of
from wam_analysis.findings.motion import identified
from wam_analysis.foreign.sources import Source
from wam_analysis.foreign.topic_map import TopicMap
from wam_analysis.recording import AnalysedRecording
from wam_description.arm import Arm


class LoopNumber(NamedTuple):
    """A number and where it is from."""

    value: float
    origin: str


class RecordedLoop(NamedTuple):
    """Numbers by the names of the options of `wam guard`; what the stack's own guard reports of the loop, or ''."""

    numbers: dict[str, LoopNumber]
    guard: str


def recorded_loop(path: Path, given: TopicMap) -> RecordedLoop:
    """What a recording shows of a force loop.

    Of another robot it is inertia, damping, friction and rate of a joint, in N m and rad: the one that is given, else
    the only one that is identifiable.  Of this stack it is all of the loop at its largest held force, along the force,
    in N and m: the identified friction of the joints, everything else by the parameters in the bag.

    Parameters
    ----------
    path : bag.
    given : topics, joints, fields and units of another robot's bag.

    Raises
    ------
    ValueError
        if nothing can be identified, or there is a choice; the message names which.
    """
    analysis = analyse(path, lambda doing: None, given)
    if not analysis.recording.is_foreign:
        return _at_the_contact(path, analysis)
    found = {one.label: (one, friction(one)) for one in analysis.recording.states if one.is_joint}
    seen = {label: (one, fit) for label, (one, fit) in found.items() if fit is not None}
    if not seen:
        raise ValueError(
            f"{path} shows friction and inertia of none of its joints: {', '.join(found) or 'it has none'}"
        )
    if len(seen) > 1:
        raise ValueError(f"{path} shows friction of {', '.join(seen)}; choose one with --joint")
    ((label, (joint, found_friction)),) = seen.items()
    fit = found_friction.friction
    values = {"rate": _rate(joint)}
    for name, kind in (("friction", "dynamic"), ("damping", "viscous"), ("inertia", "inertia")):
        known = getattr(fit, kind)
        if known.is_sure:
            values[name] = _identified(label, *known)
    if "friction" in values and fit.breakaways > 2:
        values["stiction"] = _identified(label, max(fit.static.value, fit.dynamic.value), fit.static.error)
    return RecordedLoop(values, "")


def _identified(label: str, value: float, error: float) -> LoopNumber:
    return LoopNumber(value, f"identified, {label}, +- {shown(error)}")


def _rate(joint: Source) -> LoopNumber:
    return LoopNumber(1.0 / float(np.median(np.diff(joint.time))), f"of the stamps of {joint.topic}")


def _at_the_contact(path: Path, analysis: Analysis) -> RecordedLoop:
    """The node and the loop at the largest force that was held at a known pose against a known surface."""
    parameters = analysis.recording.parameters
    arm, loop, timing = parameters.arm, parameters.force_loop, parameters.timing
    if arm is None or loop is None or timing is None:
        raise ValueError(f"{path} has no parameters of the arm: {parameters.note}")
    better, names = _with_identified(arm, analysis.recording)
    theory, largest = Theory(), None
    for largest in sorted(analysis.recording.held, key=lambda one: -one.hold.commanded):
        theory = theory_of(analysis.recording.run, parameters, largest, better)
        if theory.node is not None and np.isfinite(theory.node.contact_stiffness):
            break
    else:
        theory = Theory()
    node = theory.node
    if node is None or largest is None:
        raise ValueError(
            f"{path} has no force that was held on a link at a known pose, on a surface of known stiffness"
        )
    recorded = f"parameters in the bag, {largest.hold.name}"
    origin = f"identified friction of {', '.join(names)}; else {recorded}" if names else recorded
    axis = int(np.argmax(np.abs(largest.hold.force)))

    def along(values: Any) -> float:
        return float(np.broadcast_to(values, 3)[axis])

    numbers = {
        "inertia": LoopNumber(node.inertia, recorded),
        "damping": LoopNumber(node.damping, origin),
        "transmission": LoopNumber(node.transmission_stiffness, recorded),
        "contact": LoopNumber(node.contact_stiffness, recorded),
        "friction": LoopNumber(node.dynamic_friction, origin),
        "stiction": LoopNumber(max(node.static_friction, node.dynamic_friction), origin),
        "gain": LoopNumber(along(loop.force_gain), recorded),
        "limit": LoopNumber(along(loop.force_error_limit), recorded),
        "deadband": LoopNumber(along(loop.force_deadband), recorded),
        "rate": LoopNumber(1e9 / timing.outer_period_ns, recorded),
        "delay": LoopNumber(timing.outer_delay * timing.period, recorded),
    }
    return RecordedLoop(numbers, sentence(theory.guarded) if theory.guarded is not None else "")


def _with_identified(arm: Arm, recording: AnalysedRecording) -> tuple[Arm, list[str]]:
    """The arm with the friction of its joints that the recording shows, and their names."""
    joints, names = arm.joints, []
    for kind in ("static", "dynamic", "viscous"):
        found = {name: identified(one, kind) for name, one in recording.motion.joints.items()}
        names += [name for name, value in found.items() if math.isfinite(value)]
        old = zip(joints.names, getattr(joints, f"{kind}_friction"), strict=True)
        values = [value if math.isnan(found.get(name, math.nan)) else found[name] for name, value in old]
        changed: dict[str, Any] = {f"{kind}_friction": tuple(values)}
        joints = replace(joints, **changed)
    return replace(arm, joints=joints), list(dict.fromkeys(names))
