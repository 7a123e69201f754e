"""Forces that are held for long, and what presses on while the force loop holds the arm: the simulator's force."""

from typing import Any

import numpy as np
import pytest
from arms import BODY, CONFIGURATION
from test_force_plant import MOTORS

from wam_control.force.task import AxisKind, TaskAxis, TaskCommand, unit
from wam_control.task.scenario import Push, ScenarioStep
from wam_description.event import Code
from wam_description.signals import ForceCommand
from wam_driver.loads import contact_force
from wam_sim.simulation import Simulation
from wam_studies.force_benchmark.surfaces import NAMES, Surface, obstacles
from wam_studies.force_benchmark.tasks import RANGES, Task, configured, steps, triple
from wam_studies.force_benchmark.trial import TaskWatch

pytestmark = pytest.mark.slow  # seconds each: the plant in contact

OUTER, PLACE = "outer_link", 0.28
POSE = (0.0, -1.8, 0.0, 1.45)  # of the demonstration
DIRECTION = triple(-BODY.cover_pose(POSE, OUTER).rotation[:, 1])


def pressed(stiffness: float, *steps: ScenarioStep, **changes: Any) -> tuple[np.ndarray, list[Code]]:
    """True force on a rod across the outer link, N, and reaction in each inner period of the steps."""
    surface = Surface(OUTER, PLACE, DIRECTION, stiffness, 0.3, is_plane=False)
    given = {
        "arm.joints.start": list(POSE),
        "force_loop:guard.posture": list(POSE),
        "force_loop:guard.contact_stiffness": stiffness,
        "force_loop:contact_source": "pinned",
        "force_loop:contact_cover": OUTER,
        "force_loop:contact_position": PLACE,
        **obstacles(BODY, POSE, [surface]),
        **changes,
    }
    configuration = CONFIGURATION.with_values(given)
    run = Simulation(configuration, [ScenarioStep("release", RANGES.release, request="enable"), *steps])
    model, data = run.driver.plant.model, run.driver.plant.data
    rod, forces, reactions = model.geom(NAMES[0]).id, [], []
    while not run.step():
        pressing = [i for i in range(data.ncon) if rod in data.contact.geom[i]]
        forces.append(sum(abs(np.dot(DIRECTION, contact_force(model, data, i))) for i in pressing))
        reactions.append(run.nodes["force_loop"].event.code)
    begin = round(1e3 * RANGES.release)
    return np.array(forces[begin:]), reactions[begin:]


def press(newtons: float, seconds: float, as_task: bool = False, **more: Any) -> ScenarioStep:
    if as_task:
        axis = TaskAxis(AxisKind.FORCE, -1, OUTER, None, DIRECTION, newtons)
        return ScenarioStep("press", seconds, task=TaskCommand("base", (axis,)), **more)
    return ScenarioStep("press", seconds, force=ForceCommand("base", triple(newtons * np.array(DIRECTION))), **more)


def test_a_small_force_from_the_motors_does_not_creep_while_it_is_held() -> None:
    """Below what ends a contact it was taken for an error of the model: 1 N became 8 N in 14 s, measured as 1.4 N.

    It is known to 26 %, so that it is refused where nobody allows that.
    """
    forces, reactions = pressed(1500.0, press(1.0, 1.0), **MOTORS)
    assert reactions[-1] is Code.REFUSED
    assert not forces.any()
    forces, _ = pressed(1500.0, press(1.0, 4.0), **{**MOTORS, "force_loop:limits.tolerance": 0.4})
    assert abs(forces[-480:].mean() - 1.0) < 0.1
    assert forces.max() < 3.0


@pytest.mark.parametrize("as_task", [True])
def test_an_arm_that_holds_presses_no_harder_than_commanded(as_task: bool) -> None:
    """A hand at the side of the inner link makes it hold; less is commanded then, and 12 N stayed of 3."""
    hand = Push("inner_link", 0.4, triple(BODY.cover_pose(POSE, "inner_link").rotation.T @ (0.0, 12.0, 0.0)), 0.0, 0.6)
    steps = [
        press(12.0, 1.0, as_task),
        press(12.0, 0.6, as_task, push=hand),
        press(3.0, 1.5, as_task, push=hand._replace(end=1.5)),
    ]
    forces, reactions = pressed(4000.0, *steps, **{"force_loop:contact_source": "estimated"})
    assert forces[800:1000].mean() > 11.0
    assert reactions[1599] is Code.UNEXPLAINED
    assert forces[2400:].max() < 1.5 * 3.0
    assert forces[-200:].mean() < 3.5


@pytest.mark.parametrize(("source", "place", "newtons"), [("pinned", 0.38, 4.0), ("estimated", 0.1, 6.0)])
def test_a_second_push_on_the_same_link_is_reported(source: str, place: float, newtons: float) -> None:
    """Along the force and 8 cm and more from it: the surface got 3.2 to 12.8 N of 8, and nothing was said."""
    local = BODY.cover_pose(POSE, OUTER).rotation.T @ (newtons * np.array(DIRECTION))
    steps = [press(8.0, 1.8), press(8.0, 0.8, push=Push(OUTER, place, triple(local), 0.0, 0.8))]
    forces, reactions = pressed(4000.0, *steps, **{"force_loop:contact_source": source})
    assert reactions[1799] is Code.NONE
    assert abs(forces[-100:].mean() - 8.0) > 0.8
    assert {Code.UNEXPLAINED, Code.PUSHED, Code.NOT_REACHED} & set(reactions[1800:])


@pytest.mark.parametrize(("degrees", "friction", "as_task"), [(73.0, 0.3, True), (0.0, 0.8, False)])
def test_the_force_in_all_stays_below_a_multiple_of_the_commanded_one(
    degrees: float, friction: float, as_task: bool
) -> None:
    """Far off the normal of the surface: 45 N were true of 20.  Across the normal, friction alone is no reason."""
    aside, angle = BODY.cover_pose(POSE, OUTER).rotation[:, 2], np.radians(degrees)
    direction = triple(np.cos(angle) * np.array(DIRECTION) + np.sin(angle) * aside)
    step = ScenarioStep("press", 1.5, force=ForceCommand("base", triple(20.0 * np.array(direction))))
    if as_task:
        axis = TaskAxis(AxisKind.FORCE, -1, OUTER, PLACE, direction, 20.0)
        step = ScenarioStep("press", 1.5, task=TaskCommand("base", (axis,)))
    forces, reactions = pressed(4000.0, step, **{"driver:world.obstacles.friction": [friction]})
    assert forces.max() < 1.6 * 20.0
    assert degrees or Code.PUSHED not in reactions


def test_from_the_motors_a_force_on_a_slippery_surface_does_not_cycle() -> None:
    """At full speed it cycled by 7 % of itself, less than is reported, and such cycles are measured as less, too."""
    surface = Surface(OUTER, 0.306, unit((-0.323, 0.718, -0.616)), 7886.0, 0.073, is_plane=False)
    task = Task(
        (-1.011, 1.243, 2.07, -0.741),
        surface,
        14.63,
        is_dithered=True,
        is_tared=True,
        mismatch={
            "motor_friction": (1.186, 0.822, 0.815, 0.824),
            "joint_friction": (0.802, 0.853, 1.057, 0.802),
            "stiffness": (0.986, 0.903, 0.992, 1.063),
        },
        asymmetry=-0.015,
    )
    configuration = configured(CONFIGURATION, task)
    run = Simulation(configuration, steps(task, 3.5))
    forces = TaskWatch(configuration, task, run).traces()[0].forces[-1000:]
    cycle = RANGES.dither_cycle
    without_dither = forces[: cycle * (len(forces) // cycle)].reshape(-1, cycle).mean(axis=1)
    assert without_dither.mean() == pytest.approx(task.force, rel=0.03)
    assert np.ptp(without_dither) < 0.03 * task.force
