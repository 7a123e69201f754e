"""What parameters were in earlier versions, so that old recordings stay readable.

A new parameter gives its value for recordings without it in its own declaration, ``parameter(before=...)``.
A renamed parameter gets a line in `FORMER_NAMES`.  Only recordings are completed like this; a configuration
has to give every parameter by its present name.
"""

from collections.abc import Iterator, Mapping
from typing import Any, Final, NamedTuple

from wam_description.parameters import Field, fields

# present name: former name; with a '.' at the end that of a group; with 'node:' in front that of another node
FORMER_NAMES: Final = {
    "mismatch.": "departure.",
    "effects.added_coulomb_friction": "effects.rubbing_friction",
    "world.pushers.positions": "world.pushers.places",
    "cover_speed_limit": "elbow_speed_limit",
    "contact_position": "contact_place",
    "position_uncertainty_limit": "place_uncertainty_limit",
    "guard.stability_fraction": "guard.share",
    "guard.extra_delay": "guard.late",
    "inference.moment_arm_offset": "inference.miss",
    "inference.identification_threshold": "inference.sure",
    "inference.positions": "inference.places",
    "disturbance_force_limit": "driver:disturbance_force_limit",
    "disturbance_torque_limit": "driver:disturbance_torque_limit",
    "servo.proportional_gain": "velocity_loop:proportional_gain",
    "servo.integral_gain": "velocity_loop:integral_gain",
    "ages.feedback": "velocity_loop:command_timeout",
    "ages.command": "force_loop:command_timeout",
}
OF_ROS: Final = ("use_sim_time", "start_type_description_service", "qos_overrides.")  # every node has these


class Completed(NamedTuple):
    """The recorded parameters of a node as this version knows them.

    Attributes
    ----------
    values : flat, by present name.
    added : names that the recording lacks and that have their value from before they existed, apart from derived ones.
    missing : names that the recording lacks and for which nothing is known.
    unknown : recorded names that this version does not know; their values are ignored.
    """

    values: Mapping[str, Any]
    added: tuple[str, ...]
    missing: tuple[str, ...]
    unknown: tuple[str, ...]


def complete(node: str, nodes: Mapping[str, Mapping[str, Any]], classes: tuple[type, ...]) -> Completed:
    """Complete the recorded parameters of a node.

    Parameters
    ----------
    node : its name.
    nodes : recorded parameters of all nodes, flat, by node.
    classes : parameter classes of the node in this version.
    """
    recorded = nodes[node]
    present = [field for cls in classes for field in fields(cls)]
    values: dict[str, Any] = {}
    used: set[str] = set()
    for field in present:
        for owner, name in _names(node, field.name):
            if name in nodes.get(owner, {}):
                values[field.name] = nodes[owner][name]
                used |= {name} if owner == node else set()
                break
    added = {field.name: _before(field, values) for field in present if field.name not in values}
    missing = tuple(name for name, value in added.items() if value is None)
    values |= {name: value for name, value in added.items() if value is not None}
    unknown = tuple(name for name in recorded if name not in used and not name.startswith(OF_ROS))
    derived = {field.name for field in present if field.derived}  # a recording need not have them either
    noted = tuple(name for name in added if name not in missing and name not in derived)
    return Completed(values, noted, missing, unknown)


def _before(field: Field, values: Mapping[str, Any]) -> Any:
    """The value before the parameter existed, None if it is not known."""
    try:
        return field.before(values) if callable(field.before) else field.before
    except LookupError:  # what it follows from is not recorded either
        return None


def _names(node: str, name: str) -> Iterator[tuple[str, str]]:
    """Node and name of a parameter: the present ones, then the former ones."""
    last = "", ""
    while name and (node, name) != last:
        last = node, name
        yield last
        group = next((group for group in FORMER_NAMES if group.endswith(".") and name.startswith(group)), "")
        former = FORMER_NAMES[group] + name.removeprefix(group) if group else FORMER_NAMES.get(name, "")
        owner, _, name = former.rpartition(":")
        node = owner or node


def present_name(node: str, name: str) -> str:
    """The present name of a recorded parameter of a node; of an unknown one the same."""
    for now, former in FORMER_NAMES.items():
        owner, _, former_name = former.rpartition(":")
        if owner in ("", node) and name == former_name:
            return now
        if former.endswith(".") and name.startswith(former):
            return now + name.removeprefix(former)
    return name
