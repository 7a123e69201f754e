"""What can be wrong with a bag: the errors that reach the user and those within the package."""

import shlex
import struct
from pathlib import Path
from typing import Final

import zstandard
from mcap.exceptions import McapError


class BagError(ValueError):
    """A bag that cannot be read; the message names the path, what is wrong and what to do."""


class RecordingError(OSError):
    """A bag that cannot be created or written; the message names the path and what to do."""


class Damage(ValueError):
    """Something in a file that is not as it must be; the message names what and where."""


class TooLargeError(Damage):
    """A chunk or an attachment that would take too much memory."""


class NotClosedError(Damage):
    """A file that was not finished."""


def command(words: str, path: Path | str) -> str:
    """A command on a path as the reader of a message can copy it, in quotes."""
    text = f"{words} {shlex.quote(str(path))}"
    return f'"{text}"' if "'" in text else f"'{text}'"


BROKEN: Final = (
    ValueError, struct.error, McapError, zstandard.ZstdError, RuntimeError, LookupError, OverflowError, MemoryError,
)  # fmt: skip
"""What reading a broken file may raise: our errors and those of the libraries."""
