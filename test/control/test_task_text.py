"""Tasks and motions in scenario files, and the example of them on the simulated arm."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from arms import CONFIGURATION, SHARED, WAM
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from wam_control.force.task import AxisKind, TaskCommand
from wam_control.task.scenario import Scenario, ScenarioStep, load
from wam_description.parameters import ParameterError
from wam_description.rigid_body import RigidBody
from wam_description.signals import NO_CONTACT, PathPoint, PosturePath
from wam_ros.messages import Refused, read_trajectory
from wam_sim.simulation import Simulation

NAMES = list(WAM.joints.names)
START = [0.0, -1.2, 0.2, 0.3]
EXAMPLE = Path(__file__).parents[2] / "examples" / "tasks.yaml"
AT = {"along": [0, 0, -1], "cover": "outer_link", "contact_position": 0.28}


def step_of(tmp_path: Path, **keys: Any) -> ScenarioStep:
    path = tmp_path / "scenario.yaml"
    path.write_text(yaml.safe_dump({"steps": [{"name": "do", "seconds": 1.0, **keys}]}))
    return load(path, SHARED)[0]


def task(tmp_path: Path, *axes: dict[str, Any], **more: Any) -> TaskCommand:
    found = step_of(tmp_path, task={"axes": list(axes), **more}).task
    assert found is not None
    return found


def test_axes_are_read_in_the_order_of_their_priority(tmp_path: Path) -> None:
    read = task(tmp_path, {"force": 10, **AT}, {"position": "here", "joint": "joint3"}, {"free": 90, **AT})
    assert [axis.kind for axis in read.axes] == [AxisKind.FORCE, AxisKind.POSITION, AxisKind.IMPEDANCE]
    assert (read.axes[0].value, read.axes[1].joint, read.axes[1].value) == (10.0, 2, None)
    assert (read.axes[2].stiffness, read.axes[2].damping) == (0.0, 90.0)
    assert task(tmp_path, {"force": 10, **AT, "contact_position": "estimated"}).axes[0].position is None


def test_a_frame_of_ones_own_turns_the_axes(tmp_path: Path) -> None:
    read = task(tmp_path, {"force": 1, **AT, "along": [1, 0, 0]}, frame={"of": "base", "rpy": [0.0, 0.0, np.pi / 2]})
    assert read.axes[0].direction == pytest.approx((0.0, 1.0, 0.0), abs=1e-12)


def test_a_line_is_four_positions_of_which_some_may_be_held(tmp_path: Path) -> None:
    line = {"line": "outer_link", "point": [0.4, 0.0, -0.2], "along": [0, 1, 0]}
    assert [axis.position for axis in task(tmp_path, line).axes] == [0.0, 0.0, 0.4064, 0.4064]
    level = task(tmp_path, {**line, "hold": ["start_up", "end_up"]}).axes
    assert [abs(axis.direction[2]) for axis in level] == [1.0, 1.0]
    assert [axis.value * axis.direction[2] for axis in level] == pytest.approx([-0.2, -0.2])  # type: ignore[operator]


def test_a_torque_is_a_force_of_each_joint(tmp_path: Path) -> None:
    read = step_of(tmp_path, torque=[1.0, 2.0, 3.0, 4.0]).task
    assert read is not None
    assert [(axis.joint, axis.value) for axis in read.axes] == [(0, 1.0), (1, 2.0), (2, 3.0), (3, 4.0)]


@pytest.mark.parametrize(("keys", "reason"), [
    ({"task": {"axes": []}}, "axes of the task is"),
    ({"task": {"axes": [{"force": 3, **AT, "cover": "hand"}]}}, "cover is 'hand'; allowed: inner_link, outer_link"),
    ({"task": {"axes": [{"force": 3, **AT, "contact_position": 3.0}]}}, "is 3.0 m; allowed: 0 to 0.4064 m"),
    ({"task": {"axes": [{"position": 0, **AT}], "frame": "outer_link"}}, "turns with it"),
    ({"task": {"axes": [{"velocity": 0.1, **AT, "contact_position": "estimated"}]}}, "for a force only"),
    ({"posture": START, "tip": [0.5, 0.0, 0.0]}, "posture and tip are given"),
    ({"posture": START, "torque": [0.0] * 4}, "posture and torque are given; the torque leaves no joint free"),
    (
        {"tip": [0.5, 0.0, 0.0], "task": {"axes": [{"position": 0, "joint": f"joint{k}"} for k in (1, 2, 3, 4)]}},
        "tip and task are given; the task leaves no joint free to move; give one of them, or a task with fewer",
    ),
    ({"trajectory": {"postures": [[9.0, 0.0, 0.0, 0.0]]}}, "posture: joint1 is commanded to 9 rad"),
])  # fmt: skip
def test_what_a_file_may_not_have_is_refused_with_what_is_allowed(keys: dict, reason: str, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=reason):
        step_of(tmp_path, **keys)


@pytest.mark.parametrize(("axis", "angle", "is_refused"), [
    ({"position": 0.4}, 0.4, False),
    ({"position": 0.4}, 0.5, True),
    ({"position": "here"}, START[0], False),
    ({"position": "here"}, 0.3, True),
    ({"velocity": 0.1}, 0.3, True),
    ({"free": 5.0}, 0.3, True),
])  # fmt: skip
def test_a_posture_that_moves_a_joint_of_the_task_is_refused(
    axis: dict[str, Any], angle: float, is_refused: bool, tmp_path: Path
) -> None:
    keys = {"posture": [angle, *START[1:]], "task": {"axes": [{**axis, "joint": "joint1"}]}}
    path = tmp_path / "scenario.yaml"
    begin = {"name": "go", "seconds": 2.0, "posture": START}
    path.write_text(yaml.safe_dump({"steps": [begin, {"name": "do", "seconds": 1.0, **keys}]}))
    if not is_refused:
        assert load(path, SHARED)
        return
    with pytest.raises(ParameterError, match=r"the posture moves joint1 to .* rad, and has no effect on it next to"):
        load(path, SHARED)


def test_a_step_streams_its_task_and_takes_it_back(tmp_path: Path) -> None:
    steps = [step_of(tmp_path, torque=[0.0] * 4), ScenarioStep("rest", 1.0)]
    scenario = Scenario(steps, SHARED)
    assert scenario.step(START, NO_CONTACT, 0.005).step.task is scenario.steps[0].task
    elsewhere = [0.1, -1.1, 0.2, 0.3]
    outs = [scenario.step(elsewhere, NO_CONTACT, 0.5) for _ in range(2)]
    assert outs[-1].step.task is None
    assert outs[-1].posture == elsewhere, "the arm stays where the task has taken it"


def test_a_motion_is_commanded_with_its_velocity_and_ends_at_its_goal(tmp_path: Path) -> None:
    goal = RigidBody(WAM).tool_pose(START).position + np.array([-0.05, 0.1, -0.05])
    scenario = Scenario([step_of(tmp_path, tip=goal.tolist(), seconds=2.0)], SHARED)
    outs = [scenario.step(START, NO_CONTACT, 0.005) for _ in range(399)]
    postures, rates = np.array([out.posture for out in outs]), np.array([out.rate for out in outs])
    assert RigidBody(WAM).tool_pose(postures[-1]).position == pytest.approx(goal, abs=1e-6)
    assert np.gradient(postures, 0.005, axis=0)[1:-1] == pytest.approx(rates[1:-1], abs=5e-3)


@pytest.mark.parametrize(("step", "reason"), [
    (ScenarioStep("far", 9.0, tip=(2.0, 0.0, 0.0)), "step 'far': the goal of the tip is 2 m from the origin"),
    (ScenarioStep("through", 9.0, tip=(0.0, 0.0, 0.0)), "step 'through': at .* of the line"),
    (ScenarioStep("short", 0.1, trajectory=PosturePath((PathPoint((0.5, -1.0, 0.0, 0.0)),))), "seconds is 0.1"),
])  # fmt: skip
def test_a_motion_that_cannot_be_done_fails_before_it_moves(step: ScenarioStep, reason: str) -> None:
    scenario = Scenario([step], SHARED)
    out = scenario.step(START, NO_CONTACT, 0.005)
    assert (out.done, out.request, out.posture) == (True, "disable", START)
    with pytest.raises(AssertionError, match=reason):
        raise AssertionError(out.failure)


def message(*positions: list[float], names: list[str] = NAMES, seconds: float = 0.0) -> JointTrajectory:
    found = JointTrajectory(joint_names=names)
    for values in positions:
        point = JointTrajectoryPoint(positions=values)
        point.time_from_start.sec, point.time_from_start.nanosec = int(seconds), int(seconds % 1.0 * 1e9)
        found.points.append(point)
    return found


def test_a_trajectory_message_is_matched_by_name() -> None:
    read = read_trajectory(message([1.0, 2.0, 3.0, 4.0], names=NAMES[::-1], seconds=1.5), NAMES)
    assert read == PosturePath((PathPoint((4.0, 3.0, 2.0, 1.0), (), 1.5),))


@pytest.mark.parametrize(("given", "reason"), [
    (message(), "0 points; send 1 to"),
    (message([1.0]), "point 0: position has 1 values; send 4"),
    (message([float("nan")] * 4), "point 0: position of joint1 is nan"),
    (message([0.0] * 4, names=NAMES[:3]), "name 'joint4' is missing"),
])  # fmt: skip
def test_a_trajectory_message_that_is_none_is_refused(given: JointTrajectory, reason: str) -> None:
    with pytest.raises(Refused, match=reason):
        read_trajectory(given, NAMES)


@pytest.mark.slow
def test_the_example_presses_slides_moves_straight_and_is_led() -> None:
    run = Simulation(CONFIGURATION, load(EXAMPLE, SHARED))
    assert run.play() == ""
    body = RigidBody(WAM)
    rows = run.rows["sim/joint_states"]
    times = np.array([row.stamp for row in rows]) / 1e9
    tips = np.array([body.tool_pose(row.values[:4]).position for row in rows])
    forces = np.array([row.values[1] for row in run.rows["sim/contact/wrench"]])  # across the link; z is the friction
    shown = np.array([row.stamp for row in run.rows["task_axes"]]) / 1e9
    begin = shown[0]
    pressed = (times > begin + 1.0) & (times < begin + 2.4)
    assert forces[pressed].mean() == pytest.approx(8.0, rel=0.05)
    assert np.ptp(tips[pressed, 1]) == pytest.approx(1.4 * 0.03, rel=0.25)
    led = shown[np.argmax(np.diff(shown) > 1.0) + 1]  # after the pause without a task
    straight = (times > led - 2.0) & (times < led)
    way = tips[straight]
    along = (way[-1] - way[0]) / np.linalg.norm(way[-1] - way[0])
    off = way - way[0] - np.outer((way - way[0]) @ along, along)
    assert np.abs(off).max() < 5e-3
    assert way[-1] == pytest.approx([0.80, 0.15, 0.0], abs=5e-3)
    at = [int(np.searchsorted(times, led + t)) for t in (0.65, 1.4)]
    moved = np.linalg.norm(tips[at[1]] - tips[at[0]])
    assert moved > 3e-3, "0.7 N lead the arm"
