"""The scorecard of chapter 3: the arm's numbers by other ways, and verdicts that follow the numbers."""

import math
from dataclasses import replace

import numpy as np
import pytest

from wam_description.configuration import Configuration, packaged
from wam_description.rigid_body import RigidBody
from wam_studies.scorecard import measures, steady_force, stiffness_rule, table
from wam_theory.requisites import Measures, Requisite, scorecard
from wam_theory.stick_slip import FrictionNode, IntegralLoop, Verdict, assess

POSE = (0.0, -math.pi / 4, 0.0, 0.0)  # (A.2)
LB = 4.4482216152605


@pytest.fixture(scope="module")
def configuration() -> Configuration:
    return Configuration.load(packaged("wam"))


@pytest.fixture(scope="module")
def arm(configuration: Configuration) -> Measures:
    return measures(configuration)


def row(rows: tuple[Requisite, ...], measure: str) -> Requisite:
    (found,) = (r for r in rows if measure in r.measure)
    return found


def test_every_requisite_of_section_3_2_has_rows_and_the_arm_meets_what_the_thesis_gives(arm: Measures) -> None:
    rows = scorecard(arm)
    names = "dynamic range, robustness, high bandwidth, high aspect ratio, high efficiency, good backdrivability"
    assert ", ".join(dict.fromkeys(r.requisite for r in rows)) == names
    assert all(r.met is not False for r in rows)
    assert sum(r.met is True for r in rows) == 14
    assert all(math.isnan(r.required) is (r.met is None) for r in rows)
    assert table(rows).count("yes, within") == 1
    assert "| at least 1 | 6.5 | yes, within 1% |" in table(rows)


def test_friction_and_strength_are_the_printed_ones_in_pounds(arm: Measures) -> None:
    assert arm.friction_share == pytest.approx((0.014, 0.01, 0.01, 0.01), rel=1e-3)
    assert arm.friction_required == pytest.approx((0.014, 0.01, 0.01, 0.01))
    assert arm.steady_force_required == pytest.approx(10.0 * LB)
    assert arm.steady_force / LB == pytest.approx(15.0 * 29.97 / (22.0 + 16.0), rel=1e-5)  # across the stretched arm
    assert arm.aspect_ratio == pytest.approx((22.0 / 4.4, 18.0 / 2.0), rel=1e-3)
    assert arm.pretension == pytest.approx(57.0 / (43.0 / 0.375 / 2.0), rel=1e-3)
    assert arm.cable_tension == pytest.approx((57.0 + 43.0 / 0.375 / 2.0) / 170.0, rel=1e-2)
    assert arm.efficiency == pytest.approx((1.0 - 43.0 / 0.375 / 9500.0) ** 2, rel=1e-4)


def test_steady_force_is_held_in_poses_that_the_grid_has_not(configuration: Configuration, arm: Measures) -> None:
    """Random poses and directions with motors solved one by one; the grid's worst is within 5 % of theirs."""
    of = configuration.shared.arm
    body, matrix = RigidBody(of), np.reshape(of.joint_from_motor, (4, 4))
    least = math.inf
    for q in np.random.default_rng(2).uniform(of.joints.lower, of.joints.upper, (2000, 4)):
        carried = matrix.T @ body.gravity_torque(q)
        per_newton = matrix.T @ body.tool_jacobian(q).T
        for motor in range(4):
            along = per_newton[motor] / np.linalg.norm(per_newton[motor])
            torque = carried + np.sign(carried[motor] or 1.0) * per_newton @ along
            slope = abs(torque[motor]) - abs(carried[motor])
            least = min(least, (of.motors.continuous_torque[motor] - abs(carried[motor])) / slope)
    assert arm.steady_force == pytest.approx(least, rel=0.05)
    weak = replace(of, motors=replace(of.motors, continuous_torque=(0.1,) * 4))
    assert steady_force(weak) == 0.0  # it does not carry itself


def test_effective_mass_is_a_push_over_the_acceleration_of_the_tip(configuration: Configuration, arm: Measures) -> None:
    of = configuration.shared.arm
    body, gears = RigidBody(of), np.linalg.inv(np.reshape(of.joint_from_motor, (4, 4)))
    inertia = body.mass_matrix(POSE) + np.diag(of.joints.armature) + of.motors.inertia[0] * gears.T @ gears
    rotation = body.cover_pose(POSE, "outer_link").rotation
    jacobian = body.tool_jacobian(POSE)
    masses = []
    for angle in np.linspace(0.0, math.pi, 37):
        push = math.cos(angle) * rotation[:, 1] + math.sin(angle) * rotation[:, 2]
        acceleration = jacobian @ np.linalg.solve(inertia, jacobian.T @ push)
        masses.append(1.0 / float(push @ acceleration))
    assert arm.effective_mass == pytest.approx(max(masses), rel=1e-3)
    impact = row(scorecard(arm), "impact force")
    assert impact.value == pytest.approx(4.0 * math.sqrt(max(masses) * 4000.0), rel=1e-3)


def test_push_that_moves_no_joint_is_the_least_over_joints_and_the_greatest_over_directions(
    configuration: Configuration, arm: Measures
) -> None:
    of = configuration.shared.arm
    friction = np.array(arm.friction_share) * np.array([29.97, 2 * 30.40, 30.40, 19.15]) * of.motors.peak_torque[0]
    body = RigidBody(of)
    rotation, jacobian = body.cover_pose(POSE, "outer_link").rotation, body.tool_jacobian(POSE)
    held = []
    for angle in np.linspace(0.0, math.pi, 181):
        push = math.cos(angle) * rotation[:, 1] + math.sin(angle) * rotation[:, 2]
        force = 0.0
        while np.all(np.abs(jacobian.T @ push) * force <= friction):
            force += 0.02
        held.append(force)
    assert arm.least_force == pytest.approx(max(held), abs=0.03)
    dynamic_range = row(scorecard(arm), "steady force / force masked")
    assert dynamic_range.value == pytest.approx(arm.steady_force / max(held), rel=0.01)


def test_stiction_cycle_at_the_tip_is_that_of_the_exact_force_loop(configuration: Configuration, arm: Measures) -> None:
    """Joint by joint, and as a slow loop with a lightly damped link that goes on until its cycle repeats."""
    of = configuration.shared.arm
    body = RigidBody(of)
    rotation, jacobian = body.cover_pose(POSE, "outer_link").rotation, body.tool_jacobian(POSE)
    largest = 0.0
    for angle in np.linspace(0.0, math.pi, 19):
        levers = np.abs((math.cos(angle) * rotation[:, 1] + math.sin(angle) * rotation[:, 2]) @ jacobian)
        for i in np.flatnonzero(levers > 0.02):
            cable, contact = arm.transmission_stiffness[i], 4000.0 * levers[i] ** 2
            damping = 0.01 * 2.0 * math.sqrt((cable + contact) * arm.link_inertia[i])
            drop = (of.joints.dynamic_friction[i], of.joints.static_friction[i])
            node = FrictionNode(arm.link_inertia[i], damping, cable, contact, *drop)
            gain = 0.02 * math.sqrt((cable + contact) / arm.link_inertia[i]) * (cable + contact) / (cable * contact)
            found = assess(node, IntegralLoop(gain), 2.0 * node.static_friction, tolerance=1e-4)
            assert found.verdict is Verdict.LIMIT_CYCLE
            largest = max(largest, found.peak_to_peak / levers[i])
    assert arm.cycle_force == pytest.approx(largest, rel=0.06)  # (5.8) is the limit of a slow undamped loop
    assert row(scorecard(arm), "force feedback").value == pytest.approx(arm.steady_force / arm.cycle_force)
    without = scorecard(replace(arm, cycle_force=0.0, least_force=0.0, friction_share=(0.0,) * 4))
    found = [row(without, of_range).value for of_range in ("force feedback", "open loop", "friction, joint 3")]
    assert found == [math.inf] * 3


def test_coupled_bandwidth_is_the_least_of_an_arm_with_free_rotors(configuration: Configuration, arm: Measures) -> None:
    """Modes by a symmetric eigenvalue problem, whose contact removes one of four free motions."""
    of = configuration.shared.arm
    body, gears = RigidBody(of), np.linalg.inv(np.reshape(of.joint_from_motor, (4, 4)))
    inertia = np.zeros((8, 8))
    inertia[:4, :4], inertia[4:, 4:] = np.diag(of.motors.inertia), body.mass_matrix(POSE) + np.diag(of.joints.armature)
    half = np.linalg.inv(np.linalg.cholesky(inertia))
    rotation, jacobian, found = body.cover_pose(POSE, "outer_link").rotation, body.tool_jacobian(POSE), []
    for angle in np.linspace(0.0, math.pi, 37):
        lever = (math.cos(angle) * rotation[:, 1] + math.sin(angle) * rotation[:, 2]) @ jacobian
        rows = np.vstack([np.hstack([np.eye(4), -gears]), [*np.zeros(4), *lever]])
        stiffness = rows.T @ np.diag([*(circuit.stiffness for circuit in of.circuits), 4000.0]) @ rows
        squares = np.linalg.eigvalsh(half @ stiffness @ half.T)
        assert squares[2] < 1e-3 * squares[3]
        found.append(math.sqrt(squares[3]) / (2.0 * math.pi))
    assert arm.coupled_bandwidth == pytest.approx(min(found), rel=1e-3)
    assert arm.coupled_bandwidth > 3.0 * row(scorecard(arm), "open-loop force bandwidth, joint 2 (4.4)").value


@pytest.mark.parametrize(("change", "measure"), [
    ({"steady_force": 40.0}, "steady force at any point"),
    ({"friction_share": (0.014, 0.02, 0.01, 0.01)}, "peak torque / friction, joint 2"),
    ({"cable_tension": 1.1}, "greatest cable tension"), ({"pretension": 0.9}, "pretension"),
    ({"aspect_ratio": (5.0, 8.0)}, "length / width, outer link"), ({"efficiency": 0.9}, "limiting efficiency"),
    ({"rotor_inertia": (0.01, 0.01, 9.0, 0.01)}, "rotors' inertia / link's inertia, joint 3"),
])  # fmt: skip
def test_a_worse_number_fails_its_own_row_alone(arm: Measures, change: dict[str, object], measure: str) -> None:
    rows = scorecard(replace(arm, **change))  # type: ignore[arg-type]
    assert [r.measure for r in rows if r.met is False] == [row(rows, measure).measure]


def test_bandwidth_is_the_lowest_eigenvalue_of_any_joint(configuration: Configuration, arm: Measures) -> None:
    """Those of each joint are compared with eigenvalues in test_design_choices."""
    rule = stiffness_rule(configuration)
    lowest = rule["bandwidth, Hz"].min()
    assert row(scorecard(arm), "force bandwidth, joint 2 (4.4)").value == pytest.approx(lowest, rel=1e-6)
    rotor_alone = math.sqrt(arm.transmission_stiffness[1] / arm.rotor_inertia[1]) / (2.0 * math.pi)
    assert row(scorecard(arm), "/ its asymptote").value == pytest.approx(lowest / rotor_alone, rel=1e-6)
