"""What may ever touch, against distances that MuJoCo measures; and steps without halves against steps with them."""

import math
from typing import Any

import mujoco
import numpy as np
import pytest
from arms import WAM, changed, ideal_plant

from wam_description.configuration import Configuration, packaged
from wam_description.world import NO_SPRINGS, Obstacles, World
from wam_driver.driver import DriverParameters
from wam_driver.plant import Plant
from wam_driver.reach import within_reach

STEP = 5e-4
TURNING = changed(WAM, joints={"lower": (-50.0,) * 4, "upper": (50.0,) * 4})  # at every angle
NONE = np.zeros(3)
FAR, NEAR = -1.5, -1.1  # m, height of a floor; the stretched arm reaches 1.07 m


def one(shape: str, place: np.ndarray, turn: np.ndarray, size: tuple[float, float, float]) -> Obstacles:
    surface = (1e4,), (0.0,), (0.0,), (0.0,)
    return Obstacles(("thing",), (shape,), tuple(place.tolist()), tuple(turn.tolist()), size, *surface)


def pairs(model: Any) -> list[tuple[int, int]]:
    return list(zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True))


def may_touch(plant: Plant) -> bool:
    return any(within_reach(plant.model, *pair) for pair in pairs(plant.model))


def touches(plant: Plant, rng: np.random.Generator, poses: int) -> bool:
    """Whether MuJoCo finds a contact at one of so many random poses."""
    model, data = plant.model, plant.data
    for _ in range(poses):
        data.qpos[4:8] = rng.uniform(-math.pi, math.pi, 4)
        mujoco.mj_fwdPosition(model, data)
        if data.ncon:
            return True
    return False


@pytest.mark.parametrize("seed", range(4))
def test_what_is_called_out_of_reach_is_touched_in_no_pose(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = ("box", "cylinder", "plane")[seed % 3]
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    sizes = rng.uniform(0.02, 0.3, 3)
    size = {"plane": (3.0, 3.0, 0.0), "cylinder": (*sizes[:2], 0.0)}.get(shape, tuple(sizes))
    turn = np.array([math.atan2(way[1], -way[2]), math.asin(np.clip(-way[0], -1, 1)), 0.0])  # a plane faces the base
    said, found = [], []
    for distance in np.linspace(0.7, 2.2, 16):
        plant = ideal_plant(TURNING, one(shape, way * distance, turn, size), STEP)
        said.append(may_touch(plant))
        found.append(touches(plant, rng, 300))
        assert said[-1] or not found[-1]
    assert {True, False} == {*said} == {*found}


@pytest.mark.parametrize(("name", "expected"), [("wam", True), ("testbed", False), ("barrett-wam7", True)])
def test_the_foam_box_is_within_reach_and_the_bench_of_the_testbed_is_not(name: str, expected: bool) -> None:
    configuration = Configuration.load(packaged(name))
    driver = configuration.node("driver", DriverParameters)
    assert may_touch(Plant(configuration.shared.arm, driver.world, driver.effects, STEP)) is expected


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("<body><joint type='hinge'/>{}</body>", False),
        ("<body pos='2 0 0'><joint type='hinge'/>{}</body>", True),
        ("<body><joint type='hinge' pos='0 1 0'/>{}</body>", True),
        ("<body><joint type='slide'/>{}</body>", True),
        ("<body><freejoint/>{}</body>", True),
        ("<body mocap='true'>{}</body>", True),
    ],
)
def test_only_what_turns_about_the_base_stays_near_it(body: str, expected: bool) -> None:
    """A ball of 0.1 m, and one that is fixed 2 m away."""
    ball = "<geom size='0.1' mass='1'/>"
    world = body.format(ball) + "<geom size='0.1' pos='2 0 0'/>"
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{world}</worldbody></mujoco>")
    fixed = int(np.flatnonzero(model.geom_bodyid == 0)[0])
    assert within_reach(model, fixed, 1 - fixed) is within_reach(model, 1 - fixed, fixed) is expected


def test_a_step_in_one_is_that_in_two_halves_bit_for_bit() -> None:
    """Two floors that are not touched, one of them out of reach; a push in between, which needs the halves."""
    stories = []
    for height in (FAR, NEAR):
        world = World(one("plane", np.array([0.0, 0.0, height]), NONE, (3.0, 3.0, 0.0)), NO_SPRINGS)
        configuration = Configuration.load(packaged("wam"))
        plant = Plant(WAM, world, configuration.node("driver", DriverParameters).effects, STEP)
        assert plant._advance is None, "in plain Python; the steps in C are always two halves"
        assert may_touch(plant) is (height == NEAR)
        plant.brake(False)
        story = []
        for k in range(600):
            if k == 200:
                plant.push("outer_link", np.array([0.0, 5.0, 1.0]), NONE)
            if k == 300:
                plant.release()
            plant.step([0.3, -0.4 * math.sin(k / 50.0), 0.2, 0.1], 2)
            story += [*plant.theta, *plant.thetad, *plant.q, *plant.qd, *plant.strain_torque, *plant.cable_torque]
        assert plant.data.ncon == 0
        stories.append(story)
    assert stories[0] == stories[1]
