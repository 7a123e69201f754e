"""Limit cycles of the measured force, forces that are not known well enough, and an arm that a dither shakes."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from test_force_loop import ARM, CONFIGURATION, DT, GIVEN, OWN, POSE, STILL, World, ask, down, force_loop, lever

from wam_control.force.force_loop import ForceLoop, ForceOutput
from wam_control.force.force_swing import Reversals, Shake
from wam_description.event import Code
from wam_description.event_text import sentence
from wam_description.signals import NO_CONTACT, Contact

LIMITS = replace(GIVEN.limits, settling_time=0.5)
TOUCHED = Contact("outer_link", OWN.contact_position, (0.0, 1.0, 0.0), 0.001, 1.0)
PINNED = replace(OWN, limits=LIMITS, sensing=GIVEN.sensing, contact_source="pinned")


def test_a_cycle_is_found_with_its_size_and_period_and_noise_and_a_drift_are_none() -> None:
    turns, noise = Reversals(), np.random.default_rng(1).normal(0.0, 0.05, 400)
    cycling = [turns.step(5.0 + math.sin(2.0 * math.pi * k * DT / 0.25), 0.5, 1.0, DT) for k in range(400)]
    assert cycling[-1]
    assert not any(cycling[:60])
    assert turns.cycle == (pytest.approx(2.0, rel=0.02), pytest.approx(0.25, rel=0.02))
    turns.reset()
    assert not any(turns.step(5.0 + 0.01 * k + noise[k], 0.5, 1.0, DT) for k in range(400))


def test_a_shake_is_measured_about_the_course_of_the_motion() -> None:
    shake, straight, shaken = Shake(8), np.array([0.003, 0.001]), np.array([1e-4, 0.0])
    along, across = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    for _ in range(30):
        shake.step(straight)
    assert shake.along(along) == pytest.approx(0.0, abs=1e-12)
    for k in range(30):
        turn = math.sin(2.0 * math.pi * (k + 1) / 8.0) - math.sin(2.0 * math.pi * k / 8.0)
        shake.step(straight + turn * shaken)
    assert shake.along(along) > 1.7e-4
    assert shake.along(across) == pytest.approx(0.0, abs=1e-12)


def test_a_force_that_cycles_and_is_off_is_reported_as_both() -> None:
    loop = force_loop(ARM, PINNED)
    for k in range(420):
        ask(loop, World(400.0, force=3.0 + 0.4 * math.sin(2.0 * math.pi * k * DT / 0.2)), down(5.0))
    assert list(loop.reactions)[:2] == [Code.NOT_REACHED, Code.CYCLE]


@pytest.mark.parametrize(("lasting", "expected"), [(0.085, Code.NONE), (1.0, Code.CYCLE)])
def test_an_impact_that_bounces_is_no_limit_cycle(lasting: float, expected: Code) -> None:
    """At a touch the force turned back five times in 75 ms, and a limit cycle was reported for two seconds."""
    loop = force_loop(ARM, PINNED)
    for k in range(100):
        swing = 0.9 * (-1) ** (k // 3) if k * DT < lasting else 0.0
        ask(loop, World(400.0, force=5.0 + swing), down(5.0))
    assert loop.reaction.code is expected


def test_a_force_that_cycles_is_reported_by_name_with_its_size() -> None:
    loop = force_loop(ARM, PINNED)
    for k in range(220):
        ask(loop, World(400.0, force=5.0 + 0.4 * math.sin(2.0 * math.pi * k * DT / 0.2)), down(5.0))
    assert loop.reaction.code is Code.CYCLE
    assert "0.2 s about 5 N" in sentence(loop.reaction)
    for _ in range(220):
        ask(loop, World(400.0, force=5.0), down(5.0))
    assert loop.reaction.code is Code.NONE


@pytest.mark.slow
@pytest.mark.parametrize(
    ("feedback", "swing", "surface_speed", "share"),
    [
        ("contact_estimate", 0.8, 0.0, 0.5),
        ("contact_estimate", 0.22, 0.0, 0.5),
        ("contact_estimate", 0.1, 0.0, 1.0),
        ("contact_estimate", 0.22, 0.001, 1.0),
        ("joint_sensors", 0.8, 0.0, 1.0),
    ],
)
def test_where_the_late_force_of_the_motors_swings_the_arm_is_slowed_down(
    feedback: str, swing: float, surface_speed: float, share: float
) -> None:
    """The swing dies then; slower still, the motors would not show how the force creeps away.

    It is slowed down by less of a swing than is reported, unless the surface moves and swings the force itself.
    """
    speeds = []
    for size in (0.0, swing):
        limits = replace(LIMITS, surface_speed=surface_speed)
        loop = force_loop(ARM, replace(PINNED, feedback=feedback, limits=limits))
        for k in range(321):
            force = 5.0 + size * math.sin(2.0 * math.pi * k * DT / 0.2) - 0.2 * (k == 320)
            world = World(400.0, force=force)
            torques = (-force * lever(world.q)).tolist()
            out = ask(loop, world, down(5.0), contact=TOUCHED, external=torques)
        speeds.append(float(out.axis.lever @ out.velocity))
    assert speeds[1] == pytest.approx(share * speeds[0], rel=0.1)
    if swing < 0.8:
        assert loop.reaction.code is Code.NONE


def test_a_pinned_force_that_is_known_badly_is_reported_with_its_uncertainty() -> None:
    loop = force_loop(ARM, PINNED)
    for _ in range(200):
        ask(loop, World(400.0, force=0.6), down(0.6))
    assert loop.reaction.code is Code.UNCERTAIN
    assert "the force is known to +-0.077 N" in sentence(loop.reaction)
    for _ in range(200):
        ask(loop, World(400.0, force=15.0), down(15.0))
    assert loop.reaction.code is Code.NONE


def test_errors_of_torques_count_less_than_friction_in_what_is_reported() -> None:
    """Those found are half of what is stated; friction is bounded by little more than its standard deviation."""
    for friction, torque_sd, reaction in (
        (0.0, 0.15, Code.NONE),
        (0.0, 0.25, Code.UNCERTAIN),
    ):
        sensing = replace(PINNED.sensing, friction=friction, torque_sd=torque_sd, reported_fraction=0.04)
        loop = force_loop(ARM, replace(PINNED, sensing=sensing))
        for _ in range(200):
            out = ask(loop, World(400.0, force=4.0), down(4.0))
        assert loop.reaction.code is reaction, out.axis.force_sd


@pytest.mark.slow
def test_an_error_of_the_measured_force_leaves_less_to_what_is_not_known() -> None:
    """8 % are measured, and 7 % are not known: the true force may well be off by more than 10 %."""
    loop = force_loop(ARM, PINNED)
    for measured, reaction in ((2.5, Code.NONE), (2.7, Code.UNCERTAIN)):
        for _ in range(420):
            ask(loop, World(400.0, force=measured), down(2.5))
        assert loop.reaction.code is reaction


def test_an_arm_that_shakes_too_much_for_the_surface_holds_until_more_force_is_commanded() -> None:
    """The motion is watched before the arm moves: what it touches then does not count as shaking."""
    own = replace(OWN, feedback="contact_estimate", contact_source="pinned")
    stiff = replace(own, guard=replace(own.guard, contact_stiffness=1e5))
    shared = CONFIGURATION.shared
    loop = ForceLoop(ARM, shared.servo, stiff, replace(shared.timing, dither_cycle=40))
    world, axis = World(1e-9), lever(POSE)

    def press(force: float, amplitude: float, periods: int = 60) -> ForceOutput:
        for k in range(periods):
            world.q = (POSE + amplitude * math.sin(2.0 * math.pi * k / 8.0) * axis / float(axis @ axis)).tolist()
            out = ask(loop, world, down(force), external=STILL)
        return out

    out = press(5.0, 1e-4)
    assert loop.reaction.code is Code.SHAKEN
    assert "where no surface is as stiff, lower guard.contact_stiffness" in sentence(loop.reaction)
    assert float(axis @ out.velocity) == pytest.approx(0.0, abs=2e-3)
    advised = re.search(r"command (\S+) N", sentence(loop.reaction))
    assert advised, sentence(loop.reaction)
    assert float(axis @ press(float(advised[1]), 1e-4).velocity) > 0.005, "more force is commanded"
    ask(loop, world, None)
    press(3.0, 0.0)
    assert loop.reaction.code is Code.NONE
    press(3.0, 1e-4)
    assert loop.reaction.code is Code.NONE, "the motion that was there before counts"


@pytest.mark.parametrize("samples", [8, 16, 32])
def test_the_shaking_is_watched_for_a_whole_cycle_of_the_dither(samples: int) -> None:
    """Of a part of a slow one little more than its slope is seen, which is taken for the course of the arm."""
    own = replace(OWN, feedback="contact_estimate", contact_source="pinned")
    stiff, shared = replace(own, guard=replace(own.guard, contact_stiffness=1e5)), CONFIGURATION.shared
    loop = ForceLoop(ARM, shared.servo, stiff, replace(shared.timing, dither_cycle=5 * samples))
    world, axis, size = World(1e-9), lever(POSE), 1e-4 * (samples / 8.0) ** 2  # as much acceleration
    for k in range(60):
        swing = size * math.sin(2.0 * math.pi * k / samples)
        world.q = (POSE + swing * axis / float(axis @ axis)).tolist()
        ask(loop, world, down(5.0), external=STILL)
    assert loop.reaction.code is Code.SHAKEN
    assert f"the arm shakes by {2.0 * size:.3g} m" in sentence(loop.reaction)


def test_what_is_advised_in_place_of_a_force_that_is_not_detected_does_not_shake_the_arm_too_much_either() -> None:
    own = replace(OWN, feedback="contact_estimate", contact_source="pinned")
    sensing = replace(own.sensing, force_sd_limit=1e9, stated_fraction=1e9)
    for amplitude, advised in ((1e-6, 8.0), (1e-4, 25.0)):
        stiff = replace(own, sensing=sensing, guard=replace(own.guard, contact_stiffness=1e5))
        timing = replace(CONFIGURATION.shared.timing, dither_cycle=40)
        loop, world, axis = ForceLoop(ARM, CONFIGURATION.shared.servo, stiff, timing), World(1e-9), lever(POSE)
        sd = 5.0 * float(np.linalg.norm(axis)) / 4.5
        for k in range(60):
            world.q = (POSE + amplitude * math.sin(2.0 * math.pi * k / 8.0) * axis / float(axis @ axis)).tolist()
            ask(loop, world, down(5.0), external=STILL, external_sd=[sd] * 4)
        assert loop.reaction.code is Code.NOT_SENSED
        assert f"command {advised:g} N" in sentence(loop.reaction)


def test_where_the_arm_would_shake_less_in_another_pose_it_is_advised() -> None:
    """The joints are taken to shake there as they do here."""
    own = replace(OWN, feedback="contact_estimate", contact_source="pinned")
    stiff = replace(own, guard=replace(own.guard, contact_stiffness=1e5))
    timing = replace(CONFIGURATION.shared.timing, dither_cycle=40)

    def shaken(pose: list[float]) -> ForceLoop:
        loop, world = ForceLoop(ARM, CONFIGURATION.shared.servo, stiff, timing), World(1e-9)
        for k in range(60):
            world.q = [*pose[:3], pose[3] + 1.2e-4 * math.sin(2.0 * math.pi * k / 8.0)]
            ask(loop, world, down(3.0), external=STILL)
        return loop

    loop = shaken(list(POSE))
    assert loop.reaction.code is Code.SHAKEN
    turned = re.search(r"turn joint4 from \S+ to (\S+) rad", sentence(loop.reaction))
    assert turned, sentence(loop.reaction)
    assert shaken([*POSE[:3], float(turned[1])]).reaction.code is Code.NONE


def test_an_arm_that_would_swing_on_the_surface_in_resonance_with_the_dither_holds() -> None:
    """A softer surface is followed; where mass, cables and surface swing alike, 2 N became 12 N in every cycle."""
    timing = replace(CONFIGURATION.shared.timing, dither_cycle=40)
    own = replace(OWN, feedback="contact_estimate", contact_source="pinned")
    free = ask(force_loop(ARM, own), World(1e-9), down(5.0), external=STILL).axis
    alike = 1.0 / (1.0 / (free.impact_mass * (2.0 * math.pi / (40 * timing.period)) ** 2) - free.compliance)
    for part, reaction in ((0.2, Code.NONE), (1.0, Code.SHAKEN)):
        stiff = replace(own, guard=replace(own.guard, contact_stiffness=part * alike))
        loop, world, axis = ForceLoop(ARM, CONFIGURATION.shared.servo, stiff, timing), World(1e-9), lever(POSE)
        for k in range(60):
            world.q = (POSE + 1.5e-5 * math.sin(2.0 * math.pi * k / 8.0) * axis / float(axis @ axis)).tolist()
            ask(loop, world, down(2.5), external=STILL)
        assert loop.reaction.code is reaction


@pytest.mark.parametrize(("before", "quiet"), [(4.0, 30), (5.0, 102)])
def test_a_reported_force_stays_so_until_it_has_been_right_for_some_time(before: float, quiet: int) -> None:
    """For the whole settling time where it had been right before: what takes it away comes again."""
    loop = force_loop(ARM, PINNED)
    reactions = []
    for force, periods in ((before, 20), (4.0, 110), (5.0, quiet - 10), (5.0, 10)):
        for _ in range(periods):
            ask(loop, World(400.0, force=force), down(5.0))
        reactions.append(loop.reaction.code)
    late, now = Code.NOT_REACHED, Code.NONE
    assert reactions == [now, late, late, now]


@pytest.mark.parametrize(
    ("source", "feedback", "is_fed"),
    [
        ("pinned", "contact_estimate", True),
        ("estimated", "contact_estimate", False),
        ("pinned", "joint_sensors", False),
    ],
)
def test_from_the_motors_the_torque_of_a_force_is_fed_forward_after_the_touch(
    source: str, feedback: str, is_fed: bool
) -> None:
    """The velocity loop would wind up to it in seconds."""
    own = replace(OWN, feedback=feedback, contact_source=source, friction_feedforward=0.0)
    loop, torques = force_loop(ARM, own), 4.0 * lever(POSE)
    efforts = []
    for force in (0.0, 4.0):
        for _ in range(30):
            touch = TOUCHED if force else NO_CONTACT
            external = (-torques * force / 4.0).tolist()
            efforts.append(ask(loop, World(400.0, force=force), down(4.0), contact=touch, external=external).effort)
    assert not np.any(efforts[:30]), "a free arm would be thrown"
    assert efforts[45] == pytest.approx(is_fed * 16 / 60 * torques, abs=1e-6)
    assert efforts[59] == pytest.approx(is_fed * 0.5 * torques, abs=1e-6)
