"""Rotations, and products and inverses of small matrices where a general function of numpy takes longer."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def inverse(matrix: Array) -> Array:
    """Inverse of a matrix (n, n).

    Raises
    ------
    numpy.linalg.LinAlgError
        where it is singular.
    """
    return np.asarray(np.linalg.inv(matrix), np.float64)


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
