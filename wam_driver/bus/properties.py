"""Numbers of the properties of a controller by the version of its firmware; from libbarrett, `property_list.cpp`.

`properties.json` has them by name, the first version and the number from that version on, and the values of the
maker's arm (btutil, manual; poles of the motors 1 to 6 are assumed).
"""

import json
from functools import cache
from pathlib import Path
from typing import Any, Final

_READ: Final[dict[str, Any]] = json.loads(Path(__file__).with_suffix(".json").read_text(encoding="utf-8"))
ARM: Final[dict[int, dict[str, int]]] = {int(node): values for node, values in _READ["arm"].items()}  # awake and zeroed


@cache
def numbers(version: int, is_safety_module: bool = False) -> dict[str, int]:
    """Numbers of the properties that a firmware has, by name."""
    known = _READ["always"] | _READ["safety" if is_safety_module else "motor"]
    rows = {name: [number for first, number in steps if first <= version] for name, steps in known.items()}
    return {name: fitting[-1] for name, fitting in rows.items() if fitting}


@cache
def names(version: int, is_safety_module: bool = False) -> dict[int, str]:
    """Names of the properties that a firmware has, by number."""
    return {number: name for name, number in numbers(version, is_safety_module).items()}
