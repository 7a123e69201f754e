"""Messages between the nodes of one process, without the middleware.

In lockstep most of the time of several nodes in one process went into sending bytes to the middleware and fetching
them from it again, once for each listener.  Here a listener of a topic that only nodes of its own process publish is
called with the value itself.  Its bytes go to the middleware, too, for the recorder and everybody else.  The
subscription of the middleware stays, but nothing fetches its messages: the graph shows it, and it reveals a second
publisher.  It is the reference: it carries what a node of another process publishes, the status, which many publish,
and everything in realtime.  benchmarks/README.md shows the gain; the bits are the same.
"""

from collections import deque
from collections.abc import Callable, Collection
from typing import Any, NamedTuple

from wam_ros.limits import NODE_LIMITS


class Message(NamedTuple):
    """What was published: stamp, ns, the value, and both as bytes."""

    stamp: int
    value: Any
    data: bytes


Take = Callable[[Message], None]


class LocalBus:
    """Hands messages from publishers to listeners of one process, in their order, in turns of the executor.

    Parameters
    ----------
    executor : that spins the nodes.
    names : of the nodes of this process.
    """

    def __init__(self, executor: Any, names: Collection[str]) -> None:
        self._executor, self._names = executor, frozenset(names)
        self._takers: dict[str, list[Take]] = {}
        self._waiting: deque[tuple[list[Take], Message]] = deque()

    def carries(self, publishers: Collection[str]) -> bool:
        """Whether all nodes that publish a topic are of this process; False where none does."""
        return bool(publishers) and self._names.issuperset(publishers)

    def subscribe(self, topic: str, take: Take) -> None:
        """Let a function take each message of a topic, by its full name."""
        self._takers.setdefault(topic, []).append(take)

    def send(self, topic: str, stamp: int, value: Any, data: bytes) -> None:
        """Hand a message to all that listen here, when it is its turn."""
        if takers := self._takers.get(topic):
            if not self._waiting:
                self._executor.create_task(self._turn)
            self._waiting.append((takers, Message(stamp, value, data)))

    def _turn(self) -> None:
        waiting = self._waiting
        for _ in range(NODE_LIMITS.turn):
            takers, message = waiting[0]
            for take in takers:
                take(message)
            waiting.popleft()  # only now, so that what they send does not ask for a turn of its own
            if not waiting:
                return
        self._executor.create_task(self._turn)
