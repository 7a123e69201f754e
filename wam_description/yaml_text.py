"""YAML of plain values, read with every oddity refused that YAML itself accepts; parameters written as ROS does."""

import re
from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Any, ClassVar, Final, TextIO

import yaml

from wam_description.parameters import ParameterError, is_finite, nested
from wam_description.thresholds import FILES

OCTAL: Final = re.compile("[-+]?0[0-7_]+")
UNREADABLE: Final = (ValueError, TypeError, LookupError, OverflowError, AttributeError)  # of tags, as `!!bool x`
# in C they take a tenth of the time, if they were built
_LOADER: Final[Any] = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_DUMPER: Final[Any] = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


def _refusal(reason: str, at: Any) -> yaml.YAMLError:
    """The reason with the line of a node or an event."""
    return yaml.constructor.ConstructorError(None, None, reason, at.start_mark)


class _Strict(_LOADER):
    # on, off, yes and no are texts, as in YAML 1.2
    yaml_implicit_resolvers: ClassVar = {
        first: [one for one in found if first in "tTfF" or not one[0].endswith(":bool")]
        for first, found in _LOADER.yaml_implicit_resolvers.items()
    }

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: set[str] = set()
        for key in (key for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
            if key.value in seen:
                raise _refusal(f"'{key.value}' is given twice; remove one of the two", key)
            seen.add(key.value)
        mapping: dict[Hashable, Any] = super().construct_mapping(node, deep)
        for name in mapping:
            if not isinstance(name, str):
                raise _refusal(f"the key {name!r} is no text; write it in quotes if it is one", node)
        return mapping

    def construct_decimal(self, node: yaml.ScalarNode) -> float:
        """A number as it reads: YAML 1.1 takes 010 for 8 and 1:30 for 90."""
        is_int = node.tag.endswith(":int")
        value: float = self.construct_yaml_int(node) if is_int else self.construct_yaml_float(node)
        if not is_finite(value) and is_int:
            raise _refusal(f"a number of {len(node.value)} digits is beyond every float", node)
        if ":" in node.value or (is_int and OCTAL.fullmatch(node.value) and value != int(node.value)):
            raise _refusal(f"{node.value} is {value:g} in YAML; write that number, or a text in quotes", node)
        return value


for _kind in ("int", "float"):
    _Strict.add_constructor(f"tag:yaml.org,2002:{_kind}", _Strict.construct_decimal)


def read(path: Path, kind: str) -> Any:
    """The content of a YAML file of a kind.

    Raises
    ------
    ParameterError
        if it is no text, or as for `parse`; names the file.
    """
    try:
        with path.open(encoding="utf-8") as file:
            return parse(file)
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ParameterError(f"{kind} {path} is not YAML: {error}") from error


def parse(text: str | TextIO) -> Any:
    """The content of a YAML text, or of a file, which an error names.

    Raises
    ------
    yaml.YAMLError
        if it is not YAML, a key is given twice in one mapping or is no text, a number is another one than it seems, it
        contains itself, or it is nested more than `FILES.deepest` levels deep; names the line where it is known.
    """
    try:
        _require_plain(text)
        if not isinstance(text, str):
            text.seek(0)
        return yaml.load(text, _Strict)  # a safe loader
    except UNREADABLE as error:
        raise yaml.YAMLError(f"one of its values cannot be read: {error}") from error


def _require_plain(text: str | TextIO) -> None:
    within: list[str | None] = []  # anchors of the mappings and lists around an event
    for event in yaml.parse(text, Loader=_LOADER):
        if isinstance(event, yaml.CollectionStartEvent):
            within.append(event.anchor)
        elif isinstance(event, yaml.CollectionEndEvent):
            within.pop()
        elif isinstance(event, yaml.AliasEvent) and event.anchor in within:
            raise _refusal(f"*{event.anchor} is inside of what it refers to; write the value itself", event)
        if len(within) > FILES.deepest:
            raise yaml.YAMLError(f"it is nested more than {FILES.deepest} levels deep")


class _WithoutAliases(_DUMPER):
    def ignore_aliases(self, data: Any) -> bool:
        return True


def dump(tree: Any) -> str:
    """YAML of plain values: mappings in their own order, lists of numbers in a line, no aliases, which ROS refuses."""
    written = yaml.dump(
        tree, Dumper=_WithoutAliases, sort_keys=False, default_flow_style=None, allow_unicode=True, width=110
    )
    return str(written)


def parameter_text(parameters: Mapping[str, Mapping[str, Any]]) -> str:
    """Parameters as a ROS parameter file.

    Parameters
    ----------
    parameters : values by dotted name, by full node name; None is left out.
    """
    tree = {
        node: {
            "ros__parameters": nested({name: _plain(one) for name, one in sorted(values.items()) if one is not None})
        }
        for node, values in sorted(parameters.items())
    }
    return dump(tree)


def _plain(value: Any) -> Any:
    return value if isinstance(value, (bool, int, float, str)) else list(value)
