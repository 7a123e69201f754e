"""Numbers of the properties of a controller by the version of its firmware; from libbarrett, `property_list.cpp`.

`properties.json` has them by name: the first version, and the number from that version on.
"""

import json
from bisect import bisect_right
from functools import cache
from pathlib import Path
from typing import Any, Final

_READ: Final[dict[str, Any]] = json.loads(Path(__file__).with_suffix(".json").read_text(encoding="utf-8"))
MOTOR, SAFETY = ({**_READ["always"], **_READ[node]} for node in ("motor", "safety"))


def number(name: str, version: int, is_safety_module: bool = False) -> int:
    """Number of a property.

    Raises
    ------
    KeyError
        where the firmware of this version has no such property.
    """
    rows = (SAFETY if is_safety_module else MOTOR)[name]
    at = bisect_right([first for first, _ in rows], version)
    if not at:
        raise KeyError(f"firmware {version} has no property {name}; it came with {rows[0][0]}")
    found: int = rows[at - 1][1]
    return found


@cache
def names(version: int, is_safety_module: bool = False) -> dict[int, str]:
    """Names of all properties of a firmware by their number."""
    table = SAFETY if is_safety_module else MOTOR
    known = [name for name, rows in table.items() if rows[0][0] <= version]
    return {number(name, version, is_safety_module): name for name in known}
