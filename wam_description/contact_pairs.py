"""What may touch what, and the law of each contact force."""

from collections.abc import Iterator, Sequence
from itertools import combinations, pairwise
from typing import Any, NamedTuple

from wam_description.arm import Arm
from wam_description.parameters import rows
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
    for cover in arm.covers.names:
        yield from _on_cover(cover, "obstacle", rows(world.obstacles), world.cover_stiffness)
    for pusher in world.pushers.present:
        yield from _on_cover(pusher.cover, "pusher", [pusher])
    for cover in arm.covers.names:
        yield from _on_cover(cover, "body", world.bodies.present, world.cover_stiffness)
        yield from _on_cover(cover, "door", world.doors.present, world.cover_stiffness)
    yield from _of_bodies(world)
    folding = world.folding
    for one, other in pairwise(arm.covers.names):
        if folding.stiffness:
            law = folding.stiffness, folding.damping, 0.0, folding.friction
            yield ContactPair(one, folded(other), f"the folded {other}", *law)


def folded(cover: str) -> str:
    """Name of the geom of a cover that touches the cover before it: its tube away from the joint between them."""
    return f"{cover}_folded"


def _on_cover(cover: str, what: str, touched: Sequence[Any], stiffness: float = 0.0) -> Iterator[ContactPair]:
    """A cover of this stiffness, N/m, 0 for a rigid one, in series with everything that it may touch.

    Of the depth the share k/(k_c + k) is that of the surface; hardening counts to first order of the depth.
    """
    for one in touched:
        share = stiffness / (one.stiffness + stiffness) if stiffness else 1.0
        squared, hardening = share * share, getattr(one, "hardening", 0.0)
        law = share * one.stiffness, squared * one.damping, squared * hardening, one.friction
        yield ContactPair(cover, one.name, f"{what} '{one.name}'", *law)


def _of_bodies(world: World) -> Iterator[ContactPair]:
    """Contacts that the arm has no part in; of two bodies the softer one counts, and the larger friction."""
    bodies = world.bodies.present
    fixed = [*world.obstacles.names, *(door.name for door in world.doors.present)]
    for body in bodies:
        law = body.ground_stiffness, body.ground_damping, 0.0, body.ground_friction
        for other in fixed:
            yield ContactPair(body.name, other, f"'{other}' and body '{body.name}'", *law, is_shared=False)
    for one, other in combinations(bodies, 2):
        softer = min(one, other, key=lambda body: body.ground_stiffness)
        friction = max(one.ground_friction, other.ground_friction)
        law = softer.ground_stiffness, softer.ground_damping, 0.0, friction
        yield ContactPair(one.name, other.name, f"bodies '{one.name}' and '{other.name}'", *law, is_shared=False)
