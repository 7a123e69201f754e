"""Commands of a recording as the stack took them, and recordings of several runs, which are refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from recordings import NAMESPACE, forces, joints, said, status

from wam_analysis.findings.analysis import Analysis, analyse_bag
from wam_bag.bag import Bag, BagError, TableColumns
from wam_description.configuration import SHARED, Configuration, packaged
from wam_sim.recorded_commands import COMMANDS
from wam_sim.recorded_run import RecordedRun, recorded_run

SECONDS = 4.0
STATES = np.arange(0.001, SECONDS, 0.001)
STREAMED = np.arange(1.0, 3.0, 0.005)  # s, of a force that is commanded
WALL = 1.8e9  # s
FORCE = (0.0, -5.0, 0.0)


def bag_of(**topics: Any) -> Bag:
    sections = Configuration.load(packaged("wam")).sections
    parameters = {f"{NAMESPACE}/driver": {"ros__parameters": {**sections[SHARED], **sections["driver"]}}}
    topics = {"motor_states": joints(STATES, 0.0), "status": said(status("driver", "braked")), **topics}
    named = {f"{NAMESPACE}/{name.replace('sim_', 'sim/')}": columns for name, columns in topics.items()}
    return Bag(Path("made"), named, {}, {"parameters.yaml": yaml.safe_dump(parameters).encode()}, {})


def analysed(bag: Bag) -> Analysis:
    return analyse_bag(bag, lambda doing: None)


def sentences(analysis: Analysis, key: str) -> str:
    return " ".join(sentence for section in analysis.sections if section.key == key for sentence in section.sentences)


def commanded(run: RecordedRun) -> Any:
    return run.bag.topics[f"{NAMESPACE}/force_command"]


def test_commands_with_the_wall_clock_are_left_out_and_named() -> None:
    found = analysed(bag_of(force_command=forces(STREAMED + WALL, FORCE, "outer_link")))
    assert found.recording.holds == ()
    assert found.recording.duration == pytest.approx(SECONDS, abs=0.01)
    refused = f"{len(STREAMED)} messages of force_command with a stamp far ahead of every state (the wall clock?)"
    assert f"REFUSED: {refused}" in sentences(found, "verdict")
    assert refused in sentences(found, "happened")
    assert not any("Not in this bag" in one and "force_command" in one for one in found.sections[1].sentences)


def test_a_push_with_the_wall_clock_acted_when_it_was_logged() -> None:
    columns = forces(STREAMED, FORCE, "outer_link")
    run = recorded_run(bag_of(sim_disturbance=columns._replace(stamp_ns=columns.stamp_ns + round(WALL * 1e9))))
    assert run.refused == ()
    pushed = run.bag.topics[f"{NAMESPACE}/sim/disturbance"]
    assert np.abs(pushed.stamp_ns - columns.stamp_ns).max() < 10_000_000


def test_a_stream_that_goes_on_for_a_moment_after_the_last_state_is_none_of_these() -> None:
    run = recorded_run(bag_of(force_command=forces(np.arange(1.0, SECONDS + 0.1, 0.005), FORCE, "outer_link")))
    assert run.refused == ()


def test_commands_in_a_frame_that_the_arm_does_not_have_are_left_out_and_the_others_are_analysed() -> None:
    columns = forces(STREAMED, FORCE, "outer_link")
    frames = np.array(["outer"] * 100 + [""] * 110 + ["outer_link"] * (len(STREAMED) - 210), object)
    found = analysed(bag_of(force_command=columns._replace(frames=frames)))
    assert [hold.frame for hold in found.recording.holds] == ["outer_link"]
    assert found.recording.holds[0].begin == columns.stamp_ns[210]
    known = "base, inner_link, outer_link"
    assert "REFUSED: 100 messages of force_command with the frame 'outer'" in sentences(found, "verdict")
    assert f"110 messages of force_command with the frame '', which is none of {known}" in sentences(found, "verdict")


def test_a_command_without_a_stamp_has_that_of_the_newest_state_logged_before_it() -> None:
    columns = forces(STREAMED, FORCE, "outer_link")
    logged = columns.log_time_ns + 400_000
    whole = columns._replace(stamp_ns=np.zeros_like(columns.stamp_ns), log_time_ns=logged)
    run = recorded_run(bag_of(force_command=whole))
    np.testing.assert_array_equal(commanded(run).stamp_ns, columns.stamp_ns)
    assert run.refused == ()
    (hold,) = analysed(bag_of(force_command=whole)).recording.holds
    assert (hold.end - hold.begin) / 1e9 == pytest.approx(2.0)


@pytest.mark.slow
@pytest.mark.parametrize("topic", COMMANDS)
def test_a_bag_whose_commands_were_all_taken_is_not_changed(topic: str) -> None:
    bag = bag_of(**{topic.replace("sim/", "sim_"): forces(STREAMED, FORCE, "outer_link")})
    assert recorded_run(bag).bag is bag


def test_of_a_task_the_rows_of_the_messages_that_were_refused_are_left_out() -> None:
    stamps = np.array([1, 2, 1_800_000_000, 3]) * 1_000_000_000
    values = {"value": np.array([1.0, 2.0, 3.0, 4.0, 5.0])}
    table = TableColumns(stamps, stamps, ("base",) * 4, np.array([0, 0, 1, 2, 3]), values)
    run = recorded_run(bag_of(task_command=table))
    left = run.bag.topics[f"{NAMESPACE}/task_command"]
    assert isinstance(left, TableColumns)
    assert [(one.topic, one.number) for one in run.refused] == [("task_command", 1)]
    assert left.message.tolist() == [0, 0, 1, 2]
    assert left.columns["value"].tolist() == [1.0, 2.0, 3.0, 5.0]
    assert left.row_stamp_ns.tolist() == [10**9, 10**9, 2 * 10**9, 3 * 10**9]


def test_without_states_or_parameters_every_command_is_taken() -> None:
    bag = bag_of(force_command=forces(STREAMED + WALL, FORCE, "outer"))
    topics = {name: columns for name, columns in bag.topics.items() if "states" not in name}
    assert recorded_run(bag._replace(topics=topics, attachments={})).refused == ()


def test_two_runs_in_one_recording_are_refused_with_their_times() -> None:
    states = joints(np.concatenate([STATES, STATES[:2000]]), 0.0)
    with pytest.raises(BagError, match=r"2 runs .* motor_states go back \(0\.001 to 3\.999 s, 0\.001 to 2\.000 s\)"):
        recorded_run(bag_of(motor_states=states))


def test_two_runs_that_a_recorder_put_into_the_order_of_the_arms_time_are_refused() -> None:
    """Their messages alternate, as in a recording in lockstep the log time is that of the arm."""
    states = joints(np.sort(np.concatenate([STATES, STATES[:2000]])), 0.0)
    with pytest.raises(BagError, match=r"2 runs .* from 0\.001 to 2\.000 s come 2 times"):
        recorded_run(bag_of(motor_states=states))


def test_a_clock_that_was_set_back_a_little_is_no_second_run() -> None:
    states = joints(np.concatenate([STATES, STATES[-500:] + 0.0001]), 0.0)
    assert recorded_run(bag_of(motor_states=states)).refused == ()
