"""A payload that is declared, `arm.payload`: one fact for gravity, guard, force loop, estimator and plant."""

import dataclasses

import mujoco
import pytest
from arms import CONFIGURATION, NOWHERE, WAM, ideal_mjcf

from wam_control.contact_estimator import ContactEstimatorParameters
from wam_control.momentum_observer import MomentumObserver
from wam_description.mismatch import true_arm
from wam_description.rigid_body import RigidBody
from wam_description.signals import State
from wam_driver.driver import DriverParameters
from wam_experiments.force_benchmark.outcome import TaskEnd
from wam_experiments.force_benchmark.surfaces import Surface
from wam_experiments.force_benchmark.tasks import Task, triple
from wam_experiments.force_benchmark.trial import perform

MASS = 0.5  # kg
STEP = CONFIGURATION.shared.timing.substep
LOADED = dataclasses.replace(WAM, payload=MASS)
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
        assert (max(map(abs, observer.torques()[0])) > 0.5) is feels


@pytest.mark.slow
def test_one_newton_is_pressed_with_half_a_kilogram_at_the_tool() -> None:
    """Not declared, it would make an error of 4.6 N, and is refused."""
    q = (0.0, -1.8, 0.0, 1.45)
    direction = triple(-RigidBody(WAM).cover_pose(q, "outer_link").rotation[:, 1])
    task = Task(q, Surface("outer_link", 0.28, direction, 4000.0, 0.3, False), 1.0)
    pinned = {"force_loop:contact_source": "pinned"}
    known = perform(CONFIGURATION, task, 2.5, {**pinned, "arm.payload": MASS})
    assert known.mean == pytest.approx(1.0, abs=0.2)
    unknown = perform(CONFIGURATION, task, 1.0, {**pinned, "driver:mismatch.payload": MASS})
    assert unknown.outcome is TaskEnd.REFUSED
    assert "as with 0.48 kg at the tool" in unknown.reason
