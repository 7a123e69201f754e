"""Parameters in bags: those that do not fit are named, hostile ones are refused."""

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import yaml

from wam_analysis.findings.analysis import analyse_bag
from wam_analysis.recorded import prediction_parameters
from wam_bag.bag import Bag, BagError
from wam_control.force.force_loop import ForceLoopParameters
from wam_description.configuration import SHARED, Configuration, packaged
from wam_description.parameters import build
from wam_driver.driver import DriverParameters
from wam_sim.recorded_parameters import RecordedParameters, recorded_parameters

SECTIONS = Configuration.load(packaged("wam")).sections
NODES = {name: {**SECTIONS[SHARED], **own} for name, own in SECTIONS.items() if name != SHARED}


def bag_with(text: bytes) -> Bag:
    return Bag(Path("bags/one"), {}, {}, {"parameters.yaml": text}, {})


def read(nodes: Mapping[str, Mapping[str, Any]]) -> RecordedParameters:
    tree = {
        f"/wam/{node}": {
            "ros__parameters": {key: list(v) if isinstance(v, list | tuple) else v for key, v in values.items()}
        }
        for node, values in nodes.items()
    }
    return recorded_parameters(bag_with(yaml.dump(tree, Dumper=yaml.SafeDumper).encode()), "/wam")


def test_a_recording_of_this_version_has_no_notes_and_gives_what_was_configured() -> None:
    found = read(NODES)
    assert found.notes == ()
    assert found.part("driver", DriverParameters) == build(DriverParameters, SECTIONS["driver"])
    assert found.part("force_loop", ForceLoopParameters) == build(ForceLoopParameters, SECTIONS["force_loop"])
    assert prediction_parameters(found).note == ""


def test_parameters_that_every_ros_node_has_are_left_out() -> None:
    own = {"use_sim_time": False, "qos_overrides./clock.depth": 1}
    found = read({**NODES, "driver": {**NODES["driver"], **own}})
    assert found.notes == ()
    assert not own.keys() & found.node("driver").keys()


def test_a_bag_that_lacks_a_parameter_is_refused_by_bag_node_and_name() -> None:
    nodes = {**NODES, "driver": {k: v for k, v in NODES["driver"].items() if k != "watchdog"}}
    with pytest.raises(BagError, match=r"bags/one: .*'driver' do not fit this version: missing parameter 'watchdog'"):
        read(nodes).part("driver", DriverParameters)


def test_a_bag_without_a_node_is_refused_with_the_nodes_that_it_has() -> None:
    with pytest.raises(BagError, match="no parameters of node 'driver'; it has those of gravity"):
        read({"gravity": NODES["gravity"]}).node("driver")


@pytest.mark.parametrize(("missing", "unknown", "text"), [
    (("arm.gravity",), {}, "misses the parameters arm.gravity"),
    ((), {"arm.colour": "red"}, "has the unknown parameters arm.colour"),
    (
        ("watchdog",),
        {"lamp": 1},
        "misses the parameters driver:watchdog and has the unknown parameters driver:lamp",
    ),
    (("watchdog",), {"lamp": 1, "nodes": ["own:Driver"]}, ""),  # another class, with its own parameters
])  # fmt: skip
def test_missing_and_unknown_parameters_are_one_finding_that_names_each_once(
    missing: tuple[str, ...], unknown: dict[str, Any], text: str
) -> None:
    changed = {
        node: {k: v for k, v in values.items() if k not in missing}
        | {k: v for k, v in unknown.items() if "." in k or node == "driver"}
        for node, values in NODES.items()
    }
    note = f"the recording {text}: it is of another version, record it again"
    assert read(changed).notes == (note,) * bool(text)


LEVELS = "abcdefghijkl"
BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{b}: &{b} [{', '.join([f'*{a}'] * 9)}]\n" for a, b in pairwise(LEVELS)
)


@pytest.mark.slow
@pytest.mark.parametrize(("text", "reason"), [
    (b"[" * 50_000, "nested more than 50 levels deep"),
    (BOMB.encode(), "aliases are not read"),
    (b"#" * 1_500_000, "at most 1048576 are read"),
    (b"arm: {joints: ", "did not find expected"),
    (b"!!python/object/apply:os.getcwd []", "could not determine a constructor"),
    (b"\xff", "can't decode"),
    (b"- 3", "it has no sections"),
    (b"/wam/driver: 3", "not subscriptable"),
], ids=lambda value: value[:10] if isinstance(value, bytes) else "")  # fmt: skip
def test_parameters_that_are_no_parameters_are_refused_and_the_rest_of_the_bag_is_analysed(
    text: bytes, reason: str
) -> None:
    found = recorded_parameters(bag_with(text), "/wam")
    assert not found.nodes
    with pytest.raises(BagError, match=f"bags/one: parameters.yaml in the bag cannot be read: .*{reason}"):
        found.node("driver")
    assert reason in prediction_parameters(found).note
    assert analyse_bag(bag_with(text), lambda _: None).sections


def test_what_every_node_reads_is_read_as_it_was_recorded() -> None:
    assert read(NODES).shared == Configuration.load(packaged("wam")).shared
