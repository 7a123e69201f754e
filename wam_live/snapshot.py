"""What the page shows at one instant, whether it comes from topics or from a bag."""

import math
from typing import NamedTuple

from wam_description.signals import NO_CONTACT, Contact, LikelyRange, NodeStatus, ObjectState, Table, Triple

NAN = math.nan


class Snapshot(NamedTuple):
    """The arm and its contacts at one instant.

    Attributes
    ----------
    stamp : time of the arm, ns.
    q : joint angles, (n,), rad; empty where they are not known.
    true, estimated : contact of the world on a cover, the simulator's and the estimator's.
    likely : parts of covers that hold the contact with 90 % probability in all.
    commanded, measured : size of the force of the arm on the world, N, NaN where there is none.
    statuses : of the nodes, by name.
    real_time_factor : simulated time per wall time, NaN where it is not known.
    silent : time of the wall clock since the newest state of the arm came, s.
    objects : of the world, in the order of `World.objects`; none where they are not known.
    """

    stamp: int = 0
    q: tuple[float, ...] = ()
    true: Contact = NO_CONTACT
    estimated: Contact = NO_CONTACT
    likely: tuple[LikelyRange, ...] = ()
    commanded: float = NAN
    measured: float = NAN
    statuses: dict[str, NodeStatus] = {}  # noqa: RUF012 - never changed
    real_time_factor: float = NAN
    silent: float = 0.0
    objects: tuple[ObjectState, ...] = ()

    @property
    def seconds(self) -> float:
        """Time of the arm, s."""
        return self.stamp / 1e9


def size(force: Triple) -> float:
    """Magnitude of a force, N."""
    return math.hypot(*force)


def objects_of(table: Table | None) -> tuple[ObjectState, ...]:
    """The states in a table of objects."""
    return tuple(ObjectState._make(row) for row in table.rows) if table else ()
