"""The map between motors and joints, (A.5), for positions, velocities and torques."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from wam_description.small_matrices import Array


class TransmissionMap:
    """Positions, velocities and torques from motors to joints and back, (A.5).

    With q = M theta, equal power on both sides gives tau_motor = M^T tau.  The methods take and
    return plain lists of n numbers: on four numbers scalar Python is faster than numpy.

    Parameters
    ----------
    matrix : (n, n), M of (A.5), rad at the joints per rad at the motors.

    Attributes
    ----------
    joint_from_motor : (n, n), read-only, M.
    motor_from_joint : (n, n), read-only, inverse of M.

    Raises
    ------
    numpy.linalg.LinAlgError
        if the matrix is not square or singular.
    """

    def __init__(self, matrix: ArrayLike) -> None:
        forward = np.array(matrix, dtype=float)
        inverse = np.linalg.inv(forward) + 0.0  # turns -0.0 into 0.0
        forward.setflags(write=False)
        inverse.setflags(write=False)
        self.joint_from_motor: Array = forward
        self.motor_from_joint: Array = inverse
        self._forward, self._inverse = _terms(forward), _terms(inverse)
        self._forward_transposed, self._inverse_transposed = _terms(forward.T), _terms(inverse.T)

    def joint_motion(self, theta: Sequence[float]) -> list[float]:
        """Joint angles q = M theta, n, rad, of motor angles theta, n, rad; or velocities of velocities (A.5)."""
        return _product(self._forward, theta)

    def motor_motion(self, q: Sequence[float]) -> list[float]:
        """Motor angles theta = M^-1 q, n, rad, of joint angles q, n, rad; or velocities of velocities (A.5)."""
        return _product(self._inverse, q)

    def joint_torques(self, tau_motor: Sequence[float]) -> list[float]:
        """Joint torques M^-T tau_motor, n, N m, of motor torques, n, N m (A.5, by power)."""
        return _product(self._inverse_transposed, tau_motor)

    def motor_torques(self, tau: Sequence[float]) -> list[float]:
        """Motor torques M^T tau, n, N m, of joint torques, n, N m (A.5, by power)."""
        return _product(self._forward_transposed, tau)

    def at_joints(self, per_motor: Sequence[float]) -> Array:
        """M^-T diag M^-1, (n, n): an inertia, a stiffness or a damping of each motor as the joints have it (A.5)."""
        inverse = self.motor_from_joint
        result: Array = inverse.T @ (np.array(per_motor)[:, None] * inverse)
        return result

    def largest_joint_torques(self, peak_torque: Sequence[float]) -> list[float]:
        """Largest torque at each joint alone, n, N m, with up to peak_torque, n, N m, from each motor."""
        return _product(_terms(np.abs(self.motor_from_joint.T)), peak_torque)

    def largest_motor_velocities(self, speed_limit: Sequence[float]) -> list[float]:
        """Largest speed of each motor, n, rad/s, with joints up to speed_limit, n, rad/s."""
        return _product(_terms(np.abs(self.motor_from_joint)), speed_limit)


def _terms(matrix: Array) -> list[list[tuple[int, float]]]:
    return [[(j, factor) for j, factor in enumerate(row) if factor != 0.0] for row in matrix.tolist()]


def _product(terms: list[list[tuple[int, float]]], vector: Sequence[float]) -> list[float]:
    if len(vector) != len(terms):
        raise ValueError(f"got {len(vector)} values for {len(terms)} motors and joints: {list(vector)}")
    result = []
    for row in terms:
        total = 0.0
        for j, factor in row:
            total += factor * vector[j]
        result.append(total)
    return result
