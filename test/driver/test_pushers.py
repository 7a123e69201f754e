"""Hands of the simulator that press on a link, and an arm that departs from the configured one; forces by hand."""

import dataclasses
import math
from typing import Any

import mujoco
import numpy as np
import pytest
from arms import NOWHERE, WAM, ideal_mjcf

from wam_description.effects import no_effects
from wam_description.mismatch import ModelMismatch, true_arm
from wam_description.parameters import ParameterError
from wam_description.world import NO_SPRINGS, Pushers, World
from wam_driver.plant import Plant

STEP = 5e-4
AS_CONFIGURED = ModelMismatch((1.0,) * 4, (1.0,) * 4, (1.0,) * 4, (1.0,) * 4, 0.0, (1.0,) * 4)
L3 = 0.5588


def hand(**values: Any) -> Pushers:
    """One hand, a frictionless sphere on the outer link by default."""
    given: dict[str, Any] = {
        "names": "hand", "shapes": "sphere", "covers": "outer_link", "positions": 0.25, "angles": 0.6, "force": 8.0,
        "begin": 0.05, "end": 0.4, "rise": 0.02, "clearance": 0.01, "slide": 0.0, "turn": 0.0, "stiffness": 2000.0,
        "damping": 10.0, "friction": 0.0,
    }  # fmt: skip
    sizes = values.pop("sizes", (0.04, 0.0, 0.0))
    return Pushers(sizes=sizes, **{key: (value,) for key, value in (given | values).items()})


def plant_of(pushers: Pushers) -> Plant:
    return Plant(WAM, World(NOWHERE, NO_SPRINGS, pushers), no_effects(WAM), STEP)


def run(plant: Plant, seconds: float, torque: float = 0.0) -> None:
    for _ in range(round(seconds / STEP)):
        plant.step([0.0, 0.0, 0.0, torque])


@pytest.mark.parametrize(("shape", "sizes"), [("sphere", (0.04, 0.0, 0.0)), ("box", (0.02, 0.04, 0.02))])
@pytest.mark.parametrize("angle", [0.6, -2.0])
def test_a_hand_presses_with_its_force_at_its_place(shape: str, sizes: tuple[float, ...], angle: float) -> None:
    plant = plant_of(hand(shapes=shape, sizes=sizes, angles=angle))
    run(plant, 0.045)
    assert plant.loads() == []
    assert plant.pushes_in_words() == ""
    run(plant, 0.155)
    assert plant.pushes_in_words() == "8 N on outer_link by hand"
    plant.push("inner_link", np.array((0.0, 0.0, 3.0)), np.zeros(3))
    assert plant.pushes_in_words() == "3 N on inner_link, 8 N on outer_link by hand"
    plant.push("inner_link", np.zeros(3), np.zeros(3))
    plant.push("outer_link", np.zeros(3), np.array((0.0, 0.0, 1e-6)))  # has no place
    (load,) = plant.loads()
    plant.release()
    force = 8.0 * np.array((0.0, math.cos(angle), math.sin(angle)))
    assert load.cover == "outer_link"
    # a flat side that lies along the tube may carry at its edge
    assert load.position == pytest.approx(0.25, abs=1e-3 if shape == "sphere" else 0.0201)
    assert np.abs(np.subtract(load.force, force)).max() < 0.05
    # the line of the force meets the tube's axis there
    assert np.abs(np.subtract(load.moment, np.cross((load.position, 0.0, 0.0), force))).max() < 0.02
    run(plant, 0.25)
    assert plant.loads() == []
    assert plant.pushes_in_words() == ""


def test_on_the_inner_link_the_moment_is_that_of_its_tilted_axis() -> None:
    plant = plant_of(hand(covers="inner_link", positions=0.3, angles=0.0))
    run(plant, 0.2)
    (load,) = plant.loads()
    axis_point = np.array((0.3, 0.0, 0.3 / L3 * 0.04064))
    assert np.abs(np.subtract(load.force, (0.0, 8.0, 0.0))).max() < 0.05
    assert np.abs(np.subtract(load.moment, np.cross(axis_point, load.force))).max() < 0.02


def test_a_hand_keeps_contact_with_a_link_that_swings_away_from_it() -> None:
    plant = plant_of(hand(begin=0.02))
    plant.brake(False)
    forces, speeds = [], []
    for tick in range(700):
        swing = math.sin(2.0 * math.pi * 4.0 * tick * STEP)
        plant.step([0.3 * swing, 0.4 * swing, -0.3 * swing, 0.2 * swing])
        speeds.append(max(map(abs, plant.qd)))
        if 120 <= tick < 700:
            (load,) = plant.loads()
            forces.append(math.hypot(*load.force))
    assert max(speeds) > 2.0
    assert min(forces) == pytest.approx(8.0, rel=0.02)
    assert max(forces) == pytest.approx(8.0, rel=0.02)


@pytest.mark.parametrize("way", [-1.0])
def test_a_hand_that_slides_rubs_along_the_link_with_its_friction(way: float) -> None:
    """Slip is that against the hand: MuJoCo itself takes a moved body to be at rest."""
    plant = plant_of(hand(friction=0.4, slide=0.05 * way))
    run(plant, 0.2)
    (load,) = plant.loads()
    assert load.force[0] == pytest.approx(way * 0.4 * 8.0, rel=0.02)
    resting = plant_of(hand(friction=0.4))
    run(resting, 0.2)
    (load,) = resting.loads()
    assert abs(load.force[0]) < 0.05 * 8.0
    assert load.position == pytest.approx(0.25, abs=1e-3)


def test_a_hand_that_turns_round_the_link_twists_it() -> None:
    plant = plant_of(hand(friction=0.4, turn=0.5, angles=0.0))
    run(plant, 0.2)
    (load,) = plant.loads()
    # a frictionless force has no moment about the axis; friction acts half way into the surface, 4 mm deep
    assert abs(load.moment[0]) == pytest.approx(0.4 * 8.0 * (WAM.covers.radius[1] - 0.002), rel=0.01)


@pytest.mark.parametrize(("values", "message"), [
    ({"end": 0.06}, "hand: world.pushers.end is 0.06 s"),
    ({"sizes": (0.0, 0.0, 0.0)}, "hand: world.pushers.sizes of a sphere"),
    ({"names": ""}, "give each a name of its own"),
])  # fmt: skip
def test_hands_that_cannot_be_are_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        hand(**values)


@pytest.mark.parametrize(
    ("values", "message"),
    [({"covers": "sleeve"}, "presses on 'sleeve'; covers: inner_link"), ({"names": "outer_link"}, "rename it")],
)
def test_hands_that_do_not_fit_the_arm_are_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        plant_of(hand(**values))


def test_a_hand_without_force_is_not_in_the_model() -> None:
    assert ideal_mjcf(WAM, STEP, NOWHERE).count("mocap") == 0
    assert plant_of(hand(force=0.0)).model.nmocap == 0
    assert plant_of(hand()).model.nmocap == 1


def test_model_mismatch_is_in_the_compiled_plant() -> None:
    mismatch = ModelMismatch(
        (1.1, 1.0, 0.9, 1.0), (1.2, 1.0, 1.0, 1.0), (1.0, 0.8, 1.0, 1.0), (1.0, 1.0, 1.0, 1.5), 0.0, (1.0,) * 4
    )
    arm = true_arm(WAM, mismatch)
    before, after = (mujoco.MjModel.from_xml_string(ideal_mjcf(a, STEP, NOWHERE)) for a in (WAM, arm))
    ratio = [after.body(name).mass[0] / before.body(name).mass[0] for name in WAM.links.names]
    assert ratio == pytest.approx([1.1, 1.0, 0.9, 1.0])
    assert (after.dof_frictionloss / before.dof_frictionloss).tolist() == pytest.approx([1.2, 1, 1, 1, 1, 0.8, 1, 1])
    stiffness = (after.tendon_stiffness / before.tendon_stiffness)[::2].tolist()  # of one strand of each
    assert stiffness == pytest.approx([1.0, 1.0, 1.0, 1.5])


def test_a_payload_weighs_at_the_tool() -> None:
    """Arm stretched out level: joint 4 carries m g L4 more, and its inertia grows by m L4^2."""
    stretched = (0.0, -math.pi / 2, 0.0, math.pi / 2)
    level = dataclasses.replace(WAM, joints=dataclasses.replace(WAM.joints, start=stretched))
    loaded = true_arm(level, dataclasses.replace(AS_CONFIGURED, payload=0.2))
    bias, inertia = [], []
    for arm in (level, loaded):
        plant = Plant(arm, World(NOWHERE, NO_SPRINGS), no_effects(arm), STEP)
        mujoco.mj_forward(plant.model, plant.data)
        bias.append(plant.data.qfrc_bias[7])
        column = np.zeros(8)
        mujoco.mj_mulM(plant.model, plant.data, column, np.eye(8)[7])
        inertia.append(column[7])
    assert abs(bias[1] - bias[0]) == pytest.approx(0.2 * 9.80665 * 0.4064, rel=1e-6)
    assert inertia[1] - inertia[0] == pytest.approx(0.2 * 0.4064**2, rel=1e-6)


def test_departures_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ParameterError, match=r"mismatch.mass.*3 values"):
        true_arm(WAM, dataclasses.replace(AS_CONFIGURED, mass=(1.0,) * 3))
