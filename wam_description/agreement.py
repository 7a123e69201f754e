"""Whether nodes that were started apart work with the same shared parameters, by what their statuses have of them."""

import base64
import zlib
from typing import Any

from wam_description.arm import Shared
from wam_description.parameters import fields, listed, values
from wam_description.thresholds import FILES

DIGESTS = "shared parameters"  # fact in the status of a node: `digests` of what it was started with
OF_ONE_PROCESS = frozenset(
    {"nodes", "timing.niceness", "timing.fifo_priority", "timing.timeout", "timing.real_time_factor"}
)  # nothing that a node computes depends on them
OTHER_VERSION = "version of wam_stack"
_LENGTH = 3  # characters of 6 bits each: two values have the same digest in one of 260 000 cases


def digests(shared: Shared) -> str:
    """A digest of the names of the compared parameters, then one of the value of each; of three characters.

    All are compared but those of one process.
    """
    present, names = values(shared), _compared()
    return "".join([_digest(names), *(_digest(listed(present[name])) for name in names)])


def disagreement(node: str, own: str, other: str) -> str:
    """Why the driver has to brake for what a node was started with, '' where it has no reason.

    Parameters
    ----------
    node : name of the node.
    own, other : `digests` of the driver and of the node; there is no reason in an empty one.
    """
    if not (found := difference(own, other)):
        return ""
    if found == OTHER_VERSION:
        return (
            f"{node} was started with another version of wam_stack than the driver; "
            "start all nodes with the same version"
        )
    return f"{node} was started with another {found} than the driver; start all nodes with the same configuration"


def difference(one: str, other: str) -> str:
    """Which parameters differ between two `digests`, or `OTHER_VERSION`; '' where none does, or where one is empty."""
    if not (one and other) or one == other:
        return ""
    names = _compared()
    if len(other) != len(one) or _part(other, 0) != _part(one, 0):
        return OTHER_VERSION
    different = [name for i, name in enumerate(names, start=1) if _part(one, i) != _part(other, i)]
    more = f" and {len(different) - FILES.disagreements} more" if len(different) > FILES.disagreements else ""
    return f"{', '.join(different[: FILES.disagreements])}{more}"


def _compared() -> list[str]:
    return [field.name for field in fields(Shared) if field.name not in OF_ONE_PROCESS]


def _digest(value: Any) -> str:
    number = zlib.crc32(repr(_unsigned(value)).encode())
    return base64.b64encode(number.to_bytes(4, "big")).decode()[:_LENGTH]


def _unsigned(value: Any) -> Any:
    """The same with 0.0 for -0.0, which equals it."""
    if isinstance(value, list | tuple):
        return [_unsigned(one) for one in value]
    return value + 0.0 if isinstance(value, float) else value


def _part(text: str, i: int) -> str:
    return text[i * _LENGTH : (i + 1) * _LENGTH]
