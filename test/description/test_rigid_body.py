"""Kinematics and dynamics of the links against the table of appendix A and finite differences."""

import numpy as np
import pytest
from numpy.typing import NDArray

from wam_description.arm import Arm
from wam_description.configuration import Configuration, packaged
from wam_description.rigid_body import RigidBody

Array = NDArray[np.float64]
L3, L4 = 22 * 0.0254, 16 * 0.0254


@pytest.fixture(scope="module")
def arm() -> Arm:
    return Configuration.load(packaged("wam")).shared.arm


@pytest.fixture(scope="module")
def body(arm: Arm) -> RigidBody:
    return RigidBody(arm)


def poses(count: int) -> Array:
    return np.random.default_rng(7).uniform(-2.5, 2.5, (count, 4))


def frame(twist: float, length: float, offset: float, angle: float) -> Array:
    """Frame i in frame i-1 as a (4, 4) matrix, printed (A.4)."""
    c, s, ca, sa = np.cos(angle), np.sin(angle), np.cos(twist), np.sin(twist)
    return np.array(
        [[c, -s, 0, length], [s * ca, c * ca, -sa, -sa * offset], [s * sa, c * sa, ca, ca * offset], [0, 0, 0, 1]]
    )


def frames(q: Array) -> list[Array]:
    """Frames 1 to 5 in the base by the table of appendix A."""
    table = [(0, 0, 0), (np.pi / 2, 0, 0), (-np.pi / 2, 0, L3), (np.pi / 2, 0, 0), (0, L4, 0)]
    result, product = [], np.eye(4)
    for row, angle in zip(table, (*q, 0.0), strict=True):
        product = product @ frame(*row, angle)
        result.append(product)
    return result


def slope(function: object, q: Array) -> Array:
    """Central difference of a vector function, (m, n)."""
    assert callable(function)
    step = 1e-5
    return np.stack([(function(q + step * e) - function(q - step * e)) / (2 * step) for e in np.eye(4)], axis=1)


def test_poses_of_the_appendix_put_the_tip_where_it_says(body: RigidBody) -> None:
    inch = 0.0254
    assert body.tool_pose([0, 0, 0, 0]).position == pytest.approx([16 * inch, 0, 22 * inch])
    assert body.tool_pose([0, -np.pi / 2, 0, np.pi / 2]).position == pytest.approx([38 * inch, 0, 0], abs=1e-12)
    assert body.tool_pose([0, 0, 0, -np.pi / 2]).position == pytest.approx([0, 0, 6 * inch], abs=1e-12)


def test_tool_and_covers_are_where_the_table_puts_them(body: RigidBody) -> None:
    for q in poses(100):
        third, fourth, fifth = frames(q)[2:]
        assert np.allclose(body.tool_pose(q).position, fifth[:3, 3], atol=1e-9)
        assert np.allclose(body.tool_pose(q).rotation, fifth[:3, :3], atol=1e-9)
        assert np.allclose(body.cover_pose(q, "outer_link").rotation, fourth[:3, :3], atol=1e-9)
        inner = body.cover_pose(q, "inner_link")
        assert np.allclose(inner.position, 0.0, atol=1e-9)
        assert np.allclose(inner.rotation, np.column_stack([third[:3, 2], third[:3, 1], -third[:3, 0]]), atol=1e-9)
        assert np.allclose(body.point(q, "inner_link", [L3, 0.0, 0.0]), fourth[:3, 3], atol=1e-9)
        assert np.allclose(body.point(q, "outer_link", [0.1, 0.02, 0.03]), (fourth @ [0.1, 0.02, 0.03, 1])[:3])


def test_hand_jacobian_is_corrected_a7(body: RigidBody) -> None:
    for q in poses(100):
        (s2, s3, s4), (c2, c3, c4) = np.sin(q[1:]), np.cos(q[1:])
        transposed = [  # (A.7) with row 2, column 2 corrected to L3 c3 s4 + L4 c3
            [-L3 * s2 * s3 * c4, L3 * s2 * s3 * s4 + L4 * s2 * s3, L4 * s2 * c3 * s4 - L4 * c2 * c4 + L3 * s2 * c3],
            [-L3 * c3 * c4, L3 * c3 * s4 + L4 * c3, -L4 * s3 * s4 - L3 * s3],
            [0.0, 0.0, -L4 * c4],
            [0.0, L4, 0.0],
        ]
        turned = body.tool_pose(q).rotation.T @ body.tool_jacobian(q)
        assert np.allclose(turned, np.transpose(transposed), atol=1e-9)


def test_printed_a7_is_wrong_by_up_to_22_6_inches() -> None:
    entries = [(L4 * (np.sin(q3) - np.cos(q3))) / 0.0254 for q3 in np.linspace(-np.pi, np.pi, 361)]
    assert max(np.abs(entries)) == pytest.approx(22.6, abs=0.05)


def test_jacobians_are_slopes_of_positions(body: RigidBody) -> None:
    point = np.array([0.3, 0.02, -0.04])
    for q in poses(30):
        by_table = slope(lambda angles: frames(angles)[4][:3, 3], q)
        assert np.allclose(body.tool_jacobian(q), by_table, atol=1e-7)
        for cover in body.covers:
            expected = slope(lambda angles, cover=cover: body.point(angles, cover, point), q)
            assert np.allclose(body.point_jacobian(q, cover, point), expected, atol=1e-7)


def test_momentum_rate_is_torque_plus_coriolis_transpose(body: RigidBody) -> None:
    rng = np.random.default_rng(3)
    for q in poses(20):
        qd, qdd = rng.uniform(-2, 2, (2, 4))
        step = 1e-5
        before, after = (body.mass_matrix(q + h * qd) @ (qd + h * qdd) for h in (-step, step))
        torque = body.inverse_dynamics(q, qd, qdd)
        expected = torque + body.momentum_bias(q, qd)
        assert np.allclose((after - before) / (2 * step), expected, atol=1e-6)


def test_results_stay_when_the_next_is_computed(body: RigidBody) -> None:
    q, other = [0.1, 0.2, 0.3, 0.4], [1.0, -1.0, 1.0, -1.0]
    for compute in (body.gravity_torque, body.mass_matrix, body.tool_jacobian):
        first = compute(q)
        kept = first.copy()
        compute(other)
        assert np.array_equal(first, kept)
    pose = body.tool_pose(q)
    position = pose.position.copy()
    body.tool_pose(other)
    assert np.array_equal(pose.position, position)


def test_unknown_cover_and_bad_mass_scale_are_refused(arm: Arm, body: RigidBody) -> None:
    with pytest.raises(ValueError, match="cover 'wrist' is not on arm 'wam'; covers: inner_link, outer_link"):
        body.point([0, 0, 0, 0], "wrist", [0, 0, 0])
    for scale in ([1.0, 1.0], [1.0, 1.0, 0.0, 1.0]):
        with pytest.raises(ValueError, match="needs 4 factors above 0, one per link"):
            RigidBody(arm, scale)


def test_worst_motor_torque_for_ten_pounds_is_below_the_continuous_one(arm: Arm, body: RigidBody) -> None:
    """7.2.2 claims 10 lb at any point in any configuration; the assumed masses must allow it."""
    matrix = arm.transmission.joint_from_motor
    lower, upper = np.array(arm.joints.lower), np.array(arm.joints.upper)
    worst = 0.0
    for q in np.random.default_rng(1).uniform(lower, upper, (4000, 4)):
        force = 10 * 4.4482216 * np.linalg.norm(matrix.T @ body.tool_jacobian(q).T, axis=1)
        worst = max(worst, float(np.max(np.abs(matrix.T @ body.gravity_torque(q)) + force)))
    assert 0.8 * arm.motors.continuous_torque[0] < worst < arm.motors.continuous_torque[0]


def test_cover_jacobian_moves_every_point_of_the_cover_as_the_jacobian_of_the_point_does(body: RigidBody) -> None:
    """Velocity is v_0 + w x p in the cover's frame, and its transpose takes a wrench as virtual work does."""
    rng = np.random.default_rng(5)

    for cover in body.covers:
        q, p, force = rng.uniform(-1.5, 1.5, 4), rng.uniform(-0.5, 0.5, 3), rng.normal(size=3)
        jacobian, rotation = body.cover_jacobian(q, cover), body.cover_pose(q, cover).rotation
        at_point = rotation.T @ body.point_jacobian(q, cover, p)
        assert np.allclose(jacobian[:3] + np.cross(jacobian[3:].T, p).T, at_point, atol=1e-12)
        assert np.allclose(jacobian.T @ [*force, *np.cross(p, force)], at_point.T @ force, atol=1e-12)
    with pytest.raises(ValueError, match=r"no cover|not on arm"):
        body.cover_jacobian([0.0] * 4, "hand")
