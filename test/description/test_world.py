"""Free bodies, doors and moving obstacles, compared with what follows by hand."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from arms import CONFIGURATION, WAM

from wam_control.task.scenario import ScenarioStep
from wam_description.configuration import Configuration, packaged
from wam_description.effects import no_effects
from wam_description.mjcf import mjcf
from wam_description.movable import Doors, FreeBodies, Motions, principal_inertia
from wam_description.parameters import ParameterError, build_part
from wam_description.rigid_body import RigidBody
from wam_description.signals import ObjectState
from wam_description.world import NO_SPRINGS, Obstacles, World
from wam_driver.friction import COULOMB_STICTION
from wam_driver.plant import Plant
from wam_sim.simulation import Simulation

G = 9.80665
STEP = 5e-4
TABLE = Obstacles(
    ("table",), (4000.0,), (20.0,), (0.3,), ("box",), (0.7, 0.0, -0.6), (0.0,) * 3, (0.5, 0.5, 0.05), (0.0,)
)  # its top is at -0.55 m


def body(shape: str = "box", **changes: Any) -> FreeBodies:
    """One body of 1.5 kg on the table."""
    size = {"box": (0.05, 0.06, 0.04), "cylinder": (0.05, 0.04, 0.0), "ball": (0.04, 0.0, 0.0)}[shape]
    one = FreeBodies(
        ("thing",), (4000.0,), (20.0,), (0.3,), (shape,), size, (0.7, 0.0, -0.51), (0.0,) * 3, (1.5,), (0.4,),
        (20000.0,), (50.0,),
    )  # fmt: skip
    return dataclasses.replace(one, **changes)


def door(**changes: Any) -> Doors:
    """One door of 3 kg, 0.4 m wide, without friction, damping and spring."""
    one = Doors(
        ("door",), (4000.0,), (20.0,), (0.3,), (1.5, 0.0, 0.0), (0.0,) * 3, (0.2, 0.01, 0.3), (3.0,), (0.0,), (0.0,),
        (0.0,), (0.0,), (-3.0,), (3.0,),
    )  # fmt: skip
    return dataclasses.replace(one, **changes)


def motion(amplitude: tuple[float, float, float], frequency: float) -> Motions:
    return Motions(("table",), amplitude, (frequency,), (0.0,))


def plant_of(step: float = STEP, **world: Any) -> Plant:
    return Plant(WAM, World(TABLE, NO_SPRINGS, **world), no_effects(WAM), step)


def play(plant: Plant, seconds: float) -> ObjectState:
    for _ in range(round(seconds / STEP)):
        plant.step([0.0] * 4)
    return plant.objects()[0]


# the points at which MuJoCo lets a cylinder touch a box wander along its rim, so that its forces jitter
@pytest.mark.parametrize(("shape", "jitter"), [("box", 1e-3), ("cylinder", 0.04)])
def test_a_sliding_body_is_stopped_by_mu_m_g(shape: str, jitter: float) -> None:
    plant = plant_of(bodies=body(shape))
    start = play(plant, 0.2)
    assert start.other_force_z == pytest.approx(1.5 * G, rel=jitter)
    plant.data.joint("thing_pose").qvel[0] = 0.6
    sliding = play(plant, 0.05)
    assert -sliding.other_force_x == pytest.approx(0.4 * 1.5 * G, rel=max(jitter, 0.01))
    stopped = play(plant, 0.4)
    assert stopped.x - start.x == pytest.approx(0.6**2 / (2 * 0.4 * G), rel=0.03)
    assert play(plant, 0.1).x == pytest.approx(stopped.x, abs=1e-4)


def test_a_body_does_not_move_below_its_friction_and_moves_above_it() -> None:
    plant = plant_of(bodies=body())
    start = play(plant, 0.2)
    pull = plant.data.xfrc_applied[plant.model.body("thing").id]
    pull[0] = 0.9 * 0.4 * 1.5 * G
    assert play(plant, 0.3).x == pytest.approx(start.x, abs=1e-4)
    pull[0] = 1.5 * 0.4 * 1.5 * G
    moved = play(plant, 0.2)
    assert moved.vx == pytest.approx(0.5 * 0.4 * G * 0.2, rel=0.02)


def test_a_ball_bounces_back_to_its_height_without_damping() -> None:
    bodies = body("ball", positions=(0.7, 0.0, -0.41), ground_damping=(0.0,), ground_friction=(0.0,))
    plant = plant_of(bodies=bodies)
    heights = [play(plant, STEP).z for _ in range(900)]
    fall = math.sqrt(2 * 0.1 / G)
    lowest = int(np.argmin(heights))
    assert lowest * STEP == pytest.approx(fall, abs=0.02)
    assert max(heights[lowest:]) == pytest.approx(-0.41, abs=0.003)


def test_a_door_swings_on_its_spring_as_the_equation_of_motion_has_it() -> None:
    inertia = 3.0 * (4 * 0.2**2 + 0.01**2) / 3.0
    plant = plant_of(doors=door(spring=(4.0,), hinge_damping=(0.1,)))
    plant.data.joint("door_hinge").qpos[0] = 0.5
    rate, decay = math.sqrt(4.0 / inertia - (0.05 / inertia) ** 2), 0.05 / inertia
    for seconds in (0.25, 0.5, 0.75):
        expected = math.exp(-decay * seconds) * (math.cos(rate * seconds) + decay / rate * math.sin(rate * seconds))
        assert play(plant, 0.25).angle == pytest.approx(0.5 * expected, abs=0.005)


def test_dry_friction_stops_a_door_and_holds_it() -> None:
    inertia = 3.0 * (4 * 0.2**2 + 0.01**2) / 3.0
    plant = plant_of(doors=door(hinge_friction=(0.3,), spring=(0.2,)))
    plant.data.joint("door_hinge").qvel[0] = 1.0
    angle = play(plant, 1.0).angle
    # 0.5 I w^2 = 0.3 phi + 0.5 0.2 phi^2
    expected = (-0.3 + math.sqrt(0.09 + 0.2 * inertia)) / 0.2
    assert angle == pytest.approx(expected, rel=0.01)
    assert play(plant, 0.3).angle == pytest.approx(angle, abs=1e-4)


def test_friction_carries_a_body_on_a_moving_table() -> None:
    plant = plant_of(bodies=body(), motions=motion((0.05, 0.0, 0.0), 0.5))
    for _ in range(round(1.2 / STEP)):
        plant.step([0.0] * 4)
    thing, table = plant.objects()
    assert table.x - 0.7 == pytest.approx(0.05 * math.sin(2 * math.pi * 0.5 * (1.2 - STEP)), abs=1e-5)
    assert table.vx == pytest.approx(0.05 * math.pi * math.cos(math.pi * (1.2 - STEP)), rel=1e-3)
    assert thing.x == pytest.approx(table.x, abs=1e-3)


def test_the_force_of_the_arm_on_a_body_is_opposite_to_the_load_on_its_cover() -> None:
    tip = (0.72, 0.0, 0.355)  # below the outer link at the start pose
    bodies = body("ball", positions=tip, mass=(0.2,), ground_friction=(0.0,))
    plant = plant_of(bodies=bodies)
    plant.data.joint("thing_pose").qvel[2] = 3.0
    for _ in range(60):
        plant.step([0.0] * 4)
        thing = plant.objects()[0]
        if loads := plant.loads():
            break
    (load,) = loads
    rotation = plant.data.site(f"{load.cover}_frame").xmat.reshape(3, 3)
    force = np.array((thing.arm_force_x, thing.arm_force_y, thing.arm_force_z))
    assert np.linalg.norm(force) > 1.0
    assert force == pytest.approx(-rotation @ load.force, rel=1e-9)


def test_objects_that_are_switched_off_leave_the_model_as_it_was() -> None:
    section = CONFIGURATION.sections["driver"]
    world = build_part(World, section, "world.")
    plain = World(world.obstacles, world.springs, world.pushers)
    assert all((world.bodies.names, world.doors.names, world.motions.obstacles))
    assert world.objects == ()
    assert mjcf(WAM, STEP, world, no_effects(WAM)) == mjcf(WAM, STEP, plain, no_effects(WAM))


def test_elastic_friction_of_the_arm_leaves_free_bodies_and_doors_alone() -> None:
    """They have torques of their own, which are behind those of the arm."""
    elastic = dataclasses.replace(
        COULOMB_STICTION, motor_presliding_stiffness=(50.0,), joint_presliding_stiffness=(400.0,)
    )
    found = []
    for friction in (COULOMB_STICTION, elastic):
        plant = Plant(WAM, World(TABLE, NO_SPRINGS, bodies=body(), doors=door()), no_effects(WAM), STEP, friction)
        plant.data.joint("thing_pose").qvel[0] = 0.6
        plant.data.joint("door_hinge").qvel[0] = 0.5
        play(plant, 0.1)
        found.append([plant.data.joint("thing_pose").qpos[0], plant.data.joint("door_hinge").qpos[0]])
    assert found[1] == pytest.approx(found[0], rel=1e-9)
    assert found[0][0] > 0.72


def test_the_inertia_is_that_of_a_uniform_body() -> None:
    random = np.random.default_rng(3)
    points = random.uniform(-1.0, 1.0, (400_000, 3))
    inside = {
        "box": (np.abs(points) <= 1.0).all(axis=1),
        "ball": (points**2).sum(axis=1) <= 1.0,
        "cylinder": (points[:, :2] ** 2).sum(axis=1) <= 1.0,
    }
    size = np.array((0.3, 0.3, 0.5))
    for shape, kept in inside.items():
        scale = size if shape != "ball" else size[[0, 0, 0]]
        square = ((points[kept] * scale) ** 2).mean(axis=0)
        expected = 2.0 * (square.sum() - square)
        given = {"box": scale, "ball": scale, "cylinder": (0.3, 0.5, 0.0)}[shape]
        assert principal_inertia(shape, given, 2.0) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(("change", "message"), [
    ({"bodies": {"sizes": (0.05, 0.0, 0.04)}}, "thing: world.bodies.sizes of a box begins with 0.05, 0, 0.04 m"),
    ({"bodies": {"names": ("table",)}}, "obstacles, pushers, bodies and doors are named table"),
    ({"doors": {"upper": (-0.1,)}}, "door: world.doors.lower is -3 rad, upper -0.1 rad; 0, the angle at power-up"),
    ({"motions": {"obstacles": ("shelf",)}}, "motions.obstacles names 'shelf'; obstacles: table"),
    ({"bodies": {"mass": (0.002,)}}, "'table' and body 'thing'; allowed: up to"),
    ({"bodies": {"stiffness": (1e8,)}}, "body 'thing' on inner_link; allowed: up to"),
    ({"doors": {"spring": (1e5,), "mass": (0.01,)}}, "too long for .*hinges; allowed: up to"),
])  # fmt: skip
def test_a_world_that_cannot_be_simulated_is_refused(change: dict[str, dict[str, Any]], message: str) -> None:
    given = {"bodies": body(), "doors": door(), "motions": motion((0.0, 0.0, 0.01), 0.5)}
    with pytest.raises(ParameterError, match=message):
        plant_of(**{name: dataclasses.replace(one, **change.get(name, {})) for name, one in given.items()})


@pytest.mark.slow
def test_the_objects_are_published_where_there_are_any() -> None:
    steps = [ScenarioStep("wait", 0.05)]
    plain = Simulation(CONFIGURATION, steps)
    plain.play()
    assert "sim/objects" not in plain.rows
    moving = {
        "driver:world.motions.amplitude": [0.0, 0.0, 0.01],
        "driver:world.motions.frequency": [1.0],
        "driver:world.doors.mass": [2.0],
    }
    simulation = Simulation(CONFIGURATION.with_values(moving), steps)
    simulation.play()
    rows = simulation.rows["sim/objects"]
    assert len(rows) == len(simulation.rows["sim/joint_states"])
    width = len(ObjectState._fields)
    door_state, surface = (ObjectState._make(rows[-1].values[width * i : width * (i + 1)]) for i in (0, 1))
    assert (door_state.object, surface.object) == (0.0, 1.0)
    assert door_state.angle == pytest.approx(0.0, abs=1e-9)
    assert math.isnan(surface.angle)
    assert surface.vz > 0.0


def test_a_reset_puts_every_object_back() -> None:
    plant = plant_of(bodies=body(), doors=door(), motions=motion((0.05, 0.0, 0.0), 0.5))
    start = plant.objects()
    plant.data.joint("door_hinge").qvel[0] = 1.0
    play(plant, 0.2)
    assert plant.objects()[1].angle > 0.1
    plant.reset()
    assert np.array(plant.objects()) == pytest.approx(np.array(start), nan_ok=True)


@pytest.mark.slow
@pytest.mark.parametrize("stiffness", [0.0, 4000.0])
def test_a_folded_elbow_is_stopped_by_the_links_that_touch(stiffness: float) -> None:
    """One force between the two tubes; its torque about the elbow is what the joint measures."""
    start, goal = (0.0, -1.0, 0.0, -1.2), (0.0, -1.0, 0.0, -1.45)
    given = {"arm.joints.start": list(start), "force_loop:guard.posture": list(start)}
    given |= {"driver:world.folding.stiffness": stiffness, "driver:world.obstacles.positions": [3.0, 3.0, 3.0]}
    steps = [ScenarioStep("release", 0.3, request="enable"), ScenarioStep("fold", 1.7, posture=goal)]
    run = Simulation(CONFIGURATION.with_values(given), steps)
    while not run.step():
        pass
    plant, body = run.driver.plant, RigidBody(WAM)
    loads = {load.cover: load for load in plant.loads()}
    assert set(loads) == ({"inner_link", "outer_link"} if stiffness else set())
    if stiffness:
        on = {name: body.cover_pose(plant.q, name).rotation @ np.array(load.force) for name, load in loads.items()}
        assert on["inner_link"] == pytest.approx(-on["outer_link"], abs=0.01)
        size = float(np.linalg.norm(on["outer_link"]))
        assert size > 20.0, "N"
        torques = run.estimate.external_torques
        assert abs(torques[3]) == pytest.approx(size * loads["outer_link"].position, rel=0.05)
        assert np.abs(torques[:3]).max() < 0.3, "N m: nothing else holds the arm"


IN_LINK = WAM.covers.names[0]  # a post and a ball are put on its axis


def on_the_axis(share: float = 0.5) -> np.ndarray:
    """Point of the first cover's axis at the start pose, (3,), m, base frame."""
    length = WAM.covers.length[0]
    return RigidBody(WAM).point(WAM.joints.start, IN_LINK, WAM.covers.on_axis(IN_LINK, share * length))


def one_obstacle(shape: str, position: np.ndarray, sizes: tuple[float, ...]) -> Obstacles:
    return Obstacles(
        ("post",), (4000.0,), (20.0,), (0.3,), (shape,), tuple(position.tolist()), (0.0,) * 3, sizes, (0.0,)
    )


@pytest.mark.parametrize(("world", "text"), [
    (World(one_obstacle("cylinder", on_the_axis(), (0.05, 0.5, 0.0)), NO_SPRINGS), "obstacle 'post' is "),
    (World(one_obstacle("box", on_the_axis(), (2.0, 2.0, 2.0)), NO_SPRINGS), "obstacle 'post' is "),
    (World(TABLE, NO_SPRINGS, bodies=body("ball", positions=tuple(on_the_axis().tolist()))), "body 'thing' is "),
    (World(TABLE, NO_SPRINGS, doors=door(positions=tuple(on_the_axis().tolist()))), "door 'door' is "),
    (
        World(
            one_obstacle("box", on_the_axis(), (0.1, 0.1, 0.1)),
            NO_SPRINGS,
            motions=Motions(("post",), (0.3, 0.0, 0.0), (0.5,), (1.0,)),
        ),
        "obstacle 'post' is ",
    ),
])  # fmt: skip
def test_what_is_inside_a_link_at_power_up_is_refused_with_link_and_depth(world: World, text: str) -> None:
    with pytest.raises(ParameterError) as refusal:
        Plant(WAM, world, no_effects(WAM), STEP)
    message = str(refusal.value)
    assert message.startswith("at power-up ")
    assert text in message
    assert f" mm inside cover '{IN_LINK}' of {WAM.covers.links[0]}" in message
    assert "move it away from the arm (world), or start the arm in another pose (arm.joints.start)" in message


@pytest.mark.parametrize(("depth", "is_refused"), [(-0.001, False), (0.001, False), (0.009, False), (0.03, True)])
def test_what_only_touches_a_link_at_power_up_is_permitted(depth: float, is_refused: bool) -> None:
    pose = RigidBody(WAM).cover_pose(WAM.joints.start, IN_LINK)
    aside = np.cross(pose.rotation[:, 0], (0.0, 1.0, 0.0))
    centre = on_the_axis() + aside * (WAM.covers.radius[0] + 0.04 - depth)
    world = World(TABLE, NO_SPRINGS, bodies=body("ball", positions=tuple(centre.tolist())))
    if is_refused:
        with pytest.raises(ParameterError, match=r"body 'thing' is 30\.1 mm inside"):
            Plant(WAM, world, no_effects(WAM), STEP)
    else:
        plant = Plant(WAM, world, no_effects(WAM), STEP)
        assert bool(plant.data.ncon) == (depth > 0.0)


def test_a_pusher_is_away_from_its_link_at_power_up_though_it_pushes_from_the_beginning_on() -> None:
    section = CONFIGURATION.sections["driver"]
    pushing = {**section, "world.pushers.force": (20.0,), "world.pushers.begin": (0.0,)}
    plant = Plant(WAM, build_part(World, pushing, "world."), no_effects(WAM), STEP)
    plant.step([0.0] * 4)
    assert all(np.linalg.norm(load.force) < 1.0 for load in plant.loads())


def test_an_arm_may_start_folded() -> None:
    configuration = Configuration.load(packaged("barrett-wam7")).with_values({"driver:world.folding.stiffness": 5e3})
    section, arm = configuration.sections["driver"], configuration.shared.arm
    assert Plant(arm, build_part(World, section, "world."), no_effects(arm), STEP).data.ncon
