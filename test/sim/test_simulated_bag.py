"""The demonstration without ROS: the same nodes in one process, and a bag of the same form."""

import os
import subprocess
from pathlib import Path

import pytest
from conftest import ran

from wam_bag.bag import JointColumns, TableColumns, WrenchColumns, read
from wam_control.task.scenario import Push, ScenarioStep
from wam_control.task.scenario_settings import Setting
from wam_description.configuration import Configuration, packaged
from wam_sim.recorded_run import recorded_run
from wam_sim.simulated_bag import record
from wam_sim.simulation import Simulation

ROOT = Path(__file__).parents[2]
HIDDEN = (
    "rclpy", "ament_index_python", "builtin_interfaces", "diagnostic_msgs", "geometry_msgs", "rcl_interfaces",
    "sensor_msgs", "std_msgs", "std_srvs", "trajectory_msgs", "visualization_msgs", "rosgraph_msgs",
)  # fmt: skip
TOUCH = """steps:
  - {name: release the brakes, seconds: 0.3, request: enable}
  - name: push while moving
    seconds: 1.2
    posture: [0.0, -1.2, 0.0, 1.0]
    push: {cover: outer_link, contact_position: 0.28, newtons: [0.0, 12.0, 0.0], begin: 0.4, end: 1.0}
  - {name: brake, seconds: 0.1, request: disable}
"""


def without_ros(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """A command in a process that finds no package of ROS."""
    for name in HIDDEN:
        (folder / "hidden" / name).mkdir(parents=True, exist_ok=True)
        code = f"raise ModuleNotFoundError(\"No module named '{name}'\", name='{name}')"
        (folder / "hidden" / name / "__init__.py").write_text(code)
    path = os.pathsep.join([str(folder / "hidden"), str(ROOT)])
    return ran("-P", "-m", "wam_cli.program", *words, cwd=folder, env={**os.environ, "PYTHONPATH": path})


def test_a_run_that_fails_ends_with_the_status_of_a_braked_arm() -> None:
    steps = [ScenarioStep("release", 0.2, request="enable"), ScenarioStep("jump", 0.01, posture=(0.0, -2.0, 0.0, 1.0))]
    run, modes = Simulation(Configuration.load(packaged("wam")), steps), []
    run.listen("status", lambda _, status: modes.append(status.mode), "driver")
    assert "turns at up to" in run.play()
    assert modes == ["braked", "enabled", "braked"]


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Folder and output of a demonstration without ROS."""
    folder = tmp_path_factory.mktemp("plain")
    (folder / "touch.yaml").write_text(TOUCH)
    done = without_ros(folder, "demo", "--scenario", "touch.yaml", "--name", "touch")
    assert done.returncode == 0, done.stdout + done.stderr
    return folder, done.stdout


@pytest.mark.slow
def test_the_demonstration_without_ros_says_so_and_reports(played: tuple[Path, str]) -> None:
    _, out = played
    assert out.count("ROS is not installed") == 1
    assert "pip install 'wam_stack[ros,live]'" in out
    assert "correct link: YES" in out
    assert out.index("Verdict") < out.index("correct link: YES") < out.index("position along the link")


@pytest.mark.slow
def test_a_force_that_is_refused_ends_the_demonstration_with_an_exit_code_and_the_reason(tmp_path: Path) -> None:
    """A force that is not measured well enough: what follows it in a script would go on as after a press."""
    force = "{name: press, seconds: 1.6, force: {frame: outer_link, newtons: [50.0, 0.0, 0.0]}}"
    (tmp_path / "press.yaml").write_text(TOUCH.replace("  - {name: brake", f"  - {force}\n  - {{name: brake"))
    done = without_ros(tmp_path, "demo", "--scenario", "press.yaml", "--name", "press")
    assert done.returncode == 1
    last = done.stdout.rstrip().splitlines()[-1]
    assert last == "checks failed: force within 10 %: NO (1 of 1 not applied)"
    assert "press: refused from" in done.stdout
    assert "largest error" not in done.stdout


@pytest.mark.slow
def test_its_bag_is_that_of_a_recorder(played: tuple[Path, str]) -> None:
    path = played[0] / "bags" / "touch"
    found = read(path, ())
    assert found.mode == "lockstep"
    run = recorded_run(read(path))
    assert (run.outcome, [step.name for step in run.steps]) == (
        "done",
        ["release the brakes", "push while moving", "brake"],
    )
    assert run.parameters.shared.arm.name == "wam"
    motors = run.bag.topics["/wam/motor_states"]
    assert isinstance(motors, JointColumns)
    assert len(motors.stamp_ns) == 5 * len(run.bag.topics["/wam/joint_states"].log_time_ns) - 4
    assert isinstance(run.bag.topics["/wam/contact/hypotheses"], TableColumns)
    truth = run.bag.topics["/wam/sim/contact/wrench"]
    assert isinstance(truth, WrenchColumns)
    assert abs(truth.force[:, 1].max() - 12.0) < 1e-6
    modes = [status.mode for status in run.statuses if status.node == "driver"]
    assert modes == ["braked", "enabled", "braked"]


@pytest.mark.slow
@pytest.mark.parametrize("words", [["--live"], ["--realtime"]])
def test_what_needs_ros_is_refused_in_one_sentence(tmp_path: Path, words: list[str]) -> None:
    (tmp_path / "touch.yaml").write_text(TOUCH)
    done = without_ros(tmp_path, "demo", "--scenario", "touch.yaml", *words)
    assert done.returncode == 1
    assert done.stderr == f"wam demo: {words[0]} needs ROS; pip install 'wam_stack[ros,live]', or leave it out\n"
    assert not (tmp_path / "bags").exists()


@pytest.mark.slow
def test_what_a_scenario_commands_is_recorded_with_a_configuration_that_does_not_name_its_node(tmp_path: Path) -> None:
    configuration = Configuration.load(packaged("wam"))
    assert "scenario" not in configuration.shared.nodes
    push = Push("outer_link", 0.28, (0.0, 12.0, 0.0), 0.0, 0.05)
    assert record(configuration, [ScenarioStep("push", 0.05, push=push)], tmp_path / "bag") == ""
    topics = read(tmp_path / "bag").topics
    assert {"/wam/force_command", "/wam/joint_posture_command", "/wam/task_command"} <= set(topics)
    pushed = topics["/wam/sim/disturbance"]
    assert isinstance(pushed, WrenchColumns)
    assert pushed.force[1].tolist() == [0.0, 12.0, 0.0]


@pytest.mark.slow
def test_a_step_with_the_name_of_the_one_before_is_a_step_of_its_own_with_what_it_sets(tmp_path: Path) -> None:
    setting = Setting("force_loop", "limits.contact_force", 20.0)
    steps = [ScenarioStep("hold", 0.05), ScenarioStep("hold", 0.05, settings=(setting,)), ScenarioStep("hold", 0.05)]
    record(Configuration.load(packaged("wam")), steps, tmp_path / "bag")
    found = recorded_run(read(tmp_path / "bag")).steps
    assert [(step.name, dict(step.settings)) for step in found] == [
        ("hold", {}),
        ("hold", {"force_loop:limits.contact_force": 20.0}),
        ("hold", {}),
    ]
