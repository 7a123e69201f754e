"""Sentences of events: the one place that knows them; consoles, reports and status messages ask for them."""

import string
from collections.abc import Iterable, Mapping
from typing import Any, Final

from wam_description.event import CAUSE, Code, Event
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

HOLDS: Final = "the arm holds its position"
SENSORS: Final = "use joint sensors"
SOFTER: Final = "where no surface is as stiff, lower guard.contact_stiffness"
UNLOAD: Final = f"{HOLDS}: declare what it carries (arm.payload), or end the command and tare in free space"
SLOWER_SURFACE: Final = "let the surface move more slowly"

REFUSED_FORCES: Final = {  # by cause
    "stated_sd": "the force is known to +-{sd:.3g} N from the motors at {position:.3g} m of {cover}; to start, it "
    "must be known to {allowed:.3g} N, {fraction:.0%} of the commanded force (sensing.stated_fraction)",
    "sd": "the force is measured with a standard deviation of {sd:.3g} N at {position:.3g} m of {cover}; to start, it "
    "must be below {allowed:.3g} N, {fraction:.0%} of the limit (sensing.force_sd_limit, force_sd_fraction)",
    "weak": "the torques of {desired:.3g} N at {position:.3g} m of {cover} are {signal:b} times the standard "
    "deviation with which the motors show them; allowed: sensing.{limit}, {allowed:g}, and above, or the force is "
    "detected late or on the wrong link",
    "weak_elsewhere": "the torques of {desired:.3g} N on another link than {cover} are {signal:b} times the standard "
    "deviation with which the motors show them; allowed: sensing.least_signal, {allowed:g}, and above, or that link "
    "is pressed harder than commanded before it is detected",
    "shaken": "the arm shakes by {shaking:b} m along the force (dither): on {stiffness:g} N/m the force would swing "
    "by {force:.3g} N; allowed: limits.shake_force, {allowed:g} times the commanded {desired:.3g} N",
    "settles_slowly": "the force would settle with a time constant of {time_constant:b} s{slowed}; allowed: "
    "1/{allowed:g} of limits.settling_time",
    "stiff": "the whole force is {way_mm:b} mm on a surface of {stiffness:g} N/m (guard.contact_stiffness); from the "
    "motors at an estimated position {allowed_mm:g} mm is the least, as the velocity loops wind up through friction "
    "for longer than limits.settling_time",
    "creeps": "a surface of {stiffness:g} N/m (guard.contact_stiffness) may be approached with {speed_mm:b} mm/s for "
    "{desired:.3g} N (limits.impact), less than {allowed_mm:g} mm within limits.settling_time, in which friction "
    "moves the arm in jerks",
    "surface_lag": "a surface that moves with {speed:g} m/s (limits.surface_speed) would keep the force {off:b} N "
    "off; allowed: {allowed:b} N (sensing.reported_fraction)",
    "surface_fast": "a surface that moves with {speed:g} m/s (limits.surface_speed) goes faster than the arm follows "
    "for {desired:.3g} N on {stiffness:g} N/m (guard.contact_stiffness), {allowed:b} m/s",
    "surface_slope": "a surface that moves across the force with {speed:g} m/s (limits.slide_speed) comes nearer by "
    "{nearer_um:b} um while the friction of the arm turns round, which is {off:b} N on {stiffness:g} N/m "
    "(guard.contact_stiffness); allowed: {allowed:b} N",
}
BESIDES: Final = {  # what helps besides what is computed, by cause
    "stated_sd": f"{SENSORS}, or allow more where less accuracy will do",
    "weak": SENSORS,
    "weak_elsewhere": SENSORS,
    "shaken": f"{SENSORS}, or, {SOFTER}",
    "stiff": SENSORS,
    "creeps": SOFTER,
    "surface_lag": f"set a larger force_gain, or {SLOWER_SURFACE}",
    "surface_fast": SLOWER_SURFACE,
    "surface_slope": SLOWER_SURFACE,
}
SENTENCES: Final = {  # by cause
    **{cause: f"{text}; {HOLDS}{{advice}}" for cause, text in REFUSED_FORCES.items()},
    # the arm holds
    "moved_fast": "the arm moved faster than {speed:g} rad/s as the force began, and it is not known what it carries: "
    "it comes to rest first",
    "loaded": "the arm at rest already measures {force:.3g} N along the force of {desired:.3g} N, {carried}; allowed: "
    f"{{allowed:g}} of the commanded; {UNLOAD}",
    "loaded_torque": "{axis}: the arm at rest already measures {torque:b} N m, {carried}; allowed: {allowed:b} N m "
    f"for {{desired:b}} N m; {UNLOAD}",
    "other_link": "{touched} is touched, and the force is commanded on {cover}; command it on {touched}, with its "
    "position, or free the arm; the arm goes back to where it was free until the command ends",
    "link_in_doubt": "something is touched, and it is not known whether on {cover}; the arm goes back to where it was "
    "free until the command ends",
    "second_contact": "a second contact is nearly certain besides that on {cover}: the torques are not those of the "
    f"commanded force alone; {HOLDS} until the second contact has gone",
    "free_travel": "the arm has moved {way:.3g} m along the force {since}; allowed: limits.free_travel, {allowed:g} "
    f"m; {HOLDS}: command no force, then again",
    "creeping": "nothing was touched {time:b} s after the command: the arm creeps, and has moved {way_mm:b} mm; it "
    f"holds its position: go nearer, or pin the position, or, {SOFTER}; command no force, then again",
    "gave_way": "the arm has gone back by {way:.3g} m against the force of {desired:.3g} N, as what presses it with "
    "{measured:.3g} N moves on: it is not at rest, or is no surface; allowed: limits.free_travel, {allowed:g} m; "
    f"{HOLDS}: free it, or, for a surface that moves, declare limits.surface_speed; command no force, then again",
    "task": f"{{reason}}; {HOLDS}",
    # the arm goes on
    "nothing_touched_yet": "nothing is touched yet, {time:b} s after the command: the arm has moved {way_mm:b} mm "
    f"towards it; go nearer, or pin the position, or, {SOFTER}",
    "force_off": "{measured:.3g} N are measured and {desired:.3g} N commanded; the force has been too {side} for "
    "{time:b} s{slowed}: command what can be reached, another direction, or bend the arm",
    "force_strays": "the force was reached, and leaves {desired:.3g} N again and again by more than {allowed:b} N: "
    "the surface moves, something else pushes, friction turns, the position is unknown, or it is a limit cycle; free "
    "the arm of what else touches it, pin the position, or, for a cycle, lower force_gain",
    "torque_off": "{axis}: {measured:b} N m are measured and {desired:b} N m commanded; the torque has been off by "
    "more than {allowed:b} N m{swings} for {time:b} s: command what something that is touched can take, or another "
    "posture, or, where it swings, lower torque_gain",
    "rising": "{rising_sentence}",
    "posture_missed": "{joint} is {way:.3g} rad away from the commanded posture; allowed: {allowed:.3g} rad, "
    "{allowed_at_rest:g} rad at rest; raise force_loop:posture_gain, {gain:g} 1/s, if it is too low for this motion, "
    "or give the motion more time; or something is in the way: free the arm",
    "posture_late": "the commanded {axis} moves faster than the arm follows, {joint} with {speed:.3g} {unit}; "
    "allowed: {limit}, {allowed:g} {unit}; the arm goes on and is late: {late_advice}",
    "velocity_off": "{axis}: {commanded:.4g} {unit}/s are commanded, and it moves with {measured:b} {unit}/s; {behind}",
    "position_off": "{axis}: {commanded:.4g} {unit} is commanded, and it is at {measured:.4g} {unit}; {behind}",
    "contact_force": "the world pushes with {pushes}; allowed: {force_limit}; from {begin:g} of that on the arm is "
    "slow against it, above it gives way by limits.free_travel at most, unless that overpowers its motors: command a "
    "direction or a posture away from it, or less force",
    "joint_end": "{joint} is at {angle:.4g} rad, its end is {end:.4g} rad and limits.joint_margin {margin:g} rad: it "
    "does not move on; command another posture or direction",
    "torques_differ": "the torques are not those of a force along the commanded direction at {position:.3g} m of "
    "{cover} (off by {off_sd:.3g} standard deviations; allowed: {allowed_sd:.2g}): it acts elsewhere or on another "
    "link, or is not the only one; pin it where it acts, or free the arm",
    "torques_changed": "the torques are no longer those with which the force of {desired:.3g} N has settled (off by "
    "{off_sd:.3g} standard deviations; allowed: {allowed_sd:.2g}): something else acts on the arm, and the measured "
    "force is that of both together, or the friction of the surface has turned; free the arm, or command the force "
    "again",
    "position_from_torques": "something is touched and where it is known from the torques alone, so that the force is "
    "known to {sd:b} N; {position:.3g} m of {cover} is assumed, and the force is as wrong as that; pin it by the "
    "torque of a command across a link, or set contact_source to pinned (contact_position)",
    "position_unknown": "something is touched and it is not known where; {position:.3g} m of {cover} is assumed, and "
    "the force is as wrong as that; pin it by the torque of a command across a link, or set contact_source to pinned "
    "(contact_position)",
    "force_uncertain": "the force is known to +-{sd:b} N, {fraction:.0%} of the commanded {desired:.3g} N; "
    "sensing.reported_fraction, {allowed:.0%}, is to be known, less where it is measured off: tare in free space, "
    "command more force, or another direction or pose",
    "torque_uncertain": "{axis}: the torque is known to +-{sd:b} N m, {fraction:.0%} of the commanded {desired:b} N m; "
    f"sensing.reported_fraction, {{allowed:.0%}}, is to be known: {SENSORS}, or command more torque",
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
    "cycle": "the measured force is in a limit cycle of {swing:b} N peak to peak and {period:b} s about {desired:.3g} "
    "N; allowed: limits.cycle_force, {allowed:g} of the commanded; friction or the surface keeps it up: lower "
    f"force_gain, or {SENSORS}",
}
CARRIED: Final = ("not the force of a surface that is touched there", "as with {payload:b} kg at the tool")
SINCE: Final = ("and nothing was touched", "since the force last was right, or rose")
SIDES: Final = ("large", "small")
SWINGS: Final = ("", ", to both sides")
LATE: Final = (
    "a command lasts ages.command: stream it at shorter intervals than that",
    "give the motion more time, or raise force_loop:{limit}",
)
PUSHES: Final = {
    "at_least": "at least {force:b} N in all",
    "at_commanded": "{force:b} N in all, if it acts where the commanded force does",
    "at_estimated": "at least {force:b} N in all, if the estimated contact is on the right link",
    "at_middle": "at least {force:b} N in all, if it acts in the middle of {cover}",
}
FORCE_LIMITS: Final = {
    "contact_force": "limits.contact_force, {allowed:g} N",
    "whole_force": "limits.whole_force, {allowed:g} times the commanded {desired:.3g} N",
}
BEHIND: Final = "it has been off by more than {allowed:b} {unit} for {time:b} s; {why}"
WHY: Final = {
    "in_the_way": "something is in the way, a joint is at its end, or the arm has no lever for it here: command what "
    "is free and within reach, or another posture",
    "too_fast": "a joint would be faster than force_loop:joint_speed_limit: command less speed, or raise it",
    "posture_taken": "the task leaves the posture too little: command a posture that its axes leave, or end one of "
    "them",
}
RISING: Final = (
    "the set point is {rising:.3g} {rising_unit} on its way to the command, {rising_to:.3g} {rising_unit}, at "
    "{rising_limit}, {rising_rate:g} {rising_unit}/s: raise that, or command it for longer"
)
SLOWED: Final = (
    "; along the force the arm moves at {speed_fraction:.0%} of the speed that force_gain gives, because its own "
    "inertia resists like a large mass in this pose (sensing.apparent_mass_limit)"
)
PUSHED: Final = (
    "; something touches the arm since, and has pushed with up to {pushed:b} N: the arm gives way by "
    "limits.free_travel at most, unless that overpowers its motors"
)


class _Sentence(string.Formatter):
    """Format as str.format does; `b` writes a number briefly."""

    def format_field(self, value: Any, format_spec: str) -> str:
        return brief(value) if format_spec == "b" else str(super().format_field(value, format_spec))


def _fill(text: str, values: Mapping[str, Any]) -> str:
    return _Sentence().vformat(text, (), values)


def sentence(event: Event) -> str:
    """What an event is in words, '' where nothing has happened."""
    values = dict(event.values)
    cause = str(values.get(CAUSE, ""))
    if cause not in SENTENCES:
        return str(values.get("reason", cause or ("" if event.code is Code.NONE else event.code.value)))
    text = SENTENCES[cause]
    parts = {name: _fill(part, values) for name, part in _parts(cause, values).items()}
    end = _fill(PUSHED, values) if "pushed" in values else ""
    if "rising" in values and cause != "rising":
        end += f"; {_fill(RISING, values)}"
    return _fill(text, values | parts) + end


def reasons_in_words(reasons: Reason) -> str:
    """Why an estimate of a contact is not to be trusted, in words; '' where it is."""
    return "; ".join(text for reason, text in REASONS.items() if reason in reasons)


def sentences(events: Iterable[Event]) -> str:
    """Several events in words, each once."""
    return "; ".join(filter(None, dict.fromkeys(map(sentence, events))))


def _parts(cause: str, values: Mapping[str, Any]) -> dict[str, str]:
    """What the placeholders of a sentence stand for that are no values."""
    return {
        "advice": _advice(cause, values),
        "slowed": SLOWED if "speed_fraction" in values else "",
        "carried": CARRIED[values.get("payload", 0.0) > 0.0],
        "since": SINCE[values.get("has_touched", 0.0) > 0.0],
        "side": SIDES[values.get("error", 0.0) > 0.0],
        "swings": SWINGS[values.get("swings", 0.0) > 0.0],
        "late_advice": LATE[values.get("is_streamed", 0.0) > 0.0],
        "pushes": PUSHES.get(values.get("known", ""), ""),
        "force_limit": FORCE_LIMITS.get(values.get("limit", ""), ""),
        "behind": _fill(BEHIND, {**values, "why": WHY[values["why"]]}) if "why" in values else "",
        "rising_sentence": RISING if "rising" in values else "",
    }


def _advice(cause: str, values: Mapping[str, Any]) -> str:
    """What to do in place of a refused force; '' while that is looked for."""
    besides = f", or {BESIDES[cause]}" if cause in BESIDES else ""
    if "ways" in values:
        return f": {values['ways']}{besides}"
    if "searched" not in values:
        return ""
    if values["searched"] == "nothing":
        return f": bend the arm, or command more force, another direction or position{besides}"
    pinned = "" if values["searched"] == "pinned" else ", with a pinned position or without"
    return (
        "; no force up to 5 times and no angle of one joint up to {turned:g} rad away was found that would be "
        f"accepted with a margin{pinned}: command another direction or position{besides}"
    )
