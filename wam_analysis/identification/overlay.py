"""The identified model as a configuration: what differs from the present one, with the covariance."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from wam_analysis.identification.fit import Identification
from wam_analysis.identification.unknowns import AXES, DIRECTIONS, Unknowns
from wam_analysis.thresholds import IDENTIFY, LAYOUT
from wam_bag.arrays import Numbers
from wam_description.arm import Shared
from wam_description.configuration import GIVEN, PARAMETERS, SHARED, Configuration
from wam_description.parameters import ParameterError

HEADING = "# The controllers' model as identified"  # of the file
DEVIATIONS = ("observer.mass_scale", "observer.friction_scale")


class Identified(NamedTuple):
    """Parameters as the model has them: of friction towards zero speed F_s instead of F_s - F_c.

    Attributes
    ----------
    names : p.
    present, values, sd : (p,).
    """

    names: tuple[str, ...]
    present: Numbers
    values: Numbers
    sd: Numbers


def identified(found: Identification) -> Identified:
    """The result in the parameters of the model."""
    names = found.unknowns.names
    mixing = np.eye(len(names))
    for way in DIRECTIONS:
        rows, columns = (found.unknowns.places(f"motors.{what}_{way}") for what in ("static", "coulomb"))
        mixing[rows, columns] = 1.0
    sd = np.sqrt((mixing @ found.covariance @ mixing.T).diagonal())
    return Identified(names, mixing @ found.unknowns.present, mixing @ found.values, sd)


def model_values(shared: Shared, found: Identification, source: str) -> dict[str, Any]:
    """Values of the shared parameters `model.*`, by name.

    Parameters
    ----------
    source : the recording.
    """
    result = identified(found)
    every = dict.fromkeys(name.rpartition(".")[0] for name in result.names)
    groups = {group: result.values[found.unknowns.places(group)] for group in every}
    values: dict[str, Any] = {"model.source": source}
    for group, each in groups.items():
        if group.startswith("motors.") and group != "motors.torque_difference":
            values[f"model.{group}"] = _numbers(each)
    values |= _joint_values(shared, found.unknowns, groups)
    values |= _link_values(groups)
    values["model.covariance.parameters"] = list(found.tracked.names)
    values["model.covariance.values"] = _numbers(found.tracked.covariance.ravel())
    return values


def estimator_values(configuration: Configuration) -> dict[str, Any]:
    """Values of the contact estimator, by 'node:name', that switch off its own deviations from the model."""
    own = configuration.sections.get("contact_estimator", {})
    neutral = {name: own[name] for name in DEVIATIONS if name in own}
    return {
        f"contact_estimator:{name}": [1.0] * len(value) if isinstance(value, list) else 1.0
        for name, value in neutral.items()
    }


def impossibility(configuration: Configuration, values: Mapping[str, Any], source: str) -> str:
    """Why no configuration could have an identified model, with the value and what is allowed; '' where one could.

    Parameters
    ----------
    values : by dotted name, as of `model_values`.
    source : the recording.
    """
    try:
        _ = configuration.with_values(values).shared.model_arm
    except ParameterError as error:
        where = f", section '{SHARED}': "
        reason = str(error).removeprefix(GIVEN + where).removeprefix(f"{configuration.path}{where}")
        return (
            f"the model identified from {source} is not possible, so it is not written: {reason}. Either something "
            "touched the arm, or it moved too little: identify from a recording without contact, such as "
            "that of wam identify --excite"
        )
    return ""


def _joint_values(shared: Shared, unknowns: Unknowns, groups: Mapping[str, Numbers]) -> dict[str, Any]:
    """Friction of the joints: none at joints whose motor has it."""
    model = shared.model.joints
    found: dict[str, Numbers] = {}
    for name in ("coulomb", "load", "viscous"):
        found[name] = np.zeros(len(model.coulomb))
        found[name][list(unknowns.joints)] = groups.get(f"joints.{name}", np.zeros(0))
    drop = np.subtract(model.static, model.coulomb)
    found["static"] = found["coulomb"] + np.where(np.isin(np.arange(len(drop)), unknowns.joints), drop, 0.0)
    return {f"model.joints.{name}": _numbers(each) for name, each in found.items()}


def _link_values(groups: Mapping[str, Numbers]) -> dict[str, Any]:
    mass = groups["links.mass"]
    centre = np.column_stack([groups[f"links.moment_{axis}"] / mass for axis in AXES])
    inertia = np.maximum(np.column_stack([groups[f"links.inertia_{axis}"] for axis in AXES]), IDENTIFY.least_inertia)
    named = {"mass": mass, "centre": centre.ravel(), "inertia": inertia.ravel()}
    return {f"model.links.{name}": _numbers(each, 9) for name, each in named.items()}


def _numbers(values: Numbers, digits: int = LAYOUT.digits) -> list[float]:
    return [float(f"{value:.{digits}g}") for value in values.tolist()]


def write_overlay(file: Path, base: str, values: Mapping[str, Any], command: str) -> None:
    """Write a configuration that changes these values of another one.

    Parameters
    ----------
    base : the other one, by name or path.
    values : by dotted name of a shared parameter, or 'node:name'.
    command : that made them.
    """
    tree: dict[str, Any] = {"base": base}
    for key, value in values.items():
        node, _, name = key.rpartition(":")
        *path, leaf = name.split(".")
        branch = tree
        for part in (f"{SHARED}/{node}" if node else SHARED, PARAMETERS, *path):
            branch = branch.setdefault(part, {})
        branch[leaf] = value
    body = yaml.safe_dump(tree, sort_keys=False, default_flow_style=None, width=120)
    file.write_text(f"{HEADING}: {command}\n{body}", encoding="utf-8")
