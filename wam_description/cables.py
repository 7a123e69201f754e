"""Parameters of the cable circuits, stage by stage, and the properties of each circuit at its motor."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wam_description.parameters import lengths, parameter, require
from wam_description.small_matrices import Array
from wam_theory.cable import slack_stretch, stage_compliance, stage_loss


@dataclass(frozen=True)
class Cables:
    """The cable circuit of each motor: pretension and limits per motor, then its stages one by one.

    The first stage of a circuit spans the distance from the motor.  It runs fast if the reducer is at the joint.  It
    runs slowly if the reducer is at the motor, with N such cables in parallel for the same stress.  Pretension
    and breaking strength are those of one cable.
    """

    pretension: tuple[float, ...] = parameter("pretension T_0 of the first stage", "N", high=1e5)
    breaking_strength: tuple[float, ...] = parameter(
        "tension at which a first-stage cable breaks", "N", low=1.0, high=1e6
    )
    damping: tuple[float, ...] = parameter("material damping of the circuit, motor side", "N m s/rad", high=100.0)
    reducer: tuple[str, ...] = parameter("location of the speed reducer", choices=("joint", "motor"))
    stage_motors: tuple[str, ...] = parameter(
        "motor to which each stage belongs; the stages of a motor in order, from the motor to the joint"
    )
    stage_ea: tuple[float, ...] = parameter("elastic modulus times area, E A, of one cable of the stage", "N", low=1.0)
    stage_length: tuple[float, ...] = parameter("free length of a strand", "m", high=10.0)
    stage_radius: tuple[float, ...] = parameter("radius of the stage's driving pulley", "m", low=1e-4, high=1.0)
    stage_circuits: tuple[float, ...] = parameter("parallel circuits of the stage", low=1.0, high=100.0)
    stage_ratio: tuple[float, ...] = parameter("motor turns per turn of the driving pulley", low=1e-3, high=1e3)

    def __post_init__(self) -> None:
        stages = ("stage_ea", "stage_length", "stage_radius", "stage_circuits", "stage_ratio")
        lengths("arm.cables", self.stage_motors, {key: getattr(self, key) for key in stages})


class Circuit(NamedTuple):
    """Properties of one motor's circuit, seen at the motor."""

    stiffness: float  # k_tr, N m/rad
    radius: float  # torque at the motor per tension difference of a first-stage cable, m: its pinion's radius
    loss_per_torque: float  # fraction of the speed lost per torque at the motor, 1/(N m), (6.4) over all stages
    pretension: float  # N
    damping: float  # N m s/rad

    @property
    def slack_stretch(self) -> float:
        """Stretch at which the loose strand goes slack, rad."""
        return float(slack_stretch(self.stiffness, self.pretension, self.radius))


def circuits(motors: Sequence[str], motor_from_joint: Array, cables: Cables) -> tuple[Circuit, ...]:
    """The circuit of each motor.

    Parameters
    ----------
    motors : names of the motors.
    motor_from_joint : the inverse of the matrix of (A.5).
    cables : the stages of all circuits.

    Raises
    ------
    ParameterError
        if a stage belongs to no motor, a motor has no stage, or a circuit has zero compliance.
    """
    for name in cables.stage_motors:
        require(name in motors, f"arm.cables.stage_motors names '{name}'; motors: {', '.join(motors)}")
    return tuple(_circuit(cables, i, name, float(np.abs(motor_from_joint[i]).max())) for i, name in enumerate(motors))


def _circuit(cables: Cables, i: int, motor: str, reduction: float) -> Circuit:
    stages = [k for k, name in enumerate(cables.stage_motors) if name == motor]
    require(len(stages) > 0, f"{motor} has no cable stage; name it in arm.cables.stage_motors")
    first = stages[0]
    compliance = loss = 0.0
    for k in stages:
        ea, ratio = cables.stage_ea[k], cables.stage_ratio[k]
        if k == first and cables.reducer[i] == "motor":
            ea, ratio = ea * reduction, ratio * reduction
        radius, parallel = cables.stage_radius[k], cables.stage_circuits[k]
        compliance += float(stage_compliance(ea, cables.stage_length[k], radius, parallel, ratio))
        loss += float(stage_loss(1.0, radius, ea, parallel, ratio))
    require(compliance > 0.0, f"{motor}: its cable stages have zero compliance; give one a stage_length above zero")
    return Circuit(
        stiffness=1.0 / compliance,
        radius=cables.stage_radius[first] * cables.stage_circuits[first] / cables.stage_ratio[first],
        loss_per_torque=loss,
        pretension=cables.pretension[i],
        damping=cables.damping[i],
    )
