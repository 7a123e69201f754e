"""Inverse and solution of a few equations, as numpy.linalg computes them, without what it looks at first.

For four by four numbers that takes longer than the work, as was measured: numpy's own functions
are called, and numpy.linalg itself wherever one of them finds a matrix singular.  The bits and the refusals are equal.
"""

import math
from typing import Any

import numpy as np
from numpy.linalg import _umath_linalg
from numpy.typing import NDArray

Array = NDArray[np.float64]
LAPACK: Any = _umath_linalg


def inverse(matrix: Array) -> Array:
    """Inverse of a matrix (n, n).

    Raises
    ------
    numpy.linalg.LinAlgError
        where it is singular.
    """
    found: Array = LAPACK.inv(matrix)
    if math.isnan(found.item(0)):  # all are NaN where the matrix is singular
        found = np.asarray(np.linalg.inv(matrix), np.float64)
    return found


def largest_eigenvalue(matrix: Array) -> float:
    """Largest eigenvalue of a symmetric matrix (n, n); NaN where the matrix is not finite."""
    found: float = LAPACK.eigvalsh_lo(matrix).item(-1)
    return found


def solution(matrix: Array, right: Array) -> Array:
    """The vector (n,) of which a matrix (n, n) makes a right side (n,).

    Raises
    ------
    numpy.linalg.LinAlgError
        where the matrix is singular.
    """
    found: Array = LAPACK.solve1(matrix, right)
    if math.isnan(found.item(0)):
        found = checked_solutions(matrix, right)
    return found


def solutions(matrices: Array, right: Array) -> Array:
    """The vectors (k, n) of which matrices (k, n, n) make right sides (k, n).

    Raises
    ------
    numpy.linalg.LinAlgError
        where a matrix is singular.
    """
    found: Array = LAPACK.solve1(matrices, right)
    if math.isnan(found.sum()):
        found = checked_solutions(matrices, right)
    return found


def checked_solutions(matrices: Array, right: Array) -> Array:
    """Solutions x of A x = b for one matrix A or several, by `numpy.linalg`, which refuses singular ones."""
    return np.asarray(np.linalg.solve(matrices, right[..., None])[..., 0], np.float64)
