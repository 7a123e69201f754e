"""Signals of a program of ours, from its imports to its end, and the end in the middleware.

Python itself would print the traceback of the import that Ctrl-C interrupts, and a second Ctrl-C while
Python ends would kill the program.  Only the standard library is imported here, so that a program can
call `end_at_once_on_signals` before all else.

The end in the middleware may take only so long: FastDDS 2.14 destroys its participant with a lock that a callback of
discovery may be waiting for, and computes until that callback has returned (issue 6513 of eProsima/Fast-DDS).  Where
the programs of a stack leave the network at the same moment, one of them may do so indefinitely.  Its work is done by
then: brakes on, bag closed.
"""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

# SIGHUP comes where the terminal is closed; nohup has it ignored
SIGNALS = [signal.SIGINT, signal.SIGTERM] + [signal.SIGHUP] * (signal.getsignal(signal.SIGHUP) != signal.SIG_IGN)
LISTENER_GONE = signal.SIGUSR1  # from bring-up, before SIGTERM: a node was killed, which takes no message any more
HELD_UP: Final = signal.SIGVTALRM  # by which the system ends a process that does not leave the network
LONGEST: Final = 1.0  # s of computing to leave the network, a hundred times what it takes


def end_at_once_on_signals(last_words: str = "") -> None:
    """Until the program handles `SIGNALS` itself, they end it with code 128 + number.

    Parameters
    ----------
    last_words : written to standard error before that; '' for nothing.
    """

    def end(number: int, frame: object) -> None:
        os.write(2, last_words.encode())
        os._exit(128 + number)  # there is nothing to clean up

    for number in SIGNALS:
        signal.signal(number, end)
    signal.signal(LISTENER_GONE, signal.SIG_IGN)
    # mujoco would look for GLFW in a child process, which prints a traceback of its own; we open no window
    os.environ.setdefault("MUJOCO_GL", "disable")


def ignore_signals() -> None:
    """Ignore `SIGNALS`: the program has done its work and ends."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


class Stop:
    """Set by `SIGNALS`; the context stays alive, so that nodes can report that they end.

    Attributes
    ----------
    code : exit code of a program whose work the signal has cut short, 128 + number; 0 before.
    """

    def __init__(self) -> None:
        self.code = 0
        for number in SIGNALS:
            signal.signal(number, self._take)

    def _take(self, number: int, frame: object) -> None:
        self.code = 128 + number

    @property
    def is_set(self) -> bool:
        """Whether a signal has come."""
        return self.code > 0


@contextmanager
def held_back() -> Iterator[None]:
    """`SIGNALS` are handled at its end: an exception in a callback would be a failure that the executor reports."""
    came: list[int] = []
    numbers = SIGNALS if threading.current_thread() is threading.main_thread() else []  # no other thread handles them
    before = {number: signal.signal(number, lambda number, frame: came.append(number)) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])


@contextmanager
def leaving(context: Any) -> Iterator[None]:
    """What destroys a node, the last one with the participant; not its own work before.

    The system ends this process where that takes too long, if the context of all its nodes has a `failure` that returns
    '': a failure is to be reported, however long that takes.
    """
    failure = getattr(context, "failure", None)
    if failure is None or failure():
        yield
        return
    signal.signal(HELD_UP, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST)  # of computing: a busy machine ends nobody
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
