"""The parameters with which a bag was recorded, taken from the bag itself."""

import hashlib
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeVar

import yaml

from wam_analysis.bag import Bag
from wam_analysis.bag_file import LOADER
from wam_control.force_loop import ForceLoopParameters
from wam_control.velocity_loop import VelocityLoopParameters
from wam_description.arm import Arm, Timing
from wam_description.configuration import Configuration, packaged
from wam_description.effects import Effects
from wam_description.parameters import ParameterError, build_part, flatten
from wam_description.world import NO_SPRINGS, Obstacles, Springs
from wam_ros.bag_losses import PARAMETERS

T = TypeVar("T")


class RecordedArm(NamedTuple):
    """The arm and its surroundings as they were when the bag was recorded, and what has to be said about them."""

    arm: Arm
    obstacles: Obstacles
    note: str


class RecordedParameters(NamedTuple):
    """What the bag says of the arm and of its loops; None where it does not say it.

    Attributes
    ----------
    arm : the arm.
    obstacles : what it can touch.
    springs : under its joints.
    timing : the clockwork.
    effects : of the simulated transmission.
    force_loop, velocity_loop : gains and limits.
    hash : SHA-256 of the parameters in the bag, hexadecimal, '' where it has none.
    note : what has to be said about them, '' where nothing.
    """

    arm: Arm | None
    obstacles: Obstacles | None
    springs: Springs
    timing: Timing | None
    effects: Effects | None
    force_loop: ForceLoopParameters | None
    velocity_loop: VelocityLoopParameters | None
    hash: str
    note: str


def recorded_parameters(bag: Bag, namespace: str) -> RecordedParameters:
    """All that predictions need; a part that is missing or does not fit is None.

    Parameters
    ----------
    bag : with the attachment ``parameters.yaml`` as the recorder writes it.
    namespace : of the arm.
    """
    attached = bag.attachments.get(PARAMETERS)
    digest = hashlib.sha256(attached).hexdigest() if attached is not None else ""
    notes: list[str] = []
    nodes = _nodes(bag)
    driver, loop, speed = (
        _section(nodes, namespace, node, notes) for node in ("driver", "force_loop", "velocity_loop")
    )
    return RecordedParameters(
        arm=_part(Arm, driver, "arm.", notes),
        obstacles=_part(Obstacles, driver, "world.obstacles.", notes),
        springs=_part(Springs, driver, "world.springs.", notes) or NO_SPRINGS,
        timing=_part(Timing, driver, "timing.", notes),
        effects=_part(Effects, driver, "effects.", notes),
        force_loop=_part(ForceLoopParameters, loop, "", notes),
        velocity_loop=_part(VelocityLoopParameters, speed, "", notes),
        hash=digest,
        note="; ".join(dict.fromkeys(notes)),
    )


def recorded_arm(bag: Bag, namespace: str) -> RecordedArm:
    """Take the arm from the parameters in the bag, or from the configuration of the package.

    Parameters
    ----------
    bag : with the attachment ``parameters.yaml`` as the recorder writes it.
    namespace : of the arm.
    """
    try:
        flat = node_parameters(bag, namespace, "driver")
        return RecordedArm(build_part(Arm, flat, "arm."), build_part(Obstacles, flat, "world.obstacles."), "")
    except ParameterError as error:
        reason = str(error).partition("\n")[0]
    configuration = Configuration.load(packaged("wam"))
    obstacles = build_part(Obstacles, configuration.sections["driver"], "world.obstacles.")
    note = f"the arm is drawn from configuration 'wam' of the package, not from the bag: {reason}"
    return RecordedArm(configuration.shared.arm, obstacles, note)


def node_parameters(bag: Bag, namespace: str, node: str) -> Mapping[str, Any]:
    """Parameters of one node, flat, ``{dotted name: value}``.

    Raises
    ------
    ParameterError
        where the bag does not have them.
    """
    notes: list[str] = []
    found = _section(_nodes(bag), namespace, node, notes)
    if notes:
        raise ParameterError(notes[0])
    return found


def _nodes(bag: Bag) -> Mapping[str, Any] | ParameterError:
    """The sections of the attachment, or why there are none."""
    attached = bag.attachments.get(PARAMETERS)
    if attached is None:
        return ParameterError("it has no attachment parameters.yaml")
    try:
        tree = yaml.load(attached.decode(), LOADER)
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        return ParameterError(f"its parameters.yaml cannot be read: {error}")
    return tree if isinstance(tree, dict) else {}


def _section(
    nodes: Mapping[str, Any] | ParameterError, namespace: str, node: str, notes: list[str]
) -> Mapping[str, Any]:
    if isinstance(nodes, ParameterError):
        notes.append(str(nodes).partition("\n")[0])
        return {}
    section = nodes.get(f"{namespace}/{node}")
    if not isinstance(section, dict) or not isinstance(section.get("ros__parameters"), dict):
        notes.append(f"its parameters.yaml has no parameters of {namespace}/{node}")
        return {}
    return flatten(section["ros__parameters"])


def _part(cls: type[T], flat: Mapping[str, Any], prefix: str, notes: list[str]) -> T | None:
    if not flat:
        return None
    try:
        return build_part(cls, flat, prefix)
    except ParameterError as error:
        notes.append(str(error).partition("\n")[0])
        return None
