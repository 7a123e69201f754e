"""What became of the steps of a run, against recordings made by hand, whose answers are known."""

import itertools
import json
import math
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from wam_analysis import arm_picture
from wam_analysis.contact_list import CUT, NOT_PLACED, listed_contacts
from wam_analysis.findings.analysis import SECTIONS_OF_STEPS, TOPICS_READ, Analysis, analyse_bag, analyse_steps
from wam_analysis.findings.contact import BLIND
from wam_analysis.findings.finding import Section
from wam_analysis.findings.force import press_findings
from wam_analysis.findings.steps import verdict as answers
from wam_analysis.findings.text import text as analysis_text
from wam_analysis.recorded import prediction_parameters, recorded_arm
from wam_analysis.recording import AnalysedRecording
from wam_bag.bag import Bag, Columns, JointColumns, Messages, PointColumns, TableColumns, WrenchColumns
from wam_cli.commands.demo import _report
from wam_cli.main import main
from wam_control.task.scenario import load as load_steps
from wam_description.configuration import Configuration, packaged
from wam_description.event import Code, Event
from wam_description.event_text import REASONS
from wam_description.reasons import Reason
from wam_description.rigid_body import RigidBody
from wam_description.signals import Contact
from wam_description.topics import BY_NAME, HYPOTHESIS_COLUMNS
from wam_sim.reactions import RecordedReaction, in_words
from wam_sim.recorded_parameters import recorded_parameters
from wam_sim.recorded_run import recorded_run
from wam_sim.simulated_bag import record
from wam_studies.thesis.definition import load

MS = 1_000_000
PERIOD = 5 * MS
START = 200 * MS
STAMPS = START + PERIOD * np.arange(2000)  # 10 s
POSE = [0.0, -1.2, 0.0, 0.53]
STEPS = {"push outer": 0.0, "push inner": 2.0, "lower": 4.0, "press 8 N": 5.0, "press 4 N": 7.0, "lift": 9.0}
REASON = REASONS[Reason.MOMENT_ONLY]
PARAMETERS = "arm: {joints: "  # not YAML
NO_LIMIT = "without a commanded force, contacts stay below limits.contact_force: NOT EVALUATED, see below"
NO_TASK = TableColumns(STAMPS, STAMPS, ("base",) * len(STAMPS), np.arange(0), {"kind": np.zeros(0)})  # no axes


class Played:
    """A demonstration on paper: a link, a position and a force in each of its times, and what was estimated.

    Truth: pushes of 12 N at 0.28 m and of 15 N at 0.4 m; then a box, touched at 4.9 s with 3 N.
    """

    def __init__(self) -> None:
        k = len(STAMPS)
        self.true = [("base", (0.0, 0.0, 0.0), math.nan)] * k
        self.estimated = list(self.true)
        self.commanded = [("base", (0.0, 0.0, 0.0), math.nan)] * k
        self.push = list(self.commanded)
        self.measured = list(self.commanded)
        self.set(self.push, 0.5, 1.5, "outer_link", (0.0, 12.0, 0.0))
        self.set(self.true, 0.5, 1.5, "outer_link", (0.0, 12.0, 0.0), 0.28)
        self.set(self.estimated, 0.52, 1.55, "outer_link", (0.0, 11.0, 0.0), 0.30)
        self.set(self.push, 2.5, 3.5, "inner_link", (0.0, 15.0, 0.0))
        self.set(self.true, 2.5, 3.5, "inner_link", (0.0, 15.0, 0.0), 0.4)
        self.set(self.estimated, 2.5, 3.5, "inner_link", (0.0, 10.0, 0.0))
        self.set(self.true, 4.9, 9.2, "outer_link", (-1.0, 3.0, 0.0), 0.25)
        self.set(self.estimated, 4.93, 9.2, "outer_link", (0.0, 3.0, 0.0), 0.26)
        for begin, end, newtons in ((5.0, 7.0, 8.0), (7.0, 9.0, 4.0)):
            self.set(self.commanded, begin, end, "outer_link", (0.0, -newtons, 0.0))
            self.set(self.measured, begin, end, "outer_link", (0.0, -newtons, 0.0))
            self.set(self.true, begin, end, "outer_link", (-2.0, 1.05 * newtons, 0.0), 0.25)
            self.set(self.estimated, begin, end, "outer_link", (0.0, 0.98 * newtons, 0.0), 0.27)
        self.set(self.true, 5.0, 5.5, "outer_link", (0.0, 20.0, 0.0), 0.25)  # has died out in the steady state
        self.statuses = [(name, START + round(1e9 * at), 0) for name, at in STEPS.items()]
        self.statuses.append(("done", START + 10_000 * MS, 0))
        self.recording: dict[str, str] = {}
        self.namespace = "/wam"
        self.without: tuple[str, ...] = ()

    def set(
        self, series: list[Any], begin: float, end: float, frame: str, force: Any, position: float = math.nan
    ) -> None:
        rows = slice(round(begin * 200), round(end * 200))
        series[rows] = [(frame, force, position)] * len(series[rows])

    def bag(self) -> Bag:
        topics: dict[str, Columns] = {
            "force_command": wrenches(self.commanded),
            "force_measured": wrenches(self.measured),
            "contact/wrench": wrenches(self.estimated),
            "contact/point": points(self.estimated),
            "contact/hypotheses": hypotheses(self.estimated),
            "sim/contact/wrench": wrenches(self.true),
            "sim/contact/point": points(self.true),
            "sim/disturbance": wrenches(self.push),
            "sim/joint_states": joints(),
            "status": messages([status("driver", "braked"), *itertools.starmap(said, self.statuses)]),
        }
        kept = {f"{self.namespace}/{name}": columns for name, columns in topics.items() if name not in self.without}
        types = {f"{self.namespace}/{name}": BY_NAME[name].type for name in topics}
        attachments = {"parameters.yaml": PARAMETERS.encode()}
        return Bag(Path("bag"), kept, types, attachments, {"recording": self.recording})

    def summary(self) -> AnalysedRecording:
        return AnalysedRecording(self.bag())


def verdict(summary):
    return " | ".join(map(str, answers(summary)))


def analysed(bag: Bag, namespace: str = "") -> Analysis:
    return analyse_bag(bag, lambda doing: None, namespace, sections=SECTIONS_OF_STEPS)


def told(bag: Bag) -> str:
    """The report in one line."""
    return " ".join(analysis_text(analysed(bag), 100).split())


def section_of(bag: Bag, key: str) -> Section:
    return next(one for one in analysed(bag).sections if one.key == key)


def forces_of(recording: Played) -> dict[str, float]:
    """The numbers of all commanded forces."""
    return {one.name: one.measured for held in recording.summary().held for one in press_findings(held)}


def hypotheses(series: list[Any]) -> TableColumns:
    """A hypothesis of 97 % for each estimated contact; on the inner link its position is unknown for a reason."""
    rows = [i for i, (frame, _, _) in enumerate(series) if frame != "base"]
    inner = np.array([series[i][0] == "inner_link" for i in rows], float)
    known = {"probability": 0.97, "position_sd": 0.03, "force_sd": 0.5}
    columns = {name: np.full(len(rows), known.get(name, 0.0)) for name in HYPOTHESIS_COLUMNS}
    columns["reasons"] = inner * Reason.MOMENT_ONLY
    columns["is_lower_bound"] = inner
    columns["position"] = np.array([series[i][2] for i in rows])
    frames = tuple(series[i][0] for i in rows)
    return TableColumns(STAMPS[rows], STAMPS[rows], frames, np.arange(len(rows)), columns)


def wrenches(series: list[Any]) -> WrenchColumns:
    forces = np.array([force for _, force, _ in series])
    return WrenchColumns(STAMPS, STAMPS, tuple(frame for frame, _, _ in series), forces, np.zeros_like(forces))


def points(series: list[Any]) -> PointColumns:
    positions = np.array([(position, 0.0, 0.0) for _, _, position in series])
    return PointColumns(STAMPS, STAMPS, tuple(frame for frame, _, _ in series), positions)


def joints() -> JointColumns:
    names = ("joint1", "joint2", "joint3", "joint4")
    pose = np.tile(POSE, (len(STAMPS), 1))
    return JointColumns(STAMPS, STAMPS, ("",) * len(STAMPS), names, pose.copy(), pose, pose)


def messages(decoded: list[Any]) -> Messages:
    return Messages(np.zeros(len(decoded), np.int64), tuple(decoded))


def status(name: str, message: str, level: int = 0, **values: str) -> Any:
    pairs = [SimpleNamespace(key=key, value=value) for key, value in values.items()]
    return SimpleNamespace(name=name, message=message, level=level, values=pairs)


def said(message: str, stamp: int, level: int) -> Any:
    """A status of the scenario: of a step, or of its end."""
    step = {} if level or message == "done" else {"step": message}
    return status("scenario", message, level, stamp=str(stamp), **step)


def event(code: str, reason: str = "why") -> dict[str, str]:
    holds = {"event.1.holds": "1.0"} if code == "refused" else {}
    return {"event.1": code, "event.1.severity": "WARN", "event.1.reason": reason, **holds}


@pytest.mark.parametrize(
    ("begin", "end", "frame", "force", "expected"),
    [
        (7.0, 7.0, "base", 0.0, (4.2, 5.0, 4.0, 3.92)),  # not the 20 N of the begin, nor the friction along the link
        (7.0, 9.0, "outer_link", -4.0, (-4.0, -200.0, 4.0, 3.92)),  # pulls
        (8.0, 9.0, "base", 0.0, (0.0, -100.0, 4.0, 3.92)),  # a lost contact is no force
        (7.0, 9.0, "base", 0.0, (0.0, -100.0, 4.0, 3.92)),  # nor is one that never was
        (8.0, 9.0, "inner_link", 4.0, (math.nan, math.nan, 4.0, 3.92)),  # another link is not compared
    ],
)
def test_a_force_is_measured_in_its_steady_state_along_the_commanded_one(begin, end, frame, force, expected):
    recording = Played()
    recording.set(recording.true, begin, end, frame, (0.0, force, 0.0), 0.25)
    found = forces_of(recording)
    names = ("true force", "error of the true force", "measured force", "estimated force")
    assert [found[f"press 4 N: {name}"] for name in names] == pytest.approx(expected, nan_ok=True)
    free = (begin, end, force) == (7.0, 9.0, 0.0)
    words = "Forces: 1 of 2 within 10 %, largest error with ripple 5.0 %; nothing was touched: press 4 N."
    assert (words in told(recording.bag())) == free


def test_a_force_that_swings_is_not_right_because_its_mean_is():
    recording = Played()
    recording.set(recording.true, 8.2, 8.6, "outer_link", (0.0, 3.5, 0.0), 0.25)
    recording.set(recording.true, 8.6, 9.0, "outer_link", (0.0, 4.5, 0.0), 0.25)
    found = forces_of(recording)
    assert [found[f"press 4 N: {name} of the true force"] for name in ("error", "ripple")] == pytest.approx([0.0, 0.5])
    assert "force within 10 %: NO (12.5 %)" in verdict(recording.summary())
    assert "Forces: 1 of 2 within 10 %, largest error with ripple 12.5 %." in told(recording.bag())


def test_each_contact_is_compared_with_the_true_one():
    outer, inner, press, held, lifted = Played().summary().contacts
    assert (outer.true, outer.position_error, outer.force_error) == pytest.approx(("outer_link", 0.02, -1.0))
    assert (outer.latency, inner.latency, press.latency) == pytest.approx((0.025, 0.005, 0.035))
    assert (inner.true, held.step, lifted.step) == ("inner_link", "press 4 N", "lift")
    assert all(map(math.isnan, (inner.force_error, held.latency, lifted.latency)))  # a lower bound has no error
    recording = Played()
    recording.set(recording.estimated, 7.5, 9.0, "outer_link", (0.0, 3.0, 0.0))
    assert "estimated force [N] 7.84 >=3 error of the estimated force [%] -2 - " in told(recording.bag())


@pytest.mark.parametrize(
    ("series", "begin", "end", "link", "late"),
    [
        ("true", 4.95, 4.99, "base", 0.035),  # a bounce does not end a contact
        ("true", 4.80, 4.99, "base", -0.055),  # truly later: estimated before
    ],
)
def test_a_latency_counts_from_the_last_instant_without_contact(series, begin, end, link, late):
    recording = Played()
    recording.set(getattr(recording, series), begin, end, link, (0.0, 1.0 * (link != "base"), 0.0), 0.25)
    (found,) = (one.latency for one in recording.summary().contacts if math.isfinite(one.latency) and one.end > 5.0)
    assert found == pytest.approx(late)


@pytest.mark.parametrize("seconds", [0.15, 0.5, 0.9])
def test_a_force_that_is_commanded_for_less_than_a_second_has_no_steady_state(seconds):
    recording = Played()
    recording.set(recording.true, 7.0, 9.0, "outer_link", (0.0, 2.0, 0.0), 0.25)  # not yet 4 N
    recording.statuses[5] = ("lift", START + round(1e9 * (7.0 + seconds)), 0)
    recording.set(recording.commanded, 7.0 + seconds, 9.0, "base", (0.0, 0.0, 0.0))
    assert math.isnan(forces_of(recording).get("press 4 N: error of the true force", math.nan))
    shown = told(recording.bag())
    assert "force within 10 %: NOT EVALUATED, 1 of 2 forces constant for less than 1 s" in shown
    assert "Forces: 1 of 1 within 10 %, largest error with ripple 5.0 %." in shown
    is_hold = "press 4 N: 4 N commanded on outer_link for less than 1 s, so" in shown
    assert is_hold == (seconds > 0.3)  # else it may be part of a ramp


def thinned(columns: WrenchColumns, kept: Any) -> WrenchColumns:
    frames = tuple(columns.frames[i] for i in kept)
    return WrenchColumns(STAMPS[kept], STAMPS[kept], frames, columns.force[kept], columns.torque[kept])


def test_without_contact_point_the_position_is_that_of_the_hypotheses_and_no_force_becomes_a_lower_bound():
    recording = Played()
    recording.without = ("contact/point",)
    outer, inner, *_ = recording.summary().contacts
    assert (outer.is_lower_bound, outer.position) == (False, pytest.approx(0.30))
    assert inner.is_lower_bound
    assert verdict(recording.summary()) == verdict(Played().summary())


def test_where_no_position_was_recorded_that_is_reported_and_no_force_is_a_lower_bound():
    recording = Played()
    recording.without = ("contact/point", "contact/hypotheses")
    summary = recording.summary()
    assert not any(one.is_lower_bound for one in summary.contacts)
    assert all(math.isnan(one.force_error) for one in summary.contacts)  # the force may be the least one
    section = section_of(recording.bag(), "contact")
    assert f"Positions of contacts: {NOT_PLACED}." in section.sentences
    errors = [one for one in section.findings if one.quantity == "error of the median force"]
    assert {one.note for one in errors} == {"not known: the force may be a lower bound"}
    recording.without = ("contact/hypotheses",)  # with contact/point it is known
    outer, inner, *_ = recording.summary().contacts
    assert (outer.force_error, inner.is_lower_bound) == (pytest.approx(-1.0), True)
    assert math.isnan(inner.force_error)


def with_limits(recording: Played, *others: str) -> Bag:
    """The same, with the parameters of the force loop, of other nodes, and a status of it in the last step."""
    sections = Configuration.load(packaged("wam")).sections
    content = "".join(  # one by one: a dump of both would have anchors
        yaml.safe_dump({f"/wam/{node}": {"ros__parameters": {**sections["/**"], **sections[node]}}})
        for node in ("force_loop", *others)
    )
    bag = recording.bag()
    reacts = status("force_loop", "at least 81 N", stamp=str(START + 9300 * MS), **event("pushed", "at least 81 N"))
    stated = messages([*itertools.starmap(said, recording.statuses), reacts])
    topics = {**bag.topics, "/wam/status": stated, "/wam/task_command": NO_TASK}
    return bag._replace(topics=topics, attachments={"parameters.yaml": content.encode()})


def test_a_contact_in_motion_that_is_harder_than_allowed_is_in_the_verdict():
    recording = Played()
    recording.set(recording.true, 9.2, 9.6, "outer_link", (0.0, 80.0, 0.0), 0.25)
    recording.set(recording.estimated, 9.2, 9.6, "outer_link", (0.0, 70.0, 0.0), 0.25)
    assert AnalysedRecording(with_limits(recording)).unplanned.hard == ()
    recording.set(recording.true, 9.4, 9.5, "outer_link", (0.0, 157.0, 0.0), 0.25)
    summary = AnalysedRecording(with_limits(recording))
    assert summary.unplanned.unknown == ""
    answer = [*answers(summary)][-1]
    assert str(answer) == "without a commanded force, contacts stay below 90 N: NO (157 N)"
    said = "lift: TOO HARD: a contact with 157 N (true, at 9.60 s)"
    assert any(one.startswith(said) for one in section_of(with_limits(recording), "contact").wrong)


@pytest.mark.parametrize(
    ("off", "at", "rise", "answer"),
    [(0.01, 4.9, 0.1, "YES (0.01"), (0.1, 4.9, 0.1, "NO (0.1 rad in step l"), (0.0, 5.4, 0.1, "YES"),
     (0.0, 5.6, 0.1, "NO (0.5"), (0.1, 4.9, 1.0, "")],
)  # fmt: skip
def test_a_posture_is_reached_that_the_arm_comes_to_at_the_end_of_its_step_or_soon_after(off, at, rise, answer):
    """Unless the step ends before its motion."""
    goal, arm, bag = joints(), joints(), with_limits(Played(), "driver")
    goal.position[:, 3] += 0.5 * np.clip((np.arange(len(STAMPS)) / 200.0 - 4.5) / rise, 0.0, 1.0)
    arm.position[round(200 * at) :, 3] += 0.5 - off
    bag = bag._replace(topics={**bag.topics, "/wam/joint_posture_command": goal, "/wam/sim/joint_states": arm})
    found = verdict(AnalysedRecording(bag))
    assert found.startswith(f"posture within 0.02 rad: {answer}") if answer else "posture" not in found
    alone = {name: columns for name, columns in bag.topics.items() if "joint" in name or "status" in name}
    shows = analysed(bag._replace(topics=alone)).sections[0].sentences[2]
    assert ("Shows: posture within" in shows) == answer.startswith("YES")


@pytest.mark.parametrize(
    ("lacks", "declared", "said"),
    [("", 0.23, ""), ("", 0.2, "true position 25"), ("sim/contact/point", 0.2, ""),
     ("sim/contact/point", 0.15, "estimated position 27 +- 3")],
)  # fmt: skip
def test_a_declared_position_is_in_the_table_and_a_defect_where_it_is_not_the_true_or_the_estimated_one(
    lacks, declared, said
):
    recording = Played()
    recording.without = (lacks,)
    bag = with_limits(recording)
    command = bag.topics["/wam/force_command"]
    command.torque[:, 1:] = declared * np.column_stack([-command.force[:, 2], command.force[:, 1]])
    found = section_of(bag, "contact")
    numbers = [one.measured for one in found.findings if one.quantity == "declared position"]
    assert numbers[:3] == pytest.approx([math.nan, math.nan, 100.0 * declared], nan_ok=True)
    stated = [f"3 outer_link: declared position {100.0 * declared:g} cm, {said} cm."] * bool(said)
    assert [one for one in found.wrong if one.startswith("3 outer_link: declared")] == stated


def nothing_but(true: tuple[float, float, str, float], estimated: tuple[float, float, str, float]) -> Played:
    """A recording with one true and one estimated contact: begin, end, link and N."""
    recording = Played()
    for series in (recording.true, recording.estimated, recording.push, recording.commanded, recording.measured):
        recording.set(series, 0.0, 10.0, "base", (0.0, 0.0, 0.0))
    for series, (begin, end, link, newtons) in ((recording.true, true), (recording.estimated, estimated)):
        recording.set(series, begin, end, link, (0.0, newtons, 0.0), 0.28)
    return recording


def test_where_the_allowed_force_is_not_known_no_contact_is_shown_to_be_soft_enough():
    hit = (1.0, 2.0, "outer_link", 200.0)
    recording = nothing_but(hit, hit)
    odd = with_limits(recording)
    odd.topics["/wam/status"].messages[0].values.append(
        SimpleNamespace(key="force_loop:limits.contact_force", value="x")
    )
    for bag in (recording.bag(), odd):
        summary = AnalysedRecording(bag)
        assert str([*answers(summary)][-1]) == NO_LIMIT
        assert any(one.startswith("It is not known whether a contact") for one in section_of(bag, "contact").wrong)
    nothing = nothing_but((1.0, 1.0, "base", 0.0), (1.0, 1.0, "base", 0.0))
    assert AnalysedRecording(nothing.bag()).unplanned == ((), "")
    elsewhere = with_limits(recording)  # a setting of a node that was not recorded
    elsewhere.topics["/wam/status"].messages[0].values.append(SimpleNamespace(key="driver:world.box", value="1"))
    assert len(AnalysedRecording(elsewhere).unplanned.hard) == 1


def without_rows(bag: Bag, topic: str, begin: float, end: float) -> Bag:
    """A bag without the messages of a topic between two times, s."""
    columns = bag.topics[f"/wam/{topic}"]
    time = (columns.stamp_ns - START) / 1e9
    kept = np.flatnonzero((time < begin) | (time >= end))
    if isinstance(columns, TableColumns):
        frames = tuple(columns.frames[i] for i in kept)
        rows = np.isin(columns.message, kept)
        message = np.searchsorted(kept, columns.message[rows])
        values = {name: column[rows] for name, column in columns.columns.items()}
        left: Columns = TableColumns(STAMPS[kept], STAMPS[kept], frames, message, values)
    else:
        left = thinned(columns, kept)
    return bag._replace(topics={**bag.topics, f"/wam/{topic}": left})


@pytest.mark.parametrize("topic", ["sim/disturbance", "force_command", "task_command"])
def test_where_messages_of_a_command_are_lost_it_is_not_known_what_was_commanded(topic):
    """A program may pause; of what the recorder lost it is not known what it commanded."""
    hit = (3.0, 4.0, "outer_link", 120.0)
    bag = without_rows(with_limits(nothing_but(hit, hit)), topic, 2.0, 5.0)
    number = len(bag.topics[f"/wam/{topic}"].stamp_ns)
    for received, dropped, is_lost in ((number, 0, False), (number + 3, 0, True), (number, 3, True)):
        counts = {f"/wam/{topic} press received": str(received), f"/wam/{topic} press dropped": str(dropped)}
        counted = bag._replace(metadata={"recording": counts}, counts={f"/wam/{topic}": number})
        hard, unknown = AnalysedRecording(counted).unplanned
        assert [one.force for one in hard] == [120.0] * (not is_lost)
        doubt = f"one had 120 N, and what may have been commanded then was not recorded ({topic})"
        assert unknown == doubt * is_lost


def test_a_force_is_held_through_a_gap_of_its_command_as_by_the_arm():
    for after, parts in ((5.705, [(5.0, 5.5), (5.705, 7.0)]), (5.695, [(5.0, 7.0)])):  # s; ages.command is 0.2 s
        found = AnalysedRecording(without_rows(with_limits(Played()), "force_command", 5.5, after))
        times = [((hold.begin - START) / 1e9, (hold.end - START) / 1e9) for hold in found.holds]
        assert times == [*parts, (7.0, 9.0)]
        assert np.all(found.traces.commanded.is_known[found.traces.stamp < START + 5.69e9])


def test_a_contact_that_is_seen_for_a_moment_is_missed():
    recording = nothing_but((1.0, 4.0, "outer_link", 10.0), (1.0, 1.1, "outer_link", 9.0))
    recording.set(recording.push, 1.0, 4.0, "outer_link", (0.0, 10.0, 0.0))
    recording.statuses = [("push", START, 0), ("done", START + 5000 * MS, 0)]
    summary = recording.summary()
    assert [missed.link for missed in summary.missed] == ["outer_link"]
    assert "correct link: NO (missed)" in verdict(summary)
    recording.set(recording.estimated, 1.0, 2.6, "outer_link", (0.0, 9.0, 0.0), 0.28)
    assert "correct link: YES" in verdict(recording.summary())


def test_without_truth_the_estimate_shows_what_was_too_hard():
    recording = without_truth(Played())
    recording.set(recording.estimated, 9.4, 9.5, "outer_link", (0.0, 115.0, 0.0), 0.25)
    for mode in ("lockstep", "realtime"):  # of a simulated arm, which may have been pushed
        recording.recording = {"mode": mode}
        assert AnalysedRecording(with_limits(recording)).unplanned.hard == ()
    bag = with_limits(recording)
    of_bus = yaml.safe_load(bag.attachments["parameters.yaml"])
    own = of_bus["/wam/force_loop"]["ros__parameters"]
    own["nodes"] = ["bus_driver:OwnInterface" if node == "driver" else node for node in own["nodes"]]
    (hard,) = AnalysedRecording(
        bag._replace(attachments={"parameters.yaml": yaml.safe_dump(of_bus).encode()})
    ).unplanned.hard
    assert (hard.force, hard.allowed, hard.source) == (115.0, 90.0, "estimated")


def test_a_push_a_commanded_force_or_a_contact_in_a_task_is_not_unplanned():
    recording = Played()
    recording.set(recording.push, 0.5, 1.5, "outer_link", (0.0, 120.0, 0.0))
    recording.set(recording.true, 0.5, 1.52, "outer_link", (0.0, 120.0, 0.0), 0.28)  # it ends later than its command
    recording.set(recording.true, 5.0, 5.5, "outer_link", (0.0, 120.0, 0.0), 0.25)
    assert AnalysedRecording(with_limits(recording)).unplanned.hard == ()
    recording.set(recording.true, 9.2, 9.6, "outer_link", (0.0, 157.0, 0.0), 0.25)
    bag = with_limits(recording)
    axis = {"kind": np.zeros(len(STAMPS))}
    task = TableColumns(STAMPS, STAMPS, ("base",) * len(STAMPS), np.arange(len(STAMPS)), axis)
    assert AnalysedRecording(bag._replace(topics={**bag.topics, "/wam/task_command": task})).unplanned.hard == ()
    assert len(AnalysedRecording(bag._replace(topics={**bag.topics, "/wam/task_command": NO_TASK})).unplanned.hard) == 1


@pytest.mark.slow
def test_a_failed_task_leaves_a_report(tmp_path, capsys):
    steps = [
        {"name": "enable", "seconds": 0.1, "request": "enable"},
        {"name": "lower onto nothing", "seconds": 0.3, "posture": POSE, "until_force": 1.5},
    ]
    task = load("follow-surface")
    script, bag = tmp_path / "script.yaml", tmp_path / "bag"
    script.write_text(json.dumps({"steps": steps}))
    configuration = Configuration.load(packaged("wam"))
    assert "no contact" in record(configuration, load_steps(script, configuration.shared), bag)
    assert _report(bag, True, task) is not None
    out, err = capsys.readouterr()
    assert "no report of task follow-surface" in err
    assert "Problems: Step 'lower onto nothing'" in out


@pytest.mark.slow
def test_a_gain_that_the_guard_lowered_is_reported_as_it_was_just_after_the_change(tmp_path):
    steps = [
        {"name": "enable", "seconds": 0.1, "request": "enable"},
        {"name": "give", "seconds": 0.6, "set": {"force_loop": {"force_gain": [0.5]}}, "posture": POSE},
        {"name": "give more", "seconds": 0.1, "set": {"force_loop": {"limits.doubt": 2.0}}},
    ]
    script, bag = tmp_path / "script.yaml", tmp_path / "bag"
    script.write_text(json.dumps({"steps": steps}))
    configuration = Configuration.load(packaged("wam"))
    assert record(configuration, load_steps(script, configuration.shared), bag) == ""
    found = analyse_steps(bag)
    statuses = found.recording.run.statuses
    lowered = list(dict.fromkeys(status.facts["lowered"] for status in statuses if "lowered" in status.facts))
    assert len(lowered) == 3, "nothing, and a gain in each pose"
    assert f"to [0.5] at 0.10 s, lowered by the guard to {lowered[1]}, " in " ".join(analysis_text(found).split())


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_during_the_report_of_a_demo_leaves_where_the_recording_is_and_how_to_report_it(number):
    """The signal comes where the report begins, as it imports its modules."""
    bag = Path(__file__).parents[2] / "bags" / "sample" / "wam-touch"
    program = f"""
import os, sys
from pathlib import Path
from wam_cli.commands.demo import stoppable_report
class Signalling:
    def find_spec(self, name, *_):
        if name == "wam_analysis.findings.analysis":
            os.kill(os.getpid(), {number})
sys.meta_path.insert(0, Signalling())
stoppable_report(Path("{bag}"), False, None)
"""
    done = subprocess.run([sys.executable, "-P", "-c", program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (128 + number, "")
    assert done.stderr.strip().endswith(f"the recording is in {bag}; to print the report: wam analyse {bag} --steps")


def test_good_run_has_a_good_verdict():
    summary = Played().summary()
    assert verdict(summary) == (
        "force within 10 %: YES (5.0 %) | correct link: YES (98 % of each contact, required: 50 %) | "
        "position within 4 cm: YES (2.0 cm), contact 2 (inner_link) not evaluated: position unknown | "
        f"at most 10 % false contact: YES (1.4 % of the time without contact) | {NO_LIMIT}"
    )


def test_each_fault_turns_its_own_verdict():
    force, link, position = Played(), Played(), Played()
    force.set(force.true, 7.0, 9.0, "outer_link", (0.0, 4.5, 0.0), 0.25)
    link.set(link.estimated, 0.52, 1.5, "inner_link", (0.0, 11.0, 0.0))
    position.set(position.estimated, 0.52, 1.5, "outer_link", (0.0, 11.0, 0.0), 0.33)
    assert "force within 10 %: NO (12.5 %) | correct link: YES" in verdict(force.summary())
    assert "correct link: NO (another link than " in verdict(link.summary())
    assert "correct link: YES" in verdict(position.summary())
    assert "position within 4 cm: NO (5.0 cm)" in verdict(position.summary())
    position.set(position.estimated, 0.52, 1.5, "outer_link", (0.0, 11.0, 0.0), 0.3203)
    assert "position within 4 cm: NO (4.03 cm)" in verdict(position.summary()), "a value that fails is not its limit"


def test_each_contact_of_a_real_arm_has_its_time_link_position_and_force_with_their_uncertainty():
    recording = Played()
    without_truth(recording)
    outer, inner, *pressed = recording.summary().contacts
    assert (outer.begin, outer.end, outer.step) == pytest.approx((0.72, 1.745, "push outer"))
    assert (outer.link, outer.probability, outer.position, outer.position_sd) == ("outer_link", 0.97, 0.30, 0.03)
    assert (outer.force, outer.force_sd) == pytest.approx((11.0, 0.5))
    assert (outer.is_lower_bound, outer.true) == (False, "")
    assert math.isnan(outer.position_error)
    assert (inner.is_lower_bound, inner.reasons) == (True, (REASON,))
    assert math.isnan(inner.position)
    assert [one.step for one in pressed] == ["press 8 N", "press 4 N", "lift"]
    assert [one.force for one in pressed] == pytest.approx([7.84, 3.92, 3.0])
    shown = told(recording.bag())
    numbers = {one.name: one.measured for one in section_of(recording.bag(), "contact").findings}
    names = ("from", "probability of the link", "position along the link", "force")
    assert [numbers[f"1 outer_link: {name}"] for name in names] == pytest.approx([0.72, 97.0, 30.0, 11.0])
    assert "30 +- 3" in shown
    assert REASON in shown
    assert "missed" not in shown  # of what was not recorded nothing is known


def test_times_by_the_clock_of_a_system_count_from_the_start_of_the_recording():
    """A real arm stamps with that clock; in the simulation the arm's time begins with the run."""
    run, summary = recorded_run(Played().bag()), Played().summary()
    clock = 1_763_800_000_000_000_000
    traces = summary.traces._replace(stamp=summary.traces.stamp + clock)
    first, *_ = listed_contacts(run, traces, ())
    assert (first.begin, first.end) == pytest.approx((0.52, 1.545))
    assert (summary.traces.zero, traces.zero) == (0, START + clock)
    reaction = RecordedReaction(
        clock + START + 5000 * MS,
        clock + START + 7000 * MS,
        Event(Code.REFUSED, values={"reason": "why", "holds": 1.0}),
    )
    assert in_words("press", [reaction], traces.zero) == [("press: refused from 5.00 to 7.00 s", "why")]


def without_truth(recording: Played) -> Played:
    recording.without = tuple(name for name in TOPICS_READ if name.startswith("sim/"))
    return recording


def test_a_position_known_for_a_moment_is_not_that_of_the_whole_contact():
    recording = Played()
    recording.set(recording.estimated, 0.52, 1.55, "outer_link", (0.0, 11.0, 0.0))
    recording.set(recording.estimated, 0.52, 0.54, "outer_link", (0.0, 11.0, 0.0), 0.30)  # 2 % of it
    summary = recording.summary()
    found = summary.contacts[0]
    assert math.isnan(found.position)
    assert math.isnan(found.position_sd)
    assert found.is_lower_bound
    assert "YES (2.0 cm), contact 1 (outer_link), 2 (inner_link) not evaluated: position unknown" in verdict(summary)
    recording.set(recording.estimated, 0.52, 1.2, "outer_link", (0.0, 11.0, 0.0), 0.30)  # two thirds of it
    assert recording.summary().contacts[0].position == pytest.approx(0.30)


def test_a_contact_is_cut_where_the_estimate_was_lost():
    bag = Played().bag()
    kept = np.r_[0:1200, 1260:2000]  # from 6.0 to 6.3 s nothing came
    estimated = bag.topics["/wam/contact/wrench"]
    lost = WrenchColumns(
        STAMPS[kept],
        STAMPS[kept],
        tuple(estimated.frames[i] for i in kept),
        estimated.force[kept],
        estimated.torque[kept],
    )
    bag = bag._replace(topics={**bag.topics, "/wam/contact/wrench": lost})
    summary = AnalysedRecording(bag)
    pressed = [one.cut for one in summary.contacts if one.step == "press 8 N"]
    assert pressed == [("", CUT[1][1]), (CUT[0][1], "")]
    stated = section_of(bag, "contact").sentences
    assert not any("of the recording" in one or "before the recording" in one for one in stated)
    assert "3 outer_link: the estimate is missing after it." in stated
    assert "4 outer_link: the estimate is missing before it." in stated


def test_without_contact_topics_the_estimate_is_not_recorded_and_not_none():
    recording = Played()
    recording.without = ("contact/wrench", "contact/point", "contact/hypotheses")
    assert not section_of(recording.bag(), "contact").wrong[1:]  # that the allowed force is not known
    recording.without += without_truth(Played()).without
    assert "The estimated contact was not recorded." in section_of(recording.bag(), "contact").sentences
    recording = without_truth(Played())
    recording.set(recording.estimated, 0.0, 10.0, "base", (0.0, 0.0, 0.0))
    assert not recording.summary().contacts


@pytest.mark.parametrize("sensors", [True, False])
def test_under_the_brakes_no_contact_is_missed_where_the_motors_alone_are_observed(sensors):
    recording = Played()
    recording.set(recording.true, 8.0, 10.0, "outer_link", (0.0, 4.0, 0.0), 0.25)
    recording.set(recording.estimated, 9.0, 10.0, "base", (0.0, 0.0, 0.0))
    bag = recording.bag()
    braked = status("driver", "braked", mode="braked", stamp=str(START + 9000 * MS))
    stated = messages([*itertools.starmap(said, recording.statuses), braked])
    sections = Configuration.load(packaged("wam")).sections
    own = {**sections["/**"], **sections["contact_estimator"], "use_joint_sensors": sensors}
    content = yaml.safe_dump({"/wam/contact_estimator": {"ros__parameters": own}})
    bag = bag._replace(topics={**bag.topics, "/wam/status": stated}, attachments={"parameters.yaml": content.encode()})
    summary = AnalysedRecording(bag)
    assert ("correct link: NO (missed)" in verdict(summary)) == sensors
    assert ("correct link: YES" in verdict(summary)) != sensors
    assert (BLIND in section_of(bag, "contact").sentences) != sensors


@pytest.mark.parametrize(("seconds", "answer"), [(0.3, "YES (9.5 %"), (0.35, "NO (10.8 %"), (0.9, "NO (25.7 %")])
def test_contacts_that_are_estimated_where_none_is_are_part_of_the_verdict(seconds, answer):
    recording = Played()
    recording.set(recording.estimated, 1.6, 1.6 + seconds, "inner_link", (0.0, 5.0, 0.0), 0.2)
    assert f"false contact: {answer}" in verdict(recording.summary())
    contact = section_of(recording.bag(), "contact")
    listed, other = (contact.wrong, contact.shows)[:: -1 if answer.startswith("YES") else 1]
    assert "False contacts: 1 of 6." in listed
    assert "False contacts: 1 of 6." not in other
    assert {one.subject for one in contact.findings if "false" in one.subject} == {"2 inner_link false"}


def test_a_contact_that_ends_late_in_a_short_time_without_one_is_no_false_detection():
    recording = Played()
    recording.set(recording.true, 0.0, 9.2, "outer_link", (0.0, 12.0, 0.0), 0.25)
    recording.set(recording.estimated, 0.0, 9.4, "outer_link", (0.0, 12.0, 0.0), 0.25)
    answer = "false contact: NOT EVALUATED, only 200 ms, which is normal when a contact ends"
    assert answer in verdict(recording.summary())


def test_a_contact_that_goes_over_to_another_link_is_two_and_a_moment_of_another_is_none():
    recording = Played()
    recording.set(recording.estimated, 1.0, 1.55, "inner_link", (0.0, 25.0, 0.0))
    recording.set(recording.estimated, 0.7, 0.75, "inner_link", (0.0, 5.0, 0.0))
    outer, inner, *_ = recording.summary().contacts
    assert [outer.link, inner.link] == ["outer_link", "inner_link"]
    assert (outer.begin, outer.end, inner.begin) == pytest.approx((0.72, 1.195, 1.2))
    assert (outer.force, inner.force) == pytest.approx((11.0, 25.0))


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in TOPICS_READ if not name.startswith("/")])
def test_missing_topic_is_said_and_nothing_is_invented(name):
    recording = Played()
    recording.without = (name,)
    summary = recording.summary()
    sections = analysed(recording.bag()).sections
    if name in ("force_command", "force_measured") or name.endswith(("contact/wrench", "contact/point")):
        assert any(f" {name}" in one for one in sections[1].sentences if one.startswith("Not in this bag:"))
    if name == "sim/contact/wrench":
        assert "force within 10 %: NOT EVALUATED | correct link: NOT EVALUATED" in verdict(summary)
    if name == "contact/wrench":
        assert all(math.isnan(held.accuracy["estimated"].bias) for held in summary.held)


def test_a_section_that_asks_for_a_topic_that_was_not_read_is_told_so():
    recording = AnalysedRecording(Played().bag()._replace(counts={"/wam/motor_states": 7}))
    with pytest.raises(LookupError, match="has /wam/motor_states, but it was not read"):
        recording.run.joints("motor_states")
    assert recording.run.joints("joint_sensors") is None  # it is not in the bag


def test_empty_bag_gives_a_report():
    empty = Bag(Path("bag"), {}, {}, {}, {})
    summary = AnalysedRecording(empty)
    assert not verdict(summary)
    assert "No commanded force was constant" in told(empty)


def test_contact_lies_on_the_surface_of_its_cover_on_the_side_that_is_pushed():
    arm = Configuration.load(packaged("wam")).shared.arm
    point, force = arm_picture.contact_on_surface(arm, POSE, Contact("outer_link", 0.25, (-2.0, 8.0, 0.0)))
    pose = RigidBody(arm).cover_pose(POSE, "outer_link")
    radius = arm.covers.radius[arm.covers.names.index("outer_link")]
    np.testing.assert_allclose(pose.rotation.T @ (point - pose.position), [0.25, -radius, 0.0], atol=1e-12)
    np.testing.assert_allclose(pose.rotation.T @ force, [-2.0, 8.0, 0.0], atol=1e-12)


def with_outcome(folder, *statuses: tuple[str, str, int]):
    """A bag on disk with these statuses alone: node, message, level; one a second."""
    store = get_typestore(Stores.ROS2_JAZZY)
    kinds = {kind: store.types[f"diagnostic_msgs/msg/{kind}"] for kind in ("DiagnosticStatus", "KeyValue")}
    kind = "diagnostic_msgs/msg/DiagnosticStatus"
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/wam/status", kind, typestore=store)
        for stamp, (node, text, level) in enumerate(statuses, 1):
            facts = {"stamp": str(stamp * 10**9), **({"fault": text} if level and node == "driver" else {})}
            facts |= {"step": text} if node == "scenario" and text != "done" and not level else {}
            values = [kinds["KeyValue"](key, value) for key, value in facts.items()]
            message = kinds["DiagnosticStatus"](level, node, text, "", values)
            writer.write(connection, stamp, store.serialize_cdr(message, kind))
    return folder


@pytest.mark.parametrize(
    ("first", "last", "failure"),
    [
        ("scenario", ("scenario", "done", 0), ""),
        ("scenario", ("scenario", "step 'lower': no contact of 1.5 N within 0.7 s", 2), "step 'lower': no contact"),
        ("scenario", ("driver", "speed of joint4 is above its limit", 2), "speed of joint4"),
        ("scenario", ("driver", "enabled", 0), ""),  # the recording ends before the scenario does
        ("driver", ("scenario", "step 'lower': the motion takes 3 s", 2), "step 'lower': the motion"),  # not begun
    ],
)
def test_the_report_of_a_run_that_failed_ends_with_exit_code_1(tmp_path, capsys, first, last, failure):
    bag = with_outcome(tmp_path / "bag", (first, "lower", 0), last)
    with pytest.raises(SystemExit) as ended:
        main(["analyse", str(bag), "--steps"])
    assert ended.value.code == int(bool(failure))
    assert ("checks failed" in capsys.readouterr().out) is bool(failure)
    assert [one.partition(failure)[:2] for one in analyse_steps(bag).unmet] == [("FAILED: ", failure)] * bool(failure)


def test_a_recording_without_a_step_is_refused_with_what_analyses_it(tmp_path, capsys):
    bag = with_outcome(tmp_path / "bag", ("driver", "enabled", 0))
    with pytest.raises(SystemExit) as ended:
        main(["analyse", str(bag), "--steps"])
    assert ended.value.code == 2
    assert f"no step of a scenario; 'wam analyse {bag}' analyses any recording" in capsys.readouterr().err


def test_arm_is_drawn_with_the_parameters_in_the_bag():
    sections = Configuration.load(packaged("wam")).sections
    flat = {**sections["/**"], **sections["driver"], "arm.covers.radius": [0.1, 0.05]}
    content = yaml.safe_dump({"/wam/driver": {"ros__parameters": flat}}).encode()
    bag = Played().bag()._replace(attachments={"parameters.yaml": content})
    recorded = recorded_arm(prediction_parameters(recorded_parameters(bag, "/wam")))
    assert recorded.note == ""
    assert recorded.arm.covers.radius == (0.1, 0.05)
    assert recorded.world.obstacles.names == ("foam_box",)
