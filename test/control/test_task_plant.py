"""Tasks of several axes on the simulated arm: the true force from the simulator."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from arms import BODY, CONFIGURATION, WAM

from wam_control.force.task import AxisKind, TaskAxis, TaskCommand, line_axes, unit
from wam_control.task.scenario import ScenarioStep
from wam_description.event_text import sentence
from wam_description.signals import ForceCommand, PathPoint, PosturePath
from wam_sim.simulation import Simulation
from wam_studies.force_benchmark.surfaces import Surface
from wam_studies.force_benchmark.tasks import RANGES, Task, configured, triple
from wam_studies.force_benchmark.trial import TaskWatch

LEVEL = (-0.031, -1.083, -1.826, -0.482)  # the outer link is level
OUTER = "outer_link"


def force(surface: Surface, newtons: float) -> TaskAxis:
    return TaskAxis(AxisKind.FORCE, -1, surface.cover, surface.position, surface.direction, newtons)


class Played:
    """A task that was played: true forces (T, p), N, along those of its surfaces, and the node at the end."""

    def __init__(
        self, task: Task, axes: Sequence[TaskAxis], seconds: float, *later: ScenarioStep, **changes: Any
    ) -> None:
        configuration = configured(CONFIGURATION, task).with_values(changes)
        steps = [
            ScenarioStep("release", RANGES.release, request="enable"),
            ScenarioStep("press", seconds, task=TaskCommand("base", tuple(axes))),
            *later,
        ]
        run = Simulation(configuration, steps)
        traces = TaskWatch(configuration, task, run).traces()
        self.forces = np.array([trace.forces for trace in traces]).T
        self.reason, self.q = sentence(traces[0].event), run.driver.plant.q


@pytest.mark.slow
def test_a_force_of_a_task_on_a_stiff_surface_does_not_jump_at_the_touch() -> None:
    """Its torque fed forward to the free arm threw it at the surface: 27 N of 16 at 40 000 N/m."""
    q = (0.3, -1.2, 0.2, 1.0)
    x, y, z = (-BODY.cover_pose(q, OUTER).rotation[:, 1]).tolist()
    surface = Surface(OUTER, 0.3, (x, y, z), 4e4, 0.0, is_plane=False)
    played = Played(Task(q, surface, 16.0), [force(surface, 16.0)], 2.0)
    assert played.forces.max() < 1.2 * 16.0
    assert played.forces[-200:].mean() == pytest.approx(16.0, rel=0.05)


@pytest.mark.parametrize("q", [(0.0, -0.8, 0.0, 0.3), (0.0, -1.5, 0.0, 1.2)])
def test_an_arm_that_is_free_along_all_axes_stays_where_the_brakes_held_it(q: tuple[float, ...]) -> None:
    """First the cables sag under the braked arm, by up to 3 mm at the tool: a run begins with slack ones."""
    free = TaskCommand("base", tuple(TaskAxis(AxisKind.IMPEDANCE, i, value=None, damping=5.0) for i in range(4)))
    steps = [ScenarioStep("sag", 0.5), ScenarioStep("release", 1.0, request="enable", task=free)]
    run, tools = Simulation(CONFIGURATION.with_values({"arm.joints.start": q}), steps), []
    while not run.step():
        tools.append(BODY.point(run.driver.plant.q, OUTER, (0.4, 0.0, 0.0)))
    braked = round(0.5 / CONFIGURATION.shared.timing.period)
    assert np.abs(np.array(tools[braked:]) - tools[braked - 10]).max() < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.03])
def test_a_force_across_the_line_of_a_link_is_right_while_the_link_slides_along_it(speed: float) -> None:
    """What is touched stays where it is, so that it is touched elsewhere on the link: a friction of 0.3 is not all."""
    along = BODY.cover_pose(LEVEL, OUTER).rotation[:, 0]
    down = np.array([0.0, 0.0, -1.0]) + along[2] * along
    surface = Surface(OUTER, 0.25, triple(down / np.linalg.norm(down)), 4000.0, 0.3, is_plane=False)
    line = line_axes(WAM, OUTER, triple(BODY.point(LEVEL, OUTER, (0.0, 0.0, 0.0))), triple(along))
    slide = TaskAxis(AxisKind.VELOCITY, -1, OUTER, 0.2, triple(along), speed)
    played = Played(Task(LEVEL, surface, 5.0), [force(surface, 5.0), line[1], slide], 2.5)
    slid = BODY.point(played.q, OUTER, (0.0, 0.0, 0.0)) - BODY.point(LEVEL, OUTER, (0.0, 0.0, 0.0))
    assert slid @ along == pytest.approx(2.5 * speed, rel=0.1), "m"
    assert played.forces[1000:, 0] == pytest.approx(np.full(1500, 5.0), rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("is_task", [True])
def test_a_force_stays_right_when_the_link_slides_back_under_other_axes(is_task: bool) -> None:
    q = (0.0, -1.0, 0.0, 0.6)
    rotation = BODY.cover_pose(q, OUTER).rotation
    surface = Surface(OUTER, 0.35, triple(rotation[:, 1]), 4000.0, 0.04, is_plane=False)
    slide = TaskAxis(AxisKind.VELOCITY, -1, OUTER, 0.35, triple(rotation[:, 0]), 0.03)
    alone = (force(surface, 6.5),)
    after = (
        {"task": TaskCommand("base", alone)}
        if is_task
        else {"force": ForceCommand("base", triple(6.5 * rotation[:, 1]))}
    )
    ends = [ScenarioStep("slide", 2.0, task=TaskCommand("base", (*alone, slide)))] if is_task else []
    last = ScenarioStep("alone", 2.0, **after)
    played = Played(Task(q, surface, 6.5), alone, 2.0, *ends, last)
    assert played.forces[-200:, 0].mean() == pytest.approx(6.5, rel=0.05)
    assert not played.reason


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["warn"])
def test_two_forces_that_are_stable_alone_do_not_swing_together(mode: str) -> None:
    """Each alone has a margin of 7 and more at this gain; the two of them have one of 0.6."""
    q = (-0.012, -0.881, 0.49, 0.786)
    outer = Surface(OUTER, 0.317, unit((-0.298, 0.905, 0.303)), 4e4, 0.0, is_plane=False)
    inner = Surface("inner_link", 0.388, unit((0.263, 0.915, -0.305)), 4e4, 0.0, is_plane=False)
    given = {"force_loop:guard.mode": mode, "force_loop:limits.doubt": 2.0}
    played = Played(Task(q, outer, 8.65, second=(inner, 16.8)), [force(outer, 8.65), force(inner, 16.8)], 3.0, **given)
    swing = np.ptp(played.forces[-1000:], axis=0)
    assert swing.max() < 0.5, "N; where the guard only warns, the arm is slowed down along a force that oscillates"
    assert played.forces[-500:].mean(axis=0) == pytest.approx((8.65, 16.8), rel=0.08)


@pytest.mark.slow
@pytest.mark.parametrize(("place", "newtons"), [(0.35, 6.5)])
def test_a_posture_pulls_the_link_back_no_faster_than_its_force_follows(place: float, newtons: float) -> None:
    q = (0.0, -1.0, 0.0, 0.6)
    rotation = BODY.cover_pose(q, OUTER).rotation
    surface = Surface(OUTER, place, triple(rotation[:, 1]), 4000.0, 0.3, is_plane=False)
    slide = TaskAxis(AxisKind.VELOCITY, -1, OUTER, place, triple(rotation[:, 0]), -0.03)
    alone = (force(surface, newtons),)
    later = [
        ScenarioStep(name, s, task=TaskCommand("base", axes))
        for name, s, axes in (("slide", 2.0, (*alone, slide)), ("back", 1.5, alone))
    ]
    played = Played(Task(q, surface, newtons), alone, 1.0, *later)
    assert played.forces[3000:, 0].max() < 1.25 * newtons
    assert played.forces[-200:, 0].mean() == pytest.approx(newtons, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("shoulder", "fault"), [(-1.99, ""), (-2.02, "mm deep in an edge")])
def test_a_motion_that_drives_a_tube_into_an_edge_ends_with_a_fault(shoulder: float, fault: str) -> None:
    """At -2.005 rad the edge is at the axis of the tube; deeper, the force turned by 80 degrees in silence."""
    steps = [
        ScenarioStep("release", RANGES.release, request="enable"),
        ScenarioStep("above", 2.0, posture=(0.0, -1.8, 0.0, 1.45)),
        ScenarioStep("into", 2.0, trajectory=PosturePath((PathPoint((0.0, shoulder, 0.0, 1.45)),))),
    ]
    yielding_late = CONFIGURATION.with_values({"force_loop:limits.contact_force": 1e6})
    assert fault in (found := Simulation(yielding_late, steps).play())
    assert bool(found) is bool(fault)
