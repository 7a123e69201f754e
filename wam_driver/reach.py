"""What of the world the arm can touch, and whether it is free at power-up.

A step of a world in which nothing is within reach is simpler.
"""

import math
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from wam_description.arm import Arm
from wam_description.contact_pairs import contact_pairs, folded
from wam_description.parameters import ParameterError
from wam_description.world import World
from wam_driver.thresholds import PLANT


def within_reach(model: Any, first: int, second: int) -> bool:
    """Whether two geoms may touch at some angles of the joints; False only where it is certain that they never do.

    A geom on links that only turn stays within a distance of the base, as far as its links reach when they are
    stretched: it never touches what is fixed beyond that.
    """
    return not any(_is_beyond(model, fixed, _reach(model, one)) for one, fixed in ((first, second), (second, first)))


def require_free_start(model: Any, data: Any, arm: Arm, world: World) -> None:
    """Refuse a world in which something is inside the arm at power-up: it would push it out with k_c times the depth.

    What touches it, or presses it softly, is no mistake: an arm may lean on foam.

    Parameters
    ----------
    model, data : of MuJoCo, with the contacts of the start pose.
    arm, world : the covers and what they may touch.

    Raises
    ------
    ParameterError
        names what is inside, the cover and its link, and the depth.
    """
    links = dict(zip(arm.covers.names, arm.covers.links, strict=True))
    own = {folded(name) for name in links}  # a folded arm is no mistake
    pairs = {
        frozenset((one.first, one.second)): one
        for one in contact_pairs(arm, world)
        if one.first in links and one.second not in own
    }
    depths: dict[str, float] = {}
    for geoms, distance in zip(data.contact.geom.tolist(), data.contact.dist.tolist(), strict=True):
        pair = pairs.get(frozenset(model.geom(geom).name for geom in geoms))
        if pair is not None and -distance > PLANT.deepest and -distance * pair.stiffness > PLANT.hardest:
            inside = f"{pair.what} is {{}} mm inside cover '{pair.first}' of {links[pair.first]}"
            depths[inside] = max(depths.get(inside, 0.0), -distance)
    if depths:
        found = " and ".join(inside.format(f"{1e3 * depth:.3g}") for inside, depth in depths.items())
        raise ParameterError(
            f"at power-up {found}; allowed: up to {1e3 * PLANT.deepest:g} mm, or {PLANT.hardest:g} N by its stiffness; "
            "move it away from the arm (world), or start the arm in another pose (arm.joints.start)"
        )


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
