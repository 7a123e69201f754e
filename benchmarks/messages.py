"""What the messages of a period of the direct run cost: bus, synchronisers, and the inputs that steps read.

The driver and the steps of all nodes return what they returned in a run before, so that nothing else is left. The
reference is the same without anybody who takes a message: the topics keep the numbers, and that is all.
"""

import time
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import comparing.source_tree  # noqa: F401 - before the packages
from comparing import arguments, machine, quartiles, ratios, save, table
from parts import NODES
from speed import scenario_steps

from wam_control.task.scenario import ScenarioStep
from wam_description.configuration import Configuration, packaged
from wam_description.interface import declared
from wam_description.synchroniser import Inputs
from wam_description.wiring import Outputs, Reaction
from wam_sim.simulation import Simulation

CHUNK = 10  # periods, of which each is counted at its fastest
MEASURED = ("motor_state", "joint_sensors")
TRUE = ("currents", "true_contact", "true_joint_state", "true_objects")
Answers = dict[tuple[str, str], list[Outputs]]  # by node and step


class RecordedDriver:
    """A driver whose states are those of a run before."""

    def __init__(self, safety: Any, states: Iterator[Mapping[str, Any]]) -> None:
        self.safety, self._states = safety, states
        self.advance(0.0)

    def advance(self, _: float) -> None:
        """Go on to the next state."""
        self.__dict__.update(next(self._states))

    def command(self, stamp: int, currents: list[float]) -> None:
        """Take currents; they have no effect."""

    def disturb(self, wrench: Any) -> None:
        """Take a push; it has no effect."""


def node_class(name: str, step: Any) -> Any:
    """A node of the stack with other steps, made by a function of the node's name, the reaction and its own step."""
    kind = declared(name).node
    steps = {one.method: step(name, one, getattr(kind, one.method)) for one in declared(name).reactions}
    return type(kind.__qualname__, (kind,), {**steps, "__module__": kind.__module__})


def recorded(configuration: Configuration, steps: list[ScenarioStep]) -> tuple[list[Mapping[str, Any]], Answers]:
    """The states of the driver in a run, and what each step of each node returned."""
    answers: Answers = {}

    def recording(name: str, reaction: Reaction, own: Any) -> Any:
        kept = answers.setdefault((name, reaction.method), [])

        def step(self: Any, inputs: Inputs) -> Outputs:
            kept.append(own(self, inputs))
            return kept[-1]

        step.__dict__["reaction"] = reaction
        return step

    run = Simulation(configuration, steps, {name: node_class(name, recording) for name in NODES})
    states: list[Mapping[str, Any]] = []
    is_over = False
    while not is_over:
        names = ("stamp", "is_outer", *MEASURED, *(TRUE if run.driver.is_outer else ()))
        states.append({name: getattr(run.driver, name) for name in names})
        is_over = run.step()
    return states, answers


def chunks(run: Simulation, states: list[Mapping[str, Any]]) -> list[float]:
    """Seconds of each chunk of periods."""
    run.driver = RecordedDriver(run.driver.safety, iter(states))  # type: ignore[assignment]
    times = [time.perf_counter()]
    for _ in range((len(states) - 1) // CHUNK):
        for _ in range(CHUNK):
            run.step()
        times.append(time.perf_counter())
    return [end - begin for begin, end in pairwise(times)]


def main() -> None:
    """Measure in turns, print the table."""
    given = arguments(__doc__, rounds=20, quick_rounds=2)
    configuration = Configuration.load(packaged("wam"))
    steps = scenario_steps(1.0, configuration.shared)
    states, answers = recorded(configuration, steps)

    def answering(name: str, reaction: Reaction, _: Any) -> Any:
        left, taken = iter(answers[name, reaction.method]), [i.topic for i in (reaction.trigger, *reaction.inputs)]

        def step(self: Any, inputs: Inputs) -> Outputs:
            for topic in taken:
                inputs[topic]
            return next(left)

        step.__dict__["reaction"] = reaction
        return step

    found: dict[str, list[list[float]]] = {"taken by all": [], "taken by nobody": []}
    for _ in range(given.rounds):
        for name, rounds in found.items():
            run = Simulation(configuration, steps, {node: node_class(node, answering) for node in NODES})
            if name == "taken by nobody":
                for route in run._bus._routes.values():
                    route.takers.clear()
            rounds.append(chunks(run, states))
    periods = len(states) // CHUNK * CHUNK / 1e6
    print(machine())
    least = {name: sum(map(min, zip(*rounds, strict=True))) / periods for name, rounds in found.items()}
    whole = {name: [sum(chunk) / periods for chunk in rounds] for name, rounds in found.items()}
    compared = {name: ratios(values, whole["taken by nobody"]) for name, values in whole.items()}
    rows = [[name, f"{least[name]:.1f}", f"{quartiles(whole[name]):.1f}", f"{compared[name]:.2f}"] for name in found]
    print(table(["messages", "us of a period, at the fastest", "middle half", "ratio"], rows))
    save("messages", given, compared)


if __name__ == "__main__":
    main()
