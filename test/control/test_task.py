"""Tasks on a world that is computed here: the arm follows its velocity command, springs push back on one link."""

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from arms import BODY, CONFIGURATION, SHARED, WAM

from wam_control.force.force_loop import ForceInput, ForceLoop, ForceLoopParameters, ForceOutput
from wam_control.force.force_loop_parameters import task_of as task_of_parameters
from wam_control.force.stability_guard import GuardedForces, GuardedTask, StabilityGuard
from wam_control.force.task import AxisKind, TaskAxis, TaskCommand, joint_axes, line_axes, table_of, task_of
from wam_description.event import Code
from wam_description.event_text import sentence
from wam_description.parameters import ParameterError
from wam_description.signals import NO_CONTACT, Contact, State, Table, Triple

GIVEN = CONFIGURATION.node("force_loop", ForceLoopParameters)
OWN = replace(GIVEN, guard=replace(GIVEN.guard, mode="off"))
COVER, PLACE = "outer_link", 0.28
POSE = [0.3, -1.2, 0.2, 1.0]
LEVEL = [-0.031, -1.083, -1.826, -0.482]  # the outer link is level
REST = [0.0] * 4
DT = 0.005
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
DOWN = (0.0, 0.0, -1.0)


def force(newtons: float, along: Triple = DOWN, place: float | None = PLACE) -> TaskAxis:
    return TaskAxis(AxisKind.FORCE, -1, COVER, place, along, newtons)


def position(value: float | None, along: Triple, place: float = PLACE) -> TaskAxis:
    return TaskAxis(AxisKind.POSITION, -1, COVER, place, along, value)


def base(*axes: TaskAxis) -> TaskCommand:
    return TaskCommand("base", axes)


class Springs:
    """Springs of stiffness k, N/m, along some directions at the surface of one link; a hand, and ideal servos."""

    def __init__(self, q: list[float] = POSE, springs: dict[Triple, float] | None = None, place: float = PLACE) -> None:
        self.q, self.place, self.springs, self.hand = np.array(q), place, springs or {}, np.zeros(4)
        self.rest = {n: np.array(n) @ self.point(n) for n in self.springs}
        self.loop = ForceLoop(WAM, SHARED.servo, OWN, SHARED.timing)

    def point(self, n: Triple, q: Any = None) -> np.ndarray:
        q = self.q if q is None else q
        normal = BODY.cover_pose(q, COVER).rotation.T @ np.array(n)
        return BODY.point(q, COVER, np.array([self.place, 0.0, 0.0]) + WAM.covers.radius[1] * normal)

    def lever(self, n: Triple) -> np.ndarray:
        """Torque per force on the frozen surface point, by finite differences."""
        normal = BODY.cover_pose(self.q, COVER).rotation.T @ np.array(n)
        point = np.array([self.place, 0.0, 0.0]) + WAM.covers.radius[1] * normal
        h = np.eye(4) * 1e-6
        ends = [(BODY.point(self.q + d, COVER, point) - BODY.point(self.q - d, COVER, point)) / 2e-6 for d in h]
        return np.array([np.array(n) @ end for end in ends])

    def force(self, n: Triple) -> float:
        """Of the arm on the world, N."""
        return max(0.0, self.springs[n] * float(np.array(n) @ self.point(n) - self.rest[n]))

    def step(self, task: TaskCommand | None, periods: int = 1, **more: Any) -> ForceOutput:
        for _ in range(periods):
            torque = sum((self.force(n) * self.lever(n) for n in self.springs), -self.hand)
            q = self.q.tolist()
            sensors = State(q, REST, (BODY.gravity_torque(q) + torque).tolist())
            joints, contact = State(q, REST, [1.0] * 4), more.get("contact", NO_CONTACT)
            given = ForceInput(joints, DT, sensors, contact, posture=more.get("posture"), task=task)
            out = self.loop.step(given)
            self.q = self.q + DT * np.array(out.velocity)
        return out


def test_two_forces_at_once_are_both_reached() -> None:
    world = Springs(springs={DOWN: 4000.0, Y: 2000.0})
    world.step(base(force(10.0), force(5.0, Y)), 150)
    assert world.force(DOWN) == pytest.approx(10.0, rel=0.01)
    assert world.force(Y) == pytest.approx(5.0, rel=0.01)


def test_a_force_against_the_direction_of_its_axis_pulls() -> None:
    world = Springs(springs={DOWN: 4000.0})
    out = world.step(base(force(-10.0, Z)), 150)
    assert world.force(DOWN) == pytest.approx(10.0, rel=0.01)
    assert out.measured[2] == pytest.approx(-10.0, rel=0.01)


def test_an_axis_of_a_link_turns_with_it() -> None:
    world = Springs(springs={DOWN: 4000.0})
    along = BODY.cover_pose(POSE, COVER).rotation.T @ np.array(DOWN)
    x, y, z = along.tolist()
    world.step(TaskCommand(COVER, (force(10.0, (x, y, z)),)), 150)
    assert world.force(DOWN) == pytest.approx(10.0, rel=0.02)


@pytest.mark.slow
def test_the_point_slides_with_the_commanded_velocity_while_it_presses() -> None:
    world = Springs(springs={DOWN: 4000.0})
    slide = TaskAxis(AxisKind.VELOCITY, -1, COVER, PLACE, Y, 0.05)
    world.step(base(force(10.0), slide), 100)
    before = BODY.point(world.q, COVER, (PLACE, 0.0, 0.0))[1]
    world.step(base(force(10.0), slide), 200)
    assert BODY.point(world.q, COVER, (PLACE, 0.0, 0.0))[1] - before == pytest.approx(0.05, rel=0.02)
    assert world.force(DOWN) == pytest.approx(10.0, rel=0.05)


@pytest.mark.parametrize(("others", "slid"), [
    ((), 0.022),
    ((force(0.0, Y),), 0.022),  # at the same position: the way counts once
    ((TaskAxis(AxisKind.VELOCITY, -1, COVER, PLACE, Y, 0.05),), 0.0),
])  # fmt: skip
def test_a_pinned_point_stays_on_what_is_to_be_touched_unless_another_motion_is_commanded(
    others: tuple[TaskAxis, ...], slid: float
) -> None:
    """As under a force command; another motion may lead to what is to be touched."""
    world = Springs(place=PLACE - slid)
    along = BODY.cover_pose(POSE, COVER).rotation[:, 0] @ BODY.point_jacobian(POSE, COVER, (PLACE, 0.0, 0.0))
    for k in range(80):
        world.q = np.array(POSE) + min(k, 11) * 0.002 * along / float(along @ along)  # 22 mm along the link
        world.hand = (-5.0 if k > 20 else 0.0) * world.lever(DOWN)
        out = world.step(base(force(5.0), *others))
    assert out.rows[0][2] == pytest.approx(5.0, rel=0.01), "N, measured"


def test_the_posture_never_moves_along_an_axis() -> None:
    world = Springs()
    start = BODY.point(world.q, COVER, (PLACE, 0.0, 0.0))
    world.step(base(position(None, X), position(None, Z)), 400, posture=[0.6, -1.2, 0.2, 0.7])
    moved = BODY.point(world.q, COVER, (PLACE, 0.0, 0.0)) - start
    assert moved[[0, 2]] == pytest.approx([0.0, 0.0], abs=1e-3)
    assert abs(moved[1]) > 0.05


@pytest.mark.parametrize(("stiffness", "damping", "place"), [(400.0, 100.0, PLACE), (0.0, 200.0, None)])
def test_an_impedance_yields_as_its_spring_and_its_damper_do(stiffness: float, damping: float, place: Any) -> None:
    world = Springs()
    task = base(TaskAxis(AxisKind.IMPEDANCE, -1, COVER, place, Y, None, 0.0, stiffness, damping))
    world.step(task, 10)
    start = float(np.array(Y) @ BODY.point(world.q, COVER, (PLACE, 0.0, 0.0)))
    for _ in range(200):
        world.hand = 4.0 * world.lever(Y)
        world.step(task, contact=Contact(COVER, PLACE, Y))
    moved = float(np.array(Y) @ BODY.point(world.q, COVER, (PLACE, 0.0, 0.0))) - start
    drive = 4.0 - OWN.task.deadband
    expected = drive / stiffness * (1.0 - math.exp(-stiffness / damping)) if stiffness else drive / damping
    assert moved == pytest.approx(expected, rel=0.06)


@pytest.mark.parametrize(("joint", "damping"), [(-1, 5.0), (1, 1.0)])
def test_an_impedance_is_slowed_by_the_factor_of_the_guard(joint: int, damping: float) -> None:
    world, own = Springs(), replace(GIVEN.task, least_damping=damping, least_joint_damping=damping)
    world.loop = ForceLoop(WAM, SHARED.servo, replace(GIVEN, task=own), SHARED.timing)
    axis, band = impedance(Y, stiffness=0.0), own.deadband
    if joint >= 0:
        axis, band = TaskAxis(AxisKind.IMPEDANCE, joint, value=None), own.joint_deadband
    speeds = []
    for each in [force(-2.0, Y)] * 50 + [axis._replace(damping=damping)] * 100:
        along = world.lever(Y) if joint < 0 else np.eye(4)[joint]
        world.hand = 2.0 * along
        speeds.append(float(along @ world.step(base(each)).velocity))
    assert speeds[50] == 0.0, "it waits until it is assessed, as the force was"
    assert (factor := world.loop.supervision.factor) < 0.9
    assert speeds[-1] == pytest.approx(factor * (2.0 - band) / damping, rel=0.02)
    world.hand, reports = np.zeros(4), []
    for stiffness in (0.0, 1.0):
        world.step(base(axis._replace(damping=damping, stiffness=stiffness)), 150)
        reports.append(world.loop.supervision.report)
    assert reports[1] is not reports[0], "another stiffness is assessed, too"


def impedance(along: Triple, value: float | None = None, stiffness: float = 400.0) -> TaskAxis:
    return TaskAxis(AxisKind.IMPEDANCE, -1, COVER, PLACE, along, value, 0.0, stiffness, 100.0)


@pytest.mark.slow
def test_live_parameters_leave_the_equilibrium_of_an_impedance_where_it_was() -> None:
    world, task = Springs(), base(impedance(Y))
    world.step(task, 10)
    start = world.point(Y)[1]
    for _ in range(200):
        world.hand = 12.0 * world.lever(Y)
        world.step(task)
    assert world.point(Y)[1] - start > 0.02
    world.loop.tune(replace(OWN, posture_gain=1.1 * OWN.posture_gain))
    world.hand = np.zeros(4)
    world.step(task, 400)
    assert world.point(Y)[1] == pytest.approx(start, abs=4e-3)


def test_a_refused_task_is_tried_again_with_new_parameters() -> None:
    world, task = Springs(springs={DOWN: 4000.0, Y: 4000.0}), base(force(10.0), force(5.0, Y))
    low = replace(OWN, force_limit=8.0)
    world.loop.tune(low)
    world.step(task, 5)
    assert world.loop.event.code is Code.REFUSED
    world.loop.tune(OWN)
    world.step(task, 150)
    assert world.force(DOWN) == pytest.approx(10.0, rel=0.01)


@pytest.mark.slow
def test_an_impedance_is_sensed_at_the_side_that_is_touched_whichever_way_it_is_written() -> None:
    """Friction along the link has another lever at the other side of it: the force was wrong by as much."""
    found = []
    for along, sign in ((DOWN, 1.0), (Z, -1.0)):
        world = Springs(springs={DOWN: 4000.0})
        task = base(impedance(along, float(BODY.point(POSE, COVER, (PLACE, 0.0, 0.0)) @ along) + 0.04 * sign))
        for _ in range(400):
            rotation = BODY.cover_pose(world.q, COVER).rotation
            surface = (PLACE, *(WAM.covers.radius[1] * (rotation.T @ DOWN))[1:])
            rubbing = 0.3 * world.force(DOWN) * rotation[:, 0]
            world.hand = -rubbing @ BODY.point_jacobian(world.q, COVER, surface)
            out = world.step(task)
        found.append((world.force(DOWN), sign * out.rows[0][2]))
    assert found[0] == pytest.approx(found[1], rel=0.01)
    assert found[0][1] == pytest.approx(found[0][0], rel=0.1)
    assert found[0][0] > 5.0


@pytest.mark.parametrize(("sd", "is_known"), [(0.01, True), (0.8, False)])
def test_a_force_from_torques_that_are_known_badly_is_refused(sd: float, is_known: bool) -> None:
    """As one that is commanded alone."""
    world = Springs()
    world.loop.tune(replace(OWN, feedback="contact_estimate"))
    lever, still = world.lever(DOWN), State(POSE, REST, [1.0] * 4)
    contact = Contact(COVER, PLACE, (0.0, 0.0, 5.0), 0.001, 1.0, 0.1)
    external, task = (-5.0 * lever).tolist(), base(force(5.0))
    for _ in range(50):
        world.loop.step(ForceInput(still, DT, None, contact, external, [sd] * 4, task=task))
    assert (world.loop.event.code is Code.NONE) is is_known
    assert world.loop.event.values.get("part", "torques") == "torques"


@pytest.mark.parametrize("stiffness", [400.0, 4000.0, 10000.0])
def test_a_free_arm_follows_a_stiff_hand_without_oscillating(stiffness: float) -> None:
    world, task = Springs(), base(*joint_axes(AxisKind.IMPEDANCE, [None] * 4))
    start = BODY.point(world.q, COVER, (PLACE, 0.0, 0.0))
    goal, forces = start + np.array([0.0, 0.03, 0.02]), []
    for _ in range(250):
        pull = stiffness * (goal - BODY.point(world.q, COVER, (PLACE, 0.0, 0.0)))
        pull *= min(1.0, 20.0 / np.linalg.norm(pull))
        world.hand = BODY.point_jacobian(world.q, COVER, (PLACE, 0.0, 0.0)).T @ pull
        world.step(task)
        forces.append(float(np.linalg.norm(pull)))
    assert forces[-1] < 4.0
    assert np.all(np.diff(forces[60:]) < 0.02), "it yields more and more, and never comes back"


def test_the_stated_error_of_a_force_counts_the_friction_of_another_one_on_the_same_link() -> None:
    """Each force with friction of 0.3 across it, in every direction: the other one is measured as wrong as stated."""
    places, along, newtons = (0.33, 0.2), (np.array(DOWN), np.array(Y)), (12.0, 8.0)
    task = base(*(force(f, tuple(n), x) for f, n, x in zip(newtons, along, places, strict=True)))
    worst = np.zeros(2)
    for pressed in (0, 1):
        for angle in np.linspace(0.0, 2.0 * math.pi, 9):
            world, torque = Springs(), np.zeros(4)
            for i, (f, n, x) in enumerate(zip(newtons, along, places, strict=True)):
                across = np.cross(n, X)
                friction = 0.3 * f * (math.cos(angle) * np.array(X) + math.sin(angle) * across) if i == pressed else 0.0
                point = [x, 0.0, 0.0] + WAM.covers.radius[1] * (BODY.cover_pose(POSE, COVER).rotation.T @ n)
                torque += (f * n + friction) @ BODY.point_jacobian(POSE, COVER, tuple(point))
            world.hand = -torque
            rows = world.step(task).rows
            errors = [abs(row[2] - f) for row, f in zip(rows, newtons, strict=True)]
            worst = np.maximum(worst, [error / row[3] for error, row in zip(errors, rows, strict=True)])
    assert np.all(worst < 2.0)
    assert np.all(worst > 0.2), "nor is it stated as larger than it is"
    assert world.loop.event.code is Code.REFUSED, "and so it is not done"
    same = base(force(12.0), force(8.0, Y))
    assert Springs().step(same, 20).rows[0][3] < 0.1 * 12.0, "two axes at one place are one force"


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_a_task_feeds_the_torque_of_its_forces_forward_as_the_force_loop_does(share: float) -> None:
    """By the same parameter: on a free arm it is a throw, and the arm hits what it was to touch."""
    world = Springs()
    world.loop.tune(replace(OWN, force_feedforward=share, friction_feedforward=0.0))
    joint, lever = TaskAxis(AxisKind.FORCE, 2, value=0.5), world.lever(DOWN)
    effort = world.step(base(force(10.0), joint)).effort
    assert effort == pytest.approx(share * (10.0 * lever + [0.0, 0.0, 0.5, 0.0]), abs=1e-6)


def test_a_task_from_the_motors_feeds_the_torque_of_its_force_forward_after_the_touch() -> None:
    world = Springs()
    world.loop.tune(replace(OWN, feedback="contact_estimate"))
    lever, still = world.lever(DOWN), State(POSE, REST, [1.0] * 4)
    wound = 0.0  # by the velocity loops until then
    for touched, share in ((0.0, 0.0), (8.0, 1.0)):
        contact = Contact(COVER, PLACE, (0.0, 0.0, touched), 0.001, 1.0, 0.1) if touched else NO_CONTACT
        for _ in range(300):
            external = (-touched * lever).tolist()
            out = world.loop.step(ForceInput(still, DT, None, contact, external, task=base(force(10.0))))
            wound = wound or (out.known[0].force if any(out.effort) else 0.0)
        assert out.effort == pytest.approx((share * 10.0 - wound) * lever, rel=1e-2)
    assert wound == pytest.approx(8.0, rel=0.15), "what is pressed, but for the delay of its measurement"


def linear_loop(world: Springs, task: TaskCommand) -> tuple[StabilityGuard, GuardedTask, GuardedForces]:
    """What the guard considers of a task."""
    guard = StabilityGuard(WAM, SHARED.servo, SHARED.timing, GIVEN.guard, GIVEN.sensing_fed_back)
    world.step(task)
    axes = [one.now for one in world.loop._run.axes]
    (forces,) = world.loop.supervision._guarded(world.loop._pose.tolist(), axes, NO_CONTACT)
    assert isinstance(forces, GuardedForces)
    return guard, task_of_parameters(GIVEN), forces


def test_the_guard_considers_one_force_of_a_task_as_a_force_alone() -> None:
    guard, task, forces = linear_loop(Springs(), base(force(10.0)))
    assert min(guard.scales(task, [forces])) == pytest.approx(min(guard.scales(task, forces.contacts)), rel=0.01)


def test_the_guard_scales_the_spring_of_an_impedance_as_the_loop_does() -> None:
    guard, task, forces = linear_loop(Springs(), base(impedance(Y, stiffness=4000.0)))
    assert min(guard.scales(task, [forces], [0.1])) == 0.1


@pytest.mark.slow
def test_the_guard_considers_the_forces_of_a_task_together() -> None:
    """Its linear law is that of the task: joint velocities per torque of the world and per joint angle."""
    stiff = TaskAxis(AxisKind.IMPEDANCE, -1, COVER, PLACE, X, None, 0.0, 400.0, 100.0)
    task = base(force(10.0), stiff, position(None, Y, 0.1))
    _, _, forces = linear_loop(Springs(), task)
    still, held = np.array(settled(task, np.zeros(4), np.zeros(4))), forces.hold + forces.move @ forces.spring
    for joint in np.eye(4):
        torque, angle = 0.4 * joint, 0.005 * joint  # N m, rad
        expected = forces.move @ (forces.gain * (forces.sense @ torque))
        found = settled(task, torque, np.zeros(4)) - still
        assert -found == pytest.approx(expected, abs=4e-3)
        assert still - settled(task, np.zeros(4), angle) == pytest.approx(held @ angle, abs=4e-3)


def settled(task: TaskCommand, torque: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Joint velocities (4,), rad/s, of an arm that is kept at an angle, rad, from where the task began.

    It is pressed along both axes, so that no torque of these makes another side of the link the touched one.
    """
    world = Springs()
    world.loop.tune(replace(OWN, limits=replace(OWN.limits, impact=0.0), task=replace(OWN.task, deadband=0.0)))
    world.step(task)
    for _ in range(150):
        pressed = 9.0 * world.lever(DOWN) + 4.0 * world.lever(X)
        world.q, world.hand = np.array(POSE) + angle, -(torque + pressed)
        out = world.step(task)
    return np.array(out.velocity)


def test_a_line_is_held_while_the_link_slides_along_it() -> None:
    world = Springs(LEVEL)
    ends = [BODY.point(LEVEL, COVER, (s, 0.0, 0.0)) for s in (0.0, 0.4064)]
    u = (ends[1] - ends[0]) / 0.4064
    line = line_axes(WAM, COVER, tuple(ends[0].tolist()), tuple(u.tolist()))
    for direction in (0.05, -0.05):
        slide = TaskAxis(AxisKind.VELOCITY, -1, COVER, 0.2, tuple(u.tolist()), direction)
        world.step(base(*line[1:], slide), 120)
        for s in (0.0, 0.4064):  # both ends are on the line but for the part that is given up
            off = BODY.point(world.q, COVER, (s, 0.0, 0.0)) - ends[0]
            across = off - (off @ u) * u
            assert abs(across @ np.array(line[1].direction)) < 1e-3
            assert s == 0.0 or np.linalg.norm(across) < 1e-3
    begin = BODY.point(world.q, COVER, (0.0, 0.0, 0.0))
    world.step(base(*line), 50)
    assert BODY.point(world.q, COVER, (0.0, 0.0, 0.0)) == pytest.approx(begin, abs=0.02)


def refused(task: TaskCommand, q: list[float] = POSE) -> str:
    """Why a task is refused; the arm does not move."""
    world = Springs(q)
    world.step(task, 20)
    assert (world.loop.event.code, world.loop.event.holds) == (Code.REFUSED, True)
    assert world.q == pytest.approx(q, abs=1e-9)
    assert sentence(world.loop.refusals["task_command"]) == sentence(world.loop.event)
    return sentence(world.loop.event)


def test_axes_that_contradict_each_other_share_the_way_and_are_reported() -> None:
    world = Springs()
    y = float(BODY.point(POSE, COVER, (PLACE, 0.0, 0.0))[1])
    world.step(base(position(y, Y), position(y + 0.06, Y, PLACE + 1e-3)), 150)
    assert BODY.point(world.q, COVER, (PLACE, 0.0, 0.0))[1] - y == pytest.approx(0.03, abs=4e-3)
    assert [event.code for event in world.loop.events] == [Code.NOT_REACHED] * 2 or len(world.loop.events) == 1
    assert world.loop.event.code is Code.NOT_REACHED


@pytest.mark.parametrize("value", [TaskAxis(AxisKind.VELOCITY, -1, COVER, PLACE, X, 0.05), position(1.0, X)])
@pytest.mark.parametrize("pose", [[0.0, -1.8, 0.0, 1.2], [0.0, -math.pi / 2.0, 0.0, math.pi / 2.0]])
def test_a_motion_slows_down_and_stops_at_the_end_of_the_reach(value: TaskAxis, pose: list[float]) -> None:
    world, tips = Springs(pose), []
    for _ in range(1200):
        world.step(base(value))
        tips.append(BODY.point(world.q, COVER, (PLACE, 0.0, 0.0)))
    speeds = np.linalg.norm(np.diff(tips, axis=0), axis=1) / DT
    assert np.max(speeds) < 1.5 * OWN.task.speed_limit
    assert speeds[-1] < 0.02


def test_a_force_without_a_lever_is_refused() -> None:
    straight = [0.0, -1.0, 0.0, math.pi / 2.0]
    x, y, z = BODY.cover_pose(straight, COVER).rotation[:, 0].tolist()
    assert refused(base(force(5.0, (x, y, z), 0.4)), straight)


@pytest.mark.parametrize(("axis", "reason"), [
    (TaskAxis(AxisKind.IMPEDANCE, -1, COVER, PLACE, Y, None, 0.0, 0.0, 5.0), "damping is 5; allowed: .* 70"),
    (TaskAxis(AxisKind.IMPEDANCE, -1, COVER, PLACE, Y, None, 0.0, 5000.0, 100.0), "allowed: up to 800"),
    (TaskAxis(AxisKind.IMPEDANCE, 1, value=None, damping=0.5), "damping is 0.5; allowed: .*least_joint_damping, 5"),
    (TaskAxis(AxisKind.FORCE, 2, value=99.0), "99 N m is commanded; allowed: up to torque_limit, 40 N m"),
    (TaskAxis(AxisKind.FORCE, -1, COVER, PLACE, DOWN, 99.0), "99 N is commanded; allowed: up to force_limit"),
    (TaskAxis(AxisKind.VELOCITY, -1, COVER, PLACE, DOWN, 9.0), "9 m/s is commanded; allowed: .*0.5 m/s"),
])  # fmt: skip
def test_a_value_beyond_its_limit_is_refused_with_the_limit(axis: TaskAxis, reason: str) -> None:
    assert re.search(reason, refused(base(axis)))


def test_a_task_that_ends_leaves_the_arm_where_it_is() -> None:
    world = Springs()
    world.step(base(TaskAxis(AxisKind.VELOCITY, -1, COVER, PLACE, Y, 0.1)), 100)
    there = world.q.copy()
    world.step(None, 100)
    assert world.q == pytest.approx(there, abs=0.02)


def test_a_task_without_sensors_is_not_done() -> None:
    loop = ForceLoop(WAM, SHARED.servo, OWN, SHARED.timing)
    out = loop.step(ForceInput(State(POSE, REST, [1.0] * 4), DT, task=base(force(5.0))))
    assert out.rows == ()
    assert out.velocity == pytest.approx(REST)


def test_a_force_that_has_gone_to_zero_presses_no_more() -> None:
    world = Springs(springs={DOWN: 4000.0})
    world.step(base(force(10.0)), 100)
    world.springs, world.q = {}, world.q + 0.1
    world.step(base(force(0.0)), 2)
    world.step(None, 200)
    assert world.loop.tare() == "", "it has left what it touched"


def test_a_force_at_the_estimated_place_follows_the_estimate() -> None:
    world = Springs(springs={DOWN: 4000.0}, place=0.15)
    task = base(force(10.0, place=None))
    contact = Contact(COVER, 0.15, (0.0, 0.0, 10.0), 0.005, 1.0, 0.1)
    world.step(task, 150, contact=contact)
    assert world.force(DOWN) == pytest.approx(10.0, rel=0.02)
    elsewhere = Springs(springs={DOWN: 4000.0}, place=0.15)
    elsewhere.step(base(force(10.0)), 150, contact=contact)
    assert abs(elsewhere.force(DOWN) - 10.0) > 1.0, "another place gives another force"


def test_another_link_that_is_touched_stops_the_task() -> None:
    world, task = Springs(), base(force(5.0))
    world.step(task, 5)
    world.hand = BODY.point_jacobian(POSE, "inner_link", (0.4, 0.0, 0.0)).T @ np.array([0.0, 30.0, 0.0])
    world.step(task, 60, contact=Contact("inner_link", 0.4, (0.0, 30.0, 0.0), 0.01, 1.0, 0.1))
    holding = [event for event in world.loop.events if event.holds]
    assert [event.code for event in holding] == [Code.UNEXPLAINED]
    assert holding[0].values["touched"] == "inner_link"


def test_joint_torques_are_axes_too() -> None:
    """Each joint against a spring of 200 N m/rad."""
    world, wanted = Springs(), [2.0, -1.0, 0.5, 1.5]
    start = world.q.copy()
    for _ in range(300):
        world.hand = -200.0 * (world.q - start)
        world.step(base(*joint_axes(AxisKind.FORCE, wanted)))
    assert 200.0 * (world.q - start) == pytest.approx(wanted, rel=0.02)


@pytest.mark.slow
def test_a_joint_torque_that_nothing_takes_is_reported_in_time() -> None:
    """The joint turns on until its end, which is far."""
    world, wanted, late = Springs(), [0.0, 1.0, 0.0, 0.0], round(OWN.limits.settling_time / DT)
    world.step(base(*joint_axes(AxisKind.FORCE, wanted)), late - 5)
    assert world.loop.event.code is Code.NONE
    world.step(base(*joint_axes(AxisKind.FORCE, wanted)), 10)
    assert world.loop.event.code is Code.NOT_REACHED
    assert world.loop.event.values["axis"] == "torque of joint 2"
    spring = world.q.copy()
    for _ in range(300):
        world.hand = -200.0 * (world.q - spring)
        world.step(base(*joint_axes(AxisKind.FORCE, wanted)))
    assert world.loop.event.code is Code.NONE


def blocked(task: TaskCommand, seconds: float = 1.5, joint: int = 3) -> ForceLoop:
    """The loop after a task while one joint does not move."""
    world = Springs()
    for _ in range(round(seconds / DT)):
        world.step(task)
        world.q[joint] = POSE[joint]
    return world.loop


@pytest.mark.parametrize("axis", [TaskAxis(AxisKind.POSITION, 3, value=1.2), TaskAxis(AxisKind.VELOCITY, 3, value=0.2)])
def test_a_motion_of_a_task_that_is_blocked_is_reported(axis: TaskAxis) -> None:
    found = blocked(base(axis)).event
    assert (found.code, found.values["axis"]) == (Code.NOT_REACHED, axis.name)
    assert blocked(base(axis), joint=0).event.code is Code.NONE


@pytest.mark.slow
@pytest.mark.parametrize("direction", [X, Y, Z])
def test_a_motion_of_a_point_is_reported_only_if_it_is_not_done(direction: Triple) -> None:
    slide = TaskAxis(AxisKind.VELOCITY, -1, COVER, PLACE, direction, -0.05)
    for axis in (slide, position(float(BODY.point(POSE, COVER, (PLACE, 0.0, 0.0)) @ direction) - 0.05, direction)):
        world = Springs()
        world.step(base(axis), 300)
        assert world.loop.event.code is Code.NONE
        for _ in range(300):
            world.step(base(axis))
            world.q = np.array(POSE)
        assert world.loop.event.code is Code.NOT_REACHED


@pytest.mark.parametrize(("speed", "code"), [(0.4, Code.NONE), (0.8, Code.AT_LIMIT)])
def test_a_position_that_moves_faster_than_its_axis_is_not_followed(speed: float, code: Code) -> None:
    world, begin = Springs(), float(BODY.point(POSE, COVER, (PLACE, 0.0, 0.0))[1])
    for k in range(60):
        world.step(base(position(begin - speed * k * DT, Y)._replace(rate=-speed)))
    assert world.loop.event.code is code


def test_a_motion_that_needs_a_joint_faster_than_it_may_be_is_not_reached() -> None:
    world = Springs()
    world.loop.tune(replace(OWN, joint_speed_limit=0.5))
    world.step(base(TaskAxis(AxisKind.VELOCITY, 0, value=1.0)), 300)
    assert world.loop.event.code is Code.NOT_REACHED


TASK = TaskCommand(
    "base",
    (
        force(10.0),
        position(None, X),
        TaskAxis(AxisKind.IMPEDANCE, 2, value=0.1, rate=0.1, stiffness=4.0, damping=6.0),
        force(3.0, Y, None),
    ),
)


def test_a_task_is_the_same_after_it_was_a_table() -> None:
    assert task_of(table_of(TASK, WAM.covers.names), WAM) == TASK
    assert table_of(None, WAM.covers.names).rows == ()
    assert task_of(Table("base", ()), WAM) is None


@pytest.mark.parametrize(("column", "value", "reason"), [
    (0, 9.0, "kind is 9; allowed: 1 force"),
    (1, 0.0, "joint is 0, cover 'outer_link'.*give a joint alone, 0 to 3, or"),
    (2, 7.0, "link is 7; allowed: 0 to 1"),
    (3, 2.0, "contact_position is 2.0 m; allowed: 0 to 0.4064"),
    (6, 0.0, "along is .*; give a direction that is not zero"),
    (8, math.nan, "rate is nan; it must be a finite number"),
    (7, math.nan, "value is not a number"),
    (8, 0.1, "rate is 0.1; it is for a position"),
    (9, 5.0, "stiffness and damping are for an impedance only"),
])  # fmt: skip
def test_a_row_that_is_none_is_refused_with_what_is_allowed(column: int, value: float, reason: str) -> None:
    row = list(table_of(base(force(10.0)), WAM.covers.names).rows[0])
    row[column] = value
    with pytest.raises(ParameterError, match=reason):
        task_of(Table("base", (tuple(row),)), WAM)


def test_a_position_along_an_axis_that_turns_is_refused() -> None:
    with pytest.raises(ParameterError, match="turns with it"):
        task_of(table_of(TaskCommand(COVER, (position(0.0, Y),)), WAM.covers.names), WAM)
