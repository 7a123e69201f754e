"""Experiments: what each evaluation says of a signal with a known answer, and two of them run for real."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from recordings import forces, joints, recorded

from wam_bag.bag import BagError, PointColumns
from wam_cli.main import main
from wam_control.task import scenario
from wam_description.configuration import packaged
from wam_description.parameters import ParameterError
from wam_description.units import si
from wam_studies.page import section_of
from wam_studies.thesis import arm_forces, cables, force_accuracy, limit_cycles, quantised, testbed, transmission
from wam_studies.thesis.definition import configured, load, names
from wam_studies.thesis.evaluation import function_of
from wam_studies.thesis.measurement import ExperimentCase, measure
from wam_studies.thesis.one_link import one_link, played
from wam_studies.thesis.recording import Recording, Step
from wam_studies.thesis.rows import Comparison, Result, noted, summary

LEVER = 0.9144  # m
STIFFNESS = 1464.28  # k_c of the testbed at its joint, N m/rad
PRESS = (Step("press", 0.0, 20.0, {}),)


def pressed(time, force):  # the sensors of a testbed that presses with this force, N
    return joints(time, -np.asarray(force) * LEVER / STIFFNESS)


def pressing_run(folder: Path, run: tuple[str, int], time, force, steps=PRESS, desired=0.0, **topics):
    """A run of an experiment's testbed that presses with this force, N, of a motor at rest unless it is given."""
    given = {"joint_sensors": pressed(time, force), "motor_states": joints(time, 0.0)}
    if desired:
        given["force_command"] = forces(time, (0.0, -desired, 0.0))
    return recorded(load(run[0]), run[1], given | topics, steps, folder)


def after(run: Recording, settings: dict[str, list[float]]) -> Recording:
    """A run with other live parameters."""
    return run._replace(parameters=run.parameters.with_values(settings))


# definition


@pytest.mark.slow
@pytest.mark.parametrize("name", names())
def test_every_experiment_has_parameters_that_exist_and_steps_that_can_be_played(name: str, tmp_path: Path) -> None:
    experiment = load(name)
    assert callable(function_of(experiment.evaluation))
    for run in experiment.runs:
        configuration = configured(experiment, run, tmp_path)
        shared = configuration.shared  # refuses what does not fit together
        steps = scenario.load(tmp_path / f"{run.name}.yaml", shared)
        assert sum(step.seconds for step in steps) == pytest.approx(sum(step["seconds"] for step in run.steps))


def test_an_unknown_name_is_refused_with_those_that_exist() -> None:
    with pytest.raises(ParameterError, match=r"no experiment is named 'creeep'; choose from .*creep"):
        load("creeep")


@pytest.mark.parametrize(("change", "message"), [
    ({"rums": []}, "unknown key 'rums'"), ({"runs": []}, "'runs' must be a list with at least one"),
    ({"runs": [{"name": "../x", "steps": [{}]}]}, "it must be valid for a directory"),
    ({"runs": [{"name": "a", "steps": [{}]}] * 2}, "several runs are named a"),
    ({"runs": [{"name": "a"}]}, "'steps' is missing"),
])  # fmt: skip
def test_a_file_that_is_not_an_experiment_is_refused(change: dict, message: str, tmp_path: Path) -> None:
    body = {"title": "t", "section": "1", "configuration": "testbed", "evaluation": "cables.creeping"}
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump({**body, "runs": [{"name": "a", "steps": [{}]}], **change}))
    with pytest.raises(ParameterError, match=message):
        load(str(file))


# rows


def test_a_row_agrees_within_its_bound_and_never_with_what_could_not_be_measured() -> None:
    assert summary([noted("x", 2.0, "m")])[0] == "0 of 0"
    assert Comparison("x", 2.0, 2.03, bound=0.02).agrees
    assert not Comparison("x", 2.0, 2.05, bound=0.02).agrees
    assert Comparison("x", -2.0, -1.97, bound=0.02).deviation == pytest.approx(0.015)
    assert not Comparison("x", 2.0, math.nan, bound=0.02).agrees
    assert not Comparison("x", 0.0, 0.001, bound=0.02).agrees, "nothing is near zero in parts of it"
    assert Comparison("x", 0.0, 0.001, bound=0.02, absolute=True).agrees
    assert not Comparison("x", "settled", "diverged").agrees
    assert Comparison("x", 1.0, 9.0, bound=math.nan).agrees
    assert not Result([Comparison("x", 1.0, 1.0), Comparison("x", 1.0, 2.0, bound=0.1)], []).agrees


# evaluations


def test_marginal_gain_lies_where_growth_changes_its_sign(tmp_path: Path) -> None:
    time, runs = np.arange(0.0, 2.5, 5e-4), {}
    for number, gain, rate in ((0, 0.010, -0.6), (1, 0.014, 0.2)):
        steps = (Step("raise the gain", 0.0, 2.5, {"force_loop:force_gain": [gain]}),)
        force = 44.0 + 0.5 * np.exp(rate * time) * np.sin(75.0 * time)
        runs[f"{number}"] = pressing_run(tmp_path, ("testbed-5.6", number), time, force, steps)
    low, high, frequency, gain = testbed.margin(runs, "now")
    assert gain.measured == pytest.approx(0.013, rel=2e-3)  # three quarters of the way
    assert gain.predicted == pytest.approx(1.73e-3 * LEVER**2 / si(1.0, "lb-in"), rel=2e-3)  # of errata and thesis
    assert frequency.measured == pytest.approx(75.0, rel=2e-3)
    assert (low.predicted, low.measured) == ("decays", "decays")
    assert (high.predicted, high.measured) == ("grows", "grows")


def test_margin_with_the_velocity_loop_tends_to_that_of_a_velocity_source_as_it_gets_stiffer(tmp_path: Path) -> None:
    run = recorded(load("testbed-own-servo"), 0, {}, PRESS, tmp_path)
    own = testbed.margin_with_servo(run)
    stiff = {"velocity_loop:servo.proportional_gain": (0.03,), "velocity_loop:servo.integral_gain": (9.0,)}
    stiffer = run.parameters.with_values(stiff)
    closer = testbed.margin_with_servo(run._replace(parameters=stiffer))
    ideal = one_link(run).margin.gain * LEVER**2
    assert own > closer > ideal


def test_verdict_on_a_step_follows_from_its_last_windows(tmp_path: Path) -> None:
    time = np.arange(0.0, 3.0, 5e-4)
    step = Step("press", 0.0, 3.0, {})
    swing = np.sin(78.0 * time)
    shapes = {
        "settled": 10.0 * (1.0 - np.exp(-5.0 * time)),
        "limit cycle": 10.0 + 2.0 * swing,
        "diverged": 10.0 + np.exp(1.5 * time) * swing,
    }
    for verdict, force in shapes.items():
        run = pressing_run(tmp_path, ("testbed-5.6", 2), time, force, (step,))
        shown = played(run, step)
        assert shown.verdict == verdict
        stopped = run._replace(fault="cable", fault_time=2.0)
        assert shown._replace(run=stopped).verdict == "diverged"


def test_saturation_rod_and_delay_come_from_the_recorded_parameters(tmp_path: Path) -> None:
    experiment = load("testbed-5.6")
    number = [run.name for run in experiment.runs].index("large_step_saturated")
    run = recorded(experiment, number, {}, PRESS, tmp_path)
    link = one_link(after(run, {"driver:effects.added_coulomb_friction": [0.949]}))
    assert link.loop.error_limit == pytest.approx(22.24 * LEVER)
    assert link.loop.gain == pytest.approx(0.01921 / LEVER**2)
    assert link.node.static_friction == pytest.approx(0.949)
    assert one_link(run).node.static_friction == 0.0
    late = recorded(experiment, number + 1, {}, PRESS, tmp_path)
    assert (link.loop.delay_samples, one_link(late).loop.delay_samples) == (0, 1)
    with pytest.raises(ValueError, match="without G_P"):
        one_link(after(run, {"force_loop:force_proportional_gain": [0.001]}))


def test_stiction_cycle_of_a_square_wave(tmp_path: Path) -> None:
    time, steps = np.arange(0.0, 9.0, 1e-3), (Step("press", 0.0, 9.0, {}),)
    square = 10.9 + 1.2 * np.sign(np.sin(2.0 * np.pi * time / 1.9))
    calm = np.where(time < 2.0, square, 10.0)
    runs = {
        run.name: pressing_run(tmp_path, ("stiction-limit-cycle", number), time, force, steps, 10.936)
        for number, (run, force) in enumerate(
            zip(load("stiction-limit-cycle").runs, (square, calm, square), strict=True)
        )
    }
    rows = {row.quantity: row for row in limit_cycles.stiction(runs).rows}
    assert rows["F_c peak to peak"].measured == pytest.approx(2.4, rel=1e-4)
    assert rows["period"].measured == pytest.approx(1.9, rel=1e-3)
    assert rows["remaining peak to peak with it"].measured == pytest.approx(0.0, abs=1e-9)
    assert rows["remaining error with it"].measured == pytest.approx(0.936, abs=1e-4)
    # (5.8), (5.9) corrected, by hand: zeta 0.1604, Omega 1.6, dF 3 N m
    assert rows["F_c peak to peak"].predicted == pytest.approx(1.6 * 3.0 * 1464.28 / 3096.9 / LEVER, rel=2e-3)
    assert rows["period"].predicted == pytest.approx(1.943, rel=2e-3)


def test_actuator_cycle_of_a_motor_that_swings_against_a_stuck_joint(tmp_path: Path) -> None:
    time = np.arange(0.0, 8.0, 1e-3)
    stiffness, swing = 14.0**2 * 8.33, 0.007
    motor = 0.03 + swing * (np.abs((time / 2.0) % 2.0 - 1.0) - 0.5)  # at the joint, up and down in 4 s
    pull = stiffness * (motor - 0.03) + 20.0  # of the cable, the force of the contact and friction
    topics = {"motor_states": joints(time, -14.0 * motor), "sim/joint_states": joints(time, 0.0, effort=-pull)}
    force, steps = np.full(len(time), 20.0 / LEVER), (Step("press", 0.0, 8.0, {}),)
    run = pressing_run(tmp_path, ("actuator-limit-cycle", 0), time, force, steps, 21.9, **topics)
    result = limit_cycles.actuator({"press": run})
    rows = {row.quantity: row for row in result.rows}
    assert rows["motor, as a joint angle, peak to peak"].measured == pytest.approx(swing, rel=1e-3)
    assert rows["motor, as a joint angle, peak to peak"].predicted == pytest.approx(12.0 / stiffness, rel=1e-3)
    work = 0.5 * stiffness * (0.5 * swing) ** 2
    assert rows["work of a half cycle"].measured == pytest.approx(work, rel=5e-3)
    (power,) = (row for name, row in rows.items() if name.startswith("power"))
    assert power.measured == pytest.approx(work / 2.0, rel=5e-3)
    assert "power of a half cycle of 2.00 s" in rows
    (remark,) = result.remarks  # power times its own time is the work
    by_law, measured = (float(number) for number in re.findall(r"(\d+\.\d{3}) s", remark))
    assert power.predicted * by_law == pytest.approx(12.0**2 / 4.0 / (2.0 * stiffness), rel=1e-3)
    assert power.measured * measured == pytest.approx(rows["work of a half cycle"].measured, rel=1e-3)


def test_errors_at_rest_are_those_of_the_standstills(tmp_path: Path) -> None:
    time = np.arange(0.0, 1.0, 1e-3)
    speed = np.where((time % 0.25) < 0.1, 0.0, 0.3)
    force = np.select([time < 0.25, time < 0.5, time < 0.75], [0.0, 8.0, 9.5], 9.9)
    sensors = joints(time, -force * LEVER / STIFFNESS, -speed)
    shown = played(pressing_run(tmp_path, ("testbed-5.6", 0), time, force, desired=10.0, joint_sensors=sensors))
    assert testbed.errors_at_rest(shown) == pytest.approx([2.0, 0.5, 0.1], rel=1e-3)


def test_resonance_is_where_the_damped_response_has_it_without_damping() -> None:
    frequency = np.arange(0.1, 200.0, 0.1)
    s = 2j * np.pi * frequency
    natural, lead = 2.0 * np.pi * 9.0, 4e-3
    response = (1.0 + lead * s) / (s**2 + 2.0 * 0.07 * natural * s + natural**2)
    u = np.exp(1j * frequency**2 / 7.0) * (1.0 + 0.1 * np.cos(frequency))
    found = transmission.spectra(frequency, u, u * response)
    assert transmission.zero_of(found, 9.1, lead) == pytest.approx(9.0, rel=2e-3)
    assert found.coherence[1500] == pytest.approx(1.0, abs=1e-3)
    noise = np.random.default_rng(1).standard_normal(len(u)) + 0j
    assert np.median(transmission.spectra(frequency, u, noise).coherence) < 0.5


def test_a_torque_that_is_held_for_a_period_is_transformed_as_that(tmp_path: Path) -> None:
    """A pure integrator of a held torque, in closed form: the angle is the sum of the torques before it."""
    experiment = load("frequency-response")
    time = np.arange(1, 8001) * 1e-3
    torque = np.where(time < 7.0, np.sin(2.0 * np.pi * (1.0 + 5.0 * time) * time), 0.0)
    torque[time < 7.0] -= torque[time < 7.0].mean()  # so that the angle ends where it began
    angle = np.cumsum(torque) * 1e-3
    topics = {"motor_states": joints(time, 0.0, effort=torque), "joint_sensors": joints(time, angle)}
    steps = (Step("sweep", 0.0, 7.0, {}), Step("ring down", 7.0, 8.1, {}))
    found = transmission.transfer(recorded(experiment, 0, topics, steps, tmp_path))
    inside = (found.frequency > 20.0) & (found.frequency < 60.0)
    expected = 2j * np.pi * found.frequency[inside]
    assert np.abs(found.inverse[inside] / expected - 1.0).max() < 0.02


def test_the_gain_below_the_resonances_is_that_of_its_frequencies_and_not_the_static_one(tmp_path: Path) -> None:
    """An angle that follows a chirp of the torque as (4.3) has it, 1.2 times the static gain at 2.5 to 5 Hz."""
    experiment = load("frequency-response")
    time = np.arange(1, 20001) * 1e-3
    torque = np.where(time < 16.0, np.sin(2.0 * np.pi * (2.0 * time + 3.0 * time**2)), 0.0)
    steps = (Step("sweep", 0.0, 16.0, {}), Step("ring down", 16.0, 20.1, {}))
    topics = {"motor_states": joints(time, 0.0, effort=torque)}
    for folder in ("still", "moving"):
        (tmp_path / folder).mkdir()
    run = recorded(experiment, 0, topics, steps, tmp_path / "still")
    frequency = np.fft.rfftfreq(len(time), 1e-3)
    held = np.sinc(frequency * 1e-3) * np.exp(1j * np.pi * frequency * 1e-3)
    angle = np.fft.irfft(np.fft.rfft(torque) * held * transmission.response_of(run, frequency), len(time))
    topics |= {"joint_sensors": joints(time, angle - angle[-1])}
    rows = transmission.frequency_response({"chirp": recorded(experiment, 0, topics, steps, tmp_path / "moving")}).rows
    (row,) = (row for row in rows if row.quantity.startswith("joint angle per motor torque"))
    static = float(abs(transmission.response_of(run, np.array([1e-3]))[0]))
    assert row.predicted > 1.05 * static
    assert row.measured == pytest.approx(row.predicted, rel=0.02)


def test_forces_of_the_arm_are_compared_along_the_commanded_one(tmp_path: Path) -> None:
    experiment = load("wam-press")
    time = np.arange(0.0, 4.0, 5e-3)
    topics = {
        "force_command": forces(time, (0.0, -10.0, 0.0), "outer_link"),
        "force_measured": forces(time, (0.0, -10.0, 0.0), "outer_link"),
        "contact/wrench": forces(time, (3.0, 9.6, 0.0), "outer_link"),
        "sim/contact/wrench": forces(time, (-5.0, 9.5, 0.0), "outer_link"),
    }
    run = recorded(experiment, 0, topics, (Step("press 10 N", 0.0, 4.0, {}),), tmp_path)
    found = arm_forces.along(run)
    assert found.commanded == pytest.approx(10.0)
    assert found.true == pytest.approx(9.5)
    assert found.estimated == pytest.approx(9.6)
    elsewhere = {**topics, "contact/wrench": forces(time, (0.0, 9.6, 0.0), "inner_link")}
    run = recorded(experiment, 0, elsewhere, run.steps, tmp_path)
    assert arm_forces.along(run).estimated == pytest.approx(0.0), "a force on another link is not this one"


def test_an_experiment_outside_of_the_package_has_an_evaluation_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A YAML and a module, nothing else."""
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "my_laboratory.py").write_text("def names(runs):\n    return sorted(runs)\n")
    (tmp_path / "mine.yaml").write_text(
        "{title: Mine, section: none, configuration: testbed, evaluation: 'my_laboratory:names', "
        "runs: [{name: a, steps: [{name: rest, seconds: 1.0}]}]}"
    )
    experiment = load(str(tmp_path / "mine.yaml"))
    assert function_of(experiment.evaluation)({"b": None, "a": None}) == ["a", "b"]  # type: ignore[dict-item, comparison-overlap]
    for wrong in ("my_laboratory:missing", "nowhere:names", "cables", "cables.missing"):
        with pytest.raises(ParameterError, match=f"evaluation is '{wrong}'.*it must be MODULE.FUNCTION"):
            function_of(wrong)


def test_documentation_shows_every_experiment() -> None:
    docs = Path(__file__).resolve().parents[2] / "docs"
    text = section_of(docs / "experiments.md", "experiments")
    assert "MISSED" not in text
    for name in names():
        assert f"| `{name}` |" in text
        assert f"(experiments/{name}.png)" in text
        assert (docs / "experiments" / f"{name}.png").is_file()


def test_a_touch_is_judged_by_its_time_link_force_and_place(tmp_path: Path) -> None:
    time = np.arange(0.0, 3.0, 5e-3)
    there = (time >= 1.0) & (time < 2.0)
    detected = (time >= 1.06) & (time < 2.04)
    elsewhere = (time >= 1.5) & (time < 1.6)

    def wrench(where, newtons):
        frames = tuple("outer_link" if yes else "base" for yes in where)
        return forces(time, np.where(where, newtons, 0.0)[:, None] * (0.0, 1.0, 0.0))._replace(frames=frames)

    def place(where, x):
        stamps = np.round(time * 1e9).astype(np.int64)
        return PointColumns(stamps, stamps, ("",) * len(time), np.where(where, x, np.nan)[:, None] * (1.0, 0.0, 0.0))

    topics = {
        "sim/contact/wrench": wrench(there, 12.0),
        "contact/wrench": wrench(detected & ~elsewhere, 11.4),
        "sim/contact/point": place(there, 0.28),
        "contact/point": place(detected & ~elsewhere, 0.31),
    }
    run = recorded(load("wam-touch"), 0, topics, (Step("push", 0.0, 3.0, {}),), tmp_path)
    before, after, right, force, x = arm_forces.pushed({"push": run}).rows
    assert before.measured == pytest.approx(0.04)  # after the true contact
    assert after.measured == pytest.approx(0.065, abs=1e-6)
    assert right.measured == pytest.approx(1.0 - 0.16, abs=0.01)
    assert not right.agrees
    assert (force.predicted, force.measured) == pytest.approx((12.0, 11.4))
    assert x.deviation == pytest.approx(0.03)
    for estimated, expected in ((time > 0.5, (1.5, -0.49)), (there | ((time > 0.2) & (time < 0.4)), (0.2, 0.005))):
        wrong = {**topics, "contact/wrench": wrench(estimated, 11.4)}
        before, after, *_ = arm_forces.pushed({"push": recorded(load("wam-touch"), 0, wrong, (), tmp_path)}).rows
        assert (before.measured, after.measured) == pytest.approx(expected, abs=0.01)
        assert not (before.agrees and after.agrees)


# run for real


def run_command(*words: str) -> int:
    with pytest.raises(SystemExit) as ended:
        main(["experiment", *words])
    return int(ended.value.code or 0)


def test_creep_runs_and_is_judged_again_from_its_bag(tmp_path: Path, capfd) -> None:
    assert run_command("creep", "--directory", str(tmp_path), "--name", "mine") == 0
    said = capfd.readouterr()
    assert "\nall quantities of this table" in said.out
    assert "experiments: 1 of 1" in said.err
    assert (tmp_path / "mine" / "result.png").is_file()
    (tmp_path / "mine" / "result.png").unlink()
    again = ("--directory", str(tmp_path / "again"), "--evaluate")
    assert run_command("creep", *again, str(tmp_path / "mine")) == 0
    picture = tmp_path / "again" / "creep.png"
    assert capfd.readouterr().out == said.out.replace(str(tmp_path / "mine" / "result.png"), str(picture))
    assert picture.is_file()
    assert not (tmp_path / "mine" / "result.png").exists(), "an evaluation leaves the recording as it is"
    assert run_command("creep", *again, str(tmp_path / "mine" / "out_and_back")) == 0
    capfd.readouterr()
    assert run_command("creep", "--directory", str(tmp_path), "--name", "mine") == 2
    assert f"bag {tmp_path / 'mine' / 'out_and_back'} exists already" in capfd.readouterr().err
    # a bound that is missed: the same bag for an experiment in which the driver should have stopped the arm
    other = tmp_path / "creep.yaml"
    text = packaged("experiments/creep").read_text()
    other.write_text(text.replace("  - name: out_and_back\n", "  - name: out_and_back\n    stops: true\n"))
    assert run_command(str(other), "--directory", str(tmp_path), "--evaluate", str(tmp_path / "mine")) == 1
    assert "stops the arm  does not stop" in capfd.readouterr().out


def test_a_run_that_is_not_whole_is_not_judged(tmp_path: Path, capfd) -> None:
    file, whole = tmp_path / "short.yaml", yaml.safe_load(packaged("experiments/creep").read_text())
    file.write_text(yaml.safe_dump(whole))
    (run,) = load(str(file)).runs
    short = load(str(file))._replace(runs=(run._replace(steps=run.steps[:1]),))
    measure(ExperimentCase(short, str(tmp_path / "mine")))
    assert run_command(str(file), "--directory", str(tmp_path), "--evaluate", str(tmp_path / "mine")) == 2
    said = capfd.readouterr().err
    assert f"run 'out_and_back' ended in step '{run.steps[0]['name']}', 0 of {len(run.steps)} steps finished; " in said
    assert "repeat 'wam experiment short'" in said


def test_bags_that_are_missing_are_named(tmp_path: Path, capfd) -> None:
    assert run_command("wam-slide", "--directory", str(tmp_path), "--evaluate", str(tmp_path)) == 2
    assert "has no bag of slide; run 'wam experiment wam-slide'" in capfd.readouterr().err
    with pytest.raises(BagError):
        recorded(load("creep"), 0, {}, (), tmp_path).step("out")


def test_force_without_feedback_is_measured_as_a_play_of_its_friction(tmp_path: Path) -> None:
    """A motor torque that goes up and down, and a contact force that lags it by 4 N m at the joint."""
    time = np.arange(0.0, 8.0, 1e-3)
    desired = 5.0 * np.minimum(time, 8.0 - time)  # N, up to 20
    friction = 4.0 / LEVER
    force = np.where(time < 4.0, np.maximum(desired - friction, 0.0), np.minimum(20.0 - friction, desired + friction))
    steps = (Step("more", 0.0, 4.0, {}), Step("less", 4.0, 8.0, {}))
    motors, found = joints(time, 0.0 * time, effort=-desired * LEVER / 14.0), []
    for each in (force, np.maximum(desired - friction, 0.0)):  # the second is a deadband without memory
        run = pressing_run(tmp_path, ("force-accuracy", 0), time, each, steps, motor_states=motors)
        found.append(force_accuracy.open_loop(run)[0])
    of_play, forgotten = found
    assert all(row.agrees for row in of_play)
    assert [row.measured for row in of_play[1:3]] == pytest.approx([20.0 - friction, friction], abs=0.03)
    assert not forgotten[2].agrees


@pytest.mark.parametrize(("stretched", "agrees"), [(1.0, True), (1.15, False)])
def test_cycle_of_the_motor_under_a_force_in_steps_has_the_period_of_both_errors(
    stretched: float, agrees: bool, tmp_path: Path
) -> None:
    """By hand: 2 F_f/k_tr at G times either error, F_f 4 N m, G 8e-3 (rad/s)/(N m), 12 bits of a turn."""
    step, desired, k_tr, gain = 2.0 * math.pi / 4096 * STIFFNESS, 11.6 * LEVER, 14.0**2 * 8.33, 0.00669 / LEVER**2
    low, high = desired % step, step - desired % step
    up, down = (stretched * 2.0 * 4.0 / (k_tr * gain * error) for error in (low, high))
    time = np.arange(0.0, 12.0, 1e-3)
    phase = time % (up + down)
    motor = 8.0 / k_tr * np.where(phase < up, phase / up, 1.0 - (phase - up) / down)
    topics = {
        "motor_states": joints(time, -14.0 * motor),
        "sim/joint_states": joints(time, np.full(len(time), -4.5 * step / STIFFNESS)),
        "force_command": forces(time, (0.0, -11.6, 0.0)),
    }
    run = recorded(load("quantised-force"), 1, topics, PRESS, tmp_path)
    travel, period, force = quantised.quantised({"friction": run}).rows
    assert travel.agrees
    assert force.agrees
    assert period.agrees == agrees
    assert force.measured == pytest.approx(4.5 * step / LEVER - 11.6, rel=1e-3)


def test_joint_angles_that_keep_their_creep_are_not_taken_as_corrected(tmp_path: Path) -> None:
    experiment, time = load("creep-correction"), np.arange(0.0, 6.0, 1e-3)
    theta = 5.6 * (1.0 - np.abs(np.clip(time - 1.0, 0.0, 2.0) - 1.0))  # out and back
    travel = 5.6 * np.clip(time - 1.0, 0.0, 2.0)
    swings = np.where(time < 0.9005, 5e-4 * np.cos(2.0 * math.pi * (time - 0.9) / 0.02), 0.0)  # largest as it begins
    load_torque = 22.5  # N m at the joint
    per_radian = load_torque / 14.0 * (1.0 / (9.525e-3 * 42258.1) + 3.74166 / (9.525e-3 * 158116.0)) / 14.0
    lag = 7e-3 + per_radian * travel - swings  # elastic stretch, and creep
    steps = (Step("out", 0.9, 3.0, {}), Step("rest", 3.0, 6.0, {}))
    runs = {}
    for number, name in ((0, "taken_as_rigid"), (1, "corrected")):
        topics = {
            "motor_states": joints(time, theta),
            "joint_sensors": joints(time, theta / 14.0 - lag),
            "joint_states": joints(time, theta / 14.0),
            "sim/disturbance": forces(time, (0.0, -25.0, 0.0), torque=(0.0, 0.0, -load_torque)),
        }
        runs[name] = recorded(experiment, number, topics, steps, tmp_path)
    rigid, corrected = cables.creeping(runs).rows
    assert rigid.agrees
    assert rigid.measured == pytest.approx(1e3 * per_radian * 11.2, rel=1e-3)
    assert not corrected.agrees
