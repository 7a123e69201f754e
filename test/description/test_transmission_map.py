"""The motor-joint map (A.5)."""

import numpy as np
import pytest

from wam_description.configuration import Configuration, packaged
from wam_description.parameters import ParameterError
from wam_description.transmission_map import TransmissionMap

N1, N2, N4 = 29.97, 30.40, 19.15


@pytest.fixture(scope="module")
def transmission() -> TransmissionMap:
    return Configuration.load(packaged("wam")).shared.arm.transmission


def random_vectors(count: int) -> list[list[float]]:
    return np.random.default_rng(5).uniform(-3.0, 3.0, (count, 4)).tolist()


def test_maps_there_and_back_are_the_identity(transmission: TransmissionMap) -> None:
    pairs = [
        (transmission.joint_motion, transmission.motor_motion),
        (transmission.joint_torques, transmission.motor_torques),
    ]
    for there, back in pairs:
        for vector in random_vectors(50):
            assert back(there(vector)) == pytest.approx(vector, rel=1e-13, abs=1e-13)
            assert there(back(vector)) == pytest.approx(vector, rel=1e-13, abs=1e-13)


def test_power_in_is_power_out(transmission: TransmissionMap) -> None:
    for thetad, tau_motor in zip(random_vectors(200), reversed(random_vectors(200)), strict=True):
        qd, tau = transmission.joint_motion(thetad), transmission.joint_torques(tau_motor)
        assert np.dot(tau, qd) == pytest.approx(np.dot(tau_motor, thetad), rel=1e-12, abs=1e-12)


def test_inverse_is_the_one_of_the_errata(transmission: TransmissionMap) -> None:
    q1, q2, q3, q4 = 0.3, -0.7, 1.1, 0.4
    expected = [N1 * q1, -N2 * q2 - N2 / 2 * q3, N2 * q2 - N2 / 2 * q3, N4 * q4]
    assert transmission.motor_motion([q1, q2, q3, q4]) == pytest.approx(expected, rel=1e-12)
    assert transmission.motor_from_joint @ [q1, q2, q3, q4] == pytest.approx(expected, rel=1e-12)


def test_both_motors_carry_a_pitch_torque_in_halves(transmission: TransmissionMap) -> None:
    assert transmission.motor_torques([0.0, 2 * N2, 0.0, 0.0]) == pytest.approx([0.0, -1.0, 1.0, 0.0])
    assert transmission.joint_torques([0.0, 1.0, 1.0, 0.0]) == pytest.approx([0.0, 0.0, -N2, 0.0], abs=1e-12)
    assert transmission.largest_joint_torques([2.0] * 4) == pytest.approx([2 * N1, 4 * N2, 2 * N2, 2 * N4])


def test_one_motor_and_joint_is_a_map_too() -> None:
    testbed = TransmissionMap([[1 / 14]])
    assert testbed.joint_motion([14.0]) == pytest.approx([1.0])
    assert testbed.joint_torques([1.0]) == pytest.approx([14.0])


def test_matrices_cannot_be_written(transmission: TransmissionMap) -> None:
    for matrix in (transmission.joint_from_motor, transmission.motor_from_joint):
        with pytest.raises(ValueError, match="read-only"):
            matrix[0, 0] = 1.0


@pytest.mark.parametrize("matrix", [[[1.0, 2.0], [2.0, 4.0]], [[1.0, 2.0]]])
def test_impossible_matrix_is_refused(matrix: list[list[float]]) -> None:
    with pytest.raises(np.linalg.LinAlgError):
        TransmissionMap(matrix)


def test_wrong_number_of_values_is_refused(transmission: TransmissionMap) -> None:
    with pytest.raises(ValueError, match="got 3 values for 4 motors and joints"):
        transmission.joint_motion([1.0, 2.0, 3.0])


def test_an_arm_whose_motors_do_not_move_every_joint_by_itself_is_refused_by_name() -> None:
    matrix = [1.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, 0.0, 0.0, 1.0]
    configuration = Configuration.load(packaged("wam")).with_values({"arm.joint_from_motor": matrix})
    with pytest.raises(ParameterError, match=r"'arm\.joint_from_motor' is singular .condition number"):
        configuration.shared  # noqa: B018 - built when it is read
