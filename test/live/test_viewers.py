"""Recordings open elsewhere: with the layout for Foxglove."""

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from sample_messages import STORE, joint_state, wrench

from wam_bag.bag import JointColumns, read
from wam_cli.main import main
from wam_description.configuration import Configuration, packaged
from wam_description.rigid_body import RigidBody
from wam_description.topics import BY_NAME
from wam_description.urdf import urdf

ROOT = Path(__file__).resolve().parents[2]
LAYOUT: dict[str, Any] = json.loads((ROOT / "docs" / "foxglove.json").read_text(encoding="utf-8"))
MOTION = np.linspace([0.0, -0.6, 0.0, 0.5], [0.4, -1.4, 0.1, 1.2], 200)  # rad, 200 Hz


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The arm moves for a second, touched on the outer link for half of it."""
    path = tmp_path_factory.mktemp("view") / "bag"
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        joints = writer.add_connection("/wam/joint_states", "sensor_msgs/msg/JointState", typestore=STORE)
        estimated = writer.add_connection("/wam/contact/wrench", "geometry_msgs/msg/WrenchStamped", typestore=STORE)
        for i, q in enumerate(MOTION.tolist()):
            stamp = (i + 1) * 5_000_000
            names = [f"joint{n}" for n in range(1, 5)]
            writer.write(joints, stamp, joint_state(stamp, names, q, [0.0] * 4, []))
            frame, force = ("outer_link", 7.0) if i >= 100 else ("base", 0.0)
            writer.write(estimated, stamp, wrench(stamp, frame, 0.0, force, 0.0, 0.0, 0.0, 0.0))
    return path


def test_without_viser_the_page_says_what_to_install(
    bag: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(SystemExit, match="1"):
        main(["live", str(bag)])
    assert "pip install 'wam_stack[live]'" in capsys.readouterr().err


# Foxglove


def panels(tree: Any) -> Iterator[str]:
    if isinstance(tree, str):
        yield tree
    else:
        assert set(tree) == {"direction", "splitPercentage", "first", "second"}
        assert tree["direction"] in {"row", "column"}
        assert 0 < tree["splitPercentage"] < 100
        yield from panels(tree["first"])
        yield from panels(tree["second"])


def paths(value: Any) -> Iterator[str]:
    """Every string of the layout that names a topic."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if isinstance(key, str) and key.startswith("/"):
                yield key
            yield from paths(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from paths(inner)
    elif isinstance(value, str) and value.startswith("/"):
        yield value


def test_the_layout_shows_each_of_its_panels_once() -> None:
    shown = list(panels(LAYOUT["layout"]))
    assert sorted(shown) == sorted(LAYOUT["configById"])
    assert {name.split("!")[0] for name in shown} == {"3D", "Plot", "RawMessages", "DiagnosticSummary"}


def test_every_path_of_the_layout_is_a_field_of_a_topic() -> None:
    found = list(paths(LAYOUT["configById"]))
    assert len(found) > 12
    for path in found:
        topic, *fields = path.split(".")
        row = BY_NAME[topic.removeprefix("/wam/")]
        kind = row.type
        for field in fields:
            name = re.sub(r"\[\d+\]$", "", field)
            known = dict(STORE.get_msgdef(kind).fields)
            assert name in known, path
            node, detail = known[name]
            is_list = int(node) in {3, 4}
            assert is_list == (name != field), path
            kind = detail if isinstance(detail, str) else ""


def test_the_arm_of_the_layout_moves_with_its_joints(bag: Path) -> None:
    (layer,) = [one for one in LAYOUT["configById"]["3D!arm"]["layers"].values() if one["layerId"] == "foxglove.Urdf"]
    assert (layer["sourceType"], layer["controlMode"]) == ("topic", "jointStates")
    assert BY_NAME[layer["topic"].removeprefix("/wam/")].type == "std_msgs/msg/String"
    states = read(bag).topics[layer["jointStatesTopic"]]
    assert isinstance(states, JointColumns)
    arm = Configuration.load(packaged("wam")).shared.arm
    described = urdf(arm)
    for name in states.names:
        assert f'<joint name="{name}" type="revolute">' in described
    assert f'<link name="{LAYOUT["configById"]["3D!arm"]["followTf"]}"' in described
    assert RigidBody(arm).covers == ("inner_link", "outer_link")
