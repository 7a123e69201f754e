"""Exact sampling of a linear system: the only matrix exponential of the project."""

import math

import numpy as np

from wam_theory.arguments import Array

TERMS = 15  # of the Taylor series, of a matrix whose norm is at most 1/16: 1/(16^16 16!) is left out


def zero_order_hold(rate: Array, inlet: Array, period: float) -> tuple[Array, Array]:
    """Matrices that carry x' = A x + B u over one period in which u is held.

    Parameters
    ----------
    rate : A, (n, n).
    inlet : B, (n, m).
    period : s.

    Returns
    -------
    (n, n), (n, m)
        x at the end per x and per u at its start, both from exp([[A, B], [0, 0]] period), by scaling and squaring.
    """
    rows, columns = inlet.shape
    step = np.zeros((rows + columns, rows + columns))
    step[:rows, :rows], step[:rows, rows:] = rate * period, inlet * period
    halvings = max(0, math.ceil(math.log2(max(1.0, float(np.abs(step).sum(axis=1).max()))))) + 4
    term = total = np.eye(rows + columns)
    for power in range(1, TERMS + 1):
        term = term @ step / (power * 2.0**halvings)
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return total[:rows, :rows], total[:rows, rows:]
