"""The amplifier against the closed form of I2t, and its imperfections against their parameters."""

import dataclasses
import math

import numpy as np
import pytest
from arms import WAM

from wam_description.configuration import Configuration, packaged
from wam_driver.amplifier import Amplifier
from wam_driver.driver import DriverParameters

DT = 1e-3
THERMAL_TIME = 2.0
PEAK = WAM.motors.peak_torque[0] / WAM.motors.torque_constant[0]
CONTINUOUS = WAM.motors.continuous_torque[0] / WAM.motors.torque_constant[0]
REST = [0.0, 0.0, 0.0]
PERFECT = Configuration.load(packaged("plain-motors")).node("driver", DriverParameters).amplifier


def amplifier(seed: int = 0, **parameters: tuple[float, ...]) -> Amplifier:
    replaced = dataclasses.replace(PERFECT, thermal_time=THERMAL_TIME, **parameters)
    return Amplifier(WAM.motors, replaced, np.random.default_rng(seed))


def heat_up(amp: Amplifier) -> None:
    """Peak current in motor 1 until it is limited."""
    for _ in range(round(THERMAL_TIME / DT)):
        if amp.step([PEAK, *REST], DT)[0] < PEAK:
            return
    raise AssertionError("the peak current was never limited")


def seconds_to_limit(commanded: float) -> float:
    """Time until motor 1 gets less than it asks for."""
    amp, ticks = amplifier(), 0
    while amp.step([commanded, *REST], DT)[0] == commanded:
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


def test_nothing_flows_within_the_deadband_and_everything_beyond() -> None:
    amp = amplifier(deadband=(0.2, 0.2, 0.2, 0.0))
    assert amp.step([0.19, -0.19, 0.0, 1e-9], DT) == [0.0, 0.0, 0.0, 1e-9]
    assert amp.step([0.2, -0.21, 3.0, 0.0], DT) == [0.2, -0.21, 3.0, 0.0]


def test_torque_ripples_by_its_share_with_its_cycles_while_the_report_does_not() -> None:
    """2 % of the torque (2.1.1), 24 times in a turn; the harmonics of one turn tell both, exactly."""
    amp = amplifier(torque_ripple=(0.02, 0.02, 0.0, 0.05), ripple_cycles=(24, 6, 24, 2))
    currents = amp.step([4.0, -2.0, 3.0, 4.0], DT)
    turn = np.arange(256) / 256 * 2 * math.pi
    torque = np.array([amp.torque(currents, [angle] * 4) for angle in turn])
    harmonics = 2 * np.abs(np.fft.rfft(torque, axis=0)) / 256
    expected = np.zeros_like(harmonics)
    expected[0] = 2 * np.abs([1.0, -0.5, 0.75, 1.0])
    expected[24, 0], expected[6, 1], expected[2, 3] = 0.02 * 1.0, 0.02 * 0.5, 0.05 * 1.0
    np.testing.assert_allclose(harmonics, expected, atol=1e-12)
    assert torque[:, 0].max() == pytest.approx(1.02, abs=1e-3)  # a sample next to the crest
    assert amp.nominal_torque(currents) == [1.0, -0.5, 0.75, 1.0]
    assert amp.torque([0.0] * 4, [0.3] * 4) == [0.0] * 4


DRAWS = 20_000


def noisy(seed: int, commanded: list[float], **parameters: tuple[float, ...]) -> np.ndarray:
    amp = amplifier(seed, current_noise=(0.02, 0.05, 0.0, 0.02), **parameters)
    return np.array([amp.step(commanded, DT) for _ in range(DRAWS)])


def test_current_noise_has_its_standard_deviation_and_no_offset() -> None:
    """3 % and 3 % of a standard deviation: four sigma of 20 000 draws."""
    error = noisy(1, [1.0, -2.0, 1.0, 3.0]) - [1.0, -2.0, 1.0, 3.0]
    deviation = np.array([0.02, 0.05, 0.0, 0.02])
    np.testing.assert_allclose(error.std(axis=0), deviation, rtol=0.03)
    assert np.all(np.abs(error.mean(axis=0)) <= 0.03 * deviation)
    normal = error[:, [0, 1, 3]]
    np.testing.assert_allclose(np.corrcoef(normal.T), np.eye(3), atol=0.03)
    assert not noisy(1, [0.1, 0.0, 0.1, 0.1], deadband=(0.2,) * 4).any(), "none where no current is commanded"
    assert np.abs(noisy(1, [PEAK, -PEAK, 0.0, 0.0])[:100]).max() == PEAK, "none beyond the peak"
