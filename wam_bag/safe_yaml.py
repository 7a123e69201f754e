"""YAML of bags: read with bounded effort, written without anchors."""

from typing import Any

import yaml

from wam_bag.limits import READING_LIMITS

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the same in C, if it was built
_DUMPER: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


def load(text: str | bytes, longest: int = READING_LIMITS.yaml_length) -> Any:
    """Values of a YAML text of at most `longest` bytes.

    Raises
    ------
    yaml.YAMLError
        if it is not YAML, too long or nested too deeply, has a value that is none of its kind, as `!!bool x`, or has
        aliases, whose expansion may take any amount of memory.
    UnicodeDecodeError
        if it is not UTF-8.
    """
    if len(text) > longest:
        raise yaml.YAMLError(f"it has {len(text)} bytes; at most {longest} are read")
    text = text.decode() if isinstance(text, bytes) else text
    depth = 0
    for event in yaml.parse(text, Loader=_LOADER):
        if isinstance(event, yaml.AliasEvent):
            raise yaml.YAMLError("aliases are not read")
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > READING_LIMITS.yaml_depth:
            raise yaml.YAMLError(f"it is nested more than {READING_LIMITS.yaml_depth} levels deep")
    try:
        return yaml.load(text, _LOADER)
    except (ValueError, TypeError, LookupError, OverflowError, AttributeError) as error:
        raise yaml.YAMLError(f"one of its values does not fit its tag, or is no date: {error}") from error


class _Plain(_DUMPER):
    """YAML without anchors, which rosbag2's reader and people read more easily."""

    def ignore_aliases(self, data: Any) -> bool:
        """Write everything out."""
        return True


def dump(value: Any) -> str:
    """YAML text of a value, maps in their own order."""
    return str(yaml.dump(value, Dumper=_Plain, sort_keys=False))
