"""The recorder against real publishers; its bags read by readers that are not ours."""

import contextlib
import os
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from conftest import LONG, soon
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from mcap.exceptions import McapError
from mcap.records import Message
from mcap.stream_reader import StreamReader
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from ros_network import Network
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosReliability
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, String

from wam_bag.bag import read
from wam_bag.bag_writer import BagWriter
from wam_description.event import Level
from wam_description.parameters import ParameterError, dotted
from wam_description.signals import NodeStatus
from wam_description.topics import BY_NAME, TOPICS
from wam_ros.messages import diagnostic_status, message_type, read_status
from wam_ros.outlets import Outlets
from wam_ros.recorder import Numbering, Recorder
from wam_ros.recorder_node import RecorderNode
from wam_ros.ros_topics import header, qos
from wam_ros.testing import RunningArm

CONFIG = Path(__file__).parents[2] / "config" / "wam.yaml"
ROOT = Path(__file__).parents[2]


def parameters(directory: Path, mode: str = "realtime", nodes: tuple[str, ...] = ("recorder",), **own: Any) -> Any:
    sections = yaml.safe_load(CONFIG.read_text())
    shared = dict(dotted(sections["/**"]["ros__parameters"])) | sections["/**/recorder"]["ros__parameters"]
    changed = {"timing.mode": mode, "nodes": list(nodes), "directory": str(directory), "name": "bag", **own}
    return {**shared, **changed}


def recorder(ros: Any, directory: Path, **choices: Any) -> RecorderNode:
    given = [Parameter(name, value=value) for name, value in parameters(directory, **choices).items()]
    return ros.add(RecorderNode(context=ros.context, namespace="/wam", parameter_overrides=given))


def publisher(node: Node, topic: str) -> Any:
    return node.create_publisher(message_type(BY_NAME[topic]), topic, qos(BY_NAME[topic]))


def matched(*publishers: Any, count: int = 1) -> Callable[[], bool]:
    return lambda: all(p.get_subscription_count() >= count for p in publishers)


def state(stamp: int, value: float) -> JointState:
    return JointState(header=header(stamp), name=["motor1", "motor2"], position=[value, -value], effort=[0.0, value])


def received(node: RecorderNode, topic: str) -> int:
    return sum(count.received for count in node.recorder.counts() if count.topic == topic)


def sending(ros: Any, count: int, node: RecorderNode | None = None, step: int = 1) -> Any:
    """A publisher of the driver that has sent so many motor states, which the recorder has received."""
    sender = publisher(ros.node("driver"), "motor_states")
    ros.wait(matched(sender))
    before = received(node, "/wam/motor_states") if node else 0
    for k in range(1, count + 1):
        sender.publish(state(k * step, 0.5))
    ros.wait(lambda: node is None or received(node, "/wam/motor_states") == before + count)
    return sender


def machine(folder: Path, *topics: str, mode: str = "lockstep", arm: str = "/wam", is_late: bool = False) -> Recorder:
    """A recorder of topics, by their full names, without ROS."""
    rows = {name: BY_NAME[name if name in BY_NAME else name.removeprefix("/wam/")] for name in topics}
    return Recorder(BagWriter(folder / "bag"), rows, mode, lambda name: {"1": "driver"}, arm, is_late)


def listening(ros: Any) -> list[Any]:
    """Statuses, as they come."""
    states: list[Any] = []
    row = BY_NAME["status"]
    ros.node("listener").create_subscription(message_type(row), "status", states.append, qos(row))
    return states


@contextlib.contextmanager
def recorder_process(ros: Any, directory: Path, **choices: Any) -> Iterator[subprocess.Popen[str]]:
    file = directory / "recorder.yaml"
    file.write_text(yaml.safe_dump({"/**": {"ros__parameters": parameters(directory, **choices)}}))
    command = [sys.executable, "-m", "wam_cli.program", "node", "recorder", "--ros-args", "-r", "__ns:=/wam"]
    process = subprocess.Popen(
        [*command, "--params-file", str(file)], env=ros.environment, cwd=ROOT, text=True, stderr=subprocess.PIPE
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def recovered(file: Path) -> list[Message]:
    """Messages up to the break, as `mcap recover` finds them."""
    found = []
    with file.open("rb") as stream, contextlib.suppress(McapError, EOFError):
        found.extend(record for record in StreamReader(stream).records if isinstance(record, Message))
    return found


def test_every_message_of_every_topic_is_in_the_bag(ros: Any, tmp_path: Path) -> None:
    node = recorder(ros, tmp_path)
    sender = ros.node("sender")
    publishers = {topic.name: publisher(sender, topic.name) for topic in TOPICS}
    ros.wait(matched(*publishers.values()))
    for k in range(1, 301):
        publishers["motor_states"].publish(state(k * 1_000_000, 0.1 * k))
        if k % 5 == 0:
            for topic in TOPICS:
                if topic.name not in ("motor_states", "/diagnostics", "status"):
                    publishers[topic.name].publish(message_type(topic)())
    ros.wait(lambda: received(node, "/wam/motor_states") == 300 and received(node, "/clock") == 60)
    ros.remove(node)
    expected = {n if n[0] == "/" else f"/wam/{n}": 60 for n in publishers if n not in ("/diagnostics", "status")}
    with AnyReader([tmp_path / "bag"]) as reader:
        counts = {c.topic: c.msgcount for c in reader.connections}
        assert counts | expected | {"/wam/motor_states": 300} == counts
        assert Counter(connection.topic for connection, _, _ in reader.messages()) == {
            k: v for k, v in counts.items() if v
        }
        for connection in reader.connections:
            (offered,) = connection.ext.offered_qos_profiles
            latched = BY_NAME[connection.topic.removeprefix("/wam/")].latched
            assert offered.durability == (QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE)
            assert (offered.reliability, offered.depth) == (QosReliability.RELIABLE, 1 if latched else 1000)
        last = 0
        states = [c for c in reader.connections if c.topic == "/wam/motor_states"]
        for k, (connection, log_time, data) in enumerate(reader.messages(states), 1):
            message = reader.deserialize(data, connection.msgtype)
            assert message.position.tolist() == [0.1 * k, -0.1 * k]
            assert message.name == ["motor1", "motor2"]
            assert abs(log_time - time.time_ns()) < 60e9
            assert log_time >= last
            last = log_time


def test_only_the_topics_that_were_chosen_are_in_the_bag(ros: Any, tmp_path: Path) -> None:
    node = recorder(ros, tmp_path, topics=["motor_states", "/clock"])
    sender = ros.node("sender")
    publishers = {name: publisher(sender, name) for name in ("motor_states", "motor_currents", "/clock")}
    ros.wait(matched(*publishers.values()), what="it listens to the others too, so that every publisher begins")
    for k in range(1, 11):
        for name in ("motor_currents", "motor_states"):
            publishers[name].publish(state(k * 1_000_000, 0.1 * k))
    ros.wait(lambda: received(node, "/wam/motor_states") == 10)
    ros.remove(node)
    with AnyReader([tmp_path / "bag"]) as reader:
        assert {c.topic: c.msgcount for c in reader.connections} == {"/wam/motor_states": 10, "/clock": 0}


def test_counts_and_drops_are_in_the_bag(ros: Any, tmp_path: Path) -> None:
    node = recorder(ros, tmp_path)
    sender = sending(ros, 1, node)
    for k in range(1500):  # nobody spins: the reader keeps the last 1000
        sender.publish(state(k, 0.0))
    ros.wait(lambda: received(node, "/wam/motor_states") == 1001)
    (count,) = [count for count in node.recorder.counts() if count.topic == "/wam/motor_states"]
    assert count == ("/wam/motor_states", "driver", 1001, 500, 0, 0)
    ros.remove(node)
    record = read(tmp_path / "bag").metadata["recording"]
    assert record["mode"] == "realtime"
    assert record["/wam/motor_states driver received"] == "1001"
    assert record["/wam/motor_states driver dropped"] == "500"


def test_latched_messages_sent_before_the_recorder_started_are_recorded(ros: Any, tmp_path: Path) -> None:
    sender = publisher(ros.node("driver"), "robot_description")
    sender.publish(String(data="<robot/>"))
    node = recorder(ros, tmp_path)
    ros.wait(lambda: received(node, "/wam/robot_description") == 1)
    ros.remove(node)
    (message,) = read(tmp_path / "bag").topics["/wam/robot_description"].messages
    assert message.data == "<robot/>"


@pytest.mark.parametrize("is_single_threaded", [True, False])
def test_what_has_arrived_when_it_is_stopped_is_recorded(is_single_threaded: bool, ros: Any, tmp_path: Path) -> None:
    if is_single_threaded:
        ros.executor.shutdown()
        ros.executor = SingleThreadedExecutor(context=ros.context)
    node = recorder(ros, tmp_path)
    sending(ros, 200)
    ros.remove(node)
    assert len(read(tmp_path / "bag").topics["/wam/motor_states"].log_time_ns) == 200


def test_bytes_left_behind_by_serialize_message_are_cut(ros: Any, tmp_path: Path) -> None:
    node = by_hand(ros, tmp_path)  # it is never ready
    sender = publisher(ros.node("driver"), "motor_states")
    ros.wait(matched(sender))
    sender.publish(bytes(serialize_message(state(1, 0.5))))
    ros.wait(lambda: received(node, "/wam/motor_states") == 1)
    ros.remove(node)
    with AnyReader([tmp_path / "bag"]) as reader:
        ((connection, _, data),) = reader.messages()
        assert reader.deserialize(data, connection.msgtype).effort.tolist() == [0.0, 0.5]


def test_lockstep_times_are_those_of_the_messages(ros: Any, tmp_path: Path) -> None:
    node = recorder(ros, tmp_path, mode="lockstep")
    other = ros.node("contact_estimator")
    torques, touched = publisher(other, "external_joint_torques"), publisher(other, "contact/in_contact")
    ros.wait(matched(torques, touched))
    touched.publish(Bool(data=False))
    ros.wait(lambda: received(node, "/wam/contact/in_contact") == 1)
    for k in range(1, 51):
        torques.publish(state(k * 5_000_000, 0.0))
    ros.wait(lambda: received(node, "/wam/external_joint_torques") == 50)
    touched.publish(Bool(data=True))
    ros.wait(lambda: received(node, "/wam/contact/in_contact") == 2)
    ros.remove(node)
    times = [5_000_000 * k for k in range(1, 51)]
    bag = read(tmp_path / "bag")
    assert bag.topics["/wam/external_joint_torques"].log_time_ns.tolist() == times
    assert bag.topics["/wam/contact/in_contact"].log_time_ns.tolist() == [0, times[-1]]
    published = [m.publish_time for m in recovered(tmp_path / "bag" / "bag_0.mcap")]
    assert max(published) == times[-1]


def test_parameters_of_all_nodes_are_attached_and_it_is_ready_only_then(ros: Any, tmp_path: Path) -> None:
    states = listening(ros)
    node = recorder(ros, tmp_path, nodes=("gravity", "recorder"))
    ros.wait(lambda: node.count_subscribers("/wam/status") == 2)
    other = Node(
        "gravity",
        namespace="/wam",
        context=ros.context,
        parameter_overrides=[Parameter("arm.mass", value=[1.0, 2.5]), Parameter("on", value=True)],
        automatically_declare_parameters_from_overrides=True,
    )
    ros.add(other)
    ros.wait(lambda: not node.stack.parameters.missing)
    node.attend()
    assert not node.health.is_ready, "ready before the topics of gravity were there"
    kept = [publisher(other, topic) for topic in ("gravity_effort", "status", "/diagnostics")]
    ros.wait(lambda: states)
    assert kept
    assert (states[0].name, states[0].message) == ("recorder", "ready")
    ros.remove(node)
    attached = yaml.safe_load(read(tmp_path / "bag").attachments["parameters.yaml"])
    assert attached["/wam/gravity"]["ros__parameters"]["arm"] == {"mass": [1.0, 2.5]}
    assert attached["/wam/gravity"]["ros__parameters"]["on"] is True
    assert attached["/wam/recorder"]["ros__parameters"]["timing"]["period"] == 0.001


def test_a_process_closes_its_bag_when_told_to_stop(ros: Any, tmp_path: Path) -> None:
    with recorder_process(ros, tmp_path) as process:
        sending(ros, 500)
        ros.wait(lambda: len(recovered(tmp_path / "bag" / "bag_0.mcap")) >= 500)
        process.send_signal(signal.SIGTERM)
        _, said = process.communicate(timeout=LONG)
        assert process.returncode == 0, said
    assert "none lost" in said
    with AnyReader([tmp_path / "bag"]) as reader:
        assert {c.topic: c.msgcount for c in reader.connections}["/wam/motor_states"] == 500


def test_a_killed_recorder_loses_at_most_the_last_second(ros: Any, tmp_path: Path) -> None:
    with recorder_process(ros, tmp_path) as process:
        sender = sending(ros, 0)
        sent: list[int] = []

        def send() -> bool:
            sent.append(time.time_ns())
            sender.publish(state(len(sent), 0.0))
            return len(sent) >= 250  # one each 10 ms of `wait`

        ros.wait(send)
        killed = time.time_ns()
        process.kill()
        process.wait()
    found = [m for m in recovered(tmp_path / "bag" / "bag_0.mcap") if m.publish_time >= sent[0] - 1_000_000]
    states = [m for m in found if len(m.data) > 60 and m.publish_time <= killed]
    assert len([t for t in sent if t < killed - 1_000_000_000]) >= 100
    assert states[-1].publish_time > killed - 1_000_000_000
    numbers = [m.sequence for m in states if b"motor1" in m.data]
    assert numbers == list(range(1, len(numbers) + 1))


def test_a_bag_that_cannot_be_made_stops_the_node_before_it_starts(ros: Any, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ParameterError, match=r"Not a directory.*'directory'"):
        recorder(ros, tmp_path / "file")
    (tmp_path / "bag").mkdir()
    with pytest.raises(ParameterError, match=r"exists already.*'name'"):
        recorder(ros, tmp_path)
    with pytest.raises(ParameterError, match="without directories"):
        recorder(ros, tmp_path, name="../bag")
    with pytest.raises(ParameterError, match="parameter 'topics' names 'motor_state'; allowed: \\*, "):
        recorder(ros, tmp_path, topics=["motor_state"])


def by_hand(ros: Any, directory: Path, **choices: Any) -> RecorderNode:
    """A recorder that is not among the nodes of the stack."""
    return recorder(ros, directory, nodes=("driver", "gravity"), **choices)


@pytest.mark.parametrize(("mode", "nodes", "difference"), [
    ("realtime", ["driver", "gravity"], "node driver runs in realtime, and this recorder in lockstep"),
    ("lockstep", ["driver", "my:Own"], "only one of node driver and this recorder has gravity, my:Own in 'nodes'"),
    ("lockstep", ["gravity", "driver", "recorder"], ""),
])  # fmt: skip
def test_a_recorder_reports_a_stack_that_runs_otherwise_than_its_own_parameters(
    mode: str, nodes: list[str], difference: str, ros: Any, tmp_path: Path
) -> None:
    driver = ros.node("driver")
    driver.declare_parameter("timing.mode", mode)
    driver.declare_parameter("nodes", nodes)
    node = by_hand(ros, tmp_path, mode="lockstep")
    states = publisher(driver, "motor_states")
    ros.wait(matched(states))
    states.publish(state(1, 0.0))
    ros.wait(lambda: received(node, "/wam/motor_states") and "driver" in node.stack.parameters.found)
    node.attend()
    advice = "; start the recorder with 'wam bag record', which takes both from the running stack"
    assert node.failure == (difference and difference + advice)


@pytest.mark.parametrize(("again", "named"), [
    ({}, ""),
    ({"timing.real_time_factor": 0.5}, ""),
    ({"gain": 2.0}, "gain"),
    ({"timing.outer_divisor": 4, "arm.mass": [2.0]}, "arm.mass, timing.outer_divisor"),
])  # fmt: skip
def test_a_node_that_is_started_again_otherwise_makes_the_bag_one_of_two_runs(
    again: dict[str, Any], named: str, ros: Any, tmp_path: Path
) -> None:
    node = by_hand(ros, tmp_path, mode="lockstep")
    driver = ros.node("driver")
    driver.declare_parameter("seed", 1)
    states = publisher(driver, "motor_states")
    ros.wait(matched(states))
    states.publish(state(1, 0.0))
    given = {"gain": 1.0, "arm.mass": [1.0], "timing.outer_divisor": 5, "timing.real_time_factor": 1.0}
    for life, values in enumerate((given, given | again)):
        gravity = ros.node("gravity")
        for name, value in values.items():
            gravity.declare_parameter(name, value)
        status = publisher(gravity, "status")
        ros.wait(matched(status))
        status.publish(diagnostic_status(NodeStatus(Level.OK, "ready", "gravity"), "wam"))
        ros.wait(lambda: not node.stack.parameters.missing)
        node.attend()
        assert list(node.stack.restarted) == ["gravity"] * life
        ros.wait(lambda: not node.stack.restarted, what="its parameters")
        ros.remove(gravity)
    bag = f"and {tmp_path / 'bag'} has both runs; record each with a recorder of its own"
    assert node.failure == (named and f"node gravity was started again, with another {named}, {bag}")


def test_a_recorder_to_which_nothing_came_ends_with_the_reason(ros: Any, tmp_path: Path) -> None:
    node = by_hand(ros, tmp_path)
    ros.remove(node)
    assert node.failure.startswith(
        f"{tmp_path / 'bag'} is empty: no message came; start the stack with 'wam up' before"
    )


def test_an_unnamed_bag_is_named_after_arm_and_time(ros: Any, tmp_path: Path) -> None:
    ros.remove(recorder(ros, tmp_path, name=""))
    (path,) = tmp_path.glob("wam_2*")
    assert (path / f"{path.name}_0.mcap").is_file()
    assert (path / "metadata.yaml").is_file()


@pytest.mark.parametrize(("numbers", "total", "dropped", "missed", "lacking"), [
    ([1, 2, 3], 3, 0, 0, 0),
    ([1, 2, 3], 10, 0, 0, 7),
    ([1, 2, 5, 6, 9], 9, 4, 0, 0),
    ([7, 8, 10], 10, 1, 6, 0),  # a recorder that started later
    ([7], 3, 0, 6, 0),
    ([5, 6], 9, 0, 4, 3),
    ([7, 8, 11], 14, 2, 6, 3),
    ([1, 2, 3, 1, 2, 4], 2, 0, 0, 0),  # started again: 4 follows the 3 of the first life
    ([1, 2, 9, 1, 2], 4, 6, 0, 2),
    ([1, 1, 2, 2, 3, 3], 3, 0, 0, 0),  # two publishers under one name
    ([1, 1, 2, 2, 3, 4, 3, 6], 6, 1, 0, 0),
    ([0, 0], 5, 0, 0, 3),  # a middleware that does not number
])  # fmt: skip
def test_gaps_in_the_numbering_and_what_was_announced_and_has_not_come_are_losses(
    numbers: list[int], total: int, dropped: int, missed: int, lacking: int
) -> None:
    numbering = Numbering()
    for number in numbers:
        numbering.add(number)
    numbering.announce(total)
    found = (numbering.received, numbering.dropped, numbering.missed, numbering.lacking())
    assert found == (len(numbers), dropped, missed, lacking)


def test_a_gap_where_there_is_another_publisher_is_no_drop() -> None:
    present = {"first"}
    numbering = Numbering(lambda: present)
    for number in (1, 2, 5):  # one publisher: two were lost
        numbering.add(number)
    present.add("second")  # started again, its first three before there was a connection; the first one was killed
    for number in (9, 10, 13):
        numbering.add(number)
    present.remove("first")
    for number in (14, 16):
        numbering.add(number)
    assert (numbering.received, numbering.dropped, numbering.missed) == (8, 2 + 2 + 1, 8)


def test_what_a_restarted_node_published_before_it_was_connected_is_not_lost(ros: Any, tmp_path: Path) -> None:
    node = by_hand(ros, tmp_path, mode="lockstep")
    states = publisher(ros.node("driver"), "motor_states")
    ros.wait(matched(states))
    gravity = diagnostic_status(NodeStatus(Level.OK, "ready", "gravity"), "wam")
    for life, sent in ((1, 4), (2, 8)):
        with contextlib.closing(Network(ros.domain_id)) as another_process:
            status = publisher(another_process.node("gravity"), "status")
            for _ in range(sent):
                status.publish(gravity)  # the newest alone is kept for a recorder that does not know this publisher yet
            ros.wait(matched(status), what="a connection")
            ros.wait(lambda status=status: status.wait_for_all_acked(Duration()), what="the newest status")
            states.publish(state(life, 0.0))
            ros.wait(lambda life=life: received(node, "/wam/motor_states") == life, what="what came before this state")
    (found,) = (count for count in node.recorder.counts() if count.topic == "/wam/status")
    assert (found.received + found.missed, found.dropped) == (4 + 8, 0)


def diagnostics(name: str, stamp: int) -> bytes:
    message = DiagnosticArray(header=header(stamp, "abc"), status=[DiagnosticStatus(name=name)])
    return bytes(serialize_message(message))


def test_drops_are_told_apart_by_publisher(tmp_path: Path) -> None:
    found = machine(tmp_path, "/diagnostics")
    for name, numbers in (("driver: timing", (1, 2, 3)), ("wam: gravity", (1, 9))):
        for number in numbers:
            found.receive("/diagnostics", diagnostics(name, 5), 0, 0, number)
    counts = {c.publisher: (c.received, c.dropped) for c in found.counts()}
    assert counts == {"driver": (3, 0), "gravity": (2, 7)}


def test_the_times_of_a_lockstep_recording_are_not_those_of_another_arm(tmp_path: Path) -> None:
    found = machine(tmp_path, "/diagnostics", "motor_states", arm="/left")
    found.receive("/diagnostics", diagnostics("right: driver", 1_795_558_389_219_000_000), 0, 0, 7)
    found.receive("motor_states", bytes(serialize_message(state(5_000_000, 0.1))), 0, 0, 1)
    found.receive("/diagnostics", diagnostics("left: driver", 6_000_000), 0, 0, 1)
    found.receive("/diagnostics", diagnostics("right: gravity", 1_795_558_390_219_000_000), 0, 0, 30)
    found.receive("motor_states", bytes(serialize_message(state(7_000_000, 0.1))), 0, 0, 2)
    assert found.total("dropped") == 0
    found.finish()
    times = sorted(message.log_time for message in recovered(next((tmp_path / "bag").glob("*.mcap"))))
    assert times[-1] == 7_000_000
    assert len(times) == 5


def fill_disk(bag: BagWriter) -> None:
    """Let every further write end as on a full disk."""
    with Path("/dev/full").open("wb") as full:
        os.dup2(full.fileno(), bag._stream.fileno())


def test_a_full_disk_is_reported_once_and_the_rest_counted(tmp_path: Path) -> None:
    found = machine(tmp_path, "/wam/contact/in_contact", mode="realtime")
    bag = found._bag
    found.receive("/wam/contact/in_contact", b"\0\1\0\0\1", 1, 1, 1)
    found.flush()
    assert not found.failure
    fill_disk(bag)
    bag._writer._chunk_size = 1
    for number in (2, 3):
        found.receive("/wam/contact/in_contact", b"\0\1\0\0\1", 1, 1, number)
    found.finish()
    stopped = f"recording into {tmp_path / 'bag'} has stopped: the disk is full (No space left on device)"
    assert found.failure.startswith(stopped)
    assert "free some space" in found.failure
    assert found.lost_at_disk == 2
    assert bag.closed


def report(node: str, ended: bool, arm: str = "wam", **published: int) -> DiagnosticArray:
    """What a node says about how much it has published."""
    facts = {"node": f"/{arm}/{node}", **{f"written /wam/{topic}": str(count) for topic, count in published.items()}}
    status = NodeStatus(Level.OK, "ready", node, facts=facts | ({"ended": "yes"} if ended else {}))
    return DiagnosticArray(status=[diagnostic_status(status, "wam")])


def test_what_was_announced_and_has_not_come_is_lost_at_the_end(ros: Any, tmp_path: Path, capfd: Any) -> None:
    node = recorder(ros, tmp_path, nodes=("driver", "gravity", "transform", "recorder"))
    states, said = (publisher(ros.node("driver"), topic) for topic in ("motor_states", "/diagnostics"))
    ros.wait(matched(states, said))
    for k in range(7):
        states.publish(state(k, 0.0))
    ros.wait(lambda: received(node, "/wam/motor_states") == 7)
    said.publish(report("driver", True, motor_states=10, robot_description=4))
    said.publish(report("gravity", False, gravity_effort=5))
    said.publish(report("transform", True, "other_arm", motor_states=10**9))
    ros.wait(lambda: received(node, "/diagnostics") == 3)
    ros.remove(node)
    lost = "Lost at the end: 3 of /wam/motor_states from driver"
    unknown = "Lost at the end: not known for gravity, transform, which published no final count"
    assert f"10 messages. {lost}. {unknown}" in capfd.readouterr().err
    bag = read(tmp_path / "bag")
    assert bag.metadata["recording"]["/wam/motor_states driver lost_at_end"] == "3"
    found = bag.losses
    assert found.at_end == {"/wam/motor_states from driver": 3}
    assert found.sentences(0) == [f"{lost}.", f"{unknown}."]


def test_what_is_on_its_way_at_the_end_is_waited_for(ros: Any, tmp_path: Path) -> None:
    node = recorder(ros, tmp_path)
    node.recorder.announce("driver", "/wam/motor_states", 1)
    states = sending(ros, 1, node)
    node.recorder.announce("driver", "/wam/motor_states", 2)
    late = threading.Timer(0.2, lambda: states.publish(state(2, 0.0)))
    late.start()
    ros.remove(node)
    late.join()
    assert len(read(tmp_path / "bag").topics["/wam/motor_states"].stamp_ns) == 2


def lives(*numbers_and_totals: tuple[list[int], int], present: bool = True) -> Numbering:
    """A node that was started again, each time by another writer, with its numbers and what it announced at last."""
    writers: list[str] = []
    numbering = Numbering(lambda: writers)
    for life, (numbers, total) in enumerate(numbers_and_totals):
        writers[:] = [f"writer {life}"] if present else []
        for number in numbers:
            numbering.add(number)
        numbering.announce(total)
    return numbering


ALL = list(range(1, 101))


@pytest.mark.parametrize("present", [True, False])
@pytest.mark.parametrize(("first", "second", "dropped", "missed", "lacking"), [
    ((ALL, 100), (ALL[:40], 30), 0, 0, 0),
    ((ALL[:40], 40), (ALL, 70), 0, 0, 0),  # it is past its last total, which is above that of the first life
    ((ALL, 100), (ALL[:10], 100), 0, 0, 90),
    ((ALL[:90], 100), (ALL[:10], 15), 0, 0, 10 + 5),
    ((ALL, 100), (ALL[9:20], 20), 0, 9, 0),  # before it was connected
])  # fmt: skip
def test_losses_are_those_of_each_life_of_a_node(
    first: tuple[list[int], int], second: tuple[list[int], int], dropped: int, missed: int, lacking: int, present: bool
) -> None:
    found = lives(first, second, present=present)
    assert (found.dropped, found.missed, found.lacking()) == (dropped, missed, lacking)


def test_a_gap_of_a_second_life_is_not_closed_by_numbers_of_the_first() -> None:
    assert lives((ALL, 100), ([*range(1, 11), *range(102, 151)], 150)).dropped == 91


def test_what_was_sent_before_the_recorder_started_is_not_lost_at_the_end(tmp_path: Path) -> None:
    name = "/wam/motor_states"
    found = machine(tmp_path, name)
    data = bytes(serialize_message(state(1, 0.0)))
    for number in range(6000, 8000):
        found.receive(name, data, 0, 0, number)
        if number in (6500, 7500):
            found.announce("driver", name, number - 3)
    assert found.total("lost_at_end") == 0
    found.announce("driver", name, 8010)
    assert found.total("lost_at_end") == 11


@pytest.mark.parametrize(("change", "required"), [("deleted", True), ("moved", False)])
def test_a_bag_that_vanishes_is_reported_at_once_and_is_a_fault_if_it_was_required(
    change: str, required: bool, ros: Any, tmp_path: Path
) -> None:
    states = listening(ros)
    node = recorder(ros, tmp_path, required=required)
    sending(ros, 1, node)
    ros.wait(lambda: node.count_subscribers("/wam/status") == 2)
    node.recorder.flush()
    if change == "deleted":
        shutil.rmtree(tmp_path / "bag")
    else:
        (tmp_path / "bag").rename(tmp_path / "elsewhere")
    begin = time.monotonic()
    ros.wait(lambda: any(said.level == said.ERROR for said in states), what="an error in the status")
    assert time.monotonic() - begin < soon()
    (said,) = (said for said in states if said.level == said.ERROR)
    assert "bag_0.mcap is gone (No such file or directory): it was deleted or moved" in said.message
    assert node.failure == said.message
    assert read_status(said).fault == (said.message if required else "")
    if change == "moved":  # what was recorded before is whole
        assert len(read(tmp_path / "elsewhere").topics["/wam/motor_states"].stamp_ns) <= 1


def test_foreign_names_do_not_fill_the_memory(tmp_path: Path) -> None:
    found = machine(tmp_path, "status")
    for k in range(300):
        status = DiagnosticStatus(name=f"\x1b{k}" + "x" * 10_000)
        found.receive("status", bytes(serialize_message(status)), 0, 0, 1)
    counts = found.counts()
    assert len(counts) <= 64
    assert max(len(count.publisher) for count in counts) < 300
    assert "\x1b" not in counts[0].publisher


@pytest.mark.slow
def test_no_bytes_on_any_topic_end_the_recorder(tmp_path: Path) -> None:
    chance = random.Random(20261120)
    rows = list(BY_NAME.values())
    found = machine(tmp_path, *BY_NAME)
    for k in range(5000):
        row = chance.choice(rows)
        data = bytearray(serialize_message(message_type(row)()) + bytes(chance.randrange(40)))
        for _ in range(chance.randrange(6)):
            data[chance.randrange(len(data))] = chance.choice([0, 1, 0x7F, 0x80, 0xFF, chance.randrange(256)])
        found.receive(row.name, bytes(data[: chance.randrange(len(data) + 1)]), k, k, k)
    found.finish()
    assert not found.failure
    assert sum(read(tmp_path / "bag", may_lack=True, topics=[]).counts.values()) == 5000


def test_a_bag_goes_on_in_another_file_by_size_and_by_time(ros: Any, tmp_path: Path) -> None:
    node = by_hand(ros, tmp_path, mode="lockstep", split_time=0.1)
    sending(ros, 300, node, step=1_000_000)
    ros.remove(node)
    names = [f"bag_{i}.mcap" for i in range(3)]
    assert sorted(path.name for path in (tmp_path / "bag").glob("*.mcap")) == names
    information = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert information["relative_file_paths"] == names
    assert [file["message_count"] for file in information["files"]] == [100, 100, 100]
    with AnyReader([tmp_path / "bag"]) as reader:
        assert [time for _, time, _ in reader.messages()] == [k * 1_000_000 for k in range(1, 301)]
    bag = read(tmp_path / "bag")
    assert len(bag.topics["/wam/motor_states"].log_time_ns) == 300
    assert bag.metadata["recording"]["/wam/motor_states driver received"] == "300"


def test_every_message_is_in_the_bag_while_others_come_and_go(arm: RunningArm, monkeypatch: pytest.MonkeyPatch) -> None:
    published: Counter[str] = Counter()
    others, heard, written = [], [], {}
    for form in ("publish", "send"):
        publish = getattr(Outlets, form)

        def counting(outlets: Outlets, topic: str, *given: Any, publish: Any = publish) -> None:
            published[outlets.full[topic]] += 1
            publish(outlets, topic, *given)
            if topic == "motor_states":
                written[topic] = outlets.written[topic]
                if published["/wam/motor_states"] == 100:
                    others.append(Node("other", namespace="wam", context=arm.context))
                    others[0].create_subscription(JointState, topic, heard.append, 10)
                elif published["/wam/motor_states"] == 200:
                    others[0].destroy_node()

        monkeypatch.setattr(Outlets, form, counting)
    bag = arm.play([{"name": "speak", "seconds": 0.3}])
    recorded = dict(read(bag.path, ()).counts)
    assert published["/wam/motor_states"] == 301 > written["motor_states"] >= 100
    assert {name: published[name] for name in recorded} == recorded
    assert bag.losses.sentences(0) == []


@pytest.mark.parametrize(
    ("number", "late", "begin"), [(1, False, 0), (1, True, 6_000_000_000), (6001, False, 6_000_000_000)]
)
def test_a_recording_in_lockstep_that_begins_late_has_no_time_from_before_it(
    number: int, late: bool, begin: int, tmp_path: Path
) -> None:
    found = machine(tmp_path, "/wam/robot_description", "/wam/status", "/wam/motor_states", is_late=late)
    found.receive("/wam/robot_description", serialize_message(String(data="<robot/>")), 1, 1, 1)
    found.receive("/wam/status", serialize_message(DiagnosticStatus(name="gravity")), 1, 1, 3)
    for k in range(3):
        found.receive("/wam/motor_states", serialize_message(state(6_000_000_000 + k, 0.0)), 1, 1, number + k)
    found.receive("/wam/status", serialize_message(DiagnosticStatus(name="gravity")), 1, 1, 4)
    found.finish()
    topics = read(tmp_path / "bag").topics
    assert topics["/wam/robot_description"].log_time_ns.tolist() == [begin]
    assert topics["/wam/status"].log_time_ns.tolist() == [begin, begin]
    assert topics["/wam/motor_states"].log_time_ns.tolist() == [6_000_000_000 + k for k in range(3)]
    assert read(tmp_path / "bag", ()).first == begin


def test_a_run_without_a_stamp_is_recorded_at_its_start(tmp_path: Path) -> None:
    found = machine(tmp_path, "/wam/status", "/wam/motor_states")
    for number in range(1, 2001):  # the arm is paused
        found.receive("/wam/status", serialize_message(DiagnosticStatus(name="gravity")), 1, 1, number)
    found.finish()
    assert set(read(tmp_path / "bag").topics["/wam/status"].log_time_ns.tolist()) == {0}
    assert read(tmp_path / "bag", ()).counts["/wam/status"] == 2000
