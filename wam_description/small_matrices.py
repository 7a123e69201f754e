"""The inverse of a matrix of floats, for which numpy promises any kind of float."""

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
