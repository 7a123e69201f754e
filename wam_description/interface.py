"""The interface of a bring-up: who publishes and who takes each topic, from the declarations of its nodes."""

import importlib
from collections.abc import Callable, Collection, Iterable, Mapping
from difflib import get_close_matches
from functools import cache, cached_property
from typing import Any, NamedTuple

from wam_description.arm import Shared
from wam_description.configuration import Configuration
from wam_description.defects import Check, UnusableOutput, defect_finder, output_check
from wam_description.nodes import EACH, GROUPED, GROUPS, INNER, NODES, ONE, installation
from wam_description.parameters import ParameterError, meant, require
from wam_description.synchroniser import InputSpec, Synchroniser
from wam_description.thresholds import FILES, INPUTS
from wam_description.topics import BY_NAME, EVERY_NODE, STATUS, Topic
from wam_description.wiring import (
    WHOLE,
    Declaration,
    Input,
    Inputs,
    Outputs,
    Reaction,
    declaration,
    needed_arrays,
    raised,
)


@cache
def declared(entry: str) -> Declaration:
    """The declaration of a node.

    Parameters
    ----------
    entry : name in the table of nodes, or 'module:Class' of a node of your own.

    Raises
    ------
    ParameterError
        where there is no such node, or it cannot be imported.
    """
    module, colon, name = NODES.get(entry, entry).partition(":")
    if not colon:
        raise ParameterError(
            f"no node is named '{entry}'; nodes: {', '.join(NODES)}; name one of your own as my_package.module:Class"
        )
    try:
        imported = importlib.import_module(module)
    except ModuleNotFoundError as error:
        own = f"check that '{error.name}' is installed or on PYTHONPATH"
        cure = installation(error.name or "") if entry in NODES else own
        raise ParameterError(f"node '{entry}' cannot be imported: {error}; {cure}") from error
    except Exception as error:
        raise ParameterError(f"node '{entry}' cannot be imported: {raised(error)}; correct '{module}'") from error
    if "<locals>" in name:
        raise ParameterError(f"node '{entry}': the class is inside a function; move it to the top of '{module}'")
    if not hasattr(imported, name):
        classes = [key for key, one in vars(imported).items() if getattr(one, "__module__", "") == module]
        there = ", ".join(classes) or "none"
        raise ParameterError(f"node '{entry}': '{module}' has no class '{name}'; {meant(name, classes)}it has {there}")
    try:
        return declaration(getattr(imported, name))
    except TypeError as error:
        raise ParameterError(f"node '{entry}': {error}") from error


def require_sections(sections: Iterable[str], entries: Iterable[str]) -> None:
    """Refuse a section that is of no node, but nearly of one: next to nodes of one's own, its name alone shows that.

    Parameters
    ----------
    sections : names of the nodes for which a configuration has parameters.
    entries : of the parameter `nodes`.

    Raises
    ------
    ParameterError
        where a section is of no node and has nearly the name of one.
    """
    names = {declared(entry).name for entry in entries}
    for section in set(sections) - names - set(NODES):
        if near := get_close_matches(section, [*NODES, *names], n=1, cutoff=FILES.similar):
            raise ParameterError(f"section '/**/{section}' belongs to no node in 'nodes'; did you mean '{near[0]}'?")


def require_parameters(configuration: Configuration) -> None:
    """Refuse sections and values of nodes before any node starts.

    Raises
    ------
    ParameterError
        names each section, the values and what is allowed.
    """
    shared = configuration.shared
    require_sections(configuration.sections, shared.nodes)
    refusals = []
    for entry in shared.nodes:
        one = declared(entry)
        if one.name in configuration.sections:
            try:
                configuration.node(one.name, one.parameter_class)
            except ParameterError as error:
                refusal = str(error)
                if one.name in NODES and not one.node.__module__.startswith("wam_"):
                    shares = f"node '{entry}' has the name and so the parameters of the packaged node '{one.name}'"
                    refusal = f"{shares}: give it another name; {refusal}"
                refusals.append(refusal)
    require(not refusals, "; also: ".join(refusals))


def process_groups(entries: Iterable[str], processes: str) -> list[list[str]]:
    """Entries of the parameter `nodes` that share a process, for each process.

    Parameters
    ----------
    entries : of the parameter `nodes`.
    processes : ONE, GROUPED or EACH, of `wam_description.nodes`.
    """
    groups: dict[str, list[str]] = {}
    for entry in entries:
        found = declared(entry)
        name = found.name
        group = INNER if getattr(found.node, "high_priority", False) else GROUPS.get(name, name)
        groups.setdefault({ONE: "", GROUPED: group, EACH: name}[processes], []).append(entry)
    return list(groups.values())


class Interface:
    """Who publishes and who takes each topic among the nodes of a bring-up.

    Parameters
    ----------
    shared : shared parameters; `nodes` lists the nodes.
    replaced : node classes by name that take the place of those in the table.
    started_by_hand : a node that may not be among `shared.nodes`; nobody waits for it.

    Attributes
    ----------
    declarations : of the nodes, by node name, in the order of `shared.nodes`.
    topics : rows of the table of topics that exist on this arm, by name, with those that nodes add.
    """

    def __init__(
        self, shared: Shared, replaced: dict[str, Any] | None = None, started_by_hand: Declaration | None = None
    ) -> None:

        self._timing, self._ages, self._arm = shared.timing, shared.ages, shared.arm
        self.declarations: dict[str, Declaration] = {}
        for one in map(declared, shared.nodes):
            if one.name in self.declarations:
                raise ParameterError(
                    f"two nodes of the configuration are named '{one.name}'; list one of them, or rename your own"
                )
            self.declarations[one.name] = one
        for name, node in (replaced or {}).items():
            self.declarations[name] = declaration(node)._replace(name=name)
        known = [*self.declarations.values(), *([started_by_hand] if started_by_hand else [])]
        every = {**{topic.name: topic for one in known for topic in one.topics}, **BY_NAME}
        self.topics: dict[str, Topic] = {
            name: topic for name, topic in every.items() if shared.arm.joint_sensors or not topic.needs_joint_sensors
        }
        self._check()

    @property
    def names(self) -> list[str]:
        """Names of the nodes."""
        return list(self.declarations)

    def publishers(self, topic: str) -> list[str]:
        """Names of the nodes that publish a topic."""
        if topic in EVERY_NODE:
            return self.names
        return [name for name, one in self.declarations.items() if topic in one.outputs]

    def subscribers(self, topic: str) -> list[str]:
        """Names of the nodes that take a topic; the recorder takes every one, and every node the driver's status."""
        takers = self.declarations.items()
        return [name for name, one in takers if topic in one.inputs or topic == STATUS or name == "recorder"]

    def is_streamed(self, topic: str) -> bool:
        """Whether a message of this topic comes in every period, so that lockstep can wait for it.

        It does where the driver publishes it, or a node of the bring-up in answer to such a topic.
        """
        return topic in self._streamed

    @cached_property
    def _streamed(self) -> frozenset[str]:
        found = frozenset(_sources())
        reactions = [reaction for one in self.declarations.values() for reaction in one.reactions]
        for _ in reactions:  # the longest chain has all of them
            found |= {topic for reaction in reactions if reaction.trigger.topic in found for topic in reaction.outputs}
        return found

    def checks(self, declaration: Declaration) -> dict[str, Check]:
        """The checks of the outputs of a node of your own, by topic: `output_check` for each that another node takes.

        The nodes of the stack are not looked at: the simulation would be slower by a twentieth.
        """
        found: dict[str, Check] = {}
        if is_packaged(declaration):
            return found
        for name in declaration.outputs:
            taken = [item.arrays for one in self.declarations.values() for item in one.taken if item.topic == name]
            taken += ["effort" for one in self.declarations.values() if name in one.listens]  # the driver, currents
            topic = self.topics.get(name)
            if topic is not None and topic.is_numbers:
                finder = [defect_finder(topic, self._arm, needed_arrays(taken))] * bool(taken)
                found[name] = output_check(declaration.name, topic, *finder)
        return found

    def feeds(self, declaration: Declaration, node: Any) -> dict[str, list["Feed"]]:
        """What a node does with each topic that it listens to on this arm.

        The reactions of a topic come in the order of their declaration; there is none where the node does not use
        the topic as it is configured, though its publisher waits for the subscription.

        Parameters
        ----------
        node : the declared node.
        """
        feeds: dict[str, list[Feed]] = {topic: [] for topic in declaration.inputs if topic in self.topics}
        unused = getattr(node, "unused", ())
        clock: Synchroniser | None = None
        found: dict[str, tuple[list[Input], Synchroniser]] = {}
        for reaction in sorted(declaration.reactions, key=lambda one: not self.is_streamed(one.trigger.topic)):
            used = [item for item in reaction.inputs if item.topic in self.topics and item.topic not in unused]
            trigger, specs = reaction.trigger, {item.topic: self._spec(item) for item in used}
            is_outer, started = self._is_outer(reaction), self._spec(trigger)
            synchroniser = Synchroniser(self._timing, trigger.topic, specs, is_outer, reaction.thinned, started, clock)
            found[reaction.method] = used, synchroniser
            if started.streamed:
                clock = clock or synchroniser
        for reaction in declaration.reactions:
            used, synchroniser = found[reaction.method]
            work = self._work(declaration, node, reaction)
            essential = frozenset(i.topic for i in reaction.inputs if i.absent == "brake" and self.is_streamed(i.topic))
            for item in (reaction.trigger, *used):
                arrays = item.arrays if self.topics[item.topic].side else WHOLE
                feeds[item.topic].append(Feed(synchroniser, arrays, work, essential))
        return feeds

    def _is_outer(self, reaction: Reaction) -> bool:
        """Whether a reaction steps once per outer period."""
        return reaction.thinned or self.topics[reaction.trigger.topic].rate != "inner"

    def _work(self, declaration: Declaration, node: Any, reaction: Reaction) -> Callable[[Inputs], Outputs]:
        """The step; of a node of your own, one that refuses topics of the outer rate between two outer periods.

        The nodes that take them use those of the outer periods alone.
        """
        work: Callable[[Inputs], Any] = getattr(node, reaction.method)
        if is_packaged(declaration):
            return work
        outer = {name for name in reaction.outputs if name in self.topics and self.topics[name].rate == "outer"}
        is_outer, timing = self._is_outer(reaction), self._timing

        def checked(inputs: Inputs) -> Outputs:
            outputs = work(inputs)
            if not isinstance(outputs, Mapping):
                reason = f"{outputs!r}; return a dictionary from topic to value, which may be empty"
                raise UnusableOutput(declaration.name, f"output of {reaction.method}", reason)
            if not is_outer and not timing.is_outer(inputs.stamp):
                for name in outer & outputs.keys():
                    raise UnusableOutput(
                        declaration.name,
                        name,
                        f"it is sent at the outer rate, but this step, one for each {reaction.trigger.topic}, is "
                        "between two outer periods: no node would use it; write thinned=True in @reaction, or return "
                        "it only where shared.timing.is_outer(inputs.stamp)",
                    )
            return outputs

        return checked

    def _spec(self, item: Input) -> InputSpec:
        delay = max(self._timing.outer_delay if item.delayed else 0, item.answers)
        limit = self._ages.limit_ns(item.age)
        is_outer, is_streamed = self.topics[item.topic].rate != "inner", self.is_streamed(item.topic)
        return InputSpec(is_outer, delay, is_streamed, limit, item.age == "command")

    def upstream(self, topic: str) -> frozenset[str]:
        """Names of the nodes between the driver and a topic: those whose loss ends it."""
        found, passed, waiting = set(), set(_sources()), [topic]
        while waiting:
            passed.add(topic := waiting.pop())
            for name, one in self.declarations.items():
                triggers = [reaction.trigger.topic for reaction in one.reactions if topic in reaction.outputs]
                found |= {name} if triggers else set()
                waiting += [trigger for trigger in triggers if trigger not in passed]
        return frozenset(found)

    def silent(self, ages: Mapping[str, float]) -> tuple[list[str], list[str], list[str]]:
        """Which topics are lost, and which nodes must have ended for it while the other topics still come.

        Parameters
        ----------
        ages : of the newest message by topic, as parts of their limits.

        Returns
        -------
        tuple
            the topics; the nodes that explain them best: those that all lost topics have in common; other nodes that
            explain them if all of these have ended.  A node that still answers in a topic that comes is in neither.
        """
        oldest = max(ages.values())
        lost = [topic for topic, age in ages.items() if age > INPUTS.together * oldest]
        present = [topic for topic in ages if topic not in lost]
        suspects = [self.upstream(topic) for topic in lost]
        every: frozenset[str] = frozenset().union(*suspects)
        alive: frozenset[str] = frozenset().union(*(self.upstream(topic) for topic in present))
        stopped = every.intersection(*suspects) - alive or every - alive or every
        others = every - alive - stopped
        return lost, sorted(stopped), sorted(others) if all(map(others.intersection, suspects)) else []

    def unanswered(self, topics: Collection[str], awaited: Mapping[str, Collection[str]]) -> dict[str, list[str]]:
        """The nodes that are the reason why topics do not come, each with what it should have published.

        A node that lacks what its step takes is none; those that publish what it lacks are looked at in its place.
        A topic that no node of the bring-up publishes is that of the node ''.

        Parameters
        ----------
        topics : that have not come.
        awaited : by node, the topics that it lacks; only a node that is listed is known to run.
        """
        found: dict[str, list[str]] = {}
        passed, waiting = set(topics), list(topics)
        while waiting:
            topic = waiting.pop(0)
            if topic not in _sources() and not self.publishers(topic):
                found.setdefault("", []).append(topic)
            for name, one in self.declarations.items():
                reactions = [reaction for reaction in one.reactions if topic in reaction.outputs]
                taken = {item.topic for reaction in reactions for item in (reaction.trigger, *reaction.inputs)}
                lacking = sorted(taken.intersection(awaited.get(name, ())))
                if reactions and not lacking:
                    found.setdefault(name, []).append(topic)
                waiting += [one for one in lacking if one not in passed]
                passed.update(lacking)
        return found

    def _check(self) -> None:

        for name, one in self.declarations.items():
            for topic in (*one.inputs, *one.outputs):
                if topic not in self.topics and topic not in BY_NAME:
                    raise ParameterError(
                        f"node '{name}' names the topic '{topic}', which is in no table of topics; "
                        f"{meant(topic, self.topics)}topics = (Topic(...),) on the class adds one of your own"
                    )
            for row in one.topics:
                if self.topics.get(row.name) != row:
                    raise ParameterError(
                        f"node '{name}' adds the topic '{row.name}', which exists; give it another name"
                    )
            for topic in one.outputs:
                if (others := self.publishers(topic)) != [name]:
                    raise ParameterError(
                        f"topic '{topic}' has {len(others)} publishers, {', '.join(others)}; list only one in 'nodes'"
                    )


def is_packaged(declaration: Declaration) -> bool:
    """Whether a node is one of the stack's, none of your own."""
    return f"{declaration.node.__module__}:{declaration.node.__qualname__}" in NODES.values()


class Feed(NamedTuple):
    """What one reaction of a node does with the messages of one topic.

    Attributes
    ----------
    synchroniser : of all inputs of the reaction.
    arrays : of a JointState, the arrays that it takes.
    work : the step.
    essential : inputs of the reaction that a node of the bring-up streams, and without which the driver has to brake.
    """

    synchroniser: Synchroniser
    arrays: str
    work: Callable[[Inputs], Outputs]
    essential: frozenset[str]


@cache
def _sources() -> tuple[str, ...]:
    """Topics that start everything else, from the simulated driver or another one."""
    return declared("driver").sources
