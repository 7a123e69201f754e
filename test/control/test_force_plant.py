"""The force loop on the simulated arm where nothing is touched, behind poor amplifiers, with a load, led by a hand."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from arms import BODY, CONFIGURATION, WAM

from wam_control.force.contact_place import torque_of_position
from wam_control.force.force_loop_parameters import ForceLoopParameters, task_of
from wam_control.force.stability_guard import StabilityGuard
from wam_control.force.task import AxisKind, TaskCommand, joint_axes
from wam_control.task.scenario import Push, ScenarioStep
from wam_description.event import Code
from wam_description.signals import ForceCommand
from wam_sim.simulation import Simulation
from wam_studies.force_benchmark.outcome import TaskEnd
from wam_studies.force_benchmark.surfaces import Surface
from wam_studies.force_benchmark.tasks import RANGES, Task, configured, steps, triple
from wam_studies.force_benchmark.trial import perform

OUTER = "outer_link"
FAR_AWAY = {"driver:world.obstacles.positions": [3.0, 3.0, 3.0]}
POSE = (0.3, -1.2, 0.2, 1.0)
AGAINST = triple(-BODY.cover_pose(POSE, OUTER).rotation[:, 1])
MOTORS = {
    "arm.joint_sensors": False,
    "contact_estimator:use_joint_sensors": False,
    "force_loop:feedback": "contact_estimate",
    "timing.dither_cycle": 40,
}


def free_arm(q: tuple[float, ...], step: ScenarioStep, **changes: Any) -> Simulation:
    """A simulation of the arm released in free space, at its start."""
    given = {"arm.joints.start": list(q), "force_loop:guard.posture": list(q), **FAR_AWAY, **changes}
    configuration = CONFIGURATION.with_values(given)
    return Simulation(configuration, [ScenarioStep("release", RANGES.release, request="enable"), step])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("q", "newtons"), [((0.0, -1.0, 0.0, math.pi / 2.0 - 0.2), 15.0), ((-2.2, -1.03, 1.34, 0.7), 15.0)]
)
def test_in_free_space_a_force_moves_the_arm_without_chatter(q: tuple[float, ...], newtons: float) -> None:
    tip = BODY.point(q, OUTER, (WAM.covers.length[-1], 0.0, 0.0))
    command = ForceCommand("base", triple(newtons * tip / np.linalg.norm(tip)))
    given = {"force_loop:contact_source": "pinned", "force_loop:contact_position": 0.4, "force_loop:guard.mode": "warn"}
    run = free_arm(q, ScenarioStep("press", 1.2, force=command), **given)
    speeds = []
    while not run.step():
        speeds.append(run.driver.plant.qd)
    pressed = np.array(speeds)[round(1e3 * RANGES.release) :]
    assert np.abs(pressed).max() < 1.2, "rad/s"
    signs = np.sign(np.where(np.abs(pressed) < 0.3, 0.0, pressed)).T
    assert max(np.count_nonzero(np.diff(sign[sign != 0.0])) for sign in signs) <= 2, "turns at more than 0.3 rad/s"


@pytest.mark.slow
@pytest.mark.parametrize(("q", "place", "newtons"), [
    ((0.0, -1.5, 0.0, 1.3), 0.4064, (10.0, 0.0, 0.0)), ((-0.34, -1.08, -2.46, 2.17), 0.4, (27.6, -7.9, 4.9)),
])  # fmt: skip
def test_ahead_of_a_nearly_straight_arm_its_own_inertia_is_no_force(
    q: tuple[float, ...], place: float, newtons: tuple[float, ...]
) -> None:
    """Up to 240 N were measured in free space, at up to 2.4 rad/s, as the apparent mass has either sign here."""
    given = {"force_loop:contact_source": "pinned", "force_loop:contact_position": place}
    run = free_arm(q, ScenarioStep("press", 2.5, force=ForceCommand("base", triple(np.array(newtons)))), **given)
    speeds, measured, loop = [], [0.0], run.nodes["force_loop"]
    while not run.step():
        speeds.append(run.driver.plant.qd)
        assert loop.event.code not in (Code.OSCILLATING, Code.PUSHED)
        if run.rows["force_measured"] and not loop.event.holds:
            measured.append(math.hypot(*run.rows["force_measured"][-1].values[:3]))
    assert max(measured) < 0.2 * math.hypot(*newtons), "nothing is touched"
    signs = np.sign(np.where(np.abs(speeds) < 0.3, 0.0, speeds)).T
    assert max(np.count_nonzero(np.diff(sign[sign != 0.0])) for sign in signs) <= 1, "turns at more than 0.3 rad/s"


@pytest.mark.slow
def test_on_a_soft_surface_that_is_declared_a_force_follows_its_command() -> None:
    """0.1 s after a step from 5 to 10 N; the law alone had come to 7.7 N."""
    task = Task(POSE, Surface(OUTER, 0.28, AGAINST, 400.0, 0.3, is_plane=False), 10.0, before=5.0)
    run = Simulation(configured(CONFIGURATION, task), steps(task, 0.1))
    assert run.play() == ""
    assert math.hypot(*run.driver.true_contact.force) == pytest.approx(10.0, abs=0.6)


@pytest.mark.slow
def test_the_deadband_of_an_amplifier_does_not_freeze_the_force() -> None:
    """0.2 A: the integral of the velocity loop was lost where the current was 0, and 6.6 N stayed of 5."""
    task = Task(POSE, Surface(OUTER, 0.28, AGAINST, 4000.0, 0.3, is_plane=False), 5.0)
    result = perform(CONFIGURATION, task, 2.5, {"driver:amplifier.deadband": [0.2] * 4})
    assert result.outcome is TaskEnd.DONE
    assert result.mean == pytest.approx(5.0, rel=0.06)


def moved(seconds: float, *posture: float, **more: Any) -> ScenarioStep:
    return ScenarioStep("move", seconds, posture=posture, **more)


def pressed(newtons: float, seconds: float, at: float = 0.0, rise: float = 0.0) -> ScenarioStep:
    force = (0.0, -newtons, 0.0)
    return ScenarioStep("press", seconds, force=ForceCommand(OUTER, force, torque_of_position(force, at)), rise=rise)


REST, LOADED = (0.0, -1.0, 0.0, 1.0), {"driver:mismatch.payload": 0.3, "contact_estimator:observer.payload": (0.0, 0.5)}
LOWERED = moved(3.0, 0.0, -2.1, 0.0, 1.45, until_force=1.5)
ABOVE, STAY = moved(2.0, 0.0, -1.9, 0.0, 1.45), ScenarioStep("stay", 1.0)


@pytest.mark.slow
@pytest.mark.parametrize(("before", "press", "given"), [
    ([moved(2.8, *REST), moved(0.3, *REST, request="tare"), moved(1.5, 0.0, -1.8, 0.0, 1.45), LOWERED],
     pressed(8.0, 2.0), LOADED),  # tared in another pose
    ([moved(2.5, 0.0, -1.9, 0.0, 1.45)], pressed(8.0, 3.0, rise=0.5), {}),  # what rises from nothing
    ([ABOVE, STAY, pressed(20.0, 2.0, 0.26), STAY], pressed(5.0, 2.0, 0.26), {}),  # what the velocity loops carry
    ([moved(2.0, 0.0, -1.8, 0.0, 1.45), moved(1.0, 0.0, -1.93, 0.0, 1.45)], pressed(3.0, 4.0, 0.26), {}),  # in motion
])  # fmt: skip
def test_a_force_is_right_whatever_was_before(
    before: list[ScenarioStep], press: ScenarioStep, given: dict[str, Any]
) -> None:
    steps = [ScenarioStep("release", 0.3, request="enable"), *before, press]
    run = Simulation(CONFIGURATION.with_values(given), steps)
    assert run.play() == ""
    begin, newtons = run.played[-1].begin, math.hypot(*press.force.force)
    forces = [abs(row.values[1]) for row in run.rows["sim/contact/wrench"] if row.stamp >= begin]
    assert forces[-1] == pytest.approx(newtons, rel=0.04)
    assert max(forces) < 1.25 * max(newtons, forces[0])


@pytest.mark.slow
def test_the_guard_counts_a_payload() -> None:
    """Its margin is that of the loaded arm."""
    own, shared, scales = CONFIGURATION.node("force_loop", ForceLoopParameters), CONFIGURATION.shared, []
    for mass in (0.0, 0.5):
        loaded = replace(WAM, payload=mass)
        guard = StabilityGuard(loaded, shared.servo, shared.timing, own.guard, own.sensing_fed_back)
        scales.append(min(guard.scales(task_of(own), guard.contacts(own.guard.posture, OUTER, 0.28, 0.0))))
    assert abs(scales[1] / scales[0] - 1.0) > 0.1


@pytest.mark.slow
@pytest.mark.parametrize(("newtons", "least", "most"), [(1.0, 50.0, 200.0), (0.4, 0.0, 3.0)])
def test_a_hand_leads_the_arm_from_its_motors_with_the_dither(newtons: float, least: float, most: float) -> None:
    """Down to what friction allows: without the dither 3 N move it by 0.8 mm."""
    task = TaskCommand("base", joint_axes(AxisKind.IMPEDANCE, [None] * 4, 5.0))
    push, soft = Push(OUTER, 0.35, (0.0, newtons, 0.0), 0.5, 1.5), {"force_loop:guard.contact_stiffness": 100.0}
    run = free_arm(POSE, ScenarioStep("lead", 1.6, task=task, push=push), **MOTORS, **soft)
    places = []
    while not run.step():
        places.append(BODY.point(run.driver.plant.q, OUTER, (0.35, 0.0, 0.0)))
    moved = 1e3 * float(np.linalg.norm(places[2000] - places[1000]))
    assert least <= moved <= most, "mm"


@pytest.mark.slow
def test_a_spring_presses_from_its_motors_as_hard_as_it_is_compressed() -> None:
    """While a force counted only from where a contact was certain, it swung between 0 and 24 N."""
    q, inner, against = (-0.38, -0.83, 1.71, 1.01), "inner_link", (-0.3550, 0.6840, 0.6373)
    task = Task(q, Surface(inner, 0.4, against, 14000.0, 0.3, is_plane=False), 8.0, is_dithered=True)
    compressed = 8.0 / 12.0 * np.array(against) @ BODY.point_jacobian(q, inner, (0.4, 0.0, 0.0))
    springs = (axis._replace(stiffness=12.0) for axis in joint_axes(AxisKind.IMPEDANCE, (q + compressed).tolist(), 5.0))
    press = ScenarioStep("press", 4.0, request="enable", task=TaskCommand("base", tuple(springs)))
    run = Simulation(configured(CONFIGURATION, task), [press])
    assert run.play() == ""
    forces = [math.hypot(*row.values[:3]) for row in run.rows["sim/contact/wrench"][-200:]]
    assert forces == pytest.approx([8.0] * 200, abs=1.6)
