"""The amplifier against the closed form of I2t."""

import dataclasses
import math

import numpy as np
import pytest
from arms import CONFIGURATION, WAM

from wam_driver.amplifier import Amplifier
from wam_driver.driver import DriverParameters

DT = 1e-3
THERMAL_TIME = 2.0
PEAK = WAM.motors.peak_torque[0] / WAM.motors.torque_constant[0]
CONTINUOUS = WAM.motors.continuous_torque[0] / WAM.motors.torque_constant[0]
REST = [0.0, 0.0, 0.0]


def amplifier() -> Amplifier:
    perfect = CONFIGURATION.node("driver", DriverParameters).amplifier
    parameters = dataclasses.replace(perfect, thermal_time=THERMAL_TIME)
    return Amplifier(WAM.motors, parameters, np.random.default_rng(0))


def heat_up(amp: Amplifier) -> None:
    """Peak current in motor 1 until it is limited."""
    for _ in range(round(THERMAL_TIME / DT)):
        if amp.step([PEAK, *REST], DT)[0] < PEAK:
            return
    raise AssertionError("the peak current was never limited")


def seconds_to_limit(asked: float) -> float:
    """Time until motor 1 gets less than it asks for."""
    amp, ticks = amplifier(), 0
    while amp.step([asked, *REST], DT)[0] == asked:
        ticks += 1
        assert ticks * DT < 10 * THERMAL_TIME
    return ticks * DT


def test_current_clips_at_peak_on_both_sides_and_below_passes_unchanged() -> None:
    amp = amplifier()
    assert amp.step([1e3, -1e3, 0.9 * PEAK, -0.1], DT) == [PEAK, -PEAK, 0.9 * PEAK, -0.1]


def test_torque_is_current_times_torque_constant() -> None:
    assert amplifier().nominal_torque([1.0, -2.0, 0.0, 4.0]) == [0.25, -0.5, 0.0, 1.0]
    amp = amplifier()
    assert amp.torque(amp.step([1e3] * 4, DT), [0.3] * 4) == pytest.approx(WAM.motors.peak_torque)


@pytest.mark.parametrize("share", [1.2, 2.0, PEAK / CONTINUOUS])
def test_limit_falls_to_continuous_when_the_winding_is_hot(share: float) -> None:
    """Heat r^2 (1 - exp(-t/T)) reaches 1 at t = T ln(r^2/(r^2 - 1))."""
    expected = THERMAL_TIME * math.log(share**2 / (share**2 - 1))
    assert seconds_to_limit(share * CONTINUOUS) == pytest.approx(expected, abs=2 * DT)


def test_continuous_current_can_be_held_for_ever() -> None:
    amp = amplifier()
    for _ in range(20_000):
        assert amp.step([CONTINUOUS, *REST], DT)[0] == CONTINUOUS


def test_hot_winding_gets_the_continuous_current_and_no_more() -> None:
    amp = amplifier()
    for _ in range(round(1.5 * THERMAL_TIME / DT)):
        flowing = amp.step([1e3, *REST], DT)
    assert amp.heat[0] >= 1.0
    for _ in range(20_000):
        flowing = amp.step([1e3, *REST], DT)
        assert flowing[0] == CONTINUOUS
    assert amp.heat[1:] == [0.0] * 3


def test_winding_cools_with_its_time_constant_and_gives_peak_again() -> None:
    amp = amplifier()
    heat_up(amp)
    assert amp.step([PEAK, *REST], DT)[0] == CONTINUOUS
    hot = amp.heat[0]
    for _ in range(round(THERMAL_TIME / DT)):
        amp.step([0.0, *REST], DT)
    assert amp.heat[0] == pytest.approx(hot * math.exp(-1.0), rel=1e-3)
    assert amp.step([PEAK, *REST], DT)[0] == PEAK


def test_reset_forgets_the_heat() -> None:
    amp = amplifier()
    heat_up(amp)
    amp.reset()
    assert amp.heat == [0.0] * 4
    assert amp.step([PEAK, *REST], DT)[0] == PEAK
