"""How far a long computation is, for people: one line that changes on a terminal, a few lines elsewhere."""

import time
from typing import TextIO


class Progress:
    """Reports of pieces done, as text.

    On a terminal one line is written over; elsewhere a line is written for each tenth that is done.

    Parameters
    ----------
    name : of what is computed.
    stream : usually stderr.
    """

    def __init__(self, name: str, stream: TextIO) -> None:
        self._name, self._stream = name, stream
        self._begin: float | None = None
        self._first = 0  # done before we began
        self._tenth = -1
        self._terminal = stream.isatty()

    def __call__(self, done: int, of: int) -> None:
        """Say that so many pieces of so many are done."""
        now = time.monotonic()
        if self._begin is None:
            self._begin, self._first = now, done
        text = f"{self._name}: {done} of {of}"
        if self._first:
            text += f", {self._first} kept from before"
        if self._first < done < of:
            left = (now - self._begin) / (done - self._first) * (of - done)
            text += f", {left:.0f} s left"
        if self._terminal:
            self._stream.write(f"\r\x1b[K{text}" + ("\n" if done == of else ""))
        elif (tenth := 10 * done // max(of, 1)) > self._tenth:
            self._tenth = tenth
            self._stream.write(text + "\n")
        self._stream.flush()
