"""YAML with duplicate keys refused, which YAML itself accepts silently."""

from collections.abc import Hashable
from typing import Any

import yaml


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
