"""Progress of a long computation: one line that is updated on a terminal, a few lines elsewhere."""

import time
from typing import TextIO


class Progress:
    """Progress as text.

    On a terminal one line is overwritten; elsewhere a line is written after each tenth.

    Parameters
    ----------
    name : of the computation.
    stream : usually stderr.
    """

    def __init__(self, name: str, stream: TextIO) -> None:
        self._name, self._stream = name, stream
        self._begin: float | None = None
        self._first = 0  # finished before the start
        self._tenth = -1
        self._terminal = stream.isatty()

    def __call__(self, done: int, of: int) -> None:
        """Show that `done` pieces of `of` are finished."""
        now = time.monotonic()
        if self._begin is None:
            self._begin, self._first = now, done
        text = f"{self._name}: {done} of {of}"
        if self._first:
            text += f", {self._first} from an earlier run"
        if self._first < done < of:
            left = (now - self._begin) / (done - self._first) * (of - done)
            text += f", {left:.0f} s left"
        if self._terminal:
            self._stream.write(f"\r\x1b[K{text}" + ("\n" if done == of else ""))
        elif (tenth := 10 * done // max(of, 1)) > self._tenth:
            self._tenth = tenth
            self._stream.write(text + "\n")
        self._stream.flush()
