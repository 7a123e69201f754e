"""How a node is declared: what starts a step, what it takes, what it gives.

A node is a plain class without ROS.  From its declaration the ROS node (`wam_ros.node`), the simulation
in one process (`wam_sim.simulation`) and the replay of a recording (`wam_sim.replay`) are made.  ::

    class Gravity:
        name, parameters = "gravity", Nothing

        def __init__(self, shared: Shared, own: Nothing) -> None:
            self._body = RigidBody(shared.arm)

        @reaction(Input("joint_states", "position"), outputs=("gravity_effort",))
        def step(self, inputs: Inputs) -> Outputs:
            q = inputs["joint_states"].position
            return {"gravity_effort": State([], [], self._body.gravity_torque(q).tolist())}

`name` is the name of the node and of its section in a configuration, `parameters` the class of the
parameters in that section, or 'module:Class' where its import takes long.  What else a node may have:

tune(own) : take new live parameters, or refuse them with ParameterError.
take_status(status) : called with the `NodeStatus` that any other node reports; it may return outputs.
services : names of methods, each of which answers a std_srvs/Trigger at ``~/name`` with an `Answer`.
requests : list of `Call` and `SetParameters`, filled by steps; made in order before the step's outputs are published.
refused(message) : outputs in place of the step's where one of them is refused; none without it.
refusals : by topic, why the present input is not used, as an `Event` or in words; reported once for each message.
needs : of the inputs with absent='brake' those that the node relies on as it is tuned now; all where it has none.
diagnostics() : further values for /diagnostics, by name, as text or numbers.
done, failure : the node has finished, and why it failed ('' where it did not).
high_priority : ask the system for a higher priority in realtime than that of the other nodes.
starts_with_all : in realtime, do nothing before all nodes of the bring-up are connected.
topics : rows of the table of topics that this node adds.
"""

import traceback
from collections.abc import Callable, Collection, Mapping, Sequence
from pkgutil import resolve_name
from typing import Any, NamedTuple, Protocol, TypeVar

from wam_description.arm import Shared, seconds
from wam_description.parameters import ParameterError
from wam_description.signals import State
from wam_description.topics import EVERY_NODE, Topic

Outputs = Mapping[str, Any]  # value by topic
WHOLE = "position velocity effort"  # arrays of a JointState
Origin = tuple[int, Collection[str]]


class Inputs(dict[str, Any]):
    """The inputs of one step, by topic: None where there is none, it is too old, or this arm does not have the topic.

    A dictionary answers in a quarter of the time of a method of ours, and nodes read nine times in a period.

    Attributes
    ----------
    stamp : time of the trigger, ns.
    dt : time since the step before, s; the nominal period at the first step.
    origins : stamps, ns, each with the topics whose inputs have it.
    """

    __slots__ = ("dt", "origins", "stamp")
    stamp: int
    dt: float
    origins: list[Origin]

    @classmethod
    def of(cls, stamp: int, dt: float, taken: Mapping[str, tuple[int, Any] | None]) -> "Inputs":
        """Inputs made by hand: time of the trigger, ns, since the step before, s, and stamp and value by topic."""
        inputs = cls({topic: found and found[1] for topic, found in taken.items()})
        inputs.stamp, inputs.dt = stamp, dt
        inputs.origins = [(found[0], (topic,)) for topic, found in taken.items() if found is not None]
        return inputs

    def __missing__(self, topic: str) -> None:
        """Return None for a topic that has no input in this step."""

    def stamp_of(self, topic: str) -> int:
        """Stamp of an input, ns; that of the trigger where there is none."""
        return next((stamp for stamp, topics in self.origins if topic in topics), self.stamp)

    def age(self, topic: str) -> float:
        """Time from the state that caused an input to the trigger, s; 0 where there is none."""
        return seconds(self.stamp - self.stamp_of(topic))


Method = TypeVar("Method", bound=Callable[[Any, Inputs], Outputs])


class Input(NamedTuple):
    """A topic that a step takes.

    Attributes
    ----------
    topic : name in the table of topics.
    arrays : of a JointState, the arrays that must be filled; one with a '?' may be empty.
    delayed : whether it is used `timing.outer_delay` periods after the state that caused it.
    age : limit of its age, one of the parameters `ages`: feedback, of another node; command, of a program.
    absent : what absence means, of an input that is not there or too old; the step sees None.
        hold: the arm stays where it is; zero: nothing is added; brake: as zero or hold, and the driver brakes
        where it was there before and another node of the bring-up streams it.
    answers : whether it may be an answer to what this step publishes; it is used in the next outer period then.
    """

    topic: str
    arrays: str = WHOLE
    delayed: bool = False
    age: str = "feedback"
    absent: str = "zero"
    answers: bool = False

    def check(self) -> None:
        """Refuse what is no input: an array given as `delayed`, a word that means nothing.

        Raises
        ------
        TypeError
            names the input and what is allowed.
        """
        if self.delayed not in (True, False):
            meant = f"Input('{self.topic}', '{self.arrays} {self.delayed}')"
            raise TypeError(f"{self}: delayed must be True or False; name several arrays in one text: {meant}")
        allowed = {
            "arrays": {text for name in State._fields for text in (name, f"{name}?")},
            "age": {"feedback", "command"},
            "absent": {"zero", "hold", "brake"},
        }
        for name, words in allowed.items():
            for word in getattr(self, name).split():
                if word not in words:
                    raise TypeError(f"{self}: {name} has '{word}'; allowed: {', '.join(sorted(words))}")


class Reaction(NamedTuple):
    """One kind of step: the trigger that starts it, the other inputs, the topics that it may publish."""

    trigger: Input
    inputs: tuple[Input, ...]
    outputs: tuple[str, ...]
    thinned: bool
    method: str


class Call(NamedTuple):
    """A request to a service of another node, '' where its name has none; `data` is None for a std_srvs/Trigger."""

    node: str
    service: str
    data: bool | None = None


class SetParameters(NamedTuple):
    """A request to set live parameters of another node."""

    node: str
    values: Mapping[str, Any]


class Declared(Protocol):
    """A node class as this module describes it."""

    name: str
    parameters: Any

    def __init__(self, shared: Shared, own: Any) -> None: ...


class Declaration(NamedTuple):
    """What a node takes and gives, read off its class.

    Attributes
    ----------
    name : of the node.
    node : the class.
    reactions : its steps.
    sources : topics that it publishes by itself, not as an answer.
    listens : inputs outside of steps.
    topics : rows that it adds to the table of topics.
    ros_node : 'module:Class' of a ROS node written by hand; '' where the adapter makes one.
    """

    name: str
    node: Any
    reactions: tuple[Reaction, ...]
    sources: tuple[str, ...]
    listens: tuple[str, ...]
    topics: tuple[Topic, ...]
    ros_node: str

    @property
    def parameter_class(self) -> Any:
        """The class of the node's own parameters; imported now where it is given as 'module:Class'."""
        kind = self.node.parameters
        return resolve_name(kind) if isinstance(kind, str) else kind

    @property
    def outputs(self) -> tuple[str, ...]:
        """Every topic that the node publishes, without status and diagnostics."""
        reacting = (topic for reaction in self.reactions for topic in reaction.outputs)
        return tuple(dict.fromkeys([*self.sources, *reacting]))

    def make(self, *arguments: Any) -> Any:
        """A node of the class.

        Parameters
        ----------
        arguments : shared and own parameters, and what the class takes besides.

        Raises
        ------
        ParameterError
            where its constructor raises; names the class, the line of the code and what it raised.
        """
        try:
            return self.node(*arguments)
        except ParameterError as error:
            raise ParameterError(f"node '{self.name}': {error}") from None
        except Exception as error:
            raise ParameterError(
                f"node '{self.name}' cannot be made: {self.node.__module__}:{self.node.__qualname__} raised "
                f"{raised(error)}; correct its __init__"
            ) from error

    def require_declared(self, outputs: Outputs) -> None:
        """Refuse outputs on topics that the node does not declare.

        Raises
        ------
        ValueError
            which names the node, the topic and those that are declared.
        """
        for topic in outputs:
            if topic not in self.outputs and topic not in EVERY_NODE:
                declared = ", ".join(self.outputs) or f"nothing; write outputs=('{topic}',) in @reaction"
                raise ValueError(f"node '{self.name}' returned the topic '{topic}'; its reactions declare {declared}")

    @property
    def taken(self) -> tuple[Input, ...]:
        """Every input of its steps."""
        return tuple(item for reaction in self.reactions for item in (reaction.trigger, *reaction.inputs))

    @property
    def inputs(self) -> tuple[str, ...]:
        """Every topic that the node listens to, without status."""
        return tuple(dict.fromkeys([*self.listens, *(item.topic for item in self.taken)]))


def raised(error: Exception) -> str:
    """An exception in one line, with the last line of code that it passed through, apart from the checks here."""
    text = f"{type(error).__name__}: {' '.join(str(error).split())}"
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename != __file__]
    return f"{text}, at {frames[-1].filename}:{frames[-1].lineno}" if frames else text


def needed_arrays(inputs: Sequence[str]) -> str:
    """The arrays of a JointState that several inputs of one topic take, with a '?' where none of them needs it."""
    taken = [arrays.split() for arrays in inputs]
    names = [name for name in State._fields if any(name in one or f"{name}?" in one for one in taken)]
    return " ".join(name if any(name in one for one in taken) else f"{name}?" for name in names)


def reaction(
    trigger: Input, *inputs: Input, outputs: tuple[str, ...], thinned: bool = False
) -> Callable[[Method], Method]:
    """Declare a method as a step of its node.

    Parameters
    ----------
    trigger : input that starts a step.
    inputs : taken with it, by stamp in lockstep, the newest in realtime.
    outputs : topics that the step may publish.
    thinned : whether only triggers at the start of an outer period start a step.
    """
    for item in (trigger, *inputs):
        item.check()

    def declare(method: Method) -> Method:
        method.__dict__["reaction"] = Reaction(trigger, inputs, outputs, thinned, method.__name__)
        return method

    return declare


def declaration(node: type[Declared]) -> Declaration:
    """Read the declaration off a node class.

    Raises
    ------
    TypeError
        where the class lacks its name, its parameters or any reaction, or adds a topic that cannot be.
    """
    methods = {name: getattr(node, name) for kind in reversed(node.__mro__) for name in vars(kind)}  # in their order
    reactions = tuple(found for value in methods.values() if (found := getattr(value, "reaction", None)))
    sources, listens = getattr(node, "sources", ()), getattr(node, "listens", ())
    missing = [item for item in ("name", "parameters") if not hasattr(node, item)]
    if missing or not (reactions or sources or listens or hasattr(node, "ros_node")):
        lack = " and ".join(missing) or "a method with @reaction"
        raise TypeError(f"{node.__module__}:{node.__qualname__} is no node: it lacks {lack}; see docs/own-node.md")
    extra = tuple(getattr(node, "topics", ()))
    for topic in extra:
        topic.check()
    return Declaration(node.name, node, reactions, sources, listens, extra, getattr(node, "ros_node", ""))
