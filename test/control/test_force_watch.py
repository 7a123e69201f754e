"""Each event of a force or a motion comes after its time, lasts, and goes away."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_force_belief import OWN, POSES, axis_at

from wam_control.force.axes import CommandedAxis
from wam_control.force.belief import Belief, Errors
from wam_control.force.force_watch import ForceWatch, MotionWatch, Seen
from wam_control.task.motion import GoalMotion
from wam_description.event import Code, Event
from wam_description.event_text import sentence

DT, FORCE = 0.005, 5.0
AXIS = axis_at(POSES[0], FORCE)
assert AXIS.sensed is not None
assert AXIS.place is not None
PRESS = AXIS.sensed.press
UNPINNED = AXIS._replace(place=AXIS.place._replace(is_pinned=False))
SETTLING = OWN.limits.settling_time


class Pressed:
    """A watched force, measured as it is said."""

    def __init__(self, axis: CommandedAxis = AXIS, **limits: float) -> None:
        self.axis, self.watch = axis, ForceWatch(False)
        self.own = replace(OWN, limits=replace(OWN.limits, **limits))

    def go(
        self,
        seconds: float,
        force: float | Callable[[float], float] = FORCE,
        error: float = 0.0,
        chi2: float = 0.0,
        way: float = 0.0,
        touched: str = "",
        torques: Any = None,
        is_led: bool = False,
    ) -> list[list[Event]]:
        """The events of each period."""
        found = []
        for k in range(round(seconds / DT)):
            measured = force(k * DT) if callable(force) else force
            known = Belief(measured, measured, 0.1, chi2, Errors(torques=error), 0.5)
            self.watch.touch.step(measured, FORCE, 0.0, DT)
            pattern = -measured * PRESS if torques is None else torques
            seen = Seen(known, way, touched, is_led)
            found.append(self.watch.step(self.axis, seen, pattern, self.own, DT))
        return found

    def last(self, seconds: float, *given: Any, **more: Any) -> list[tuple[Code, str, bool]]:
        """Those of the last of them."""
        return [(event.code, str(event.cause), event.holds) for event in self.go(seconds, *given, **more)[-1]]


REFUSED = [(Code.REFUSED, "error", True)]
UNCERTAIN = [(Code.REFUSED, "uncertain", False)]


def test_a_force_that_would_be_off_by_too_much_is_refused_until_it_is_known_well_enough() -> None:
    pressed = Pressed()
    for force, error, expected in (
        (0.0, 0.55, REFUSED),
        (0.0, 0.45, []),
        (0.0, 0.6, []),  # it goes on up to 1.25
        (0.0, 0.65, REFUSED),
        (0.0, 0.55, REFUSED),
        (0.0, 0.45, []),
        (FORCE, 0.45, []),
        (FORCE, 0.9, []),  # after the touch it goes on, and says so later
    ):
        assert pressed.last(DT, force, error) == expected
    touching = Pressed()
    assert touching.last(DT, FORCE, 0.55) == REFUSED
    assert touching.last(DT, FORCE, 0.45) == [], "a refusal is looked at again, whatever is touched meanwhile"
    assert Pressed(doubt=2.5).last(DT, 0.0, 1.2) == [], "who asks for more"


def test_at_a_place_that_is_not_pinned_it_is_refused_until_the_force_is_there() -> None:
    pressed = Pressed(UNPINNED)
    assert pressed.last(DT, 2.0, 0.45) == []
    assert pressed.last(DT, 2.0, 0.7) == REFUSED
    assert pressed.last(DT, FORCE, 0.45) == []
    assert pressed.last(DT, 2.0, 0.7) == [], "once it was there"


def test_a_refusal_stays_the_same_report_while_the_estimated_link_wavers() -> None:
    assert UNPINNED.place is not None
    pressed, subjects = Pressed(UNPINNED), set()
    for cover in ("outer_link", "inner_link"):
        pressed.axis = UNPINNED._replace(place=UNPINNED.place._replace(cover=cover))
        subjects |= {event.subject for event in pressed.go(DT, 2.0, 0.7)[-1]}
    assert len(subjects) == 1


def test_what_is_not_known_well_enough_while_it_presses_is_reported_with_what_is_off_already() -> None:
    pressed = Pressed()
    assert pressed.last(SETTLING + 1.0, FORCE, 0.45) == []
    assert pressed.last(SETTLING - 0.1, FORCE - 0.4, 0.45) == []
    assert pressed.last(0.2, FORCE - 0.4, 0.45) == UNCERTAIN
    assert pressed.last(SETTLING - 0.2, FORCE, 0.45) == UNCERTAIN
    assert pressed.last(0.4, FORCE, 0.45) == []


def test_a_force_that_is_not_reached_is_reported_after_the_settling_time_and_after_a_quarter_once_it_was() -> None:
    off, strays = [(Code.NOT_REACHED, "force_off", False)], [(Code.NOT_REACHED, "force_strays", False)]
    pressed = Pressed()
    assert pressed.last(SETTLING - 0.05, 0.0) == []
    assert pressed.last(0.1, 0.0) == off
    assert pressed.last(SETTLING / 4 + 0.05, FORCE) == []
    assert pressed.last(SETTLING, FORCE) == []
    assert pressed.last(SETTLING / 4 - 0.05, FORCE - 0.8) == []
    assert pressed.last(0.1, FORCE - 0.8) == strays
    assert pressed.last(SETTLING - 0.05, FORCE) == strays, "what takes it away comes again"
    assert pressed.last(0.1, FORCE) == []
    crossed = Pressed()
    assert crossed.last(0.1, FORCE) == []
    assert crossed.last(SETTLING - 0.2, 2.0 * FORCE) == [], "a force that rises too far was not reached yet"
    assert crossed.last(SETTLING, FORCE) == []


def test_torques_that_the_force_does_not_explain_are_reported_while_it_presses() -> None:
    differ = [(Code.UNEXPLAINED, "torques_differ", False)]
    pressed = Pressed()
    assert pressed.last(SETTLING - 0.1, chi2=20.0) == []
    assert pressed.last(0.2, chi2=20.0) == differ
    assert pressed.last(SETTLING - 0.1, chi2=1.0) == differ
    assert pressed.go(0.1, chi2=1.0)[0][0].values["chi2"] == 20.0, "as it was when it was strange"
    assert pressed.last(0.1, chi2=1.0) == []
    loose = Pressed()
    assert all(event.code is not Code.UNEXPLAINED for event in loose.go(SETTLING + 1.0, 0.5, chi2=20.0)[-1])


def test_torques_that_change_after_the_force_has_settled_are_reported_with_as_much_force_measured() -> None:
    assert AXIS.sensed is not None
    free = np.random.default_rng(0).normal(size=4)
    aside = 3.0 * (free - AXIS.sensed.press * float(AXIS.sensed.sense @ free))  # is no force along the axis
    changed = [(Code.UNEXPLAINED, "torques_changed", False)]
    pressed = Pressed()
    assert pressed.last(1.0) == []
    assert pressed.last(0.08, torques=aside - FORCE * PRESS) == []
    assert pressed.last(0.1, torques=aside - FORCE * PRESS) == changed
    assert pressed.last(0.2) == []
    pressed.axis = AXIS._replace(in_frame=-AXIS.in_frame)  # another direction is commanded
    assert pressed.last(0.2, torques=aside - FORCE * PRESS) == []


def test_torques_that_change_with_the_pose_alone_are_those_of_the_force() -> None:
    pressed = Pressed()
    assert pressed.last(1.0) == []
    pressed.axis = axis_at(POSES[1], FORCE)
    assert pressed.axis.sensed is not None
    assert pressed.last(1.0, torques=-FORCE * pressed.axis.sensed.press) == []


@pytest.mark.parametrize(("axis", "chi2", "holds"), [(AXIS, 20.0, True), (AXIS, 1.0, False), (UNPINNED, 1.0, True)])
def test_another_link_that_is_touched_ends_the_force_until_the_command_ends(
    axis: CommandedAxis, chi2: float, holds: bool
) -> None:
    """At a pinned place the torques decide."""
    other, pressed = [(Code.UNEXPLAINED, "other_link", True)], Pressed(axis)
    assert pressed.last(0.08, chi2=chi2, touched="inner_link") == []
    assert pressed.last(0.1, chi2=chi2, touched="inner_link") == (other if holds else [])
    assert pressed.last(1.0) == (other if holds else [])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_arm_that_moves_on_without_its_force_stops_at_the_free_travel_for_good(sign: float) -> None:
    travelled, pressed = [(Code.AT_LIMIT, "free_travel", True)], Pressed()
    assert pressed.last(0.5, 0.0, way=sign * 0.00149) == []
    assert pressed.last(0.01, 0.0, way=sign * 0.00149) == travelled
    assert pressed.last(1.0) == travelled
    turned = Pressed()
    assert turned.last(0.5, 0.0, way=sign * 0.00149) == []
    turned.axis = AXIS._replace(in_frame=-AXIS.in_frame)
    assert turned.last(0.9, 0.0, way=sign * 0.00149) == [], "on the way back"


@pytest.mark.parametrize(("force", "is_led"), [(FORCE, True), (FORCE, False), (0.0, True)])
def test_a_way_with_the_right_force_counts_only_where_nothing_else_moves_the_arm(force: float, is_led: bool) -> None:
    """What is led along a surface goes as far as it is led; what moves by itself back and forth does not add up."""
    pressed = Pressed()
    found = pressed.last(1.0, force, way=0.002, is_led=is_led)
    assert ((Code.AT_LIMIT, "free_travel", True) in found) is (force == 0.0)
    if force:
        assert pressed.last(0.3, FORCE - 0.8, way=-0.001, is_led=is_led) == []


def swing(size: float, period: float = 0.2) -> Callable[[float], float]:
    return lambda time: FORCE + size * math.sin(2.0 * math.pi * time / period)


@pytest.mark.parametrize("dithered", [False, True])
def test_an_oscillation_is_reported_with_its_size_and_ends_and_the_arm_is_slowed_down_before(dithered: bool) -> None:
    pressed = Pressed()
    pressed.watch = ForceWatch(dithered)
    pressed.go(0.5)
    found = pressed.go(SETTLING, swing(0.4))
    (event,) = [event for event in found[-1] if event.code is Code.OSCILLATING]
    assert not event.holds
    assert event.values["swing"] == pytest.approx(0.8, rel=0.02)
    assert event.values["period"] == pytest.approx(0.2, rel=0.02)
    assert ("timing.dither_cycle" in sentence(event)) == dithered
    assert pressed.watch.oscillation.share == 0.25
    assert pressed.last(2.0 * SETTLING + 0.1) == []


@pytest.mark.parametrize(("feedback", "is_used"), [("joint_sensors", True), ("contact_estimate", False)])
@pytest.mark.parametrize("error", [0.0, 0.9, math.inf])
def test_joint_sensors_are_advised_where_they_are_not_used_and_a_tare_only_where_it_helps(
    error: float, feedback: str, is_used: bool
) -> None:
    pressed = Pressed()
    pressed.own = replace(OWN, feedback=feedback)
    pressed.go(0.5, FORCE, error)
    event = pressed.go(SETTLING, swing(0.4), error)[-1][0]
    assert event.code is (Code.REFUSED if error else Code.OSCILLATING)
    text = sentence(event)
    assert "use joint sensors" in text if not is_used else "joint sensors" not in text
    assert "tare" not in text
    assert ("cannot be controlled" in text) == math.isinf(error)


def test_a_force_that_follows_a_sine_of_its_set_point_is_no_oscillation() -> None:
    pressed = Pressed()
    for k in range(600):
        desired = swing(1.0)(k * DT)
        pressed.axis = AXIS._replace(desired=desired)
        assert pressed.go(DT, desired) == [[]]
    assert pressed.watch.oscillation.share == 1.0


@pytest.mark.parametrize(("lasting", "is_reported"), [(0.085, False), (1.0, True)])
def test_an_impact_that_bounces_is_no_oscillation(lasting: float, is_reported: bool) -> None:
    pressed = Pressed()
    found = pressed.go(2.0, lambda time: FORCE + (0.9 * (-1) ** int(time / 0.015) if time < lasting else 0.0))
    assert any(event.code is Code.OSCILLATING for events in found for event in events) is is_reported


def test_a_new_command_settles_anew() -> None:
    pressed = Pressed()
    pressed.go(SETTLING)
    pressed.axis = axis_at(POSES[0], 2.0 * FORCE)
    assert pressed.last(SETTLING - 0.1) == [], "half of it is measured, and it has its time"
    assert pressed.last(0.2) == [(Code.NOT_REACHED, "force_off", False)]


GAIN, FASTEST, LATE = 8.0, 1.5, 0.5


def moved(
    goal: Callable[[float], float],
    follows: float = 1.0,
    rate: float = 0.0,
    seconds: float = 4.0,
    stops: float = math.inf,
) -> list[tuple[Code, str] | None]:
    """What is reported of a joint that follows its goal with a part of the velocity of its law, until it stops."""
    watch, q, found = MotionWatch(), 0.0, []
    for k in range(round(seconds / DT)):
        event = watch.step("elbow", "rad", goal(k * DT), rate, q, GAIN, FASTEST, LATE, DT)
        found.append((event.code, str(event.cause)) if event else None)
        speed = follows * min(max(rate + GAIN * (goal(k * DT) - q), -FASTEST), FASTEST)
        q += speed * DT * (k * DT < stops)
    return found


TOO_LATE, TOO_FAST = (Code.NOT_REACHED, "motion_off"), (Code.AT_LIMIT, "speed")


def path(seconds: float) -> Callable[[float], float]:
    motion = GoalMotion([0.0], [2.0], seconds)
    return lambda time: motion.at(time).position[0]


@pytest.mark.parametrize("goal", [
    lambda time: 2.0,  # a goal may be set anywhere
    lambda time: 2.0 * (round(time) % 2),
    lambda time: 0.9 * FASTEST * (time - time % 0.5),  # streamed at 2 Hz
    path(3.0),
])  # fmt: skip
def test_an_arm_that_follows_as_its_law_has_it_is_never_late(goal: Callable[[float], float]) -> None:
    assert not any(moved(goal))


def test_an_arm_that_is_stopped_or_follows_too_slowly_is_late_until_it_arrives() -> None:
    stopped = moved(lambda _: 2.0, stops=0.3)
    assert stopped[-1] == TOO_LATE
    assert stopped.index(TOO_LATE) * DT > 0.3 + LATE * 0.9
    slow = moved(path(3.0), follows=0.2, seconds=12.0)
    assert TOO_LATE in slow
    assert slow[-1] is None


@pytest.mark.parametrize(("rate", "expected"), [(0.9 * FASTEST, {None}), (1.1 * FASTEST, {TOO_FAST})])
def test_a_motion_that_is_commanded_too_fast_is_reported_at_once(
    rate: float, expected: set[tuple[Code, str] | None]
) -> None:
    assert set(moved(lambda time: rate * time, rate=rate, seconds=1.0)) == expected
