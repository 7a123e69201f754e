"""The identified model as a configuration: what differs from the present one, with the covariance."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from wam_analysis.identification.fit import Identification
from wam_analysis.identification.unknowns import DIRECTIONS, OF_LINK, Unknowns
from wam_analysis.thresholds import IDENTIFY, LAYOUT
from wam_bag.arrays import Numbers
from wam_description.arm import Shared
from wam_description.configuration import BASE, GIVEN, PARAMETERS, SHARED, Configuration, shaped_like
from wam_description.parameters import ParameterError, nested

HEADING = "# The controllers' model as identified"  # of the file
DEVIATIONS = ("observer.mass_scale", "observer.friction_scale")


class Identified(NamedTuple):
    """Parameters as the model has them: of friction towards zero speed F_s instead of F_s - F_c; (p,) each."""

    values: Numbers
    sd: Numbers
    present: Numbers


def identified(found: Identification) -> Identified:
    """The result in the parameters of the model."""
    mixing = np.eye(len(found.values))
    for way in DIRECTIONS:
        rows, columns = (found.unknowns.places(f"motors.{what}_{way}") for what in ("static", "coulomb"))
        mixing[rows, columns] = 1.0
    sd = np.sqrt((mixing @ found.covariance @ mixing.T).diagonal())
    return Identified(mixing @ found.values, sd, mixing @ found.unknowns.present)


def model_values(shared: Shared, found: Identification, source: str) -> dict[str, Any]:
    """Values of the shared parameters `model.*`, by name.

    Parameters
    ----------
    source : the recording.
    """
    result, unknowns = identified(found).values, found.unknowns
    groups = (name.rpartition(".")[0] for name in unknowns.names if name.startswith("motors."))
    model = {group: result[unknowns.places(group)] for group in dict.fromkeys(groups)}
    model.pop("motors.torque_difference", None)  # the controllers' model has none
    model |= _joint_friction(shared, unknowns, result)
    values = {f"model.{name}": _numbers(each) for name, each in model.items()}
    values |= {f"model.links.{name}": _numbers(each, 9) for name, each in _links(unknowns, result).items()}
    return {
        "model.source": source,
        **values,
        "model.covariance.parameters": list(found.tracked.names),
        "model.covariance.values": _numbers(found.tracked.covariance.ravel()),
    }


def estimator_values(configuration: Configuration) -> dict[str, Any]:
    """Values of the contact estimator, by 'node:name', that switch off its own deviations from the model."""
    own = configuration.sections.get("contact_estimator", {})
    return {f"contact_estimator:{name}": shaped_like(own[name], 1.0) for name in DEVIATIONS if name in own}


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
        where = f", section '{SHARED}': "  # left out: nobody has set these values
        reason = str(error).removeprefix(GIVEN + where).removeprefix(f"{configuration.path}{where}")
        return (
            f"the model identified from {source} is not possible, so it is not written: {reason}. Either something "
            "touched the arm, or it moved too little: identify from a recording without contact, such as "
            "that of wam identify --excite"
        )
    return ""


def _joint_friction(shared: Shared, unknowns: Unknowns, result: Numbers) -> dict[str, Numbers]:
    """Friction of the joints: none at joints whose motor has it."""
    model, chosen = shared.model.joints, list(unknowns.joints)
    friction = {name: result[unknowns.places(f"joints.{name}")] for name in ("coulomb", "load", "viscous")}
    friction["static"] = friction["coulomb"] + np.subtract(model.static, model.coulomb)[chosen]
    every = np.zeros((len(friction), len(model.coulomb)))
    every[:, chosen] = list(friction.values())
    return {f"joints.{name}": each for name, each in zip(friction, every, strict=True)}


def _links(unknowns: Unknowns, result: Numbers) -> dict[str, Numbers]:
    mass, *others = (result[unknowns.places(f"links.{name}")] for name in OF_LINK)
    centre, inertia = np.array(others[:3]) / mass, np.maximum(others[3:], IDENTIFY.least_inertia)
    return {"mass": mass, "centre": centre.T.ravel(), "inertia": inertia.T.ravel()}


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
    flat: dict[str, Any] = {BASE: base}
    for key, value in values.items():
        node, _, name = key.rpartition(":")
        section = f"{SHARED}/{node}" if node else SHARED
        flat[f"{section}.{PARAMETERS}.{name}"] = value
    body = yaml.safe_dump(nested(flat), sort_keys=False, default_flow_style=None, width=120)
    file.write_text(f"{HEADING}: {command}\n{body}", encoding="utf-8")
