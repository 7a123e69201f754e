"""Whole-arm tasks: their files, their numbers, their pictures; the samples are measured again in test_samples."""

from pathlib import Path

import numpy as np
import pytest

from wam_control.task import scenario
from wam_description.configuration import Configuration, packaged
from wam_description.signals import ObjectState
from wam_driver.driver import Driver, DriverParameters
from wam_studies.tasks.pictures import save
from wam_studies.thesis.definition import load, tasks, with_run
from wam_studies.thesis.evaluation import evaluate, function_of
from wam_studies.thesis.recording import recording

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "bags" / "sample"


def test_the_whole_arm_tasks_of_the_thesis_are_there() -> None:
    assert tasks() == ["follow-surface", "hold-tube", "open-door", "push-box", "sweep-objects"]


@pytest.mark.parametrize("name", tasks())
def test_every_task_has_a_world_that_can_be_simulated_and_steps_that_can_be_played(name: str, tmp_path: Path) -> None:
    task = load(name)
    assert callable(function_of(task.evaluation))
    (run,) = task.runs
    configuration = with_run(Configuration.load(packaged("wam")), run, tmp_path)
    driver = Driver(configuration.shared, configuration.node("driver", DriverParameters))
    begin = list(map(np.array, driver.plant.objects()))
    assert begin
    for _ in range(20):  # nothing is thrown away by what it overlaps
        driver.advance(0.0)
    for before, row in zip(begin, driver.plant.objects(), strict=True):
        assert np.array(row)[1:4] == pytest.approx(before[1:4], abs=2e-3)
    steps = scenario.load(tmp_path / f"{run.name}.yaml", configuration.shared)
    assert sum(step.seconds for step in steps) == pytest.approx(sum(step["seconds"] for step in run.steps))


def test_tasks_move_along_lines_of_the_tip_and_joint_trajectories(tmp_path: Path) -> None:
    motions = {}
    for name in tasks():
        (run,) = load(name).runs
        shared = with_run(Configuration.load(packaged("wam")), run, tmp_path).shared
        steps = scenario.load(tmp_path / f"{run.name}.yaml", shared)
        motions[name] = sum(bool(step.trajectory) for step in steps), sum(bool(step.tip) for step in steps)
    assert sum(any(counts) for counts in motions.values()) >= 2, motions
    assert all(map(sum, zip(*motions.values(), strict=True))), motions


@pytest.mark.slow
@pytest.mark.parametrize("name", tasks())
def test_every_number_of_a_task_with_a_bound_is_within_it(name: str) -> None:
    result = evaluate(load(name), SAMPLES / name)
    assert result.agrees, [row for row in result.rows if not row.agrees]
    assert sum(row.bound == row.bound for row in result.rows) >= 3


def test_a_recording_holds_the_objects_by_name() -> None:
    run = recording(SAMPLES / "sweep-objects")
    traces = run.objects
    assert tuple(traces) == run.world.objects == ("block", "can", "tin")
    at = float(traces["can"].time[200])
    can = run.object_states(at)[1]
    assert isinstance(can, ObjectState)
    assert (can.x, can.y, can.z) == pytest.approx(traces["can"].position[200])


@pytest.mark.slow
def test_a_picture_of_a_task_is_drawn_from_its_sample(tmp_path: Path) -> None:
    task = load("open-door")
    save(task, SAMPLES / "open-door", evaluate(task, SAMPLES / "open-door"), tmp_path / "door.png")
    assert (tmp_path / "door.png").stat().st_size > 20_000


def test_the_documentation_shows_every_task() -> None:
    page = (ROOT / "docs" / "tasks.md").read_text(encoding="utf-8")
    assert "`wam demo --task NAME`" in page
    for name in tasks():
        assert f"**`{name}`**" in page
        assert f"tasks/{name}.png" in page
        assert (ROOT / "docs" / "tasks" / f"{name}.png").is_file()
    assert "MISSED" not in page
