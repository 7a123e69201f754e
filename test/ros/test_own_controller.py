"""A user's own controller, named in the configuration, runs in the simulation, over topics and in a replay."""

import dataclasses
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wam_bag.bag import JointColumns
from wam_control.task.scenario import ScenarioStep, load
from wam_description.arm import Shared
from wam_description.configuration import Configuration, packaged
from wam_description.defects import UnusableOutput, output_check
from wam_description.event import Level
from wam_description.interface import Interface, declared, require_parameters
from wam_description.parameters import Nothing, ParameterError
from wam_description.signals import ForceCommand, NodeStatus, State, Table, Wrench
from wam_description.topics import BY_NAME, JOINT_STATE, TABLE, WRENCH, Topic
from wam_description.wiring import Call, Input, Inputs, Outputs, reaction
from wam_ros import requests
from wam_ros.testing import RunningArm, playing
from wam_sim.replay import replay
from wam_sim.simulation import Simulation

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
STEPS = [
    {"name": "release", "seconds": 0.1, "request": "enable"},
    {
        "name": "push",
        "seconds": 0.3,
        "push": {
            "cover": "outer_link",
            "contact_position": 0.4,
            "newtons": [0.0, 20.0, 0.0],
            "begin": 0.05,
            "end": 0.25,
        },
    },
]


@pytest.fixture
def configured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Configuration:
    monkeypatch.syspath_prepend(str(EXAMPLES))
    return playing(STEPS, tmp_path, configuration=EXAMPLES / "impedance.yaml")


@pytest.mark.usefixtures("configured")
def test_the_status_of_an_own_controller_has_what_it_refuses(arm: RunningArm) -> None:
    arm.start(configuration=EXAMPLES / "impedance.yaml")
    arm.send("joint_posture_command", position=[-9.0, 0.0, 0.0, 0.0], seconds=0.3)
    assert "impedance: " in arm.run_until_refused("joint_posture_command")
    arm.run(0.1)
    status = arm.status("impedance")
    assert status is not None
    assert (status.level, status.facts["refused"]) == (Level.WARN, "joint_posture_command"), status.message


def test_an_own_controller_is_the_same_in_simulation_topics_and_replay(
    configured: Configuration, tmp_path: Path, arm: RunningArm
) -> None:
    recorded = arm.start(configuration=configured).play().topics["/wam/joint_effort_command"]
    run = Simulation(configured, load(tmp_path / "script.yaml", configured.shared))
    assert run.play() == ""
    assert isinstance(recorded, JointColumns)
    simulated = np.array([row.values for row in run.rows["joint_effort_command"]])
    assert np.abs(simulated).max() > 1.0, "zeros would show nothing"
    assert simulated.tobytes() == np.ascontiguousarray(recorded.effort).tobytes()
    assert replay(tmp_path / "bag", "impedance:Impedance").is_same


class Echo:
    """Publishes the torques of gravity on a topic of its own."""

    name, parameters = "echo", Nothing
    topics = (Topic("echo", JOINT_STATE, "outer", "the torques of gravity, N m", "joints"),)

    def __init__(self, shared: Shared, own: Nothing) -> None: ...

    @reaction(Input("gravity_effort", "effort"), outputs=("echo",))
    def step(self, inputs: Inputs) -> Outputs:
        return {"echo": inputs["gravity_effort"]}


def test_a_node_class_comes_on_top_of_a_configuration_with_a_topic_of_its_own(
    configured: Configuration, tmp_path: Path
) -> None:
    steps = load(tmp_path / "script.yaml", configured.shared)
    run = Simulation(configured, steps, controllers={"echo": Echo})
    assert run.play() == ""
    assert [row.values for row in run.rows["echo"]] == [row.values for row in run.rows["gravity_effort"]]


@pytest.mark.parametrize(("row", "text"), [
    (
        Topic("echo", "sensor_msgs/JointState", "outer", "N m", "joints"),
        "topic 'echo': type is 'sensor_msgs/JointState'; allowed: 'sensor_msgs/msg/JointState', ",
    ),
    (Topic("echo", JOINT_STATE, "200 Hz", "N m", "joints"), "topic 'echo': rate is '200 Hz'; allowed: 'inner', "),
    (Topic("echo", JOINT_STATE, "outer", "N m"), "topic 'echo': side is ''; allowed: 'motors', 'joints'"),
    (Topic("echo", WRENCH, "outer", "N", "joints"), "topic 'echo': side is 'joints'; allowed: ''"),
    (Topic("echo", TABLE, "outer", "N"), "topic 'echo': columns are (); name its columns"),
])  # fmt: skip
def test_a_topic_of_its_own_that_cannot_be_is_refused_with_what_is_allowed(
    row: Topic, text: str, configured: Configuration, monkeypatch: pytest.MonkeyPatch
) -> None:

    class Other(Echo):
        topics = (row,)

    with pytest.raises(TypeError) as refusal:
        Simulation(configured, [ScenarioStep("wait", 0.1)], controllers={"echo": Other})
    assert str(refusal.value).startswith(text)
    monkeypatch.setitem(sys.modules, "own_nodes", sys.modules[__name__])
    monkeypatch.setattr(Echo, "topics", (row,))
    with pytest.raises(ParameterError, match="node 'own_nodes:Echo': topic 'echo': "):
        declared("own_nodes:Echo")


def test_lockstep_waits_for_a_topic_only_where_the_configured_nodes_stream_it(configured: Configuration) -> None:
    interface = Interface(configured.shared)
    assert interface.publishers("joint_effort_command") == ["impedance"]
    assert interface.is_streamed("motor_velocity_command")
    without = dataclasses.replace(configured.shared, nodes=("driver", "transform", "velocity_loop", "gravity"))
    assert not Interface(without).is_streamed("motor_velocity_command")
    assert Interface(without).is_streamed("motor_effort_command")


class Raising(Echo):
    def __init__(self, shared: Shared, own: Nothing) -> None:
        raise KeyError("stiff\nness")


def test_a_controller_whose_constructor_raises_is_named_with_its_line(
    configured: Configuration, tmp_path: Path
) -> None:
    with pytest.raises(ParameterError) as refusal:
        Simulation(configured, load(tmp_path / "script.yaml", configured.shared), {"echo": Raising})
    text = str(refusal.value)
    assert text.startswith(f"node 'echo' cannot be made: {__name__}:Raising raised KeyError: ")
    assert f", at {__file__}:" in text
    assert text.endswith("; correct its __init__")
    assert "\n" not in text


IMPORTS = "from wam_description.wiring import Input, reaction\nclass Other:\n    "
STEP = "\n    def step(self, inputs): ...\nclass Mine: ...\n"
LOOP = 'from test_own_controller import Echo\nclass Mine(Echo): name = "velocity_loop"\n'
NO_NODES = [
    ("gravitation", "", "no node is named 'gravitation'; nodes: driver, transform"),
    ("wam_control.velocity.gravity_node:Gravity", "", "has no class 'Gravity'; did you mean 'GravityNode'\\? it has"),
    ("wam_control.velocity.gravity_node:f.<locals>.Own", "", "is inside a function; move it to the top of 'wam_con"),
    ("no_such_package:Class", "", "check that 'no_such_package' is installed or on PYTHONPATH"),
    ("impedance:ImpedanceParameters", "", "is no node: it lacks name and parameters"),
    ("broken_module:Any", "gain = 1 +\n", "node 'broken_module:Any' cannot be imported: SyntaxError: .*; correct"),
    ("my_loop:Mine", LOOP, "of the packaged node 'velocity_loop': give it another name; .*unknown"),
    # the faulty one, though another class of the module is configured
    ("no_outputs:Mine", f'{IMPORTS}@reaction(Input("q")){STEP}', r"'no_outputs:Mine' .* TypeError: .*no_outputs\.py:3"),
    ("odd:Mine", f'{IMPORTS}@reaction(Input("q", "p"), outputs=()){STEP}', r"'odd:Mine' .* TypeError: .*odd\.py:3"),
]


@pytest.mark.parametrize(("entry", "module", "text"), NO_NODES, ids=[row[0] for row in NO_NODES])
def test_a_node_that_is_none_is_refused_by_name_and_line(
    entry: str, module: str, text: str, configured: Configuration, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if module:
        (tmp_path / f"{entry.partition(':')[0]}.py").write_text(module)
        monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(ParameterError, match=text):
        require_parameters(configured.with_values({"nodes": [entry]}))


def test_the_example_holds_the_last_posture_where_one_is_beyond_the_stops(configured: Configuration) -> None:
    node: Any = declared("impedance:Impedance").node
    loop = node(configured.shared, configured.node("impedance", node.parameters))
    joints = State([0.0, -1.2, 0.0, 0.9], [0.0] * 4, [])

    def effort(stamp: int, posture: list[float]) -> Any:
        taken = {"joint_states": (stamp, joints), "joint_posture_command": (stamp, State(posture, [], []))}
        return loop.step(Inputs.of(stamp, 0.005, taken))["joint_effort_command"]

    good = effort(5_000_000, [0.0, -1.3, 0.0, 0.9])
    assert loop.refusals == {}
    assert effort(10_000_000, [0.0, 9.0, 0.0, 0.9]) == good
    assert "joint2 is commanded to 9 rad; allowed: " in loop.refusals["joint_posture_command"]


def publishing(topic: str) -> Any:
    """A node that declares a topic."""

    class Lost(Echo):
        name, topics = "lost", ()

        @reaction(Input("gravity_effort", "effort"), outputs=(topic,))
        def step(self, inputs: Inputs) -> Outputs:
            return {}

    return Lost


GRAVITY = "wam_control.velocity.gravity_node:GravityNode"


@pytest.mark.parametrize(("more", "own", "text"), [
    (("force_loop",), {}, "'joint_velocity_command' has 2 publishers, impedance, force_loop"),
    ((GRAVITY,), {}, "two nodes of the configuration are named 'gravity'"),
    ((), {"lost": publishing("nowhere")}, "node 'lost' names the topic 'nowhere'"),
    (
        (),
        {"lost": publishing("joint_posture_comand")},
        r"'joint_posture_comand', .*did you mean 'joint_posture_command'\? topics = \(Topic\(...\),\) on the class",
    ),
])  # fmt: skip
def test_nodes_that_do_not_fit_together_are_refused(
    more: tuple[str, ...], own: dict[str, Any], text: str, configured: Configuration
) -> None:
    shared = dataclasses.replace(configured.shared, nodes=(*configured.shared.nodes, *more))
    with pytest.raises(ParameterError, match=text):
        Interface(shared, own)


@pytest.mark.parametrize(("outputs", "text"), [
    (("echo",), "node 'echo' returned the topic 'ecko'; its reactions declare echo"),
    ((), r"its reactions declare nothing; write outputs=\('ecko',\) in @reaction"),
])  # fmt: skip
def test_an_output_that_is_not_declared_is_refused_by_node_and_topic(
    outputs: tuple[str, ...], text: str, configured: Configuration, tmp_path: Path
) -> None:
    class Typing(Echo):
        @reaction(Input("gravity_effort", "effort"), outputs=outputs)
        def step(self, inputs: Inputs) -> Outputs:
            return {"ecko": inputs["gravity_effort"]}

    run = Simulation(configured, load(tmp_path / "script.yaml", configured.shared), {"echo": Typing})
    with pytest.raises(ValueError, match=text):
        run.play()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["wam", "barrett-wam4", "testbed", "torque-loop", "position-loop"])
def test_the_nodes_of_the_stack_read_no_array_that_they_do_not_declare(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    configuration = Configuration.load(packaged(name))
    force = ForceCommand("base", (0.0, 5.0, 0.0))
    steps = [ScenarioStep("release", 0.1, request="enable"), ScenarioStep("press", 0.3, force=force)]
    plain = Simulation(configuration, steps)
    monkeypatch.setattr("wam_sim.bus.is_packaged", lambda declaration: False)
    masked = Simulation(configuration, steps)
    assert plain.play() == masked.play() == ""
    is_same = repr(plain.rows) == repr(masked.rows)  # not in the assertion: pytest would compare the texts for minutes
    assert is_same


@pytest.mark.parametrize("velocity", [None, State([], [], []), State([], [0.1] * 4, [])])
def test_torque_without_a_velocity_command_does_not_move_the_arm_and_is_warned_of_once(
    velocity: State | None, configured: Configuration, caplog: pytest.LogCaptureFixture
) -> None:
    commands = {"joint_effort_command": State([], [], [3.0, 0.0, 0.0, 0.0])}
    if velocity is not None:
        commands["joint_velocity_command"] = velocity

    class Torque(Echo):
        name, topics = "torque", ()

        @reaction(Input("joint_states", "position"), outputs=tuple(commands))
        def step(self, inputs: Inputs) -> Outputs:
            return commands

    alone = configured.with_values({"nodes": ["driver", "transform", "velocity_loop", "gravity"]})
    steps = [ScenarioStep("release", 0.1, request="enable"), ScenarioStep("wait", 0.4)]
    run = Simulation(alone, steps, {"torque": Torque})
    assert run.play() == ""
    texts = caplog.messages
    moved = abs(run.rows["joint_states"][-1].values[0])
    if velocity is None:
        assert moved < 0.01
        assert [
            text.startswith("warning: transform: joint_effort_command has no lasting effect") for text in texts
        ] == [True]
        assert "empty velocity to command torque alone: State([], [], [])" in texts[0]
    else:
        assert moved > 0.02
        assert texts == []


NAN = float("nan")
EFFORT = "joint_effort_command"


class Careless(Echo):
    """Returns in place of the force loop what the test gives it."""

    name, topics, given = "careless", (), State([], [], [])

    @reaction(Input("joint_states", "position"), outputs=("joint_velocity_command", EFFORT))
    def step(self, inputs: Inputs) -> Outputs:
        return {"joint_velocity_command": State([], [], []), EFFORT: self.given}


UNUSABLE: list[tuple[str, Any, str]] = [
    (EFFORT, State([], [], [0.0, NAN, 0.0, 0.0]), "effort of joint2 is nan; send finite numbers"),
    (EFFORT, State([], [], [0.0, 0.0, 1e13, -1e13]), "effort of joint3 is 1e+13; no arm reaches that, send at most"),
    (EFFORT, State([], [], [0.0] * 3), "effort has 3 values; send 4, one for each of joint1, joint2, joint3, joint4"),
    (EFFORT, State([], [0.0] * 3, [0.0] * 4), "velocity has 3 values; send 4, one for each of joint1"),
    (EFFORT, [0.0] * 4, "[0.0, 0.0, 0.0, 0.0] is no State; give one"),
    *(
        (EFFORT, State([], [], given), f"cannot be sent: effort {found}")  # type: ignore[arg-type]
        for given, found in (
            (["a"] * 4, "has 'a'; give floats"),
            (None, "is None; give a list of floats"),
            ("1234", "is '1234'; give a list of floats"),
        )
    ),
    ("force_command", Wrench("base", {1.0, 2.0, 3.0}, (0.0,) * 3), "force is {1.0, 2.0, 3.0}; give a list"),  # type: ignore[arg-type]
    ("force_command", Wrench(b"base", (0.0,) * 3, (0.0,) * 3), "frame is b'base'; give a text"),  # type: ignore[arg-type]
    ("task_command", Table("base", {(1.0,)}), "rows is {(1.0,)}; give a list of rows"),  # type: ignore[arg-type]
]


@pytest.mark.parametrize(("topic", "given", "text"), UNUSABLE)
def test_an_output_that_no_node_could_use_is_refused_by_node_topic_and_value(
    topic: str, given: Any, text: str, configured: Configuration, tmp_path: Path
) -> None:
    class One(Careless):
        pass

    One.given = given
    with_own = configured.with_values({"nodes": ["driver", "transform", "velocity_loop", "gravity"]})
    run = Simulation(with_own, load(tmp_path / "script.yaml", configured.shared), {"careless": One})
    with pytest.raises(UnusableOutput) as refusal:
        run.play() if topic == EFFORT else output_check("careless", BY_NAME[topic])(given)
    assert str(refusal.value).startswith(f"node 'careless' returned an unusable {topic}: ")
    assert text in str(refusal.value)


@pytest.mark.parametrize(("topic", "given", "taken"), [
    ("joint_effort_command", State((), np.array([]), np.full(2, 0.5)), State([], [], [0.5, 0.5])),  # type: ignore[arg-type]
    ("force_command", Wrench("base", np.ones(3), [0] * 3), Wrench("base", (1.0,) * 3, (0.0,) * 3)),  # type: ignore[arg-type]
    ("task_command", Table("base", np.array([[1.0, 2.0]])), Table("base", ((1.0, 2.0),))),  # type: ignore[arg-type]
])  # fmt: skip
def test_a_node_may_return_arrays_of_numpy_as_well_as_lists(topic: str, given: Any, taken: Any) -> None:
    found = output_check("own", BY_NAME[topic])(given)
    assert repr(found) == repr(taken)


def without(configuration: Configuration, node: str) -> Configuration:
    """The same nodes but one."""
    return configuration.with_values({"nodes": [name for name in configuration.shared.nodes if name != node]})


def silent_after(node: Any, steps: int) -> Any:
    """A node of the stack that returns nothing any more after so many steps."""

    class Silent(node):  # type: ignore[misc]
        count = 0

        @reaction(Input("joint_states", "position"), outputs=("gravity_effort",))
        def step(self, inputs: Inputs) -> Outputs:
            self.count += 1
            return super().step(inputs) if self.count <= steps else {}

    return Silent


class Inner:
    """Commands the joints, which is of the outer rate, in answer to each motor state."""

    name, parameters, waits = "inner", Nothing, False

    def __init__(self, shared: Shared, own: Nothing) -> None:
        self._timing = shared.timing

    @reaction(Input("motor_states", "position"), outputs=("joint_velocity_command",))
    def step(self, inputs: Inputs) -> Outputs:
        is_left_out = self.waits and not self._timing.is_outer(inputs.stamp)
        return {} if is_left_out else {"joint_velocity_command": State([], [0.0] * 4, [])}


class Thinned(Inner):
    """The same once per outer period."""

    @reaction(Input("motor_states", "position"), outputs=("joint_velocity_command",), thinned=True)
    def step(self, inputs: Inputs) -> Outputs:
        return super().step(inputs)


class Waiting(Inner):
    """The same, which leaves the command out between the outer periods."""

    waits = True


def test_a_topic_of_the_outer_rate_between_two_outer_periods_is_refused_with_the_node_that_returned_it() -> None:
    wam, steps = without(Configuration.load(packaged("wam")), "force_loop"), [ScenarioStep("wait", 0.1)]
    text = (
        "node 'inner' returned an unusable joint_velocity_command: it is sent at the outer rate, .* write thinned=True"
    )
    with pytest.raises(UnusableOutput, match=text):
        Simulation(wam, steps, {"inner": Inner}).play()
    for kind in (Thinned, Waiting):
        run = Simulation(wam, steps, {"inner": kind})
        assert run.play() == ""
        stamps = [[row.stamp for row in run.rows[name]] for name in ("joint_velocity_command", "joint_states")]
        assert stamps[0] == stamps[1] != []


INNER_NODES = ["driver", "transform", "velocity_loop", "gravity"]


def test_over_topics_a_command_between_two_outer_periods_is_a_fault_of_its_node(arm: RunningArm) -> None:
    fault = arm.start(Inner, nodes=INNER_NODES).run_until_fault()
    assert fault.startswith("inner: unusable joint_velocity_command: it is sent at the outer rate")


@pytest.mark.slow
@pytest.mark.parametrize("steps", [0, 50, 300])
def test_a_node_that_stops_to_return_its_output_ends_the_run_with_its_name_and_topic(steps: int) -> None:
    wam = Configuration.load(packaged("wam"))
    silent = silent_after(declared("gravity").node, steps)
    plan = [ScenarioStep("release", 0.3, request="enable"), ScenarioStep("wait", 2.0)]
    run = Simulation(without(wam, "gravity"), plan, {"my_gravity": silent})
    failure = run.play()
    assert "my_gravity runs, but did not publish gravity_effort: its step has to return this each time" in failure
    assert run.driver.safety.fault in failure


class Requesting(Echo):
    """Requests what nobody serves, or what the test gives it, with a new list of requests every time."""

    name, topics = "requesting", ()
    given: tuple[Call, ...] = (Call("nobody", "help"),)

    def __init__(self, shared: Shared, own: Nothing) -> None:
        self.requests: list[Call] = []

    @reaction(Input("gravity_effort", "effort"), outputs=("joint_torque_command",))
    def step(self, inputs: Inputs) -> Outputs:
        self.requests = list(self.given)
        return {"joint_torque_command": inputs["gravity_effort"]}


def test_without_an_answer_to_refusals_a_refused_step_publishes_nothing(
    configured: Configuration, tmp_path: Path
) -> None:
    run = Simulation(configured, load(tmp_path / "script.yaml", configured.shared), {"requesting": Requesting})
    for _ in range(20):
        run.step()
    assert len(run.rows["gravity_effort"]) == 4
    assert "joint_torque_command" not in run.rows


def test_requests_in_a_new_list_are_made(configured: Configuration, tmp_path: Path) -> None:
    class Stopping(Requesting):
        given = (Call("driver", "estop"),)

    run = Simulation(configured, load(tmp_path / "script.yaml", configured.shared), {"requesting": Stopping})
    run.step()
    assert run.driver.safety.fault == "emergency stop"


class Twice:
    """Two reactions to one topic; what each does is noted, with numbers where text is usual."""

    name, parameters = "twice", Nothing
    topics = (Topic("first", JOINT_STATE, "outer", "position, rad", "joints"),)

    def __init__(self, shared: Shared, own: Nothing) -> None:
        self.done: list[str] = []

    @reaction(Input("joint_states", "position"), outputs=("first",))
    def one(self, inputs: Inputs) -> Outputs:
        self.done.append(f"one {[len(array) for array in inputs['joint_states']]}")
        return {
            "first": State(inputs["joint_states"].position, [], []),
            "status": NodeStatus(Level.OK, "at work", facts={"steps": len(self.done)}),  # type: ignore[dict-item]
        }

    @reaction(Input("joint_states", "velocity"), outputs=())
    def two(self, inputs: Inputs) -> Outputs:
        self.done.append(f"two {[len(array) for array in inputs['joint_states']]}")
        return {}

    @reaction(Input("first", "position"), outputs=())
    def three(self, inputs: Inputs) -> Outputs:
        self.done.append("three")
        return {}

    def diagnostics(self) -> dict[str, float]:
        return {"steps": len(self.done) / 2.0}


def test_reactions_to_one_topic_work_in_the_order_of_their_declaration_everywhere(
    configured: Configuration, tmp_path: Path, arm: RunningArm
) -> None:
    run = Simulation(configured, load(tmp_path / "script.yaml", configured.shared), {"twice": Twice})
    for _ in range(11):
        run.step()
    order = ["one [4, 0, 0]", "two [0, 4, 0]", "three"]
    assert run.nodes["twice"].done == 3 * order
    arm.start(Twice, configuration=configured)
    twice: Any = arm.nodes["twice"]
    arm.run_until(lambda: len(twice.node.done) >= 30)
    subscribers = [info.node_name for info in twice.get_subscriptions_info_by_topic("/wam/joint_states")]
    done = [word for word in twice.node.done if word != "three"]
    assert done == (order[:2] * len(done))[: len(done)]
    assert subscribers.count("twice") == 1


def test_a_request_to_a_node_that_does_not_exist_says_what_it_waits_for(
    configured: Configuration, arm: RunningArm, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(requests, "NODE_LIMITS", replace(requests.NODE_LIMITS, service_wait=0.0))
    said: list[str] = []
    arm.start(Requesting, configuration=configured)
    arm.run_until(lambda: bool(said.append(capfd.readouterr().err) or "nobody/help" in "".join(said)))
    assert "waiting for the service nobody/help, which no node offers; start the node 'nobody'" in "".join(said)


def test_topics_that_answer_each_other_in_a_circle_are_not_streamed(configured: Configuration) -> None:
    ping = Topic("ping", JOINT_STATE, "outer", "torque, N m", "joints")
    pong = ping._replace(name="pong")

    class Ping(Echo):
        name, topics = "ping", (ping, pong)

        @reaction(Input("pong", "effort"), outputs=("ping",))
        def step(self, inputs: Inputs) -> Outputs:
            return {}

    class Pong(Echo):
        name, topics = "pong", ()

        @reaction(Input("ping", "effort"), outputs=("pong",))
        def step(self, inputs: Inputs) -> Outputs:
            return {}

    class Started(Pong):
        @reaction(Input("gravity_effort", "effort"), outputs=("pong",))
        def begin(self, inputs: Inputs) -> Outputs:
            return {}

    circle = Interface(configured.shared, {"ping": Ping, "pong": Pong})
    assert not circle.is_streamed("ping")
    assert not circle.is_streamed("pong")
    started = Interface(configured.shared, {"ping": Ping, "pong": Started})
    assert started.is_streamed("ping")
    assert started.is_streamed("pong")
