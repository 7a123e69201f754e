"""What a bag shows, in words and numbers, measured beside predicted."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from wam_analysis.bag import Bag, JointColumns, WrenchColumns, read
from wam_analysis.findings.finding import Section, shown, times
from wam_analysis.findings.force import contact_section, cycle_section, force_section
from wam_analysis.findings.held_force import HeldForce, held_forces
from wam_analysis.findings.motion import Motion, motion_sections
from wam_analysis.findings.recording import Recording, recording_of
from wam_analysis.findings.timing import extent, provenance, timing_section

Progress = Callable[[str], None]

# what the analyses look at; everything else would cost time for nothing
TOPICS_READ = (
    "motor_states", "motor_current_command", "motor_velocity_command", "joint_states", "joint_sensors",
    "gravity_effort", "force_command", "force_measured", "contact/wrench", "contact/point", "contact/hypotheses",
    "sim/contact/wrench", "sim/contact/point", "sim/disturbance", "sim/joint_states", "status", "/diagnostics",
)  # fmt: skip
OWN = ("motor_states", "force_command", "contact/wrench", "sim/joint_states", "status")  # nobody else has these


class Analysis(NamedTuple):
    """All that is said about a bag.

    Attributes
    ----------
    recording, held, motion : what the sections rest on, for the pictures.
    duration : s.
    provenance : where it comes from, in the order in which people ask.
    sections : one for each side of it; "happened" is the first.
    """

    recording: Recording
    held: tuple[HeldForce, ...]
    motion: Motion
    duration: float
    provenance: dict[str, str]
    sections: tuple[Section, ...]


def analyse(path: str | Path, progress: Progress) -> Analysis:
    """Read a bag and analyse it.

    Parameters
    ----------
    path : bag directory or .mcap file, of this stack or of another that has JointState or WrenchStamped.
    progress : is told what is being done.

    Raises
    ------
    BagError
        where the bag cannot be read.
    """
    progress(f"reading {path}")
    bag = read(path, TOPICS_READ, may_lack=True)
    if not any(len(columns.log_time_ns) for columns in bag.topics.values()):
        progress("none of the stack's topics is in it; reading all")
        bag = read(path)
    return analyse_bag(bag, progress)


def analyse_bag(bag: Bag, progress: Progress) -> Analysis:
    """Analyse a bag that has been read, see `analyse`."""
    progress("forces and contacts")
    recording = recording_of(bag)
    held = held_forces(recording)
    forces = force_section(recording, held), cycle_section(recording, held), contact_section(recording)
    progress("friction, ripple, power and frequency")
    motion = motion_sections(recording)
    progress("timing")
    timing = timing_section(recording)
    duration = extent(bag.topics)
    sections = (_happened(recording, duration), *forces, *motion.sections, timing)
    return Analysis(recording, held, motion, duration, provenance(recording), sections)


def _happened(recording: Recording, duration: float) -> Section:
    """What happened, in a few sentences."""
    summary, bag = recording.summary, recording.bag
    said = [f"INCOMPLETE: {line}" for line in summary.lost]
    said.append(f"{shown(duration, 's')} of {summary.namespace or '/'}, {recording.mode}.")
    if summary.steps:
        ended = "to its end" if summary.outcome == "done" else f"and ended so: {summary.outcome}"
        said.append(f"A scenario of {len(summary.steps)} steps was played {ended}.")
    touches = [touch for touch in summary.touches if touch.link_true]
    if recording.holds:
        forces = ", ".join(f"{hold.asked:.3g} N" for hold in recording.holds)
        said.append(f"The arm was asked to press {times(len(recording.holds))} ({forces}).")
    if touches:
        said.append(f"It touched something in {len(touches)} step{'s' * (len(touches) > 1)}.")
    faults = [note for note in summary.notes if note.startswith("driver fault")]
    said += [f"{fault[0].upper()}{fault[1:]}." for fault in faults]
    foreign = _foreign(bag)
    if foreign:
        said += foreign
    if recording.parameters.note:
        said.append(f"Predictions are missing in part: {recording.parameters.note}.")
    lacking = recording.lacking("motor_states", "joint_states", "force_command", "contact/wrench", "status")
    return Section("happened", "What happened", tuple(said), (), lacking)


def _foreign(bag: Bag) -> list[str]:
    """Ranges of JointState and WrenchStamped where none of the stack's own topics is in the bag."""
    own = tuple(f"/{name}" for name in OWN)
    if any(name.endswith(own) and len(columns.log_time_ns) for name, columns in bag.topics.items()):
        return []
    said = ["It is not a recording of this stack."]
    for name, columns in sorted(bag.topics.items()):
        if isinstance(columns, JointColumns) and len(columns.stamp_ns):
            said.append(f"{name}: {len(columns.stamp_ns)} messages of the joints {', '.join(columns.names)}.")
        elif isinstance(columns, WrenchColumns) and len(columns.stamp_ns):
            largest = float((columns.force**2).sum(axis=1).max()) ** 0.5
            said.append(f"{name}: {len(columns.stamp_ns)} forces, up to {shown(largest, 'N')}.")
    return said
