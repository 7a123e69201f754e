"""Message definitions: text, fields and hash of each type that the stack publishes, as ROS Jazzy installs them.

They are in `messages.json`, a copy of common_interfaces and rcl_interfaces (Apache-2.0).
"""

import json
from functools import cache
from pathlib import Path
from typing import Any

from wam_bag.message_text import SEPARATOR, Fields, fields


@cache
def _copies() -> dict[str, Any]:
    return json.loads(Path(__file__).with_name("messages.json").read_text(encoding="utf-8"))


def _text(name: str) -> str:
    return "\n".join(_copies()[name]["text"]) + "\n"


@cache
def definition(name: str) -> Fields:
    """The fields of ``package/msg/Type``."""
    return fields(_text(name), name.partition("/")[0])


@cache
def schema(name: str) -> bytes:
    """The ``ros2msg`` schema: the text of the type, then that of each type it consists of, once."""
    parts, names = [_text(name)], [name]
    for outer in names:
        for field in definition(outer):
            if "/" in field.type and field.type not in names:
                names.append(field.type)
                package, _, kind = field.type.split("/")
                parts.append(f"{SEPARATOR}\nMSG: {package}/{kind}\n{_text(field.type)}")
    return "\n".join(parts).encode()


def type_hash(name: str) -> str:
    """The RIHS01 hash of a type, as ROS computed it."""
    return str(_copies()[name]["hash"])
