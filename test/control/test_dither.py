"""The dither of the motor torques: when, how large, and what it costs."""

import dataclasses
import math

import numpy as np
import pytest
from arms import CONFIGURATION, WAM

from wam_control.velocity.dither import Dither, DitherParameters, friction_at_motors
from wam_control.velocity.velocity_loop import VelocityLoopParameters
from wam_description.parameters import ParameterError

TIMING = dataclasses.replace(CONFIGURATION.shared.timing, dither_cycle=40)
PARAMETERS = CONFIGURATION.node("velocity_loop", VelocityLoopParameters).dither
POSE = (0.0, -0.6, 0.0, 0.5)


def test_it_is_off_unless_a_cycle_is_given() -> None:
    off = Dither(WAM, CONFIGURATION.shared.timing, PARAMETERS)
    assert CONFIGURATION.shared.timing.dither_cycle == 0
    assert off.torque(5_000_000) == []
    assert off.added(5_000_000, [1.0, 2.0, 3.0, 4.0]) == [1.0, 2.0, 3.0, 4.0]
    assert off.cost(POSE).tip_motion == 0.0
    assert off.cost(POSE).heat == (0.0,) * 4


def test_it_is_a_sine_of_25_hertz_that_adds_nothing_over_a_cycle() -> None:
    dither = Dither(WAM, TIMING, PARAMETERS)
    rows = np.array([dither.torque(k * TIMING.period_ns) for k in range(1, 81)])
    np.testing.assert_allclose(rows[:40].sum(axis=0), 0.0, atol=1e-12)
    assert np.array_equal(rows[:40], rows[40:])
    k = np.arange(1, 81)
    np.testing.assert_allclose(rows[:, 0], dither.amplitude[0] * np.sin(2 * math.pi * 25.0 * k * 1e-3), atol=1e-12)
    np.testing.assert_allclose(rows[:, 2], dither.amplitude[2] * np.cos(2 * math.pi * 25.0 * k * 1e-3), atol=1e-12)


def test_its_amplitude_follows_the_friction_that_each_motor_overcomes() -> None:
    """By hand: joint 2 is moved by motors 2 and 3 with 30.4 each, joint 3 with 15.2 each."""
    motors, joints = WAM.motors.static_friction, WAM.joints.static_friction
    shared = joints[1] / (2 * 30.40) + joints[2] / (2 * 15.20)
    by_hand = [motors[0] + joints[0] / 29.97, motors[1] + shared, motors[2] + shared, motors[3] + joints[3] / 19.15]
    np.testing.assert_allclose(friction_at_motors(WAM), by_hand, rtol=1e-9)
    dither = Dither(WAM, TIMING, DitherParameters(1.5, (0.0,) * 4))
    np.testing.assert_allclose(dither.amplitude, [1.5 * level for level in by_hand], rtol=1e-9)


def test_joints_2_and_3_are_both_dithered_because_their_motors_are_out_of_phase() -> None:
    """By hand: joint 2 has 30.4 (tau3 - tau2), joint 3 -15.2 (tau2 + tau3); in phase nothing is left at joint 2."""
    swings = {}
    for name, phase in (("configured", PARAMETERS.phase), ("in phase", (0.0,) * 4)):
        dither = Dither(WAM, TIMING, DitherParameters(PARAMETERS.level, phase))
        rows = np.array([dither.torque(k * TIMING.period_ns) for k in range(40)])
        swings[name] = (
            np.abs(30.4 * (rows[:, 2] - rows[:, 1])).max() / (2 * 30.4 * dither.amplitude[1]),
            np.abs(15.2 * (rows[:, 1] + rows[:, 2])).max() / (2 * 15.2 * dither.amplitude[1]),
        )
    assert min(swings["configured"]) > 0.7
    assert swings["in phase"][0] == 0.0


def test_its_cost_is_below_half_a_percent_of_heat_and_a_few_millimetres() -> None:
    cost = Dither(WAM, TIMING, PARAMETERS).cost(POSE)
    assert 0.0 < max(cost.heat) < 0.005
    assert 0.5e-3 < cost.tip_motion < 5e-3  # without friction; with it a tenth, test_contact_traps.py
    slower = Dither(WAM, dataclasses.replace(TIMING, dither_cycle=80), PARAMETERS).cost(POSE)
    assert slower.tip_motion == pytest.approx(4.0 * cost.tip_motion, rel=0.02)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"dither.phase.*2 values; it needs 4"):
        Dither(WAM, TIMING, DitherParameters(1.0, (0.0, 0.0)))
    with pytest.raises(ParameterError, match=r"dither_cycle.*at least 4"):
        Dither(WAM, dataclasses.replace(TIMING, dither_cycle=2), PARAMETERS)
