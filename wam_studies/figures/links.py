"""Numbers of figure 3.1: grasp with slender links."""

from typing import NamedTuple

import numpy as np

from wam_studies.figures.series import Numbers
from wam_theory.requisites import largest_cylinder, secure_angle, useful_length


class Grasp(NamedTuple):
    """L'/L and D_cyl/L, (coefficients, n), for each coefficient of friction over the aspect ratio L/W, (n,)."""

    aspect_ratio: Numbers
    friction: Numbers
    length: Numbers
    diameter: Numbers


def grasp() -> Grasp:
    """Useful length (3.2) and largest cylinder (3.3)."""
    ratio, friction = np.geomspace(1.5, 40.0, 200), np.array([0.2, 0.4, 0.6])
    column = friction[:, np.newaxis]
    length = useful_length(ratio, secure_angle(column))
    diameter = largest_cylinder(ratio, column)
    return Grasp(ratio, friction, length, diameter)
