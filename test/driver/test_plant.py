"""The plant against closed forms, pinocchio, virtual work and energy; nothing is read from its matrices."""

import dataclasses
import math
from collections.abc import Callable

import mujoco
import numpy as np
import pytest
from arms import LINK_INERTIA, NOWHERE, WAM, box, changed, frictionless, ideal_plant, one_joint
from contact_truth import cover_frame, frame, motor_from_joint, torques

from wam_description.arm import Arm
from wam_description.rigid_body import RigidBody
from wam_description.world import Obstacles
from wam_driver.plant import Plant

STEP = 5e-4
BODY = RigidBody(WAM)
POSES = [(0.0, -0.6, 0.0, 0.5), (0.5, -1.2, 0.8, 1.5), (-2.0, 1.4, -2.0, -1.0), (1.0, 2.2, 1.5, 2.2)]
NONE = np.zeros(3)
R = np.array([motor_from_joint(e) for e in np.eye(4)]).T  # theta = R q
ROTOR = np.array(WAM.motors.inertia)
ARMATURE = np.array(WAM.joints.armature)


def drive(plant: Plant, seconds: float, torque: list[float], step: float = STEP) -> None:
    for _ in range(round(seconds / step)):
        plant.step(torque)


def released(arm: Arm, obstacles: Obstacles = NOWHERE, step: float = STEP) -> Plant:
    plant = ideal_plant(arm, obstacles, step)
    plant.brake(False)
    return plant


# friction

F_STATIC, F_DYNAMIC = 0.06, 0.045


def with_friction(where: str, viscous: float = 0.0) -> Arm:
    """One joint, dry friction of the same size at the motor shaft, whether at the motor or at the joint.

    The cable is damped: an undamped one rings to twice the torque put on and breaks the joint away.
    """
    arm = one_joint()
    scale = 1.0 if where == "motors" else 14.0
    friction = {"static_friction": (scale * F_STATIC,), "dynamic_friction": (scale * F_DYNAMIC,)}
    return changed(
        arm,
        cables={"damping": (0.02,)},
        motors={"viscous_friction": (viscous,)} | (friction if where == "motors" else {}),
        joints={"start": (-2.9,)} | (friction if where == "joints" else {}),
    )


def creep(plant: Plant, torque: float, seconds: float) -> float:
    """How far the rotor goes after it has wound up the cable, slowly."""
    for k in range(400):
        plant.step([torque * (k + 1) / 400])
    drive(plant, 0.2, [torque])
    begin = plant.theta[0]
    drive(plant, seconds, [torque])
    return abs(plant.theta[0] - begin)


def test_joint_under_nine_tenths_of_its_static_friction_stays() -> None:
    plant = released(with_friction("joints"))
    drive(plant, 0.5, [0.0])
    begin = plant.q[0]
    torque = np.array([0.0, 0.0, 0.9 * 14 * F_STATIC])
    plant.push("tube", NONE, torque)
    drive(plant, 10.0, [0.0])
    assert abs(plant.q[0] - begin) < 1e-9
    plant.push("tube", NONE, torque * 1.1 / 0.9)
    drive(plant, 1.0, [0.0])
    assert abs(plant.q[0] - begin) > 0.01


@pytest.mark.parametrize("where", ["motors", "joints"])
def test_between_dynamic_and_static_friction_rest_stays_rest_and_motion_motion(where: str) -> None:
    between = (F_STATIC + F_DYNAMIC) / 2
    resting = released(with_friction(where))
    assert creep(resting, between, 1.0) < 1e-9
    moving = released(with_friction(where))
    drive(moving, 0.15, [1.5 * F_STATIC])
    drive(moving, 0.1, [between])
    speed = moving.thetad[0]
    drive(moving, 0.5, [between])
    inertia = 4.067e-5 + LINK_INERTIA / 14**2
    gained = (between - F_DYNAMIC) / inertia * 0.5
    assert moving.thetad[0] - speed == pytest.approx(gained, rel=0.01)
    same = changed(
        with_friction(where), **{where: {"static_friction": getattr(with_friction(where), where).dynamic_friction}}
    )
    assert creep(released(same), between, 1.0) > 0.1


@pytest.mark.parametrize("where", ["motors", "joints"])
def test_what_has_come_to_rest_sticks_again(where: str) -> None:
    plant = released(with_friction(where))
    drive(plant, 0.3, [1.5 * F_STATIC])
    drive(plant, 2.0, [0.0])
    assert creep(plant, (F_STATIC + F_DYNAMIC) / 2, 1.0) < 1e-9
    assert creep(plant, 1.1 * F_STATIC, 1.0) > 0.1


@pytest.mark.parametrize("where", ["motors", "joints"])
def test_rotor_breaks_away_at_static_friction(where: str) -> None:
    plant = released(with_friction(where))
    torque, begin = 0.0, plant.q[0]
    while abs(plant.q[0] - begin) < 1e-6:
        torque += 2e-5  # slow against the cable
        plant.step([torque])
        assert torque < 2 * F_STATIC
    assert torque == pytest.approx(F_STATIC, rel=0.02)


@pytest.mark.parametrize("where", ["motors", "joints"])
def test_sliding_arm_loses_its_momentum_at_the_rate_of_dynamic_friction_and_stops(where: str) -> None:
    plant = released(with_friction(where))
    plant.data.qvel[:] = (20.0, 20.0 / 14)
    inertia = np.array([4.067e-5, LINK_INERTIA / 14])  # moment along the rigid motion, seen at the motor
    stop = 20.0 * (inertia[0] + inertia[1] / 14) / F_DYNAMIC
    for k in range(1, round(0.8 * stop / STEP)):
        plant.step([0.0])
        momentum = inertia @ (plant.thetad[0], plant.qd[0])
        expected = inertia @ (20.0, 20.0 / 14) - F_DYNAMIC * k * STEP
        assert momentum == pytest.approx(expected, abs=1e-9)
    drive(plant, 0.4 * stop, [0.0])
    assert abs(plant.thetad[0] if where == "motors" else plant.qd[0]) < 1e-9


@pytest.mark.parametrize("where", ["motors", "joints"])
def test_steady_speed_is_what_coulomb_and_viscous_friction_leave(where: str) -> None:
    viscous = 5e-3
    plant = released(with_friction(where, viscous))
    drive(plant, 6.5, [0.1])
    assert plant.q[0] < 2.9
    assert plant.qd[0] * 14 == pytest.approx((0.1 - F_DYNAMIC) / viscous, rel=1e-5)


# brakes


@pytest.mark.parametrize("start", POSES)
def test_braked_arm_does_not_sag_in_two_seconds(start: tuple[float, ...]) -> None:
    arm = frictionless(WAM, start, damping=1.0)
    plant = ideal_plant(arm, NOWHERE, STEP)
    drive(plant, 2.0, [0.0] * 4)
    np.testing.assert_allclose(plant.q, start, atol=1e-9)
    plant.reset()
    plant.data.qpos[:4] = R @ start  # cables that carry nothing yet
    drive(plant, 2.0, [0.0] * 4)
    assert max(abs(np.array(plant.q) - start)) > 1e-4


def test_brakes_hold_three_times_the_peak_torque() -> None:
    arm = frictionless(WAM, damping=1.0)
    peak = np.array(WAM.motors.peak_torque)
    for sign in (3.0, -3.0):
        plant = ideal_plant(arm, NOWHERE, STEP)
        theta = np.array(plant.theta)
        drive(plant, 1.0, (sign * peak).tolist())
        np.testing.assert_allclose(plant.theta, theta, atol=1e-9)
        plant.brake(False)
        drive(plant, 0.01, (sign * peak).tolist())
        assert min(abs(np.array(plant.theta) - theta)) > 0.1


# contact

TILTED, LEVEL = (0.0, -0.6, 0.0, 0.45), (0.0, -0.6, 0.0, 0.6)  # outer link falls towards its tip; lies level
TIP, RADIUS = 0.4064, 0.0254


def pressed(start: tuple[float, ...], surface: Obstacles, force: tuple[float, ...], seconds: float = 1.5) -> Plant:
    """Braked, without dry friction in the arm, pressed onto the surface until it rests."""
    plant = ideal_plant(changed(frictionless(WAM, start, damping=10.0)), surface, STEP)
    for k in range(round(seconds / STEP)):
        share = min(1.0, k * STEP / 0.3)
        f = share * np.array(force)
        plant.push("inner_link", f, np.cross([0.5, 0.0, 0.0], f))
        plant.step([0.0] * 4)
    assert max(map(abs, plant.qd)) < 1e-6
    return plant


def top_at(z: float, near: float, far: float, stiffness: float, friction: float = 0.0) -> Obstacles:
    """A box from x = near to far, its top at z."""
    return box(
        ((near + far) / 2, 0.0, z - 0.1), ((far - near) / 2, 0.4, 0.1), stiffness, damping=100.0, friction=friction
    )


def axis_height(q: list[float], x: float) -> float:
    """Height of the outer tube's axis above a place of the floor plan, m; the arm in the x-z plane."""
    pose = cover_frame(q, "outer_link")
    along = (x - pose[0, 3]) / pose[0, 0]
    return float(pose[2, 3] + along * pose[2, 0])


DOWN = (-40.0, 0.0, -40.0)


@pytest.mark.slow
@pytest.mark.parametrize("stiffness", [1e3, 1e5])
def test_two_contacts_share_the_stiffness_of_their_surface(stiffness: float) -> None:
    near, far = 0.5, 0.65
    top = axis_height(list(LEVEL), 0.6) - RADIUS + 2e-3
    plant = pressed(LEVEL, top_at(top, near, far, stiffness), DOWN)
    depths = [top - (axis_height(plant.q, x) - RADIUS) for x in (near, far)]
    assert plant.data.ncon == 2
    assert min(depths) > 1e-5
    pose = cover_frame(plant.q, "outer_link")
    load = next(load for load in plant.loads() if load.cover == "outer_link")
    force = pose[:3, :3] @ load.force
    shares = np.array(depths) ** 32 / (np.array(depths) ** 32).sum()
    assert force[2] == pytest.approx(stiffness * float(shares @ depths), rel=2e-3)
    assert force[2] == pytest.approx(stiffness * max(depths), rel=0.03)  # k_c, whatever touches
    np.testing.assert_allclose(force[:2], 0.0, atol=5e-3 * force[2])  # an edge pushes at right angles to the tube
    middle = float(np.average([near, far], weights=shares * depths)) - pose[0, 3]
    assert load.position == pytest.approx(middle / pose[0, 0], abs=2e-3)


def test_arm_that_starts_in_contact_feels_it_at_once() -> None:
    low = cover_frame(TILTED, "outer_link") @ [TIP, 0.0, 0.0, 1.0]
    plant = ideal_plant(changed(WAM, joints={"start": TILTED}), top_at(low[2] - RADIUS + 2e-3, 0.6, 0.9, 4e3), STEP)
    (load,) = plant.loads()
    assert np.linalg.norm(load.force) == pytest.approx(4e3 * 2e-3, rel=5e-3)
    first = plant.loads()
    plant.step([0.0] * 4)
    assert plant.loads()[0].force == pytest.approx(first[0].force, rel=1e-6)


def mujocos_own_slip(plant: Plant) -> None:
    """Let MuJoCo choose what the friction of contacts aims at: slip falls at damping/impedance."""
    match = plant._surfaces.apply

    def match_normals() -> None:
        own = plant.data.efc_aref.copy()
        match()
        for row, size in zip(plant.data.contact.efc_address, plant.data.contact.dim, strict=True):
            plant.data.efc_aref[row + 1 : row + size] = own[row + 1 : row + size]

    plant._surfaces.apply = match_normals  # type: ignore[method-assign]


def slides(
    friction: float, sideways: float, change: Callable[[Plant], None] = lambda _: None
) -> tuple[np.ndarray, float]:
    """Contact force in base coordinates over the last 0.1 s and how fast the tip slides, while pushed sideways."""
    low = cover_frame(TILTED, "outer_link") @ [TIP, 0.0, 0.0, 1.0]
    plant = ideal_plant(
        frictionless(WAM, TILTED, damping=10.0), top_at(low[2] - RADIUS + 2e-3, 0.6, 0.9, 4e3, friction), STEP
    )
    change(plant)
    forces, way = [], []
    for k in range(5000):
        share = min(1.0, k / 2000)
        plant.push("inner_link", share * np.array(DOWN), np.cross([0.5, 0.0, 0.0], share * np.array(DOWN)))
        f = share * np.array([0.0, 0.0, sideways])
        plant.push("outer_link", f, np.cross([TIP, 0.0, 0.0], f))
        plant.step([0.0] * 4)
        if k == 2500 or k >= 4800:
            load = next(load for load in plant.loads() if load.cover == "outer_link")
            forces.append(cover_frame(plant.q, "outer_link")[:3, :3] @ (np.array(load.force) - f))
            way.append((cover_frame(plant.q, "outer_link") @ [TIP, 0.0, 0.0, 1.0])[1])
    return np.array(forces[1:]), way[-1] - way[0]


@pytest.mark.slow
def test_friction_of_a_resting_contact_is_steady() -> None:
    forces, _ = slides(0.4, 0.0)
    assert forces[:, 2].min() > 5.0
    assert np.ptp(forces, axis=0).max() < 0.05
    alternating, _ = slides(0.4, 0.0, mujocos_own_slip)
    assert np.ptp(alternating[:, :2], axis=0).max() > 1.0


@pytest.mark.slow
def test_contact_friction_holds_below_its_cone_and_takes_its_share_above() -> None:
    held, crept = slides(1.0, 2.0)
    assert abs(crept) < 1e-6
    free, _ = slides(0.0, 2.0)
    np.testing.assert_allclose(free[:, :2], 0.0, atol=1e-9)
    assert np.all(np.hypot(held[:, 0], held[:, 1]) < 1.0 * held[:, 2])


def at(plant: Plant, q: tuple[float, ...]) -> Plant:
    """Put the joints at the angles q, rad, and look for contacts there."""
    for name, angle in zip(WAM.joints.names, q, strict=True):
        plant.data.qpos[plant.model.joint(name).qposadr[0]] = angle
    mujoco.mj_kinematics(plant.model, plant.data)
    mujoco.mj_comPos(plant.model, plant.data)
    mujoco.mj_collision(plant.model, plant.data)
    return plant


@pytest.mark.parametrize(("shoulder", "sunk"), [(-1.98, False), (-2.0, False), (-2.01, True), (-2.05, True)])
def test_a_tube_whose_axis_is_in_an_edge_is_sunk(shoulder: float, sunk: bool) -> None:
    """At the edge of the box, 0.026 m deep, MuJoCo's normal turns from across the tube to the face beneath the edge."""
    edge = box((0.628, 0.0, -0.468), (0.1, 0.2, 0.1), 4000.0)
    plant = at(ideal_plant(WAM, edge, 5e-4), (0.0, shoulder, 0.0, 1.45))
    (contact,) = (plant.data.contact[i] for i in range(plant.data.ncon))
    axis = plant.data.geom("outer_link").xmat.reshape(3, 3)[:, 2]
    assert (abs(float(contact.frame[:3] @ axis)) > 0.5) is sunk
    assert ("mm deep in an edge" in plant.sunk()) is sunk


@pytest.mark.parametrize("depth", [0.01, 0.05, 0.09])
def test_the_end_of_a_tube_may_be_deep_in_what_is_soft(depth: float) -> None:
    q = (0.0, -1.8, 0.0, 1.0)
    low = (cover_frame(q, "outer_link") @ [TIP, 0.0, 0.0, 1.0])[2] - RADIUS
    plant = at(ideal_plant(WAM, box((0.0, 0.0, low + depth - 0.5), (2.0, 2.0, 0.5), 100.0), 5e-4), q)
    assert plant.data.contact.dist.min() == pytest.approx(-depth, abs=1e-6)
    assert plant.sunk() == ""


@pytest.mark.parametrize("shape", ["box", "cylinder"])
@pytest.mark.parametrize(("part", "sunk", "sign"), [(0.7, False, -1.0), (0.9, True, -1.0), (1.1, True, 1.0)])
def test_a_tube_at_the_middle_of_a_thin_object_is_sunk(shape: str, part: float, sunk: bool, sign: float) -> None:
    """Beyond the middle of a box, MuJoCo's normal is that of the face behind."""
    q, half = (0.0, -1.8, 0.0, 1.0), 0.03
    low = (cover_frame(q, "outer_link") @ [TIP, 0.0, 0.0, 1.0])[2] - RADIUS
    thin = box((0.0, 0.0, low + RADIUS + part * half - half), (2.0, 2.0, half), 100.0)
    if shape == "cylinder":
        thin = dataclasses.replace(thin, shapes=("cylinder",), sizes=(2.0, half, 0.0))
    plant = at(ideal_plant(WAM, thin, 5e-4), q)
    assert shape == "cylinder" or float(plant.data.contact[0].frame[2]) == sign
    assert (" mm deep in block; allowed: " in plant.sunk()) is sunk


# pushes


def acceleration(plant: Plant, step: float) -> np.ndarray:
    before = np.array(plant.qd)
    plant.step([0.0] * len(plant.q))
    return (np.array(plant.qd) - before) / step


@pytest.mark.parametrize("start", POSES)
def test_push_accelerates_a_resting_arm_as_inertia_and_jacobian_say(start: tuple[float, ...]) -> None:
    mass = BODY.mass_matrix(start) + np.diag(ARMATURE)
    rng = np.random.default_rng(5)
    for cover in WAM.covers.names:
        for _ in range(5):
            force, point, lever = rng.normal(size=3) * 20, rng.normal(size=3) * 0.2, rng.normal(size=3) * 0.1
            plant = ideal_plant(frictionless(WAM, start), NOWHERE, STEP)
            plant.push(cover, force, np.cross(point, force))
            expected = np.linalg.solve(mass, torques(start, cover, point, force))
            np.testing.assert_allclose(acceleration(plant, STEP), expected, rtol=1e-6, atol=1e-6)
            plant = ideal_plant(frictionless(WAM, start), NOWHERE, STEP)
            plant.push(cover, NONE, np.cross(lever, force))  # a couple: force at the lever, its opposite at the origin
            couple = torques(start, cover, lever, force) - torques(start, cover, NONE, force)
            np.testing.assert_allclose(acceleration(plant, STEP), np.linalg.solve(mass, couple), rtol=1e-6, atol=1e-6)


def test_push_lasts_until_it_is_released_or_made_zero() -> None:
    ends: list[Callable[[Plant], None]] = [
        Plant.release,
        lambda plant: plant.push("outer_link", NONE, NONE),
        Plant.reset,
    ]
    for end in ends:
        plant = ideal_plant(frictionless(WAM), NOWHERE, STEP)
        plant.push("outer_link", np.array([0.0, 9.0, 0.0]), NONE)
        assert plant.loads()
        end(plant)
        assert plant.loads() == []
        assert np.abs(acceleration(plant, STEP)).max() < 1e-6


def test_push_on_an_unknown_cover_is_refused_with_the_covers_there_are() -> None:
    with pytest.raises(ValueError, match="no cover is named 'hand'; covers: inner_link, outer_link"):
        released(WAM).push("hand", np.ones(3), NONE)


@pytest.mark.parametrize(
    ("force", "place"),
    [((0.0, 5.0, 0.0), 0.31), ((0.0, -3.0, 4.0), 0.31), ((6.0, 2.0, -1.0), 0.31), ((3.0, 0.0, 0.0), math.nan)],
)
def test_place_of_a_push_is_where_its_line_crosses_the_axis(force: tuple[float, float, float], place: float) -> None:
    plant = released(WAM)
    plant.push("inner_link", np.array(force), np.cross([0.31, 0.0, 0.0], force))
    (load,) = plant.loads()
    assert (load.cover, load.force) == ("inner_link", force)
    assert load.position == pytest.approx(place, abs=1e-12, nan_ok=True)


# torques inside the arm


def wave(time: float) -> np.ndarray:
    """Joint torques that swing every joint to and fro."""
    return np.array([8.0, 10.0, 4.0, 3.0]) * np.sin(2 * math.pi * np.array([1.1, 1.3, 1.7, 2.1]) * time)


WIDE: dict[str, tuple[float, ...]] = {"lower": (-50.0,) * 4, "upper": (50.0,) * 4}  # no stop in the way


def swing(arm: Arm, seconds: float, step: float, pushed: bool = False) -> list[tuple[np.ndarray, ...]]:
    """Rows of q and qd before each step, q and qd after it, strain torque, motor torque."""
    plant, rows = released(arm, step=step), []
    for k in range(round(seconds / step)):
        if pushed:
            f = np.array(pushing(k * step))
            plant.push("outer_link", f, np.cross([0.3, 0.0, 0.0], f))
        before = np.array(plant.q), np.array(plant.qd)
        tau = np.linalg.solve(R.T, wave((k + 0.5) * step) + BODY.gravity_torque(before[0]))
        plant.step(tau.tolist())
        rows.append((*before, np.array(plant.q), np.array(plant.qd), np.array(plant.strain_torque), tau))
    return rows


def pushing(time: float) -> tuple[float, float, float]:
    """Force at 0.3 m of the outer link, N, in its frame."""
    return (2.0, 6.0 * math.sin(9 * time), -5.0)


@pytest.mark.slow
@pytest.mark.parametrize("pushed", [False, True])
def test_strain_torque_is_what_moves_the_links(pushed: bool) -> None:
    """Inverse dynamics of the links alone, from differences of the velocity, less what the world adds."""
    fastest = 0.0
    for k, (q, qd, _, qd_after, strain, _) in enumerate(swing(changed(WAM, joints=WIDE), 1.0, STEP, pushed)):
        needed = BODY.inverse_dynamics(q, qd, (qd_after - qd) / STEP)
        if pushed:
            needed = needed - torques(q.tolist(), "outer_link", (0.3, 0, 0), pushing(k * STEP))
        np.testing.assert_allclose(strain, needed, atol=1e-6)
        fastest = max(fastest, np.abs(qd).max())
    assert fastest > 1.0


def test_cable_torque_moves_links_and_pulleys() -> None:
    plant = released(changed(frictionless(WAM, damping=3.0), joints=WIDE))
    for k in range(1000):
        q, qd = np.array(plant.q), np.array(plant.qd)
        plant.step(np.linalg.solve(R.T, wave(k * STEP) + BODY.gravity_torque(q)).tolist())
        qdd = (plant.qd - qd) / STEP
        needed = BODY.inverse_dynamics(q, qd, qdd) + ARMATURE * qdd
        np.testing.assert_allclose(plant.cable_torque, needed, atol=1e-6)
    assert np.abs(plant.qd).max() > 1.0


def test_joint_friction_hides_a_light_push_from_the_cables_but_not_from_the_strain_gauges() -> None:
    plant = ideal_plant(WAM, NOWHERE, STEP)
    drive(plant, 0.2, [0.0] * 4)
    before = np.array(plant.strain_torque), np.array(plant.cable_torque)
    light = 0.5 * WAM.joints.static_friction[3] / 0.3
    force = np.array([0.0, light, 0.0])
    plant.push("outer_link", force, np.cross([0.3, 0.0, 0.0], force))
    drive(plant, 1.0, [0.0] * 4)
    push = torques(plant.q, "outer_link", (0.3, 0, 0), force)
    np.testing.assert_allclose(plant.strain_torque - before[0], -push, atol=1e-3)
    assert abs(plant.cable_torque[3] - before[1][3]) < 1e-3 < abs(push[3])


# energy


def height_energy(q: np.ndarray) -> float:
    """Potential energy of the links by the table of (A.4), J."""
    return sum(
        9.80665 * mass * (frame(q.tolist(), i + 1) @ [*WAM.links.centre[3 * i : 3 * i + 3], 1.0])[2]
        for i, mass in enumerate(WAM.links.mass)
    )


def energy(plant: Plant, theta: np.ndarray, q: np.ndarray, thetad: np.ndarray, qd: np.ndarray) -> float:
    """Rotors, pulleys, links, cables and height, J."""
    stretch = theta - motor_from_joint(q)
    kinetic = ROTOR @ thetad**2 + qd @ (BODY.mass_matrix(q) + np.diag(ARMATURE)) @ qd
    return 0.5 * float(
        kinetic + np.array([circuit.stiffness for circuit in WAM.circuits]) @ stretch**2
    ) + height_energy(q)


def energies(arm: Arm, seed: int, seconds: float, step: float) -> np.ndarray:
    """Energy after every step; velocities belong to the middle of a step, so two are averaged."""
    plant = released(arm, step=step)
    rng = np.random.default_rng(seed)
    qd = rng.uniform(-2.0, 2.0, 4)
    plant.data.qvel[:] = [*(R @ qd + rng.uniform(-20, 20, 4)), *qd]
    result = []
    for _ in range(round(seconds / step)):
        theta, q = np.array(plant.theta), np.array(plant.q)
        before = np.array(plant.thetad), np.array(plant.qd)
        plant.step([0.0] * 4)
        middle = (before[0] + plant.thetad) / 2, (before[1] + plant.qd) / 2
        result.append(energy(plant, theta, q, *middle))
    return np.array(result[1:])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1))
def test_energy_of_the_undriven_arm_never_grows(seed: int) -> None:
    found = energies(changed(WAM, joints=WIDE), seed, 1.5, STEP)
    assert found[0] - found[-1] > 0.5
    assert np.diff(found).max() < 1e-6


def test_stop_gives_back_less_than_it_takes() -> None:
    tight: dict[str, tuple[float, ...]] = {"lower": (-0.1, -0.7, -0.1, 0.4), "upper": (0.1, -0.5, 0.1, 0.6)}
    found = energies(changed(WAM, joints=tight), 0, 1.0, STEP)
    assert found[0] - found[-1] > 0.5
    assert found.max() < found[0] + 0.01


def test_energy_of_the_frictionless_arm_grows_no_faster_than_stated() -> None:
    """docs/plant.md: at the step of config/wam.yaml, up to 0.3 W in fast motion."""
    plant = released(changed(frictionless(WAM), joints=WIDE), step=STEP)
    plant.model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    qd = np.array([-0.9, 1.8, -1.4, 1.8])
    plant.data.qvel[:] = [*(R @ qd), *qd]
    means = []
    for _ in range(3):  # before it meets a stop
        total = 0.0
        for _ in range(round(1.0 / STEP)):
            plant.step([0.0] * 4)
            total += plant.data.energy.sum() * STEP
        means.append(total)
    assert abs(np.polyfit(np.arange(3.0), means, 1)[0]) < 0.33


# repeatability


def story(plant: Plant) -> list[float]:
    """A motion with brakes, pushes and a fall onto the foam; every number on its way."""
    values: list[float] = []
    for k in range(3000):
        plant.brake(k < 50 or k > 2500)
        if k == 200:
            plant.push("outer_link", np.array([0.0, 6.0, 1.0]), np.array([0.1, 0.0, 0.5]))
        if k == 600:
            plant.release()
        plant.step([0.3, 0.1 * math.sin(k / 50), -0.2, 0.1])
        if k % 5 == 0:
            values += [*plant.theta, *plant.thetad, *plant.q, *plant.qd, *plant.strain_torque, *plant.cable_torque]
            for load in plant.loads():
                values += [load.position, *load.force]
    return values


def test_reset_brings_everything_back_bit_for_bit() -> None:
    plant = ideal_plant(WAM, top_at(-0.05, 0.0, 1.0, 4e3, 0.3), STEP)
    first = story(plant)
    assert plant.data.ncon > 0
    plant.push("inner_link", np.ones(3), np.ones(3))
    drive(plant, 0.1, [1.0] * 4)
    plant.reset()
    assert story(plant) == first
