"""The analysis of a bag: sections of sentences and numbers, measured and predicted."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from wam_analysis.findings.contact import contact_section
from wam_analysis.findings.efficiency import efficiency_section
from wam_analysis.findings.effort import effort_section
from wam_analysis.findings.finding import Section, counted, deviations, shown, stated
from wam_analysis.findings.following import following_section
from wam_analysis.findings.force import cycle_section, force_section
from wam_analysis.findings.force_steps import step_section
from wam_analysis.findings.friction import friction_section
from wam_analysis.findings.repetition import repetition_section, spectrum_section
from wam_analysis.findings.steps import VerdictResult, steps_section, verdict
from wam_analysis.findings.stick_slip import stick_section
from wam_analysis.findings.timing import provenance, timing_section
from wam_analysis.findings.topics import topics_section, unread
from wam_analysis.foreign.reading import foreign_bag
from wam_analysis.foreign.tables import RENAMED, UNUSED, series_of_csv, series_of_frame, table_bag
from wam_analysis.foreign.topic_map import NOTHING_GIVEN, TopicMap
from wam_analysis.recording import AnalysedRecording
from wam_analysis.thresholds import LAYOUT
from wam_bag.bag import Bag, BagError, read
from wam_bag.errors import command
from wam_bag.losses import PARAMETERS, RECORDING
from wam_description.event import Code
from wam_description.signals import NodeStatus
from wam_sim.recorded_run import RecordedRun

Progress = Callable[[str], None]
Maker = Callable[[AnalysedRecording], Section | None]

SHOWN = (  # topics without which some section has less
    "status", "joint_states", "motor_states", "motor_current_command", "joint_sensors", "gravity_effort",
    "force_command", "force_measured", "contact/wrench", "contact/point", "contact/hypotheses",
    "sim/joint_states", "sim/contact/wrench", "sim/contact/point",
)  # fmt: skip
TOPICS_READ = (  # those for which any section asks; reading others would only cost time
    *SHOWN, "sim/disturbance", "force_axis", "task_command", "task_axes", "joint_posture_command", "/diagnostics",
)  # fmt: skip
OWN_TOPICS = {  # topics of this stack alone; a bag with two of them in a namespace is of this stack
    "motor_states": "sensor_msgs/msg/JointState",
    "force_command": "geometry_msgs/msg/WrenchStamped",
    "contact/wrench": "geometry_msgs/msg/WrenchStamped",
    "sim/joint_states": "sensor_msgs/msg/JointState",
    "status": "diagnostic_msgs/msg/DiagnosticStatus",
}


class Analysis(NamedTuple):
    """The analysis of a bag.

    Attributes
    ----------
    recording : what the sections are made from, for the pictures.
    sections : one for each subject; "verdict" is the first.
    """

    recording: AnalysedRecording
    sections: tuple[Section, ...]

    @property
    def provenance(self) -> dict[str, str]:
        """Origin of the bag and of the numbers."""
        return provenance(self.recording)

    @property
    def unmet(self) -> tuple[str, ...]:
        """A failure of the run, and those answers on its steps that are no."""
        failed = [f"FAILED: {why}" for why in [self.recording.failure] if why]
        wrong = [str(answer) for answer in verdict(self.recording) if answer.result is VerdictResult.NO]
        return (*failed, *wrong)

    def __repr__(self) -> str:
        return f"Analysis({self.recording.bag!r}, {self.recording.duration:.1f} s, {len(self.sections)} sections)"


def analyse(
    source: str | Path | Mapping[str, Any] | np.ndarray,
    progress: Progress,
    given: TopicMap = NOTHING_GIVEN,
    namespace: str = "",
) -> Analysis:
    """Read a bag and analyse it.

    Parameters
    ----------
    source : bag directory or file, of this stack or of another robot with JointState, WrenchStamped or mapped topics; a
        CSV file; or a table, such as a DataFrame, see `wam_analysis.foreign.tables.table_bag`.
    progress : called with each stage of the work.
    given : topics, joints, fields and units of another robot's bag.
    namespace : of an arm of this stack, '' for the one with the most topics.

    Raises
    ------
    BagError
        if the bag cannot be read, or is empty.
    ValueError
        if it has not what is given.
    """
    series: Mapping[str, Any] | None
    if isinstance(source, (str, Path)):
        path = Path(source)
        progress(f"reading {path}")
        series = series_of_csv(path) if path.suffix.lower() in (".csv", ".tsv", ".txt") else None
    else:
        path, series = Path("table"), series_of_frame(source)
    if series is None:
        found = read(path, ())
        if not any(found.counts.values()):
            raise BagError(f"{path} is empty: it has no message; record again while the nodes publish")
        if not any(given) and _is_own(found):
            return analyse_bag(read(path, TOPICS_READ, may_lack=True), progress, namespace)
    if namespace:
        raise ValueError(
            f"--namespace chooses an arm of this stack, but {path} is a recording of another robot; leave it out"
        )
    if series is None:
        progress("as a recording of another robot")
        bag = foreign_bag(found, given)
    else:
        bag, given = table_bag(path, series, given)
    return analyse_bag(bag, progress, given=given)


def analyse_steps(path: str | Path, namespace: str = "") -> Analysis:
    """Whether the steps of a scenario did what was commanded, and what was measured of them.

    Raises
    ------
    BagError
        if the bag cannot be read, or holds no step.
    """
    bag = read(Path(path), TOPICS_READ, may_lack=True)
    found = analyse_bag(bag, lambda doing: None, namespace, sections=SECTIONS_OF_STEPS)
    if not (found.recording.steps or found.recording.run.outcome):
        raise BagError(
            f"{path} holds no step of a scenario; "
            f"{command('wam analyse', path)} analyses any recording, {command('wam bag info', path)} lists its topics"
        )
    return found


def _is_own(found: Bag) -> bool:
    """Whether a bag is of this stack: by what its recorder left in it, or by its topics."""
    if PARAMETERS in found.attachments or RECORDING in found.metadata:
        return True
    spaces = [name[: -len(own)] for name, one in found.types.items() for own, kind in OWN_TOPICS.items()
              if name.endswith(f"/{own}") and one == kind]  # fmt: skip
    return any(spaces.count(space) > 1 for space in spaces)


def analyse_bag(
    bag: Bag,
    progress: Progress,
    namespace: str = "",
    given: TopicMap | None = None,
    sections: Sequence[Maker] = (),
) -> Analysis:
    """Analyse a bag that has been read, see `analyse`; `given` is None for one of this stack.

    Parameters
    ----------
    sections : which are made; all if empty.
    """
    recording = AnalysedRecording(bag, namespace, given)
    if recording.is_foreign and not recording.sources:
        raise BagError(f"{bag.path}: too few messages of joints or forces. {' '.join(unread(bag))}".rstrip())
    made = []
    for make in sections or (FOREIGN_SECTIONS if recording.is_foreign else SECTIONS):
        if (section := make(recording)) is not None:
            progress(section.title)
            made.append(section)
    return Analysis(recording, (_verdict(recording, made), *made))


def _verdict(recording: AnalysedRecording, sections: Sequence[Section]) -> Section:
    """Three lines: what the recording is, what is wrong with it, what it shows, first what was not predicted."""
    what = _foreign_line(recording) if recording.is_foreign else _own_line(recording)
    wrong = [(sentence, section.title) for section in sections for sentence in section.wrong]
    shows = [
        (sentence, section.title)
        for section in sorted(sections, key=lambda section: not deviations(section.findings))
        for sentence in section.shows
    ]
    right = [(f"{one}.", "Steps") for one in verdict(recording) if one.result is VerdictResult.YES]
    # that joints moved, or that nothing vibrated
    rest = [one for one in sections if one.key == ("stick_slip" if one.findings else "frequency")]
    shows = shows or right or [(sentence, one.title) for one in rest for sentence in one.sentences]
    problems = _line("Problems", wrong, "none found.")
    return Section("verdict", "Verdict", (what, problems, _line("Shows", shows, "nothing that can be evaluated.")))


def _line(title: str, found: list[tuple[str, str]], silent: str) -> str:
    """The first of some sentences in a line, and the sections with the others."""
    if not found:
        return f"{title}: {silent}"
    kept, rest = found[: LAYOUT.stated], found[LAYOUT.stated :]
    more = f" More below: {', '.join(dict.fromkeys(section for _, section in rest))}." * bool(rest)
    return f"{title}: {' '.join(sentence for sentence, _ in kept)}{more}"


def _foreign_line(recording: AnalysedRecording) -> str:
    """What another robot's recording is."""
    named = {(one.name, one.topic.rpartition("/")[0]) for one in recording.sources if one.is_joint}
    found = {  # a joint of one robot may be in topics of namespaces below its own
        "joint": [name for name, at in named if not any(at.startswith(f"{n}/") for o, n in named if o == name)],
        "wrench topic": {one.topic for one in recording.sources if not one.is_joint},
    }
    held = [counted(len(those), what) for what, those in found.items() if those]
    unused = [title for title, kind in recording.bag.types.items() if kind == UNUSED]
    is_assumed = bool(found["joint"]) and recording.given.units.keys().isdisjoint(("position", "velocity"))
    unit = " Joints taken as rotary (a linear one: --joint NAME --unit position=m)." * is_assumed
    line = f"Another robot's recording: {shown(recording.duration, 's')}, {' and '.join(held)}.{unit}"
    return f"{line} Not used: {'; '.join(unused)}; rename those that you need: {RENAMED}." if unused else line


def happened_section(recording: AnalysedRecording) -> Section:
    """What happened, in a few sentences."""
    run, zero = recording.run, recording.traces.zero
    faults = [*dict.fromkeys(f"driver fault at {(one.stamp - zero) / 1e9:.2f} s: {one.reason}" for one in run.faults)]
    wrong = [stated(run.others)] if run.others else []
    wrong += [f"INCOMPLETE: {line}" for line in recording.lost]
    wrong += [f"REFUSED: {one.sentence}." for one in run.refused]
    wrong += [f"STOPPED: {fault}." for fault in faults[:1]]
    wrong += [stated(recording.failure)] if recording.failure and not faults else []
    sentences = [*wrong, *map(stated, faults[1:]), *_changed(run, zero)]
    if recording.parameters.note:
        sentences.append(f"Some numbers have no prediction: {recording.parameters.note}.")
    if missing := run.lacking(*SHOWN):
        sentences.append(f"Not in this bag: {', '.join(missing)}.")
    return Section("happened", "What happened", sentences, wrong=wrong)


def _own_line(recording: AnalysedRecording) -> str:
    """What a recording of this stack is."""
    mode = "" if recording.mode == "unknown" else f" in {recording.mode}"
    text = f"{recording.namespace or '/'}: {shown(recording.duration, 's')}{mode}"
    steps = f", {counted(len(recording.steps), 'step')}" * bool(recording.steps)
    part = ", part of a longer recording" if recording.is_part else f", {Code.DONE}" * (recording.outcome == Code.DONE)
    return f"{text}{steps}{part}."


def _changed(run: RecordedRun, zero: int) -> Iterator[str]:
    """The changes of live parameters while the arm ran; zero is in ns."""
    newest, changes = dict[str, Any](), list[tuple[int, str, Any, Any]]()
    for stamp, values in run.live_values(*run.parameters.nodes):
        for key, value in values.items():
            node, _, name = key.partition(":")
            before = newest.get(key, run.parameters.nodes.get(node, {}).get(name))
            if before not in (None, value):
                changes.append((stamp, key, before, value))
            newest[key] = value
    if not changes:
        return
    statuses, named = run.stamped_statuses(), list[str]()
    for i, (stamp, key, before, value) in enumerate(changes[: LAYOUT.named], 1):
        end = next((later for later, other, *_ in changes[i:] if other == key), math.inf)
        lowered = _lowered(statuses, key, stamp, end)
        named.append(f"{key} from {before} to {value} at {(stamp - zero) / 1e9:.2f} s{lowered}")
    more = f" and {len(changes) - len(named)} more" * (len(changes) > len(named))
    yield f"Changed while it ran: {', '.join(named)}{more}. Predictions are for the values at the start."


def _lowered(statuses: Sequence[tuple[int, NodeStatus]], key: str, begin: int, end: float) -> str:
    """To what the guard lowered a parameter that had a value from one time to another, ns, '' where it did not."""
    node, _, name = key.partition(":")
    own = [status.facts for at, status in statuses if begin <= at < end and status.node == node]
    reported = next((i for i, facts in enumerate(own) if key in facts), -1)  # with what applied before
    text = next((facts["lowered"] for facts in own[reported + 1 :] if "lowered" in facts), "")
    return f", lowered by the guard to {text}" * (name in text)


SECTIONS_OF_STEPS: tuple[Maker, ...] = (happened_section, steps_section, force_section, contact_section)
SECTIONS: tuple[Maker, ...] = (
    happened_section, steps_section, force_section, cycle_section, contact_section, stick_section, friction_section,
    efficiency_section, timing_section,
)  # fmt: skip
FOREIGN_SECTIONS: tuple[Maker, ...] = (
    topics_section, step_section, following_section, repetition_section, stick_section, effort_section,
    spectrum_section, timing_section,
)  # fmt: skip
"""Each makes its section of a recording, or None where the recording has nothing for it."""
