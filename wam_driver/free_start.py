"""Whether the arm is free at power-up."""

from typing import Any

from wam_description.arm import Arm
from wam_description.contact_pairs import contact_pairs, folded
from wam_description.parameters import ParameterError
from wam_description.world import World
from wam_driver.thresholds import PLANT


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
            f"at power-up {found}; allowed: up to {1e3 * PLANT.deepest:g} mm, or a contact force of {PLANT.hardest:g} N"
            "; move it away from the arm (world), or start the arm in another pose (arm.joints.start)"
        )
