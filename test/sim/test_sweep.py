"""Sweeps: parameter sets, equal results on every executor, what was finished is kept, a refused set fails alone."""

import csv
import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from wam_cli.main import main
from wam_control.task.scenario import load
from wam_description.configuration import Configuration, packaged
from wam_description.parameters import ParameterError
from wam_sim.batch import results
from wam_sim.sweep import Axis, SweepPoint, SweepResult, drawn, grid, listed, outcome, points
from wam_studies.thesis import definition
from wam_studies.thesis.measurement import measure, swept

GAIN = "force_loop:force_gain"
STEPS = """
steps:
  - {name: release, seconds: 0.1, request: enable}
  - {name: press, seconds: 0.4, force: {frame: link, newtons: [0.0, -20.0, 0.0]}}
"""


@pytest.fixture
def script(tmp_path: Path) -> Path:
    file = tmp_path / "short.yaml"
    file.write_text(STEPS)
    return file


def runs(script: Path, gains: tuple[float, ...]) -> list[SweepPoint]:
    configuration = Configuration.load(packaged("testbed"))
    axes = [Axis(GAIN, gains)]
    return points(configuration, load(script, configuration.shared), axes, grid(axes))


def test_a_grid_has_every_combination_and_a_list_goes_in_step() -> None:
    axes = [Axis("a", (1, 2)), Axis("b", (3, 4))]
    assert grid(axes) == [(1, 3), (1, 4), (2, 3), (2, 4)]
    assert listed(axes) == [(1, 3), (2, 4)]
    with pytest.raises(ValueError, match="a: 2, b: 1"):
        listed([axes[0], Axis("b", (3,))])


def test_random_sets_are_repeatable_and_between_the_ends() -> None:
    axes = [Axis("a", (1e-3, 1.0)), Axis("b", (-1.0, 2.0))]
    found = drawn(axes, 200, 4)
    assert found == drawn(axes, 200, 4) != drawn(axes, 200, 5)
    assert all(1e-3 <= a <= 1.0 and -1.0 <= b <= 2.0 for a, b in found)
    assert 60 < sum(a < 10**-1.5 for a, _ in found) < 140, "by the logarithm"
    with pytest.raises(ValueError, match="needs two numbers"):
        drawn([Axis("a", (1.0, 2.0, 3.0))], 1, 1)


def test_an_unknown_parameter_is_refused_before_anything_runs(script: Path) -> None:
    configuration = Configuration.load(packaged("testbed"))
    with pytest.raises(ParameterError, match="no parameter 'nothing'"):
        points(configuration, load(script, configuration.shared), [Axis("force_loop:nothing", (1,))], [(1,)])


def pressed(tmp_path: Path, frame: str, newtons: list[float]) -> SweepResult:
    file = tmp_path / "force.yaml"
    file.write_text(STEPS.replace("link", frame).replace("[0.0, -20.0, 0.0]", str(newtons)))
    return outcome(runs(file, (0.004,))[0])


@pytest.mark.slow
def test_the_error_is_the_same_in_every_frame_and_all_of_the_force_where_nothing_is_touched(tmp_path: Path) -> None:
    on_link, in_base = pressed(tmp_path, "link", [0.0, -20.0, 0.0]), pressed(tmp_path, "base", [0.0, 0.0, -20.0])
    assert in_base.force_rms == pytest.approx(on_link.force_rms, rel=0.02) != pytest.approx(20.0)
    away = pressed(tmp_path, "link", [0.0, 20.0, 0.0])
    assert away.force_rms == pytest.approx(20.0, abs=0.2)
    assert not any(one.failure for one in (on_link, in_base, away))


@pytest.mark.slow
def test_a_force_that_is_commanded_too_briefly_is_named(tmp_path: Path) -> None:
    file, found = tmp_path / "brief.yaml", []
    for seconds in ("0.4", "1.0"):
        file.write_text(STEPS.replace("0.4", seconds))
        found.append(outcome(runs(file, (0.004,))[0]))
    file.write_text(STEPS.replace("force: {frame", "chirp: {newtons: 2.0, from: 1.0, to: 3.0}, force: {frame"))
    found.append(outcome(runs(file, (0.004,))[0]))
    assert [one.unassessed for one in found] == ["20 N in link: commanded for less than 1 s", "", ""]
    assert not any(one.failure for one in found)


@pytest.mark.slow
def test_a_force_that_a_larger_one_on_another_link_hides_is_not_assessed(tmp_path: Path) -> None:
    """`sim/contact/wrench` has the link that bears most: 7 N of error were stated for a force that was right."""
    file, found = tmp_path / "two.yaml", []
    for size in (0.0, 15.0):
        push = f"push: {{cover: inner_link, contact_position: 0.02, newtons: [0.0, 0.0, {size}]}}"
        file.write_text(f"""
steps:
  - {{name: release, seconds: 0.3, request: enable}}
  - {{name: above, seconds: 2.0, posture: [0.0, -1.8, 0.0, 1.45]}}
  - {{name: lower, seconds: 4.0, posture: [0.0, -2.1, 0.0, 1.45], until_force: 1.5}}
  - {{name: press, seconds: 2.0, force: {{frame: base, newtons: [0.0, 0.0, -8.0]}}, {push}}}
""")
        configuration = Configuration.load(packaged("wam")).with_values({"force_loop:limits.doubt": 5.0})
        (point,) = points(configuration, load(file, configuration.shared), [], [()])
        found.append(outcome(point))
    alone, hidden = found
    assert alone.force_rms < 3.0  # without a known position the force is known to 2 N
    assert not alone.unassessed
    assert math.isnan(hidden.force_rms)
    assert hidden.unassessed == "8 N in base: another link bears more in 100 % of its steady state"
    assert hidden.force_peak > 14.0


@pytest.mark.slow
def test_a_sweep_names_a_lowered_gain_and_an_uncertain_force(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """15 N along base -z, 36 deg off the normal of the link."""
    file = tmp_path / "inclined.yaml"
    file.write_text("""
steps:
  - {name: release, seconds: 0.3, request: enable}
  - {name: above, seconds: 2.0, posture: [0.0, -1.7, 0.0, 1.3]}
  - {name: down, seconds: 4.0, posture: [0.0, -2.35, 0.0, 1.3], until_force: 1.5}
  - {name: press, seconds: 3.0, force: {frame: base, newtons: [0.0, 0.0, -15.0]}}
""")
    table = tmp_path / "table.csv"
    words = ["--set", "force_loop:limits.doubt=9.0", "--vary", "force_loop:force_gain=0.3", "--scenario", str(file)]
    with pytest.raises(SystemExit, match="0"):
        main(["sweep", str(table), *words, "--results", str(tmp_path / "kept.jsonl")])
    with table.open() as stream:
        (row,) = csv.DictReader(stream)
    assert row["failure"] == ""
    lowered, _, why = row["reported"].partition("; press: ")
    assert lowered.startswith("the guard lowered it; used: force_gain [0.")
    assert why == "refused"
    assert float(row["force_worst"]) > 1.0
    assert "1 set, 0 failed, 1 with a remark (column 'reported')" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "failure"),
    [
        ("torque: [0, 0, 0, 50]", "press refused: torque of joint 4: 50 N m is commanded; allowed: up to torque_limit"),
        ("torque: [0, 0, 0, 2]", "press not reached: torque of joint 4: "),
        ("force: {frame: outer_link, newtons: [0, -4, 0]}", "press not reached: force along (0, -1, 0): 4 N are"),
        (
            "task: {axes: [{force: 70.0, along: [0, 0, -1], cover: outer_link, contact_position: 0.28}]}",
            "press refused: force along (0, 0, -1) at 0.28 m along outer_link: 70 N is commanded; allowed: up to",
        ),
        ("torque: [0, 0, 0, 0]", ""),
    ],
)
def test_a_task_that_the_loop_refuses_or_does_not_reach_is_a_failure(
    command: str, failure: str, tmp_path: Path
) -> None:
    file = tmp_path / "task.yaml"
    press = f"- {{name: press, seconds: {3.0 if 'reached' in failure else 0.4}, {command}}}"
    file.write_text(f"steps:\n- {{name: release, seconds: 0.1, request: enable}}\n{press}\n")
    configuration = Configuration.load(packaged("wam"))
    found = outcome(SweepPoint(configuration, tuple(load(file, configuration.shared)))).failure
    assert found.startswith(failure)
    assert bool(found) == bool(failure)


@pytest.mark.slow
def test_a_refused_set_fails_alone_and_finished_runs_are_kept(script: Path, tmp_path: Path) -> None:
    given = runs(script, (0.004, 0.02, -1.0))
    with ThreadPoolExecutor(1) as one:
        found = results(outcome, given, one, tmp_path / "kept.jsonl")
    assert [bool(result.failure) for result in found] == [False, False, True]
    assert found[2].failure
    assert found[0].force_rms > found[1].force_rms, "a small gain is slower"
    again: list[tuple[int, int]] = []
    with ThreadPoolExecutor(1) as one:
        kept = results(outcome, given, one, tmp_path / "kept.jsonl", lambda done, of: again.append((done, of)))
    assert again == [(3, 3)]
    assert kept[:2] == found[:2]


@pytest.mark.slow
def test_runs_with_a_node_of_ones_own_are_computed_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its code may have changed: what was kept of other code was taken for its own."""
    monkeypatch.syspath_prepend(tmp_path)
    module, overlay, script = tmp_path / "own_push.py", tmp_path / "own.yaml", tmp_path / "steps.yaml"
    module.write_text("from wam_control.velocity.gravity_node import GravityNode as Own\n")
    overlay.write_text(
        "base: wam\n/**: {ros__parameters: {nodes: [driver, transform, velocity_loop, 'own_push:Own']}}\n"
    )
    script.write_text("steps:\n  - {name: release, seconds: 0.1, request: enable}\n")
    command = ["sweep", str(tmp_path / "s.csv"), "--config", str(overlay), "--scenario", str(script), "--jobs", "1"]
    for _ in range(2):
        with pytest.raises(SystemExit):
            main([*command, "--vary", "arm.payload=0.0", "--results", str(tmp_path / "kept.jsonl")])
        assert "from an earlier run" not in capsys.readouterr().err
    assert not (tmp_path / "kept.jsonl").exists()


@pytest.mark.slow
def test_the_command_writes_the_table_and_the_plot(script: Path, tmp_path: Path) -> None:
    table, plot = tmp_path / "sweep.csv", tmp_path / "sweep.png"
    command = ["sweep", str(table), "--config", "testbed", "--fresh", "--jobs", "1", "--scenario", str(script)]
    with pytest.raises(SystemExit, match="0"):
        main([*command, "--vary", f"{GAIN}=0.004:0.02:2", "--picture", str(plot)])
    with table.open() as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row[GAIN]) for row in rows] == pytest.approx([0.004, 0.02])
    assert all(float(row["force_rms"]) > 0.0 for row in rows)
    assert plot.stat().st_size > 5000


@pytest.mark.slow
def test_an_experiment_is_swept_with_what_it_predicts_and_measures(tmp_path: Path) -> None:
    """Cables that do not creep are measured as such, against a prediction that knows only their radii."""
    table, plot = tmp_path / "creep.csv", tmp_path / "creep.png"
    command = ["sweep", str(table), "--experiment", "creep", "--fresh", "--jobs", "1", "--picture", str(plot)]
    guarded = ("guard.mode=limit", "joint_speed_limit=20", "force_gain=9.0")
    with pytest.raises(SystemExit, match="0"):
        main([*command, *(f"--vary=force_loop:{one}" for one in guarded), "--vary", "driver:effects.creep=true,false"])
    with table.open() as stream:
        rows = list(csv.DictReader(stream))
    creeping, rigid = ([row for row in rows if row["driver:effects.creep"] == name] for name in ("True", "False"))
    assert [row["quantity"] for row in creeping] == [row["quantity"] for row in rigid]
    predicted = [[float(row["predicted"]) for row in those] for those in (creeping, rigid)]
    assert predicted[0] == pytest.approx(predicted[1])
    assert all(row["agrees"] == "True" for row in creeping)
    assert "out and back: the guard lowered it; used: force_gain [0.00" in creeping[0]["reported"]
    assert not any(row["agrees"] == "True" for row in rigid)
    assert all(abs(float(row["measured"])) < 0.01 * float(row["predicted"]) for row in rigid)
    assert plot.stat().st_size > 5000


def test_a_refused_set_of_an_experiment_fails_alone_and_an_unknown_parameter_before_anything_runs() -> None:
    experiment = definition.load("creep")
    (case,) = swept(experiment, [Axis(GAIN, (-1.0,))], [(-1.0,)])
    found = measure(case)
    assert "force_gain" in found.failure
    assert not found.result.rows
    with pytest.raises(ParameterError, match="no parameter 'nothing'"):
        swept(experiment, [Axis("force_loop:nothing", (1,))], [(1,)])
