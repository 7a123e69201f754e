"""Whether the nodes run as a recorder takes them to, each in one life: a bag has one run."""

from collections.abc import Iterable, Mapping
from typing import Final

from rclpy.node import Node

from wam_description.agreement import DIGESTS, difference
from wam_description.arm import Shared
from wam_description.parameters import fields
from wam_description.signals import NodeStatus
from wam_ros.recorder_interface import RecorderInterface
from wam_ros.remote_parameters import RemoteParameters

_SHARED: Final = frozenset(field.name for field in fields(Shared))


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
    parameters : of the nodes.
    """

    def __init__(self, node: Node, shared: Shared, names: Iterable[str], bag: str) -> None:
        self._node, self._bag = node, bag
        self._mode, self._listed = shared.timing.mode, frozenset(shared.nodes)
        self.parameters = RemoteParameters(node, names)
        self._differing: dict[str, str] = {}  # how each node runs otherwise, '' where it does not
        self._digests: dict[str, str] = {}  # of the shared parameters with which each node ran first
        self._lives: dict[str, str] = {}  # the node of each writer of a status that was seen
        self._again: dict[str, RemoteParameters] = {}  # those of nodes that were started again
        self._two_runs = ""  # which node was started again with others

    @property
    def failure(self) -> str:
        """How nodes run otherwise than the recorder takes them to, or that there are two runs; '' where neither."""
        if listed := "; ".join(filter(None, self._differing.values())):
            return f"{listed}; start the recorder with 'wam bag record', which takes both from the running stack"
        return self._two_runs

    @property
    def restarted(self) -> list[str]:
        """Nodes that were started again and whose parameters have been requested."""
        return list(self._again)

    def attend(self, writers: Mapping[str, str]) -> None:
        """Ask for parameters and look at those that came; `writers` are the nodes of the statuses by identity."""
        self.parameters.ask()
        self._compare()
        self._look_for_restarts(writers)

    def hear(self, status: NodeStatus) -> None:
        """Report a node that was started again with other shared parameters."""
        given = status.facts.get(DIGESTS, "")
        if not given or status.node not in self.parameters.names or self._two_runs:
            return
        if found := difference(self._digests.setdefault(status.node, given), given):
            self._report_two_runs(status.node, found)

    def _compare(self) -> None:
        """Report each node that has another mode or list of nodes than the recorder was given."""
        for node, given in self.parameters.found.items():
            if node in self._differing:
                continue
            mode, listed = given.get("timing.mode", self._mode), frozenset(given.get("nodes", self._listed))
            others = listed.symmetric_difference(self._listed) - {RecorderInterface.name}
            found = [f"node {node} runs in {mode}, and this recorder in {self._mode}"] * (mode != self._mode)
            found += [f"node {node} and this recorder do not both have {', '.join(sorted(others))}"] * bool(others)
            self._differing[node] = "; ".join(found)
            if found:
                self._node.get_logger().error(self.failure)

    def _look_for_restarts(self, writers: Mapping[str, str]) -> None:
        """Ask a node that was started again for its own parameters, and report others than those in the bag."""
        for writer, node in writers.items():
            if writer not in self._lives and node in self._lives.values() and node in self.parameters.found:
                self._again[node] = RemoteParameters(self._node, [node])
            self._lives[writer] = node
        for node, again in list(self._again.items()):
            again.ask()
            if node in again.found:
                del self._again[node]
                before, after = self.parameters.found[node], again.found[node]
                others = sorted(name for name in before.keys() - _SHARED if str(before[name]) != str(after.get(name)))
                if others and not self._two_runs:
                    self._report_two_runs(node, ", ".join(others))

    def _report_two_runs(self, node: str, others: str) -> None:
        self._two_runs = (
            f"node {node} was started again, with another {others}, and {self._bag} has both runs; "
            "record each with a recorder of its own"
        )
        self._node.get_logger().error(self._two_runs)
