"""Forces and tasks that were refused or doubted are seen in analysis and report, with reason and time."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from wam_analysis.findings.analysis import Analysis, analyse_bag
from wam_analysis.findings.held_force import HeldForce
from wam_analysis.findings.steps import verdict
from wam_analysis.findings.text import text
from wam_analysis.recording import AnalysedRecording
from wam_bag.bag import Bag, TableColumns, read
from wam_control.task.scenario import load
from wam_description.configuration import Configuration, packaged
from wam_description.event import Code, Event
from wam_sim.reactions import RecordedReaction, in_words, within
from wam_sim.simulated_bag import record

SAMPLES = Path(__file__).parents[2] / "bags" / "sample"
STEPS = """
- {name: release the brakes, seconds: 0.3, request: enable}
- {name: nearly straight, seconds: 1.5, posture: [0.0, -1.2, 0.0, 0.05]}
- {name: too small, seconds: 1.0, force: {frame: outer_link, newtons: [0.0, -0.2, 0.0]}}
- {name: no force, seconds: 0.4}
- {name: above the limit, seconds: 0.6, force: {frame: outer_link, newtons: [0.0, -80.0, 0.0]}}
- name: one place twice
  seconds: 0.6
  task:
    axes:
      - {force: 8.0, along: [0, 0, -1], cover: outer_link, contact_position: 0.28}
      - {force: 8.0, along: [0, 0, -1], cover: outer_link, contact_position: 0.27}
- {name: to the box, seconds: 2.0, posture: [0.0, -1.9, 0.0, 1.45]}
- {name: lower, seconds: 4.0, posture: [0.0, -2.1, 0.0, 1.45], until_force: 1.5}
- {name: press across, seconds: 1.2, force: {frame: outer_link, newtons: [0.0, -8.0, 0.0]}}
- name: press across by a task
  seconds: 1.2
  task: {frame: outer_link, axes: [{force: 8.0, along: [0, -1, 0], cover: outer_link, contact_position: 0.26}]}
- {name: brake, seconds: 0.2, request: disable}
"""
REFUSED = {
    "too small": ("refused", "cannot be controlled because of"),
    "above the limit": ("refused", "allowed: up to force_limit, 60 N"),
    "one place twice": ("refused", "may be wrong by"),
}


TORQUES = """
- {name: release the brakes, seconds: 0.3, request: enable}
- {name: too much, seconds: 0.6, torque: [0, 0, 0, 50]}
- {name: nothing there, seconds: 3.0, torque: [0, 0, 0, 2]}
- {name: none, seconds: 1.0, torque: [0, 0, 0, 0]}
- {name: brake, seconds: 0.2, request: disable}
"""


def recorded(folder: Path, steps: str, values: Mapping[str, Any] | None = None) -> Bag:
    script = folder / "script.yaml"
    script.write_text(f"steps:\n{steps}", encoding="utf-8")
    base = Configuration.load(packaged("wam"))
    names = [name for name in base.shared.nodes if name not in ("scenario", "recorder")]
    configuration = base.with_values({"nodes": [*names, "scenario"], **(values or {})})
    assert not record(configuration, load(script, base.shared), folder / "bag")
    return read(folder / "bag")


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> tuple[AnalysedRecording, Analysis]:
    bag = recorded(tmp_path_factory.mktemp("reactions"), STEPS)
    return AnalysedRecording(bag), analyse_bag(bag, lambda stage: None)


def press(recording: AnalysedRecording, name: str) -> HeldForce:
    (one,) = (one for one in recording.held if one.hold.name == name)
    return one


@pytest.mark.slow
def test_a_joint_torque_that_is_refused_or_not_reached_is_not_as_it_should_be(tmp_path: Path) -> None:
    summary = AnalysedRecording(recorded(tmp_path, TORQUES))
    (answer,) = (one for one in verdict(summary) if one.result == "NO")
    failed = "refused: too much; not reached: nothing there"
    assert str(answer) == f"commands carried out: NO ({failed})"
    analysis = analyse_bag(read(tmp_path / "bag"), lambda stage: None)
    sections = {section.key: section for section in analysis.sections}
    assert sections["steps"].wrong == [f"Failed: commands carried out ({failed})."]


@pytest.mark.slow
def test_a_spring_at_its_rest_is_no_contact(tmp_path: Path) -> None:
    spring = {"joints": ["joint3"], "stiffness": [4000.0], "lever": [0.3], "rest": [0.0], "bilateral": [True]}
    values = {f"driver:world.springs.{key}": value for key, value in spring.items()}
    summary = AnalysedRecording(recorded(tmp_path, "- {name: release, seconds: 0.4, request: enable}", values))
    assert not summary.missed
    assert summary.traces.true.is_known.all()


@pytest.mark.slow
def test_the_analysis_names_what_was_refused_with_time_and_reason(found: tuple[AnalysedRecording, Analysis]) -> None:
    summary, analysis = found
    begins = {step.name: step.begin / 1e9 for step in summary.steps}
    sections = {section.key: section for section in analysis.sections}
    wrong = sections["force"].wrong
    for name, (kind, reason) in REFUSED.items():
        assert any(line.startswith(name) and reason in line for line in sections["force"].sentences), name
        begin = [f": {kind} from {begins[name] + late:.2f} to " for late in (0.0, 0.005)]
        assert any(line.startswith(name) and any(one in line for one in begin) for line in wrong), name
    assert not any("press across" in line for line in wrong)


@pytest.mark.slow
def test_of_a_refused_force_nothing_is_measured_and_no_contact_is_missed(
    found: tuple[AnalysedRecording, Analysis],
) -> None:
    _, analysis = found
    sections = {section.key: section for section in analysis.sections}
    measured = {one.name for key in ("force", "stability") for one in sections[key].findings}
    for name in REFUSED:
        assert {one.partition(": ")[2] for one in measured if one.startswith(name)} == {
            "commanded force",
            "refused for",
        }
    assert "press across: overshoot" in measured
    assert not any("MISSED" in line for line in sections["force"].wrong)


@pytest.mark.slow
def test_the_table_of_the_demonstration_shows_what_was_held(found: tuple[AnalysedRecording, Analysis]) -> None:
    told = " ".join(text(found[1]).split())
    assert "force within 10 %: NO (4 of 6 not applied)" in told
    assert "Problems: Failed: force within 10 % (4 of 6 not applied)" in told
    for name, (kind, _) in REFUSED.items():
        assert re.search(rf" {name}(, axis \d)?: {kind} from", told)


@pytest.mark.slow
def test_a_force_of_a_task_is_assessed_as_one_of_force_command(found: tuple[AnalysedRecording, Analysis]) -> None:
    summary, analysis = found
    one, other = press(summary, "press across"), press(summary, "press across by a task")
    assert one.hold.commanded == other.hold.commanded == pytest.approx(8.0)
    for held in (one, other):
        for accuracy in held.accuracy.values():
            assert accuracy.bias == pytest.approx(0.0, abs=1.2)
    assert {"press across by a task: ripple of the true force"} <= {
        finding.name for section in analysis.sections for finding in section.findings
    }


def test_the_true_force_along_an_axis_of_the_base_is_that_of_the_arm_on_the_object() -> None:
    """The sample has the force on the tube in the base frame, without a link and its rotation."""
    bag = read(SAMPLES / "hold-tube")
    (held,) = AnalysedRecording(bag).held
    objects = bag.topics["/wam/sim/objects"]
    assert isinstance(objects, TableColumns)
    stamps, columns = objects.row_stamp_ns, objects.columns
    late = (stamps >= held.hold.end - 0.4 * (held.hold.end - held.hold.begin)) & (stamps < held.hold.end)
    expected = -float(columns["arm_force_x"][late & (columns["object"] == 0)].mean())
    assert held.hold.commanded + held.accuracy["true"].bias == pytest.approx(expected, rel=1e-3)


def test_what_lasts_a_moment_into_a_step_belongs_to_the_one_before() -> None:
    late = RecordedReaction(0, 1_005_000_000, Event(Code.NOT_REACHED, values={"reason": "why"}))
    assert within([late], 1_000_000_000, 2_000_000_000) == ()
    assert len(within([late], 0, 1_000_000_000)) == 1
    lasting = RecordedReaction(2_000_000_000, 4_000_000_000, Event(Code.NOT_REACHED, values={"reason": "so"}))
    times = "press: reported (not reached) from 2.00 to 4.00 s, and for 1.00 s at other times"
    assert in_words("press", [late, lasting], 0) == [(times, "so")]
