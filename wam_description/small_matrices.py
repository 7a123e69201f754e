"""Rotations, and products and inverses of small matrices where a general function of numpy takes longer."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def _direct(name: str, usual: Callable[..., Any]) -> Callable[..., Any]:
    """What a function of numpy.linalg calls once it has looked at its arrays; the function where numpy has it no more.

    On small arrays this look takes most of the time.  Of a singular matrix all results are not numbers.
    """
    found: Callable[..., Any] = getattr(getattr(np.linalg, "_umath_linalg", None), name, usual)
    return found


_inverse, _solve = _direct("inv", np.linalg.inv), _direct("solve1", np.linalg.solve)
_eigenvalues = _direct("eigvalsh_lo", np.linalg.eigvalsh)


def inverse(matrix: Array) -> Array:
    """Inverse of a matrix (n, n), with the bits of numpy.linalg.inv in a third of its time.

    Raises
    ------
    numpy.linalg.LinAlgError
        where it is singular.
    """
    found: Array = _inverse(matrix)
    return np.asarray(np.linalg.inv(matrix), np.float64) if math.isnan(found.item(0)) else found


def solution(matrix: Array, right: Array) -> Array:
    """Solution (n,) for a matrix (n, n) and a right side (n,), with the bits of numpy.linalg.solve, as `inverse`."""
    found: Array = _solve(matrix, right)
    return np.asarray(np.linalg.solve(matrix, right), np.float64) if math.isnan(found.item(0)) else found


def largest_eigenvalue(matrix: Array) -> float:
    """Of a symmetric matrix (n, n), with the bits of numpy.linalg.eigvalsh in a fifth of its time."""
    return float(_eigenvalues(matrix).item(-1))


def length(vector: Array) -> float:
    """Length of a vector (n,), with the bits of numpy.linalg.norm in a third of its time."""
    return math.sqrt(vector.dot(vector))


def outer(first: Array, second: Array) -> Array:
    """Outer product (n, m) of two vectors, with the bits of numpy.outer in a third of its time."""
    return first[:, None] * second


def cross(first: Sequence[float], second: Sequence[float]) -> tuple[float, float, float]:
    """Cross product of two vectors (3,), with the bits of numpy.cross in a tenth of its time."""
    (a, b, c), (x, y, z) = first, second
    return b * z - c * y, c * x - a * z, a * y - b * x


def rotation_xyz(roll: float, pitch: float, yaw: float) -> Array:
    """Rotation matrix (3, 3) of URDF's roll, pitch, yaw: about fixed x, then y, then z."""
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
