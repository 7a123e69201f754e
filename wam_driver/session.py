"""The session of a driver, a number for each start: which one the nodes follow, and since when commands count."""

from collections.abc import Collection

from wam_description.signals import NodeStatus
from wam_description.status import AWAITED


class Session:
    """Number of this session, which no driver had before, and the nodes that follow it.

    Parameters
    ----------
    followers : nodes that have to follow.
    number : of the session, 0 before it has begun.

    Attributes
    ----------
    number : of the session; every node forgets what came before another one.
    since : time from which commands count, ns: the next state after the brakes were switched.
    awaited : by node that follows, the topics that it lacked for its next step when it began to.
    """

    def __init__(self, followers: Collection[str], number: int = 0) -> None:
        self.number, self.since = number, 0
        self._followed = dict.fromkeys(followers, 0)
        self.awaited: dict[str, list[str]] = {}

    def begin(self) -> None:
        """Begin another session, with a number that no node follows yet."""
        self.number = 1 + max([self.number, *self._followed.values()])
        self.awaited.clear()

    def hear(self, status: NodeStatus) -> None:
        """Take which session a node follows."""
        if status.node in self._followed:
            self._followed[status.node] = status.session
            if status.session == self.number and AWAITED in status.facts:
                self.awaited[status.node] = status.facts[AWAITED].split()

    @property
    def is_overtaken(self) -> bool:
        """Whether a node follows a later session, which this driver has not begun."""
        return any(number > self.number for number in self._followed.values())

    @property
    def silent(self) -> list[str]:
        """The nodes that do not follow yet."""
        return sorted(name for name, number in self._followed.items() if number != self.number)
