"""Contact forces of the plant: each surface gives the force of its own law, and contacts stick truly."""

from collections.abc import Sequence
from typing import Any

from wam_description.world import World
from wam_driver.pusher import Pusher

SHARPNESS = (
    32  # of the sharing between the ends of a tube: energy is conserved to 0.2 %, and depths within 2 % count as equal
)
WHOLE = (1.0,)
SMALLEST_DEPTH = 1e-12  # m


class Surfaces:
    """The surfaces of obstacles and pushers, one for each pair of geoms that may touch.

    Parameters
    ----------
    model, data : of MuJoCo.
    world : the obstacles.
    covers : how many covers each obstacle is paired with.
    pushers : those in the model.
    step : of the plant, s.
    """

    def __init__(
        self, model: Any, data: Any, world: World, covers: int, pushers: Sequence[Pusher], step: float
    ) -> None:
        self._data, self._contact, self._step = data, data.contact, step
        pairs = list(zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True))
        # MuJoCo may name the two geoms of a contact in either order
        self._pair = {geoms: i for i, pair in enumerate(pairs) for geoms in (pair, pair[::-1])}
        self._pusher = {model.geom(pusher.name).id: pusher for pusher in pushers}
        obstacles = world.obstacles
        laws = list(zip(obstacles.stiffness, obstacles.damping, obstacles.hardening, strict=True)) * covers
        laws += [pusher.surface for pusher in pushers]
        self._law = [(*law, size) for law, size in zip(laws, model.pair_dim.tolist(), strict=True)]

    def apply(self) -> None:
        """Make each contact's force k_c depth + b_c speed, and let it stick within its friction cone.

        It is called between the two halves of a step.  MuJoCo's contact force is (a_ref - a)/R.  The model's R is far
        above the inverse of the mass behind the contact, so that a_ref = R f gives the force f.  Several contacts of
        one pair share its stiffness, see `_fractions`.  Along the surface a_ref stops the slip in one step, as for the
        joints; MuJoCo's own value, the damping over the impedance d, makes friction alternate between its limits from
        step to step.
        """
        data, contact = self._data, self._contact
        pairs = [self._pair[first, second] for first, second in contact.geom.tolist()]
        rows, distances = contact.efc_address.tolist(), contact.dist.tolist()
        reference, regularisation, velocity = data.efc_aref, data.efc_R, data.efc_vel.tolist()
        fractions = WHOLE if len(pairs) == 1 else _fractions(pairs, distances)
        if self._pusher:
            self._subtract_pushers(velocity, rows, pairs)
        for pair, row, distance, fraction in zip(pairs, rows, distances, fractions):  # noqa: B905 - one of each per contact
            if row >= 0:
                stiffness, damping, hardening, size = self._law[pair]
                if hardening and distance < 0.0:
                    stiffness *= 1.0 - hardening * distance
                force = -(stiffness * distance + damping * velocity[row]) * fraction
                reference[row] = force * regularisation[row]
                for k in range(row + 1, row + size):
                    reference[k] = -velocity[k] / self._step

    def _subtract_pushers(self, velocity: list[float], rows: Sequence[int], pairs: Sequence[int]) -> None:
        """Make the velocities of contacts relative to the pushers, which MuJoCo takes to be at rest."""
        contact = self._contact
        for i, (row, pair) in enumerate(zip(rows, pairs, strict=True)):
            first, second = contact.geom[i].tolist()
            pusher = self._pusher.get(second) or self._pusher.get(first)
            if row >= 0 and pusher is not None:
                sign = 1.0 if second in self._pusher else -1.0
                along = (contact.frame[i].reshape(3, 3) @ pusher.velocity).tolist()
                for k in range(self._law[pair][3]):
                    velocity[row + k] += sign * along[k]


def _fractions(pairs: Sequence[int], distances: Sequence[float]) -> list[float]:
    """Fraction of the stiffness of its surface for each contact.

    The ends of a tube carry alike if they are equally deep, so that a tube that lies flat meets the stiffness k_c;
    otherwise the deepest carries nearly all.  Fractions by number or by depth alone would give energy to a tube that
    tips from end to end.
    """
    deepest = dict.fromkeys(pairs, SMALLEST_DEPTH)
    for pair, distance in zip(pairs, distances, strict=True):
        deepest[pair] = max(deepest[pair], -distance)
    weights = [(max(-d, 0.0) / deepest[pair]) ** SHARPNESS for pair, d in zip(pairs, distances, strict=True)]
    totals = dict.fromkeys(pairs, 0.0)
    for pair, weight in zip(pairs, weights, strict=True):
        totals[pair] += weight
    return [weight / totals[pair] if totals[pair] else 0.0 for pair, weight in zip(pairs, weights, strict=True)]
