"""YAML read with duplicate keys refused, which YAML itself accepts silently; parameters written as ROS does."""

from collections.abc import Hashable, Mapping
from typing import Any

import yaml

from wam_description.parameters import nested


class _Strict(yaml.SafeLoader):
    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: set[str] = set()
        for key in (key for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
            if key.value in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"'{key.value}' is given twice; remove one of the two", key.start_mark
                )
            seen.add(key.value)
        return super().construct_mapping(node, deep)


def parse(text: str) -> Any:
    """The content of a YAML text.

    Raises
    ------
    yaml.YAMLError
        if it is not YAML, a key is given twice in one mapping, or blocks and brackets are nested too deeply for
        Python; names the line where it is known.
    """
    try:
        return yaml.load(text, _Strict)  # a safe loader
    except RecursionError:
        raise yaml.YAMLError("its brackets or blocks are nested hundreds of levels deep; allowed: a few") from None


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
    return str(yaml.safe_dump(tree, sort_keys=False, default_flow_style=None, allow_unicode=True, width=110))


def _plain(value: Any) -> Any:
    return value if isinstance(value, (bool, int, float, str)) else list(value)
