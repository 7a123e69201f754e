"""Messages serialized (CDR, little-endian) from their values, where there is no ROS to do it."""

import struct
from collections.abc import Sequence
from typing import Any, Final

from wam_bag.definitions import definition

_LETTERS: Final = {
    "bool": "?", "byte": "B", "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i",
    "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip


def encoded(kind: str, value: Sequence[Any]) -> bytes:
    """A serialized message.

    Parameters
    ----------
    kind : ``package/msg/Type``.
    value : its fields in their order: a number, a string, bytes, a sequence of them, or the fields of a message.
    """
    body = bytearray()
    _message(body, kind, value)
    return b"\0\1\0\0" + bytes(body)


def _message(body: bytearray, kind: str, value: Sequence[Any]) -> None:
    for field, part in zip(definition(kind).fields, value, strict=True):
        if field.length is None:
            _one(body, field.type, part)
            continue
        if not field.length:
            _numbers(body, "I", [len(part)])
        if isinstance(part, bytes):
            body += part
        elif field.type in _LETTERS:
            _numbers(body, _LETTERS[field.type], part)
        else:
            for item in part:
                _one(body, field.type, item)


def _one(body: bytearray, kind: str, value: Any) -> None:
    if kind == "string":
        text = value.encode() + b"\0"
        _numbers(body, "I", [len(text)])
        body += text
    elif kind in _LETTERS:
        _numbers(body, _LETTERS[kind], [value])
    else:
        _message(body, kind, value)


def _numbers(body: bytearray, letter: str, values: Sequence[float]) -> None:
    """Numbers, aligned to their size."""
    if values:
        body += bytes(-len(body) % struct.calcsize(letter))
        body += struct.pack(f"<{len(values)}{letter}", *values)
