"""A bag of several arms: each command that reads one takes the arm that is chosen, and names the others."""

from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin, Writer
from sample_messages import STORE, joint_state, status

from wam_bag.bag import read
from wam_bag.bag_writer import BagWriter
from wam_bag.metadata import offered
from wam_cli.main import main
from wam_description.configuration import SHARED, Configuration, packaged
from wam_description.yaml_text import parameter_text
from wam_sim.recorded_parameters import recorded_parameters

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
    assert f"0 messages both recorded and replayed; 0 only recorded, {MESSAGES['/' + chosen]} only replayed" in printed


@pytest.mark.parametrize(("chosen", "length"), [("left", "0.145 s"), ("right", "0.195 s")])
def test_the_length_is_that_of_the_arm_that_is_analysed(
    bag: Path, chosen: str, length: str, capsys: pytest.CaptureFixture[str]
) -> None:
    printed, _ = ended(capsys, "analyse", bag, "--namespace", chosen)
    assert f"  /{chosen}: {length}." in printed


@pytest.mark.parametrize("command", [("replay", "gravity", "--config", "wam"), ("identify",)])
def test_without_a_choice_the_other_arms_are_named(
    bag: Path,
    command: tuple[str, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    name, *options = command
    printed, _ = ended(capsys, name, bag, *options)
    assert "this is /left alone; other arms in this bag: --namespace right" in printed
    _, refused = ended(capsys, name, bag, *options, "--namespace", "middle")
    assert "has no arm in the namespace /middle; its arms: /left, /right" in refused


def merged(parts: list[Path], file: Path) -> Path:
    """One file of several, as other tools make it: every record of each."""
    with file.open("wb") as stream:
        writer = McapWriter(stream)
        writer.start(profile="ros2")
        for part in parts:
            with part.open("rb") as source:
                reader = make_reader(source)
                channels: dict[int, int] = {}
                for schema, channel, message in reader.iter_messages():
                    assert schema is not None
                    if channel.id not in channels:
                        number = writer.register_schema(schema.name, schema.encoding, schema.data)
                        more = channel.message_encoding, number, channel.metadata
                        channels[channel.id] = writer.register_channel(channel.topic, *more)
                    times = message.log_time, message.data, message.publish_time, message.sequence
                    writer.add_message(channels[channel.id], *times)
                for item in reader.iter_attachments():
                    writer.add_attachment(item.create_time, item.log_time, item.name, item.media_type, item.data)
                for record in reader.iter_metadata():
                    writer.add_metadata(record.name, record.metadata)
        writer.finish()
    return file


@pytest.mark.slow
def test_bags_of_two_arms_that_another_tool_merged_keep_what_each_had(tmp_path: Path) -> None:
    sections, files = Configuration.load(packaged("wam")).sections, []
    for namespace, mass in (("left", 1.0), ("right", 2.0)):
        with BagWriter(tmp_path / namespace) as bag:
            own = {**sections[SHARED], **sections["driver"], "arm.payload": mass}
            bag.add_topic(f"/{namespace}/contact/in_contact", "std_msgs/msg/Bool", offered())
            bag.write(f"/{namespace}/contact/in_contact", b"\0\1\0\0\1", 1, 1, 1)
            bag.attach("parameters.yaml", "application/yaml", parameter_text({f"/{namespace}/driver": own}).encode())
            bag.metadata("recording", {"mode": "lockstep", f"/{namespace}/contact/in_contact driver dropped": "3"})
        files.append(tmp_path / namespace / f"{namespace}_0.mcap")
    both = merged(files, tmp_path / "both.mcap")
    bag_of_both = read(both)
    for namespace, mass in (("/left", 1.0), ("/right", 2.0)):
        assert recorded_parameters(bag_of_both, namespace).node("driver")["arm.payload"] == mass
    of_third = recorded_parameters(bag_of_both, "/third")
    assert "no parameters of the arm /third; it has those of /left, /right" in of_third.problem
    lost = bag_of_both.losses
    assert sorted(lost.dropped) == [f"/{arm}/contact/in_contact from driver" for arm in ("left", "right")]
    assert read(both, ()).attachments == bag_of_both.attachments
