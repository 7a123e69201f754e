"""Topics within one process: who takes the messages of each, and when they are handed over.

A simulation and a replay hand each message on at once: their clocks are the periods of the plant and the recorded
stamps.  Nodes over ROS take turns with all else that their executor does.  Which messages make a step, and after what
delay, is in the stamps (`wam_description.synchroniser`), so that the bits are the same.  A stamp is a number, ns, that
only passes through here; as `Any` it need not become one of C and back in each function.
"""

from collections import Counter, defaultdict, deque
from collections.abc import Callable
from typing import Any

Take = Callable[[Any, Any], object]  # of a message: stamp, ns, and value
Publish = Callable[[Any, Any], None]


class MessageBus:
    """Hands each message at once to all that take its topic, in the order in which they began to listen."""

    def __init__(self) -> None:
        self._takers = defaultdict[str, list[Take]](list)

    def listen(self, topic: str, take: Take) -> None:
        """Call a function with stamp, ns, and value of each message of a topic."""
        self._takers[topic].append(take)

    def publisher(self, topic: str) -> Publish:
        """A function that publishes on a topic: stamp, ns, and value, and what is published in answer to them."""
        takers = self._takers[topic]

        def publish(stamp: Any, value: Any) -> None:
            for take in takers:
                take(stamp, value)

        return publish


class QueuedBus(MessageBus):
    """Hands messages on in the order in which they were published, some of them in each turn of an executor.

    What is published in answer to a message of the middleware has its turn right after it.  A turn of the executor
    comes only after all that has arrived before: on a busy computer, many seconds later.

    Parameters
    ----------
    later : lets the executor call a function in its turn.
    most : messages in one turn.

    Attributes
    ----------
    unserved : subscriptions of the middleware whose nodes get the messages here, by topic.
    tapes : of the recorders of this process: called with the full name and the bytes of what only this process takes.
    """

    def __init__(self, later: Callable[[Callable[[], None]], object], most: int) -> None:
        super().__init__()
        self._later, self._most = later, most
        self._is_due = False  # whether there will be a turn
        self._published = 0  # messages
        self.unserved: Counter[str] = Counter()
        self.tapes: list[Callable[[str, bytes], object]] = []
        self._next: deque[tuple[list[Take], deque[tuple[Any, Any]]]] = deque()  # whose message is next

    def publisher(self, topic: str, depth: int = 1) -> Publish:
        """A function that publishes on a topic: stamp, ns, and value, which wait for their turn.

        Parameters
        ----------
        topic : its name.
        depth : messages that wait at most; of more the oldest is dropped.
        """
        takers, following = self._takers[topic], self._next
        waiting: deque[tuple[Any, Any]] = deque(maxlen=depth)

        def publish(stamp: Any, value: Any) -> None:
            if not takers:
                return
            if len(waiting) < depth:
                following.append((takers, waiting))
            waiting.append((stamp, value))
            self._published += 1
            if not self._is_due:
                self._request()

        return publish

    def answered(self, receive: Callable[[Any], object]) -> Callable[[Any], None]:
        """A function that takes a message of the middleware, and then hands on what was published in answer.

        One without an answer gives no turn: else nodes that answer each other would leave less time to all others.
        """

        def take(data: Any) -> None:
            is_due, self._is_due, before = self._is_due, True, self._published
            try:
                receive(data)
                if self._published > before:
                    self._hand_on()
            finally:
                self._is_due = is_due
                self._request()

        return take

    def _request(self) -> None:
        """Request a turn of the executor, where something waits for one."""
        if self._next and not self._is_due:
            self._is_due = True
            self._later(self._turn)

    def _turn(self) -> None:
        self._hand_on()
        self._is_due = False
        self._request()

    def _hand_on(self) -> None:
        following = self._next
        for _ in range(self._most):
            if not following:
                return
            takers, waiting = following.popleft()
            stamp, value = waiting.popleft()
            for take in takers:
                take(stamp, value)
