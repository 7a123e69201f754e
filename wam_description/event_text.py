"""Sentences of events: the one place that knows them; consoles, reports and status messages ask for them."""

import math
import string
from collections.abc import Iterable, Mapping
from typing import Any, Final

from wam_description.event import Code, Event
from wam_description.number_text import brief
from wam_description.reasons import Reason

REASONS: Final = {
    Reason.MOMENT_ONLY: "only the moment is measured on this link: the contact position is unknown, the force is a "
    "lower bound",
    Reason.BENT: "elbow at 90 deg and force in plane: contact position and force cannot be separated",
    Reason.STRAIGHT: "elbow straight and force out of plane: contact position and force cannot be separated",
    Reason.SHOULDER: "the axes of the shoulder leave one of its moments unmeasured in this pose",
    Reason.WEAK: "the torques are too small, compared with their uncertainty, to identify the contact position",
    Reason.ELBOW: "torque of the elbow near 0: a contact there and one on the inner link cannot be distinguished",
    Reason.STRAIGHT_LINK: "elbow straight and force out of plane: the links cannot be distinguished",
    Reason.LINKS: "the torques do not identify the link",
    Reason.MORE: "one contact does not explain the torques",
    Reason.ALONG: "the force may act along the link: then its torques are the same at every position, and on the link "
    "before",
    Reason.PAYLOAD: "a payload that was picked up may explain the torques; its probability is what those of the links "
    "lack to 1",
    Reason.TOO_EARLY: "too few samples yet",
    Reason.BRAKED: "brakes hold the motors",
}

PINNED: Final = "pin the force where it acts (the torque of a command across a link, or contact_source)"
RAISE: Final = "{axis}: {speed:.3g} {unit}/s are commanded; allowed: {allowed:g} {unit}/s; the arm goes on and is late"
PARTS: Final = {  # of the predicted error of a force, and what makes each smaller
    "torques": ("the measured torques", "use joint sensors, tare in free space, or command more force"),
    "friction": ("friction of the surface", "lower sensing.friction if the surface has less, or bend the arm"),
    "place": ("the contact position", PINNED),
    "resting": ("what the arm carries", "declare it (arm.payload), or end the command and tare in free space"),
    "moving_surface": ("a surface that moves", "let it move more slowly, or raise force_gain"),
    "slow_arm": ("an arm that gets there too slowly", "declare guard.contact_stiffness, or raise limits.settling_time"),
    "shaking_arm": ("the arm's own shaking", "use joint sensors, or declare guard.contact_stiffness"),
}
UNCERTAIN: Final = (
    "{desired:.3g} {unit} at {where} may be off by {error:b} {unit}, most of it by {part_text}; allowed: {allowed:b} "
    "{unit} (limits.tolerance)"
)
SENTENCES: Final = {  # by cause
    # the arm holds
    "error": UNCERTAIN + ": {help}",
    "moved_fast": "the arm moved faster than {speed:g} rad/s as the force began, and it is not known what it carries: "
    "it comes to rest first",
    "task": "{reason}",
    "other_link": "{touched} is touched, and the force is commanded on {cover}: command it on {touched}, or free the "
    "arm; it goes back to where it was free until the command ends",
    "free_travel": "the arm has moved {way:.3g} m along the force {since}; allowed: {allowed:g} m "
    "(limits.free_travel): command no force, then again",
    # the arm goes on
    "uncertain": UNCERTAIN + ": {part_help}",
    "force_off": "{axis}: {measured:.3g} {unit} are measured and {desired:.3g} {unit} commanded, for {time:b} s: "
    "command what can be reached, another direction, or bend the arm",
    "force_strays": "{axis}: the force was reached, and is off by more than {allowed:b} {unit} again: {measured:.3g} "
    "{unit} of {desired:.3g} {unit}; the surface moves, something else pushes, or friction turns",
    "motion_off": "{axis}: {desired:.4g} {unit} is commanded, and it is at {measured:.4g} {unit}; allowed: "
    "{allowed:.2g} {unit}, for {time:b} s: something is in the way, a joint is at its end, or the arm has no lever "
    "for it here",
    "speed": RAISE,
    "torques_differ": "the torques are not those of a force at {position:.3g} m of {cover} (chi^2 {chi2:.3g}, allowed: "
    "{allowed:g}): it acts elsewhere, or is not the only one; pin it where it acts, or free the arm",
    "torques_changed": "the torques are no longer those with which the force has settled (chi^2 {chi2:.3g}, allowed: "
    "{allowed:g}): something else acts on the arm, or the friction of the surface has turned; command the force again",
    "pushed": "the world pushes with at least {force:b} N; allowed: {allowed:b} N (limits.contact_force, whole_force): "
    "the arm gives way, by limits.free_travel at most",
    "joint_end": "{joint} is at {angle:.4g} rad, {margin:g} rad from its end, {end:.4g} rad, and does not move on: "
    "command another posture or direction",
    "oscillating": "the measured force oscillates by {swing:b} N in {period:b} s about {desired:.3g} N; allowed: "
    "{allowed:g} of the commanded (limits.cycle_force): lower force_gain, or use joint sensors",
    "model_off": "the model is off: {part}; see /diagnostics, run 'wam identify'",
    # the driver has put the brakes on
    "emergency_stop": "emergency stop",
    "command_stale": "command stale: {age_ms:.0f} ms old, allowed {allowed_ms:.0f} ms; {cure}",
    "driver_late": "the driver itself did not run for {time:.2f} s, allowed {allowed_ms:.0f} ms; {cure}",
    "held_up": "the driver itself did not run for {time:.2f} s, allowed {allowed_ms:.0f} ms; {step}: let its steps "
    "compute less, or run it in a process of its own",
    "unanswered": "lockstep: no {topics} for the state of {stamp} ns within {allowed:.1f} s; {cure}, then reset_fault",
    "simulation": "the simulation of the arm failed: {trouble}; the arm is where it was before; {cure}, or lower "
    "timing.period",
    "limit": "{excess}; {cure}",
    "broken": "{excess} under the brakes; check the cable",
    "node": "{node}: {fault}{late}",
    # a node reports it, and the driver brakes
    "claimed": "{nodes} publish {topic}, which one node alone may; stop all others, then reset_fault",
    "stopped": "{nodes} has stopped: {topics} too old; start {nodes} again, then reset_fault",
    "long_step": "{step}: {topics} too old; let its steps compute less, then reset_fault",
    "ended": "{node} has ended; start it again, then reset_fault",
}
HOLDING: Final = "; the arm holds its position"
SINCE: Final = ("and nothing was touched", "since the force last was right, or rose")


class _Sentence(string.Formatter):
    """Format as str.format does; `b` writes a number briefly."""

    def format_field(self, value: Any, format_spec: str) -> str:
        return brief(value) if format_spec == "b" else str(super().format_field(value, format_spec))


def _fill(text: str, values: Mapping[str, Any]) -> str:
    return _Sentence().vformat(text, (), values)


def sentence(event: Event) -> str:
    """What an event is in words, '' where nothing has happened."""
    cause = str(event.cause)
    if cause not in SENTENCES:
        return str(event.values.get("reason", cause or ("" if event.code is Code.NONE else event.code.value)))
    values = {**event.values, **_parts(event.values)}
    end = HOLDING if event.holds and "hold" not in SENTENCES[cause] and "goes back" not in SENTENCES[cause] else ""
    return _fill(SENTENCES[cause], values) + end


def reasons_in_words(reasons: Reason) -> str:
    """Why an estimate of a contact is not to be trusted, in words; '' where it is."""
    return "; ".join(text for reason, text in REASONS.items() if reason in reasons)


def sentences(events: Iterable[Event]) -> str:
    """Several events in words, each once."""
    return "; ".join(filter(None, dict.fromkeys(map(sentence, events))))


def _parts(values: Mapping[str, Any]) -> dict[str, str]:
    """What the placeholders of a sentence stand for that are no values."""
    found = {"since": SINCE[values.get("has_touched", 0.0) > 0.0]}
    if values.get("part") in PARTS:
        part, helps = PARTS[values["part"]]
        is_joint = math.isnan(values["position"])
        where = values["cover"] if is_joint else f"{values['position']:.3g} m of {values['cover']}"
        found |= {"part_text": part, "part_help": helps, "where": where, "help": _help(values, helps)}
    return found


def _help(values: Mapping[str, Any], helps: str) -> str:
    """What to do in place of a refused force: what was found, and what helps against its largest part."""
    found = []
    if "turn" in values:
        found.append(f"turn {values['turn']} from {values['turn_from']:.2f} to {values['turn_to']:.1f} rad")
    if "more_force" in values:
        found.append(f"command {values['more_force']:g} N")
    if "pin" in values and helps is not PINNED:
        found.append(PINNED)
    if "searched" in values and not found:
        return f"no other force up to 5 times and no turn of one joint was found that helps; {helps}"
    return ", or ".join([*found, helps])
