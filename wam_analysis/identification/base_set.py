"""Combinations of inertial parameters that gravity torques depend on (base parameters; Gautier & Khalil 1990)."""

import numpy as np
from numpy.typing import NDArray

from wam_analysis.thresholds import IDENTIFY
from wam_description.arm import Arm
from wam_description.rigid_body import RigidBody

NAMES = ("mass", "moment_x", "moment_y", "moment_z")


def gravity_base_set(arm: Arm) -> tuple[str, ...]:
    """Each combination as text, the parameter of the outermost link first, as 'moment_x.link4'."""
    columns, names = _columns(arm)
    chosen: list[int] = []
    for i in range(len(names)):
        if np.linalg.norm(_rest(columns[:, chosen], columns[:, i])) > IDENTIFY.dependent * np.abs(columns).max():
            chosen.append(i)
    factors = np.linalg.lstsq(columns[:, chosen], columns, rcond=None)[0]
    return tuple(
        " ".join(
            _term(factors[row, i], names[i], i == place)
            for i in range(len(names))
            if abs(factors[row, i]) > IDENTIFY.shown
        )
        for row, place in enumerate(chosen)
    )


def _columns(arm: Arm) -> tuple[NDArray[np.float64], list[str]]:
    """Gravity torque in random poses per moment, then per mass of each link, the outermost first."""
    n = len(arm.joints.names)
    random = np.random.Generator(np.random.PCG64(IDENTIFY.seed))
    body, rest = RigidBody(arm), np.zeros(n)
    poses = random.uniform(arm.joints.lower, arm.joints.upper, (IDENTIFY.poses, n))
    every = np.vstack([body.inverse_dynamics_regressor(q, rest, rest) for q in poses])
    order = [(i, k) for i in reversed(range(n)) for k in (1, 2, 3)] + [(i, 0) for i in reversed(range(n))]
    return every[:, [10 * i + k for i, k in order]], [f"{NAMES[k]}.{arm.links.names[i]}" for i, k in order]


def _rest(columns: NDArray[np.float64], column: NDArray[np.float64]) -> NDArray[np.float64]:
    """What of a column others do not make up."""
    found: NDArray[np.float64] = column - columns @ np.linalg.lstsq(columns, column, rcond=None)[0]
    return found


def _term(factor: float, name: str, is_first: bool) -> str:
    if is_first:
        return name
    size = "" if abs(abs(factor) - 1.0) < IDENTIFY.shown else f"{abs(factor):.4g} "
    return f"{'+' if factor > 0.0 else '-'} {size}{name}"
