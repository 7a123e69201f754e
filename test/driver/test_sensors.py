"""Sensors: steps, differences and noise with the configured statistics."""

import dataclasses
import math

import numpy as np
import pytest
from arms import CONFIGURATION, WAM

from wam_description.parameters import ParameterError
from wam_description.signals import State
from wam_driver.driver import DriverParameters
from wam_driver.sensors import Sensors

DT = 1e-3
PERFECT = CONFIGURATION.node("driver", DriverParameters).sensors
ZERO = [0.0] * 4
DRAWS = 40_000


def sensors(seed: int = 1, **parameters: tuple[float, ...]) -> Sensors:
    return Sensors(WAM, dataclasses.replace(PERFECT, **parameters), np.random.default_rng(seed))


def test_perfect_sensors_pass_values_through_unchanged() -> None:
    perfect = sensors()
    theta, thetad, torque = [0.1, -0.2, 3.7, 1e-9], [1.0, -2.0, 0.0, 1e3], [0.3, 0.0, -0.1, 2.0]
    for _ in range(3):
        for side in (perfect.motors, perfect.joints):
            assert side.read(State(theta, thetad, torque), DT) == (theta, thetad, torque)


def test_encoder_reads_the_nearest_of_its_steps() -> None:
    """Off by half a step at most; spread evenly, so that the mean square is step^2/12: 2 % of 40 000 readings."""
    step = 2 * math.pi / 4096
    read = sensors(encoder_resolution=(step, step, 2 * step, 0.0))
    true = np.random.default_rng(3).uniform(-9.0, 9.0, (DRAWS // 4, 4))
    found = np.array([read.motors.read(State(angles.tolist(), ZERO, ZERO), DT).position for angles in true])
    np.testing.assert_allclose(found[:, :2] / step, np.round(found[:, :2] / step), atol=1e-9)
    error = found - true
    assert np.abs(error[:, :2]).max() <= step / 2 * (1 + 1e-9)
    assert np.abs(error[:, 2]).max() > 0.9 * step
    np.testing.assert_allclose((error[:, :2] ** 2).mean(), step**2 / 12, rtol=0.02)
    np.testing.assert_array_equal(error[:, 3], 0.0)


def test_joint_encoders_have_one_resolution_for_all_or_one_each() -> None:
    angles = [0.24, 0.26, -0.31, 1.0]
    for resolution, expected in (((0.1,), [0.2, 0.3, -0.3, 1.0]), ((0.1, 0.0, 1.0, 0.0), [0.2, 0.26, 0.0, 1.0])):
        joints = sensors(joint_encoder_resolution=resolution).joints
        assert joints.read(State(angles, ZERO, ZERO), DT).position == pytest.approx(expected)
    with pytest.raises(ParameterError, match="joint_encoder_resolution"):
        sensors(joint_encoder_resolution=(0.1, 0.1))


def test_velocity_of_a_real_encoder_is_the_difference_of_two_readings() -> None:
    step = 1e-3
    read = sensors(encoder_resolution=(step,) * 4)
    assert read.motors.read(State([0.25] * 4, [7.0] * 4, ZERO), DT).velocity == ZERO  # there is no reading before it
    angles = [0.2504, 0.2506, 0.2494, 0.3]
    expected = [0.0, step / DT, -step / DT, 50 * step / DT]
    np.testing.assert_allclose(read.motors.read(State(angles, [7.0] * 4, ZERO), DT).velocity, expected, atol=1e-9)
    np.testing.assert_allclose(read.motors.read(State(angles, [7.0] * 4, ZERO), 2 * DT).velocity, 0.0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("side", ["motors", "joints"])
def test_noise_of_an_angle_has_its_standard_deviation_and_no_offset_and_no_memory(side: str) -> None:
    """2 % and 2 % of a standard deviation: four sigma of 40 000 draws."""
    deviation = (1e-3, 2e-3, 0.0, 5e-4)
    read = sensors(**{"encoder_noise" if side == "motors" else "joint_encoder_noise": deviation})
    true = State([1.0, 2.0, 3.0, 4.0], ZERO, [0.5] * 4)
    states = [getattr(read, side).read(true, DT) for _ in range(DRAWS)]
    error = np.array([state.position for state in states]) - [1.0, 2.0, 3.0, 4.0]
    np.testing.assert_allclose(error.std(axis=0), deviation, rtol=0.02)
    assert np.all(np.abs(error.mean(axis=0)) <= 0.02 * np.array(deviation))
    normal = np.delete(error, 2, axis=1) / np.delete(deviation, 2)
    np.testing.assert_allclose(np.corrcoef(normal.T), np.eye(3), atol=0.025)
    np.testing.assert_allclose((normal[1:] * normal[:-1]).mean(axis=0), 0.0, atol=0.025)
    assert (np.abs(normal) < 1).mean() == pytest.approx(0.6827, abs=0.01)
    velocity = np.array([state.velocity for state in states])
    np.testing.assert_allclose(velocity[1:], np.diff(error, axis=0) / DT, atol=1e-9)
    assert all(state.effort == [0.5] * 4 for state in states)


@pytest.mark.slow
def test_noise_of_the_strain_gauges_has_its_standard_deviation_and_leaves_the_angles_alone() -> None:
    deviation = (0.02, 0.0, 0.05, 0.01)
    read = sensors(strain_noise=deviation)
    states = [read.joints.read(State([1.0] * 4, [2.0] * 4, [3.0, 4.0, 5.0, 6.0]), DT) for _ in range(DRAWS)]
    error = np.array([state.effort for state in states]) - [3.0, 4.0, 5.0, 6.0]
    np.testing.assert_allclose(error.std(axis=0), deviation, rtol=0.02)
    assert np.all(np.abs(error.mean(axis=0)) <= 0.02 * np.array(deviation))
    assert all(state.position == [1.0] * 4 and state.velocity == [2.0] * 4 for state in states)
