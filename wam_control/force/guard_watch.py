"""The guard while the arm moves: it scales the gains with pose, force direction and contact position.

An assessment takes milliseconds, so it is distributed: a part of it in each outer period, and a new
one only after the arm has moved.
"""

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from wam_control.force.stability_guard import (
    LARGEST,
    GuardAssessment,
    Guarded,
    GuardedContact,
    GuardedTask,
    StabilityGuard,
)

TURN = 0.1  # rad, of a joint or of the force direction, after which the loop is assessed again
SHIFT = 0.02  # m, of the contact position or its uncertainty, after which it is assessed again
GROWTH = 1.5  # of the commanded force, after which it is assessed again
PARTS = (0.02, 0.05, 0.1, 0.25, 0.5, 0.75, 1.0)  # of the required scale, all of which have to be stable
POSITIONS = (0.25, 0.5, 0.75, 1.0)  # of a cover's length, at which an uncertain contact may be


class Watch:
    """Follows the arm and gives the factor of the gains in force.

    Without scheduling the factor is 1, or less where the parameters would leave their domain.  With it
    the margin stays the one where they were tuned; no factor takes them above `stability_fraction` of it.

    Parameters
    ----------
    guard : computes the margins.
    task : what is controlled, with the gains in force.
    found : assessment of these gains when they were tuned.
    is_scheduled : whether the gains follow the contact position.

    Attributes
    ----------
    factor : of the gains.
    scale : factor up to which the gains in force are linearly stable here; at first that of `found`.
    assessed : contacts of the last assessment, none before the first; another list after each.
    """

    def __init__(self, guard: StabilityGuard, task: GuardedTask, found: GuardAssessment, is_scheduled: bool) -> None:
        self._guard, self._task, self._is_scheduled = guard, task, is_scheduled
        demanded = 1.0 / guard.parameters.stability_fraction
        # gains without any margin are only taken where the guard warns: there is none to keep
        self._tuned = found.scale or demanded
        # in domain II the margin is less than the fraction demands, and may stay so
        self._needed = min(self._tuned, demanded)
        self.assessed: list[GuardedContact] = []
        self._pending: list[GuardedContact] = []
        self._work: Iterator[float] | None = None
        self._least = math.inf
        self._since = math.inf
        self.factor, self.scale = 1.0, found.scale

    def step(self, where: Callable[[], Sequence[Guarded]], dt: float) -> bool:
        """Continue the present assessment, or begin one if it is due; True if the factor has changed.

        Parameters
        ----------
        where : gives the contacts that are possible now; called when an assessment is due.
        dt : outer period, s.
        """
        self._since += dt
        if self._work is None and self._since >= self._guard.parameters.interval:
            self._since = 0.0
            guarded = where()
            contacts = [contact for each in guarded for contact in each.contacts]
            if contacts and self._is_new(contacts):
                self._pending, self._least = contacts, math.inf
                self._work = self._guard.scales(self._task, guarded, self._tried())
        if self._work is None:
            return False
        try:
            self._least = min(self._least, next(self._work))
            return False
        except StopIteration:
            self._work, self.assessed, self.scale = None, self._pending, self._least
        before = self.factor
        allowed = self.scale / self._needed
        self.factor = min(allowed, self.scale / self._tuned) if self._is_scheduled else min(allowed, 1.0)
        return self.factor != before

    def _tried(self) -> list[float]:
        top = LARGEST if self._is_scheduled else self._needed
        return [part * top for part in (np.geomspace(0.01, 1.0, 12).tolist() if self._is_scheduled else PARTS)]

    def _is_new(self, contacts: Sequence[GuardedContact]) -> bool:
        return len(contacts) != len(self.assessed) or any(map(_is_apart, contacts, self.assessed))


def possible_contacts(guard: StabilityGuard, q: Sequence[float], cover: str, length: float) -> list[GuardedContact]:
    """Contacts at an unknown position: along the whole cover, `length` m, along both axes across it."""
    return [contact for part in POSITIONS for contact in guard.contacts(q, cover, part * length, 0.0)]


def _is_apart(one: GuardedContact, other: GuardedContact) -> bool:
    turned = any(abs(a - b) > TURN for a, b in zip(one.q, other.q, strict=True))
    bent = any(abs(a - b) > TURN for a, b in zip(one.direction, other.direction, strict=True))
    shifted = max(abs(one.position - other.position), abs(one.position_sd - other.position_sd)) > SHIFT
    grown = not one.force / GROWTH <= other.force <= one.force * GROWTH
    return turned or bent or shifted or grown or one.cover != other.cover
