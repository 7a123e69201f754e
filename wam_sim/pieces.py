"""Finished pieces of a batch in a file of lines: reading one runs no code of the file.

A line is JSON with the key of the piece, its value and a hash of that, so that a damaged one is computed again.  The
key is a hash of the function, of its input and of the code that it depends on, so that a result of other code is never
used.  The value is a pickle of which plain values alone are read.  Numbers are exact to the bit.
"""

import base64
import hashlib
import inspect
import io
import json
import os
import pickle
import sys
from collections.abc import Callable
from enum import Enum
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import numpy as np

from wam_description.configuration import packaged

_ROOT: Final = Path(__file__).resolve().parents[1]
_BEGIN: Final = '{"key": '  # of every line
_PLAIN: Final = (tuple, Enum, np.ndarray, np.dtype)  # types of values, besides those that have no name in a pickle
_OF_NUMPY: Final = [value.__reduce__()[0] for value in (np.zeros(1), np.float64(0.0))]  # what makes arrays and scalars


def default_file(name: str) -> Path:
    """A file in the user's own cache directory, whatever the working directory is."""
    cache_home = os.environ.get("XDG_CACHE_HOME", "")
    folder = Path(cache_home) if Path(cache_home).is_absolute() else Path.home() / ".cache"
    return folder / "wam_stack" / f"{name}.jsonl"


class FinishedPieces:
    """The pieces in a file, and those that are added to it.

    Parameters
    ----------
    file : made with the first piece where there is none.

    Raises
    ------
    ValueError
        for a file of another user, who could put results of his own into it, and for one of another kind.
    """

    def __init__(self, file: Path) -> None:
        self._file = file
        self._values = dict[str, str]()
        self._is_cut = False
        if not file.exists():
            return
        if file.stat().st_uid != os.getuid():
            raise ValueError(f"{file} belongs to another user; choose a file of your own for results")
        text = file.read_bytes().decode("utf-8", "replace")
        if text and not text.startswith(_BEGIN[: len(text)]):
            raise ValueError(f"{file} is no file of results; choose another one")
        self._is_cut = bool(text) and not text.endswith("\n")  # the program was ended while it wrote
        for line in text.splitlines():
            self._take(line)

    def _take(self, line: str) -> None:
        try:
            piece = json.loads(line)
            if piece["hash"] == _hash(piece["value"]):
                self._values[piece["key"]] = piece["value"]
        except (ValueError, LookupError, TypeError, AttributeError):
            return  # damaged

    def get(self, key: str) -> tuple[Any] | None:
        """The value of a piece, None if there is none or it is damaged."""
        try:
            return (_read(self._values[key]),)
        except Exception:  # a pickle that is damaged may raise any
            return None

    def add(self, key: str, value: object) -> None:
        """Append a piece.

        Raises
        ------
        TypeError
            if the value has anything but numbers, texts, arrays, lists, tuples, mappings, NamedTuples and enumerations.
        """
        text = base64.b64encode(pickle.dumps(value, protocol=4)).decode("ascii")
        try:
            _read(text)
        except pickle.UnpicklingError as error:
            raise TypeError(f"a piece cannot hold {error}") from None
        line = json.dumps({"key": key, "hash": _hash(text), "value": text})
        self._file.parent.mkdir(parents=True, exist_ok=True)
        with self._file.open("a", encoding="utf-8") as stream:
            stream.write("\n" * self._is_cut + line + "\n")
        self._is_cut = False
        self._values[key] = text


def key_of(function: Callable[..., Any], given: Any) -> str:
    """The key of the piece of a function and an input: a hash of both and of the code that the result depends on."""
    name, source = f"{function.__module__}:{function.__qualname__}", inspect.getsourcefile(function)
    code = sources(Path(source).resolve() if source else None)
    return hashlib.sha256(pickle.dumps((name, given, code), protocol=5)).hexdigest()[:32]


@cache
def sources(file: Path | None) -> str:
    """Hash of all packages of ours, of a source file and those next to it, and of the versions of NumPy and MuJoCo."""
    found = {*_ROOT.glob("wam_*/**/*.py"), *packaged("testbed").parent.glob("*.yaml")}
    if file is not None:
        found |= {file, *file.parent.glob("*.py")}
    digest = hashlib.sha256(f"{version('numpy')} {version('mujoco')}".encode())
    for path in sorted(found):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _hash(content: str) -> str:
    return hashlib.sha256(content.encode()).hexdigest()[:16]


class _Reader(pickle.Unpickler):
    """Reads plain values: what else a pickle names is refused, and nothing is imported for it."""

    def find_class(self, module: str, name: str) -> Any:
        """A type of plain values."""
        found = getattr(sys.modules.get(module), name, None)
        if found in _OF_NUMPY or (isinstance(found, type) and issubclass(found, _PLAIN)):
            return found
        raise pickle.UnpicklingError(f"{module}.{name}")


def _read(text: str) -> Any:
    return _Reader(io.BytesIO(base64.b64decode(text))).load()
