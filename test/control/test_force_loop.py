"""The outer loop on a world that is computed here: the arm follows its velocity command, springs push back."""

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from wam_control.force.force_loop import ForceCommand, ForceLoop, ForceLoopParameters, ForceOutput
from wam_control.force.task import AxisKind, TaskAxis, TaskCommand
from wam_control.force.torque_watch import TorqueWatch
from wam_control.task.motion import GoalMotion
from wam_description.arm import Arm
from wam_description.configuration import Configuration, packaged
from wam_description.event import Code
from wam_description.event_text import sentence
from wam_description.parameters import ParameterError, build, values
from wam_description.rigid_body import RigidBody
from wam_description.signals import NO_CONTACT, Contact, State

CONFIGURATION = Configuration.load(packaged("wam"))
ARM = CONFIGURATION.shared.arm
BODY = RigidBody(ARM)
GAIN, LIMIT = 0.015, 20.0
PACKAGED = CONFIGURATION.node("force_loop", ForceLoopParameters)
GIVEN = replace(
    PACKAGED,
    sensing=replace(
        PACKAGED.sensing,
        torque_sd=0.1,
        torque_fraction=0.0,
        zero_limit=0.0,
        force_sd_limit=1.5,
        force_sd_fraction=0.15,
        reported_fraction=0.1,
    ),
)
OWN = replace(
    GIVEN,
    guard=replace(GIVEN.guard, mode="off"),
    sensing=replace(GIVEN.sensing, force_sd_limit=1e9, apparent_mass_limit=0.0),
    limits=replace(GIVEN.limits, joint_gain=0.0, contact_force=1e9, impact=0.0, settling_time=1e9, free_travel=1e9),
    force_gain=(GAIN,),
    force_error_limit=(LIMIT,),
    force_limit=1e3,
    torque_limit=1e3,
    torque_gain=(0.02,),
    force_filter=0.0,
    blend_time=0.0,
)
COVER, PLACE = OWN.contact_cover, OWN.contact_position
POSE = [0.3, -1.2, 0.2, 1.0]
DOWN = (0.0, 0.0, -1.0)
DT = 5e-3
STILL = [0.0] * 4
DRIVEN = [1.0] * 4  # N m: the motors give torque


def force_loop(arm: Arm, own: ForceLoopParameters) -> ForceLoop:
    return ForceLoop(arm, CONFIGURATION.shared.servo, own, CONFIGURATION.shared.timing)


def lever(q: list[float], n: Any = DOWN, cover: str = COVER, place: float = PLACE) -> np.ndarray:
    """Joint torques per newton along n at a point, from finite differences of where the point is."""
    h = 1e-6
    columns = []
    for i in range(4):
        more, less = list(q), list(q)
        more[i] += h
        less[i] -= h
        point = (place, *ARM.covers.aside(cover, place))
        columns.append((BODY.point(more, cover, point) - BODY.point(less, cover, point)) / (2 * h))
    return np.array(n) @ np.array(columns).T


class World:
    """Arm with ideal velocity servos in front of a spring of stiffness k, N/m, along n, base frame."""

    def __init__(self, stiffness: float, n: Any = DOWN, q: list[float] = POSE, force: float = 0.0) -> None:
        self.stiffness, self.n, self.q = stiffness, np.array(n), list(q)
        self._surface = self.n @ BODY.point(self.q, COVER, (PLACE, 0, 0)) - force / stiffness

    @property
    def force(self) -> float:
        """Force of the arm on the world along n, N."""
        return float(self.stiffness * (self.n @ BODY.point(self.q, COVER, (PLACE, 0, 0)) - self._surface))

    @property
    def sensors(self) -> State:
        strain = BODY.gravity_torque(self.q) + lever(self.q, self.n) * self.force
        return State(self.q, STILL, strain.tolist())

    @property
    def joints(self) -> State:
        return State(list(self.q), STILL, DRIVEN)

    def move(self, velocity: list[float], dt: float = DT) -> None:
        self.q = [a + b * dt for a, b in zip(self.q, velocity, strict=True)]


def ask(loop: ForceLoop, world: World, force: Any, dt: float = DT, **more: Any) -> ForceOutput:
    command = None if force is None else ForceCommand("base", tuple(float(f) for f in force))
    given: dict[str, Any] = {"contact": NO_CONTACT, "external": None, "posture": None, "torque": None, **more}
    return loop.step(
        world.joints,
        world.sensors,
        given["contact"],
        given["external"],
        given.get("command", command),
        given["posture"],
        given["torque"],
        dt,
        external_sd=given.get("external_sd"),
    )


def down(newtons: float) -> tuple[float, float, float]:
    return (0.0, 0.0, -newtons)


@pytest.mark.slow
@pytest.mark.parametrize("stiffness", [200.0, 800.0])
def test_force_comes_with_the_time_constant_of_equation_5_2(stiffness: float) -> None:
    loop, world, dt = force_loop(ARM, OWN), World(stiffness, force=1.0), 2e-4
    time_constant = 1.0 / (GAIN * stiffness)
    worst = 0.0
    for k in range(round(3.0 * time_constant / dt)):
        expected = 8.0 - 7.0 * math.exp(-k * dt / time_constant)
        worst = max(worst, abs(world.force - expected))
        world.move(ask(loop, world, down(8.0), dt).velocity, dt)
    assert worst < 0.01 * 7.0
    assert world.force == pytest.approx(8.0 - 7.0 * math.exp(-3.0), rel=0.005)


@pytest.mark.slow
def test_force_converges_to_the_commanded_one() -> None:
    loop, world = force_loop(ARM, replace(OWN, force_filter=0.02)), World(400.0)
    for newtons in (5.0, 10.0, 5.0):
        for _ in range(600):
            out = ask(loop, world, down(newtons))
            world.move(out.velocity)
        assert world.force == pytest.approx(newtons, abs=1e-4)
        assert out.measured == pytest.approx(down(newtons), abs=1e-4)
        assert out.error == pytest.approx((0.0, 0.0, 0.0), abs=1e-4)


@pytest.mark.parametrize(("commanded", "limited"), [(100.0, LIMIT), (-90.0, -LIMIT), (7.0, 7.0), (20.0, 20.0)])
def test_saturation_limits_the_commanded_speed_exactly(commanded: float, limited: float) -> None:
    out = ask(force_loop(ARM, OWN), World(400.0), down(commanded))
    along = lever(POSE)
    assert along @ out.velocity == pytest.approx(GAIN * limited, rel=1e-7)
    assert out.error == pytest.approx(down(commanded), rel=1e-7)
    assert out.limited == pytest.approx(down(limited), rel=1e-7)
    free = replace(OWN, force_error_limit=(1e9,), joint_speed_limit=1e9)
    unlimited = ask(force_loop(ARM, free), World(400.0), down(commanded))
    assert along @ unlimited.velocity == pytest.approx(GAIN * commanded, rel=1e-7)


def test_a_short_lever_does_not_make_a_joint_race() -> None:
    """Straight up, a force along the arm has hardly a lever on any joint: what is sensed there is the arm's inertia."""
    upright = [0.0, -2e-3, 0.0, math.pi / 2 - 5e-3]
    fastest = []
    for mass in (2.0, 0.0):
        sensing = replace(OWN.sensing, apparent_mass_limit=mass)
        controller = force_loop(ARM, replace(OWN, contact_position=0.4, joint_speed_limit=1e9, sensing=sensing))
        state = State(upright, [0.0] * 4, DRIVEN)
        sensed = State(upright, [0.0] * 4, BODY.gravity_torque(upright).tolist())
        press = ForceCommand("base", (0.0, 0.0, 20.0))
        out = controller.step(state, sensed, NO_CONTACT, None, press, upright, None, 0.005)
        fastest.append(max(map(abs, out.velocity)))
    assert fastest[0] < 0.2
    assert fastest[1] > 10.0 * OWN.joint_speed_limit, "without the limit of the apparent mass"


def test_posture_moves_nothing_along_the_force() -> None:
    along = lever(POSE)
    for posture in (POSE, [0.5, -1.0, 0.0, 1.2], [-2.0, 1.0, 1.0, -1.0]):
        out = ask(force_loop(ARM, OWN), World(400.0), down(6.0), posture=posture)
        assert along @ out.velocity == pytest.approx(GAIN * 6.0, rel=1e-7)


@pytest.mark.slow
def test_posture_is_reached_in_the_complement_of_the_force() -> None:
    posture = [0.35, -1.15, 0.25, 1.1]
    loop, world = force_loop(ARM, OWN), World(400.0)
    for _ in range(1500):
        world.move(ask(loop, world, down(6.0), posture=posture).velocity)
    assert world.force == pytest.approx(6.0, abs=1e-3)
    missing = np.subtract(posture, world.q)
    along = lever(world.q)
    along /= np.linalg.norm(along)
    assert np.linalg.norm(missing) > 0.01, "the force has moved the arm off the posture"
    assert np.linalg.norm(missing - along * (along @ missing)) < 1e-4, "the lever has turned a little on the way"


def test_posture_alone_is_reached_no_faster_than_allowed() -> None:
    loop, world = force_loop(ARM, OWN), World(1e-9)
    posture = [0.3, -0.2, 0.2, 1.3]
    speeds = []
    for _ in range(600):
        velocity = ask(loop, world, None, posture=posture).velocity
        speeds.append(max(map(abs, velocity)))
        world.move(velocity)
    assert world.q == pytest.approx(posture, abs=1e-6)
    assert max(speeds) == OWN.joint_speed_limit


def test_zero_force_releases_the_axis() -> None:
    posture = [0.3, -1.1, 0.2, 1.0]
    outs = [
        ask(force_loop(ARM, OWN), World(400.0, force=3.0), force, posture=posture)
        for force in ((0.0, 0.0, 0.0), None, down(3.0))
    ]
    released, none, pressing = outs
    assert released == none
    assert released.velocity == pytest.approx([OWN.posture_gain * (a - b) for a, b in zip(posture, POSE, strict=True)])
    assert released.effort == [0.0] * 4
    assert pressing.velocity != pytest.approx(released.velocity)


def test_no_motion_is_commanded_at_the_start() -> None:
    assert ask(force_loop(ARM, OWN), World(400.0), None).velocity == [0.0] * 4
    out = ask(force_loop(ARM, OWN), World(400.0, force=4.0), down(4.0))
    assert out.velocity == pytest.approx([0.0] * 4, abs=1e-9), "the filter starts at what is measured"
    slow = force_loop(ARM, replace(OWN, force_filter=10.0))
    assert ask(slow, World(400.0, force=4.0), down(4.0)).measured == pytest.approx(down(4.0), rel=1e-6)


def test_the_filter_is_a_first_order_lag() -> None:
    loop = force_loop(ARM, replace(OWN, force_filter=0.1))
    ask(loop, World(400.0, force=0.0), down(1.0), dt=1e-3)
    for _ in range(100):
        out = ask(loop, World(400.0, force=4.0), down(1.0), dt=1e-3)
    assert -out.measured[2] == pytest.approx(4.0 * (1.0 - math.exp(-1.0)), rel=0.01)


def test_open_loop_feeds_the_torque_of_the_force_forward_and_no_velocity() -> None:
    loop, force = force_loop(ARM, replace(OWN, mode="open_loop")), np.array([2.0, -3.0, 6.0])
    for feeling in (0.0, 5.0):
        out = ask(loop, World(400.0, force=feeling), force)
        assert out.velocity == []
        expected = sum(component * lever(POSE, axis) for component, axis in zip(force, np.eye(3), strict=True))
        assert out.effort == pytest.approx(expected, abs=1e-6)
    assert ask(loop, World(400.0), None).velocity == []


def test_the_feedback_loop_feeds_no_torque_of_the_force_forward() -> None:
    """On a free arm the velocity loop would have to take it back, and until then it throws the arm at the surface."""
    own = replace(OWN, friction_feedforward=0.0)
    assert not any(ask(force_loop(ARM, own), World(400.0, force=2.0), (1.0, 2.0, 3.0)).effort)


@pytest.mark.parametrize("share", [0.7, 0.3])
def test_a_share_of_the_dry_friction_is_fed_forward_along_the_commanded_motion(share: float) -> None:
    """Or the velocity loop winds up through twice the friction before an error of the force changes it."""
    own = replace(OWN, friction_feedforward=share, posture_gain=0.0)
    ratio = np.linalg.inv(np.reshape(ARM.joint_from_motor, (4, 4)))
    for commanded in (8.0, -8.0):
        out = ask(force_loop(ARM, own), World(400.0), down(commanded))
        velocity = np.array(out.velocity)
        motors = ratio.T @ (np.array(ARM.motors.dynamic_friction) * np.tanh(ratio @ velocity / 0.04))
        joints = np.array(ARM.joints.dynamic_friction) * np.tanh(velocity / 0.002)
        assert out.effort == pytest.approx(share * (motors + joints))
        assert np.abs(out.effort).max() > 0.5, "N m"
    dithered = replace(own, feedback="contact_estimate")
    assert not any(ask(force_loop(ARM, dithered), World(400.0), down(8.0), external=STILL).effort)


@pytest.mark.slow
def test_joint_torques_converge_in_a_world_of_joint_springs() -> None:
    loop = force_loop(ARM, replace(OWN, mode="joint_torque"))
    stiffness, commanded = np.array([40.0, 60.0, 30.0, 20.0]), [1.0, -2.0, 0.5, 0.8]
    world = World(1e-9)
    for _ in range(4000):
        external = -stiffness * np.subtract(world.q, POSE)
        sensors = State(world.q, STILL, (BODY.gravity_torque(world.q) - external).tolist())
        out = loop.step(world.joints, sensors, NO_CONTACT, None, None, None, commanded, DT)
        assert out.effort == STILL, "nothing is fed forward: on a free arm it would be a throw"
        world.move(out.velocity)
    assert stiffness * np.subtract(world.q, POSE) == pytest.approx(commanded, rel=1e-3)
    assert loop.reaction.code is Code.NONE


LATE = 200  # periods of the settling time
WATCHING = replace(OWN, mode="joint_torque", limits=replace(OWN.limits, settling_time=LATE * DT))


def reactions(torques: list[float], taken: list[float], sd: float = 0.0) -> list[Code]:
    """Of a joint in each period, while its commanded and measured torque, N m, are these."""
    watch, sensing = TorqueWatch("joint2"), replace(OWN.sensing, reported_fraction=0.1)
    own = replace(WATCHING, sensing=sensing)
    return [watch.step(a, b, sd, own, DT)[0] for a, b in zip(torques, taken, strict=True)]


@pytest.mark.parametrize("taken", [0.0, 1.5])
def test_a_joint_torque_that_is_not_reached_is_reported_in_time(taken: float) -> None:
    loop = force_loop(ARM, WATCHING)
    external = [0.0, taken, 0.0, 0.0]
    sensors = State(POSE, STILL, (BODY.gravity_torque(POSE) - external).tolist())
    for period in range(LATE + 3):
        loop.step(World(1e-9).joints, sensors, NO_CONTACT, None, None, None, [0.0, -1.0, 0.0, 0.0], DT)
        assert period > LATE - 2 or loop.reaction.code is Code.NONE
    assert loop.reaction.code is Code.NOT_REACHED
    assert f"joint2: {-taken + 0.0:.2g} N m are measured and -1 N m commanded; the torque has been off" in sentence(
        loop.reaction
    )


def test_a_joint_torque_that_is_not_reached_is_reported_next_to_one_that_is_uncertain_and_a_joint_at_its_end() -> None:
    sensing = replace(OWN.sensing, torque_sd=0.04)
    limits = replace(WATCHING.limits, joint_gain=PACKAGED.limits.joint_gain)
    loop = force_loop(ARM, replace(WATCHING, sensing=sensing, limits=limits))
    pose = [*POSE[:3], ARM.joints.upper[3] - limits.joint_margin]
    sensors = State(pose, STILL, (BODY.gravity_torque(pose) - np.array([0.0, 0.0, -0.3, 0.0])).tolist())
    for _ in range(LATE + 3):
        loop.step(State(pose, STILL, DRIVEN), sensors, NO_CONTACT, None, None, None, [0.0, 0.0, 0.3, 2.0], DT)
    assert list(loop.reactions) == [
        Code.NOT_REACHED,
        Code.UNCERTAIN,
        Code.JOINT_END,
    ]
    assert loop.reaction == next(iter(loop.reactions.values()))
    who = [event.values.get("joint", event.values.get("axis")) for event in loop.reactions.values()]
    assert who == ["joint4", "joint3", "joint4"]


TIME = np.arange(0.0, 12.0, DT)


@pytest.mark.parametrize(
    ("torques", "taken"),
    [
        (2.0 + 0.0 * TIME, 0.0 * TIME),
        (np.where(TIME % 2.0 < 1.0, 2.0, 1.5), 0.0 * TIME),
        (4.0 * np.sin(2.0 * math.pi * 0.3 * TIME), 0.0 * TIME),
        (np.minimum(0.4 * TIME, 4.0), 0.0 * TIME),
        (2.0 + 0.0 * TIME, 0.3 * np.random.default_rng(1).normal(size=len(TIME))),
        (1.5 + 0.0 * TIME, 1.5 + 1.8 * np.sin(2.0 * math.pi * 0.7 * TIME)),  # a limit cycle
        (0.0 * TIME, 3.0 + 0.0 * TIME),  # a push on a joint that is to give way
    ],
)
def test_a_joint_torque_that_is_not_taken_is_reported_whatever_the_command_does(
    torques: np.ndarray, taken: np.ndarray
) -> None:
    found = reactions(torques.tolist(), taken.tolist(), 0.02)
    assert Code.NOT_REACHED not in found[: LATE - 2]
    assert found[3 * LATE :] == [Code.NOT_REACHED] * (len(found) - 3 * LATE)


def test_a_joint_torque_that_is_right_is_not_reported_and_no_more_once_it_is() -> None:
    varying = 2.0 + 0.5 * np.sin(2.0 * math.pi * 0.5 * TIME)
    noisy = varying + 0.1 * np.random.default_rng(2).normal(size=len(TIME))
    assert set(reactions(varying.tolist(), noisy.tolist(), 0.05)) == {Code.NONE}
    later = np.where(np.arange(len(TIME)) < 2 * LATE, 0.0, 2.0)
    found = reactions([2.0] * len(TIME), later.tolist(), 0.02)
    back = 2 * LATE + LATE // 4
    assert found[2 * LATE] is Code.NOT_REACHED
    assert set(found[back:]) == {Code.NONE}


def test_a_joint_torque_that_is_not_known_well_enough_is_reported() -> None:
    for torque, reaction in ((12.0, Code.NONE), (6.0, Code.UNCERTAIN)):
        assert reactions([torque] * LATE, [torque] * LATE, 1.0)[-1] is reaction


def test_torques_at_rest_of_an_undeclared_mass_are_no_torques_of_the_joints() -> None:
    """Of 0.5 kg at the tool; the arm was elsewhere before, and had no contact."""
    weight = BODY.tool_jacobian(POSE).T @ np.array([0.0, 0.0, -0.5 * 9.81])
    loop = force_loop(ARM, replace(WATCHING, sensing=replace(OWN.sensing, zero_limit=0.5)))
    sensors = State(POSE, STILL, (BODY.gravity_torque(POSE) - weight).tolist())
    for torque in (None, [0.0, 0.0, 0.0, 2.0]):
        for _ in range(LATE):
            out = loop.step(World(1e-9).joints, sensors, NO_CONTACT, None, None, None, torque, DT)
    assert loop.reaction.code is Code.NOT_SENSED
    assert "as with 0.5 kg at the tool" in sentence(loop.reaction)
    assert out.velocity == STILL


def test_a_command_that_has_no_effect_in_a_mode_is_refused() -> None:
    loop = force_loop(ARM, WATCHING)
    moved = [angle + 0.05 for angle in POSE]
    for given, refused in (
        ({"posture": POSE, "torque": [1.0, 0.0, 0.0, 0.0]}, set()),
        ({"posture": POSE}, set()),
        ({"posture": moved}, {"joint_posture_command"}),
        ({"posture": moved}, {"joint_posture_command"}),  # until it ends
        ({}, set()),
        ({"command": ForceCommand("base", down(5.0))}, {"force_command"}),
        ({"command": ForceCommand("base", down(0.0))}, set()),
    ):
        ask(loop, World(400.0), None, **given)
        assert set(loop.refusals) == refused
    hybrid = force_loop(ARM, OWN)
    ask(hybrid, World(400.0), None, torque=[1.0, 0.0, 0.0, 0.0], posture=moved)
    why = "joint_torque_command has no effect in the mode hybrid; set force_loop:mode to joint_torque, or end the"
    assert sentence(hybrid.refusals["joint_torque_command"]).startswith(why)


MOVED = [angle + 0.05 for angle in POSE]


@pytest.mark.parametrize("mode", ["joint_torque", "open_loop"])
def test_a_posture_in_a_mode_that_follows_none_is_refused_if_the_arm_would_have_to_move(mode: str) -> None:
    for first in (POSE, MOVED):
        loop = force_loop(ARM, replace(WATCHING, mode=mode))
        ask(loop, World(400.0), None)
        for posture in (first, MOVED):
            out = ask(loop, World(400.0), None, posture=posture)
            assert not any(out.velocity)
            refusals = {topic: sentence(event) for topic, event in loop.refusals.items()}
            refusal = refusals.get("joint_posture_command", "")
            why = f"joint_posture_command has no effect in the mode {mode}; set force_loop:mode to hybrid, or end"
            assert refusal.startswith(why) if posture is MOVED else not refusal


@pytest.mark.parametrize("mode", ["joint_torque", "open_loop"])
def test_a_posture_that_is_set_to_where_the_arm_is_does_not_ask_for_a_motion(mode: str) -> None:
    """As a scenario does after a force, and with the last increment of a motion before a torque."""
    loop, world = force_loop(ARM, replace(WATCHING, mode=mode)), World(400.0)
    postures = [*[POSE] * 20, *[[POSE[0] + 0.2, *POSE[1:]]] * 20]
    for k, posture in enumerate(postures):
        q = [POSE[0] + 0.01 * k, *POSE[1:]]  # turned by the torques
        joints = world.joints._replace(position=q)
        loop.step(joints, world.sensors, NO_CONTACT, None, None, posture, None, DT)
        assert "joint_posture_command" not in loop.refusals


def test_with_a_task_other_commands_are_refused_as_far_as_it_leaves_nothing_for_them() -> None:
    force = ForceCommand("base", down(5.0))
    for count, refused in ((3, {"force_command"}), (4, {"force_command", "joint_posture_command"})):
        axes = tuple(TaskAxis(AxisKind.POSITION, k, value=None) for k in range(count))
        loop = force_loop(ARM, OWN)
        for posture in (POSE, MOVED):
            world = World(400.0)
            loop.step(
                world.joints, world.sensors, NO_CONTACT, None, force, posture, None, DT, TaskCommand("base", axes)
            )
        assert set(loop.refusals) == refused
        text = f"force_command has no effect with a task of {count} axes on 4 joints; end one of them"
        assert sentence(loop.refusals["force_command"]) == text


@pytest.mark.parametrize(("speed", "is_late"), [(1.0, False), (1.2, False), (1.3, True)])
def test_a_posture_that_moves_faster_than_the_arm_follows_is_reported(speed: float, is_late: bool) -> None:
    loop, world = force_loop(ARM, replace(OWN, joint_speed_limit=0.5)), World(1e-9)
    found = []
    for k in range(200):
        posture = [POSE[0] + 0.5 * speed * DT * k, *POSE[1:]]
        world.move(ask(loop, world, None, posture=posture).velocity)
        found.append(loop.reaction.code)
    assert set(found) == {Code.NONE, *([Code.NOT_FOLLOWED] if is_late else [])}
    assert ("joint1 with 0.65 rad/s; allowed: joint_speed_limit, 0.5 rad/s" in sentence(loop.reaction)) is is_late


@pytest.mark.slow
def test_a_force_that_its_rate_limit_keeps_from_the_command_is_reported() -> None:
    limits = replace(OWN.limits, settling_time=0.5)
    loop, world = force_loop(ARM, replace(OWN, limits=limits, force_rate_limit=2.0)), World(400.0)
    found, way = [], "; the set point is {} N on its way to the command, 4 N, at force_rate_limit, 2 N/s: raise that"
    for _ in range(round(4.0 / DT)):
        world.move(ask(loop, world, down(4.0)).velocity)
        found.append(loop.reactions)
    late = [Code.NOT_REACHED in one for one in found]
    assert late.index(True) == pytest.approx(0.5 / DT, abs=2)
    assert sentence(found[late.index(True)][Code.NOT_REACHED]).startswith(way.format("1")[2:])
    assert not any(late[round(2.0 / DT) :]), "the set point is the command"
    loop.step(world.joints, world.sensors, NO_CONTACT, None, ForceCommand("base", down(60.0)), None, None, DT)
    assert all("on its way to the command, 60 N" in sentence(event) for event in loop.reactions.values())
    turning = replace(OWN, mode="joint_torque", limits=limits, torque_rate_limit=1.0)
    loop = force_loop(ARM, turning)
    for _ in range(round(0.6 / DT)):
        loop.step(world.joints, world.sensors, NO_CONTACT, None, None, None, [0.0, -2.0, 0.0, 0.0], DT)
    assert "to the command, 2 N m, at torque_rate_limit, 1 N m/s" in sentence(loop.reactions[Code.NOT_REACHED])


@pytest.mark.parametrize(
    ("gain", "way", "is_free", "is_short"),
    [(8.0, 0.9, True, False), (4.0, 0.9, True, False), (0.5, 0.9, True, True), (0.0, 0.9, True, True),
     (8.0, 0.9, False, True), (0.0, 0.04, True, False)],
)  # fmt: skip
def test_a_posture_that_is_not_reached_is_reported(gain: float, way: float, is_free: bool, is_short: bool) -> None:
    loop, world = force_loop(ARM, replace(OWN, posture_gain=gain)), World(1e-9)
    motion = GoalMotion(POSE, [POSE[0], POSE[1] + way, *POSE[2:]], 1.0)
    for k in range(round(1.0 / DT) + 1):
        velocity = ask(loop, world, None, posture=motion.at(k * DT).position).velocity
        if is_free:
            world.move(velocity)
    assert (loop.reaction.code is Code.NOT_REACHED) is is_short
    if is_short:
        name, advice = ARM.joints.names[1], f"raise force_loop:posture_gain, {gain:g} 1/s"
        assert re.match(
            rf"{name} is \S+ rad away from the commanded posture; allowed: \S+ rad, 0.05 rad", sentence(loop.reaction)
        )
        assert advice in sentence(loop.reaction)
    ask(loop, world, down(6.0), posture=motion.at(2.0).position)
    assert "posture" not in sentence(loop.reaction), "a force moves the arm away from it"


def test_under_the_brakes_neither_a_posture_nor_a_force_is_late() -> None:
    limits = replace(OWN.limits, settling_time=0.1)
    loop, world = force_loop(ARM, replace(OWN, limits=limits, force_rate_limit=1.0)), World(1e-9)
    goal = [POSE[0], POSE[1] + 1.0, *POSE[2:]]
    braked = world.joints._replace(effort=[0.0] * 4)
    for _ in range(round(0.5 / DT)):
        loop.step(braked, world.sensors, NO_CONTACT, None, ForceCommand("base", down(6.0)), goal, None, DT)
        assert Code.NOT_REACHED not in loop.reactions
    for _ in range(5):
        ask(loop, world, None, posture=goal)
        assert loop.reaction.code is Code.NONE


def test_a_posture_that_is_set_at_once_is_reached_as_fast_as_the_arm_may_go() -> None:
    loop, world, goal = force_loop(ARM, OWN), World(1e-9), [POSE[0], POSE[1] + 1.2, *POSE[2:]]
    for _ in range(round(2.0 / DT)):
        world.move(ask(loop, world, None, posture=goal).velocity)
        assert loop.reaction.code is Code.NONE
    assert world.q == pytest.approx(goal, abs=1e-3)


def test_joint_torque_error_is_limited_and_posture_is_held_without_a_command() -> None:
    loop = force_loop(ARM, replace(OWN, mode="joint_torque"))
    assert ask(loop, World(1e-9), None).velocity == [0.0] * 4
    out = ask(loop, World(1e-9), None, torque=[100.0, -100.0, 1.0, 0.0])
    (limit,), (gain,) = OWN.torque_error_limit, OWN.torque_gain
    assert out.velocity == pytest.approx([gain * limit, -gain * limit, gain, 0.0], abs=1e-9)


@pytest.mark.slow
def test_a_stale_force_command_is_dropped_and_the_arm_holds_its_position() -> None:
    loop, world = force_loop(ARM, OWN), World(400.0)
    for _ in range(1500):
        world.move(ask(loop, world, down(6.0), posture=POSE).velocity)
    pressed = list(world.q)
    assert world.force == pytest.approx(6.0, abs=1e-3)
    assert not any(ask(loop, world, None, posture=[0.5, 0.0, 0.0, 0.0]).effort)
    out = ask(loop, world, None, posture=[0.5, 0.0, 0.0, 0.0])
    assert out.velocity == pytest.approx([0.0] * 4, abs=1e-9)  # holds here, not at the posture of old
    assert world.q == pressed
    again = ask(loop, world, down(6.0), posture=[0.5, 0.0, 0.0, 0.0])
    assert max(map(abs, again.velocity)) > 0.03


def test_after_a_stale_command_the_arm_is_pulled_back_to_where_the_command_ended() -> None:
    loop, world = force_loop(ARM, OWN), World(400.0)
    ask(loop, world, down(6.0))
    ask(loop, world, None)
    world.q = [angle + 0.01 for angle in POSE]  # pushed away
    for _ in range(3):
        out = ask(loop, world, None)
    assert out.velocity == pytest.approx([-0.01 * OWN.posture_gain] * 4)


def test_joint_torque_without_a_command_holds_still_whatever_the_posture() -> None:
    loop = force_loop(ARM, OWN)
    ask(loop, World(400.0), None, posture=[0.3, 0.3, 0.3, 0.3])
    loop.tune(replace(OWN, mode="joint_torque"))
    assert ask(loop, World(400.0), None, posture=[0.3, 0.3, 0.3, 0.3]).velocity == [0.0] * 4


def rotation(cover: str, q: list[float] = POSE) -> np.ndarray:
    return BODY.cover_pose(q, cover).rotation


def test_the_estimate_is_fed_back_if_it_is_chosen() -> None:
    loop, world = force_loop(ARM, replace(OWN, feedback="contact_estimate")), World(400.0, force=9.0)
    torques = (-4.0 * lever(POSE)).tolist()
    touch = Contact(COVER, PLACE, (0.0, 1.0, 0.0))
    out = ask(loop, world, down(6.0), contact=touch, external=torques)
    assert out.measured == pytest.approx(down(4.0), abs=1e-6)
    assert out.error == pytest.approx(down(2.0), abs=1e-6)
    again = ask(loop, world, down(6.0), external=torques)
    assert again.error == pytest.approx(down(2.0), abs=1e-6), "a force that is held stays measured below the detection"
    fresh = force_loop(ARM, replace(OWN, feedback="contact_estimate"))
    never = ask(fresh, world, down(6.0), external=torques)
    assert never.error == pytest.approx(down(6.0)), "no contact is no force"


def test_tare_acts_on_the_estimate_too() -> None:
    loop, world = force_loop(ARM, replace(OWN, feedback="contact_estimate")), World(400.0)
    touch = Contact(COVER, PLACE, (0.0, 1.0, 0.0))
    torques = (-4.0 * lever(POSE)).tolist()
    ask(loop, world, None, contact=touch, external=torques)
    assert loop.tare() == ""
    assert ask(loop, world, down(6.0), contact=touch, external=torques).measured == pytest.approx(down(0.0), abs=1e-9)


def test_the_force_acts_where_contact_is_detected() -> None:
    loop = force_loop(ARM, OWN)
    out = ask(loop, World(400.0), down(2.0), contact=Contact("inner_link", 0.4, (0.0, 0.0, 1.0)))
    assert out.axis.lever == pytest.approx(lever(POSE, DOWN, "inner_link", 0.4), abs=1e-6)
    elsewhere = ask(loop, World(400.0), down(2.0))
    assert elsewhere.axis.lever == pytest.approx(lever(POSE), abs=1e-6)


@pytest.mark.parametrize("feedback", ["joint_sensors", "contact_estimate"])
@pytest.mark.parametrize(
    ("position_sd", "probability", "is_used"), [(0.01, 0.99, True), (0.05, 0.99, False), (0.01, 0.5, False)]
)
def test_an_uncertain_contact_position_is_replaced_by_the_configured_one(
    position_sd: float, probability: float, is_used: bool, feedback: str
) -> None:
    """A refusal where the estimate is what the loop lives on; with joint sensors the estimate is not required."""
    loop = force_loop(ARM, replace(OWN, feedback=feedback))
    contact = Contact("inner_link", 0.4, (0.0, 0.0, 1.0), position_sd, probability)
    for _ in range(2):
        out = ask(loop, World(400.0), down(6.0), contact=contact)
    there = lever(POSE, DOWN, "inner_link", 0.4) if is_used else lever(POSE)
    assert out.axis.lever == pytest.approx(there, abs=1e-6)
    assert ("contact_cover and contact_position are used" in loop.fallback) is not is_used
    is_refused = not is_used and feedback == "contact_estimate"
    assert ("contact/hypotheses" in loop.refusals) is is_refused
    assert loop.refused == is_refused
    ask(loop, World(400.0), down(6.0))
    assert (loop.fallback, loop.refusals) == ("", {})


def test_a_certain_contact_position_is_kept_as_long_as_the_contact_lasts() -> None:
    """Going back and forth between it and the configured one would make a step of the measured force each time."""
    loop = force_loop(ARM, OWN)
    certain, uncertain = (
        Contact("inner_link", 0.4, (0.0, 0.0, 1.0), position_sd, 0.99) for position_sd in (0.01, 0.05)
    )
    there, configured = lever(POSE, DOWN, "inner_link", 0.4), lever(POSE)
    for contact, expected in (
        (uncertain, configured),
        (certain, there),
        (uncertain, there),
        (NO_CONTACT, configured),
        (uncertain, configured),
    ):
        out = ask(loop, World(400.0), down(2.0), contact=contact)
        assert out.axis.lever == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("feedback", ["joint_sensors", "contact_estimate"])
@pytest.mark.parametrize("mode", ["hybrid", "open_loop"])
def test_a_force_in_a_cover_frame_is_the_same_force_in_the_base_frame(feedback: str, mode: str) -> None:
    own = replace(OWN, feedback=feedback, mode=mode)
    in_cover = np.array([1.0, -4.0, 2.0])
    in_base = rotation("outer_link") @ in_cover
    touch = Contact("outer_link", 0.2, (0.3, 1.0, -0.2))
    commands = [ForceCommand(frame, tuple(force)) for frame, force in (("outer_link", in_cover), ("base", in_base))]
    outs = [
        ask(force_loop(ARM, own), World(400.0, force=2.0), None, contact=touch, command=command) for command in commands
    ]
    assert outs[0].velocity == pytest.approx(outs[1].velocity, abs=1e-12)
    assert outs[0].effort == pytest.approx(outs[1].effort, abs=1e-12)
    for here, there in ((outs[0].measured, outs[1].measured), (outs[0].limited, outs[1].limited)):
        assert rotation("outer_link") @ here == pytest.approx(there, abs=1e-12)


def test_tare_takes_the_present_torques_as_zero() -> None:
    loop = force_loop(ARM, OWN)
    ask(loop, World(400.0, force=3.0), None)
    assert loop.tare() == ""
    assert ask(loop, World(400.0, force=3.0), down(5.0)).measured == pytest.approx(down(0.0), abs=1e-9)
    ask(loop, World(400.0, force=3.0), None)
    assert loop.tare() == "", "again, on top"
    loop = force_loop(ARM, replace(OWN, force_filter=0.0))
    ask(loop, World(400.0, force=3.0), None)
    loop.tare()
    assert ask(loop, World(400.0, force=7.0), down(5.0)).measured == pytest.approx(down(4.0), abs=1e-6)


def test_tare_is_refused_while_a_force_is_commanded_the_arm_moves_or_is_where_it_pressed() -> None:
    loop, world = force_loop(ARM, replace(OWN, contact_source="pinned")), World(400.0, force=3.0)
    ask(loop, world, down(5.0))
    assert "a force is commanded" in loop.tare()
    ask(loop, world, None)
    assert "still is where it pressed" in loop.tare()
    away = World(400.0, q=[angle + 0.1 for angle in POSE])
    moving = away.joints._replace(velocity=[0.5] * 4)
    for _ in range(20):
        loop.step(moving, away.sensors, NO_CONTACT, None, None, None, None, DT)
    assert "the arm moves" in loop.tare()
    for _ in range(200):
        ask(loop, away, None)
    assert loop.tare() == ""


@pytest.mark.parametrize("limit", [1.0, 0.0])
def test_what_a_free_arm_at_rest_measures_counts_as_zero_when_a_force_is_commanded(limit: float) -> None:
    """The torques of 0.4 N that do not act: an error of the model."""
    own = replace(OWN, contact_source="pinned", sensing=replace(OWN.sensing, zero_limit=limit))
    loop, wrong = force_loop(ARM, own), World(400.0, force=0.4)
    for _ in range(100):
        ask(loop, wrong, None)
    for _ in range(20):  # from the first period on, or it would be a touch
        measured = ask(loop, wrong, down(5.0)).measured
        assert measured == pytest.approx(down(0.0 if limit else 0.4), abs=1e-6)


@pytest.mark.parametrize("case", ["touched", "pressed here before", "moving", "too large", "nobody estimates contacts"])
def test_a_force_that_may_be_true_is_never_taken_as_zero(case: str) -> None:
    own = replace(OWN, contact_source="pinned", sensing=replace(OWN.sensing, zero_limit=1.0))
    loop = force_loop(ARM, own)
    world = World(400.0, force=3.0 if case == "too large" else 0.4)
    touch = Contact(COVER, PLACE, (0.0, 1.0, 0.0)) if case == "touched" else NO_CONTACT
    joints = world.joints._replace(velocity=[0.5] * 4) if case == "moving" else world.joints
    estimate = None if case == "nobody estimates contacts" else touch
    if case == "pressed here before":
        ask(loop, World(400.0, force=4.0), down(5.0), contact=Contact(COVER, PLACE, (0.0, 1.0, 0.0)))
    for command in (None, ForceCommand("base", down(5.0))):
        for _ in range(100):
            out = loop.step(joints, world.sensors, estimate, None, command, None, None, DT)
    assert -out.measured[2] == pytest.approx(world.force, rel=1e-3)


def test_a_force_without_a_lever_commands_no_motion_along_it() -> None:
    stretched = [0.0, 0.0, 0.0, math.pi / 2]  # arm straight up
    out = ask(force_loop(ARM, OWN), World(400.0, q=stretched), down(5.0))
    assert out.velocity == pytest.approx([0.0] * 4, abs=1e-12)
    assert np.all(np.isfinite(out.effort))


def test_missing_sensors_count_as_no_force() -> None:
    loop = force_loop(ARM, OWN)
    command = ForceCommand("base", (0.0, 0.0, -5.0))
    out = loop.step(State(POSE, STILL, STILL), None, NO_CONTACT, None, command, None, None, DT)
    assert out.measured == pytest.approx((0.0, 0.0, 0.0))
    assert all(math.isfinite(value) for value in (*out.velocity, *out.effort))


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"contact_cover": "hand"}, "contact_cover is 'hand'; allowed: inner_link, outer_link"),
        ({"mode": "soft"}, "'mode' is 'soft'; allowed: one of hybrid, joint_torque, open_loop"),
        ({"feedback": "eyes"}, "'feedback' is 'eyes'; allowed: one of joint_sensors, contact_estimate"),
        ({"force_gain": [-0.1]}, "'force_gain' is -0.1 m/s/N; allowed: 0 to 100"),
        ({"force_filter": math.nan}, "'force_filter' is nan s"),
        ({"contact_position": "tip"}, "'contact_position' is 'tip' m; allowed: a number"),
    ],
)
def test_a_parameter_set_that_does_not_fit_is_refused_by_name(change: dict[str, Any], text: str) -> None:
    loop = force_loop(ARM, OWN)
    with pytest.raises(ParameterError, match=text):
        loop.tune(build(ForceLoopParameters, {**values(OWN), **change}))
    assert loop.parameters == OWN


def test_feedback_of_sensors_that_are_not_mounted_is_refused() -> None:
    bare = CONFIGURATION.with_values({"arm.joint_sensors": False}).shared.arm
    with pytest.raises(ParameterError, match=r"arm\.joint_sensors is false; use 'contact_estimate'"):
        force_loop(bare, OWN)
    force_loop(bare, replace(OWN, feedback="contact_estimate"))


def test_feedback_of_springs_that_nobody_knows_is_refused() -> None:
    deaf = r"feedback is 'joint_position' but spring_stiffness is 0 at each joint, .* or use 'joint_sensors'"
    with pytest.raises(ParameterError, match=deaf):
        force_loop(ARM, replace(OWN, feedback="joint_position"))
    loop = force_loop(ARM, OWN)
    with pytest.raises(ParameterError, match=deaf):
        loop.tune(replace(OWN, feedback="joint_position"))
    assert loop.parameters == OWN
    known = replace(OWN, feedback="joint_position", spring_stiffness=(0.0, 1464.0, 0.0, 0.0))
    loop.tune(known)
    with pytest.raises(ParameterError, match=deaf):
        loop.tune(replace(known, spring_stiffness=OWN.spring_stiffness))
    assert loop.parameters == known
