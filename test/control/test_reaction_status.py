"""No report of the force loop hides another one: in its status, in a recording, and in what is made of a step."""

import math

import pytest

from wam_control.force.task import AxisKind, TaskAxis, TaskCommand, joint_axes
from wam_description.event import OBEYED, Code, Event, Level, fault, holding, refused, warning
from wam_description.event_text import news, sentence
from wam_description.signals import BASE, NodeStatus
from wam_description.status import pairs, parse, with_refused
from wam_sim.reactions import RecordedReaction, RecordedStep, is_too_short, lasting, unmet, watched_times
from wam_sim.reactions import settling_time_in as longest

SECOND = 1_000_000_000
PUSH = {"allowed": 20.0, "limit": "limits.whole_force"}
OFF = {"axis": "press", "desired": 5.0, "unit": "N", "time": 2.0, "allowed": 0.5, "has_touched": 0.0}
DIFFER = {"position": 0.2, "cover": "outer_link", "chi2": 20.0, "allowed": 9.0}


def named(code: Code, joint: str) -> Event:
    return warning(code, "test", joint=joint)


def test_events_in_a_status_are_pairs_of_text_and_back() -> None:
    events = (
        refused("joint_posture_command", "no effect"),
        warning(Code.NOT_REACHED, "force_off", measured=3.1, desired=-1e-7, cover="12", time=math.inf),
        Event(Code.FAULT, Level.ERROR, {"reason": 'a "quoted" one'}),
    )
    status = NodeStatus(Level.WARN, "text", facts={"margin": "2"}, events=events)
    found = pairs(status)
    assert ("event.2", "not_reached") in found
    assert ("event.2.measured", "3.1") in found
    assert parse("", Level.WARN, "text", found) == status


@pytest.mark.parametrize(("event", "words"), [
    (OBEYED, ""),
    (Event(Code.DONE), "done"),
    (refused("task_command", "no effect"), "no effect"),
    (Event(Code.FAULT, Level.ERROR, {"reason": "the cable slipped"}), "the cable slipped"),
    (warning(Code.PUSHED, "pushed", force=24.6, **PUSH), "at least 25 N acts on the arm; allowed: 20 N"),
    (warning(Code.PUSHED, "pushed", force=20.04, **PUSH), "at least 20.04 N acts on the arm; allowed: 20 N"),
    (fault("command_stale", age_ms=45.04, allowed_ms=45.0, cure=""), "45.04 ms old; allowed: below 45 ms"),
    (fault("bus_safety_idle", detail="velocity"), "the arm moved faster than the safety module allows"),
    (warning(Code.NOT_REACHED, "force_off", measured=-0.2, **OFF), "for 2 s; hardly anything is touched"),
    (warning(Code.NOT_REACHED, "force_off", measured=-5.6, **OFF), "for 2 s; the arm is pulled"),
    (warning(Code.NOT_REACHED, "force_off", measured=-2.6, **OFF | {"desired": -5.0}), "more force, towards it"),
    (warning(Code.MODEL_OFF, "model_off", part="friction of motor1"), "if it lasts, run 'wam identify'"),
    (warning(Code.MODEL_OFF, "model_off", part="payload"), "(arm.payload); if the tool carries none, run"),
    (warning(Code.UNEXPLAINED, "torques_differ", **DIFFER, source="motors"), "position, use the dither (t"),
    (warning(Code.UNEXPLAINED, "torques_differ", **DIFFER, source="sensors"), "position, or free the arm"),
])  # fmt: skip
def test_an_event_has_words_of_its_cause_or_reason_or_code(event: Event, words: str) -> None:
    assert words in sentence(event)
    assert words or not sentence(event)


def test_each_of_several_events_is_a_line_at_a_terminal_once() -> None:
    late, end = refused("a", "no effect"), Event(Code.AT_LIMIT, values={"reason": "far"})
    status = NodeStatus(Level.WARN, "no effect; also: far", facts={"refused": "a"}, events=(late, end))
    assert news(status, ()).splitlines() == ["a: refused: no effect", "    also: far"]
    assert news(status, {late.subject}) == "a: at limit: far"


@pytest.mark.parametrize("given", [
    {"event.1": "of another version", "event.1.severity": "WARN"},
    {"event.1": "fault", "event.1.severity": "loud", "event.1.force": "{"},
    {"event.1": "fault"},
])  # fmt: skip
def test_an_event_that_is_not_understood_is_left_out(given: dict[str, str]) -> None:
    assert parse("driver", 1, "", given.items()).events == ()


@pytest.mark.parametrize("text", ["{", "[" * 9999], ids=["no JSON", "too deep"])
def test_a_value_of_an_event_that_is_not_understood_stays_as_it_is_written(text: str) -> None:
    given = {"event.1": "fault", "event.1.severity": "WARN", "event.1.force": text}
    (event,) = parse("driver", 1, "", given.items()).events
    assert event.values == {"force": text}


def test_a_message_that_is_refused_before_the_node_has_it_is_an_event_of_its_status() -> None:
    late = warning(Code.NOT_REACHED, "joint_end", joint="joint1")
    status = with_refused(NodeStatus(Level.WARN, "late", events=(late,)), {"task_command": "no table"})
    assert status.events == (late, refused("task_command", "no table"))
    assert status.message == "late; no table"
    plain = with_refused(NodeStatus(Level.OK, "at work"), {"task_command": "no table"})
    assert (plain.level, plain.message) == (Level.WARN, "no table")


def test_what_is_reported_at_the_same_time_has_times_of_its_own() -> None:
    end, late = named(Code.AT_LIMIT, "joint1"), named(Code.NOT_REACHED, "joint1")
    more, other = end.with_values(angle=1.0), late.with_values(ways="turn joint4")
    found = lasting([(0, ()), (1, (end,)), (2, (late, more)), (4, (other,)), (6, ())], 9)
    assert sorted(found, key=lambda one: one.begin) == [RecordedReaction(1, 4, more), RecordedReaction(2, 6, other)]


def test_what_holds_for_another_reason_is_another_reaction() -> None:
    fast = holding(Code.REFUSED, "moved_fast", speed=0.3)
    loaded, also = (holding(Code.REFUSED, "error", error=error) for error in (2.9, 3.1))
    found = lasting([(0, (fast,)), (2, (loaded,)), (4, (also,))], 9)
    assert found == [RecordedReaction(0, 2, fast), RecordedReaction(2, 9, loaded)]


def test_a_command_is_not_met_that_is_refused_or_in_the_end_not_reached() -> None:
    step = RecordedStep("press", 0, 4 * SECOND, {})
    denied = refused("joint_posture_command", "no effect")
    late = RecordedReaction(2 * SECOND, 4 * SECOND, Event(Code.NOT_REACHED))
    taken = RecordedReaction(0, 4 * SECOND, denied)
    seen_late, seen_refused = (one._replace(begin=3 * SECOND) for one in (late, taken))
    assert unmet([late, late._replace(event=Event(Code.REFUSED))], step) == [seen_late]
    assert not unmet([late._replace(end=3_500_000_000)], step)
    assert unmet([late, taken], step) == [seen_refused, seen_late]
    assert not unmet([taken._replace(end=2 * SECOND), late._replace(event=Event(Code.AT_LIMIT))], step)


def test_a_command_is_not_met_with_more_force_than_allowed_in_all_of_its_steady_state() -> None:
    step = RecordedStep("press", 0, 4 * SECOND, {})
    hard = RecordedReaction(SECOND, 4 * SECOND, Event(Code.PUSHED))
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
    assert not watched_times([(TaskCommand(BASE, (press,)), 0, SECOND)])
    steps = [RecordedStep(str(i), i * SECOND, (i + 1) * SECOND, {}) for i in range(5)]
    assert [one.name for one in steps if is_too_short(times, one, 1.5)] == ["0", "3", "4"]
    assert not any(is_too_short(times, one, math.nan) for one in steps)
    settling = [(0, 2.0), (3 * SECOND, 60.0), (5 * SECOND, 1.0)]
    spans = [(1, 2), (1, 4), (5, 6)]
    during = [steps[0]._replace(begin=begin * SECOND, end=end * SECOND) for begin, end in spans]
    found = [longest(settling, one) for one in during]
    assert found == [2.0, 60.0, 1.0]
    assert math.isnan(longest([], steps[0]))
