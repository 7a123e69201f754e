"""Message definitions as text: the fields of a type, from a .msg file or from the schema of a bag."""

import re
from functools import lru_cache
from typing import Final, NamedTuple

SEPARATOR: Final = "=" * 80
PRIMITIVES: Final = {
    "bool": "B", "byte": "B", "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i",
    "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
"""The letter of each number for `struct` and numpy."""
_TIMES = {"time": "builtin_interfaces/msg/Time", "duration": "builtin_interfaces/msg/Duration"}  # as ROS 1 has them
_FIELD = re.compile(r"^([A-Za-z][\w/]*)(?:<=\d+)?(?:\[(<=)?(\d*)\])?\s+([A-Za-z]\w*)\s*(=?)")


class MessageField(NamedTuple):
    """One field of a message: `type` is a primitive or ``package/msg/Type``.

    `length` is None for a single value, 0 for a sequence, else the length of a fixed array.
    """

    name: str
    type: str
    length: int | None


Fields = tuple[MessageField, ...]


def fields(text: str, package: str) -> Fields:
    """The fields that a .msg text of a package defines, without constants."""
    found = []
    for line in text.splitlines():
        match = _FIELD.match(line.split("#")[0].strip())
        if match is None or match[5]:
            continue
        kind = match[1]
        if kind == "Header":
            kind = "std_msgs/msg/Header"
        elif kind not in PRIMITIVES and kind not in ("string", "wstring"):
            kind = _TIMES.get(kind) or full_name(kind if "/" in kind else f"{package}/{kind}")
        length = None if match[3] is None else 0 if match[2] or not match[3] else int(match[3])
        found.append(MessageField(match[4], kind, length))
    return tuple(found)


@lru_cache(maxsize=256)
def definitions(name: str, schema: bytes) -> dict[str, Fields]:
    """The types of a ``ros2msg`` schema by their full names, the type itself and those it consists of.

    Parameters
    ----------
    name : ``package/msg/Type``.
    schema : text of the type and, each below a line of '=' and its name, of the others.

    Raises
    ------
    ValueError
        if the text is not a schema of that type; the message gives the reason.
    """
    parts = name.split("/")
    if len(parts) != 3:
        raise ValueError(f"type {name!r} does not have the form package/msg/Type")
    first, *others = re.split(r"^={80}\n", schema.decode("utf-8").replace("\r\n", "\n"), flags=re.MULTILINE)
    found = {
        **dict.fromkeys(_TIMES.values(), fields("int32 sec\nuint32 nanosec", "")),
        name: fields(first, parts[0]),
    }
    for other in others:
        heading, _, text = other.partition("\n")
        kind = full_name(heading.removeprefix("MSG: ").strip())
        found[kind] = fields(text, kind.partition("/")[0])
    _check(name, found, (), set())
    return found


def _check(name: str, found: dict[str, Fields], outer: tuple[str, ...], checked: set[str]) -> None:
    if name in outer:
        raise ValueError(f"type {name} contains itself")
    if name in checked:
        return
    names = [field.name for field in found[name]]
    if len(set(names)) < len(names):
        raise ValueError(f"type {name} has a field twice; its fields: {', '.join(names)}")
    for field in found[name]:
        if "/" in field.type:
            if field.type not in found:
                raise ValueError(f"type {field.type} of field '{field.name}' of {name} is not defined")
            _check(field.type, found, (*outer, name), checked)
        elif field.type not in PRIMITIVES and field.type != "string":
            raise ValueError(f"field '{field.name}' of {name} is a {field.type}, which is not read")
    checked.add(name)


def full_name(name: str) -> str:
    """The name of a type as ROS 2 has it, package/msg/Type; one without a package stays as it is."""
    package, slash, kind = name.partition("/")
    return f"{package}/msg/{kind.removeprefix('msg/')}" if slash else name
