"""Parameters in bags: those of earlier versions are completed, hostile ones are refused, live ones stay strict."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import yaml

from wam_analysis.findings.analysis import analyse_bag
from wam_analysis.recorded import prediction_parameters
from wam_bag.bag import Bag, BagError
from wam_control.force.force_loop import ForceLoopParameters
from wam_description.arm import Shared
from wam_description.configuration import SHARED, Configuration, packaged
from wam_description.parameter_history import FORMER_NAMES, complete, present_name
from wam_description.parameters import ParameterError, build, fields, one_each, parameter
from wam_driver.driver import DriverParameters
from wam_sim.recorded_parameters import RecordedParameters, recorded_parameters

SECTIONS = Configuration.load(packaged("wam")).sections
NODES = {name: {**SECTIONS[SHARED], **own} for name, own in SECTIONS.items() if name != SHARED}


def bag_with(text: bytes) -> Bag:
    return Bag(Path("bags/old"), {}, {}, {"parameters.yaml": text}, {})


def read(nodes: Mapping[str, Mapping[str, Any]]) -> RecordedParameters:
    tree = {
        f"/wam/{node}": {
            "ros__parameters": {key: list(v) if isinstance(v, list | tuple) else v for key, v in values.items()}
        }
        for node, values in nodes.items()
    }
    return recorded_parameters(bag_with(yaml.dump(tree, Dumper=yaml.SafeDumper).encode()), "/wam")


def of_first_edition() -> dict[str, dict[str, Any]]:
    """The packaged parameters by the names that they had before."""
    former = {node: dict(values) for node, values in NODES.items()}
    for now, before in FORMER_NAMES.items():
        owner, _, name = before.rpartition(":")
        for node, values in former.items():
            for key in [key for key in values if key == now or (now.endswith(".") and key.startswith(now))]:
                value = values.pop(key)
                if owner in ("", node):
                    values[name + key.removeprefix(now)] = value
    return former


@dataclass(frozen=True)
class Young:
    names: tuple[str, ...] = parameter("the shafts")
    gain: float = parameter("a gain", "1/s", before=0.5)
    offset: tuple[float, ...] = parameter("an offset of each shaft", "N m", before=one_each("names", 0.0))
    limit: float = parameter("a limit", "N m")


OLD = {"names": ["a", "b"], "limit": 3.0}


def test_a_recording_without_a_parameter_has_its_value_from_before_it_existed() -> None:
    found = complete("driver", {"driver": OLD}, (Young,))
    assert build(Young, found.values) == Young(("a", "b"), 0.5, (0.0, 0.0), 3.0)
    assert found.added == ("gain", "offset")
    assert found.missing == found.unknown == ()


def test_what_is_recorded_wins_over_the_value_from_before() -> None:
    found = complete("driver", {"driver": {**OLD, "gain": 0.7}}, (Young,))
    assert found.values["gain"] == 0.7
    assert found.added == ("offset",)


def test_a_live_configuration_has_to_give_every_parameter() -> None:
    with pytest.raises(ParameterError, match="missing parameter 'gain'; missing parameter 'offset'"):
        build(Young, OLD)


def test_a_value_that_follows_from_one_that_is_missing_is_missing() -> None:
    assert complete("driver", {"driver": {"limit": 3.0}}, (Young,)).missing == ("names", "offset")


def test_names_that_are_not_known_are_ignored_and_those_of_ros_are_nobodys() -> None:
    recorded = {**OLD, "use_sim_time": False, "qos_overrides./clock.depth": 1, "colour": "red"}
    assert complete("driver", {"driver": recorded}, (Young,)).unknown == ("colour",)


@pytest.mark.slow
def test_parameters_of_the_first_edition_are_those_of_today_by_their_present_names() -> None:
    former = of_first_edition()
    assert "departure.mass" in former["driver"]
    assert "mismatch.mass" not in former["driver"]
    found = read(former)
    assert found.notes == ()
    assert found.part("driver", DriverParameters) == build(DriverParameters, SECTIONS["driver"])
    assert found.part("force_loop", ForceLoopParameters) == build(ForceLoopParameters, SECTIONS["force_loop"])
    assert found.shared == build(Shared, SECTIONS[SHARED])
    assert prediction_parameters(found) == prediction_parameters(read(NODES))
    assert prediction_parameters(found).note == ""


def test_everything_with_a_value_from_before_may_be_missing_in_a_recording() -> None:
    young = {
        field.name: field.before
        for cls in (Shared, DriverParameters)
        for field in fields(cls)
        if field.before is not None
    }
    assert "friction.law" in young
    found = read({node: {k: v for k, v in values.items() if k not in young} for node, values in NODES.items()})
    before = {name: value(SECTIONS["/**"]) if callable(value) else value for name, value in young.items()}
    own = {field.name: before[field.name] for field in fields(DriverParameters) if field.name in young}
    assert found.part("driver", DriverParameters) == build(DriverParameters, {**SECTIONS["driver"], **own})
    derived = {field.name for field in fields(Shared) if field.derived}
    noted = {name for name in young if any(name in note for note in found.notes)}
    assert noted == set(young) - derived
    assert found.shared.model_arm == found.shared.arm, "a recording from before the model was its own had that of arm"


def test_a_parameter_that_moved_to_another_node_is_found_where_it_was() -> None:
    found = complete("driver", {"driver": {}, "velocity_loop": {"proportional_gain": [1.0]}}, (Servo,))
    assert found.values == {"servo.proportional_gain": [1.0]}


@dataclass(frozen=True)
class Gains:
    proportional_gain: tuple[float, ...] = parameter("of the servo")


@dataclass(frozen=True)
class Servo:
    servo: Gains


def test_live_settings_of_old_recordings_get_their_present_names() -> None:
    assert present_name("driver", "effects.rubbing_friction") == "effects.added_coulomb_friction"
    assert present_name("driver", "departure.payload") == "mismatch.payload"
    assert present_name("velocity_loop", "proportional_gain") == "servo.proportional_gain"
    assert present_name("force_loop", "proportional_gain") == "proportional_gain"


def test_a_bag_that_lacks_a_parameter_is_refused_by_bag_node_and_name() -> None:
    nodes = {**NODES, "driver": {k: v for k, v in NODES["driver"].items() if k != "watchdog"}}
    with pytest.raises(BagError, match=r"bags/old: .*'driver' do not fit this version: missing parameter 'watchdog'"):
        read(nodes).part("driver", DriverParameters)


def test_a_bag_without_a_node_is_refused_with_the_nodes_that_it_has() -> None:
    with pytest.raises(BagError, match="no parameters of node 'driver'; it has those of gravity"):
        read({"gravity": NODES["gravity"]}).node("driver")


@pytest.mark.slow
def test_what_this_version_does_not_know_is_named_once() -> None:
    found = read({node: {**values, "arm.colour": "red"} for node, values in NODES.items()})
    assert found.notes == ("this version does not know the parameters arm.colour; they are ignored",)
    (note,) = read({**NODES, "driver": {**NODES["driver"], "lamp": 1}}).notes
    assert note == "this version does not know the parameters driver:lamp; they are ignored"


LEVELS = "abcdefghijkl"
BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{b}: &{b} [{', '.join([f'*{a}'] * 9)}]\n" for a, b in pairwise(LEVELS)
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (b"[" * 50_000, "nested more than 50 levels deep"),
        (b"{a: " * 50_000, "nested more than 50 levels deep"),
        (b"- " * 50_000, "nested more than 50 levels deep"),
        (BOMB.encode(), "aliases are not read"),
        (b"a: 1\n" * 300_000, "at most 1048576 are read"),
        (b"arm: {joints: ", "did not find expected"),
        (b"!!python/object/apply:os.getcwd []", "could not determine a constructor"),
        (b"a: " + b"9" * 5000, "Exceeds the limit"),
        (b"a: 2001-99-99", "month must be in"),
        (b"\xff", "can't decode"),
        (b"- 3", "it has no sections"),
        (b"/wam/driver: 3", "not subscriptable"),
    ],
    ids=lambda value: value[:10] if isinstance(value, bytes) else "",
)
def test_parameters_that_are_no_parameters_are_refused_and_the_rest_of_the_bag_is_analysed(
    text: bytes, reason: str
) -> None:
    found = recorded_parameters(bag_with(text), "/wam")
    assert not found.nodes
    with pytest.raises(BagError, match=f"bags/old: parameters.yaml in the bag cannot be read: .*{reason}"):
        found.node("driver")
    assert reason in prediction_parameters(found).note
    assert analyse_bag(bag_with(text), lambda _: None).sections


def test_a_group_of_shared_parameters_is_recorded_as_the_node_had_it_that_may_change_it() -> None:
    gains = [2.0 * gain for gain in NODES["velocity_loop"]["servo.integral_gain"]]
    shared = read({**NODES, "velocity_loop": {**NODES["velocity_loop"], "servo.integral_gain": gains}}).shared
    assert shared.servo.integral_gain == tuple(gains)
    assert read(NODES).shared == Configuration.load(packaged("wam")).shared
