"""The analysis of another robot's recording: a section for each question."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from wam_analysis.findings.finding import Finding, Section, counted, shown, times
from wam_analysis.foreign.cycles import COMMANDED_CYCLE, HARMONIC, LIMIT_CYCLE, FoundCycle, cycles, lines, slowest
from wam_analysis.foreign.forces import ForceStep, force_steps
from wam_analysis.foreign.mechanics import (
    DRAG,
    FILTER,
    WEIGHT,
    friction,
    is_sure,
    rests,
    velocity_factor,
)  # fmt: skip
from wam_analysis.foreign.sources import Source, Treated, Treatment, clocks_of
from wam_analysis.recording import AnalysedRecording
from wam_analysis.thresholds import CYCLE
from wam_bag.bag import Bag, Columns, JointColumns, WrenchColumns
from wam_bag.limits import READING_LIMITS

NAMED = READING_LIMITS.named
TURNS = 4.0 * math.pi  # rad; few joints turn so far, and most that are recorded in degrees do
ALSO = {
    WEIGHT: "with its weight",
    DRAG: "with a drag by the square of the velocity",
    FILTER: "the effort is filtered, or otherwise lags behind the motion, which was corrected",
}


def topics_section(recording: AnalysedRecording) -> Section:
    """What is in another robot's recording, and what was done to its raw values."""
    bag, mixed, given, found = recording.bag, recording.mixed, recording.given, recording.analysed
    what = (
        "Analysed as that of another robot, as the options request."
        if given.is_given
        else "This is not a recording of this stack."
    )
    sentences = [what, *(line for name, columns in sorted(bag.topics.items()) for line in _topic(name, columns))]
    clocks = [f"{name}: {clock.note}." for name, clock in clocks_of(bag).items() if clock.note]
    wrong = [*_treated(found), *clocks]
    wrong += [
        f"{topic}: values jump back and forth from message to message, as where two publishers take turns; "
        f"the topic is not analysed ({', '.join(one.label for one in mixed if one.topic == topic)})."
        for topic in dict.fromkeys(one.topic for one in mixed)
    ]
    for name, columns in bag.topics.items():
        if isinstance(columns, JointColumns):
            wrong += [f"{name}: {counted(n, 'message')} with {what}." for what, n in columns.irregular.items()]
            largest = float(np.nanmax(np.abs(columns.position), initial=0.0))
            if largest > TURNS and not given.units.get("position"):
                far = f"positions up to {shown(largest, 'rad')}, taken as radians"
                wrong.append(f"{name}: {far}; if they are degrees, give --unit position=deg.")
    if topics := ", ".join(dict.fromkeys(one.topic for one in found if one.is_command)):
        sentences.append(f"Taken as commands: {topics}.")
    sentences += [*wrong, *_alike(found), *_unread(bag)]
    if not found:
        wrong += _unread(bag) or ["nothing in it can be analysed."]
    return Section("happened", "What happened", tuple(sentences), _treated_findings(found), (), (), tuple(wrong))


def _topic(name: str, columns: Columns) -> Iterator[str]:
    """What a topic holds."""
    if isinstance(columns, JointColumns) and len(columns.stamp_ns):
        yield f"{name}: {len(columns.stamp_ns)} messages of the joints {', '.join(columns.names)}."
        numbers = np.hstack([columns.position, columns.velocity, columns.effort])
        known = [np.isfinite(numbers[:, i :: len(columns.names)]).any() for i in range(len(columns.names))]
        if none := [joint for joint, there in zip(columns.names, known, strict=True) if not there]:
            yield f"{name}: {', '.join(none)} without a value that is a number."
    elif isinstance(columns, WrenchColumns) and len(columns.stamp_ns):
        sizes = np.sqrt((columns.force**2).sum(axis=1))
        sizes = sizes[np.isfinite(sizes)]
        what = f"up to {shown(float(sizes.max()), 'N')}" if len(sizes) else "none of which is a number"
        yield f"{name}: {len(columns.stamp_ns)} forces, {what}."


DONE_TO = {
    Treatment.COARSE: "{number} of {of} stamps repeat the one before; times of reception are used",
    Treatment.ROUNDED: "the stamps are rounded to {size}; times of reception are used",
    Treatment.SPREAD: "{number} of {of} stamps repeat the one before; the messages are placed evenly between them",
    Treatment.TWICE: "{number} of {of} stamps came twice; the first message of each is used",
    Treatment.WRAPPED: "the {quantity} jumps {times} by {size}; it is unwrapped",
    Treatment.MOVED_ZERO: "the zero of the {quantity} moves {times}, by up to {size}, which is taken off",
    Treatment.SPARSE: "{quantity} in only {share:.0f} % of the messages",
}


def _treated(found: Sequence[Source]) -> list[str]:
    """What was done to raw values, a sentence for all joints of a topic and quantities to which the same was done."""
    alike: dict[tuple[str, Treated], tuple[list[Source], list[str]]] = {}
    for one in found:
        for treated in one.treated:
            those, quantities = alike.setdefault((one.topic, treated._replace(quantity="")), ([], []))
            those += [one] * (one not in those)
            quantities += [treated.quantity] * (treated.quantity not in quantities)
    sentences = []
    for (topic, treated), (those, quantities) in alike.items():
        is_whole = not quantities[0] or 1 < len(those) == sum(one.topic == topic for one in found)
        subject = topic if is_whole else ", ".join(one.label for one in those)
        words = DONE_TO[treated.what].format(
            quantity=" and ".join(quantities),
            number=treated.number,
            of=treated.of,
            size=shown(abs(treated.size), those[0].units.get(quantities[0], "s")),
            times=times(treated.number),
            share=100.0 * (1.0 - treated.number / treated.of),
        )
        sentences.append(f"{subject}: {words}.")
    return sentences


def _treated_findings(found: Sequence[Source]) -> tuple[Finding, ...]:
    every = [
        Finding(
            f"{one.label}: {treated.what}{' ' * bool(treated.quantity)}{treated.quantity}", "", float(treated.number)
        )
        for one in found
        for treated in one.treated
    ]
    return tuple(every)


def _alike(found: Sequence[Source]) -> list[str]:
    """How to name the command among several topics with the same joints: their values do not show it."""
    topics: dict[str, list[str]] = {}
    for one in found:
        if one.is_joint and not one.is_command:
            topics.setdefault(one.name, []).append(one.topic)
    shared = {tuple(dict.fromkeys(some)): joint for joint, some in topics.items() if len({*some}) > 1}
    if any(one.is_command for one in found):
        return []
    return [
        f"{joint} is in {' and '.join(some)}; if one of them is what was commanded, give --command {some[-1]}."
        for some, joint in shared.items()
    ]


def _unread(bag: Bag) -> list[str]:
    """Topics that were not read, and how to."""
    others = {
        name: n for name, n in bag.counts.items() if n and not any(one.split(" ")[0] == name for one in bag.topics)
    }
    if not others:
        return []
    most = sorted(others, key=lambda name: -others[name])[:NAMED]
    listed = ", ".join(f"{name} ({bag.types.get(name, '')})" for name in most) + ", ..." * (len(others) > NAMED)
    number = f"{sum(others.values())} messages of other topics"
    return [f"{number} were not analysed: {listed}; --topic {most[0]} --map QUANTITY=FIELD names what they hold."]


# forces


def step_section(recording: AnalysedRecording) -> Section:
    """Steps of a commanded force, and how the measured one followed."""
    states, commands = recording.states, recording.commands
    steps: list[ForceStep] = []
    sentences, findings, doubts, followed = [], [], [], set()
    for one in (one for one in states if not one.is_joint):
        if (command := recording.command_of(one)) is not None:
            steps += force_steps(one, command)
            followed.add(command.topic)
            continue
        doubts += [
            f"{one.label}, in the frame {one.frame}, is not compared with the command {other.topic}, in the frame "
            f"{other.frame}."
            for other in commands
            if not other.is_joint and not one.shares_frame(other)
        ]
    doubts += [text for one in commands if one.topic in followed and (text := _arrival(one))]
    for step in steps:
        name = f"{step.label}, {shown(step.commanded, 'N')} at {step.begin:.1f} s"
        response = step.response
        over = 100.0 * response.overshoot
        settled = "" if math.isfinite(response.settling) else ", which did not settle to 5 %"
        sentences.append(f"{name}: a step from {shown(step.before, 'N')}{settled}.")
        findings += [
            Finding(f"{name}: force in the steady state", "N", abs(response.final), abs(step.commanded)),
            Finding(f"{name}: rise time 10-90 %", "s", response.rise),
            Finding(f"{name}: settling time to 5 %", "s", response.settling),
            Finding(f"{name}: overshoot", "%", over),
            Finding(f"{name}: ripple", "N", response.ripple),
        ]
    if steps:
        worst = max(steps, key=lambda step: abs(step.response.final - step.commanded))
        error = shown(abs(worst.response.final - worst.commanded), "N")
        number, size = counted(len(steps), "force step"), shown(worst.commanded, "N")
        verdict = f"{number}; the largest steady error is {error} of {size}."
        return Section("force", "Force", (*sentences, *doubts), tuple(findings), (), (verdict,), tuple(doubts))
    stated = tuple(doubts) or ("No step of a commanded force was recorded.",)
    return Section("force", "Force", stated, (), (), (), tuple(doubts))


def _arrival(command: Source) -> str:
    """That a command goes over to its frame from another one, '' if it does not."""
    at = command.time[command.arrives & np.any(np.column_stack([*command.values.values()]), axis=1)]
    if not len(at):
        return ""
    when = f"at {at[0]:.1f} s" if len(at) == 1 else f"{times(len(at))}, first at {at[0]:.1f} s"
    return (
        f"{command.topic} goes over to the frame {command.frame or 'without a name'} {when}; that is not evaluated as "
        "a step, because what was commanded before is in another frame."
    )


# cycles and spectrum


def repetition_section(recording: AnalysedRecording) -> Section:
    """What repeats, and whether it was commanded."""
    found = [cycle for one in recording.states for cycle in cycles(one, recording.command_of(one))]
    sentences, findings, verdict = [], [], []
    taken: set[str] = set()
    for one in found:
        label = one.label if one.label not in taken else f"{one.label} from {one.begin:.1f} s"
        taken.add(one.label)
        sentence = _cycle_sentence(one)
        sentences.append(sentence)
        if one.origin not in (COMMANDED_CYCLE, HARMONIC):
            size = f"{shown(one.frequency, 'Hz')}, {shown(one.peak_to_peak, one.unit)} peak to peak"
            verdict.append(f"{one.label}: {size}{', not commanded' * (one.origin == LIMIT_CYCLE)}.")
        findings += [
            Finding(f"{label}: cycle, peak to peak", one.unit, one.peak_to_peak, note=one.origin, error=one.error),
            Finding(f"{label}: frequency", "Hz", one.frequency, note=one.origin),
            Finding(f"{label}: begin", "s", one.begin),
            Finding(f"{label}: end", "s", one.end),
            Finding(f"{label}: confidence", "", one.confidence),
        ]
    stated = tuple(sentences) or ("Nothing in this recording repeats five times.",)
    return Section("stability", "Cycles", stated, tuple(findings), (), tuple(verdict))


def _cycle_sentence(one: FoundCycle) -> str:
    size = f"{shown(one.peak_to_peak, one.unit)} peak to peak"
    if not CYCLE.changing < one.growth < 1.0 / CYCLE.changing:
        change = f"{'growing' if one.growth > 1.0 else 'shrinking'} by {100.0 * abs(one.growth - 1.0):.0f} %"
        size += f", {change} from half to half,"
    where = f"from {one.begin:.1f} to {one.end:.1f} s (confidence {one.confidence:.2f})"
    frequency = shown(one.frequency, "Hz")
    if one.origin == LIMIT_CYCLE:
        return f"{one.label}: limit cycle of {size} at {frequency} {where}; it was not commanded."
    if one.origin == COMMANDED_CYCLE:
        return f"{one.label} repeats at {frequency}, {size}, {where}, as it was commanded."
    if one.origin == HARMONIC:
        return (
            f"{one.label} repeats at {frequency}, {size}, {where}, near a multiple of the commanded frequency: a limit "
            "cycle, or the commanded motion that is not followed linearly."
        )
    return f"{one.label} repeats at {frequency}, {size}, {where}; no command of it is known, --command names one."


def spectrum_section(recording: AnalysedRecording) -> Section:
    """The strongest lines of each joint and wrench axis."""
    states = recording.states
    findings = []
    for label, unit, line in (found for one in states for found in lines(one)):
        findings.append(Finding(f"{label}, {shown(line.frequency, 'Hz')}: amplitude", unit, line.amplitude))
        findings.append(Finding(f"{label}, {shown(line.frequency, 'Hz')}: frequency", "Hz", line.frequency))
    begins = [first for one in states if math.isfinite(first := slowest(one))]
    if not begins:
        return Section("frequency", "Spectrum", ("No stretch is long enough.",), ())
    span = f"from {shown(min(begins), 'Hz')} on, five cycles of the longest stretch"
    if findings:
        return Section("frequency", "Spectrum", (f"Looked for {span}.",), tuple(findings))
    silent = f"No frequency is above the noise {span}; slower ones were not looked for."
    return Section("frequency", "Spectrum", (silent,), (), (), (silent,))


# mechanics


def effort_section(recording: AnalysedRecording) -> Section:
    """Friction and inertia of the joints of another robot."""
    states = recording.states
    sentences, findings, doubts, brief, alone, wrong = [], [], [], [], [], []
    for one in states:
        factor = velocity_factor(one)
        if math.isfinite(factor):
            wrong.append(
                f"{one.label}: the recorded velocity is {factor:.3g} times the rate of the position; one of the two is "
                f"of another unit or sign, so that neither friction nor inertia is given."
            )
        whole = friction(one) if one.is_joint else None
        if whole is None:
            if not math.isfinite(factor) and {"effort"} < one.values.keys() and not rests(one):
                doubts.append(f"{one.label}: its effort determines neither a dry nor a viscous friction.")
            continue
        found = whole.friction
        effort, speed = one.units["effort"], one.units.get("velocity", "rad/s").partition("/")[0]
        every = (
            ("dry friction", effort, found.dynamic, found.dynamic_error),
            ("viscous friction", f"{effort} s/{speed}", found.viscous, found.viscous_error),
            ("inertia", "kg m2" if effort == "N m" else f"{effort} s2/{speed}", found.inertia, found.inertia_error),
        )
        numbers = [number for number in every if is_sure(*number[2:])]
        findings += [Finding(f"{one.label}: {what}", unit, value, error=error) for what, unit, value, error in numbers]
        brief.append(f"{one.label}: {', '.join(f'{what} {shown(value, unit)}' for what, unit, value, _ in numbers)}.")
        missing = [what for what, _, value, error in every if not (math.isnan(value) or is_sure(value, error))]
        stated = [f"{100.0 * found.unexplained:.2g} % of the effort's rms is unexplained"]
        if math.isnan(found.inertia):
            late = shown(1e-3 * abs(whole.per_lag))
            stated.append(f"one frequency, 1 ms of delay changes the viscous friction by {late}")
            alone.append(one.label)
        stated += [f"not identifiable: {', '.join(missing)}"] * bool(missing)
        stated += [ALSO[name] for name in whole.also]
        way = "behind" if whole.lag > 0.0 else "before"
        stated += [f"the effort is {shown(abs(whole.lag), 's')} {way} the motion"] * bool(whole.lag)
        sentences.append(f"{one.label}: {'; '.join(stated)}.")
    if not sentences:
        why = "The friction of the joints cannot be identified: no effort determines a dry or viscous friction."
        return Section("friction", "Friction", (why, *doubts, *wrong), (), (), (), tuple(wrong))
    assumed = (
        "Of the recorded effort, as loaded by friction, inertia and the joint's own weight alone; drag and delays "
        "that it may also hold are taken off where they are found, and otherwise count in the errors:"
    )
    if alone:
        doubts.append(
            f"{', '.join(alone)} moved at one frequency: inertia cannot be separated from weight, nor viscous "
            "friction from a delay of the effort."
        )
    stated = [assumed, *sentences, *doubts, *wrong]
    return Section("friction", "Friction", tuple(stated), tuple(findings), (), tuple(brief), tuple(wrong))
