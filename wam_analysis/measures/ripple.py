"""Torque ripple by the angle of a pulley."""

import math
from typing import NamedTuple

import numpy as np

from wam_analysis.thresholds import SHAFT
from wam_bag.arrays import Numbers, Rows


class Ripple(NamedTuple):
    """Spectrum over the angle of a pulley.

    Attributes
    ----------
    order : (k,), cycles per turn, 1 to k.
    amplitude : (k,), N m (half of the peak to peak of each).
    turns : range of the angle in turns; at least 1 is needed, in practice 1.2.
    """

    order: Rows
    amplitude: Numbers
    turns: float


NO_RIPPLE = Ripple(np.empty(0, dtype=np.int64), np.empty(0), 0.0)


def ripple_spectrum(angle: Numbers, torque: Numbers, orders: int) -> Ripple:
    """Amplitude of each order of the angle, by least squares over all orders at once.

    The shaft may rest, reverse or turn at any speed, because nothing is resampled; equal angles are
    averaged first.  A slow drift over the range, up to the third power, is fitted together with the orders.

    Parameters
    ----------
    angle : (n,), of the pulley, rad.
    torque : (n,), N m, in one direction of motion, or without friction.
    orders : highest order.

    Returns
    -------
    Ripple
        without any order if the pulley made less than one turn, there are too few angles, or gaps between them.
    """
    if not len(angle):
        return NO_RIPPLE
    turns = float(np.ptp(angle)) / (2.0 * math.pi)
    cell = np.floor((angle - np.min(angle)) * (2.0 * SHAFT.cells * orders / (2.0 * math.pi))).astype(np.int64)
    count = np.bincount(cell)
    seen = np.flatnonzero(count)
    drift = 4
    if turns < 1.0 or len(seen) < 2 * orders + drift + 1:
        return NO_RIPPLE._replace(turns=turns)
    number = count[seen]
    at = np.bincount(cell, angle)[seen] / number
    mean = np.bincount(cell, torque)[seen] / number
    k = np.arange(1, orders + 1)
    steady = np.polynomial.chebyshev.chebvander(2.0 * (at - at.min()) / np.ptp(at) - 1.0, drift - 1)
    columns = np.hstack([np.sin(np.outer(at, k)), np.cos(np.outer(at, k)), steady])
    weight = np.sqrt(number)[:, np.newaxis]
    solution, _, _, singular = np.linalg.lstsq(weight * columns, weight[:, 0] * mean, rcond=None)
    if singular[0] > SHAFT.determined * singular[-1]:
        return NO_RIPPLE._replace(turns=turns)
    sine, cosine = solution[:orders], solution[orders : 2 * orders]
    return Ripple(k, np.hypot(sine, cosine), turns)
