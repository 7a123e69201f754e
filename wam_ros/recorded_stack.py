"""Whether the nodes run as a recorder takes them to, each in one life: a bag has one run."""

from collections.abc import Iterable, Mapping

from rclpy.node import Node

from wam_description.agreement import OF_ONE_PROCESS
from wam_description.arm import Shared
from wam_ros.recorder_interface import RecorderInterface
from wam_ros.remote_parameters import RemoteParameters


class RecordedStack:
    """The nodes that a recorder records: their parameters, and whether one differs or was started again.

    Parameters
    ----------
    node : the recorder, which asks.
    shared : its shared parameters.
    names : of the other nodes.
    bag : path of the bag.

    Attributes
    ----------
    failure : how a node runs otherwise than the recorder takes it to, or that there are two runs; '' where neither.
    parameters : of the nodes.
    restarted : nodes that were started again and whose parameters have been requested.
    """

    def __init__(self, node: Node, shared: Shared, names: Iterable[str], bag: str) -> None:
        self._node, self._bag = node, bag
        self._mode, self._listed = shared.timing.mode, frozenset(shared.nodes)
        self.parameters = RemoteParameters(node, names)
        self.restarted: dict[str, RemoteParameters] = {}
        self.failure = ""
        self._compared: set[str] = set()  # nodes
        self._lives: dict[str, str] = {}  # the node of each writer of a status that was seen

    def attend(self, writers: Mapping[str, str]) -> None:
        """Ask for parameters and look at those that came; `writers` are the nodes of the statuses by identity."""
        self.parameters.ask()
        for node in self.parameters.found.keys() - self._compared:
            self._compared.add(node)
            self._note(self._difference(node))
        for writer, node in writers.items():
            if writer not in self._lives and node in self._lives.values() and node in self.parameters.found:
                self.restarted[node] = RemoteParameters(self._node, [node])
            self._lives[writer] = node
        for node, again in list(self.restarted.items()):
            if again.complete():
                del self.restarted[node]
                self._note(self._change(node, again.found[node]))

    def _note(self, failure: str) -> None:
        if failure and not self.failure:
            self.failure = failure
            self._node.get_logger().error(failure)

    def _difference(self, node: str) -> str:
        """How a node has another mode or list of nodes than the recorder was given."""
        given = self.parameters.found[node]
        mode, listed = given.get("timing.mode", self._mode), frozenset(given.get("nodes", self._listed))
        others = listed.symmetric_difference(self._listed) - {RecorderInterface.name}
        found = [f"node {node} runs in {mode}, and this recorder in {self._mode}"] * (mode != self._mode)
        only = ", ".join(sorted(others))
        found += [f"only one of node {node} and this recorder has {only} in 'nodes'"] * bool(others)
        advice = "start the recorder with 'wam bag record', which takes both from the running stack"
        return "; ".join([*found, advice]) if found else ""

    def _change(self, node: str, after: Mapping[str, object]) -> str:
        """That a node was started again with other parameters than those in the bag, '' where it was not."""
        before = self.parameters.found[node]
        others = [name for name in before.keys() - OF_ONE_PROCESS if str(before[name]) != str(after.get(name))]
        if not others:
            return ""
        return (
            f"node {node} was started again, with another {', '.join(sorted(others))}, and {self._bag} has both "
            "runs; record each with a recorder of its own"
        )
