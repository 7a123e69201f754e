"""Backdriven inertia over the workspace: against the kinetic energy of a carried mass and pushes one by one."""

import math

import numpy as np
import pytest

from wam_description.arm import Arm
from wam_description.configuration import Configuration, packaged
from wam_description.rigid_body import RigidBody
from wam_studies.figures.backdrivability import Backdriving, backdrivability

POSE = (0.3, -0.9, 0.4, 0.6)


@pytest.fixture(scope="module")
def arm() -> Arm:
    return Configuration.load(packaged("wam")).shared.arm


def test_payload_is_a_mass_that_the_joints_carry(arm: Arm) -> None:
    """2 kg in the mass matrix, with the rotors by their motors' kinetic energy, as accelerations of the tip."""
    body = RigidBody(arm)
    jacobian = body.tool_jacobian(POSE)
    motors = np.linalg.inv(np.reshape(arm.joint_from_motor, (4, 4)))
    inertia = body.mass_matrix(POSE) + np.diag(arm.joints.armature) + 2.0 * jacobian.T @ jacobian
    for motor, of_rotor in zip(motors, arm.motors.inertia, strict=True):
        inertia += of_rotor * np.outer(motor, motor)
    accelerations = jacobian @ np.linalg.solve(inertia, jacobian.T @ np.eye(3))
    assert Backdriving(arm).mobility(POSE, 2.0) == pytest.approx(accelerations, rel=1e-9, abs=1e-12)


def test_two_kilograms_add_themselves_to_every_effective_mass(arm: Arm) -> None:
    tip, directions = Backdriving(arm), np.linalg.eigh(Backdriving(arm).mobility(POSE, 0.0)).eigenvectors.T
    free, loaded = (tip.masses(POSE, directions, payload) for payload in (0.0, 2.0))
    assert loaded - free == pytest.approx(2.0, rel=1e-6)


def test_stretched_arm_has_a_direction_that_no_push_moves(arm: Arm) -> None:
    assert Backdriving(arm).at((0.0, -math.pi / 2.0, 0.0, math.pi / 2.0), 2.0).isotropy < 1e-6


@pytest.mark.slow
def test_with_two_kilograms_the_rotors_share_is_small_over_most_of_the_workspace_and_the_arm_is_not_isotropic() -> None:
    """7.2.2."""
    isotropy, rotors, _ = backdrivability()
    assert np.quantile(rotors.line("payload 2 kg").x, 0.9) < 0.15 < np.median(rotors.line("payload none").x)
    assert np.median(isotropy.line("payload none").x) < 0.1
    assert np.quantile(isotropy.line("payload 2 kg").x, 0.9) < 0.6


def test_half_of_the_directions_move_under_the_stated_push(arm: Arm) -> None:
    push, body = Backdriving(arm).at(POSE, 0.0).friction, RigidBody(arm)
    held = np.array(arm.joints.static_friction)
    motors = np.linalg.inv(np.reshape(arm.joint_from_motor, (4, 4)))
    for motor, of_rotor in zip(motors, arm.motors.static_friction, strict=True):
        held += of_rotor * np.abs(motor)
    directions = np.random.default_rng(1).normal(size=(20_000, 3))
    torques = push * directions / np.linalg.norm(directions, axis=1, keepdims=True) @ body.tool_jacobian(POSE)
    assert np.mean(np.any(np.abs(torques) > held, axis=1)) == pytest.approx(0.5, abs=0.1)
