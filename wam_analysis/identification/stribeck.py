"""The Stribeck velocity v_s of each motor: that by which held-out motion is predicted best, and its uncertainty."""

from typing import Final, NamedTuple

import numpy as np

from wam_analysis.thresholds import IDENTIFY
from wam_bag.arrays import Numbers

VELOCITIES: Final = np.geomspace(0.4, 8.0, 9)  # rad/s, of the motors


class StribeckVelocities(NamedTuple):
    """v_s of each motor, (n,), rad/s; and as it is without each part of the motion, (parts, n)."""

    velocity: Numbers
    without: Numbers


def stribeck_velocities(present: Numbers, present_errors: Numbers, errors: Numbers) -> StribeckVelocities:
    """Velocities by the squared errors of held-out motion.

    Parameters
    ----------
    present : (n,), rad/s; it is kept where no other one is clearly better.
    present_errors : (parts, n), squared errors with it, N^2 m^2.
    errors : (c, parts, n), those with each of `VELOCITIES`.
    """
    total = errors.sum(1)
    is_better = total.min(0) < (1.0 - IDENTIFY.worth) * present_errors.sum(0)
    best = np.where(is_better, _minimum(total), present)
    left_out = np.array([_minimum(total - part) for part in errors.transpose(1, 0, 2)])
    return StribeckVelocities(best, np.where(is_better, left_out, present))


def slopes(values: Numbers, velocity: Numbers) -> Numbers:
    """Change of parameters per change of ln v_s about the v_s of each motor, (n, p).

    Parameters
    ----------
    values : (c, p), parameters with each of `VELOCITIES`.
    velocity : (n,), rad/s.
    """
    upper = np.clip(np.searchsorted(VELOCITIES, velocity), 1, len(VELOCITIES) - 1)
    return (values[upper] - values[upper - 1]) / np.log(VELOCITIES[upper] / VELOCITIES[upper - 1])[:, None]


def _minimum(total: Numbers) -> Numbers:
    """Where a parabola through the least of the errors, (c, n), and its neighbours is least, (n,), rad/s."""
    at = np.clip(total.argmin(0), 1, len(total) - 2)
    motor = np.arange(total.shape[1])
    below, least, above = (total[at + i, motor] for i in (-1, 0, 1))
    curvature = below - 2.0 * least + above
    shift = np.where(curvature > 0.0, 0.5 * (below - above) / np.where(curvature > 0.0, curvature, 1.0), 0.0)
    step = np.log(VELOCITIES[1] / VELOCITIES[0])
    return VELOCITIES[at] * np.exp(step * np.clip(shift, -1.0, 1.0))
