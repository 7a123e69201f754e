"""Recordings open elsewhere: in Rerun, and with the layout for Foxglove."""

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import LONG
from rosbags.rosbag2 import StoragePlugin, Writer
from sample_messages import STORE, joint_state, wrench

from wam_analysis.findings.analysed_run import analysed_run
from wam_analysis.rerun_view import NoViewerError, _arrows, _quaternion, _turn, load_rerun, view, viewer
from wam_bag.bag import Bag, JointColumns, read
from wam_cli.main import main
from wam_description.configuration import Configuration, packaged
from wam_description.mjcf import rotation_xyz
from wam_description.rigid_body import RigidBody
from wam_description.topics import BY_NAME
from wam_description.urdf import urdf

ROOT = Path(__file__).resolve().parents[2]
LAYOUT: dict[str, Any] = json.loads((ROOT / "docs" / "foxglove.json").read_text(encoding="utf-8"))
MOTION = np.linspace([0.0, -0.6, 0.0, 0.5], [0.4, -1.4, 0.1, 1.2], 200)  # rad, 200 Hz


# Rerun


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


def test_without_rerun_the_command_says_what_to_install(
    bag: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(SystemExit) as ended:
        main(["live", "--rerun", str(bag)])
    assert ended.value.code == 1
    assert "pip install 'wam_stack[view]'" in capsys.readouterr().err


def test_without_viser_the_page_says_what_to_install(
    bag: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(SystemExit, match="1"):
        main(["live", str(bag)])
    assert "pip install 'wam_stack[live]'" in capsys.readouterr().err


def test_the_viewer_is_found_beside_this_python_though_its_folder_is_not_on_the_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "executable", str(tmp_path / "bin" / "python"))
    monkeypatch.setenv("PATH", str(tmp_path / "elsewhere"))
    with pytest.raises(NoViewerError, match=r"neither in .*/bin nor on PATH; pip install .*--save") as refused:
        viewer()
    assert "\n" not in str(refused.value)
    program = tmp_path / "bin" / "rerun"
    program.parent.mkdir()
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    assert viewer() == str(program)


@pytest.fixture
def rerun() -> Any:
    pytest.importorskip("rerun", reason="Rerun is not installed: pip install 'wam_stack[view]'")
    return load_rerun()


def rerun_says(*arguments: str) -> str:
    """What Rerun's own program says of a file."""
    command = [sys.executable, "-m", "rerun", "rrd", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LONG, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_rerun_reads_the_arm_its_plots_and_nothing_broken(bag: Path, rerun: Any, tmp_path: Path) -> None:
    file = tmp_path / "view.rrd"
    assert view(analysed_run(read(bag)), file).startswith("100 poses of the arm")  # 100 Hz of 200
    rerun_says("verify", str(file))
    said = rerun_says("stats", str(file))
    for path in (
        "/arm/inner_link",
        "/arm/outer_link",
        "/arm/world/foam_box",
        "/plots/joints/joint4",
        "/plots/force/estimated",
    ):
        assert path in said


def test_a_bag_without_joints_is_refused(bag: Path, rerun: Any, tmp_path: Path) -> None:
    recording = analysed_run(Bag(bag, {}, {}, {}, {}))
    with pytest.raises(ValueError, match="no joint states"):
        view(recording, tmp_path / "view.rrd")


def test_turns_are_those_of_the_models() -> None:
    """The capsule's z goes along the tube, and roll pitch yaw mean what they mean in MJCF and URDF."""
    for direction in ([1.0, 0.0, 0.0], [0.3, -0.4, 0.2], [0.0, 0.0, 1.0], [0.0, 0.0, -2.0]):
        axis, angle = _turn(np.array(direction))
        x, y, z = axis
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        turned = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
        assert turned[:, 2] == pytest.approx(np.array(direction) / np.linalg.norm(direction), abs=1e-12)
    x, y, z, w = _quaternion(0.3, -0.5, 1.1)
    matrix = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    assert np.array(matrix) == pytest.approx(rotation_xyz(0.3, -0.5, 1.1), abs=1e-12)


def test_arrows_stand_where_the_link_is_touched_and_nowhere_else(bag: Path) -> None:
    estimated = analysed_run(read(bag)).summary.traces.estimated
    position = estimated._replace(position=np.where(estimated.acts, 0.25, np.nan))
    rows = np.arange(len(position.frame))
    origins, vectors = _arrows(position, rows, "outer_link")
    assert np.all(vectors[:100] == 0.0)
    assert np.all(origins[100:, 0] == 0.25)
    assert np.ptp(vectors[100:, 1]) == 0.0
    assert vectors[150, 1] > 0.0
    assert not np.any(_arrows(position, rows, "inner_link")[1])


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
