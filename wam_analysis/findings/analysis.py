"""The analysis of a bag: sections of sentences and numbers, measured and predicted."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from wam_analysis.findings.analysed_run import AnalysedRun, analysed_run
from wam_analysis.findings.contact import contact_section
from wam_analysis.findings.finding import Section, shown, times
from wam_analysis.findings.force import cycle_section, force_section
from wam_analysis.findings.held_force import HeldForce, held_forces
from wam_analysis.findings.motion import MotionFindings, motion_sections
from wam_analysis.findings.other_robots import friction_of_others, signals_of_others
from wam_analysis.findings.swinging import cycles_of_others
from wam_analysis.findings.timing import extent, provenance, timing_section
from wam_bag.bag import Bag, JointColumns, WrenchColumns, read

LONGEST = 160  # characters of a note on the parameters
Progress = Callable[[str], None]

# the topics that are analysed; reading others would only cost time
TOPICS_READ = (
    "motor_states", "motor_current_command", "motor_velocity_command", "joint_states", "joint_sensors",
    "gravity_effort", "force_command", "force_measured", "contact/wrench", "contact/point", "contact/hypotheses",
    "sim/contact/wrench", "sim/contact/point", "sim/disturbance", "sim/joint_states", "status", "/diagnostics",
)  # fmt: skip
OWN = (
    "motor_states",
    "force_command",
    "contact/wrench",
    "sim/joint_states",
    "status",
)  # only bags of this stack have these


class Analysis(NamedTuple):
    """The analysis of a bag.

    Attributes
    ----------
    recording, held, motion : what the sections are made from, for the pictures.
    duration : s.
    provenance : origin of the bag and of the numbers.
    sections : one for each subject; "verdict" is the first.
    """

    recording: AnalysedRun
    held: tuple[HeldForce, ...]
    motion: MotionFindings
    duration: float
    provenance: dict[str, str]
    sections: tuple[Section, ...]

    def __repr__(self) -> str:
        return f"Analysis({self.recording.run.bag!r}, {self.duration:.1f} s, {len(self.sections)} sections)"


def analyse(path: str | Path, progress: Progress) -> Analysis:
    """Read a bag and analyse it.

    Parameters
    ----------
    path : bag directory or .mcap file, of this stack or of another robot with JointState or WrenchStamped.
    progress : called with each stage of the work.

    Raises
    ------
    BagError
        if the bag cannot be read.
    """
    progress(f"reading {path}")
    bag = read(path, TOPICS_READ, may_lack=True)
    if not any(len(columns.log_time_ns) for columns in bag.topics.values()):
        progress("it has none of the stack's topics; reading all")
        bag = read(path)
    return analyse_bag(bag, progress)


def analyse_bag(bag: Bag, progress: Progress) -> Analysis:
    """Analyse a bag that has been read, see `analyse`."""
    progress("forces and contacts")
    recording = analysed_run(bag)
    held = held_forces(recording)
    foreign = _foreign(bag)
    others = signals_of_others(bag) if foreign else {}
    if foreign:
        middle: tuple[Section, ...] = (cycles_of_others(others),)
    else:
        middle = (force_section(recording, held), cycle_section(recording, held), contact_section(recording))
    progress("friction, ripple, power and frequency")
    motion = motion_sections(recording)
    moved = motion.sections if not foreign else (*motion.sections[:1], friction_of_others(others))
    progress("timing")
    timing = timing_section(recording)
    duration = extent(bag.topics)
    sections = (_happened(recording, duration, foreign), *middle, *moved, timing)
    return Analysis(recording, held, motion, duration, provenance(recording), (_verdict(sections), *sections))


def _verdict(sections: tuple[Section, ...]) -> Section:
    """What every section says of importance, in a few sentences."""
    said = [sentence for section in sections for sentence in section.verdict]
    silent = "No force, contact, cycle or fault was recorded that could be evaluated."
    return Section("verdict", "Verdict", tuple(said) or (silent,), ())


def _happened(recording: AnalysedRun, duration: float, foreign: list[str]) -> Section:
    """What happened, in a few sentences."""
    summary = recording.summary
    sentences = [f"INCOMPLETE: {line}" for line in summary.lost]
    sentences.append(f"{shown(duration, 's')} of {summary.namespace or '/'}, {recording.mode}.")
    if summary.steps:
        ended = " to its end" if summary.outcome == "done" else f"; {summary.outcome}"
        sentences.append(f"A scenario of {_count(len(summary.steps), 'step')} was played{ended}.")
    touches = [touch for touch in summary.touches if touch.link_true]
    if recording.holds:
        forces = ", ".join(f"{hold.commanded:.3g} N" for hold in recording.holds)
        sentences.append(f"The arm was commanded to press {times(len(recording.holds))} ({forces}).")
    if touches:
        sentences.append(f"It touched something in {_count(len(touches), 'step')}.")
    faults = [note for note in summary.notes if note.startswith("driver fault")]
    sentences += [f"{fault[0].upper()}{fault[1:]}." for fault in faults]
    sentences += foreign
    if recording.parameters.note:
        sentences.append(f"No predictions for some parts: {recording.parameters.note}.")
    sentences += [_brief(f"{note[0].upper()}{note[1:]}.") for note in recording.run.parameters.notes]
    lacking = recording.lacking("motor_states", "joint_states", "force_command", "contact/wrench", "status")
    verdict = [f"INCOMPLETE: {line}" for line in summary.lost]
    verdict += [f"STOPPED: {fault}." for fault in faults]
    if summary.steps and summary.outcome != "done" and not faults:
        verdict.append(f"Of the scenario: {summary.outcome}.")
    return Section("happened", "What happened", tuple(sentences), (), lacking, tuple(verdict))


def _brief(note: str) -> str:
    """A note on the parameters in one line; the whole of it is in the provenance."""
    return note if len(note) <= LONGEST else f"{note[:LONGEST].rpartition(',')[0]}, ... (all under Provenance)."


def _count(number: int, name: str) -> str:
    return f"{number} {name}{'s' * (number != 1)}"


def _foreign(bag: Bag) -> list[str]:
    """Messages of JointState and WrenchStamped, if the bag has none of the stack's own topics."""
    own = tuple(f"/{name}" for name in OWN)
    if any(name.endswith(own) and len(columns.log_time_ns) for name, columns in bag.topics.items()):
        return []
    sentences = ["This is not a recording of this stack."]
    for name, columns in sorted(bag.topics.items()):
        if isinstance(columns, JointColumns) and len(columns.stamp_ns):
            sentences.append(f"{name}: {len(columns.stamp_ns)} messages of the joints {', '.join(columns.names)}.")
        elif isinstance(columns, WrenchColumns) and len(columns.stamp_ns):
            largest = float((columns.force**2).sum(axis=1).max()) ** 0.5
            sentences.append(f"{name}: {len(columns.stamp_ns)} forces, up to {shown(largest, 'N')}.")
    return sentences
