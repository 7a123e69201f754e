"""The parameters in a bag, read with care."""

import hashlib
from collections import defaultdict
from collections.abc import Mapping
from typing import Any, Final, NamedTuple, TypeVar

import yaml

from wam_bag import safe_yaml
from wam_bag.bag import Bag, BagError
from wam_bag.losses import PARAMETERS as ATTACHMENT
from wam_description.arm import Shared
from wam_description.configuration import PARAMETERS, shaped_like
from wam_description.interface import declared
from wam_description.nodes import NODES
from wam_description.parameters import ParameterError, build_part, dotted, fields, meant, require

T = TypeVar("T")
Values = Mapping[str, Any]

LARGEST: Final = 2**20  # bytes; those of the whole stack are about 30 kB
OF_ROS: Final = ("use_sim_time", "start_type_description_service", "qos_overrides.")  # every node has these


class RecordedParameters(NamedTuple):
    """The parameters of an arm's nodes at the start of a recording.

    Attributes
    ----------
    source : the bag, for messages.
    nodes : flat values by node, without those that every ROS node has.
    sha256 : of the attachment, hexadecimal, '' if there is none.
    problem : why there are no parameters, '' if there are some.
    notes : which ones are missing or unknown; a part with one of these is refused.
    """

    source: str
    nodes: Mapping[str, Values]
    sha256: str
    problem: str
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        return f"RecordedParameters({self.source!r}, nodes {', '.join(self.nodes) or 'none'})"

    def node(self, name: str) -> Values:
        """The flat values of a node.

        Raises
        ------
        BagError
            if the bag does not have them.
        """
        if self.problem:
            raise BagError(f"{self.source}: {self.problem}")
        if name not in self.nodes:
            raise BagError(
                f"{self.source}: {ATTACHMENT} in the bag has no parameters of node '{name}'; "
                f"it has those of {', '.join(self.nodes) or 'no node'}"
            )
        return self.nodes[name]

    def part(self, node: str, cls: type[T], prefix: str = "") -> T:
        """A parameter object from the values of a node, as ``part("driver", Springs, "world.springs.")``.

        Raises
        ------
        BagError
            if the bag does not have them, or they are not allowed in this version.
        """
        values = self.node(node)
        try:
            return build_part(cls, values, prefix)
        except ParameterError as error:
            raise BagError(
                f"{self.source}: the recorded parameters of node '{node}' do not fit this version: {error}"
            ) from None

    def with_values(self, settings: Mapping[str, Any]) -> "RecordedParameters":
        """The same with some values replaced, by 'node:parameter', such as the live ones that a step set."""
        nodes = {
            node: {**values, **{key.partition(":")[2]: v for key, v in settings.items() if key.startswith(f"{node}:")}}
            for node, values in self.nodes.items()
        }
        return self._replace(nodes=nodes)

    def with_options(self, values: Mapping[str, Any]) -> "RecordedParameters":
        """The same with some values replaced as an option gives them: 'node:parameter', or one that nodes share.

        Raises
        ------
        ParameterError
            if no node in the bag has such a parameter, or a value is not allowed.
        """
        nodes = {node: dict(flat) for node, flat in self.nodes.items()}
        for key, value in values.items():
            node, colon, name = key.rpartition(":")
            owners = [own for own, flat in self.nodes.items() if name in flat and (own == node or not colon)]
            who = f"node '{node}' has no" if colon else "no node has"
            known = [f"{own}{colon}{one}" if colon else one for own, flat in self.nodes.items() for one in flat]
            reason = f"{who} parameter '{name}' in {self.source}; {meant(key, known)}write [node:]parameter=value"
            require(bool(owners), f"--set {key}: {reason}")
            for own in owners:
                nodes[own][name] = shaped_like(nodes[own][name], value)
        for node in nodes.keys() & NODES.keys():
            for cls in (Shared, declared(node).parameter_class):
                why = _refusal(cls, nodes[node])  # values of another version are refused where they are used
                require(not why or bool(_refusal(cls, self.nodes[node])), f"--set: {why}")
        return self._replace(nodes=nodes)

    @property
    def shared(self) -> Shared:
        """What every node reads."""
        return self.part(next((node for node in NODES if node in self.nodes), "driver"), Shared)


def recorded_parameters(bag: Bag, namespace: str) -> RecordedParameters:
    """The parameters of an arm in a bag.

    Parameters
    ----------
    bag : with the attachment ``parameters.yaml`` as the recorder writes it, or without.
    namespace : of the arm.
    """
    attached, problem, recorded = bag.attachments.get(ATTACHMENT), "", dict[str, Values]()
    if attached is None:
        return RecordedParameters(str(bag.path), {}, "", f"no {ATTACHMENT} in the bag", ())
    try:
        tree = safe_yaml.load(attached, LARGEST)
        if not isinstance(tree, dict):
            raise ValueError("it has no sections")
        recorded = {
            str(name).removeprefix(f"{namespace}/"): {
                key: value for key, value in dotted(body[PARAMETERS]) if not key.startswith(OF_ROS)
            }
            for name, body in tree.items()
            if str(name).rpartition("/")[0] == namespace
        }
        if tree and not recorded:
            there = ", ".join(sorted({str(name).rpartition("/")[0] for name in tree}))
            problem = f"{ATTACHMENT} in the bag has no parameters of the arm {namespace}; it has those of {there}"
    except (yaml.YAMLError, ValueError, TypeError, LookupError, AttributeError) as error:
        problem = f"{ATTACHMENT} in the bag cannot be read: {' '.join(str(error).split())}"
    return RecordedParameters(str(bag.path), recorded, hashlib.sha256(attached).hexdigest(), problem, _notes(recorded))


def _refusal(cls: type, values: Values) -> str:
    """Why a parameter object cannot have these values, '' if it can."""
    try:
        build_part(cls, values)
    except ParameterError as error:
        return str(error)
    return ""


def _notes(recorded: Mapping[str, Values]) -> tuple[str, ...]:
    """Which parameters are missing, and which are unknown; one of several nodes is named once, without a node.

    Not looked at is a foreign node, or one that `nodes` does not list: it has its own class, as the driver of a real
    arm.
    """
    missing, unknown = defaultdict[str, list[str]](list), defaultdict[str, list[str]](list)
    for node, values in recorded.items():
        listed = values.get("nodes")
        if node not in NODES or node == "recorder" or (isinstance(listed, list) and node not in listed):
            continue
        known = {field.name: field for cls in (Shared, declared(node).parameter_class) for field in fields(cls)}
        for name in [name for name, field in known.items() if field.is_required and name not in values]:
            missing[name].append(node)
        for name in [name for name in values if name not in known]:
            unknown[name].append(node)
    both = {"misses the parameters": missing, "has the unknown parameters": unknown}
    texts = [
        f"{what} {', '.join(name if nodes[1:] else f'{nodes[0]}:{name}' for name, nodes in of.items())}"
        for what, of in both.items()
        if of
    ]
    return (f"the recording {' and '.join(texts)}: it is of another version, record it again",) * bool(texts)
