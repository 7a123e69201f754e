"""One number decides: the predicted error of a force by its causes, per tolerated error."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from arms import BODY, CONFIGURATION, WAM

from wam_control.force.axes import CommandedAxis, TaskAxes
from wam_control.force.belief import Errors, WorldTorques, belief, predicted
from wam_control.force.command_run import Shaking
from wam_control.force.force_axis import ForceAxes, ForcePlace, Phasors
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.limits import yielding
from wam_control.force.task import AxisKind, TaskAxis, TaskCommand, joint_axes
from wam_description.rigid_body import RigidBody

OWN = CONFIGURATION.node("force_loop", ForceLoopParameters)
PLAIN = replace(OWN, sensing=replace(OWN.sensing, torque_fraction=0.0))
FORCES, OUTER = ForceAxes(BODY, PLAIN.sensing), "outer_link"
POSES = ((0.3, -1.2, 0.2, 1.0), (0.0, -1.0, 0.0, 1.2), (0.5, 0.2, -0.4, 0.8))
SD = np.full(4, OWN.sensing.torque_sd)
NONE = np.zeros(4)


def axis_at(q: Sequence[float], force: float = 10.0, sd: float = 0.01) -> CommandedAxis:
    direction = BODY.cover_pose(q, OUTER).rotation[:, 2].tolist()
    of = TaskAxis(AxisKind.FORCE, -1, OUTER, 0.28, tuple(direction), force)
    place = ForcePlace(OUTER, 0.28, sd, is_pinned=True, is_known=True)
    return TaskAxes(BODY, FORCES).of(q, TaskCommand("base", (of,)), [place], [1.0])[0]


def errors(q: Sequence[float], force: float, sd: float = 0.01, **more: float) -> Errors:
    return predicted(axis_at(q, force, sd), SD, PLAIN, **more)


@pytest.mark.parametrize(("part", "limits", "given"), [
    ("torques", {}, {"torque_sd": 1.0}),
    ("place", {}, {"sd": 0.1}),
    ("resting", {}, {"resting": -9.0}),
    ("moving_surface", {"surface_speed": 0.015}, {}),
    ("moving_surface", {"surface_speed": 9.0}, {}),  # no force law follows it
    ("moving_surface", {"slide_speed": 1.0}, {}),
    ("slow_arm", {"impact": 1e-6}, {}),
    ("slow_arm", {"settling_time": 1e-3}, {}),
    ("shaking_arm", {}, {"shaking": 100.0}),
    ("friction", {}, {"torque_sd": 1e-5, "sd": 0.0}),
])  # fmt: skip
def test_each_cause_counts_by_itself_and_is_named_where_it_is_the_largest(
    part: str, limits: dict[str, float], given: dict[str, Any]
) -> None:
    axis = axis_at(POSES[0], 10.0, given.pop("sd", 0.01))
    own, torque_sd = replace(PLAIN, limits=replace(PLAIN.limits, **limits)), given.pop("torque_sd", SD[0])
    found, without = predicted(axis, np.full(4, torque_sd), own, **given), errors(POSES[0], 10.0)
    assert found.cause == part
    assert found.size == pytest.approx(math.sqrt(sum(each**2 for each in found)))
    if part != "friction":
        assert getattr(found, part) > getattr(without, part)
        assert found.size > without.size


@pytest.mark.parametrize("q", POSES)
def test_more_force_is_never_known_worse_per_newton(q: tuple[float, ...]) -> None:
    for sd, more in ((0.01, {}), (0.1, {"resting": 0.5}), (0.0, {"shaking": 2.0})):
        doubts = [errors(q, force, sd, **more).size / force for force in (1, 2, 5, 10, 20, 40, 60)]
        assert all(later <= before * (1.0 + 1e-6) for before, later in pairwise(doubts))
        assert doubts[-1] < doubts[0]


@pytest.mark.parametrize("q", POSES)
def test_the_predicted_error_is_that_of_random_torques_friction_and_position(q: tuple[float, ...]) -> None:
    """The surface pushes back at a place that is off, with friction, and the sensors err."""
    random, n, axis = np.random.default_rng(2), 5000, axis_at(q, 10.0, 0.02)
    radius, rotation = WAM.covers.radius_of(OUTER), BODY.cover_pose(q, OUTER).rotation
    across = np.eye(3) - np.outer(axis.direction, axis.direction)
    found = []
    for off, sideways, noise in zip(
        0.02 * random.normal(size=n), random.normal(size=(n, 3)), SD * random.normal(size=(n, 4)), strict=True
    ):
        point = np.array([0.28 + off, *WAM.covers.on_axis(OUTER, 0.28)[1:]]) + radius * (rotation.T @ axis.direction)
        force = 10.0 * axis.direction + 10.0 * PLAIN.sensing.friction * across @ sideways
        torques = noise - force @ BODY.point_jacobian(q, OUTER, point)
        found.append(axis.force(torques) - 10.0)
    assert np.std(found) == pytest.approx(predicted(axis, SD, PLAIN).size, rel=0.08)


def test_without_a_lever_nothing_is_known() -> None:
    straight = (0.0, -1.0, 0.0, math.pi / 2.0)
    tip = BODY.point(straight, OUTER, (0.3, 0.0, 0.0))
    sensed = FORCES.axis(straight, ForcePlace(OUTER, 0.3, 0.0), tip / np.linalg.norm(tip), 10.0)
    axis = axis_at(straight)._replace(sensed=sensed)
    assert predicted(axis, SD, PLAIN).size == math.inf


@pytest.mark.parametrize("is_touching", [False, True])
def test_the_arms_own_motion_is_no_force_until_something_is_touched(is_touching: bool) -> None:
    axis, acceleration = axis_at(POSES[0]), np.array([2.0, -3.0, 1.0, 4.0])
    inertial = -FORCES.inertia(POSES[0]) @ acceleration  # as sensors show it
    torques = WorldTorques(inertial, inertial, acceleration, SD)
    known = belief(axis, 10.0, torques, PLAIN, is_touching, NONE, 0.0)
    assert (abs(known.force) < 1e-9) is not is_touching
    at_rest = belief(axis, 10.0, torques._replace(acceleration=None), PLAIN, False, NONE, 0.0)
    assert at_rest.force == pytest.approx(axis.force(inertial)), "motors do not show it"


def test_torques_at_rest_count_as_the_force_that_they_look_like() -> None:
    axis = axis_at(POSES[0])
    assert axis.sensed is not None
    none = WorldTorques(NONE, NONE, None, SD)
    known = belief(axis, 10.0, none, PLAIN, False, -2.0 * axis.sensed.press, 0.0)
    assert known.errors.resting == pytest.approx(2.0)
    assert known.doubt > 1.0
    assert belief(axis, 60.0, none, PLAIN, False, -2.0 * axis.sensed.press, 0.0).doubt < 1.0


def test_a_joint_torque_is_known_as_its_joint_is() -> None:
    task = TaskCommand("base", joint_axes(AxisKind.FORCE, [1.0, 2.0, 0.0, -3.0]))
    axes = TaskAxes(BODY, FORCES).of(POSES[0], task, [ForcePlace("", 0.0, 0.0)] * 4, [1.0] * 4)
    torques = WorldTorques(np.array([0.5, -2.0, 0.0, 3.0]), NONE, None, np.array([0.1, 0.2, 0.3, 0.4]))
    resting = np.array([0.0, 0.1, 0.0, 0.0])
    known = [belief(axis, 4.0, torques, PLAIN, False, resting, 0.0) for axis in axes]
    assert [each.force for each in known] == [-0.5, 2.0, 0.0, -3.0]
    assert [each.sd for each in known] == [0.1, 0.2, 0.3, 0.4]
    assert [each.doubt for each in known] == pytest.approx([0.25, math.hypot(0.5, 0.25), 0.75, 1.0])


def test_a_stiff_surface_yields_as_the_cables_do() -> None:
    sensed = axis_at(POSES[0]).sensed
    assert sensed is not None
    stiff = replace(PLAIN, guard=replace(PLAIN.guard, contact_stiffness=1e12))
    assert yielding(sensed, stiff) == pytest.approx(sensed.compliance)
    assert yielding(sensed, PLAIN) == pytest.approx(sensed.compliance + 1.0 / 4000.0)


@pytest.mark.parametrize("q", POSES)
@pytest.mark.parametrize("stiffness", [400.0, 2e4, 6e4, 3e5])
def test_what_shakes_the_free_arm_shakes_it_on_a_surface(q: tuple[float, ...], stiffness: float) -> None:
    """Links on the cables, and motors on their velocity loops, as one system of both; without dry friction."""
    forces = ForceAxes(RigidBody(replace(WAM, joints=replace(WAM.joints, dynamic_friction=(0.0,) * 4))), PLAIN.sensing)
    shared, dt, frequency = CONFIGURATION.shared, 0.005, 2.0 * math.pi * 25.0
    at_joints = WAM.transmission.at_joints
    cables, servo = at_joints([circuit.stiffness for circuit in WAM.circuits]), shared.servo
    loops = at_joints(servo.integral_gain) + 1j * frequency * at_joints(servo.proportional_gain)
    motors = loops - frequency**2 * at_joints(WAM.motors.inertia)
    links = np.array(-(frequency**2) * FORCES.inertia(q), complex)
    axis = axis_at(q)
    push = np.concatenate([np.zeros(4), [0.1, 0.2j, -0.3, 0.1]])  # N m, of the dither

    def motion(surface: float) -> Phasors:
        touched = links + cables + surface * np.outer(axis.along, axis.along)
        return np.linalg.solve(np.block([[touched, -cables], [-cables, motors + cables]]), push)

    free, shaking = motion(0.0), Shaking(replace(shared.timing, dither_cycle=40))
    for k in range(50):
        swing = np.real(free[4:] * np.exp(1j * frequency * k * dt))
        shaking.is_watching((np.array(q) + swing + 1e-3 * k * dt).tolist(), forces, servo, dt)
    pressed = motion(stiffness)
    own = replace(OWN, guard=replace(OWN.guard, contact_stiffness=stiffness))
    assert shaking.swing(axis, own) == pytest.approx(2.0 * stiffness * abs(axis.along @ pressed[:4]), rel=1e-3)


@pytest.mark.parametrize("q", POSES)
def test_dry_friction_takes_4_over_pi_of_itself_from_a_vibration_and_holds_a_weak_one(q: tuple[float, ...]) -> None:
    motion, frequency, servo = np.array([4e-4, 3e-4j, -8e-4, 1e-3]), 2.0 * math.pi * 25.0, CONFIGURATION.shared.servo
    for size, is_held in ((1.0, False), (0.01, True)):
        damping = FORCES.friction_damping(q, size * motion, frequency)
        free, _ = FORCES.vibration(q, size * motion, frequency, damping, servo)
        assert max(abs(free)) < 1e-4 * size * max(abs(motion)) if is_held else min(abs(free)) > 0.1 * min(abs(motion))
        if not is_held:
            taken = damping * frequency * abs(free)
            assert taken == pytest.approx(4.0 / math.pi * np.array(WAM.joints.dynamic_friction), rel=1e-3)
