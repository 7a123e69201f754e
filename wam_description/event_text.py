"""Sentences of events: the one place that knows them; consoles, reports and status messages ask for them."""

import math
import string
from collections.abc import Collection, Iterable, Mapping
from typing import Any, Final

from wam_description.event import Code, Event
from wam_description.number_text import brief, digits_apart
from wam_description.reasons import Reason
from wam_description.signals import NodeStatus
from wam_description.status import REFUSED

REASONS: Final = {
    Reason.MOMENT_ONLY: "on this link only the moment is measured: the contact position is unknown, and the estimated "
    "force is a lower bound",
    Reason.POSE: "in this pose, the torques of a force in this direction do not determine the contact position",
    Reason.WEAK: "the torques are too small, compared with their uncertainty, to identify the contact position",
    Reason.LINKS: "the link is not certain: a contact on another one explains the torques almost as well",
    Reason.MORE: "no single contact explains the torques",
    Reason.ALONG: "a force along this link, or along the link before it, explains the torques equally well",
    Reason.PAYLOAD: "a payload that was picked up may also explain the torques; the probabilities of the links and of "
    "the payload add up to 1",
    Reason.TOO_EARLY: "too few samples so far",
    Reason.BRAKED: "the arm is braked",
}

PINNED: Final = (
    "give the contact position (contact_position in a scenario, r x F as torque in force_command, or "
    "contact_source=pinned)"
)
EXCESS: Final = "{quantity} is {value:b} {unit}, above its limit of {allowed:g} {unit}{where}"
PARTS: Final = {  # of the predicted error of a force, and what makes each smaller
    "torques": (
        "the uncertain torques",
        "use joint sensors, or the dither (timing.dither_cycle=40)",
    ),
    "friction": (
        "the unknown friction of the surface",
        "lower sensing.friction if the surface has less friction, or bend the arm",
    ),
    "place": ("the uncertain contact position", PINNED),
    "resting": (
        "a load that is not in the model",
        "end the command and tare in free space ('wam call tare'), or declare the load (arm.payload)",
    ),
    "moving_surface": ("the motion of the surface", "move the surface more slowly, or raise force_gain"),
    "slow_arm": (
        "the arm, which would reach this force too slowly",
        "raise limits.settling_time, or lower guard.contact_stiffness if all surfaces are softer",
    ),
    "shaking_arm": (
        "the vibration of the arm",
        "use joint sensors, or lower guard.contact_stiffness if all surfaces are softer",
    ),
}
INSTEAD: Final = {  # of a part and where it comes from, what makes it smaller instead
    ("torques", "dithered motors"): "use joint sensors",
    ("torques", "sensors"): "raise limits.tolerance, or command another direction; of several forces, command fewer",
    ("place", "pinned"): "bend the arm, or lower contact_position_sd if the position is known better",
}
UNKNOWN: Final = "{desired:.3g} {unit} at {where} cannot be controlled because of {part_text}"
UNCERTAIN: Final = (
    "{desired:.3g} {unit} at {where} may be wrong by {error:b} {unit}, mostly because of {part_text}; allowed: "
    "{allowed:b} {unit} (limits.tolerance)"
)
HELPED: Final = "; the arm holds its position; {help}"
KEEPS_PRESSING: Final = "; the arm keeps pressing; {part_help}"
UNBOUNDED: Final = {  # by cause, in place of the next table where the error is infinite
    "error": UNKNOWN + HELPED,
    "uncertain": UNKNOWN + KEEPS_PRESSING,
}
BUS: Final = {  # by cause of a fault on the bus of a real arm
    "no_safety_module": "motor controllers answer, but the safety module (node 10) does not; check the cable to the "
    "pendant",
    "missing": "motor controller {node} does not answer; check its cable",
    "unknown_node": "node {node} does not belong to this arm; take the configuration of your arm",
    "not_motor": "node {node} is no motor controller: its role is {detail}; disconnect it",
    "firmware": "the firmware of node {node} has no property {detail}; update it",
    "mixed_firmware": "motor controllers {node} and 1 number {detail} differently; give both the same firmware",
    "not_awake": "motor controller {node} does not wake up; its status is {detail}; switch the arm off and on",
    "wrist": "motor 7 has {detail} poles; allowed: 6, those of a wrist; this driver does not know the transmission "
    "ratios of a gimbal",
    "counts": "motor controller {node} has {detail} counts per turn; allowed: 4096 or 40960",
    "gain": "motor controller {node} has {detail}; correct its property IPNM",
    "limit": "the largest torque (property MT, or TL1 of the safety module) of node {node} is {detail}; it must be "
    "above 0",
    "index": "motor controller {node} would take the torque of another motor; correct its property {detail}",
    "not_zeroed": "motor controller {node} is at {detail} counts, not those of the home pose; start there again",
    "no_reply": "motor controller {node} sends no position; check its cable",
    "no_mode": "motor controller {node} does not answer with its mode; check its cable",
    "jump": "the position of motor {node} jumps; check its encoder, then start in the home pose again",
    "reset": "motor controller {node} was reset; its zero is lost; check its power, then start in the home pose again",
    "all_silent": "the safety module answers, but no motor controller does; check the cable of the bus",
    "no_power": "nothing answers on the bus; check power, cable and adapter",
    "estop": "E-stop{lamps}; release it and press Shift-Idle",
    "safety_idle": "the safety module went to idle{lamps}; press Shift-Activate when the arm may move",
    "safety_silent": "the safety module does not answer; check the cable to the pendant",
    "controller_idle": "motor controller {node} left the torque mode (2) for mode {detail}; check its power",
    "foreign": "another computer sends on this bus; end its program",
    "doubled": "two nodes have the number {node}; give each its own",
    "not_sent": "the adapter refused {detail} frames; check adapter, cable and power of the arm",
}
SENTENCES: Final = {  # by cause
    # the arm holds
    "error": UNCERTAIN + HELPED,
    "moved_fast": "when the command came, the arm moved faster than {speed:g} rad/s, so the load on it is not yet "
    "known; the arm holds its position, and presses once it is at rest",
    "task": "{reason}; the arm holds its position",
    "other_link": "{touched} is touched, but the force is commanded on {cover}; command it on {touched}, or free the "
    "arm; until then the arm moves away from the contact, and holds",
    "free_travel": "the arm has moved {travel} the force {since}; allowed: {allowed:g} m "
    "(limits.free_travel); the arm holds its position; end the command, bring the arm to the surface, then begin again",
    # the arm goes on
    "uncertain": UNCERTAIN + KEEPS_PRESSING,
    "force_off": "{axis}: {desired:.3g} {unit} are commanded, but {measured:z.2f} {unit} are measured; the force has "
    "been wrong by more than {allowed:b} {unit} for {time:b} s; {reach}",
    "force_strays": "{axis}: the force was reached, but is now wrong by more than {allowed:b} {unit}: "
    "{measured:z.2f} {unit} are measured, {desired:.3g} {unit} are commanded; perhaps the surface moves, something "
    "else pushes, or the friction of the surface has changed its direction",
    "motion_off": "{axis}: {desired:.4g} {unit} is commanded, but it has been at {measured:.4g} {unit} for {time:b} s; "
    "allowed error: {allowed:.2g} {unit}; perhaps something is in the way, a joint is at its end, or the arm cannot "
    "move in this direction here",
    "speed": "{axis}: {speed:.3g} {unit}/s are commanded; allowed: {allowed:g} {unit}/s; the arm moves more slowly",
    "torques_differ": "the torques do not fit a force at {position:.3g} m along {cover} (chi^2 {chi2:.3g}, allowed: "
    "{allowed:g}); perhaps it acts elsewhere{hidden}, or a second force acts; correct the contact position{dither}, or "
    "free the arm",
    "torques_changed": "the torques have changed since the force settled (chi^2 {chi2:.3g}, allowed: {allowed:g}); "
    "perhaps a second force acts, or the friction of the surface has changed its direction; lift off, then command the "
    "force again",
    "pushed": "a force of at least {force:b} N acts on the arm; allowed: {allowed:b} N ({limit}); the arm "
    "moves away, by at most limits.free_travel",
    "joint_end": "{joint} stops at {angle:.4g} rad, {margin:g} rad before its end at {end:.4g} rad; command another "
    "posture or direction",
    "oscillating": "the measured force oscillates by {swing:b} N peak to peak, with a period of {period:b} s; "
    "allowed: {allowed:g} times the commanded {desired:.3g} N (limits.cycle_force); {calm}",
    "model_off": "the {part} seems to differ from the configured one; /diagnostics has the difference; if it lasts, "
    "{model}",
    # the driver has put the brakes on
    "emergency_stop": "emergency stop",
    "command_stale": "command stale: {age_ms:b} ms old; allowed: below {allowed_ms:g} ms; {cure}",
    "node_late": "the {what} itself did not run for {time:.2f} s; allowed: {allowed:g} s; {cure}",
    "held_up": "the driver itself did not run for {time:.2f} s; allowed: {allowed:g} s; {step}: make the steps of "
    "that node faster, or run it in its own process",
    "unanswered": "lockstep: no {topics} for the state at {stamp} ns within {allowed:.1f} s; {cure}",
    "simulation": "the simulation of the arm failed: {trouble}; the arm is back where it was before this step; "
    "{less}, or lower timing.period",
    "limit": EXCESS + "; {less}",
    "broken": EXCESS + " while the brakes hold; check the cable",
    "node": "{node}: {fault}{late}",
    # a node reports it, and the driver brakes
    "claimed": "{nodes} publish {topic}, but only one node may; stop all but one",
    "stopped": "{nodes} has stopped or is very slow: no new {topics}{together}; if it has stopped, start it, or "
    "'wam up', again; if the computer is busy, end other programs",
    "long_step": "no new {topics}, because {step}; make the steps of that node faster",
    "ended": "{node} has ended; start it again, or 'wam up' if that started it",
    **{f"bus_{cause}": f"bus: {text}" for cause, text in BUS.items()},
}
LESS: Final = "command less; if little is commanded, a controller has a wrong sign or too large a gain"
LOADED: Final = "declare the load (arm.payload); if the tool carries none, "  # else the model is wrong
TURNED: Final = "in the frame of a link the force turns with it"
SINCE: Final = ("without reaching it", "since the force was last within its tolerance")
REACH: Final = (
    "hardly anything is touched; bring the arm to the surface first, or command more force, towards it",
    "command a force that the arm can reach",
    f"the arm is pulled, or carries a load that is not in its model; {PARTS['resting'][1]}",
)
FAST: Final = ": the arm moved faster than the safety module allows; move it more slowly"
NO_DITHER: Final = "set timing.dither_cycle to 0, as joint sensors need no dither, or "


class _Sentence(string.Formatter):
    """Format as str.format does; `b` writes a number briefly.

    Parameters
    ----------
    digits : of a brief number.
    """

    def __init__(self, digits: int) -> None:
        self._digits = digits

    def format_field(self, value: Any, format_spec: str) -> str:
        return brief(value, self._digits) if format_spec == "b" else str(super().format_field(value, format_spec))


def sentence(event: Event) -> str:
    """What an event is in words, '' where nothing has happened."""
    cause = str(event.cause)
    if cause not in SENTENCES:
        return str(event.values.get("reason", cause or ("" if event.code is Code.NONE else event.code.value)))
    values = {**event.values, **_parts(event.values)}
    text = (UNBOUNDED if values.get("error") == math.inf else SENTENCES)[cause]
    return _Sentence(_digits(event.values)).vformat(text, (), values)


def _digits(values: Mapping[str, Any]) -> int:
    """Of brief numbers: what is above an allowed number is written so that it is seen."""
    if "value" in values:
        return max(3, digits_apart(values["value"], values["allowed"]))
    value = values.get("error", values.get("force", values.get("age_ms")))
    allowed = values.get("allowed", values.get("allowed_ms"))
    return 2 if value is None or allowed in (None, value) else digits_apart(value, allowed)


def sentences(events: Iterable[Event], between: str = "; also: ") -> str:
    """Several events in words, each once."""
    return between.join(filter(None, dict.fromkeys(map(sentence, events))))


def news(status: NodeStatus, known: Collection[object]) -> str:
    """What a status states of other subjects than those that are known, for a terminal: a line for each event."""
    new = [one for one in status.events if one.subject not in known]
    what = f"{status.facts[REFUSED]}: {new[0].code.words}: " if new and REFUSED in status.facts else ""
    return what + (sentences(new, "\n    also: ") or status.message)


def _parts(values: Mapping[str, Any]) -> dict[str, str]:
    """What the placeholders of a sentence stand for that are no values."""
    source, detail = (str(values.get(name, "")) for name in ("source", "detail"))
    has_touched, way = values.get("has_touched", 0.0) > 0.0, values.get("way", 0.0)
    push, ago = values.get("push"), values.get("ago", 0.0)
    acts = f"acted until {ago:.2f} s before" if ago else "acts"
    calm = NO_DITHER * (values.get("dither", 0.0) > 0.0) + "hold the surface still, or lower force_gain"
    along = math.copysign(1.0, values.get("desired", 1.0))
    is_pulled = along * values.get("measured", 0.0) <= -values.get("allowed", math.inf)
    found = {
        "travel": f"{abs(way):.3g} m {'against' if way < 0.0 else 'along'}",
        "since": SINCE[values.get("has_settled", 0.0) > 0.0],
        "reach": REACH[2 if is_pulled else has_touched],
        "calm": "hold the surface still, lower force_gain, or use joint sensors" if "motors" in source else calm,
        "less": f"a push {acts} ({push}); push less, or {LESS}" if push else LESS,
        "lamps": f" (the pendant shows a fault of the {detail}{FAST * ('velocity' in detail)})" if detail else "",
        "hidden": ", friction of motors at rest hides a part of it" * (source == "motors"),
        "dither": ", use the dither (timing.dither_cycle=40)" * (source == "motors"),
        "together": f" (or {others} have stopped)" if (others := values.get("others")) else "",
        "model": LOADED * (values.get("part") == "payload") + "run 'wam identify'",
    }
    if values.get("part") in PARTS:
        part, helps = PARTS[values["part"]]
        helps = INSTEAD.get((values["part"], values["source"]), helps)
        is_joint = math.isnan(values["position"])
        where = values["cover"] if is_joint else f"{values['position']:.3g} m along {values['cover']}"
        found |= {"part_text": part, "part_help": helps, "where": where, "help": _help(values, helps)}
    return found


def _help(values: Mapping[str, Any], helps: str) -> str:
    """What to do in place of a refused force: what was found, and what helps against its largest part."""
    found = []
    if "turn" in values:
        angles = f"from {values['turn_from']:.2f} to {values['turn_to']:.1f} rad"
        found.append(f"lift off, turn {values['turn']} {angles}, and repeat the command ({TURNED})")
    if "more_force" in values:
        found.append(f"command {values['more_force']:g} N")
    if "pin" in values and helps is not PINNED:
        found.append(PINNED)
    if "no_pin" in values and helps is PINNED:
        helps = "command another direction"  # a pinned position does not help
    if "searched" in values and not found:
        return f"neither a force up to 5 times as large nor the turn of a single joint helps; {helps}"
    return ", or ".join([*found, helps])
