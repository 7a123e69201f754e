"""What the guard does while the arm moves: scales the gains with the pose, the direction and the place.

Judgements take milliseconds, so they are spread: a part of one in each outer period, and a new one
only where the arm has moved since the last.
"""

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from wam_control.stability_guard import LARGEST, Judgement, StabilityGuard, Task, Touch

TURN = 0.1  # rad at a joint, and of the direction, after which the arm is judged anew
SHIFT = 0.02  # m of the place
PARTS = (0.25, 0.5, 0.75, 1.0)  # of the scale that is needed, that have to be stable
PLACES = (0.25, 0.5, 0.75, 1.0)  # of a cover's length, that an unsure contact may be at


def place_is_sure(place: float, place_sd: float, limit: float) -> bool:
    """Whether an estimated place is sure enough to build on.

    Parameters
    ----------
    place : m along the cover, NaN where it cannot be observed.
    place_sd : its standard deviation, m; NaN where it is not told, which counts as sure.
    limit : largest standard deviation that is sure, m.
    """
    return not math.isnan(place) and not place_sd > limit


class Watch:
    """Follows the arm and says by what factor the gains of the set in force are to be taken.

    Without scheduling the factor is 1, or less where the set would leave its domain.  With it the
    factor keeps the margin that the set had where it was tuned; it never exceeds `share` of the margin.

    Parameters
    ----------
    guard : judges.
    task : the set in force.
    found : its judgement when it was tuned.
    is_scheduled : whether the gain follows the place.

    Attributes
    ----------
    factor : of the gains.
    scale : so many times the set's gains are linearly stable here; that of `found` before anything was judged.
    """

    def __init__(self, guard: StabilityGuard, task: Task, found: Judgement, is_scheduled: bool) -> None:
        self._guard, self._task, self._is_scheduled = guard, task, is_scheduled
        self._tuned = found.scale
        self._needed = min(found.scale, 1.0 / guard.parameters.share)  # less than that is domain II, kept as it is
        self._judged: list[Touch] = []
        self._asked: list[Touch] = []
        self._work: Iterator[float] | None = None
        self._least = math.inf
        self._since = math.inf
        self.factor, self.scale = 1.0, found.scale

    def step(self, where: Callable[[], list[Touch]], dt: float) -> bool:
        """Look where the arm touches; True where the factor has changed.

        Parameters
        ----------
        where : says where the arm touches, or may touch; asked when a judgement is due.
        dt : outer period, s.
        """
        self._since += dt
        if self._work is None and self._since >= self._guard.parameters.interval:
            self._since = 0.0
            touches = where()
            if touches and self._is_new(touches):
                self._asked, self._least = touches, math.inf
                self._work = self._guard.scales(self._task, touches, self._tried())
        if self._work is None:
            return False
        try:
            self._least = min(self._least, next(self._work))
            return False
        except StopIteration:
            self._work, self._judged, self.scale = None, self._asked, self._least
        before = self.factor
        allowed = self.scale / self._needed
        self.factor = min(allowed, self.scale / self._tuned) if self._is_scheduled else min(allowed, 1.0)
        return self.factor != before

    def _tried(self) -> list[float]:
        top = LARGEST if self._is_scheduled else self._needed
        return [part * top for part in (np.geomspace(0.01, 1.0, 12).tolist() if self._is_scheduled else PARTS)]

    def _is_new(self, touches: Sequence[Touch]) -> bool:
        return len(touches) != len(self._judged) or any(map(_is_apart, touches, self._judged))


def possible_touches(guard: StabilityGuard, q: Sequence[float], cover: str, length: float) -> list[Touch]:
    """Where a contact of unknown place can be: along the whole cover, `length` m, against both axes across it."""
    return [touch for part in PLACES for touch in guard.touches(q, cover, part * length)]


def _is_apart(one: Touch, other: Touch) -> bool:
    turned = any(abs(a - b) > TURN for a, b in zip(one.q, other.q, strict=True))
    bent = any(abs(a - b) > TURN for a, b in zip(one.direction, other.direction, strict=True))
    return turned or bent or one.cover != other.cover or abs(one.place - other.place) > SHIFT
