"""A payload that is declared, `arm.payload`: one fact for gravity, guard, force loop, estimator and plant."""

import dataclasses
import math

import mujoco
import numpy as np
import pytest
from arms import CONFIGURATION, NOWHERE, WAM, ideal_mjcf, ideal_plant

from wam_control.contact.contact_estimator import ContactEstimatorParameters
from wam_control.contact.momentum_observer import MomentumObserver
from wam_control.task.scenario import ScenarioStep
from wam_description.event import Code
from wam_description.mismatch import true_arm
from wam_description.rigid_body import RigidBody
from wam_description.signals import ForceCommand, State
from wam_driver.driver import DriverParameters
from wam_sim.simulation import Simulation
from wam_studies.force_benchmark import surfaces
from wam_studies.force_benchmark.outcome import TaskEnd
from wam_studies.force_benchmark.surfaces import Surface
from wam_studies.force_benchmark.tasks import RANGES, Task, configured, triple
from wam_studies.force_benchmark.trial import perform

MASS = 0.5  # kg
STEP = CONFIGURATION.shared.timing.substep
LOADED = dataclasses.replace(WAM, payload=MASS)
DEMO = (0.0, -1.8, 0.0, 1.45)
PINNED = {"force_loop:contact_source": "pinned"}
POSE = (0.4, -1.1, 0.3, 0.9)


@pytest.mark.parametrize("tool", [WAM.tool, (0.4, 0.1, -0.05)])
def test_it_adds_the_weight_and_inertia_of_a_point_at_the_tool(tool: tuple[float, float, float]) -> None:
    """Also where it turns the principal axes of the last link."""
    bare = dataclasses.replace(WAM, tool=tool)
    before, after = RigidBody(bare), RigidBody(dataclasses.replace(bare, payload=MASS))
    jacobian = before.tool_jacobian(POSE)
    added = after.gravity_torque(POSE) - before.gravity_torque(POSE)
    assert added == pytest.approx(MASS * 9.80665 * jacobian[2])
    assert after.mass_matrix(POSE) - before.mass_matrix(POSE) == pytest.approx(MASS * jacobian.T @ jacobian)


def test_the_plant_carries_it_besides_what_nobody_knows_of() -> None:
    unknown = dataclasses.replace(CONFIGURATION.node("driver", DriverParameters).mismatch, payload=0.1)
    for arm, mass in ((LOADED, MASS), (true_arm(LOADED, unknown), MASS + 0.1)):
        model = mujoco.MjModel.from_xml_string(ideal_mjcf(arm, STEP, NOWHERE))
        data = mujoco.MjData(model)
        data.qpos[4:] = POSE
        mujoco.mj_forward(model, data)
        weight = mass * 9.80665 * RigidBody(WAM).tool_jacobian(POSE)[2]
        assert data.qfrc_bias[4:] - RigidBody(WAM).gravity_torque(POSE) == pytest.approx(weight, abs=1e-9)
        assert model.body("link4").mass[0] == pytest.approx(WAM.links.mass[3] + mass)


def test_the_estimator_feels_nothing_of_it() -> None:
    own = CONFIGURATION.node("contact_estimator", ContactEstimatorParameters).observer
    exact = dataclasses.replace(own, mass_scale=(1.0,) * 4)
    strain = RigidBody(LOADED).gravity_torque(POSE).tolist()
    for arm, feels in ((LOADED, False), (WAM, True)):
        observer = MomentumObserver(arm, exact, use_joint_sensors=True)
        for _ in range(200):
            observer.observe(State(list(POSE), [0.0] * 4, strain), 0.001)
        assert (max(map(abs, observer.torques()[0])) > 0.5) == feels


def contacts(values: dict[str, object]) -> list[float]:
    """Probability of a link in each period of a free motion with a rest that has a contact."""
    places = ([0.0, -1.2, 0.0, 1.0], [0.8, -0.6, 0.4, 1.4], [-0.6, -1.4, -0.3, 0.3])
    steps = [*(ScenarioStep("go", 1.5, posture=q) for q in places), ScenarioStep("rest", 1.2)]
    free = {"driver:world.obstacles.positions": [5.0, 0.0, -2.0]}
    run, found = Simulation(CONFIGURATION.with_values(free | values), [steps[0]._replace(request="enable"), *steps]), []
    while not run.step():
        found += [sum(one.probability for one in run.estimate.hypotheses)] * run.estimate.in_contact
    return found


@pytest.mark.slow
def test_a_mass_that_joint_sensors_feel_in_motion_is_no_contact() -> None:
    for most in (0.0, 0.6):
        found = contacts({"driver:mismatch.payload": 0.3, "contact_estimator:observer.payload": [0.0, most]})
        assert not found if most else np.median(found) < 0.1


@pytest.mark.slow
def test_friction_above_that_of_the_model_is_no_contact_at_rest() -> None:
    more = {"driver:mismatch.motor_friction": [1.2] * 4, "driver:mismatch.joint_friction": [1.2] * 4}
    assert contacts({**more, "contact_estimator:use_joint_sensors": False}) == []


@pytest.mark.slow
@pytest.mark.parametrize(("mass", "side", "force"), [(0.1, -1.0, 10.0), (2.0, 1.0, 30.0)])
def test_a_force_is_refused_by_the_mass_that_nobody_knows_of(mass: float, side: float, force: float) -> None:
    """10 N were 11.2 N with 0.1 kg, and 13.5 N with 0.3 kg, without a reason."""
    direction = triple(side * RigidBody(WAM).cover_pose(DEMO, "outer_link").rotation[:, 1])
    task = Task(DEMO, Surface("outer_link", 0.28, direction, 4000.0, 0.3, False), force)
    found = perform(CONFIGURATION, task, 0.6, {**PINNED, "driver:mismatch.payload": mass})
    assert "a load that is not in the model" in found.reason
    assert found.peak < 0.1 * force


@pytest.mark.slow
def test_an_error_of_less_than_a_tenth_is_reported_where_less_force_is_commanded() -> None:
    """0.08 kg are 0.9 N."""
    direction = triple(-RigidBody(WAM).cover_pose(DEMO, "outer_link").rotation[:, 1])
    given = configured(CONFIGURATION, Task(DEMO, Surface("outer_link", 0.28, direction, 4000.0, 0.3, False), 8.0))
    run = Simulation(
        given.with_values({**PINNED, "driver:mismatch.payload": 0.08}),
        [
            ScenarioStep("release", RANGES.release, request="enable"),
            *(
                ScenarioStep(f"{force} N", seconds, force=ForceCommand("base", triple(force * np.array(direction))))
                for force, seconds in ((12.0, 0.8), (3.0, 2.5))
            ),
        ],
    )
    found, node = [], run.nodes["force_loop"]
    while not run.step():
        found.append(node.event)
    assert found[-500].code is Code.REFUSED
    assert found[-500].values["error"] == pytest.approx(0.9, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("about", [0.0, 120.0])
def test_a_press_that_starts_in_contact_goes_on(about: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(surfaces, "SHAPE", dataclasses.replace(surfaces.SHAPE, gap=-1e-3))
    local = np.array([0.0, -math.cos(math.radians(about)), math.sin(math.radians(about))])
    direction = triple(RigidBody(WAM).cover_pose(DEMO, "outer_link").rotation @ local)
    task = Task(DEMO, Surface("outer_link", 0.28, direction, 4000.0, 0.3, False), 10.0)
    assert perform(CONFIGURATION, task, 1.5, PINNED).mean == pytest.approx(10.0, rel=0.05)


@pytest.mark.slow
def test_one_newton_is_pressed_with_half_a_kilogram_at_the_tool() -> None:
    """Not declared, it would make an error of 4.6 N, and is refused."""
    direction = triple(-RigidBody(WAM).cover_pose(DEMO, "outer_link").rotation[:, 1])
    task = Task(DEMO, Surface("outer_link", 0.28, direction, 4000.0, 0.3, False), 1.0)
    known = perform(CONFIGURATION, task, 2.5, {**PINNED, "arm.payload": MASS})
    assert known.mean == pytest.approx(1.0, abs=0.2)
    unknown = perform(CONFIGURATION, task, 1.0, {**PINNED, "driver:mismatch.payload": MASS})
    assert unknown.outcome is TaskEnd.REFUSED
    assert "a load that is not in the model" in unknown.reason


def test_a_mass_picked_up_in_motion_is_carried_as_if_the_arm_had_it_and_reset_sets_it_down() -> None:
    """The same state with the same mass moves alike from then on; picking it up changes no velocity."""
    plants = [ideal_plant(arm, NOWHERE, STEP) for arm in (WAM, LOADED)]
    bare, loaded = plants
    for plant in plants:
        plant.brake(False)
    bare.step([0.02, -0.1, 0.05, 0.1], 100)
    before = bare.qd
    bare.carry(MASS)
    assert bare.qd == before
    for kept in ("qpos", "qvel", "act", "plastic", "qacc_warmstart", "time"):
        if hasattr(bare.data, kept):
            setattr(loaded.data, kept, getattr(bare.data, kept))
    for plant in plants:
        plant.step([0.02, -0.1, 0.05, 0.1], 50)
    assert bare.qd == pytest.approx(loaded.qd, abs=1e-9)
    light = ideal_plant(WAM, NOWHERE, STEP)
    light.brake(False)
    light.step([0.02, -0.1, 0.05, 0.1], 150)
    assert np.abs(np.subtract(bare.qd, light.qd)).max() > 1e-2
    bare.reset()
    assert bare.model.body("link4").mass[0] == pytest.approx(WAM.links.mass[3])


@pytest.mark.slow
def test_a_force_that_is_commanded_while_the_arm_moves_fast_waits_until_it_is_at_rest() -> None:
    given = {
        **PINNED,
        "arm.joints.start": [-0.9, *DEMO[1:]],
        "force_loop:guard.posture": list(DEMO),
        "driver:world.obstacles.positions": [3.0, 3.0, 3.0],
    }
    down = triple(-10.0 * RigidBody(WAM).cover_pose(DEMO, "outer_link").rotation[:, 1])
    steps = [
        ScenarioStep("release", RANGES.release, request="enable"),
        ScenarioStep("move", 0.43, posture=DEMO),
        ScenarioStep("press", 1.1, posture=DEMO, force=ForceCommand("base", down)),
    ]
    run = Simulation(CONFIGURATION.with_values(given), steps)
    loop, causes = run.nodes["force_loop"], list[str]()
    while not run.step():
        if loop.event.holds and loop.event.cause not in causes[-1:]:
            causes.append(str(loop.event.cause))
    assert causes == ["moved_fast"]
    assert not loop.event.holds


@pytest.mark.slow
def test_a_mass_that_the_arm_showed_before_it_touched_is_no_force() -> None:
    """10 N were 13 N with 0.3 kg, commanded while the arm came down on the surface."""
    steps = [
        ScenarioStep("release", 0.3, request="enable"),
        ScenarioStep("above", 1.2, posture=(0.0, -1.8, 0.0, 1.45)),
        ScenarioStep("lower", 3.0, posture=(0.0, -2.1, 0.0, 1.45), until_force=1.5),
        ScenarioStep("press", 1.0, force=ForceCommand("outer_link", (0.0, -10.0, 0.0))),
    ]
    load = {"driver:mismatch.payload": 0.3, "contact_estimator:observer.payload": [0.0, 0.6]}
    run = Simulation(CONFIGURATION.with_values(load), steps)
    assert not run.play()
    assert "a load that is not in the model" in run.unmet
