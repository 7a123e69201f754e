"""Contact forces of the plant: each surface gives the force of its own law, and contacts stick truly."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

from wam_description.arm import Arm
from wam_description.contact_pairs import contact_pairs, folded
from wam_description.parameters import ParameterError
from wam_description.rigid_body import Array
from wam_description.world import World
from wam_driver.thresholds import PLANT

WHOLE = [1.0]


class SurfaceLaw(NamedTuple):
    """The law of the contact force of a pair of geoms; the steps in C read it by index."""

    first: int  # geoms
    second: int
    stiffness: float  # N/m
    damping: float  # N s/m
    hardening: float  # 1/m
    rows: int  # of a contact in MuJoCo's constraints: along the normal, then along the surface
    is_shared: bool  # whether several contacts share the stiffness


class Mover(Protocol):
    """A body whose pose the plant prescribes, with its velocity, (3,), m/s, in the base frame."""

    name: str
    velocity: Array

    def lead(self, time: float) -> None:
        """Move to the pose at a time, s since power-up."""


class Surfaces:
    """The law of the contact force of each pair of geoms that may touch.

    Parameters
    ----------
    model, data : of MuJoCo.
    arm, world : the covers and what they may touch.
    movers : pushers and moving obstacles.
    step : of the plant, s.

    Attributes
    ----------
    laws : of each pair.
    """

    def __init__(self, model: Any, data: Any, arm: Arm, world: World, movers: Sequence[Mover], step: float) -> None:
        self._data, self._contact, self._step = data, data.contact, step
        self._first: Any = None  # view of the first contact, always at the same address
        pairs = list(zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True))
        # MuJoCo may name the two geoms of a contact in either order
        self._pair = {geoms: i for i, pair in enumerate(pairs) for geoms in (pair, pair[::-1])}
        self._mover = {model.geom(mover.name).id: mover for mover in movers}
        given = {one.name: one for one in contact_pairs(arm, world)}
        self._given = [given[model.pair(i).name] for i in range(model.npair)]
        self.laws: list[SurfaceLaw] = [
            SurfaceLaw(*pair, float(law.stiffness), float(law.damping), float(law.hardening), size, law.is_shared)
            for pair, law, size in zip(pairs, self._given, model.pair_dim.tolist(), strict=True)
        ]

    def require_free_start(self, arm: Arm) -> None:
        """Refuse a world in which something is inside the arm now: it would push it out with k_c times the depth.

        What touches it, or presses it softly, is no mistake: an arm may lean on foam.

        Raises
        ------
        ParameterError
            names what is inside, the cover and its link, and the depth.
        """
        links = dict(zip(arm.covers.names, arm.covers.links, strict=True))
        own = {folded(name) for name in links}  # a folded arm is no mistake
        depths: dict[str, float] = {}
        for (first, second), distance in zip(self._contact.geom.tolist(), self._contact.dist.tolist(), strict=True):
            pair, depth = self._given[self._pair[first, second]], -distance
            is_within = depth > PLANT.deepest and depth * pair.stiffness > PLANT.hardest
            if is_within and pair.first in links and pair.second not in own:
                inside = f"{pair.what} is {{}} mm inside cover '{pair.first}' of {links[pair.first]}"
                depths[inside] = max(depths.get(inside, 0.0), depth)
        if depths:
            found = " and ".join(inside.format(f"{1e3 * depth:.3g}") for inside, depth in depths.items())
            raise ParameterError(
                f"at power-up {found}; allowed: up to {1e3 * PLANT.deepest:g} mm, or a contact force of "
                f"{PLANT.hardest:g} N; move it away from the arm (world), or start the arm in another pose "
                "(arm.joints.start)"
            )

    def apply(self) -> None:
        """Make each contact's force k_c depth + b_c speed, and let it stick within its friction cone.

        It is called between the two halves of a step.  MuJoCo's contact force is (a_ref - a)/R.  The model's R is far
        above the inverse of the mass behind the contact, so that a_ref = R f gives the force f.  Several contacts of
        a cover with one surface share its stiffness, see `_fractions`.  Along the surface a_ref stops the slip in one
        step, as for the joints; MuJoCo's own value, the damping over the impedance d, makes friction alternate between
        its limits from step to step.
        """
        data, contact, fractions = self._data, self._contact, WHOLE
        if data.ncon == 1:  # a view of one contact is read in half the time of arrays of all
            only = self._first = self._first or contact[0]
            pairs, rows, distances = [self._pair[only.geom1, only.geom2]], [only.efc_address], [only.dist]
        else:
            pairs = [self._pair[first, second] for first, second in contact.geom.tolist()]
            rows, distances = contact.efc_address.tolist(), contact.dist.tolist()
            fractions = _fractions(pairs, distances)
        reference, regularisation, velocity = data.efc_aref, data.efc_R, data.efc_vel.tolist()
        if self._mover:
            self._subtract_movers(velocity, rows, pairs)
        for pair, row, distance, fraction in zip(pairs, rows, distances, fractions):  # noqa: B905 - one of each per contact
            if row >= 0:
                _, _, stiffness, damping, hardening, size, is_shared = self.laws[pair]
                if hardening and distance < 0.0:
                    stiffness *= 1.0 - hardening * distance
                force = -(stiffness * distance + damping * velocity[row]) * (fraction if is_shared else 1.0)
                reference[row] = force * regularisation[row]
                for k in range(row + 1, row + size):
                    reference[k] = -velocity[k] / self._step

    def _subtract_movers(self, velocity: list[float], rows: Sequence[int], pairs: Sequence[int]) -> None:
        """Make the velocities of contacts relative to the movers, which MuJoCo takes to be at rest."""
        contact = self._contact
        for i, (row, pair) in enumerate(zip(rows, pairs, strict=True)):
            first, second = contact.geom[i].tolist()
            mover = self._mover.get(second) or self._mover.get(first)
            if row >= 0 and mover is not None:
                sign = 1.0 if second in self._mover else -1.0
                along = (contact.frame[i].reshape(3, 3) @ mover.velocity).tolist()
                for k in range(self.laws[pair].rows):
                    velocity[row + k] += sign * along[k]


def _fractions(pairs: Sequence[int], distances: Sequence[float]) -> list[float]:
    """Fraction of the stiffness of its surface for each contact.

    The ends of a tube carry alike if they are equally deep, so that a tube that lies flat meets the stiffness k_c;
    otherwise the deepest carries nearly all.  Fractions by number or by depth alone would give energy to a tube that
    tips from end to end.
    """
    deepest = dict.fromkeys(pairs, PLANT.smallest_depth)
    for pair, distance in zip(pairs, distances, strict=True):
        deepest[pair] = max(deepest[pair], -distance)
    weights = [(max(-d, 0.0) / deepest[pair]) ** PLANT.sharpness for pair, d in zip(pairs, distances, strict=True)]
    totals = dict.fromkeys(pairs, 0.0)
    for pair, weight in zip(pairs, weights, strict=True):
        totals[pair] += weight
    return [weight / totals[pair] if totals[pair] else 0.0 for pair, weight in zip(pairs, weights, strict=True)]
