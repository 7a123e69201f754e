"""What may touch what, and the law of each contact force."""

from collections.abc import Iterator
from itertools import combinations, pairwise
from typing import NamedTuple

from wam_description.arm import Arm
from wam_description.movable import Doors, FreeBodies
from wam_description.world import World


class ContactPair(NamedTuple):
    """Two geoms that may touch and the law of their contact force.

    Attributes
    ----------
    first, second : names of the geoms; `first` is the cover where one of them is.
    what : the second one in words.
    stiffness, damping, hardening, friction : N/m, N s/m, 1/m and a coefficient.
    is_shared : whether the points of contact of the pair share the stiffness; otherwise each has it.
    """

    first: str
    second: str
    what: str
    stiffness: float
    damping: float
    hardening: float
    friction: float
    is_shared: bool = True

    @property
    def name(self) -> str:
        """Name of the pair in the model."""
        return f"{self.first}/{self.second}"


def contact_pairs(arm: Arm, world: World) -> Iterator[ContactPair]:
    """Every pair of geoms that may touch: covers with everything, free bodies with everything but pushers.

    Covers that follow each other touch where `World.folding` has a stiffness.
    """
    obstacles, pushers = world.obstacles, world.pushers
    for cover in arm.covers.names:
        for i, name in enumerate(obstacles.names):
            law = obstacles.stiffness[i], obstacles.damping[i], obstacles.hardening[i], obstacles.friction[i]
            yield _through_cover(ContactPair(cover, name, f"obstacle '{name}'", *law), world.cover_stiffness)
    for i, name in enumerate(pushers.names):
        if pushers.force[i] > 0.0:
            law = pushers.stiffness[i], pushers.damping[i], 0.0, pushers.friction[i]
            yield ContactPair(pushers.covers[i], name, f"pusher '{name}'", *law)
    for cover in arm.covers.names:
        for pair in (*_on_cover(cover, "body", world.bodies), *_on_cover(cover, "door", world.doors)):
            yield _through_cover(pair, world.cover_stiffness)
    yield from _of_bodies(world)
    folding = world.folding
    for one, other in pairwise(arm.covers.names):
        if folding.stiffness:
            law = folding.stiffness, folding.damping, 0.0, folding.friction
            yield ContactPair(one, folded(other), f"the folded {other}", *law)


def folded(cover: str) -> str:
    """Name of the geom of a cover that touches the cover before it: its tube away from the joint between them."""
    return f"{cover}_folded"


def _through_cover(pair: ContactPair, stiffness: float) -> ContactPair:
    """A contact with a cover of this stiffness in series, N/m; 0 for a rigid one.

    Of the depth the share k/(k_c + k) is that of the surface; hardening counts to first order of the depth.
    """
    if not stiffness:
        return pair
    share = stiffness / (pair.stiffness + stiffness)
    squared = share * share
    return pair._replace(
        stiffness=share * pair.stiffness, damping=squared * pair.damping, hardening=squared * pair.hardening
    )


def _on_cover(cover: str, what: str, group: FreeBodies | Doors) -> Iterator[ContactPair]:
    for i in group.present:
        law = group.stiffness[i], group.damping[i], 0.0, group.friction[i]
        yield ContactPair(cover, group.names[i], f"{what} '{group.names[i]}'", *law)


def _of_bodies(world: World) -> Iterator[ContactPair]:
    """Contacts that the arm has no part in; of two bodies the softer one counts, and the larger friction."""
    bodies = world.bodies
    fixed = [*world.obstacles.names, *(world.doors.names[i] for i in world.doors.present)]
    for i in bodies.present:
        law = bodies.ground_stiffness[i], bodies.ground_damping[i], 0.0, bodies.ground_friction[i]
        for other in fixed:
            yield ContactPair(bodies.names[i], other, f"'{other}' and body '{bodies.names[i]}'", *law, is_shared=False)
    for i, j in combinations(bodies.present, 2):
        softer = min(i, j, key=lambda k: bodies.ground_stiffness[k])
        friction = max(bodies.ground_friction[i], bodies.ground_friction[j])
        law = bodies.ground_stiffness[softer], bodies.ground_damping[softer], 0.0, friction
        one, other = bodies.names[i], bodies.names[j]
        yield ContactPair(one, other, f"bodies '{one}' and '{other}'", *law, is_shared=False)
