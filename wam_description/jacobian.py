"""The hand Jacobian of the WAM in closed form, (A.7) with its erratum corrected; a check of the general code."""

from math import cos, sin

import numpy as np
from numpy.typing import NDArray


def hand_jacobian_transposed(
    q: tuple[float, float, float, float], inner_length: float, outer_length: float
) -> NDArray[np.float64]:
    """J^T in hand coordinates, (A.7) with row 2, column 2 corrected to L3 c3 s4 + L4 c3.

    Parameters
    ----------
    q : four joint angles, rad.
    inner_length, outer_length : L3 and L4, m.

    Returns
    -------
    (4, 3) joint torques, N m, per force of the hand on the world in frame 5, N.
    """
    _, q2, q3, q4 = q
    s2, s3, s4, c2, c3, c4 = sin(q2), sin(q3), sin(q4), cos(q2), cos(q3), cos(q4)
    l3, l4 = inner_length, outer_length
    return np.array(
        [
            [
                -l3 * s2 * s3 * c4,
                l3 * s2 * s3 * s4 + l4 * s2 * s3,
                l4 * s2 * c3 * s4 - l4 * c2 * c4 + l3 * s2 * c3,
            ],
            [-l3 * c3 * c4, l3 * c3 * s4 + l4 * c3, -l4 * s3 * s4 - l3 * s3],
            [0.0, 0.0, -l4 * c4],
            [0.0, l4, 0.0],
        ]
    )
