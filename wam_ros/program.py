"""Signals while a program of ours still imports, and while Python ends it.

Python itself would print the traceback of the import that Ctrl-C interrupts, and a second Ctrl-C while
Python ends would kill the program.  Only the standard library is imported here, so that a program can
call `end_at_once_on_signals` before all else.
"""

import os
import signal

SIGNALS = (signal.SIGINT, signal.SIGTERM)
LISTENER_GONE = signal.SIGUSR1  # from bring-up, before SIGTERM: a node was killed, which takes no message any more


def end_at_once_on_signals(last_words: str = "") -> None:
    """Until the program handles SIGINT and SIGTERM itself, they end it with code 128 + number.

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
    """Ignore SIGINT and SIGTERM: the program has done its work and ends."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


class Stop:
    """Set by SIGINT and SIGTERM; the context stays alive, so that nodes can report that they end."""

    def __init__(self) -> None:
        self.is_set = False
        for number in SIGNALS:
            signal.signal(number, self._take)

    def _take(self, number: int, frame: object) -> None:
        self.is_set = True


def main() -> None:
    """Run the nodes that the name of this program, or its first arguments, name."""
    end_at_once_on_signals()
    try:
        from wam_ros.node import main as run_node

        run_node()
    finally:
        ignore_signals()


if __name__ == "__main__":
    main()
