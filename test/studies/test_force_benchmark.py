"""The benchmark of force control: its tasks, how it evaluates them, and that it goes on where it was stopped."""

import math
from typing import Any

import numpy as np
import pytest
from arms import CONFIGURATION, WAM

from wam_description.event import OBEYED, Code, fault, warning
from wam_description.rigid_body import RigidBody
from wam_driver.driver import Driver, DriverParameters
from wam_studies.force_benchmark.controllers import Admittance, TorqueControl
from wam_studies.force_benchmark.outcome import TaskEnd, TaskTrace, evaluated
from wam_studies.force_benchmark.study import GROUPINGS, ForceStudy
from wam_studies.force_benchmark.surfaces import Surface
from wam_studies.force_benchmark.tasks import RANGES, Task, configured, draw, steps, triple
from wam_studies.force_benchmark.trial import ForceTrial, inertia, knowable, perform

DRAWN = [draw(WAM, 1, number) for number in range(300)]
Q = (0.0, -1.0, 0.0, 0.8)
ACROSS = Surface("outer_link", 0.3, (0.0, 0.0, -1.0), 4000.0, 0.3, is_plane=False)
REPORTED = warning(Code.NOT_REACHED, "force_strays", axis="force", unit="N", measured=8.0, desired=10.0, allowed=1.0)
TASK = Task(Q, ACROSS, 10.0)


def test_a_task_depends_on_its_seed_and_number_alone() -> None:
    assert draw(WAM, 1, 17) == DRAWN[17]
    assert draw(WAM, 2, 17) != DRAWN[17]
    assert len({task.q for task in DRAWN}) == len(DRAWN)


def test_tasks_are_as_wide_as_the_page_says() -> None:
    force, stiffness = [task.force for task in DRAWN], [task.surface.stiffness for task in DRAWN]
    assert 1.0 <= min(force) < 1.1
    assert 36.0 < max(force) <= 40.0
    assert 400.0 <= min(stiffness) < 500.0
    assert 3.5e5 < max(stiffness) <= 4e5
    assert all(
        low < angle < high
        for task in DRAWN
        for low, angle, high in zip(WAM.joints.lower, task.q, WAM.joints.upper, strict=True)
    )
    for grouping in GROUPINGS:
        counts = {name: sum(grouping.name(task) == name for task in DRAWN) for name in grouping.classes}
        assert sum(counts.values()) == len(DRAWN), "every task is in one class"
        least = 8 if grouping.title == "not known" else 15
        assert min(counts.values()) >= least, (grouping.title, counts)


def test_what_nobody_knows_is_in_the_true_arm_alone() -> None:
    loaded = next(task for task in DRAWN if task.payload)
    rough = next(task for task in DRAWN if task.asymmetry)
    assert 0.05 <= loaded.payload <= 2.0
    for task in (loaded, rough):
        given = configured(CONFIGURATION, task)
        driver = given.node("driver", DriverParameters)
        assert given.shared.arm.payload == 0.0
        assert driver.mismatch.payload == task.payload
        assert (driver.friction.law == "stribeck") is (task is rough)
        assert set(driver.friction.motor_asymmetry) == {task.asymmetry}


@pytest.mark.parametrize("number", [0, 3, 4, 8])
def test_the_plant_of_a_task_touches_nothing_and_is_the_true_arm(number: int) -> None:
    task = DRAWN[number]._replace(payload=0.0)
    configuration = configured(CONFIGURATION, task)
    driver = Driver(configuration.shared, configuration.node("driver", DriverParameters))
    assert driver.plant.data.ncon == 0
    assert driver.plant.q == pytest.approx(task.q)
    factors = [a / b for a, b in zip(driver.plant.model.body_mass[-4:], WAM.links.mass, strict=True)]
    assert factors == pytest.approx(task.mismatch["mass"])


@pytest.mark.slow
def test_the_surface_is_two_millimetres_from_the_link_along_the_force() -> None:
    body = RigidBody(WAM)
    for task in DRAWN[:12]:
        configuration = configured(CONFIGURATION, task)
        surface = task.surface
        point = WAM.covers.on_axis(surface.cover, surface.position)
        lever = np.array(surface.direction) @ body.point_jacobian(task.q, surface.cover, point)
        for distance, touches in ((0.001, False), (0.003, True)):
            q = np.array(task.q) + lever * distance / float(lever @ lever)
            if float(np.abs(q - task.q).max()) > 0.02:
                continue  # near a singular pose this is no small motion
            moved = configuration.with_values({"arm.joints.start": q.tolist()})
            driver = Driver(moved.shared, moved.node("driver", DriverParameters))
            assert bool(driver.plant.data.ncon) is touches, (task, distance)


@pytest.mark.slow
def test_a_task_that_tares_during_a_false_contact_is_done() -> None:
    assert perform(CONFIGURATION, draw(WAM, 7501, 37)).outcome is not TaskEnd.REFUSED


def test_another_force_comes_first_and_a_small_one_lasts_longer() -> None:
    stepped = TASK._replace(before=30.0, ramp=0.5)
    _, *ramp, first, press = steps(stepped, RANGES.seconds)
    forces = [math.hypot(*step.force.force) for step in (ramp[0], first, press)]
    assert forces == pytest.approx([6.0, 30.0, 10.0])
    assert steps(TASK._replace(longer=5.0), RANGES.seconds)[-1].seconds == 5.0 * RANGES.seconds
    courses = [(task.before > 0.0, task.longer > 1.0) for task in DRAWN]
    assert all(0.05 < np.mean(share) < 0.15 for share in zip(*courses, strict=True))
    lasting = [task for task in DRAWN if task.longer > 1.0]
    assert all(t.force <= 3.0 and t.surface.stiffness <= 4e3 and t.is_pinned for t in lasting)
    changes = [task.before / task.force for task in DRAWN if task.before]
    assert min(changes) < 0.5
    assert max(changes) > 2.0
    assert all(0.249 < change < 4.001 for change in changes)


def test_the_last_command_limits_the_force_at_the_end() -> None:
    """A hold that goes on pressing as before is not a task given up."""
    task, held_back = TASK._replace(before=30.0), {"event": REPORTED, "is_stopped": True}
    down = [0.0] * 100 + [31.0] * 2000
    assert not evaluated(task, trace(down + [10.1] * 3000)).is_over
    assert evaluated(task, trace(down + [10.1] * 3000, **held_back)).outcome is TaskEnd.GIVEN_UP
    pressing = evaluated(task, trace(down + [18.0] * 3000, **held_back))
    assert (pressing.outcome, pressing.is_over) == (TaskEnd.ENDED, True)


def test_true_motors_give_another_torque_than_their_reported_one() -> None:
    factors = [1.1, 1.0, 0.9, 1.0]
    configuration = CONFIGURATION.with_values({"driver:mismatch.torque_constant": factors})
    amplifier = Driver(configuration.shared, configuration.node("driver", DriverParameters)).amplifier
    true, reported = amplifier.torque([2.0] * 4, [0.0] * 4), amplifier.nominal_torque([2.0] * 4)
    assert [a / b for a, b in zip(true, reported, strict=True)] == pytest.approx(factors)


def trace(forces: Any, **more: Any) -> TaskTrace:
    given = TaskTrace(np.array(forces, float), 1e-3, 0.005, 2.0, OBEYED, False, 0.0)
    return given._replace(**more)


def held(newtons: float, **more: Any) -> TaskTrace:
    return trace([0.0] * 100 + [newtons] * 3000, **more)


@pytest.mark.parametrize(("seen", "expected"), [
    (held(10.9), TaskEnd.DONE), (held(9.1, event=REPORTED), TaskEnd.DONE),
    (held(10.9, event=REPORTED, is_stopped=True), TaskEnd.ENDED), (held(11.1), TaskEnd.SILENT),
    (held(0.0), TaskEnd.SILENT), (held(11.1, event=REPORTED), TaskEnd.ENDED),
    (held(0.0, event=REPORTED, is_stopped=True, travel=0.0), TaskEnd.REFUSED),
    (held(0.0, event=REPORTED, is_stopped=True, travel=0.1), TaskEnd.GIVEN_UP),
    (held(2.0, event=REPORTED, is_stopped=True), TaskEnd.GIVEN_UP),
    (trace([0.0, 10.1] + [2.0] * 3000, event=REPORTED, is_stopped=True), TaskEnd.ENDED),
    (held(2.0, event=fault("hit"), is_stopped=True), TaskEnd.ENDED),
    (held(0.0, event=REPORTED, travel=0.0), TaskEnd.ENDED),
])  # fmt: skip
def test_an_outcome_is_that_of_the_true_force_and_the_report(seen: TaskTrace, expected: TaskEnd) -> None:
    assert evaluated(TASK, seen).outcome is expected


def test_a_peak_counts_above_one_and_a_half_times_the_command_and_the_impact() -> None:
    for peak, is_over in ((16.9, False), (17.1, True)):
        assert evaluated(TASK, trace([0.0, peak] + [10.0] * 3000)).is_over is is_over


@pytest.mark.parametrize(
    ("size", "more", "is_silent"),
    [(0.4, {}, False), (0.8, {}, True), (0.8, {"predicted_cycle": 1.5}, False), (0.8, {"event": REPORTED}, False)],
)
def test_a_cycle_above_the_tolerance_counts_unless_it_is_reported(
    size: float, more: dict[str, Any], is_silent: bool
) -> None:
    wave = 10.0 + size * np.sin(2.0 * math.pi * 3.0 * 1e-3 * np.arange(4000))
    result = evaluated(TASK, trace(wave, **more))
    assert result.outcome is TaskEnd.DONE
    assert result.cycles_silently is is_silent


def test_the_dither_is_no_cycle() -> None:
    wave = 10.0 + 2.0 * np.sin(2.0 * math.pi * 25.0 * 1e-3 * np.arange(4000))
    dithered = TASK._replace(is_dithered=True)
    assert evaluated(TASK, trace(wave)).cycles_silently
    assert not evaluated(dithered, trace(wave)).cycles_silently


def test_the_inertia_of_an_impact_is_that_of_the_compiled_plant() -> None:
    """Kinetic energy of MuJoCo's model with links and rotors at the speeds of stiff cables."""
    import mujoco

    driver = Driver(CONFIGURATION.shared, CONFIGURATION.node("driver", DriverParameters))
    plant, qd = driver.plant, np.array([0.3, -0.5, 0.8, 1.1])
    rotors = np.linalg.inv(np.reshape(WAM.joint_from_motor, (4, 4))) @ qd
    plant.data.qvel[:] = np.concatenate([rotors, qd])
    mujoco.mj_energyVel(plant.model, plant.data)
    mass = inertia(WAM, RigidBody(WAM), plant.q)
    assert 0.5 * float(qd @ mass @ qd) == pytest.approx(float(plant.data.energy[1]), rel=1e-4)


@pytest.mark.slow
def test_a_force_is_done_a_blind_one_refused_and_a_wrong_place_is_not_called_done() -> None:
    """The short form: three tasks by hand, each with another outcome."""
    body = RigidBody(WAM)
    x, y, z = body.cover_pose(Q, "outer_link").rotation[:, 1].tolist()
    good = TASK._replace(surface=ACROSS._replace(direction=(x, y, z)))
    done = perform(CONFIGURATION, good, 1.5)
    assert done.outcome is TaskEnd.DONE
    assert 0.0 < done.peak < done.limit
    assert 15.0 < done.limit < 40.0
    straight = (0.0, -1.0, 0.0, math.pi / 2.0 - 0.05)
    tip = body.point(straight, "outer_link", (WAM.covers.length[1], 0.0, 0.0))
    x, y, z = (tip / np.linalg.norm(tip)).tolist()
    blind = Task(straight, Surface("outer_link", WAM.covers.length[1], (x, y, z), 4000.0, 0.3, is_plane=True), 5.0)
    refusal = perform(CONFIGURATION, blind, 1.5)
    assert refusal.outcome is TaskEnd.REFUSED
    assert "may be wrong by" in refusal.reason
    wrong = perform(CONFIGURATION, good, 1.5, {"force_loop:contact_position": 0.1})
    assert wrong.outcome is not TaskEnd.DONE
    assert abs(wrong.mean - 10.0) > 1.0


STUDY = ForceStudy(CONFIGURATION)


def trials() -> list[ForceTrial]:
    """Two hundred tasks, each with 5 % too much; task 3 is silent, task 4 above the limit, task 5 refused."""
    results = [evaluated(task, held(1.05 * task.force)) for task in DRAWN[:200]]
    found = [ForceTrial(7, number, *each) for number, each in enumerate(zip(DRAWN, results, strict=False))]
    found[3] = found[3]._replace(result=evaluated(DRAWN[3], held(2.0 * DRAWN[3].force)))
    above = trace([4.0 * DRAWN[4].force] + [DRAWN[4].force] * 3000, impact=0.0)
    found[4] = found[4]._replace(result=evaluated(DRAWN[4], above))
    blind = held(0.0, event=REPORTED, is_stopped=True, travel=0.0)
    found[5] = found[5]._replace(result=evaluated(DRAWN[5], blind))
    return found


def test_the_scores_count_what_went_in_and_list_each_failure() -> None:
    scores = STUDY.score(trials())
    rows = {row.name: row for row in scores.rows}
    silent = rows["wrong force that nothing reports"]
    assert (silent.found.value, silent.is_missed) == (1, True)
    assert rows["tasks refused with a reason"].found[::3] == (1 / 200, 200)
    outcomes, *_, reasons = scores.tables
    assert [line[1] for line in outcomes.rows] == [f"{one} (200)" for one in ("99", "0.5", "0", "0", "0.5", "2", "0")]
    assert reasons.rows == [["not_reached force_strays", "1"]]
    failures = {trial.number: STUDY.failure(trial).partition(":")[0] for trial in trials() if STUDY.failure(trial)}
    assert failures == {3: "silent and above the limit", 4: "above the limit"}


def test_required_shares_are_of_the_accepted_tasks() -> None:
    found = trials()
    number = next(t.number for t in found[6:] if not t.task.is_dithered)
    left = held(0.0, event=REPORTED, is_stopped=True)
    found[number] = found[number]._replace(result=evaluated(DRAWN[number], left))
    ends = [t.result.outcome for t in found if not (t.task.is_dithered or t.task.mistake)]
    refusals, withdrawals = ends.count(TaskEnd.REFUSED), ends.count(TaskEnd.GIVEN_UP)
    assert withdrawals == 1
    strict, wide = [row.found.observed for row in STUDY.score(found).rows if "joint sensors" in row.name]
    assert strict == len(ends) - refusals - withdrawals
    assert wide == len(ends) - refusals


def test_a_task_is_feasible_where_its_force_can_be_known_or_something_does_it() -> None:
    right, wrong = (evaluated(DRAWN[0], held(factor * DRAWN[0].force)) for factor in (1.0, 0.5))
    sensed = DRAWN[0]._replace(is_dithered=False)
    trial = ForceTrial(7, 0, sensed, wrong, {"another": wrong}, knowable=0.5)
    known, done = trial._replace(knowable=0.01), trial._replace(others={"another": right})
    rows = {row.name: row.found for row in STUDY.score([trial, known, done, done._replace(result=right)]).rows}
    assert rows["feasible tasks that are right, joint sensors"][::3] == (1 / 3, 3)


def test_the_force_can_be_known_worse_the_rougher_the_surface_and_the_less_is_declared() -> None:
    task = next(t for t in DRAWN if t.is_pinned and not t.is_dithered and not t.surface.is_plane)
    smooth, rough = (
        knowable(CONFIGURATION, task._replace(surface=task.surface._replace(friction=mu))) for mu in (0.0, 0.8)
    )
    anywhere = knowable(CONFIGURATION, task._replace(is_pinned=False))
    assert 0.0 < smooth <= rough
    assert anywhere > knowable(CONFIGURATION, task)


@pytest.mark.parametrize("controller", [Admittance, TorqueControl])
def test_what_a_user_would_write_presses_on_a_soft_rod_at_a_known_position(controller: type) -> None:
    q, cover = (0.0, -0.6, 0.0, 0.5), WAM.covers.names[-1]
    across = triple(-RigidBody(WAM).cover_pose(q, cover).rotation[:, 1])
    task = Task(q, Surface(cover, 0.3, across, 4000.0, 0.3, is_plane=False), 8.0)
    assert perform(CONFIGURATION, task, controller=controller).mean == pytest.approx(8.0, rel=0.1)


def test_conditions_of_a_task_are_drawn_within_the_declared_mismatch() -> None:
    for name, width in (("mass", 0.03), ("motor_friction", 0.2), ("stiffness", 0.1), ("torque_constant", 0.03)):
        factors = np.array([task.mismatch[name] for task in DRAWN])
        assert 0.95 * width < float(np.abs(factors - 1.0).max()) <= width
