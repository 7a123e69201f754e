"""What is estimated: the parameters of the controllers' model by name, their present values, how far they may be off.

Friction of a joint with a motor of its own cannot be separated from that of the motor and is counted there.  Friction
of the other joints is alike in both directions: a constant torque looks the same from the motor and from the joint.
So does a torque offset, which is counted as a difference between the directions of the motor.  A torque constant that
is off cannot be separated from friction and masses, which are all those of the reported torques; only what it differs
by between motors that move the same joints, as no masses do.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wam_analysis.thresholds import IDENTIFY
from wam_bag.arrays import Numbers
from wam_description.arm import Shared
from wam_description.rigid_body import RigidBody

DIRECTIONS = ("positive", "negative")
AXES = ("x", "y", "z")
OF_LINK = ("mass", *(f"{what}_{axis}" for what in ("moment", "inertia") for axis in AXES))
# standard deviations of the prior, which decides only what the motion does not show


class Unknowns(NamedTuple):
    """The estimated parameters.

    Attributes
    ----------
    names : p, as in `model.covariance.parameters`.
    present : (p,), values before the identification.
    prior_sd : (p,).
    joints : indices of the joints whose friction is estimated.
    sharing : indices of the motors that move these joints together.
    kept : (p, p), information that keeps the weight at joints that the motion does not show.
    """

    names: tuple[str, ...]
    present: Numbers
    prior_sd: Numbers
    joints: tuple[int, ...]
    sharing: tuple[int, ...]
    kept: Numbers

    @property
    def prior(self) -> Numbers:
        """(p, p), information before the motion."""
        return np.diag(self.prior_sd**-2) + self.kept

    def places(self, group: str) -> list[int]:
        """Where the parameters of a group are, as 'motors.viscous'."""
        return [i for i, name in enumerate(self.names) if name.rpartition(".")[0] == group]


def shared_joints(matrix: Numbers) -> tuple[int, ...]:
    """Indices of the joints that several motors move together."""
    return tuple(int(j) for j in np.flatnonzero(np.count_nonzero(matrix, axis=1) > 1))


def unknowns(shared: Shared) -> Unknowns:
    """The estimated parameters of an arm, with the values of its present model.

    'static' is F_s - F_c here, which the torque is linear in, until `static_friction` adds F_c.
    """
    arm, model = shared.arm, shared.model
    matrix = arm.transmission.joint_from_motor
    joints = shared_joints(matrix)
    lumped = np.abs(matrix) * [[j not in joints] for j in range(len(matrix))]
    motors, at_joints, links = model.motors, model.joints, model.links
    names: list[str] = []
    present: list[float] = []
    sd: list[float] = []

    def add(group: str, of: list[str], values: Numbers | float, sds: Numbers | float) -> None:
        names.extend(f"{group}.{name}" for name in of)
        present.extend(np.broadcast_to(values, len(of)))
        sd.extend(np.broadcast_to(np.maximum(sds, IDENTIFY.least_sd), len(of)))

    every = list(arm.motors.names)
    through = lumped.T @ at_joints.coulomb
    level = (np.array(motors.coulomb_positive) + motors.coulomb_negative) / 2.0 + through
    drop_at_joints = np.subtract(at_joints.static, at_joints.coulomb)
    for way in DIRECTIONS:
        coulomb = np.array(getattr(motors, f"coulomb_{way}"))
        add(f"motors.coulomb_{way}", every, coulomb + through, IDENTIFY.friction * level)
    for way in DIRECTIONS:
        drop = np.subtract(getattr(motors, f"static_{way}"), getattr(motors, f"coulomb_{way}"))
        add(f"motors.static_{way}", every, drop + lumped.T @ drop_at_joints, IDENTIFY.friction * level)
    for way in DIRECTIONS:
        load = np.array(getattr(motors, f"load_{way}"))
        add(f"motors.load_{way}", every, load + (lumped.T > 0.0) @ at_joints.load, IDENTIFY.load)
    add("motors.stribeck_velocity", every, np.array(motors.stribeck_velocity), IDENTIFY.stribeck)
    viscous = np.array(motors.viscous) + (lumped**2).T @ at_joints.viscous
    add("motors.viscous", every, viscous, IDENTIFY.viscous * viscous)
    add("motors.inertia", every, np.array(motors.inertia), IDENTIFY.rotor * np.array(motors.inertia))
    sharing = [int(m) for m in np.flatnonzero(matrix[list(joints)].any(axis=0))]
    add("motors.torque_difference", [every[m] for m in sharing[1:]], 0.0, IDENTIFY.constants_difference)
    chosen = [arm.joints.names[j] for j in joints]
    coulomb, load, viscous = np.array([at_joints.coulomb, at_joints.load, at_joints.viscous])[:, list(joints)]
    add("joints.coulomb", chosen, coulomb, IDENTIFY.friction * coulomb)
    add("joints.load", chosen, load, IDENTIFY.load)
    add("joints.viscous", chosen, viscous, IDENTIFY.viscous * viscous)
    mass = np.array(links.mass)
    centres, inertias = (np.reshape(each, (len(mass), 3)).T for each in (links.centre, links.inertia))
    sds = [IDENTIFY.mass * mass, *[IDENTIFY.centre * mass] * 3, *(IDENTIFY.inertia * inertias)]
    for name, each, deviation in zip(OF_LINK, [mass, *(mass * centres), *inertias], sds, strict=True):
        add(f"links.{name}", list(arm.links.names), each, deviation)
    kept = np.zeros((len(names), len(names)))
    return Unknowns(tuple(names), np.array(present), np.array(sd), joints, tuple(sharing), kept)


def with_kept_weight(sought: Unknowns, shared: Shared, still: Sequence[int]) -> Unknowns:
    """The same where the weight of the links at some joints stays as configured: the motion does not show it."""
    arm, rest = shared.arm, np.zeros(shared.arm.n)
    random = np.random.Generator(np.random.PCG64(IDENTIFY.seed))
    poses = random.uniform(arm.joints.lower, arm.joints.upper, (IDENTIFY.poses, len(rest)))
    body = RigidBody(arm)
    rows = np.zeros((len(poses) * len(still), len(sought.names)))
    torques = np.concatenate([body.inverse_dynamics_regressor(q, rest, rest)[list(still)] for q in poses])
    for i, name in enumerate(OF_LINK[:4]):  # that have weight
        rows[:, sought.places(f"links.{name}")] = torques[:, i::10]
    return sought._replace(kept=rows.T @ rows / IDENTIFY.kept_weight**2)
