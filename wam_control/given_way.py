"""How far an arm has given way to what pushes it: one count, whatever the arm does meanwhile."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wam_description.rigid_body import RigidBody

Array = NDArray[np.float64]
LASTING: Final = 0.2  # s, for which a push counts after the last time: a swing is one, and the arm runs on


class GivenWay:
    """Counts the way of the fastest point of an arm from where it is pushed.

    What pauses, comes again or is called something else later goes on with the count.  What the arm moves by itself
    while nothing pushes is taken off: it goes back, or on with what is commanded.

    Parameters
    ----------
    body : kinematics of the arm.

    Attributes
    ----------
    way : so far, m.
    """

    def __init__(self, body: RigidBody) -> None:
        covers = body.arm.covers
        self._ends = [(name, (length, 0.0, 0.0)) for name, length in zip(covers.names, covers.length, strict=True)]
        self._body = body
        self.restart()

    def restart(self) -> None:
        """Something else is commanded."""
        self.way = self._before = self._lasting = 0.0
        self._is_pushed = self._gives = False
        self._begun: Array = np.zeros((0, 3))

    def give(self) -> None:
        """The arm is pushed, and gives way, in this period."""
        self._gives = True

    def step(self, q: Sequence[float], dt: float) -> None:
        """Begin a period of dt, s, with the joints at (n,), rad."""
        self._lasting = LASTING if self._gives else max(self._lasting - dt, 0.0)
        is_pushed, self._gives = self._lasting > 0.0, False
        if is_pushed != self._is_pushed:
            self._is_pushed, self._before, self._begun = is_pushed, self.way, self._points(q)
        if is_pushed or self._before:
            moved = float(np.linalg.norm(self._points(q) - self._begun, axis=1).max())
            self.way = self._before + moved if is_pushed else min(self.way, max(self._before - moved, 0.0))

    def _points(self, q: Sequence[float]) -> Array:
        """Ends of the covers, and the tool (m, 3), m: no point of the arm moves further than the fastest of them."""
        ends = [self._body.point(q, name, end) for name, end in self._ends]
        return np.array([*ends, self._body.tool_pose(q).position])
