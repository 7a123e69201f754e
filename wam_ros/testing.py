"""The test kit: the stack in the process of a test, on the simulated arm, in a ROS domain of its own.

`wam_ros.pytest_plugin` has its fixtures; docs/own-node.md shows it.
"""

import itertools
import linecache
import math
import os
import struct
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import yaml
from rclpy.node import Node
from rclpy.publisher import Publisher

from wam_bag.bag import Bag, read
from wam_bag.columns import columns_of
from wam_description.configuration import SHARED, Configuration, named_file
from wam_description.defects import UnusableOutput, defect_finder, output_check
from wam_description.interface import Interface, declared, is_packaged, require_parameters
from wam_description.parameters import ParameterError, dotted, meant, require
from wam_description.signals import BASE, ZERO, NodeStatus, Point, State, Table, Wrench
from wam_description.status import REFUSED
from wam_description.topics import JOINT_STATE, POINT, TABLE, WRENCH, Topic
from wam_description.wiring import Call
from wam_ros.bring_up import Composition
from wam_ros.client import StackClient
from wam_ros.limits import TEST_LIMITS
from wam_ros.messages import Refused, message_type
from wam_ros.network import Place, is_inhabited
from wam_ros.ros_topics import NAMESPACE, SECOND, listening, topic_name
from wam_ros.wire import decoder, deserialized, stamp_in

_EMPTY: Final[Mapping[str, Any]] = {
    JOINT_STATE: State([], [], []),
    WRENCH: Wrench(BASE, ZERO, ZERO),
    POINT: Point(BASE, ZERO),
    TABLE: Table(BASE, ()),
}
ANY: Final = "position? velocity? effort?"  # arrays of a JointState
_COUNTER = itertools.count()


class ArmFault(AssertionError):
    """The driver has braked, or a node refuses a message, and the test did not expect it."""


@contextmanager
def locked_domain() -> Iterator[int]:
    """A ROS domain that no node is in, locked against other test processes.

    Raises
    ------
    TimeoutError
        where all are in use for long.
    """
    domains = TEST_LIMITS.domains
    end = time.monotonic() + 10.0 * TEST_LIMITS.patience
    for attempt in itertools.count(os.getpid() + next(_COUNTER)):
        number = domains[attempt % len(domains)]
        with suppress(ParameterError):  # another test has it
            place = Place(number, "", "test")
            if not is_inhabited(number):
                break
            place.close()
        if time.monotonic() > end:
            raise TimeoutError(f"ROS domains {domains[0]} to {domains[-1]} are all in use; end the programs there")
        time.sleep(TEST_LIMITS.domain_retry)
    try:
        yield number
    finally:
        place.close()


class Recorded(Mapping[str, Any]):
    """The messages of a run so far, as arrays, by the topic's name; topics without a message are not in it."""

    def __init__(self, types: Mapping[str, str]) -> None:
        self.data: dict[str, list[bytes]] = {topic: [] for topic in types}
        self._columns = lru_cache(lambda topic, count: columns_of(types[topic], self.data[topic]))

    def __getitem__(self, topic: str) -> Any:
        if not (data := self.data.get(topic)):
            there = ", ".join(self) or "none"
            near = "" if topic in self.data else meant(topic.removeprefix(f"/{NAMESPACE}/"), self.data)
            raise KeyError(f"nothing was recorded on '{topic}' so far; {near}topics with messages: {there}")
        return self._columns(topic, len(data))

    def __iter__(self) -> Iterator[str]:
        return (topic for topic, data in self.data.items() if data)

    def __len__(self) -> int:
        return sum(map(bool, self.data.values()))


class RunningArm:
    """The stack of one test.  Its first use starts it, but for `context` and `add`; `start` with other nodes or values.

    Parameters
    ----------
    domain_id : ROS domain that the test has to itself.
    folder : for the scenario and the bag.

    Attributes
    ----------
    fault : present fault of the driver that the test expects; `run_until_fault` sets it.
    """

    def __init__(self, domain_id: int, folder: Path) -> None:
        self._domain_id, self._folder = domain_id, folder
        self._composition: Composition | None = None
        self._has_ended = False
        self.fault = ""
        self._expected: set[str] = set()  # topics of which messages may be refused, until that ends
        self._known: dict[str, int] = {}  # refused messages that were expected, by topic

    def start(
        self, *own: Any, configuration: str | Path | Configuration = "wam", nodes: Sequence[str] = (), **values: Any
    ) -> "RunningArm":
        """Start the nodes of a configuration, in lockstep as fast as they can, all in this process.

        Parameters
        ----------
        own : further nodes: classes at the top of a module, or 'module:Class'.
        configuration : name, path or object.
        nodes : names of the nodes; by default those of the configuration.
        values : by keyword.  The name of a group of shared parameters or of a node, with a mapping of values, as
            ``timing={"outer_delay": 1}``; the name of a node, with a class that takes its place.

        Raises
        ------
        ParameterError
            where a value is refused, or there is no such node.
        """
        assert not self._is_started, "the stack of this test already runs; call start once, before all else"
        self._has_ended = False
        self.configuration = configured(*own, configuration=configuration, nodes=nodes, **values)
        self.interface = Interface(self.configuration.shared)
        self._is_lockstep = self.configuration.shared.timing.mode == "lockstep"
        require_parameters(self.configuration)
        made, self._composition = self._connected(), None  # one whose nodes cannot be made is closed
        made.compose(self.configuration)
        self._composition = made
        self.nodes: dict[str, Any] = made.nodes
        self.executor = made.executor
        self._driver: Any = self.nodes["driver"].driver if "driver" in self.nodes else None
        self._client = StackClient(NAMESPACE, "test", made, self.configuration.shared)
        self._client.follow_statuses()
        self.node = self._client.node
        self._streams: dict[str, tuple[int, Any]] = {}  # until a stamp, ns: a value
        every = self.interface.declarations.values()
        untaken = {topic for one in every if not is_packaged(one) for topic in one.outputs}
        untaken.difference_update(*(one.inputs for one in every))
        self._untaken = [name for name, row in self.interface.topics.items() if row.is_numbers and name in untaken]
        self._listen()
        return self

    def _listen(self) -> None:
        """Keep each message: as it is published where its publishers are of this process, else from the middleware."""
        rows = self.interface.topics
        self._recorded = Recorded({topic: row.type for topic, row in rows.items()})
        for topic, row in rows.items():
            name, take = topic_name(self.node, row), self._taking(topic)
            if row.is_numbers and self.context.carries(self.interface.publishers(topic)):
                self.context.bus.listen(
                    self.node.resolve_topic_name(name), lambda stamp, sent, take=take: take(sent.data)
                )
            else:
                self.node.create_subscription(message_type(row), name, take, listening(row), raw=True)

    def _taking(self, topic: str) -> Callable[[bytes], None]:
        kept = self._recorded.data[topic]

        def take(data: bytes) -> None:
            kept.append(data)
            self._stream(stamp_in(data))

        return take if topic == "joint_states" else kept.append

    @property
    def context(self) -> Any:
        """The rclpy context of the stack, also before its start: a node for `add` is made with it."""
        return self._connected().context

    # what the arm does

    @property
    def stamp(self) -> int:
        """The arm's time, ns."""
        return int(self._simulator.stamp)

    @property
    def truth(self) -> Any:
        """The simulated arm, a `wam_driver.plant.Plant`: `q`, `qd`, `loads()` and so on, which no sensor reports."""
        return self._simulator.plant

    @property
    def _simulator(self) -> Any:
        self._require_start()
        assert self._driver is not None, "this test has no driver, so no arm and no time: use run_until"
        return self._driver

    @property
    def recorded(self) -> Recorded:
        """All messages so far as arrays: ``arm.recorded["joint_states"].position`` is (k, n), rad."""
        self._require_start()
        return self._recorded

    def newest(self, topic: str) -> Any:
        """The newest value of a topic, message of a type that no step can take, or None before the first.

        In a condition it is cheaper than `recorded`.
        """
        row, data = self._row(topic), self.recorded.data[topic]
        if not data:
            return None
        try:
            if row.is_replayed:
                return decoder(row, self.configuration.shared, ANY)(data[-1])
            return deserialized(data[-1], message_type(row), row.type)
        except Refused as reason:
            raise ArmFault(f"{' and '.join(self.interface.publishers(topic))} published {topic}: {reason}") from None

    def status(self, node: str) -> NodeStatus | None:
        """The newest status of a node, None before the first; raises ValueError where there is no such node."""
        self._require_start()
        if node not in self.nodes:
            raise ValueError(f"no node '{node}' in this test; it has {', '.join(self.nodes)}")
        return self._client.statuses.get(node)

    # what the test does

    def add(self, node: Any) -> Any:
        """Spin a plain rclpy node, too.  Make it with ``context=arm.context``; it ends with the test."""
        require(isinstance(node, Node), f"{node!r} is no node of rclpy; give one, made with context=arm.context")
        return self._connected().add(node)

    def run_until(self, condition: Callable[[], Any], seconds: float = TEST_LIMITS.arm_time) -> None:
        """Spin until a condition holds; it is checked once per outer period of the arm.

        Raises
        ------
        ArmFault
            where the driver has a fault, or a node refuses a message, and the test does not expect it.
        AssertionError
            where the condition does not hold within `seconds` of the arm's time.
        """
        self._spin(condition, seconds, self._look)

    def _spin(self, condition: Callable[[], Any], seconds: float, look: Callable[[], None], what: str = "") -> None:
        self._require_start()
        period = self.configuration.shared.timing.outer_period_ns
        limit = self.stamp + seconds * SECOND if self._driver else math.inf
        begin = running = time.monotonic()
        looked, looked_at = -period, 0.0
        while True:
            stamp = self.stamp if self._driver else 0
            now = time.monotonic()
            if stamp - looked >= period or now - looked_at > TEST_LIMITS.look:
                looked, looked_at = stamp, now
                if condition():
                    return
                look()
                is_paused = getattr(self.nodes.get("driver"), "is_paused", False)
                running = running if is_paused else now
                if stamp > limit or now - begin > TEST_LIMITS.patience or now - running > TEST_LIMITS.lockstep_timeout:
                    waited = f"{seconds:g} s of the arm's time" if stamp > limit else f"{now - begin:.0f} s"
                    waited += "; the arm is paused, call driver/pause with False" * is_paused
                    q = self.newest("joint_states")
                    at = f"at {stamp / SECOND:.3f} s joint_states is {q and [round(x, 4) for x in q.position]}"
                    raise AssertionError(f"not met within {waited}: {what or _source(condition)}; {at}")
            self.executor.spin_once(timeout_sec=TEST_LIMITS.look)
            if not self._present_fault():
                self.fault = ""  # it is over; the next one is another one

    def run(self, seconds: float) -> None:
        """Spin for a time of the arm, s, from now on."""
        assert seconds >= 0.0, f"the arm's time does not go back by {-seconds:g} s"
        end = self.stamp + round(seconds * SECOND)
        self.run_until(lambda: self.stamp >= end, seconds + 1.0)
        self._look()

    def run_until_fault(self, seconds: float = TEST_LIMITS.arm_time) -> str:
        """Spin until the driver has a fault, which the test expects; returns it."""
        self._spin(self._present_fault, seconds, lambda: None, "a fault of the driver")
        self.fault = self._present_fault()
        return self.fault

    def run_until_refused(self, topic: str, seconds: float = TEST_LIMITS.arm_time) -> str:
        """Spin until a node refuses a message of a topic, which the test expects; returns the node and its reason.

        The test expects the refusals that follow, too, until the status of the node leaves them out.
        """
        self._row(topic)

        def is_refused() -> bool:
            count, _ = self._refusals().get(topic, (0, ""))
            return count > self._known.get(topic, 0)

        self._spin(is_refused, seconds, self._look, f"that a node refuses {topic}")
        self._expected.add(topic)
        return self._refusals()[topic][1]

    def _refusals(self) -> dict[str, tuple[int, str]]:
        """By topic, how many messages were refused, and the last reason; this kit looks at what no node takes."""
        refused: dict[str, tuple[int, str]] = {}
        for name, node in self.nodes.items():
            for topic, one in node.health.refusals.items() if hasattr(node, "health") else ():
                refused[topic] = one.count + refused.get(topic, (0, ""))[0], f"{name}: {one.reason}"
        for topic in self._untaken:
            try:
                self.newest(topic)
            except ArmFault as fault:
                refused[topic] = len(self.recorded.data[topic]), f"the test, as no node takes it: {fault}"
        return refused

    def _forget_ended(self, refusals: Mapping[str, tuple[int, str]]) -> None:
        """Expect no further refusals of a topic that no status states, and of which no message was refused again."""
        healths = [node.health for node in self.nodes.values() if hasattr(node, "health")]
        stated = {topic for health in healths for topic in health.status.facts.get(REFUSED, "").split(", ")}
        stated |= refusals.keys() & set(self._untaken)  # until a good one comes
        for topic in list(self._expected):
            count, _ = refusals.get(topic, (0, ""))
            if topic not in stated and count == self._known.get(topic):
                self._expected.remove(topic)
            self._known[topic] = count

    def _present_fault(self) -> str:
        return str(self._driver.safety.fault) if self._driver else ""

    def _look(self) -> None:
        if (fault := self._present_fault()) not in ("", self.fault):
            raise ArmFault(fault)
        refusals = self._refusals()
        self._forget_ended(refusals)
        unexpected = {
            topic: why
            for topic, (count, why) in refusals.items()
            if topic not in self._expected and count > self._known.get(topic, 0)
        }
        if unexpected and self._is_lockstep:  # in realtime a busy computer may be late
            raise ArmFault("; ".join(f"{topic} is refused by {why}" for topic, why in unexpected.items()))

    def call(self, service: str, switch: bool | None = None) -> Any:
        """The answer of a service of a node, as ``call("driver/enable", True)``; it has `success` and `message`.

        Raises
        ------
        ValueError
            where there is no such service, with a switch or without.
        """
        self._require_start()
        kinds = {"std_srvs/srv/Trigger": "no value", "std_srvs/srv/SetBool": "True or False"}
        found = self.node.get_service_names_and_types()
        there = {name.removeprefix(f"/{NAMESPACE}/"): kinds[kind] for name, (kind, *_) in found if kind in kinds}
        require(service in there, f"no service is named '{service}'; there are {', '.join(there)}")
        fits = switch is None if there[service] == "no value" else isinstance(switch, bool)
        require(fits, f"'{service}' takes {there[service]}")
        node, _, name = service.rpartition("/")
        client, message = self._client.service(Call(node, name, switch))
        self.run_until(client.service_is_ready)
        future = client.call_async(message)
        self._spin(future.done, TEST_LIMITS.arm_time, lambda: None)  # a fault that it causes is no failure of the call
        return future.result()

    def enable(self) -> None:
        """Release the brakes.

        Raises
        ------
        ArmFault
            where the driver refuses it.
        """
        self._require_start()
        node = self.nodes["driver"]
        self.run_until(lambda: self.stamp > 0 and not node.unready and not node.is_waiting())
        answer = self.call("driver/enable", True)
        if not answer.success:
            raise ArmFault(answer.message)

    def send(self, topic: str, value: Any = None, seconds: float = 0.0, **fields: Any) -> None:
        """Publish on a topic with the stamp of the newest state.

        Parameters
        ----------
        topic : name in the table of topics.
        value : State, Wrench, Point or Table; messages of other types are for a node of your own, see `add`.
        seconds : arm's time in which it is sent again with each joint state; 0 sends it once, and the force loop
            ignores a single command.
        fields : instead of a value, its fields, as ``velocity=[...]`` or ``frame="link", force=(0.0, -5.0, 0.0)``.

        Raises
        ------
        ValueError
            where there is no such topic, the time is negative, no message can have the value, or it is unusable and no
            node takes the topic.
        """
        require(
            0.0 <= seconds < math.inf,
            f"seconds is {seconds:g}; give the time in which {topic} is sent again, 0 for once",
        )
        made, row = self.value(topic, **fields), self._row(topic)
        self.publisher(topic)
        states = self.recorded.data.get("joint_states") or self.recorded.data["motor_states"]
        stamp = stamp_in(states[-1]) if states else 0
        defect_of = defect_finder(row, self.configuration.shared.arm, ANY)
        check = output_check("test", row, *[defect_of] * (not self.interface.subscribers(topic)))
        try:
            value = check(made if value is None else value)
            self._client.send(topic, stamp, value)
        except UnusableOutput as reason:
            raise ValueError(reason.what) from None
        except struct.error:  # a vector or a row of another length
            raise ValueError(f"unusable {topic}: {defect_of(value)}") from None
        self._streams[topic] = stamp + round(seconds * SECOND), value

    def value(self, topic: str, **fields: Any) -> Any:
        """A value of a topic; what is not given is empty or zero."""
        kind = self._row(topic).type
        others = f"publish it with a node of your own, see add; send takes {', '.join(_EMPTY)}"
        require(kind in _EMPTY, f"'{topic}' is a {kind}; {others}")
        empty = _EMPTY[kind]
        if unknown := fields.keys() - set(empty._fields):
            raise ValueError(f"'{topic}' has no field '{min(unknown)}'; it has {', '.join(empty._fields)}")
        return empty._replace(**fields)

    def _row(self, topic: str) -> Topic:
        """The row of a topic."""
        self._require_start()
        rows = self.interface.topics
        if topic not in rows:
            raise ValueError(f"no topic is named '{topic}'; {meant(topic, rows)}this stack has {', '.join(rows)}")
        return rows[topic]

    def publisher(self, topic: str) -> Publisher:
        """A publisher of the test; every node of the stack that takes the topic has found it."""
        self._row(topic)
        publisher, takers = self._client.publisher(topic), len(self.interface.subscribers(topic))
        self.run_until(lambda: publisher.get_subscription_count() >= takers)
        return publisher

    def _stream(self, stamp: int) -> None:
        for topic, (end, value) in list(self._streams.items()):
            if stamp > end:
                self._streams.pop(topic)
            else:
                self._client.send(topic, stamp, value)

    def play(self, steps: Sequence[Mapping[str, Any]] = (), **start: Any) -> Bag:
        """Play a scenario from start to end, recorded; the same steps give the same numbers, bit for bit.

        Parameters
        ----------
        steps : of the scenario, as in its file; none where `start` was called with `playing`.
        start : as `start` takes it.

        Returns
        -------
        the bag, whose folder is `bag.path`.  The stack has ended then.

        Raises
        ------
        ArmFault
            where the scenario failed.
        """
        if not self._is_started:
            self.start(configuration=playing(steps, self._folder, **start))
        elif steps or start or "scenario" not in self.configuration.shared.nodes:
            raise ValueError("the arm has been started already; call play instead of start, with its arguments")
        failure = self._require_start().play()
        self.close()
        if failure:
            raise ArmFault(failure)
        recorder = self.configuration.sections["recorder"]
        return read(Path(recorder["directory"], recorder["name"]))

    def close(self) -> None:
        """Destroy all nodes, the driver first, the recorder last."""
        if self._composition is not None:
            self._composition.close()
            self._composition, self._has_ended = None, True

    def _connected(self) -> Composition:
        if self._composition is None:
            assert not self._has_ended, "the stack of this test has ended; read the bag that play returned"
            self._composition = Composition(domain_id=self._domain_id)
        return self._composition

    @property
    def _is_started(self) -> bool:
        return self._composition is not None and bool(self._composition.nodes)

    def _require_start(self) -> Composition:
        made = self._connected()
        if not self._is_started:
            self.start()
        return made


def _source(condition: Callable[[], Any]) -> str:
    """The line of a condition, with its file and number; its name where it has none."""
    if (code := getattr(condition, "__code__", None)) is None:
        return str(condition)
    line = linecache.getline(code.co_filename, code.co_firstlineno).strip()
    return f"{line} ({Path(code.co_filename).name}:{code.co_firstlineno})"


def configured(
    *own: Any, configuration: str | Path | Configuration = "wam", nodes: Sequence[str] = (), **values: Any
) -> Configuration:
    """A configuration in lockstep without a pace, with nodes and values as `RunningArm.start` takes them."""
    require(not isinstance(nodes, str), f"nodes is '{nodes}'; give a list, as ['{nodes}']")
    base = configuration
    if not isinstance(base, Configuration):
        base = Configuration.load(named_file(str(base)))
    replaced = {name: _entry(value) for name, value in values.items() if _is_node(value)}
    every = [*(nodes or base.shared.nodes), *map(_entry, own)]
    entries = [replaced.pop(declared(entry).name, entry) for entry in every]
    require(not replaced, f"{', '.join(replaced)} is no node of this stack; it has {', '.join(every)}")
    groups = {name.partition(".")[0] for name in base.sections[SHARED]}
    changed: dict[str, dict[str, Any]] = {
        SHARED: {
            "nodes": list(dict.fromkeys(entries)),
            "timing.mode": "lockstep",
            "timing.real_time_factor": 0.0,
            "timing.timeout": TEST_LIMITS.lockstep_timeout,
        }
    }
    for name, value in values.items():
        if isinstance(value, Mapping):
            section, begin = (SHARED, f"{name}.") if name in groups else (name, "")
            changed.setdefault(section, {}).update(dotted(value, begin))
        elif not _is_node(value):
            changed[SHARED][name] = value
    return base.with_sections(changed)


def playing(steps: Sequence[Mapping[str, Any]], folder: Path, *own: Any, **start: Any) -> Configuration:
    """`configured` with a scenario of these steps and a recorder, whose bag is ``folder/bag``, or bag1 next to it."""
    script = folder / "script.yaml"
    try:
        script.write_text(yaml.safe_dump({"steps": list(steps)}), encoding="utf-8")
    except yaml.YAMLError as error:
        raise ParameterError(f"the steps contain {error.args[1]!r}; give mappings as a scenario file has") from None
    name = f"bag{len([*folder.glob('bag*')]) or ''}"
    recorder = {"directory": str(folder), "name": name, **start.pop("recorder", {})}
    return configured("scenario", "recorder", *own, scenario={"script": str(script)}, recorder=recorder, **start)


def _is_node(value: Any) -> bool:
    return hasattr(value, "parameters") or isinstance(value, type) or (isinstance(value, str) and ":" in value)


def _entry(node: Any) -> str:
    require(isinstance(node, (str, type)), f"{node!r} is no node; give its class, or 'module:Class'")
    return node if isinstance(node, str) else f"{node.__module__}:{node.__qualname__}"
