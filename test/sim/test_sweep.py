"""Sweeps: parameter sets, equal results on every executor, what was finished is kept, a refused set fails alone."""

import csv
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from wam_cli.main import main
from wam_control.task.scenario import load
from wam_description.configuration import Configuration, packaged
from wam_description.parameters import ParameterError
from wam_sim.batch import results
from wam_sim.sweep import Axis, drawn, grid, listed
from wam_studies.thesis import definition
from wam_studies.thesis.measurement import MeasuredCase, ScenarioCase, measure, measure_scenario, swept, swept_scenario

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


def runs(script: Path, gains: tuple[float, ...]) -> list[ScenarioCase]:
    configuration = Configuration.load(packaged("testbed"))
    return swept_scenario(configuration, load(script, configuration.shared), grid([Axis(GAIN, gains)]))


def number(found: MeasuredCase, name: str) -> float | str:
    """What was measured of a quantity."""
    return next(one.measured for one in found.result.rows if one.quantity == name)


def test_a_grid_has_every_combination_and_a_list_goes_in_step() -> None:
    axes = [Axis("a", (1, 2)), Axis("b", (3, 4))]
    assert grid(axes) == [{"a": a, "b": b} for a in (1, 2) for b in (3, 4)]
    assert listed(axes) == [{"a": 1, "b": 3}, {"a": 2, "b": 4}]
    with pytest.raises(ValueError, match="a: 2, b: 1"):
        listed([axes[0], Axis("b", (3,))])


def test_random_sets_are_repeatable_and_between_the_ends() -> None:
    axes = [Axis("a", (1e-3, 1.0)), Axis("b", (-1.0, 2.0))]
    found = drawn(axes, 200, 4)
    assert found == drawn(axes, 200, 4) != drawn(axes, 200, 5)
    assert all(1e-3 <= one["a"] <= 1.0 and -1.0 <= one["b"] <= 2.0 for one in found)
    assert 60 < sum(one["a"] < 10**-1.5 for one in found) < 140, "by the logarithm"
    with pytest.raises(ValueError, match="needs two numbers"):
        drawn([Axis("a", (1.0, 2.0, 3.0))], 1, 1)


def test_an_unknown_parameter_is_refused_before_anything_runs(script: Path) -> None:
    configuration = Configuration.load(packaged("testbed"))
    with pytest.raises(ParameterError, match="no parameter 'nothing'"):
        swept_scenario(configuration, load(script, configuration.shared), [{"force_loop:nothing": 1}])


@pytest.mark.slow
@pytest.mark.parametrize(("frame", "newtons", "seconds", "error"), [
    ("link", [0.0, -20.0, 0.0], 1.2, -11.8),
    ("base", [0.0, 0.0, -20.0], 1.2, -11.8),
    ("link", [0.0, 20.0, 0.0], 1.0, -100.0),  # nothing is touched; not too brief
    ("link", [0.0, -20.0, 0.0], 0.4, float("nan")),  # too brief to be steady
])  # fmt: skip
def test_the_error_of_a_force(frame: str, newtons: list[float], seconds: float, error: float, tmp_path: Path) -> None:
    file = tmp_path / "force.yaml"
    text = STEPS.replace("link", frame).replace("[0.0, -20.0, 0.0]", str(newtons))
    file.write_text(text.replace("0.4", str(seconds)))
    found = measure_scenario(runs(file, (0.004,))[0])
    assert number(found, "press: error of the true force") == pytest.approx(error, abs=0.1, nan_ok=True)
    brief = ("press: 20 N commanded on link for less than 1 s, so it has no steady state.",)
    assert (found.result.reported == brief) == (seconds < 1.0)
    assert not found.failure


@pytest.mark.slow
def test_a_force_that_changes_all_the_time_is_not_too_brief(script: Path) -> None:
    script.write_text(STEPS.replace("force:", "chirp: {newtons: 2.0, from: 1.0, to: 3.0}, force:"))
    assert measure_scenario(runs(script, (0.004,))[0]).result.reported == ()


@pytest.mark.slow
def test_a_force_that_a_larger_one_on_another_link_hides_is_not_assessed(tmp_path: Path) -> None:
    """`sim/contact/wrench` has the link that bears most: 7 N of error were stated for a force that was right."""
    file, found = tmp_path / "two.yaml", []
    for size in (0.0, 15.0):
        push = f"push: {{cover: inner_link, contact_position: 0.02, newtons: [0.0, 0.0, {size}]}}"
        force = "force: {frame: outer_link, newtons: [0.0, -8.0, 0.0], contact_position: 0.26}"
        file.write_text(f"""
steps:
  - {{name: release, seconds: 0.3, request: enable}}
  - {{name: above, seconds: 2.0, posture: [0.0, -1.8, 0.0, 1.45]}}
  - {{name: lower, seconds: 4.0, posture: [0.0, -2.1, 0.0, 1.45], until_force: 1.5}}
  - {{name: press, seconds: 2.0, {force}, {push}}}
""")
        configuration = Configuration.load(packaged("wam")).with_values({"force_loop:limits.doubt": 5.0})
        (case,) = swept_scenario(configuration, load(file, configuration.shared), [{}])
        found.append(measure_scenario(case))
    assert [one.result.reported for one in found] == [(), ("Failed: correct link (another link than inner_link).",)]
    alone, hidden = (number(one, "press: true force") for one in found)
    assert alone == pytest.approx(8.0, abs=0.8)
    assert hidden == pytest.approx(float("nan"), nan_ok=True)


@pytest.mark.slow
def test_a_sweep_names_a_lowered_gain_and_uncertain_force(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
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
    assert row["reported"].startswith("the guard lowered it; used: force_gain [0.")
    assert "; Failed: force within 10 %" in row["reported"]
    assert "; press: applied, but perhaps wrong from " in row["reported"]
    assert float(row["largest error, bias plus ripple [N]"]) > 1.0
    assert "1 set, 0 failed, 1 with a remark (column 'reported')" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize(("seconds", "command", "report"), [
    (0.4, "torque: [0, 0, 0, 50]", "s': torque of joint 4: 50 N m is commanded; allowed: up to torque_limit"),
    (3.0, "torque: [0, 0, 0, 2]", "s: torque of joint 4: 2 N m are commanded, but 0.00 N m are measured"),
    (3.0, "force: {frame: outer_link, newtons: [0, -4, 0]}", "s: force along (0, -1, 0): 4 N are commanded, but"),
    (
        0.4,
        "task: {axes: [{force: 70.0, along: [0, 0, -1], cover: outer_link, contact_position: 0.28}]}",
        "s': force along (0, 0, -1) at 0.28 m along outer_link: 70 N is commanded; allowed: up to",
    ),
    (0.4, "torque: [0, 0, 0, 0]", "press: not assessed: its force, torque or motion was commanded for at most 2 s"),
])  # fmt: skip
def test_a_task_that_is_not_done_has_its_reason(seconds: float, command: str, report: str, tmp_path: Path) -> None:
    file = tmp_path / "task.yaml"
    press = f"- {{name: press, seconds: {seconds}, {command}}}"
    file.write_text(f"steps:\n- {{name: release, seconds: 0.1, request: enable}}\n{press}\n")
    configuration = Configuration.load(packaged("wam"))
    found = measure_scenario(ScenarioCase(configuration, tuple(load(file, configuration.shared))))
    assert report in "; ".join([found.failure, *found.result.reported])
    assert bool(found.failure) is ("allowed" in report), "what is beyond a limit is refused before the start"


@pytest.mark.slow
def test_a_refused_set_fails_alone_and_finished_runs_are_kept(script: Path, tmp_path: Path) -> None:
    given = runs(script, (0.004, 0.02, -1.0))
    with ThreadPoolExecutor(1) as one:
        found = results(measure_scenario, given, one, tmp_path / "kept.jsonl")
    assert [bool(result.failure) for result in found] == [False, False, True]
    assert found[2].failure
    largest = [number(one, "press: largest force") for one in found[:2]]
    assert largest[0] < largest[1], "a large gain overshoots"
    again: list[tuple[int, int]] = []
    with ThreadPoolExecutor(1) as one:
        kept = results(measure_scenario, given, one, tmp_path / "kept.jsonl", lambda done, of: again.append((done, of)))
    assert again == [(3, 3)]
    assert repr(kept) == repr(found)  # with numbers that are not known


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
    assert all(20.0 < float(row["press: largest force [N]"]) < 25.0 for row in rows)
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
    creeping, rigid = rows
    assert [row["driver:effects.creep"] for row in rows] == ["True", "False"]
    quantities = [name for name in creeping if f"{name}, predicted" in creeping]
    for name in quantities:
        assert float(creeping[f"{name}, predicted"]) == pytest.approx(float(rigid[f"{name}, predicted"]))
        assert abs(float(rigid[name])) < 0.01 * float(rigid[f"{name}, predicted"])
    assert (creeping["deviating"], rigid["deviating"].count(";")) == ("", len(quantities) - 1)
    assert "out and back: the guard lowered it; used: force_gain [0.00" in creeping["reported"]
    assert plot.stat().st_size > 5000


def test_a_refused_set_of_an_experiment_fails_alone_and_an_unknown_parameter_before_anything_runs() -> None:
    experiment = definition.load("creep")
    (case,) = swept(experiment, [{GAIN: -1.0}])
    found = measure(case)
    assert "force_gain" in found.failure
    assert not found.result.rows
    with pytest.raises(ParameterError, match="no parameter 'nothing'"):
        swept(experiment, [{"force_loop:nothing": 1}])
