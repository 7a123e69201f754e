"""Parameters: refused by name, described to ROS, changed as a set or not at all."""

import math
import os
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml
from conftest import LONG, ran
from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter

from wam_cli.commands.conform import on_bus
from wam_description.arm import Shared
from wam_description.configuration import SHARED, Configuration, packaged
from wam_description.interface import declared
from wam_description.nodes import NODES
from wam_description.parameters import ParameterError, build, fields, like, parameter, require, values
from wam_description.wiring import Input, Inputs, Outputs, declaration, reaction
from wam_description.wiring import SetParameters as SetParametersRequest
from wam_ros.node import AdaptedNode, make_node, parameter_file
from wam_ros.requests import answer_of

ROOT = Path(__file__).parents[2]
WAM = Configuration.load(packaged("wam"))
FILES = [path for path in sorted((ROOT / "config").glob("*.yaml")) if "/**" in yaml.safe_load(path.read_text())]


@dataclass(frozen=True)
class Gains:
    gain: float = parameter("gain", "1/s", low=0.0, high=2.0, live=True)
    names: tuple[str, ...] = parameter("names")
    weights: tuple[float, ...] = parameter("weights", "kg", low=0.0)

    def __post_init__(self) -> None:
        require(len(self.names) == len(self.weights), f"{len(self.names)} names, {len(self.weights)} weights")


@dataclass(frozen=True)
class Example:
    mode: str = parameter("mode", choices=("soft", "hard"))
    count: int = parameter("count", low=1, high=9)
    is_on: bool = parameter("switch")
    inner: Gains


GOOD: dict[str, Any] = {
    "mode": "soft",
    "count": 3,
    "is_on": True,
    "inner.gain": 0.5,
    "inner.names": ["a", "b"],
    "inner.weights": [1.0, 2],
}


@pytest.mark.parametrize(("change", "text"), [
    ({"speed": 1.0}, "unknown parameter 'speed'"),
    ({"inner.gain": None, "inner.gian": 0.5}, "missing parameter 'inner.gain'; unknown parameter 'inner.gian'"),
    ({"count": None, "mode": None}, "missing parameter 'mode'; missing parameter 'count'"),
    ({"mode": "medium"}, "parameter 'mode' is 'medium'; allowed: one of soft, hard"),
    ({"mode": 3}, "parameter 'mode' is 3; allowed: one of soft, hard, in quotes, in a shell as \"'a'\""),
    ({"count": 0}, "parameter 'count' is 0; allowed: 1 to 9"),
    ({"count": 2.5}, "parameter 'count' is 2.5; allowed: a whole number"),
    ({"count": True}, "parameter 'count' is True; allowed: a number"),
    ({"is_on": "yes"}, "parameter 'is_on' is 'yes'; allowed: true, false"),
    ({"inner.gain": math.nan}, "parameter 'inner.gain' is nan 1/s; allowed: 0 to 2"),
    ({"inner.gain": -0.1}, "parameter 'inner.gain' is -0.1 1/s; allowed: 0 to 2"),
    ({"inner.gain": "0.5"}, "parameter 'inner.gain' is '0.5' 1/s; allowed: a number"),
    ({"inner.weights": [1.0, math.nan]}, "parameter 'inner.weights' is nan kg; allowed: 0 to 1e.09"),
    ({"inner.weights": 1.0}, "parameter 'inner.weights' is 1.0; it must be a list of float"),
    ({"inner.names": "ab"}, "parameter 'inner.names' is 'ab'; it must be a list of str"),
    ({"inner.weights": [1.0]}, "2 names, 1 weights"),
])  # fmt: skip
def test_a_set_with_something_wrong_is_refused_by_name(change: dict[str, Any], text: str) -> None:
    flat = {name: value for name, value in {**GOOD, **change}.items() if value is not None}
    with pytest.raises(ParameterError, match=text):
        build(Example, flat)


@dataclass(frozen=True)
class Derived:
    gain: float = parameter("gain", low=0.0, high=2.0)
    switched: bool = parameter("off by default, and not last", default=False)
    copy: float = like(Gains, "gain", "copy")


def test_a_parameter_that_is_not_given_has_its_default_or_follows_another_one() -> None:
    assert build(Derived, {"gain": 1.5}) == Derived(1.5, 1.5)
    assert build(Derived, {"gain": 1.5, "copy": 0.5, "switched": True}) == Derived(1.5, 0.5, switched=True)
    with pytest.raises(ParameterError, match="missing parameter 'gain'; missing parameter 'copy'"):
        build(Derived, {})


@pytest.mark.parametrize("node", ["", *NODES])
def test_every_number_has_a_finite_range(node: str) -> None:
    numbers = [field for field in fields(own_class(node) if node else Shared) if field.kind in (int, float)]
    endless = [field.name for field in numbers if not -1e18 < field.low <= field.high < 1e18]
    assert not endless, "give each a low and a high that an arm can have; 1e308 is a value, too"


def own_class(node: str) -> Any:
    """The parameter class of a node."""
    return declared(node).parameter_class


@pytest.mark.slow
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_section_of_every_configuration_builds_the_class_of_its_node(path: Path) -> None:
    configuration = Configuration.load(path)
    shared = configuration.sections["/**"]
    assert build(Shared, shared) == configuration.shared
    derived = {field.name for field in fields(Shared) if not field.is_required}
    assert set(values(configuration.shared)) == set(shared) | derived, "nothing is left over"
    assert not derived & set(shared), "they have their home elsewhere"
    sections = set(configuration.sections) - {"/**"}
    every = {declared(entry).name: entry for file in FILES for entry in Configuration.load(file).shared.nodes}
    assert sections <= {*NODES, *every}, "every section is that of a node"
    listed = {declared(entry).name: entry for entry in configuration.shared.nodes}
    assert {declared(entry).name for entry in configuration.shared.nodes} <= sections, "every node has one"
    for name in sections:
        built = configuration.node(name, own_class(listed.get(name) or every.get(name, name)))
        assert set(values(built)) == set(configuration.sections[name])


@pytest.mark.parametrize("path", [packaged("wam"), packaged("barrett-wam7-bus")], ids=lambda path: path.stem)
@pytest.mark.parametrize("name", [name for name in NODES if name != "recorder"])
def test_every_node_starts_with_its_section_of_a_configuration(path: Path, name: str, ros: Any) -> None:
    configuration = Configuration.load(path)
    if "interface" in configuration.sections["driver"]:  # there is no bus here
        configuration = on_bus(configuration, "simulated:200")
    listed = {declared(entry).name: entry for entry in configuration.shared.nodes}
    with parameter_file(configuration) as file:  # ROS does not know overlays
        assert Path("/proc") in file.parents  # nothing is left of a process that is killed
        node = make(ros, listed.get(name, name), file)
    for key, value in {**configuration.sections["/**"], **configuration.sections[name]}.items():
        there = node.get_parameter(key).value
        assert there == value if isinstance(value, str) else pytest.approx(value) == there


def make(ros: Any, name: str, path: Path = WAM.path) -> Any:
    return ros.add(
        make_node(
            name,
            context=ros.context,
            namespace="/wam",
            cli_args=["--ros-args", "--params-file", str(path)],
            use_global_arguments=False,
        )
    )


def call(ros: Any, kind: Any, service: str, request: Any) -> Any:
    client = ros.node("asker").create_client(kind, service)
    ros.wait(client.service_is_ready, what=service)
    future = client.call_async(request)
    ros.wait(future.done, what=f"answer of {service}")
    return future.result()


def test_every_parameter_is_described_to_ros(ros: Any) -> None:
    make(ros, "driver")
    described = [*fields(Shared), *fields(own_class("driver"))]
    names = [field.name for field in described]
    answer = call(ros, DescribeParameters, "driver/describe_parameters", DescribeParameters.Request(names=names))
    assert [d.name for d in answer.descriptors] == names
    for field, there in zip(described, answer.descriptors, strict=True):
        assert there.description.startswith(field.doc)
        assert (f"[{field.unit}]" in there.description) == bool(field.unit)
        assert there.read_only is not field.live
        assert there.additional_constraints == field.allowed
        for limits in (*there.floating_point_range, *there.integer_range):
            assert limits.from_value == max(field.low, -1e308)
            assert limits.to_value == min(field.high, 1e308)
    ranged = {d.name for d in answer.descriptors if d.floating_point_range or d.integer_range}
    assert {"watchdog", "arm.joints.viscous_friction", "timing.outer_delay"} <= ranged


def change(ros: Any, node: str, **given: Any) -> Any:
    """Answer of set_parameters_atomically."""
    parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in given.items()]
    request = SetParametersAtomically.Request(parameters=parameters)
    return call(ros, SetParametersAtomically, f"{node}/set_parameters_atomically", request).result


def test_live_parameters_change_as_a_set_over_ros(ros: Any) -> None:
    node = make(ros, "force_loop")
    lower, slower = [0.02], [0.001]
    assert change(ros, "force_loop", force_gain=lower, torque_gain=slower).successful
    own = node.node._loop.parameters
    assert (own.force_gain, own.torque_gain) == (tuple(lower), tuple(slower))
    answer = call(ros, GetParameters, "force_loop/get_parameters", GetParameters.Request(names=["force_gain"]))
    assert [list(value.double_array_value) for value in answer.values] == [lower]


@pytest.mark.parametrize(("given", "text"), [
    ({"force_gain": [0.02], "contact_cover": "hand"}, "contact_cover is 'hand'; allowed: inner_link, outer_link"),
    ({"force_gain": [0.02], "mode": "soft"}, "parameter 'mode' is 'soft'; allowed: one of hybrid"),
    ({"force_gain": [0.02], "posture_gain": math.nan}, "posture_gain"),
    ({"force_gain": [0.02], "posture_gain": "much"}, "'posture_gain' is 'much' 1/s; allowed: a number"),
    ({"force_gain": [0.02], "timing.mode": "lockstep"}, "timing.mode"),
    (
        {"force_gain": [0.02], "force_gian": 0.02},
        "unknown parameter 'force_gian'; did you mean 'force_gain'? while node force_loop runs, these may",
    ),
    ({"force_gain": [0.5], "guard.mode": "refuse"}, "times the largest linearly stable one"),
    ({"force_gain": [0.02], "guard.contact_stiffness": 0.5}, "guard.contact_stiffness"),
])  # fmt: skip
def test_a_set_with_one_wrong_value_changes_nothing_over_ros(given: dict[str, Any], text: str, ros: Any) -> None:
    node = make(ros, "force_loop")
    before = node.node._loop.parameters
    result = change(ros, "force_loop", **given)
    assert not result.successful
    assert text in result.reason
    assert node.node._loop.parameters == before
    assert tuple(node.get_parameter("force_gain").value) == before.force_gain
    assert change(ros, "force_loop", force_gain=[0.02]).successful
    assert node.node._loop.parameters.force_gain == (0.02,), "the good part alone is taken"


@pytest.mark.parametrize(("node", "given", "text"), [
    ("velocity_loop", {"servo.proportional_gain": [0.01] * 4}, "servo.proportional_gain' is chosen at the start"),
    ("velocity_loop", {"ages.command": 0.5}, "ages.command"),
    ("force_loop", {"force_gain": [1e308]}, "allowed: 0 to "),
    ("force_loop", {"force_gain": [0.1] * 2}, "has 2 values; give 3, one for each of"),
    ("force_loop", {"force_limit": 1e308}, "force_limit"),
    ("force_loop", {"joint_speed_limit": 9.0}, "joint_speed_limit"),
    ("force_loop", {"limits.settling_time": 0.0}, "limits.settling_time' is 0.0 s; allowed: 0.001 to "),
    ("force_loop", {"contact_position": 0.9}, "contact_position is 0.9 m; allowed: 0 to 0.4064, on outer_link"),
])  # fmt: skip
def test_a_value_that_cannot_be_taken_while_the_node_runs_is_refused(
    ros: Any, node: str, given: dict[str, Any], text: str
) -> None:
    there = make(ros, node)
    (name,) = given
    before = there.get_parameter(name).value
    result = change(ros, node, **given)
    assert not result.successful
    assert text in result.reason
    assert there.get_parameter(name).value == before


def test_a_node_that_fails_while_it_takes_a_set_keeps_the_old_one(ros: Any) -> None:
    class Failing:
        name, parameters = "velocity_loop", Gains

        def __init__(self, shared: Shared, own: Gains) -> None:
            self.gain = own.gain

        @reaction(Input("motor_states"), outputs=())
        def step(self, inputs: Inputs) -> Outputs:
            return {}

        def tune(self, own: Gains) -> None:
            self.gain = own.gain
            self.inverse = 1.0 / (own.gain - 0.75)

    given = {**WAM.sections[SHARED], "gain": 1.0, "names": ["a"], "weights": [1.0]}
    overrides = [Parameter(name, value=list(v) if isinstance(v, tuple) else v) for name, v in given.items()]
    node = ros.add(
        AdaptedNode(declaration(Failing), namespace="/wam", context=ros.context, parameter_overrides=overrides)
    )
    refused = change(ros, "velocity_loop", gain=0.75)
    assert not refused.successful
    assert "failed while it set the parameters: ZeroDivisionError" in refused.reason
    assert node.node.gain == node.get_parameter("gain").value == 1.0
    assert change(ros, "velocity_loop", gain=1.5).successful
    assert node.node.gain == 1.5


def test_an_answer_without_a_result_is_no_success() -> None:
    request = SetParametersRequest("filter", {"gain": 0.7})
    assert "filter failed while it set the parameters" in answer_of(request, SetParameters.Response()).message


def run_node(name: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return ran("-m", "wam_cli.program", "node", name, *arguments, timeout=LONG, cwd=ROOT, env=environment)


@pytest.mark.parametrize(("name", "right", "wrong", "text"), [
    ("velocity_loop", "integral_gain:", "integral_gian:", "missing parameter 'servo.integral_gain'"),
    ("driver", "watchdog: 0.045", "watchdog: 0.5", "parameter 'watchdog' is 0.5 s; allowed: 0.002 to 0.05"),
    (
        "force_loop",
        "force_limit: 60.0",
        "force_limit: 1e9",
        "parameter 'force_limit' is 1000000000.0 N; allowed: 0 to 1000",
    ),
    ("transform", "mode: lockstep", "mode: fast", "parameter 'timing.mode' is 'fast'; allowed: one of lockstep"),
])  # fmt: skip
def test_a_wrong_parameter_stops_the_process_with_its_name(
    name: str, right: str, wrong: str, text: str, tmp_path: Path, domain_id: int
) -> None:
    file = tmp_path / "parameters.yaml"
    good = packaged("wam").read_text()
    assert good.count(right) == 1
    file.write_text(good.replace(right, wrong))
    done = run_node(name, "--ros-args", "--params-file", str(file))
    assert f"node '{name}', section '" in done.stderr
    assert done.returncode == 1
    assert text in done.stderr
    assert "Traceback" not in done.stdout + done.stderr


@pytest.mark.parametrize("given", [["--params-file", str(packaged("wam"))], ["--config", "barrett-wam4-bus"]])
def test_a_parameter_on_the_command_line_wins_over_the_file(given: list[str], domain_id: int) -> None:
    done = run_node("driver", *given, "-p", "watchdog:=0.5")
    assert "parameter 'watchdog' is 0.5 s; allowed: 0.002 to 0.05" in done.stderr
