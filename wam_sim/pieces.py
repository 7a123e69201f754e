"""Finished pieces of a batch on disk, as text: reading one runs no code, unlike a pickle.

A piece is a file of JSON below a line with its hash, so that a damaged one is computed again.  It is named by a hash of
the function, of its input and of every source file of the stack, so that a result of other code is never used.  Numbers
are exact to the bit.
"""

import base64
import hashlib
import inspect
import json
import os
import pickle
import sys
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import numpy as np

from wam_description.configuration import packaged

_ROOT: Final = Path(__file__).resolve().parents[1]
_NUMERIC: Final = "biufc"  # kinds of numpy arrays that are plain numbers


def default_folder() -> Path:
    """The user's own cache directory, whatever the working directory is."""
    cache_home = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(cache_home) if Path(cache_home).is_absolute() else Path.home() / ".cache") / "wam_stack" / "pieces"


def require_own(folder: Path) -> None:
    """Refuse a folder that belongs to another user, who could put results of his own into it.

    Raises
    ------
    ValueError
        if the folder exists and is not the user's.
    """
    if folder.exists() and folder.stat().st_uid != os.getuid():
        raise ValueError(f"{folder} belongs to another user; choose a directory of your own for finished pieces")


def file_of(folder: Path, function: Callable[..., Any], given: Any) -> Path:
    """File of the piece of a function and an input."""
    name = f"{function.__module__}:{function.__qualname__}"
    source = inspect.getsourcefile(function)
    own = Path(source).read_bytes() if source else b""
    key = hashlib.sha256(pickle.dumps((name, own, given, sources()), protocol=5)).hexdigest()[:32]
    return folder / f"{key}.piece"


@cache
def sources(packages: str = "wam_*") -> str:
    """Hash of the source files of the packages that a pattern names, and of the versions of NumPy and MuJoCo."""
    digest = hashlib.sha256(f"{version('numpy')} {version('mujoco')}".encode())
    for path in sorted([*_ROOT.glob(f"{packages}/**/*.py"), *packaged("testbed").parent.glob("*.yaml")]):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def write(file: Path, value: object) -> None:
    """Write a piece; a reader sees all of it or nothing.

    Raises
    ------
    TypeError
        if the value has anything but numbers, texts, arrays, lists, tuples and NamedTuples.
    """
    content = json.dumps(_encoded(value))
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_suffix(f".{os.getpid()}.part")
    part.write_text(f"{_hash(content)}\n{content}", encoding="ascii")
    part.replace(file)


def read(file: Path) -> tuple[Any] | None:
    """A piece, None if there is none or it is damaged."""
    try:
        digest, _, content = file.read_bytes().decode("ascii").partition("\n")
        return (_decoded(json.loads(content)),) if _hash(content) == digest else None
    except (FileNotFoundError, ValueError):
        return None


def _hash(content: str) -> str:
    return hashlib.sha256(content.encode("ascii")).hexdigest()


def _encoded(value: Any) -> Any:
    """A value as JSON: numbers and texts as they are, everything else as one pair of kind and content."""
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, np.ndarray) and value.dtype.kind in _NUMERIC:
        data = base64.b64encode(np.ascontiguousarray(value).tobytes()).decode("ascii")
        return {"array": [value.dtype.str, list(value.shape), data]}
    if isinstance(value, np.generic) and value.dtype.kind in _NUMERIC:
        return _encoded(value.item())
    if isinstance(value, (list, tuple)):
        kind = type(value)
        items = [_encoded(item) for item in value]
        if kind in (list, tuple):
            return {kind.__name__: items}
        if hasattr(value, "_fields"):
            return {"named": [kind.__module__, kind.__qualname__, items]}
    raise TypeError(f"a piece cannot hold {type(value).__name__} ({value!r})")


def _decoded(tree: Any) -> Any:
    if not isinstance(tree, dict):
        return tree
    ((kind, content),) = tree.items()
    if kind == "array":
        dtype, shape, data = content
        if np.dtype(dtype).kind not in _NUMERIC:
            raise ValueError(f"array of {dtype}")
        return np.frombuffer(base64.b64decode(data), dtype).reshape(shape).copy()
    if kind == "named":
        module, name, items = content
        found = getattr(sys.modules.get(module), name, None)  # nothing is imported for a file
        if not (isinstance(found, type) and issubclass(found, tuple) and hasattr(found, "_make")):
            raise ValueError(f"no NamedTuple {module}.{name}")
        return found._make(map(_decoded, items))
    if kind in ("list", "tuple"):
        items = [_decoded(item) for item in content]
        return items if kind == "list" else tuple(items)
    raise ValueError(f"unknown kind {kind}")
