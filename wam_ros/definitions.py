"""Message definitions as ROS installs them: text, fields and hash of a type.

Found below ``share/<package>/msg`` through the ament index or, where that is not set (wheels from
PyPI), beside the Python package of the messages.
"""

import importlib.util
import json
import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

SEPARATOR = "=" * 80
PRIMITIVES = {
    "bool": 1, "byte": 1, "char": 1, "int8": 1, "uint8": 1, "int16": 2, "uint16": 2, "int32": 4, "uint32": 4,
    "int64": 8, "uint64": 8, "float32": 4, "float64": 8,
}  # fmt: skip
_FIELD = re.compile(r"^([A-Za-z][\w/]*)(?:<=\d+)?(?:\[(<=)?(\d*)\])?\s+([A-Za-z]\w*)\s*(=?)")


class DefinitionError(LookupError):
    """A message type whose definition cannot be found or read."""


class Field(NamedTuple):
    """One field of a message: `type` is a primitive or ``package/msg/Type``.

    `length` is None for a single value, 0 for a sequence, else the length of a fixed array.
    """

    name: str
    type: str
    length: int | None


class Definition(NamedTuple):
    """A message type: ``package/msg/Type``, its text and its fields."""

    name: str
    text: str
    fields: tuple[Field, ...]


@cache
def definition(name: str) -> Definition:
    """The definition of ``package/msg/Type``."""
    text = _file(name, ".msg").read_text(encoding="utf-8")
    package = name.partition("/")[0]
    fields = []
    for line in text.splitlines():
        match = _FIELD.match(line.split("#")[0].strip())
        if match is None or match[5]:
            continue
        kind = _full_name(match[1], package)
        length = None if match[3] is None else 0 if match[2] or not match[3] else int(match[3])
        fields.append(Field(match[4], kind, length))
    return Definition(name, text, tuple(fields))


@cache
def schema(name: str) -> bytes:
    """The ``ros2msg`` schema: the text of the type, then that of each type it is made of, once."""
    parts, names = [definition(name).text], [name]
    for outer in names:
        for field in definition(outer).fields:
            if "/" in field.type and field.type not in names:
                names.append(field.type)
                package, _, kind = field.type.split("/")
                parts.append(f"{SEPARATOR}\nMSG: {package}/{kind}\n{definition(field.type).text}")
    return "\n".join(parts).encode()


@cache
def type_hash(name: str) -> str:
    """The RIHS01 hash of a type, as ROS computed it."""
    path = _file(name, ".json")
    for entry in json.loads(path.read_text(encoding="utf-8"))["type_hashes"]:
        if entry["type_name"] == name:
            return str(entry["hash_string"])
    raise DefinitionError(f"{path} has no hash of {name}; reinstall its package")


def _full_name(kind: str, package: str) -> str:
    if kind in PRIMITIVES or kind in ("string", "wstring"):
        return kind
    if kind == "Header":
        return "std_msgs/msg/Header"
    if "/" not in kind:
        return f"{package}/msg/{kind}"
    return "{}/msg/{}".format(*kind.split("/"))


def _file(name: str, suffix: str) -> Path:
    try:
        package, folder, kind = name.split("/")
    except ValueError:
        raise DefinitionError(f"message type is {name!r}; it must read package/msg/Type") from None
    path = _share(package) / folder / (kind + suffix)
    if not path.is_file():
        raise DefinitionError(f"message type {name} has no definition {path}; install the package {package}")
    return path


@cache
def _share(package: str) -> Path:
    try:
        from ament_index_python.packages import get_package_share_directory

        return Path(get_package_share_directory(package))
    except (ImportError, LookupError, OSError):
        pass  # no ROS index, or one without this package
    spec = importlib.util.find_spec(package)
    for location in (spec.submodule_search_locations or []) if spec else []:
        for parent in Path(location).parents:
            if (parent / "share" / package).is_dir():
                return parent / "share" / package
    raise DefinitionError(f"package {package} has no message definitions here; install ros-jazzy-common-interfaces")
