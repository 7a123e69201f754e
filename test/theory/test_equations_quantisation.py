"""Integral force control on a force that is read in steps: against small steps in time of the node of figure 5.4."""

import math

import numpy as np
import pytest

from wam_theory.linear_loop import gain_ratio
from wam_theory.quantisation import hunting, quantised_cycle_period, threshold

J, B, KTR, KC, STEP = 1.0, 1.0, 2.0, 2.0, 1.0


def stepped(gain: float, desired: float, friction: float, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """F_c and x_m over time, every 0.002 s; with friction the node has no inertia and sticks."""
    h, x, v, motor = 0.002, desired / KC, 0.0, 2.0 * desired / KTR
    force, motors = [], []
    for _ in range(round(seconds / h)):
        read = STEP * math.floor(KC * x / STEP + 0.5)
        motor += h * gain * (desired - read)
        net = KTR * (motor - x) - KC * x
        if friction:
            x += math.copysign(max(abs(net) - friction, 0.0), net) / (KTR + KC)
        else:
            v += h * (net - B * v) / J
            x += h * v
        force.append(KC * x)
        motors.append(motor)
    return np.array(force), np.array(motors)


def rises(value: np.ndarray) -> np.ndarray:
    level = 0.5 * (value.max() + value.min())
    return np.flatnonzero((value[1:] > level) & (value[:-1] <= level))


@pytest.mark.parametrize("desired", [4.5, 4.3])
def test_force_hunts_about_the_border_of_two_steps(desired: float) -> None:
    """A tenth: the describing function neglects the harmonics, which the node filters poorly."""
    gain = 0.1
    force, _ = stepped(gain, desired, 0.0, 200.0)
    late = force[len(force) // 2 :]
    assert late.mean() == pytest.approx(float(threshold(desired, STEP)), abs=0.05)
    gamma = float(gain_ratio(gain, J, B, KTR, KC))
    assert np.ptp(late) == pytest.approx(float(hunting(STEP, gamma, desired)), rel=0.1)
    period = np.diff(rises(late)).mean() * 0.002
    assert period == pytest.approx(2.0 * math.pi / math.sqrt((KTR + KC) / J), rel=0.1)


@pytest.mark.slow
def test_friction_makes_the_motor_cycle_with_a_period_that_stays() -> None:
    gain, desired, friction = 0.01, 4.3, 0.3
    force, motor = stepped(gain, desired, friction, 2000.0)
    late = motor[len(motor) // 2 :]
    periods = np.diff(rises(late)) * 0.002
    assert periods == pytest.approx(np.full(len(periods), periods[0]), rel=1e-3)
    assert periods[0] == pytest.approx(float(quantised_cycle_period(gain, KTR, friction, desired, STEP)), rel=0.01)
    assert np.ptp(late) == pytest.approx(2.0 * friction / KTR, rel=0.01)
    assert force[-1] == pytest.approx(4.5, abs=0.01)


def test_force_on_a_step_is_at_rest_and_beyond_routh_without_bound() -> None:
    assert hunting(STEP, [0.5, 1.0], 4.5) == pytest.approx([2.0 / math.pi, math.inf])
    with pytest.raises(ValueError, match="multiple of step"):
        quantised_cycle_period(0.01, KTR, 0.3, 4.0, STEP)
