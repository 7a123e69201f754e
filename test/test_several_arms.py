"""A bag of several arms: each command that reads one takes the arm that is chosen, and names the others."""

from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from test_bag import STORE, joint_state, status

from wam_cli.main import main

MESSAGES = {"/left": 30, "/right": 40}
JOINTS, MOTORS = ([f"{name}{i}" for i in (1, 2, 3, 4)] for name in ("joint", "motor"))


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two arms at rest, the right one for longer."""
    path = tmp_path_factory.mktemp("arms") / "bag"
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for namespace, number in MESSAGES.items():
            topics = {
                name: writer.add_connection(f"{namespace}/{name}", f"{kind}", typestore=STORE)
                for name, kind in (
                    ("joint_states", "sensor_msgs/msg/JointState"),
                    ("motor_states", "sensor_msgs/msg/JointState"),
                    ("status", "diagnostic_msgs/msg/DiagnosticStatus"),
                )
            }
            writer.write(topics["status"], 1, status(f"{namespace[1:]}/driver", "enabled"))
            for i, angle in enumerate(np.linspace(-1.0, -1.1, number).tolist()):
                stamp = (i + 1) * 5_000_000
                for topic, names in (("joint_states", JOINTS), ("motor_states", MOTORS)):
                    values = [angle] * 4, [0.0] * 4, [0.0] * 4
                    writer.write(topics[topic], stamp, joint_state(stamp, names, *values))
    return path


def ended(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[str, str]:
    """What a command printed, whatever its end."""
    with pytest.raises(SystemExit):
        main([str(argument) for argument in arguments])
    return capsys.readouterr()


@pytest.mark.parametrize(("chosen", "other"), [("left", "right"), ("right", "left")])
def test_the_arm_that_is_chosen_is_replayed(
    bag: Path, chosen: str, other: str, capsys: pytest.CaptureFixture[str]
) -> None:
    printed, _ = ended(capsys, "replay", bag, "gravity", "--config", "wam", "--namespace", chosen)
    assert f"this is /{chosen} alone; other arms in this bag: --namespace {other}" in printed
    assert f"; 0 only recorded, {MESSAGES['/' + chosen]} only replayed" in printed


@pytest.mark.parametrize(("chosen", "length"), [("left", "0.145 s"), ("right", "0.195 s")])
def test_the_length_is_that_of_the_arm_that_is_analysed(
    bag: Path, chosen: str, length: str, capsys: pytest.CaptureFixture[str]
) -> None:
    printed, _ = ended(capsys, "analyse", bag, "--namespace", chosen)
    assert f"{length} of /{chosen}, " in printed


@pytest.mark.parametrize(
    "command", [("replay", "gravity", "--config", "wam"), ("identify",), ("view", "--save", "x.rrd")]
)
def test_without_a_choice_the_other_arms_are_named(
    bag: Path,
    command: tuple[str, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    if command[0] == "view":
        pytest.importorskip("rerun", reason="Rerun is not installed: pip install 'wam_stack[view]'")
    monkeypatch.chdir(tmp_path)
    name, *options = command
    printed, _ = ended(capsys, name, bag, *options)
    assert "this is /left alone; other arms in this bag: --namespace right" in printed
    _, refused = ended(capsys, name, bag, *options, "--namespace", "middle")
    assert "has no arm in the namespace /middle; its arms: /left, /right" in refused
