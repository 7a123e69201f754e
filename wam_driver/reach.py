"""Which geoms of the plant may ever touch: a step of a world in which nothing is within reach is simpler."""

import math
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray


def within_reach(model: Any, first: int, second: int) -> bool:
    """Whether two geoms may touch at some angles of the joints; False only where it is certain that they never do.

    A geom on links that only turn stays within a distance of the base, as far as its links reach when they are
    stretched: it never touches what is fixed beyond that.
    """
    return not any(_is_beyond(model, fixed, _reach(model, one)) for one, fixed in ((first, second), (second, first)))


def _reach(model: Any, geom: int) -> float:
    """Distance from the base, m, within which a geom stays."""
    distance = _length(model.geom_pos[geom]) + (float(model.geom_rbound[geom]) or math.inf)  # 0: without end
    body = int(model.geom_bodyid[geom])
    while body:
        begin, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        joints = range(begin, begin + count)
        if model.body_mocapid[body] >= 0 or any(model.jnt_type[i] != mujoco.mjtJoint.mjJNT_HINGE for i in joints):
            return math.inf
        distance += _length(model.body_pos[body]) + sum(2.0 * _length(model.jnt_pos[i]) for i in joints)
        body = int(model.body_parentid[body])
    return distance


def _is_beyond(model: Any, geom: int, distance: float) -> bool:
    """Whether a geom is fixed, and everywhere farther from the base than this, m."""
    if model.geom_bodyid[geom]:
        return False
    place = model.geom_pos[geom]
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE:  # solid below
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
        return bool(-rotation[2::3] @ place > distance)
    return bool(_length(place) - model.geom_rbound[geom] > distance)


def _length(vector: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(vector))
