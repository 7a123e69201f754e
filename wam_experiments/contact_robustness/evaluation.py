"""All degradations of some seeds on an executor, and the page docs/contact-robustness.md."""

from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import NamedTuple

from wam_description.configuration import Configuration
from wam_experiments.contact_robustness import degradations
from wam_experiments.contact_robustness.recording import Drive, DriveRecording, record
from wam_experiments.contact_robustness.replay import ReplayScore, replay
from wam_experiments.contact_robustness.rows import DETECTION, POSITION, SECOND, kinds_table, table
from wam_sim import pieces
from wam_sim.batch import Report, results

Groups = dict[str, list[ReplayScore]]  # scores by degradation


class DriveTrial(NamedTuple):
    """A drive, and the folder of recordings, '' for none."""

    drive: Drive
    folder: str


def drives(
    configuration: Configuration, seeds: Sequence[int], names: Sequence[str], seconds: float
) -> tuple[list[Drive], list[Drive], list[Drive]]:
    """A drive for each degradation and seed; the same with many second contacts; the same of arms identified before.

    Raises
    ------
    ValueError
        for a degradation that is not known.
    """
    for name in names:
        if name not in degradations.NAMES:
            raise ValueError(f"no degradation is named '{name}'; degradations: {', '.join(degradations.NAMES)}")
    every = [Drive(configuration, name, seed, seconds) for seed in seeds for name in names]
    identified = [drive._replace(is_identified=True) for drive in every if drive.degradation in degradations.IDENTIFIED]
    return every, [drive._replace(second=True) for drive in every], identified


def evaluate_trial(trial: DriveTrial) -> ReplayScore:
    """Record a drive, or read its recording from the folder, and score the estimator on it."""
    drive = trial.drive
    kind = " second" * drive.second + " identified" * drive.is_identified
    name = f"{drive.degradation} {drive.seed} {drive.seconds:g} s{kind}.recording"
    file = Path(trial.folder) / name.replace("/", " ")
    kept = pieces.read(file) if trial.folder else None
    recording: DriveRecording = record(drive) if kept is None else kept[0]
    if trial.folder and kept is None:
        pieces.write(file, recording)
    return replay(drive.configuration, drive.degradation, recording, drive.seed)


def evaluate(
    chosen: Sequence[Drive],
    executor: Executor,
    folder: Path | None = None,
    report: Report | None = None,
    recordings: Path | None = None,
) -> Groups:
    """Scores by degradation.

    Parameters
    ----------
    recordings : folder in which recordings are kept, so that another version can be scored on the same ones.

    The other arguments are those of `batch.results`.
    """
    if recordings is not None:
        pieces.require_own(recordings)
    kept = "" if recordings is None else str(recordings)
    scores = results(evaluate_trial, [DriveTrial(drive, kept) for drive in chosen], executor, folder, report)
    names = [name for name in degradations.NAMES if any(drive.degradation == name for drive in chosen)]
    return {name: [score for score in scores if score.degradation == name] for name in names}


def report_text(groups: Groups, second: Groups, identified: Groups) -> str:
    """The tables as text, of the drives as `drives` gives them."""
    every, after = ([score for own in each.values() for score in own] for each in (groups, identified))
    failures = sorted({f"{score.degradation}: {score.failure}" for score in every if score.failure})
    parts = [
        "## Detection",
        "",
        table(DETECTION, groups),
        "",
        "## Position on the outer link, and the link",
        "",
        table(POSITION, groups),
        "",
        "## By kind of contact, all degradations",
        "",
        kinds_table(every),
        "",
        "## Second contact",
        "",
        table(SECOND, {**second, "all": [score for own in second.values() for score in own]}),
        "",
        "## After an identification",
        "",
        table(DETECTION, {**identified, "all": after}),
        "",
        table(POSITION, {**identified, "all": after}),
    ]
    return "\n".join([*parts, *(f"\nEnded early: {failure}" for failure in failures)])


def page(text: str, command: str, before: str = "") -> str:
    """The page of the documentation; `before` is the page of another version, whose tables follow."""
    parts = [HEAD.format(command=command), text]
    if before:
        tables = before[before.index("## Detection") :].split("## Method")[0].rstrip()
        parts.append(
            "## The estimator before, on the same recordings\n\n"
            + tables.replace("\n## ", "\n### ").replace("## D", "### D", 1)
        )
    return "\n\n".join([*parts, METHOD])


HEAD = """# Contact estimation on arms that differ from what the estimator states

Written by `{command}`; nothing here is written by hand.

What the estimator states is in the section `contact_estimator` of the configuration; what is drawn is in
`wam_experiments/contact_robustness/degradations.py` (the arm and its signals) and `touches.py` (the contacts: 1 to
60 N, friction to 0.8, tip, end cap, elbow, two at once, sliding, impacts). Neither is read by the other. Every row
adds one degradation to friction within 10 % and masses within 2 %; contacts are drawn for each row. Numbers in
brackets are counts."""

METHOD = """## Method

* The plant is simulated with the degradation, the contacts are exact forces. Torque constant, torque noise, delay and
  dropped samples change the recorded signals; an error of the centre of mass is in the arm that the estimator is given;
  drift is added Coulomb friction of the joints. The estimator starts with the recording and has 6 s without contact.
* The estimate is evaluated 0.2 s after the start of a contact, if the arm moves then and moved at the start. A contact
  that is missed, has no position or a wrong link has an infinite error, written as inf.
* False alarm: a detection that starts without contact. Warned: share of the contact-free time with a warning that the
  model is off. Stated sd: rms over all joints in free motion; 68 % quantile for positions.
* Second contact: other recordings of the same arms, two of five contacts with a second one 0.5 s later, on the same
  link or on the other, of 4 to 60 N; the others are single for 1 s, constant, sliding at 0.2 m/s, or growing to 1.5 to
  3 times their force within 50 to 400 ms. False: reported while there is one, from 0.1 s after its start.
* After an identification: the contacts of the first table, the same arms, whose models come from `wam identify` on
  20 s of exciting motion; torque constant, delay and noise of the mix are not in that motion.
* Start in contact: an estimator that starts 0.1 s after the contact, with the model errors known (warm) or
  without (cold), detects it within 0.3 s; contacts of at least 9 N.
"""
