"""No report of the force loop hides another one: in its status, in a recording, and in what is made of a step."""

import math

import pytest

from wam_control.force.force_hold import ForceReaction, by_seriousness
from wam_control.force.reaction_status import facts_of, stated
from wam_control.force.task import AxisKind, TaskAxis, TaskCommand, joint_axes
from wam_control.task.scenario import ScenarioStep
from wam_description.configuration import Configuration, packaged
from wam_description.signals import BASE, Level, NodeStatus
from wam_sim.reactions import RecordedReaction, is_too_short, lasting, settling_time_in, unmet, watched_times
from wam_sim.recording import RecordedStep
from wam_sim.sweep import SweepPoint, outcome

NONE, UNCERTAIN, NOT_REACHED, JOINT_END = (
    ForceReaction[name] for name in ("NONE", "UNCERTAIN", "NOT_REACHED", "JOINT_END")
)
SECOND = 1_000_000_000
ELBOW = [0.0, -1.2, 0.0, 2.35]  # rad, joint4 near its end at 2.44


def status(reactions: dict[ForceReaction, str], refused: dict[str, str]) -> NodeStatus:
    message, facts = facts_of(reactions, refused)
    return NodeStatus(Level.WARN, message, facts={"margin": "2", **facts})


def test_a_command_that_is_not_reached_comes_before_what_is_less_serious() -> None:
    found = [(NONE, ""), (UNCERTAIN, "joint3"), (JOINT_END, "joint4"), (NOT_REACHED, "joint4"), (NOT_REACHED, "joint1")]
    assert list(by_seriousness(found).items()) == [
        (NOT_REACHED, "joint4"),
        (UNCERTAIN, "joint3"),
        (JOINT_END, "joint4"),
    ]
    push = ForceReaction.CONTACT_FORCE, "a push"
    assert next(iter(by_seriousness([*found, push]))) is ForceReaction.CONTACT_FORCE
    assert by_seriousness([*found, push, (ForceReaction.NOT_SENSED, "blind")]) == {ForceReaction.NOT_SENSED: "blind"}
    assert by_seriousness([(NONE, "")]) == {}


@pytest.mark.parametrize("reactions", [{}, {NOT_REACHED: "late"}, {NOT_REACHED: "late", JOINT_END: "at its end"}])
@pytest.mark.parametrize("refused", [{}, {"joint_posture_command": "no effect"}])
def test_each_report_is_in_the_status_with_its_own_reason(reactions: dict, refused: dict) -> None:
    found = stated(status(reactions, refused))
    assert found == {
        **({"refused": "no effect"} if refused else {}),
        **{one.name.lower(): why for one, why in reactions.items()},
    }
    message = status(reactions, refused).message
    assert message == ("no effect" if refused else "; ".join(reactions.values()))


def test_a_command_that_is_refused_because_the_arm_holds_is_one_report() -> None:
    held = {ForceReaction.NOT_SENSED: "no lever"}
    assert stated(status(held, {"force_command": "no lever"})) == {"not_sensed": "no lever"}


def test_a_status_of_an_older_recording_has_the_reaction_and_what_is_refused() -> None:
    old = NodeStatus(Level.WARN, "late", facts={"reaction": "not_reached", "refused": "joint_posture_command"})
    assert stated(old) == {"refused": "joint_posture_command", "not_reached": "late"}


def test_what_is_reported_at_the_same_time_has_times_of_its_own() -> None:
    late, end = "not_reached", "joint_end"
    found = lasting([(0, {}), (1, {end: "a"}), (2, {late: "b", end: "c"}), (4, {late: "b: turn joint4"}), (6, {})], 9)
    assert sorted(found) == [
        RecordedReaction(1, 4, end, "a"),
        RecordedReaction(2, 6, late, "b: turn joint4"),
    ]


def test_what_holds_for_another_reason_is_another_reaction() -> None:
    fast, loaded, also = "the arm moved faster than 0.3 rad/s", "it measures -2.9 N: tare", "it measures -3.1 N: tare"
    found = lasting([(0, {"not_sensed": fast}), (2, {"not_sensed": loaded}), (4, {"not_sensed": also})], 9)
    assert found == [RecordedReaction(0, 2, "not_sensed", fast), RecordedReaction(2, 9, "not_sensed", loaded)]


def test_a_command_is_not_met_that_is_refused_or_in_the_end_not_reached() -> None:
    step = RecordedStep("press", 0, 4 * SECOND, {})
    late = RecordedReaction(2 * SECOND, 4 * SECOND, "not_reached", "late")
    refused = RecordedReaction(0, 4 * SECOND, "refused", "no effect")
    seen_late, seen_refused = (one._replace(begin=3 * SECOND) for one in (late, refused))
    assert unmet([late, late._replace(name="uncertain")], step) == [seen_late]
    assert not unmet([late._replace(end=3_500_000_000)], step)
    assert unmet([late, refused], step) == [seen_refused, seen_late]
    assert not unmet([refused._replace(end=2 * SECOND), late._replace(name="joint_end")], step)


def test_a_command_is_not_met_with_more_force_than_allowed_in_all_of_its_steady_state() -> None:
    step = RecordedStep("press", 0, 4 * SECOND, {})
    hard = RecordedReaction(SECOND, 4 * SECOND, "contact_force", "13 N in all")
    seen = hard._replace(begin=3 * SECOND)
    assert unmet([hard], step) == [seen]
    assert seen.outcome == "with too much force"
    assert not unmet([hard._replace(begin=3_100_000_000)], step), "a push at the end is not held by the arm"
    assert not unmet([hard._replace(end=3_500_000_000)], step)


def test_torques_are_too_short_that_end_before_they_would_be_reported() -> None:
    torques, other = (TaskCommand(BASE, joint_axes(AxisKind.FORCE, (1.0, value))) for value in (2.0, 3.0))
    press = TaskAxis(AxisKind.FORCE, -1, "outer_link", 0.2, (0.0, 0.0, -1.0), 8.0)
    place = TaskCommand(BASE, (TaskAxis(AxisKind.POSITION, 0, value=0.0), press._replace(value=0.0)))
    tasks = [torques, other, None, torques, place]
    times = watched_times((task, i * SECOND, (i + 1) * SECOND) for i, task in enumerate(tasks))
    assert times == [(0, 2 * SECOND), (3 * SECOND, 4 * SECOND), (4 * SECOND, 5 * SECOND)]
    pressing = [(TaskCommand(BASE, (press,)), 0, SECOND)]
    assert watched_times(pressing) == [(0, SECOND)]
    assert not watched_times(pressing, without_forces=True)
    steps = [RecordedStep(str(i), i * SECOND, (i + 1) * SECOND, {}) for i in range(5)]
    assert [one.name for one in steps if is_too_short(times, one, 1.5)] == ["0", "3", "4"]
    assert not any(is_too_short(times, one, math.nan) for one in steps)
    settling = [(0, 2.0), (3 * SECOND, 60.0), (5 * SECOND, 1.0)]
    spans = [(1, 2), (1, 4), (5, 6)]
    during = [steps[0]._replace(begin=begin * SECOND, end=end * SECOND) for begin, end in spans]
    found = [settling_time_in(settling, one) for one in during]
    assert found == [2.0, 60.0, 1.0]
    assert math.isnan(settling_time_in([], steps[0]))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("start", "torques", "seconds", "failure", "unassessed"),
    [
        (ELBOW, (0.0, 0.0, 0.0, 3.0), 3.0, "torque not reached: force of joint 4: ", ""),  # at the end of joint4
        (
            ELBOW,
            (0.0, 0.0, 0.0, 3.0),
            1.0,
            "",
            "torque: not assessed: force, torque or motion of a task commanded for no longer than",
        ),
    ],
)
def test_a_sweep_states_each_torque_that_is_not_reached_or_too_short(
    start: list[float], torques: tuple[float, ...], seconds: float, failure: str, unassessed: str
) -> None:
    found = swept(start, ScenarioStep("torque", seconds, task=TaskCommand(BASE, joint_axes(AxisKind.FORCE, torques))))
    for words, given in ((failure, found.failure), (unassessed, found.unassessed)):
        assert given.startswith(words)
        assert bool(given) == bool(words)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "value", "failure"),
    [
        (AxisKind.POSITION, None, ""),
        (AxisKind.POSITION, 2.43, "motion not reached: position of joint 4: 2.43 rad is commanded, and it is at 2.39"),
        (
            AxisKind.VELOCITY,
            0.2,
            "motion not reached: velocity of joint 4: 0.2 rad/s are commanded, and it moves with ",
        ),
        (AxisKind.VELOCITY, -0.2, ""),
    ],
)
def test_a_sweep_states_each_motion_that_is_not_reached(kind: AxisKind, value: float | None, failure: str) -> None:
    found = swept(ELBOW, ScenarioStep("motion", 2.1, task=TaskCommand(BASE, (TaskAxis(kind, 3, value=value),))))
    assert found.failure.startswith(failure)
    assert bool(found.failure) == bool(failure)
    assert not found.unassessed


@pytest.mark.slow
def test_a_posture_that_the_force_loop_refuses_is_a_failure_of_a_sweep() -> None:
    step = ScenarioStep("go", 1.0, posture=(0.1, -1.2, 0.0, 1.0))
    found = swept([0.0, -1.2, 0.0, 1.0], step, {"force_loop:mode": "joint_torque"})
    assert found.failure.startswith("go refused: joint_posture_command has no effect in the mode joint_torque")
    assert not swept([0.0, -1.2, 0.0, 1.0], step).failure


def swept(start: list[float], step: ScenarioStep, values: dict | None = None):
    configuration = Configuration.load(packaged("wam")).with_values(
        {
            "arm.joints.start": start,
            "force_loop:guard.posture": start,
            "driver:world.obstacles.positions": [3.0, 3.0, 3.0],
            **(values or {}),
        }
    )
    return outcome(SweepPoint(configuration, (ScenarioStep("release", 0.1, request="enable"), step)))
