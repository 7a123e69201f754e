"""A simulation recorded into a bag, as the recorder node does it in lockstep, without ROS."""

from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

from wam_bag.bag_writer import BagWriter
from wam_bag.cdr import encoded
from wam_bag.losses import PARAMETERS as ATTACHMENT
from wam_bag.losses import RECORDING
from wam_bag.metadata import offered
from wam_bag.value_messages import TIME, Encode, encoder
from wam_control.task.scenario import ScenarioStep
from wam_description.configuration import SHARED, Configuration
from wam_description.defects import owners
from wam_description.interface import Interface, declared
from wam_description.signals import NodeStatus
from wam_description.status import pairs
from wam_description.topics import STATUS
from wam_description.urdf import urdf
from wam_description.yaml_text import parameter_text
from wam_sim.simulation import SCENARIO, Simulation

DESCRIPTION: Final = "robot_description"
NAMESPACE: Final = "/wam"  # of the recorded topics


def record(
    configuration: Configuration,
    steps: Sequence[ScenarioStep],
    path: Path,
    report: Callable[[float, str], None] = lambda seconds, step: None,
    is_stopped: Callable[[], bool] = lambda: False,
) -> str:
    """Play a scenario in this process and record it.

    Not recorded are what only viewers use and what describes the network: markers, diagnostics, the clock.

    Parameters
    ----------
    configuration : of the nodes.
    steps : the scenario.
    path : of the bag, a new directory.
    report : called with the arm's time, s, and the name of each step that begins.
    is_stopped : ends the recording once it is true.

    Returns
    -------
    str
        why the scenario failed, '' where it did not.

    Raises
    ------
    RecordingError
        if the bag cannot be written.
    """
    configuration = configuration.with_nodes(SCENARIO)  # it is simulated in any case
    simulation = Simulation(configuration, steps)
    with BagWriter(path) as bag:
        recording = _Recording(bag, simulation)
        simulation.listen(STATUS, lambda _, status: report(status.stamp / 1e9, status.message), SCENARIO)
        bag.attach(ATTACHMENT, "application/yaml", _parameters(configuration).encode())
        while not is_stopped() and not simulation.step():
            pass
        bag.metadata(RECORDING, recording.counts())
    failure: str = simulation.scenario.failure
    return failure


class _Recording:
    """Writes what a simulation publishes."""

    def __init__(self, bag: BagWriter, simulation: Simulation) -> None:
        shared = simulation.configuration.shared
        self._bag, self._simulation, self._arm = bag, simulation, shared.arm
        self._counts: Counter[tuple[str, str]] = Counter()
        interface = Interface(shared)
        for topic in interface.topics.values():
            encode = encoder(topic.type, owners(topic, shared.arm), topic.columns)
            if encode is not None and topic.type != TIME and (senders := interface.publishers(topic.name)):
                bag.add_topic(self._full(topic.name), topic.type, offered(topic.depth, topic.latched))
                if topic.name != DESCRIPTION:
                    simulation.listen(topic.name, partial(self._write_value, topic.name, encode, senders[0]))
        self._status = interface.topics[STATUS]
        bag.add_topic(self._full(STATUS), self._status.type, offered(self._status.depth, self._status.latched))
        for node in ("driver", *simulation.nodes):
            simulation.listen(STATUS, partial(self._write_status, node), node)
        self._write(DESCRIPTION, encoded(interface.topics[DESCRIPTION].type, [urdf(shared.arm)]), 0, "driver")

    def counts(self) -> dict[str, str]:
        """The record of what is in the bag: everything."""
        found = {"mode": "lockstep"}
        for (topic, node), count in self._counts.items():
            found |= {f"{topic} {node} received": str(count), f"{topic} {node} dropped": "0"}
            found[f"{topic} {node} missed"] = "0"
        return found

    def _full(self, topic: str) -> str:
        return topic if topic.startswith("/") else f"{NAMESPACE}/{topic}"

    def _write_value(self, topic: str, encode: Encode, sender: str, stamp: int, value: Any) -> None:
        self._write(topic, encode(stamp, value), stamp, sender)

    def _write_status(self, node: str, _: int, status: NodeStatus) -> None:
        status = status._replace(node=node, connected=True, session=1)
        facts = pairs(status)
        fields = [status.level, node, status.message, self._arm.name, facts]
        self._write(STATUS, encoded(self._status.type, fields), self._simulation.driver.stamp, node)

    def _write(self, topic: str, data: bytes, stamp: int, sender: str) -> None:
        name = self._full(topic)
        self._counts[name, sender] += 1
        self._bag.write(name, data, stamp, stamp, self._counts[name, sender])


def _parameters(configuration: Configuration) -> str:
    nodes = {declared(entry).name for entry in configuration.shared.nodes}
    own = {name: flat for name, flat in configuration.sections.items() if name in nodes}
    shared = configuration.sections[SHARED]
    return parameter_text({f"{NAMESPACE}/{name}": {**shared, **flat} for name, flat in own.items()})
