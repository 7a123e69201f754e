"""How far an arm has given way to what pushes it: one count, whatever the arm does meanwhile."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wam_control.force.thresholds import FORCE
from wam_description.rigid_body import RigidBody

Array = NDArray[np.float64]


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
        self._gives = self._is_anywhere = False
        self._kind = False, False  # pushed, and anywhere
        self._along: Array | None = None
        self._begun: Array = np.zeros((0, 3))

    def give(self, along: Array | None = None) -> None:
        """The arm is pushed, and gives way, in this period.

        Parameters
        ----------
        along : direction (3,) of the way that counts, where motion across it is commanded; None: any.
        """
        self._is_anywhere = along is None or (self._gives and self._is_anywhere)
        self._gives, self._along = True, along if along is not None else self._along

    def step(self, q: Sequence[float], dt: float) -> None:
        """Begin a period of dt, s, with the joints at (n,), rad."""
        self._lasting = FORCE.lasting if self._gives else max(self._lasting - dt, 0.0)
        is_pushed, self._gives = self._lasting > 0.0, False
        kind = (is_pushed, is_pushed and self._is_anywhere)
        if kind != self._kind:
            self._kind, self._before, self._begun = kind, self.way, self._points(q)
        if not (is_pushed or self._before):
            return
        moved = self._points(q) - self._begun
        if is_pushed and self._along is not None and not self._is_anywhere:
            self.way = max(self._before + float((moved @ self._along).max()), 0.0)
            return
        furthest = float(np.linalg.norm(moved, axis=1).max())
        self.way = self._before + furthest if is_pushed else min(self.way, max(self._before - furthest, 0.0))

    def _points(self, q: Sequence[float]) -> Array:
        """Ends of the covers, and the tool (m, 3), m: no point of the arm moves further than the fastest of them."""
        ends = [self._body.point(q, name, end) for name, end in self._ends]
        return np.array([*ends, self._body.tool_pose(q).position])


def has_left(pressed_at: Sequence[float], q: Sequence[float]) -> bool:
    """Whether a joint has moved by `left_angle` from the pose (n,), rad, in which the arm pressed last."""
    return any(abs(a - b) > FORCE.left_angle for a, b in zip(pressed_at, q, strict=True))
