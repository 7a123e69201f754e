"""YAML of bags: read with bounded effort, written without anchors."""

from typing import Any, Final

import yaml

from wam_description.yaml_text import DUMPER, LOADER, events

LONGEST: Final = 2**22  # bytes; the longest files of our own, of bags of a thousand files, have a tenth of it


def load(text: str | bytes) -> Any:
    """Values of a YAML text.

    Raises
    ------
    yaml.YAMLError
        if it is not YAML, too long or nested too deeply, or has aliases, whose expansion may take any amount of memory.
    UnicodeDecodeError
        if it is not UTF-8.
    """
    if len(text) > LONGEST:
        raise yaml.YAMLError(f"it has {len(text)} bytes; at most {LONGEST} are read")
    text = text.decode() if isinstance(text, bytes) else text
    if any(isinstance(event, yaml.AliasEvent) for event in events(text)):
        raise yaml.YAMLError("aliases are not read")
    return yaml.load(text, LOADER)


class _Plain(DUMPER):
    """YAML without anchors, which rosbag2's reader and people read more easily."""

    def ignore_aliases(self, data: Any) -> bool:
        """Write everything out."""
        return True


def dump(value: Any) -> str:
    """YAML text of a value, maps in their own order."""
    return str(yaml.dump(value, Dumper=_Plain, sort_keys=False))
