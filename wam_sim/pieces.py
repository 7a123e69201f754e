"""Finished pieces of a batch in a file of JSON lines: reading one runs no code, unlike a pickle.

A line has the key of the piece, its value and a hash of that, so that a damaged one is computed again.  The key is a
hash of the function, of its input and of the code that it depends on, so that a result of other code is never used.
Numbers are exact to the bit.
"""

import ast
import base64
import hashlib
import inspect
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
_STACK: Final = ("wam_theory", "wam_description", "wam_driver", "wam_control", "wam_sim")  # it loads nodes by name
_NUMERIC: Final = "biufc"  # kinds of numpy arrays that are plain numbers
_BEGIN: Final = '{"key": '  # of every line


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
        self._trees = dict[str, Any]()
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
            tree = json.loads(line)
            if tree["hash"] == _hash(json.dumps(tree["value"])):
                self._trees[tree["key"]] = tree["value"]
        except (ValueError, KeyError, TypeError):
            return  # damaged

    def get(self, key: str) -> tuple[Any] | None:
        """The value of a piece, None if there is none or it is damaged."""
        try:
            return (_decoded(self._trees[key]),)
        except (KeyError, ValueError, TypeError):
            return None

    def add(self, key: str, value: object) -> None:
        """Append a piece.

        Raises
        ------
        TypeError
            if the value has anything but numbers, texts, arrays, lists, tuples, mappings, NamedTuples and enumerations.
        """
        tree = _encoded(value)
        line = json.dumps({"key": key, "hash": _hash(json.dumps(tree)), "value": tree})
        self._file.parent.mkdir(parents=True, exist_ok=True)
        with self._file.open("a", encoding="utf-8") as stream:
            stream.write("\n" * self._is_cut + line + "\n")
        self._is_cut = False
        self._trees[key] = tree


def key_of(function: Callable[..., Any], given: Any) -> str:
    """The key of the piece of a function and an input."""
    name = f"{function.__module__}:{function.__qualname__}"
    return hashlib.sha256(pickle.dumps((name, given, code_of(function)), protocol=5)).hexdigest()[:32]


def code_of(function: Callable[..., Any]) -> str:
    """Hash of the code that the results of a function depend on."""
    source = inspect.getsourcefile(function)
    return sources(Path(source).resolve() if source else None)


@cache
def sources(file: Path | None) -> str:
    """Hash of the stack, of a source file with all that it imports of ours, and of the versions of NumPy and MuJoCo."""
    found = {path for package in _STACK for path in _ROOT.glob(f"{package}/**/*.py")}
    if file is not None:
        _add_imported(file, found)
    digest = hashlib.sha256(f"{version('numpy')} {version('mujoco')}".encode())
    for path in [*sorted(found), *sorted(packaged("testbed").parent.glob("*.yaml"))]:
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _add_imported(file: Path, found: set[Path]) -> None:
    """Add a source file, and those of this repository that it imports, directly or not."""
    if file in found:
        return
    found.add(file)
    for node in ast.walk(ast.parse(file.read_bytes())):
        names = [f".{alias.name}" for alias in node.names] if isinstance(node, (ast.Import, ast.ImportFrom)) else []
        if isinstance(node, ast.ImportFrom):
            names = [node.module or "", *(f"{node.module}{name}" for name in names)]
        for name in names:
            path = _ROOT.joinpath(*name.strip(".").split("."))
            for each in (path.with_suffix(".py"), path / "__init__.py") if name.strip(".") else ():
                if each.is_file():
                    _add_imported(each, found)


def _hash(content: str) -> str:
    return hashlib.sha256(content.encode()).hexdigest()[:16]


def _encoded(value: Any) -> Any:
    """A value as JSON: numbers and texts as they are, everything else as one pair of kind and content."""
    kind = type(value)
    if isinstance(value, Enum):
        return {"enum": [kind.__module__, kind.__qualname__, value.value]}
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, np.ndarray) and value.dtype.kind in _NUMERIC:
        data = base64.b64encode(np.ascontiguousarray(value).tobytes()).decode("ascii")
        return {"array": [value.dtype.str, list(value.shape), data]}
    if isinstance(value, np.generic) and value.dtype.kind in _NUMERIC:
        return _encoded(value.item())
    if kind in (list, tuple):
        return {kind.__name__: [_encoded(item) for item in value]}
    if kind is dict:
        return {"dict": [[_encoded(key), _encoded(item)] for key, item in value.items()]}
    if hasattr(value, "_fields"):
        return {"named": [kind.__module__, kind.__qualname__, {n: _encoded(getattr(value, n)) for n in value._fields}]}
    raise TypeError(f"a piece cannot hold {kind.__name__} ({value!r})")


def _decoded(tree: Any) -> Any:
    if not isinstance(tree, dict):
        return tree
    ((kind, content),) = tree.items()
    if kind == "array":
        dtype, shape, data = content
        if np.dtype(dtype).kind not in _NUMERIC:
            raise ValueError(f"array of {dtype}")
        return np.frombuffer(base64.b64decode(data), dtype).reshape(shape).copy()
    if kind in ("named", "enum"):
        module, name, value = content
        found = getattr(sys.modules.get(module), name, None)  # nothing is imported for a file
        if kind == "enum" and isinstance(found, type) and issubclass(found, Enum):
            return found(value)
        if kind == "named" and isinstance(found, type) and issubclass(found, tuple) and hasattr(found, "_make"):
            return found(**{name: _decoded(item) for name, item in value.items()})
        raise ValueError(f"no type of values {module}.{name}")
    if kind == "dict":
        return {_decoded(key): _decoded(item) for key, item in content}
    if kind in ("list", "tuple"):
        items = [_decoded(item) for item in content]
        return items if kind == "list" else tuple(items)
    raise ValueError(f"unknown kind {kind}")
