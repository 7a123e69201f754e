"""What a plant can have besides, off by default: each holds what it promises, and without it that does not hold."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from arms import NOWHERE, WAM, changed, frictionless, one_joint

from wam_description.configuration import Configuration, packaged
from wam_description.contact_pairs import contact_pairs
from wam_description.effects import no_effects
from wam_description.parameters import ParameterError, build, fields, values
from wam_description.world import NO_SPRINGS, World
from wam_driver.amplifier import Amplifier
from wam_driver.driver import Driver, DriverParameters
from wam_driver.plant import Plant

STEP = 5e-4
CONFIGURATION = Configuration.load(packaged("plain-motors"))
GIVEN = CONFIGURATION.node("driver", DriverParameters)
WIDE = {"lower": (-9.0,), "upper": (9.0,)}
ARM = changed(frictionless(one_joint()), gravity=(0.0, 0.0, 0.0), cables={"damping": (0.06,)}, joints=WIDE)
N, CABLE, PINION, PRETENSION = 14.0, 8.33, 0.01, 300.0  # of one_joint(): ratio, k_tr N m/rad, m, N
STRAND = CABLE / (2 * PINION**2)  # N/m, of 1 m: E A


def plant_of(**effects: Any) -> Plant:
    made = Plant(ARM, World(NOWHERE, NO_SPRINGS), dataclasses.replace(no_effects(ARM), **effects), STEP)
    made.brake(False)
    return made


def test_options_are_off_where_a_configuration_does_not_name_them() -> None:
    found = {f.name: f.default for f in fields(DriverParameters) if not f.is_required}
    assert found == {
        "world.cover_stiffness": 0.0,
        "effects.terminated": False,
        "effects.capstan": 0.0,
        "friction.warm_drop": 0.0,
        "amplifier.bandwidth": 0.0,
        "amplifier.delay": 0,
    }
    without = {name: value for name, value in values(GIVEN).items() if name not in found}
    assert build(DriverParameters, without) == GIVEN


@pytest.mark.parametrize(("terminated", "passages"), [(False, [1.0, 2.0, 3.0, 4.0]), (True, [0.5, 0.5, 0.5, 0.5])])
def test_creep_adds_up_unless_the_cables_end_on_the_pulleys(terminated: bool, passages: list[float]) -> None:
    """Under 4 N m at the motor; passages of 2 rad, in units of (6.19) for one; 3 % for parts of 0.05 rad."""
    plant, torque = plant_of(creep=True, terminated=terminated), 4.0
    plant.brake(True)
    plant.data.qfrc_applied[1] = -N * torque
    for _ in range(4000):
        plant.step([0.0])
    plant.brake(False)
    begin, crept = plant.theta[0] - N * plant.q[0], []
    for way in (1.0, -1.0, 1.0, -1.0):
        for _ in range(4000):
            plant.data.qvel[:] = way, way / N
            plant.step([torque])
        crept.append(plant.theta[0] - N * plant.q[0] - begin)
    assert crept == pytest.approx([part * 2.0 * torque / (PINION * STRAND) for part in passages], rel=0.03)


@pytest.mark.parametrize(("capstan", "limit"), [(0.0, math.inf), (1.5, 2.0 * PRETENSION * PINION * math.tanh(0.75))])
def test_cable_slips_as_a_whole_at_the_limit_of_the_capstan(capstan: float, limit: float) -> None:
    plant, found = plant_of(capstan=capstan), []
    for k in range(1000):
        plant.data.qpos[:], plant.data.qvel[:] = (1e-3 * k, 0.0), (1e-3 / STEP, 0.0)
        plant.step([0.0])
        found.append(plant.circuit_torque[0] - 0.06 * 1e-3 / STEP)
    assert found == pytest.approx([min(CABLE * 1e-3 * k, limit) for k in range(1000)], abs=1e-6)


def test_a_cable_that_ends_on_its_pulleys_does_not_slip() -> None:
    both = dataclasses.replace(no_effects(WAM), terminated=True, capstan=1.0)
    with pytest.raises(ParameterError, match=r"effects\.capstan is 1, and effects\.terminated is true"):
        both.require_fit(WAM)


@pytest.mark.parametrize(("cover", "share"), [(0.0, 1.0), (4000.0, 0.5), (1000.0, 0.2)])
def test_a_soft_cover_is_in_series_with_what_the_world_has(cover: float, share: float) -> None:
    world = dataclasses.replace(GIVEN.world, cover_stiffness=cover)
    rigid = {pair.name: pair for pair in contact_pairs(WAM, GIVEN.world)}
    for pair in contact_pairs(WAM, world):
        assert pair.stiffness == pytest.approx(share * rigid[pair.name].stiffness)
        assert pair.damping == pytest.approx(share**2 * rigid[pair.name].damping)


def test_a_hardening_surface_under_a_cover_is_exact_to_second_order() -> None:
    obstacles = dataclasses.replace(GIVEN.world.obstacles, hardening=(2.0,))
    world = dataclasses.replace(GIVEN.world, obstacles=obstacles, cover_stiffness=4000.0)
    pair = next(iter(contact_pairs(WAM, world)))
    for x in (1e-3, 2e-3):
        inside = (
            -8000.0 + math.sqrt(8000.0**2 + 4.0 * 8000.0 * 4000.0 * x)
        ) / 16000.0  # 4000 s (1 + 2 s) = 4000 (x - s)
        assert pair.stiffness * x * (1.0 + pair.hardening * x) == pytest.approx(
            4000.0 * (x - inside), rel=2.0 * x * x * 2
        )


@pytest.mark.parametrize(("bandwidth", "delay"), [(0.0, 0), (0.0, 3), (80.0, 0), (80.0, 2)])
def test_current_follows_after_delay_and_lag(bandwidth: float, delay: int) -> None:
    slow = dataclasses.replace(GIVEN.amplifier, bandwidth=bandwidth, delay=delay)
    amplifier = Amplifier(WAM.motors, slow, np.random.default_rng(0))
    for _ in range(2):
        found = [amplifier.step([1.0, 1e3, -2.0, 0.0], 1e-3) for _ in range(10)]
        rate = 2e-3 * math.pi * bandwidth if bandwidth else math.inf
        expected = [1.0 - math.exp(-rate * (k - delay)) if k > delay else 0.0 for k in range(1, 11)]
        assert [row[0] for row in found] == pytest.approx(expected)
        assert [row[2] for row in found] == pytest.approx([-2.0 * value for value in expected])
        assert [row[1] for row in found] == pytest.approx([amplifier.peak[1] * value for value in expected])
        amplifier.cut()


@pytest.mark.parametrize("drop", [0.0, 0.3])
def test_hot_motors_have_less_dry_friction(drop: float) -> None:
    """Motor 1 at its rated torque against its joint's friction: after a while the winding is at its limit."""
    friction = dataclasses.replace(GIVEN.friction, warm_drop=drop)
    given = dataclasses.replace(GIVEN, friction=friction, world=World(NOWHERE, NO_SPRINGS))
    driver = Driver(CONFIGURATION.shared, given)
    driver.amplifier.heat = [0.5, 1.0, 0.0, 2.0]
    cold = list(driver.plant._friction.levels)
    for _ in range(CONFIGURATION.shared.timing.outer_divisor + 1):
        driver.advance(0.0)
    left = [1.0 - 0.5 * drop, 1.0 - drop, 1.0, 1.0 - drop, 1.0, 1.0, 1.0, 1.0]
    expected = [level * part for level, part in zip(cold, left, strict=True)]
    assert driver.plant._friction.levels == pytest.approx(expected, rel=1e-3)
