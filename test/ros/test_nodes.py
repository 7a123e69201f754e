"""The nodes over real ROS: what is refused, what stops the arm, what the graph looks like."""

import math
from collections import defaultdict
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy, qos_profile_sensor_data
from ros_network import Network
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from wam_control.velocity.transform import Transform
from wam_description.configuration import Configuration, packaged
from wam_description.event import Level
from wam_description.interface import Interface
from wam_description.nodes import NODES
from wam_description.rigid_body import RigidBody
from wam_description.signals import NodeStatus, State, Wrench
from wam_description.topics import BY_NAME, DEPTH, TOPICS
from wam_driver.safety import Mode
from wam_ros.health import READY
from wam_ros.messages import diagnostic_status, joint_state, message_type, read_status
from wam_ros.node import make_node
from wam_ros.ros_topics import qos, stamp_of
from wam_ros.testing import RunningArm, playing
from wam_ros.wire import encoder
from wam_studies.faults.answered_clock import AnsweredClock

PLAYING = ("scenario", "recorder")
WAM = Configuration.load(packaged("wam"))
ARM = WAM.shared.arm
MOTORS = list(ARM.motors.names)
MS = 1_000_000
pytestmark = pytest.mark.usefixtures("checked_fields")


def start(ros: Any, folder: Path, nodes: list[str], namespace: str = "/wam", **values: Any) -> dict[str, Any]:
    """Nodes of one bring-up in the test's own executor."""
    configured = changed(nodes, **values)
    return {name: make(ros, folder, name, namespace, configured) for name in nodes}


def changed(nodes: list[str], **values: Any) -> Configuration:
    """The packaged configuration with other values; '__' stands for a dot."""
    return WAM.with_values({"nodes": nodes, **{key.replace("__", "."): value for key, value in values.items()}})


def make(ros: Any, folder: Path, name: str, namespace: str, configured: Configuration) -> Any:
    file = folder / f"{namespace.strip('/')}.yaml"
    file.write_text(configured.text)
    arguments = ["--ros-args", "--params-file", str(file)]
    return ros.add(
        make_node(name, context=ros.context, namespace=namespace, cli_args=arguments, use_global_arguments=False)
    )


class Listener:
    """Collects messages of topics of the interface table."""

    def __init__(self, ros: Any, *topics: str, namespace: str = "/wam") -> None:
        self.seen: dict[str, list[Any]] = defaultdict(list)
        node = ros.node("listener", namespace)
        for topic in topics:
            row = BY_NAME[topic]
            profile = qos(row)
            profile.depth = DEPTH
            node.create_subscription(message_type(row), topic, self.seen[topic].append, profile)
        self.node = node

    def stamps(self, topic: str) -> list[int]:
        return [stamp_of(message) for message in self.seen[topic]]


class Hand:
    """Somebody else's velocity loop: answers each motor state with the currents it is told.

    In realtime a period passes with each answer, so that the driver is not late on a busy machine.
    """

    def __init__(self, ros: Any, folder: Path, mode: str, **values: Any) -> None:
        self.ros, self._clock = ros, AnsweredClock(MS * 1e-9)
        node = ros.node("velocity_loop")
        row = BY_NAME["motor_current_command"]
        self.publisher = node.create_publisher(JointState, row.name, qos(row))
        self._subscription = node.create_subscription(JointState, "motor_states", self.answer, qos(row))
        self._status = node.create_publisher(DiagnosticStatus, "status", qos(BY_NAME["status"]))
        self._heard = node.create_subscription(DiagnosticStatus, "status", self.follow, qos(BY_NAME["status"]))
        self.currents = HOLDING
        self.is_answering = True
        self.stamp: int | None = None
        self.extra: list[Any] = []
        self.last = self.flow = 0  # stamps, ns, of the last state that was answered, and of that with a torque
        self.largest = 0.0  # N m
        self._clients = {
            name: node.create_client(kind, f"driver/{name}")
            for name, kind in (
                ("enable", SetBool),
                ("pause", SetBool),
                ("estop", Trigger),
                ("reset_fault", Trigger),
                ("reset", Trigger),
                ("step", Trigger),
            )
        }
        nodes = ["driver", "velocity_loop"]
        unpaced = {"timing__real_time_factor": 0.0, "driver:late_periods": 1.0}
        configured = changed(nodes, timing__mode=mode, **{**unpaced, **values})
        with self._clock.of_new_nodes(mode):
            self.node = make(ros, folder, "driver", "/wam", configured)
        self.driver = self.node.driver
        ros.wait(lambda: self.publisher.get_subscription_count() and node.count_publishers("motor_states"))
        self._status.publish(diagnostic_status(READY._replace(node="velocity_loop"), "wam"))
        ros.wait(lambda: self.last > 10 * MS, what="the driver's states")

    def follow(self, message: Any) -> None:
        """Say that this node follows the driver's session."""
        session = read_status(message).session
        if message.name == "driver" and session:
            self._status.publish(diagnostic_status(READY._replace(node="velocity_loop", session=session), "wam"))

    def answer(self, state: Any) -> None:
        self.flow = stamp_of(state) if any(state.effort) else self.flow
        self.largest = max(self.largest, *map(abs, state.effort))
        if self.is_answering:
            self.last = stamp_of(state)
            stamp = self.last if self.stamp is None else self.stamp
            self.publisher.publish(joint_state(stamp, MOTORS, State([], [], self.currents)))
            self._clock.advance()
        if self.extra:
            self.publisher.publish(self.extra.pop(0)(stamp_of(state)))

    def ask(self, name: str, data: bool | None = None) -> Any:
        client = self._clients[name]
        self.ros.wait(client.service_is_ready, what=name)
        future = client.call_async(client.srv_type.Request(**({} if data is None else {"data": data})))
        self.ros.wait(future.done, what=f"answer of {name}")
        return future.result()

    def enable(self) -> None:
        """Until currents flow."""
        answer = self.ask("enable", True)
        assert answer.success, answer.message
        self.ros.wait(lambda: self.driver.currents == self.currents or self.driver.safety.fault)
        assert not self.driver.safety.fault

    def wait_periods(self, count: int) -> None:
        begin = self.driver.stamp
        self.ros.wait(lambda: self.driver.stamp >= begin + count * MS)


def holding() -> list[float]:
    gravity = RigidBody(ARM).gravity_torque(ARM.joints.start).tolist()
    torque = Transform(ARM).motor_effort(gravity, [0.0] * 4)
    return [t / k for t, k in zip(torque, ARM.motors.torque_constant, strict=True)]


HOLDING = holding()


@pytest.fixture
def hand(ros: Any, tmp_path: Path) -> Hand:
    """A driver in lockstep, alone, and a hand that answers it."""
    return Hand(ros, tmp_path, "lockstep")


@pytest.fixture
def live(ros: Any, tmp_path: Path) -> Hand:
    """A driver in realtime, alone, and a hand that answers it; a busy machine is no obstacle."""
    return Hand(ros, tmp_path, "realtime")


@pytest.fixture
def strict(ros: Any, tmp_path: Path) -> Hand:
    """The same with a driver that releases no brakes where many periods are late."""
    return Hand(ros, tmp_path, "realtime", **{"driver:late_periods": 0.05})


def bad(names: list[str] = MOTORS, effort: list[float] | None = None, ahead: int = 0) -> Callable[[int], Any]:
    values = [3.0] * 4 if effort is None else effort
    return lambda stamp: joint_state(stamp + ahead, names, State([], [], values))


def test_two_publishers_of_the_command_are_a_fault_and_the_second_never_reaches_the_motors(live: Hand) -> None:
    heard = Listener(live.ros, "status")
    live.enable()
    other = live.ros.node("intruder")
    second = other.create_publisher(JointState, "motor_current_command", qos(BY_NAME["motor_current_command"]))
    live.ros.wait(lambda: live.driver.safety.mode is Mode.FAULT, what="a fault")
    assert live.driver.currents == [0.0] * 4
    text = "/wam/intruder and /wam/velocity_loop publish motor_current_command, but only one node may; stop all but one"
    live.ros.wait(lambda: any(text in m.message and m.level == DiagnosticStatus.ERROR for m in heard.seen["status"]))
    for _ in range(20):
        second.publish(joint_state(live.driver.stamp, MOTORS, State([], [], [3.0] * 4)))
    live.wait_periods(20)
    assert live.node.health.refusals["motor_current_command"].count > 0
    assert live.largest < 2.0 * min(ARM.motors.torque_constant)
    live.ask("reset_fault")
    assert "only one node may" in live.ask("enable", True).message
    other.destroy_publisher(second)
    live.ros.wait(lambda: live.node.inlets.subscriptions["motor_current_command"].get_publisher_count() == 1)
    live.ros.wait(lambda: not live.node.health.problem)
    live.wait_periods(5)
    live.enable()


def test_a_publisher_of_which_nothing_can_come_shows_in_the_status(live: Hand) -> None:
    heard, other = Listener(live.ros, "status"), live.ros.node("other")
    second = other.create_publisher(JointState, "motor_current_command", qos_profile_sensor_data)
    live.ros.wait(lambda: [m for m in heard.seen["status"] if "nothing of /wam/other comes: " in m.message])
    other.destroy_publisher(second)
    live.ros.wait(lambda: "nothing of" not in heard.seen["status"][-1].message)


def test_without_commands_the_current_is_zero_within_50_ms(live: Hand) -> None:
    live.enable()
    live.is_answering = False
    live.ros.wait(lambda: live.driver.safety.mode is Mode.FAULT, what="the watchdog")
    live.wait_periods(20)
    assert 0 <= live.flow - live.last <= 50 * MS
    assert live.driver.currents == [0.0] * 4
    assert "command stale" in live.driver.safety.fault
    assert "check that velocity_loop runs" in live.driver.safety.fault


@pytest.mark.parametrize("is_reported", [False, True], ids=["stale", "of another node"])
def test_where_many_periods_are_late_a_fault_names_the_computer(is_reported: bool, strict: Hand) -> None:
    strict.ros.wait(lambda: strict.ask("enable", True).success, what="few late periods")
    for _ in range(100):
        strict._clock.advance()
        strict.wait_periods(2)
    strict.is_answering = False
    if is_reported:
        stopped = NodeStatus(Level.ERROR, "force_loop has stopped", "velocity_loop", fault="force_loop has stopped")
        strict._status.publish(diagnostic_status(stopped, "wam"))
    strict.ros.wait(lambda: strict.driver.safety.mode is Mode.FAULT, what="a fault")
    begin = "velocity_loop: force_loop has stopped; " if is_reported else "command stale: "
    assert strict.driver.safety.fault.startswith(begin)
    assert "% of the newest periods were late; allowed: 5 %; this computer is too" in strict.driver.safety.fault
    assert is_reported or "; check that velocity_loop runs; " in strict.driver.safety.fault


def test_where_many_periods_are_late_the_brakes_stay_on(strict: Hand) -> None:
    strict.ros.wait(lambda: strict.node.health.is_ready, what="a driver that is connected")
    for _ in range(200):
        strict._clock.advance()
        strict.wait_periods(2)
    answer = strict.ask("enable", True)
    assert not answer.success
    assert "% of the newest periods were late; allowed: 5 %; this computer is too" in answer.message
    assert strict.driver.safety.mode is Mode.BRAKED


def test_in_realtime_the_driver_is_connected_when_its_computer_has_kept_the_periods(strict: Hand) -> None:
    connected: list[int] = []

    def note() -> None:
        if strict.node.health.is_ready:
            connected.append(strict.driver.stamp)

    strict.node.create_timer(0.001, note)
    strict.ros.wait(lambda: connected, what="a driver that is connected")
    assert connected[0] >= 1000 * MS


@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
def test_pause_step_and_reset(mode: str, ros: Any, tmp_path: Path) -> None:
    hand = Hand(ros, tmp_path, mode)
    refused = hand.ask("step")
    assert (refused.success, refused.message) == (False, "refused: the driver is running; call pause first")
    hand.enable()
    assert hand.ask("pause", True).message == "paused"
    stamp = hand.driver.stamp
    for k in range(1, 4):
        hand.ros.wait(lambda: hand.ask("step").success, what="a step")
        assert hand.driver.stamp == stamp + k * MS
        hand.ros.wait(lambda k=k: hand.last == stamp + k * MS, what="an answer")
    assert hand.driver.safety.mode is Mode.ENABLED
    assert hand.ask("pause", False).message == "running"
    hand.wait_periods(60)
    assert hand.driver.safety.mode is Mode.ENABLED, "the pause does not count as a stale command"
    hand.currents = [current + 1.0 for current in HOLDING]
    begin = hand.driver.plant.q
    hand.ros.wait(lambda: max(abs(a - b) for a, b in zip(hand.driver.plant.q, begin, strict=True)) > 0.01)
    before = hand.driver.stamp
    assert "arm back at its start pose" in hand.ask("reset").message
    assert hand.driver.safety.mode is Mode.BRAKED
    assert hand.driver.plant.q == pytest.approx(ARM.joints.start, abs=1e-3)
    hand.wait_periods(2)
    assert hand.driver.stamp > before, "time goes on"


def test_a_late_subscriber_gets_the_description_and_the_status(hand: Hand) -> None:
    hand.enable()
    hand.wait_periods(100)
    late = Listener(hand.ros, "robot_description", "status")
    hand.ros.wait(lambda: late.seen["robot_description"] and len(late.seen["status"]) == 2)
    assert ElementTree.fromstring(late.seen["robot_description"][0].data).get("name") == ARM.name
    assert {m.name: m.message for m in late.seen["status"]} == {"driver": "enabled", "velocity_loop": READY.message}


def test_a_push_on_the_base_or_without_numbers_is_refused(hand: Hand) -> None:
    row = BY_NAME["sim/disturbance"]
    publisher = hand.ros.node("pusher").create_publisher(message_type(row), row.name, qos(row))
    hand.ros.wait(publisher.get_subscription_count)
    refusals, push = hand.node.health.refusals, encoder(row, WAM.shared)
    zero = (0.0, 0.0, 0.0)
    for k, wrench in enumerate(
        [
            Wrench("base", (1.0, 0.0, 0.0), zero),
            Wrench("hand", (1.0, 0.0, 0.0), zero),
            Wrench("outer_link", (math.nan, 0.0, 0.0), zero),
            Wrench("outer_link", (501.0, 0.0, 0.0), zero),
        ]
    ):
        publisher.publish(push(hand.driver.stamp, wrench))
        hand.ros.wait(lambda k=k: refusals["sim/disturbance"].count == k + 1)
    assert hand.driver.plant.loads() == []
    publisher.publish(push(hand.driver.stamp, Wrench("outer_link", (0.0, 2.0, 0.0), (0.0, 0.0, 0.6))))
    hand.ros.wait(hand.driver.plant.loads)
    (load,) = hand.driver.plant.loads()
    assert (load.cover, load.position) == ("outer_link", pytest.approx(0.3))
    publisher.publish(push(hand.driver.stamp, Wrench("base", zero, zero)))
    hand.ros.wait(lambda: not hand.driver.plant.loads())


@pytest.mark.parametrize("is_enabled", [True, False], ids=["enabled", "braked"])
def test_lockstep_time_out_names_what_is_missing_and_lockstep_goes_on_with_the_next_answer(
    is_enabled: bool, ros: Any, tmp_path: Path
) -> None:
    hand = Hand(ros, tmp_path, "lockstep", timing__timeout=0.3)
    if is_enabled:
        hand.enable()
    hand.is_answering = False
    ros.wait(lambda: hand.driver.safety.mode is Mode.FAULT, what="the time-out")
    text = f"lockstep: no motor_current_command for the state at {hand.last + MS} ns within 0.3 s"
    assert hand.driver.safety.fault == f"{text}; check that velocity_loop runs"
    assert hand.driver.currents == [0.0] * 4
    unanswered = hand.driver.stamp
    ros.wait(lambda: hand.driver.stamp > unanswered + 3 * MS, what="time that creeps")
    hand.ask("reset_fault")
    assert not hand.ask("enable", True).success
    assert hand.driver.currents == [0.0] * 4
    hand.is_answering = True
    hand.wait_periods(50)
    hand.ask("reset_fault")
    hand.enable()


SIX = ["driver", "transform", "velocity_loop", "gravity", "force_loop", "contact_estimator"]
COMMANDS = [
    "gravity_effort",
    "joint_velocity_command",
    "joint_effort_command",
    "motor_velocity_command",
    "motor_effort_command",
    "force_measured",
    "external_joint_torques",
    "contact/wrench",
    "contact/point",
]


@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
def test_every_command_carries_the_stamp_of_the_state_that_caused_it(mode: str, ros: Any, tmp_path: Path) -> None:
    heard = Listener(ros, "motor_states", "joint_states", "motor_current_command", "/clock", *COMMANDS)
    nodes = start(ros, tmp_path, SIX, timing__mode=mode, timing__real_time_factor=0.0)
    ros.wait(lambda: min(map(len, [heard.seen[topic] for topic in COMMANDS])) > 40, what="commands")
    driver = nodes["driver"].driver
    states, joints = heard.stamps("motor_states"), heard.stamps("joint_states")
    newest = driver.stamp
    assert set(heard.stamps("motor_current_command")) <= {*range(MS, states[0], MS), *states, newest}
    outer = set(range(MS, newest + MS, 5 * MS))
    assert set(joints) <= outer
    for topic in [*COMMANDS, "motor_current_command"]:
        stamps = heard.stamps(topic)
        assert stamps == sorted(set(stamps)), topic
        assert topic == "motor_current_command" or set(stamps) <= outer, topic
        if mode == "lockstep":
            step = MS if topic == "motor_current_command" else 5 * MS
            assert stamps == list(range(stamps[0], stamps[-1] + step, step)), f"{topic} leaves none out"
    clock = [message.clock.sec * 1_000_000_000 + message.clock.nanosec for message in heard.seen["/clock"]]
    assert len(clock) > 40
    assert clock == sorted(set(clock)), "/clock is strictly increasing"


def test_lockstep_goes_on_after_a_node_was_restarted(ros: Any, tmp_path: Path) -> None:
    configured = changed(SIX, timing__mode="lockstep", timing__real_time_factor=0.0, timing__timeout=3.0)
    nodes = {name: make(ros, tmp_path, name, "/wam", configured) for name in SIX if name != "velocity_loop"}
    driver, time = nodes["driver"].driver, nodes["driver"].time

    def wait(world: Network, until: Callable[[], Any], what: str) -> None:
        ros.wait(lambda: world.executor.spin_once(timeout_sec=0.0) or until(), what=what)

    with closing(Network(ros.domain_id)) as first:
        make(first, tmp_path, "velocity_loop", "/wam", configured)
        wait(first, lambda: driver.stamp > 20 * MS, "lockstep")
    ros.wait(lambda: driver.safety.fault, what="the fault of a node that is missing")
    assert "no motor_current_command" in driver.safety.fault
    with closing(Network(ros.domain_id)) as second:
        make(second, tmp_path, "velocity_loop", "/wam", configured)
        wait(second, lambda: not time.obstacle(), "lockstep again")
        assert driver.reset_fault().success
        begin = driver.stamp
        wait(second, lambda: driver.stamp > begin + 100 * MS, "lockstep at its pace")
        assert driver.safety.fault == ""


def test_two_arms_in_two_namespaces_do_not_mix(ros: Any, tmp_path: Path) -> None:
    four = ["driver", "transform", "velocity_loop", "gravity"]
    starts = {"/left": [0.3, -0.6, 0.0, 0.5], "/right": [-0.3, -1.0, 0.2, 0.9]}
    heard, arms = {}, {}
    for namespace, pose in starts.items():
        heard[namespace] = Listener(ros, "joint_states", "status", namespace=namespace)
        arms[namespace] = start(
            ros,
            tmp_path,
            four,
            namespace,
            timing__real_time_factor=0.0,
            arm__joints__start=pose,
            arm__name=namespace[1:],
        )
    drivers = {namespace: nodes["driver"].driver for namespace, nodes in arms.items()}
    ros.wait(lambda: all(len(h.seen["joint_states"]) > 20 for h in heard.values()), what="both arms")
    assert drivers["/left"].safety.enable("").success
    counts = {namespace: len(h.seen["joint_states"]) for namespace, h in heard.items()}
    ros.wait(lambda: all(len(h.seen["joint_states"]) > counts[n] + 20 for n, h in heard.items()))
    assert [d.safety.mode for d in drivers.values()] == [Mode.ENABLED, Mode.BRAKED]
    for namespace, pose in starts.items():
        states = heard[namespace].seen["joint_states"]
        assert all(list(m.position) == pytest.approx(pose, abs=0.05) for m in states)
        assert heard[namespace].stamps("joint_states") == sorted(set(heard[namespace].stamps("joint_states")))
        assert {m.hardware_id for m in heard[namespace].seen["status"]} == {namespace[1:]}
        clocks = heard[namespace].node.get_publishers_info_by_topic(f"{namespace}/clock")
        assert {info.node_namespace for info in clocks} == {namespace}, "a clock of its own"
        assert not heard[namespace].node.get_publishers_info_by_topic("/clock")
        for topic in TOPICS:
            if not topic.name.startswith("/"):
                publishers = heard[namespace].node.get_publishers_info_by_topic(f"{namespace}/{topic.name}")
                assert {info.node_namespace for info in publishers} <= {namespace}


@pytest.fixture
def whole(arm: RunningArm, tmp_path: Path) -> RunningArm:
    """Every node of the stack in one process, in lockstep, playing nothing for long."""
    steps = [{"name": "wait", "seconds": 1000.0}]
    return arm.start(configuration=playing(steps, tmp_path, nodes=[name for name in NODES if name not in PLAYING]))


def test_the_live_graph_is_the_interface_table(whole: RunningArm) -> None:
    whole.run(0.02)
    driver = whole.nodes["driver"]
    node = whole.nodes["scenario"]
    names = {driver.resolve_topic_name(topic.name): topic for topic in TOPICS}
    interface = Interface(WAM.with_values({"nodes": list(NODES)}).shared)
    for full_name, topic in names.items():
        publishers = node.get_publishers_info_by_topic(full_name)
        assert sorted(info.node_name for info in publishers) == sorted(interface.publishers(topic.name)), topic.name
        durability = DurabilityPolicy.TRANSIENT_LOCAL if topic.latched else DurabilityPolicy.VOLATILE
        for info in publishers:
            assert info.topic_type == topic.type, topic.name
            assert info.qos_profile.reliability == ReliabilityPolicy.RELIABLE, topic.name
            assert info.qos_profile.durability == durability, topic.name
        subscriptions = node.get_subscriptions_info_by_topic(full_name)
        takers = sorted(info.node_name for info in subscriptions if info.node_name != whole.node.get_name())
        assert takers == sorted(interface.subscribers(topic.name)), topic.name
        for info in subscriptions:
            assert info.topic_type == topic.type
            assert info.qos_profile.durability == durability, f"{info.node_name} of {topic.name}"
    others = {name for name, _ in node.get_topic_names_and_types()} - set(names)
    beside = {name.rsplit("/", 1)[-1] for name in others}
    assert beside <= {"rosout", "parameter_events"}, "nothing beside the table"


def test_every_node_says_that_it_is_ready_and_reports_every_second(whole: RunningArm) -> None:
    whole.run(1.1)
    whole.run_until(lambda: all(whole.status(node) for node in NODES))
    reports = {one.status[0].name for one in whole.recorded["/diagnostics"].messages}
    assert reports >= {f"wam: {name}" for name in NODES if name != "recorder"}
