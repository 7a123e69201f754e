"""The end of a process in the middleware, which may take only so long.

FastDDS 2.14 destroys its participant with a lock that a callback of discovery may be waiting for, and computes until
that callback has returned (issue 6513 of eProsima/Fast-DDS): where the programs of a stack leave the network at the
same moment, one of them may do so indefinitely.  Its work is done by then: brakes on, bag closed.
"""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final
from weakref import WeakKeyDictionary

from rclpy.context import Context

LONGEST: Final = 1.0  # s of computing, a hundred times what it takes
HELD_UP: Final = signal.SIGVTALRM  # by which the system ends the process

_BOUNDED: WeakKeyDictionary[Context, Callable[[], str]] = WeakKeyDictionary()


def bound_leaving(context: Context, failure: Callable[[], str]) -> None:
    """Let the system end this process where leaving the network with a context takes too long.

    Parameters
    ----------
    context : of all nodes of this process.
    failure : why one of them has failed, '' where none has; a failure is to be reported, however long that takes.
    """
    _BOUNDED[context] = failure


@contextmanager
def leaving(context: Context) -> Iterator[None]:
    """What destroys a node, the last one with the participant; not its own work before."""
    failure = _BOUNDED.get(context)
    if failure is None or failure():
        yield
        return
    signal.signal(HELD_UP, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST)  # of computing: a busy machine ends nobody
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
