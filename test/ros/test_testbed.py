"""The testbed of section 5.6 on the same nodes and the same driver as the arm."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from rclpy.parameter import Parameter
from test_lockstep import differences, play_directly, record_composed

from wam_bag.bag import JointColumns, read
from wam_description.configuration import Configuration, packaged
from wam_ros.bring_up import Composition

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


def configured_testbed(folder: Path, *extra: str, mode: str = "lockstep") -> Configuration:
    script = folder / "script.yaml"
    script.write_text(yaml.safe_dump({"steps": STEPS}))
    base = Configuration.load(packaged("testbed"))
    return base.with_values(
        {
            "nodes": [*base.shared.nodes, *extra],
            "timing.mode": mode,
            "timing.real_time_factor": 0.0,
            "timing.timeout": 60.0,
            "scenario:script": str(script),
            "recorder:directory": str(folder),
            "recorder:name": "bag",
            "force_loop:force_gain": [0.01],
        }
    )


def test_the_nodes_press_ten_pounds_on_the_spring_as_the_loop_without_ros_does(tmp_path: Path, domain_id: int) -> None:
    configured = configured_testbed(tmp_path, "scenario", "recorder")
    record_composed(configured, domain_id)
    bag = read(tmp_path / "bag")
    assert differences(play_directly(configured, tmp_path / "script.yaml").rows, bag) == []
    sensors = bag.topics["/wam/joint_sensors"]
    assert isinstance(sensors, JointColumns)
    at = int(np.searchsorted(sensors.stamp_ns, 1_950_000_000))
    deflection = -float(sensors.position[at, 0]) * 36.0  # in
    assert 10.0 * deflection == pytest.approx(10.0, rel=0.05)  # lb, by the 10 lb/in of section 5.6


def test_the_outer_loop_runs_at_fifty_hertz_and_answers_in_the_same_period() -> None:
    timing = Configuration.load(packaged("testbed")).shared.timing
    assert timing.outer_period_ns == 20_000_000
    assert timing.outer_delay == 0


def test_the_teflon_rod_is_pressed_on_while_the_testbed_runs(tmp_path: Path, domain_id: int) -> None:
    with Composition(configured_testbed(tmp_path, mode="realtime"), domain_id=domain_id) as composition:
        node = composition.nodes["driver"]
        plant = node.driver.plant  # type: ignore[attr-defined]
        (before,) = plant.model.dof_frictionloss[1:]
        (answer,) = node.set_parameters([Parameter("effects.added_coulomb_friction", value=[0.7])])
        assert answer.successful
        stamp = node.driver.stamp  # type: ignore[attr-defined]
        composition.spin(lambda: node.driver.stamp > stamp + 5_000_000)  # type: ignore[attr-defined]
        assert plant.model.dof_frictionloss[1] == pytest.approx(before + 0.7)
        (answer,) = node.set_parameters([Parameter("effects.added_coulomb_friction", value=[0.7, 0.7])])
        assert not answer.successful
        assert "added_coulomb_friction' has 2 values" in answer.reason
        (answer,) = node.set_parameters([Parameter("effects.added_coulomb_friction", value=[-0.1])])
        assert not answer.successful


def test_settings_and_chirps_are_the_same_over_topics_and_without_ros(tmp_path: Path, domain_id: int) -> None:
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
    configured = configured_testbed(tmp_path, "scenario", "recorder")
    (tmp_path / "script.yaml").write_text(yaml.safe_dump({"steps": steps}))
    record_composed(configured, domain_id)
    run = play_directly(configured, tmp_path / "script.yaml")
    assert differences(run.rows, read(tmp_path / "bag")) == []
    (friction,) = run.driver.plant.model.dof_frictionloss[1:]
    assert friction <= 0.19, "the rod is off again"
    for step in steps:
        step.pop("set", None)
    (tmp_path / "script.yaml").write_text(yaml.safe_dump({"steps": steps}))
    assert run.rows["joint_sensors"] != play_directly(configured, tmp_path / "script.yaml").rows["joint_sensors"]


def test_a_setting_that_is_refused_ends_the_scenario_with_the_reason(tmp_path: Path, domain_id: int) -> None:
    configured = configured_testbed(tmp_path, "scenario")
    body = {"name": "rub", "seconds": 0.3, "set": {"driver": {"effects.added_coulomb_friction": [1.0] * 2}}}
    (tmp_path / "script.yaml").write_text(yaml.safe_dump({"steps": [body]}))
    with Composition(configured, domain_id=domain_id) as composition:
        scenario = composition.nodes["scenario"]
        composition.spin(lambda: scenario.done)  # type: ignore[attr-defined]
        assert "step 'rub': driver refuses" in scenario.failure  # type: ignore[attr-defined]
