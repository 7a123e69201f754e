"""The whole stack in one Python process without ROS: the same nodes, the same numbers, much faster.

The nodes are those of the configuration, connected by topics as in lockstep: what is published on a
topic goes through the input synchroniser of every reaction that takes it.
"""

import logging
import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from wam_control.contact.contact_estimator import ContactEstimate
from wam_control.task.scenario import FORCE_LOOP, Scenario, ScenarioStep
from wam_control.task.scenario_settings import require_settings
from wam_description.configuration import Configuration
from wam_description.event import Event, Level
from wam_description.event_text import news
from wam_description.interface import Interface, require_sections
from wam_description.message_bus import Take
from wam_description.parameters import ParameterError, build, meant, require
from wam_description.signals import NodeStatus, State
from wam_description.synchroniser import Synchroniser
from wam_description.topics import EVERY_NODE, STATUS
from wam_description.wiring import Call, Declaration, Inputs, Outputs, SetParameters
from wam_driver.driver import Driver, DriverParameters
from wam_driver.lockstep import unpublished
from wam_driver.safety import Mode
from wam_sim.bus import NodeBus, Rows, Work, of_node
from wam_sim.reactions import RecordedReaction, RecordedStep, lasting, unmet

SCENARIO = "scenario"
WITHOUT_EFFECT = frozenset(  # in a direct run: it is in lockstep, as fast as it can, and no node is a process
    {"timing.mode", "timing.real_time_factor", "timing.fifo_priority", "timing.niceness", "driver:late_periods"}
)


class Simulation:
    """The nodes of a configuration around the simulated arm, in lockstep.

    Parameters
    ----------
    configuration : the same that the ROS nodes take.
    steps : the scenario to play.
    controllers : node classes by name that take the place of those of the configuration, or come on top.

    Attributes
    ----------
    configuration, steps : what is simulated.
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
        entries = [name for name in configuration.shared.nodes if name not in (SCENARIO, "recorder")]
        if "driver" not in entries:
            raise ParameterError(f"nodes are {', '.join(entries)}; a simulation needs the driver")
        configuration = configuration.with_values({"nodes": [*entries, SCENARIO], "timing.mode": "lockstep"})
        self.configuration = configuration
        shared = configuration.shared
        self._patience = round(shared.timing.timeout * 1e9)  # ns, for which the scenario may get nothing
        self._looked = 0  # ns, when the scenario was last seen to go on
        self.driver = Driver(shared, configuration.node("driver", DriverParameters))
        self.driver.stale_advice = self._cause
        own = dict(controllers or {})
        self._interface = Interface(shared, own)
        self._settings = dict(configuration.sections)
        self._bus = NodeBus(self._interface, self._interface.topics)
        self._bus.listen("motor_current_command", self._command)
        self._bus.listen("sim/disturbance", lambda _, wrench: self.driver.disturb(wrench))
        self._publishers = {topic: self._bus.publisher(topic) for topic in self._interface.topics}
        self._currents: tuple[int, list[float]] = (0, [])
        self._reported: tuple[Mode, tuple[Event, ...]] | None = None
        self._warned: dict[str, set[tuple[Any, ...]]] = {}  # of each node, what its last status was about
        self.steps = steps
        self._begins: list[int] = []  # of the steps, ns
        self._events: list[tuple[int, tuple[Event, ...]]] = []  # of the force loop, each time these change
        self.nodes: dict[str, Any] = {}
        self._synchronisers: dict[str, set[Synchroniser]] = {}
        require_sections(configuration.sections, shared.nodes)
        for name, declaration in self._interface.declarations.items():
            if name == SCENARIO:  # what it sets has to fit the other values of its node
                scenario = Scenario(steps, shared, own)
                require_settings("the scenario", [step.settings for step in scenario.steps], configuration, own)
                self._connect(declaration, scenario)
            elif name != "driver":
                self._connect(declaration)
        self._motors = shared.arm.n
        if FORCE_LOOP in self.nodes:
            self.listen(STATUS, lambda stamp, status: self._events.append((stamp, status.events)), FORCE_LOOP)
        self.listen(STATUS, lambda stamp, status: self._begins.append(stamp) if status.step else None, SCENARIO)

    def _connect(self, declaration: Declaration, *more: Scenario) -> None:
        name, kind, given = declaration.name, declaration.parameter_class, self.configuration
        own = given.node(name, kind) if name in given.sections else build(kind, {})
        node = self.nodes[name] = declaration.make(given.shared, own, *more)
        self._synchronisers[name] = self._bus.connect(declaration, node, partial(self._requesting, node))
        self.listen(STATUS, lambda _, status: self._warn(name, status), name)

    def _warn(self, node: str, status: NodeStatus) -> None:
        known, self._warned[node] = self._warned.get(node, set()), status.subjects
        if status.level is Level.WARN and not status.subjects <= known:
            logging.getLogger("wam_sim").warning("warning: %s: %s", node, news(status, known))

    def _requesting(self, node: Any, work: Work) -> Work:
        """The step of a node together with its requests to others."""
        if not hasattr(node, "requests"):
            return work

        def step(inputs: Inputs) -> Outputs:
            outputs = work(inputs)
            if node.requests:
                refusal = next(filter(None, map(self._make, node.requests)), "")
                node.requests.clear()
                if refusal:
                    return node.refused(refusal) if hasattr(node, "refused") else {}
            return outputs

        return step

    @property
    def rows(self) -> Rows:
        """What was published on each topic of numbers so far; a JointState as position, velocity and effort."""
        return self._bus.rows

    @property
    def reactions(self) -> list[RecordedReaction]:
        """What the force loop did so far instead of what was commanded."""
        return lasting(self._events, self.driver.stamp)

    @property
    def played(self) -> list[RecordedStep]:
        """The steps that have begun so far, and when."""
        times = zip(self.steps, self._begins, [*self._begins[1:], self.driver.stamp], strict=False)
        return [RecordedStep(step.name, begin, end) for step, begin, end in times]

    @property
    def unmet(self) -> str:
        """Which steps were played and yet not carried out, and why; '' where all were."""
        played = zip(self.steps, self.played, strict=False)
        commanding = [one for step, one in played if step.commands_arm]
        found = [(one.name, why) for one in commanding for why in unmet(self.reactions, one)]
        return "; ".join(f"{name} {why.outcome}: {why.reason}" for name, why in found)

    @property
    def scenario(self) -> Any:
        """The node that plays the task."""
        return self.nodes[SCENARIO]

    @property
    def estimate(self) -> ContactEstimate:
        """The newest estimate of the contact estimator, in full."""
        found: ContactEstimate = self.nodes["contact_estimator"].estimate
        return found

    def listen(self, topic: str, take: Take, node: str = "") -> None:
        """Call a function with stamp, ns, and value of each message of a topic; of one that all publish, of a node."""
        known = {*self._interface.topics, *EVERY_NODE}
        require(topic in known, f"no topic is named '{topic}'; {meant(topic, known)}topics: {', '.join(sorted(known))}")
        self._bus.listen(of_node(node, topic), take)

    def play(self) -> str:
        """Play the scenario to its end; returns why it was not played, '' where it was.

        A force that the loop refuses does not end it: see `unmet`.
        """
        while not self.step():
            pass
        failure: str = self.scenario.failure
        return failure

    def step(self) -> bool:
        """One inner period; True where the scenario is over."""
        driver, stamp = self.driver, self.driver.stamp
        self._report(stamp)
        if driver.is_outer:
            for topic, value in driver.outer_values().items():
                self._publishers[topic](stamp, value)
        if "joint_sensors" in self._publishers:
            self._publishers["joint_sensors"](stamp, driver.joint_sensors)
        self._publishers["motor_states"](stamp, driver.motor_state)
        if self.scenario.done:
            self._report(stamp)  # what it requested at its end
            return True
        if stamp - self._looked >= self._patience:
            self._require_progress(stamp)
        driver.command(*self._currents)
        driver.advance(0.0)
        return False

    def _require_progress(self, stamp: int) -> None:
        """Refuse to go on where the scenario does not get what it takes: the run would not end."""
        self._looked = stamp
        if awaited := self._awaited(SCENARIO):
            raise ValueError(
                f"the scenario gets no {' and '.join(sorted(awaited))} for the state of {stamp} ns; "
                f"{self._cause(sorted(awaited))}"
            )

    def _command(self, stamp: int, command: State) -> None:
        currents = command.effort
        if len(currents) != self._motors or not math.isfinite(sum(currents)):
            raise ValueError(
                f"motor_current_command of {stamp} ns is {currents}; it needs {self._motors} finite numbers, A"
            )
        self._currents = (stamp, currents)

    def _make(self, request: Call | SetParameters) -> str:
        node = self.driver if request.node == "driver" else self.nodes.get(request.node)
        if node is None:
            return f"no node is named '{request.node}'; nodes: driver, {', '.join(self.nodes)}"
        if isinstance(request, SetParameters):
            return self._tune(node, request)
        if request.service == "pause":  # nobody waits for the time of a simulation
            return ""
        if request.service == "enable":
            safety = self.driver.safety
            answer = safety.enable(self.driver.obstacle) if request.data else safety.disable()
            for synchroniser in set().union(*self._synchronisers.values()):
                synchroniser.discard_commands(self.driver.stamp + self.driver.timing.period_ns)
        else:
            answer = getattr(node, request.service)()
        return "" if answer.success else answer.message

    def _tune(self, node: Any, request: SetParameters) -> str:
        """Give a node new live parameters; where it refuses them, nothing has changed, and the reason is returned."""
        before = self._settings.get(request.node, {})
        values = {**before, **request.values}
        if values != before:
            try:
                node.tune(build(self._interface.declarations[request.node].parameter_class, values))
            except ParameterError as error:
                return f"{request.node} refuses: {error}"
            self._settings[request.node] = values
        return ""

    def _cause(self, topics: Sequence[str] = ("motor_current_command",)) -> str:
        """The node that is the reason why topics do not come, the command if none is given, and what to do about it."""
        awaited = {name: self._awaited(name) for name in self._synchronisers}
        return unpublished(self._interface.unanswered(topics, awaited))

    def _awaited(self, name: str) -> set[str]:
        """Topics that a node lacks for the present state."""
        return {topic for one in self._synchronisers[name] for topic in one.awaited(self.driver.stamp)}

    def _report(self, stamp: int) -> None:
        """Report a new mode or fault of the driver to every node that takes status, then to who listens."""
        mode, events = present = self.driver.safety.mode, self.driver.safety.events
        if present == self._reported:
            return
        self._reported, fault = present, self.driver.safety.fault
        level, message = (Level.ERROR, f"{mode.value}: {fault}") if fault else (Level.OK, mode.value)
        status = NodeStatus(level, message, "driver", mode=mode.value, fault=fault, stamp=stamp, events=events)
        for node_name, node in self.nodes.items():
            if hasattr(node, "take_status"):
                self._bus.publish_of(node_name, stamp, node.take_status(status) or {})
        self._bus.publisher(of_node("driver", STATUS))(stamp, status)
