"""The testbed of section 5.6 on the same nodes and the same driver as the arm."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from rclpy.parameter import Parameter
from test_lockstep import differences, play_directly

from wam_bag.bag import JointColumns
from wam_ros.testing import RunningArm

POUND = 4.4482216152605
STEPS = [
    {"name": "release", "seconds": 0.2, "request": "enable"},
    {"name": "press", "seconds": 1.8, "force": {"frame": "base", "newtons": [0.0, 0.0, -10.0 * POUND]}},
    {
        "name": "disturb",
        "seconds": 0.5,
        "force": {"frame": "base", "newtons": [0.0, 0.0, -10.0 * POUND]},
        "push": {"cover": "link", "contact_position": 0.6, "newtons": [0.0, -5.0, 0.0], "begin": 0.1, "end": 0.3},
    },
    {"name": "brake", "seconds": 0.1, "request": "disable"},
]


def test_the_nodes_press_ten_pounds_on_the_spring_as_the_loop_without_ros_does(arm: RunningArm) -> None:
    bag = arm.play(STEPS, configuration="testbed", force_loop={"force_gain": [0.01]})
    assert differences(play_directly(arm.configuration).rows, bag) == []
    sensors = bag.topics["/wam/joint_sensors"]
    assert isinstance(sensors, JointColumns)
    at = int(np.searchsorted(sensors.stamp_ns, 1_950_000_000))
    deflection = -float(sensors.position[at, 0]) * 36.0  # in
    assert 10.0 * deflection == pytest.approx(10.0, rel=0.05)  # lb, by the 10 lb/in of section 5.6


@pytest.mark.parametrize(
    ("values", "text"), [([0.7, 0.7], "added_coulomb_friction' has 2 values"), ([-0.1], "allowed: 0 to 100")]
)
def test_the_teflon_rod_is_pressed_on_while_the_testbed_runs(values: list[float], text: str, arm: RunningArm) -> None:
    arm.start(configuration="testbed", timing={"mode": "realtime"})
    model, node = arm.truth.model, arm.nodes["driver"]
    (before,) = model.dof_frictionloss[1:]
    (answer,) = node.set_parameters([Parameter("effects.added_coulomb_friction", value=[0.7])])
    assert answer.successful
    arm.run(0.005)
    assert model.dof_frictionloss[1] == pytest.approx(before + 0.7)
    (answer,) = node.set_parameters([Parameter("effects.added_coulomb_friction", value=values)])
    assert not answer.successful
    assert text in answer.reason


def test_settings_and_chirps_are_the_same_over_topics_and_without_ros(arm: RunningArm, tmp_path: Path) -> None:
    force = {"frame": "link", "newtons": [0.0, -20.0, 0.0]}
    set_up = {"driver": {"effects.added_coulomb_friction": [0.7]}, "force_loop": {"force_gain": [0.009]}}
    steps = [
        {"name": "press", "seconds": 0.3, "request": "enable", "force": force, "set": set_up},
        {"name": "sweep", "seconds": 0.4, "force": force, "chirp": {"newtons": 6.0, "from": 2.0, "to": 20.0}},
        {
            "name": "no rod",
            "seconds": 0.3,
            "force": force,
            "set": {"driver": {"effects.added_coulomb_friction": [0.0]}},
        },
    ]
    bag = arm.play(steps, configuration="testbed", force_loop={"force_gain": [0.01]})
    run = play_directly(arm.configuration)
    assert differences(run.rows, bag) == []
    (friction,) = run.driver.plant.model.dof_frictionloss[1:]
    assert friction <= 0.19, "the rod is off again"
    for step in steps:
        step.pop("set", None)
    (tmp_path / "script.yaml").write_text(yaml.safe_dump({"steps": steps}))
    assert run.rows["joint_sensors"] != play_directly(arm.configuration).rows["joint_sensors"]
