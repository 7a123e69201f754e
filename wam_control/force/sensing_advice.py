"""What to change so that a refused force would be accepted: a joint to turn, another force, or a pinned position.

Each way is checked by all that refuses a command before the arm moves.  One takes a fifth of a millisecond, so that a
few are tried in each period of the force loop.
"""

from collections.abc import Callable, Hashable, Iterator, Sequence
from typing import NamedTuple

from wam_control.force.contact_position import ForceCase
from wam_control.force.thresholds import FORCE


class Turnable(NamedTuple):
    """A joint that moves the link: its index and name, and between which angles it may be, rad."""

    joint: int
    name: str
    lower: float
    upper: float


class OtherForces(NamedTuple):
    """The same force in other poses, of another size, and at a pinned position.

    Attributes
    ----------
    q : present joint angles (n,), rad.
    turnable : joints that move the link, the last one first, which bends the arm there.
    where : the position of the force in words; '' where it is pinned already.
    at : a force, N, in a pose (n,), rad, as it would be commanded there; pinned, or as it is.
    """

    q: Sequence[float]
    turnable: Sequence[Turnable]
    where: str
    at: Callable[[Sequence[float], float, bool], ForceCase]


class Advice:
    """Looks for what would help, a little in each period.

    Attributes
    ----------
    ways : what was found.
    is_complete : whether all was tried.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Nothing is refused."""
        self._refused: tuple[float, Hashable] | None = None
        self._search: Iterator[str] = iter(())
        self.ways: list[str] = []
        self.is_complete = False

    def step(
        self,
        force: float,
        refused: Hashable,
        others: Callable[[], OtherForces],
        is_accepted: Callable[[ForceCase], bool],
    ) -> None:
        """Try some ways; from the beginning where another force, N, is refused, or for other reasons.

        Parameters
        ----------
        refused : the reasons.
        others : the force in other poses, as it is refused.
        is_accepted : whether a force would be accepted.
        """
        before = self._refused
        if before is None or before[1] != refused or abs(force - before[0]) > FORCE.another * force:
            self.reset()
            self._refused, self._search = (force, refused), _search(others(), force, is_accepted)
        for _ in range(0 if self.is_complete else FORCE.each):
            way = next(self._search, None)
            if way is None:
                self.is_complete = True
                return
            self.ways += [way] if way else []


def _search(others: OtherForces, force: float, is_accepted: Callable[[ForceCase], bool]) -> Iterator[str]:
    """After each force that is tried: what to do where it would be accepted, else ''.

    First one change alone, then a pinned position together with another one.
    """
    changes = [list(_turned(others, force)), [(others.q, size, f"command {size:g} N") for size in _larger(force)]]
    pin, found = f"pin the position ({others.where})", 0
    tries = [(changed, False, "") for changed in changes]
    if others.where:
        tries += [([(others.q, force, pin)], True, ""), *((changed, True, f"{pin} and ") for changed in changes)]
    for changed, is_pinned, first in tries:
        if first and found:
            return
        for q, size, way in changed:
            is_good = is_accepted(others.at(q, size, is_pinned))
            yield f"{first}{way}" if is_good else ""
            if is_good:
                found += 1
                break


def _larger(force: float) -> list[float]:
    return [float(f"{factor * force:.2g}") for factor in FORCE.more]


def _turned(others: OtherForces, force: float) -> Iterator[tuple[Sequence[float], float, str]]:
    """Poses in which one joint is turned, the force, and how to get there; the nearest first."""
    q = others.q
    for by in FORCE.turns:
        for joint, name, lower, upper in others.turnable:
            for angle in (round(q[joint] + by, 1) + 0.0, round(q[joint] - by, 1) + 0.0):  # no -0
                if lower + FORCE.spare <= angle <= upper - FORCE.spare:
                    pose = [*q[:joint], angle, *q[joint + 1 :]]
                    yield pose, force, f"turn {name} from {q[joint]:.2f} to {angle:.1f} rad"
