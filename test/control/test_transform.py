"""The transform as the joint side uses it: power is neither made nor lost, nothing is invented."""

import numpy as np
import pytest

from wam_control.velocity.transform import Transform, TransformParameters
from wam_control.velocity.transform_node import HELD, TransformNode
from wam_description.configuration import Configuration, packaged
from wam_description.signals import State
from wam_description.wiring import Inputs

SHARED = Configuration.load(packaged("wam")).shared
ARM = SHARED.arm
MATRIX = np.reshape(ARM.joint_from_motor, (4, 4))
RANDOM = np.random.default_rng(4)


def numbers() -> list[float]:
    return RANDOM.uniform(-10.0, 10.0, 4).tolist()


def test_commands_come_back_as_states() -> None:
    transform = Transform(ARM)
    velocity, torque = numbers(), numbers()
    motors = State(numbers(), transform.motor_velocity(velocity), transform.motor_effort(torque, [0.0] * 4))
    joints = transform.joint_state(motors)
    assert joints.position == pytest.approx(MATRIX @ motors.position, rel=1e-13)
    assert joints.velocity == pytest.approx(velocity, rel=1e-12)
    assert joints.effort == pytest.approx(torque, rel=1e-12)


def test_gravity_and_effort_add_up() -> None:
    transform = Transform(ARM)
    gravity, effort = numbers(), numbers()
    expected = MATRIX.T @ np.add(gravity, effort)
    assert transform.motor_effort(gravity, effort) == pytest.approx(expected, rel=1e-12)


def test_an_empty_velocity_stays_empty_and_zero_stays_zero() -> None:
    transform = Transform(ARM)
    assert transform.motor_velocity([]) == []
    assert transform.motor_velocity([0.0] * 4) == [0.0] * 4


@pytest.mark.parametrize("wrong", [[1.0], [1.0] * 5])
def test_a_wrong_number_of_values_is_refused(wrong: list[float]) -> None:
    transform = Transform(ARM)
    with pytest.raises(ValueError, match="values for 4 motors and joints"):
        transform.motor_velocity(wrong)
    with pytest.raises(ValueError):  # noqa: PT011
        transform.motor_effort([0.0] * 4, wrong)


@pytest.mark.parametrize("begin", [0, 10**18])
def test_torque_without_velocity_is_warned_of_after_a_while(begin: int) -> None:
    node, effort, found = TransformNode(SHARED, TransformParameters(False)), State([], [], [1.0] * 4), []
    for stamp in range(begin, begin + 120_000_000, 5_000_000):
        given = {"gravity_effort": (stamp, effort), "joint_effort_command": (stamp, effort)}
        found.append(node.effort(Inputs.of(stamp, 0.005, given)).get("status"))
    assert found.index(HELD) > 6
