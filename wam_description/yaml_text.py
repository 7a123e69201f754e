"""YAML read with duplicate keys refused, which YAML itself accepts silently; parameters written as ROS does."""

from collections.abc import Hashable, Mapping
from typing import Any, Final

import yaml

from wam_description.parameters import nested

DEEPEST: Final = 50  # nested mappings and lists; the loader in C recurses
# in C they take a tenth of the time, if they were built
_LOADER: Final[Any] = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_DUMPER: Final[Any] = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


class _Strict(_LOADER):
    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        if not isinstance(node, yaml.MappingNode):
            raise yaml.constructor.ConstructorError(
                None, None, "it is marked as a mapping and is none", node.start_mark
            )
        seen: set[str] = set()
        for key in (key for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
            if key.value in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"'{key.value}' is given twice; remove one of the two", key.start_mark
                )
            seen.add(key.value)
        mapping: dict[Hashable, Any] = super().construct_mapping(node, deep)
        return mapping


def parse(text: str) -> Any:
    """The content of a YAML text.

    Raises
    ------
    yaml.YAMLError
        if it is not YAML, a key is given twice in one mapping, or it is nested more than `DEEPEST` levels deep; names
        the line where it is known.
    """
    depth = 0
    for event in yaml.parse(text, Loader=_LOADER):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > DEEPEST:
            raise yaml.YAMLError(f"it is nested more than {DEEPEST} levels deep")
    try:
        return yaml.load(text, _Strict)  # a safe loader
    except (ValueError, TypeError, LookupError, OverflowError) as error:  # of the value of a tag, as a date of month 99
        raise yaml.YAMLError(f"one of its values is none of its kind: {error}") from error


def dump(tree: Any) -> str:
    """YAML of plain values: mappings in their own order, lists of numbers in a line."""
    written = yaml.dump(tree, Dumper=_DUMPER, sort_keys=False, default_flow_style=None, allow_unicode=True, width=110)
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
