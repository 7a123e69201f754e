"""The limit cycle of backlash in a torque loop, against small steps in time."""

import math

import numpy as np
import pytest

from wam_theory.backlash_cycle import GearedTorqueLoop, exact_cycle


def loop(critical: float, damping: float = 0.0) -> GearedTorqueLoop:
    """J = k = 1, G = 2; a play of 0.1."""
    derivative = 0.5
    return GearedTorqueLoop(1.0, 0.1, 1.0, damping, 2.0, 3.0 * (critical * derivative + damping), derivative)


def stepped(case: GearedTorqueLoop, cycles: float) -> tuple[float, float]:
    """Peak to peak of the torque and frequency, rad/s, by the classical method of Runge and Kutta."""

    def torque(x: float) -> float:
        return case.stiffness * (x - math.copysign(min(abs(x), 0.5 * case.play), x))

    def rate(s: np.ndarray) -> np.ndarray:
        x, v, w = s.tolist()
        t = torque(x)
        slope = case.stiffness * v if t else 0.0
        push = -t - case.proportional * t - w - case.derivative * slope - case.damping * v
        return np.array([v, push / case.inertia, case.integral * t])

    h, state, angles = 0.004, np.array([0.0, 0.2, 0.0]), []
    for _ in range(round(cycles * 2.0 * math.pi / h)):
        k1 = rate(state)
        k2 = rate(state + 0.5 * h * k1)
        k3 = rate(state + 0.5 * h * k2)
        state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rate(state + h * k3))
        angles.append(state[0])
    late = np.array(angles[len(angles) // 2 :])
    rises = np.flatnonzero((late[1:] > 0.0) & (late[:-1] <= 0.0))
    return 2.0 * torque(float(np.abs(late).max())), 2.0 * math.pi / (float(np.diff(rises).mean()) * h)


@pytest.mark.slow
@pytest.mark.parametrize(("critical", "damping"), [(0.4, 0.0), (0.7, 0.1)])
def test_exact_cycle_is_that_of_small_steps_in_time(critical: float, damping: float) -> None:
    torque, frequency = stepped(loop(critical, damping), 60.0)
    found = exact_cycle(loop(critical, damping))
    assert found.torque == pytest.approx(torque, rel=2e-3)
    assert found.frequency == pytest.approx(frequency, rel=2e-3)


def test_there_is_no_cycle_where_damping_suffices_without_the_derivative_or_no_play_is_needed() -> None:
    for critical in (-0.1, 1.1):
        case = loop(critical, 0.2)
        assert case.critical_gain == pytest.approx(critical)
        assert exact_cycle(case).torque == 0.0
