"""The law of an axis beside the exact integrator's, and what protects a user of the force loop."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_force_loop import ARM, BODY, DRIVEN, DT, GAIN, OWN, POSE, STILL, World, ask, down, force_loop, lever

from wam_control.force.force_law import ForceLaw
from wam_control.force.force_loop import ForceCommand, ForceInput, ForceOutput
from wam_control.force.task import AxisKind, TaskAxis, TaskCommand
from wam_description.event import refused
from wam_description.event_text import sentence
from wam_description.parameters import ParameterError
from wam_description.signals import NO_CONTACT, State
from wam_theory.stick_slip import IntegralLoop


def law(**values: tuple[float, ...]) -> ForceLaw:
    given = {"gain": (1.0,), "proportional_gain": (0.0,), "error_limit": (5.0,), "deadband": (0.0,), **values}
    return ForceLaw("force", ("x", "y", "z"), **given)


def test_the_law_is_that_of_the_exact_integrator_bit_for_bit() -> None:
    random = np.random.default_rng(5)
    for error, *sizes in random.uniform(-1.0, 1.0, (500, 4)).tolist():
        limit, share, gain = map(abs, sizes)
        deadband = limit * share
        exact = IntegralLoop(gain, limit, deadband)
        controller = law(gain=(gain,), error_limit=(limit,), deadband=(deadband,))
        assert controller.velocity(1, error, error, DT) == gain * exact.effective_error(error)


@pytest.mark.parametrize(
    ("error", "velocity"), [(0.5, 0.0), (-0.9, 0.0), (1.5, 1.0), (-3.0, -4.0), (5.0, 8.0), (9.0, 8.0), (-9.0, -8.0)]
)
def test_saturation_comes_first_and_the_deadband_is_subtracted_from_the_rest(error: float, velocity: float) -> None:
    assert law(gain=(2.0,), deadband=(1.0,)).velocity(0, error, error, DT) == pytest.approx(velocity)


def test_each_axis_has_a_law_of_its_own() -> None:
    each = law(gain=(1.0, 2.0, 3.0), error_limit=(1.0, 2.0, 4.0), deadband=(0.0, 1.0, 3.0))
    assert [each.velocity(i, 9.0, 9.0, DT) for i in range(3)] == [1.0, 2.0, 3.0]
    for n, expected in (((1, 0, 0), 1.0), ((0, 1, 0), 2.0), ((0, 0, -1), 3.0)):
        own = replace(
            OWN, force_gain=each.gain, force_error_limit=each.error_limit, force_deadband=each.deadband,
            joint_speed_limit=1e9,
        )  # fmt: skip
        out = ask(force_loop(ARM, own), World(400.0), [9.0 * c for c in n])
        assert lever(POSE, n) @ out.velocity == pytest.approx(expected, rel=1e-6)


def test_a_deadband_may_be_as_small_as_it_likes() -> None:
    small = law(deadband=(3e-170, 3e-170, 1e-160)).along((0.6, 0.0, 0.8))
    assert small.deadband == (pytest.approx(5e-170, rel=1e-9),)


def test_proportional_action_of_each_axis_has_the_saturation_of_that_axis() -> None:
    law = ForceLaw("torque", ("a", "b"), (0.0, 0.0), (0.1, 0.1), (5.0, 1.0), (0.0, 0.0))
    assert [law.velocity(axis, 3.0, 0.0, DT) for axis in (0, 1)] == pytest.approx([0.3 / DT, 0.1 / DT])


def test_proportional_action_moves_by_its_gain_times_the_change_of_force_and_not_of_the_set_point() -> None:
    own, gp = replace(OWN, force_gain=(1e-11,), force_proportional_gain=(2e-4,)), 2e-4
    loop = force_loop(ARM, own)
    along = lever(POSE)
    assert along @ ask(loop, World(400.0, force=1.0), down(4.0)).velocity == pytest.approx(0.0, abs=1e-10)
    more = ask(loop, World(400.0, force=3.0), down(4.0)).velocity
    assert along @ more * DT == pytest.approx(-gp * 2.0, rel=1e-5)
    stepped = ask(loop, World(400.0, force=3.0), down(9.0)).velocity
    assert along @ stepped == pytest.approx(0.0, abs=1e-9), "a new set point is no change of the force"
    blunt = force_loop(ARM, replace(own, force_error_limit=(0.5,)))
    ask(blunt, World(400.0, force=1.0), down(4.0))
    assert along @ ask(blunt, World(400.0, force=3.0), down(4.0)).velocity == pytest.approx(0.0, abs=1e-10)


@pytest.mark.parametrize("samples", [1, 3])
def test_a_delayed_velocity_comes_so_many_periods_later(samples: int) -> None:
    loop = force_loop(ARM, replace(OWN, delay_samples=samples))
    along = lever(POSE)
    reported = [float(along @ ask(loop, World(400.0, force=f), down(9.0)).velocity) for f in (2.0, 3.0, 4.0, 5.0, 6.0)]
    expected = [0.0] * samples + [GAIN * (9.0 - f) for f in (2.0, 3.0, 4.0, 5.0, 6.0)]
    assert reported == pytest.approx(expected[:5], rel=1e-6, abs=1e-9)
    found = []
    for value in [0.5] * 6 + [99.0] * 4 + [0.2] * 4:  # what is beyond the limit, it holds
        task = TaskCommand("base", (TaskAxis(AxisKind.VELOCITY, 0, value=value),))
        found.append(ask(loop, World(), task=task).velocity[0])
    expected = [0.0] * samples + [0.5] * (6 - samples) + [0.0] * (4 + samples) + [0.2] * (4 - samples)
    assert found == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(("change", "text"), [
    ({"force_gain": (1.0, 2.0)}, "'force_gain' has 2 values; give 3, one for each of x, y, z, or one for all"),
    ({"torque_deadband": (1.0,) * 3}, "'torque_deadband' has 3 values; give 4, one for each of joint1"),
    ({"force_deadband": (LIMIT := 20.0,)}, "force_error_limit of x is 20; it must be above force_deadband, 20"),
    ({"torque_error_limit": (5.0, 5.0, 0.0, 5.0)}, "torque_error_limit of joint3 is 0; it must be above"),
])  # fmt: skip
def test_laws_that_do_not_fit_are_refused_whole(change: dict[str, Any], text: str) -> None:
    loop = force_loop(ARM, OWN)
    with pytest.raises(ParameterError, match=text):
        loop.tune(replace(OWN, **change, posture_gain=1.0))
    assert loop.parameters == OWN


def test_the_saturation_holds_along_every_direction() -> None:
    """Axis by axis, an error along the diagonal would be sqrt(3) times as large."""
    for direction in ((0.0, 0.0, -1.0), (1.0, 1.0, 0.0), (1.0, -1.0, 1.0)):
        unit = np.array(direction) / np.linalg.norm(direction)
        out = ask(force_loop(ARM, OWN), World(400.0), (90.0 * unit).tolist())
        assert out.limited == pytest.approx(20.0 * unit)
        assert lever(POSE, unit) @ out.velocity == pytest.approx(GAIN * 20.0, rel=1e-6)


def test_a_force_that_turns_or_flips_is_measured_with_the_right_sign_at_once() -> None:
    """The filter remembers torques, not a force along a direction that is commanded no more."""
    loop = force_loop(ARM, replace(OWN, force_filter=1.0))
    for _ in range(400):
        ask(loop, World(400.0, force=5.0), down(5.0))
    assert ask(loop, World(400.0, force=5.0), down(-5.0)).measured == pytest.approx(down(5.0), abs=1e-6)


@pytest.mark.slow
def test_another_frame_begins_without_the_answers_still_delayed() -> None:
    speeds = {}
    for frame in ("base", "inner_link"):
        loop = force_loop(ARM, replace(OWN, delay_samples=5))
        for _ in range(400):
            ask(loop, World(400.0, force=9.0), down(9.5))
        rotation = np.eye(3) if frame == "base" else BODY.cover_pose(POSE, frame).rotation
        command = ForceCommand(frame, tuple((rotation.T @ down(9.5)).tolist()))
        out = ask(loop, World(400.0, force=3.0), None, command=command)
        speeds[frame] = lever(POSE) @ out.velocity
    assert speeds == {"base": pytest.approx(GAIN * 0.5, rel=0.1), "inner_link": pytest.approx(0.0, abs=1e-9)}


def test_joint_torques_begin_without_the_rate_of_an_earlier_measurement() -> None:
    own = replace(OWN, torque_gain=(0.0,), torque_proportional_gain=(1e-4,), force_filter=0.0)
    speeds = []
    for pause, force in (([1.0] * 4, 2.0), (None, 4.0)):
        loop = force_loop(ARM, own)
        ask(loop, World(400.0, force=2.0), None, torque=[1.0] * 4)
        ask(loop, World(400.0, force=force), None, torque=pause)
        speeds.append(max(map(abs, ask(loop, World(400.0, force=4.0), None, torque=[1.0] * 4).velocity)))
    assert speeds[0] > 1e-3, "G_P answers a change of the measured torque"
    assert speeds[1] == 0.0, "but not one that came while nothing was commanded"


def measured_across(torque: list[float]) -> ForceOutput:
    """Output for 3 N after 9 N, in the period in which the motors give this torque."""
    loop = force_loop(ARM, replace(OWN, force_filter=1.0, delay_samples=5))
    for _ in range(400):
        ask(loop, World(400.0, force=9.0), down(9.5))
    world = World(400.0, force=3.0)
    command = ForceCommand("base", down(9.5))
    return loop.step(ForceInput(State(POSE, STILL, torque), DT, world.sensors, NO_CONTACT, command=command))


@pytest.mark.slow
def test_brakes_and_faults_make_the_loop_forget_filter_and_delayed_answers() -> None:
    braked, driven = measured_across(STILL), measured_across(DRIVEN)
    assert braked.measured == pytest.approx(down(3.0), abs=1e-6)
    assert driven.measured == pytest.approx(down(9.0), abs=0.1), "the filter remembers"
    assert lever(POSE) @ braked.velocity == pytest.approx(0.0, abs=1e-9)
    assert lever(POSE) @ driven.velocity == pytest.approx(GAIN * 0.5, rel=0.1), "and so does the delay line"


def test_the_posture_to_hold_is_that_of_the_enabling() -> None:
    loop = force_loop(ARM, OWN)
    moved = [0.3, -1.0, 0.4, 0.9]

    def hold(q: list[float], effort: list[float]) -> list[float]:
        return loop.step(ForceInput(State(q, STILL, effort), DT, contact=NO_CONTACT)).velocity

    hold(POSE, DRIVEN)
    assert max(map(abs, hold(moved, DRIVEN))) > 0.5, "driven, the arm goes back to where it started"
    hold(moved, STILL)
    assert hold(moved, DRIVEN) == STILL, "after the brakes it holds where it is"


def test_a_force_above_the_limit_is_refused_and_the_last_good_one_remains_in_force() -> None:
    loop = force_loop(ARM, replace(OWN, force_limit=30.0))
    free = force_loop(ARM, OWN)
    for controller, force in ((loop, 10.0), (free, 31.0)):
        for newtons in (10.0, 31.0):
            out = ask(controller, World(400.0), down(newtons))
        assert -out.error[2] == pytest.approx(force)
    remains = "the last good command remains in use for inf s"  # the age of a command is not limited here
    reason = f"31 N is commanded; allowed: up to force_limit, 30 N; {remains}"
    assert loop.refusals == {"force_command": refused("force_command", reason)}
    assert free.refusals == {}
    ask(loop, World(400.0), down(29.0))
    assert loop.refusals == {}


@pytest.mark.parametrize("newtons", [5e-324, 1e-300, 1e-160, 1e-10])
def test_a_force_too_small_to_have_a_direction_is_none(newtons: float) -> None:
    pressing, none = force_loop(ARM, OWN), force_loop(ARM, OWN)
    for _ in range(3):
        out = ask(pressing, World(400.0), down(newtons))
        assert out == ask(none, World(400.0), down(0.0))


def test_a_torque_above_the_limit_is_refused_and_the_arm_holds() -> None:
    own = replace(OWN, torque_limit=4.0, force_feedforward=1.0, friction_feedforward=0.0)
    loop, found = force_loop(ARM, own), []
    for torque in ([1.0, 2.0, 0.0, 0.0], [1.0, -4.5, 0.0, 0.0]):
        found.append(ask(loop, World(1e-9), None, torque=torque).effort)
    assert found == [[1.0, 2.0, 0.0, 0.0], STILL]
    assert "4.5 N m is commanded; allowed: up to torque_limit, 4 N m" in sentence(loop.refusals["joint_torque_command"])
    loop.tune(replace(loop.parameters, torque_limit=5.0))
    assert ask(loop, World(1e-9), None, torque=torque).effort == torque
