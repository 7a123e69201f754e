"""The whole stack in one Python process without ROS: the same nodes, the same numbers, much faster.

The nodes are those of the configuration, connected by topics as in lockstep: what is published on a
topic goes through the input synchroniser of every reaction that takes it.
"""

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from wam_control.contact_estimator import ContactEstimate
from wam_control.scenario import Scenario, ScenarioStep
from wam_description.arm import Shared
from wam_description.configuration import Configuration
from wam_description.interface import Interface
from wam_description.parameters import ParameterError, build
from wam_description.signals import BASE, Level, NodeStatus, Point, State, Table, Wrench
from wam_description.synchroniser import Inputs, Synchroniser
from wam_description.topics import EVERY_NODE
from wam_description.wiring import WHOLE, Call, Declaration, Outputs, SetParameters, masked
from wam_driver.driver import Driver, DriverParameters


class TopicValue(NamedTuple):
    """One message: time and numbers; the frame where there is one."""

    stamp: int  # ns
    values: tuple[float, ...]
    frame: str = ""


Rows = dict[str, list[TopicValue]]


class Simulation:
    """The nodes of a configuration around the simulated arm, in lockstep.

    Parameters
    ----------
    configuration : the same that the ROS nodes take.
    steps : the scenario to play.
    controllers : node classes by name that take the place of those of the configuration, or come on top.

    Attributes
    ----------
    rows : what was published on each topic of numbers; a JointState as position, velocity and effort.
    driver : the driver, for a look at the plant.
    nodes : the other nodes by name.
    scenario : the scenario, for its failure.
    """

    def __init__(
        self,
        configuration: Configuration,
        steps: Sequence[ScenarioStep],
        controllers: Mapping[str, Any] | None = None,
    ) -> None:
        entries = [name for name in configuration.shared.nodes if name not in ("scenario", "recorder")]
        if "driver" not in entries:
            raise ParameterError(f"nodes are {', '.join(entries)}; a simulation needs the driver")
        configuration = configuration.with_values({"nodes": [*entries, "scenario"], "timing.mode": "lockstep"})
        shared = configuration.shared
        self._timing = shared.timing
        self.driver = Driver(shared, configuration.node("driver", DriverParameters))
        self._interface = Interface(shared, dict(controllers or {}))
        self._settings = {"driver": dict(configuration.sections["driver"])}
        self.rows: Rows = defaultdict(list)
        self._listeners: dict[str, list[Listener]] = defaultdict(list)
        self._currents: tuple[int, list[float]] = (0, [])
        self._fault = ""
        self.nodes: dict[str, Any] = {}
        self._synchronisers: list[Synchroniser] = []
        for name, declaration in self._interface.declarations.items():
            if name != "driver":
                self._connect(name, declaration, shared, configuration, steps)
        self._motors = len(shared.arm.motors.names)
        self._known = {*EVERY_NODE, *(t for one in self._interface.declarations.values() for t in one.outputs)}
        self._has_sensors = "joint_sensors" in self._interface.topics
        self._kept = {name for name, topic in self._interface.topics.items() if topic.is_numbers}

    def _connect(
        self,
        name: str,
        declaration: Declaration,
        shared: Shared,
        configuration: Configuration,
        steps: Sequence[ScenarioStep],
    ) -> None:
        kind = declaration.parameter_class
        own = configuration.node(name, kind) if name in configuration.sections else build(kind, {})
        node = declaration.node(shared, own, Scenario(steps)) if name == "scenario" else declaration.node(shared, own)
        self.nodes[name] = node
        self._settings[name] = dict(configuration.sections.get(name, {}))
        unused = getattr(node, "unused", ())
        for reaction in declaration.reactions:
            topics, synchroniser = self._interface.synchroniser(reaction, unused)
            self._synchronisers.append(synchroniser)
            listener = Listener(
                synchroniser.put,
                getattr(node, reaction.method),
                reaction.thinned,
                getattr(node, "requests", None),
                getattr(node, "refused", None),
                declaration,
                "",
            )
            arrays = {item.topic: item.arrays for item in (reaction.trigger, *reaction.inputs)}
            for topic in topics:
                is_whole = arrays[topic] == WHOLE or self._interface.topics[topic].side == ""
                self._listeners[topic].append(listener._replace(arrays="" if is_whole else arrays[topic]))

    @property
    def scenario(self) -> Any:
        """The node that plays the task."""
        return self.nodes["scenario"]

    @property
    def estimate(self) -> ContactEstimate:
        """The newest estimate of the contact estimator, in full."""
        found: ContactEstimate = self.nodes["contact_estimator"].estimate
        return found

    def play(self) -> str:
        """Play the scenario to its end; returns why it failed, '' where it did not."""
        while not self.step():
            pass
        failure: str = self.scenario.failure
        return failure

    def step(self) -> bool:
        """One inner period; True where the scenario is over."""
        driver, stamp = self.driver, self.driver.stamp
        self._is_outer = driver.is_outer
        if self._is_outer:
            self._publish_truth(stamp)
        if self._has_sensors:
            self._publish("joint_sensors", stamp, driver.joint_sensors)
        self._publish("motor_states", stamp, driver.motor_state)
        if self.scenario.done:
            return True
        driver.command(*self._currents)
        driver.advance(0.0)
        self._watch_driver()
        return False

    def _publish_truth(self, stamp: int) -> None:
        load = self.driver.true_contact
        frame = load.cover or BASE
        self._publish("motor_currents", stamp, State([], [], list(self.driver.currents)))
        self._publish("sim/joint_states", stamp, self.driver.true_joint_state)
        self._publish("sim/contact/wrench", stamp, Wrench(frame, load.force, load.moment))
        self._publish("sim/contact/point", stamp, Point(frame, (load.place, 0.0, 0.0)))

    def _publish(self, topic: str, stamp: int, value: Any) -> None:
        """Keep a message, and let everybody who listens work on it."""
        if topic in self._kept:
            self.rows[topic].append(flat(stamp, value))
        if topic == "motor_current_command":
            self._command(stamp, value.effort)
        elif topic == "sim/disturbance":
            self._push(value)
        for listener in self._listeners[topic]:
            if listener.thinned and not self._is_outer:
                continue
            taken = masked(value, listener.arrays) if listener.arrays else value
            for inputs in listener.put(topic, stamp, taken):
                outputs = listener.work(inputs)
                if listener.requests and (refusal := self._make_all(listener.requests)):
                    outputs = listener.refused(refusal)
                for name, output in outputs.items():
                    if name not in self._known:
                        listener.declaration.require_declared(outputs)
                    self._publish(name, inputs.stamp, output)

    def _command(self, stamp: int, currents: list[float]) -> None:
        if len(currents) != self._motors or not all(map(math.isfinite, currents)):
            raise ValueError(
                f"motor_current_command of {stamp} ns is {currents}; it needs {self._motors} finite numbers, A"
            )
        self._currents = (stamp, currents)

    def _push(self, wrench: Wrench) -> None:
        if wrench.frame == BASE:
            self.driver.plant.release()
        else:
            self.driver.plant.push(wrench.frame, np.array(wrench.force), np.array(wrench.torque))

    def _make_all(self, requests: list[Call | SetParameters]) -> str:
        """Carry out what a node requests of others; returns why one is refused, '' where none is."""
        refusal = ""
        for request in requests:
            refusal = refusal or self._make(request)
        requests.clear()
        return refusal

    def _make(self, request: Call | SetParameters) -> str:
        if request.node != "driver" and request.node not in self.nodes:
            return f"no node is named '{request.node}'; nodes: driver, {', '.join(self.nodes)}"
        if isinstance(request, SetParameters):
            try:
                self._tune(request)
            except ParameterError as error:
                return f"{request.node} refuses: {error}"
            return ""
        if request.service == "pause":  # nobody waits for the time of a simulation
            return ""
        if request.service == "enable":
            answer = self.driver.enable("") if request.data else self.driver.disable()
            for synchroniser in self._synchronisers:
                synchroniser.discard_commands(self.driver.stamp + self._timing.period_ns)
        else:
            answer = getattr(self.driver if request.node == "driver" else self.nodes[request.node], request.service)()
        return "" if answer.success else answer.message

    def _tune(self, request: SetParameters) -> None:
        """Give a node new live parameters; where it refuses them, nothing has changed."""
        values = {**self._settings[request.node], **request.values}
        if request.node == "driver":
            self.driver.set_added_friction(build(DriverParameters, values).effects.added_coulomb_friction)
        else:
            declaration = self._interface.declarations[request.node]
            self.nodes[request.node].tune(build(declaration.parameter_class, values))
        self._settings[request.node] = values

    def _watch_driver(self) -> None:
        """Report a new fault of the driver to every node that takes status."""
        safety = self.driver.safety
        if safety.fault == self._fault:
            return
        self._fault = safety.fault
        level = Level.ERROR if safety.fault else Level.OK
        message = f"{safety.mode.value}: {safety.fault}".removesuffix(": ")
        status = NodeStatus(level, message, "driver", mode=safety.mode.value, fault=safety.fault)
        for node in self.nodes.values():
            if hasattr(node, "take_status"):
                for name, output in (node.take_status(status) or {}).items():
                    self._publish(name, status.stamp, output)


class Listener(NamedTuple):
    """A reaction of a node behind its input synchroniser."""

    put: Callable[[str, int, Any], Iterable[Inputs]]
    work: Callable[[Inputs], Outputs]
    thinned: bool
    requests: list[Call | SetParameters] | None
    refused: Any  # called with the reason where a request is refused
    declaration: Declaration
    arrays: str  # of a JointState that the reaction takes, '' for all of the value


def flat(stamp: int, value: State | Wrench | Point | Table) -> TopicValue:
    """A value as one row of numbers."""
    if isinstance(value, State):
        position, velocity, effort = value
        return TopicValue(stamp, (*position, *velocity, *effort))
    if isinstance(value, Wrench):
        return TopicValue(stamp, (*value.force, *value.torque), value.frame)
    if isinstance(value, Point):
        return TopicValue(stamp, value.position, value.frame)
    return TopicValue(stamp, tuple(number for row in value.rows for number in row), value.frame)
