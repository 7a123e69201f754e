"""Message definitions as ROS installs them: text, fields and hash of a type.

Found below ``share/<package>/msg`` through the ament index or, if that is not set (wheels from PyPI), next to
the Python package of the messages.  Where there is no ROS, `messages.json` has those that a simulation records; it is
a copy of what ROS Jazzy installs, common_interfaces (Apache-2.0).
"""

import importlib.util
import json
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from wam_bag.message_text import SEPARATOR, Fields, fields


class DefinitionError(LookupError):
    """A message type whose definition cannot be found or read."""


class Definition(NamedTuple):
    """A message type: ``package/msg/Type``, its text and its fields."""

    name: str
    text: str
    fields: Fields


@cache
def definition(name: str) -> Definition:
    """The definition of ``package/msg/Type``."""
    if (copy := _copy(name)) is not None:
        text = "\n".join(copy["text"]) + "\n"
    else:
        text = _file(name, ".msg").read_text(encoding="utf-8")
    return Definition(name, text, fields(text, name.partition("/")[0]))


@cache
def schema(name: str) -> bytes:
    """The ``ros2msg`` schema: the text of the type, then that of each type it consists of, once."""
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
    if (copy := _copy(name)) is not None:
        return str(copy["hash"])
    path = _file(name, ".json")
    for entry in json.loads(path.read_text(encoding="utf-8"))["type_hashes"]:
        if entry["type_name"] == name:
            return str(entry["hash_string"])
    raise DefinitionError(f"{path} has no hash of {name}; reinstall its package")


@cache
def _copies() -> dict[str, Any]:
    return json.loads(Path(__file__).with_name("messages.json").read_text(encoding="utf-8"))


def _copy(name: str) -> Any:
    """The entry of a type in `messages.json`, None where ROS has its definition, or there is no entry."""
    try:
        _file(name, ".msg")
    except DefinitionError:
        return _copies().get(name)
    return None


def _file(name: str, suffix: str) -> Path:
    try:
        package, folder, kind = name.split("/")
    except ValueError:
        raise DefinitionError(f"message type is {name!r}; it must have the form package/msg/Type") from None
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
