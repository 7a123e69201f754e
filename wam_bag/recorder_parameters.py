"""Parameters of nodes that a recorder attached: those of several attachments together, and the mode by them."""

from collections.abc import Mapping
from typing import Any

import yaml

from wam_bag import safe_yaml
from wam_bag.losses import RECORDING


def with_nodes_of(before: bytes, after: bytes) -> bytes:
    """The later parameters with those of nodes that only the earlier ones have, unless one of them is unreadable.

    A recorder attaches them again when it knows those of more nodes, and a tool that merges bags takes those of each.
    """
    try:
        nodes, known = safe_yaml.load(after), safe_yaml.load(before)
    except (yaml.YAMLError, UnicodeDecodeError):
        return after
    if not (isinstance(nodes, dict) and isinstance(known, dict) and known.keys() - nodes.keys()):
        return after
    return safe_yaml.dump({**known, **nodes}).encode()


def mode_of(metadata: Mapping[str, Mapping[str, str]], parameters: bytes | None) -> str:
    """'realtime', 'lockstep' or 'unknown': by the recorder's metadata, else by the parameters of its nodes.

    A recorder that was killed left only the parameters.
    """
    recorded = metadata.get(RECORDING, {}).get("mode")
    if recorded is not None or parameters is None:
        return recorded or "unknown"
    try:
        modes = {_timing_mode(node["ros__parameters"]) for node in safe_yaml.load(parameters).values()}
    except (yaml.YAMLError, ValueError, LookupError, TypeError, AttributeError):
        return "unknown"
    known = sorted(str(mode) for mode in modes - {None})
    return known[0] if len(known) == 1 else "unknown"


def _timing_mode(parameters: Mapping[str, Any]) -> Any:
    return parameters.get("timing", {}).get("mode", parameters.get("timing.mode"))
