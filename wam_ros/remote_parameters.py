"""The parameters of other nodes, read over the standard services."""

import time
from collections.abc import Iterable
from functools import partial
from typing import Any

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python

from wam_ros.limits import CALL_LIMITS


class RemoteParameters:
    """Collects all parameters of some nodes, with one request each, without waiting.

    Parameters
    ----------
    node : node that asks.
    names : nodes to ask, relative to the namespace of `node`.
    """

    def __init__(self, node: Node, names: Iterable[str]) -> None:
        self.found: dict[str, dict[str, Any]] = {}
        self._clients = {
            name: (
                node.create_client(ListParameters, f"{name}/list_parameters"),
                node.create_client(GetParameters, f"{name}/get_parameters"),
            )
            for name in names
        }
        self._requested = dict.fromkeys(self._clients, -CALL_LIMITS.parameters)

    @property
    def missing(self) -> list[str]:
        """Nodes that have not answered yet."""
        return [name for name in self._clients if name not in self.found]

    def complete(self) -> bool:
        """Ask the nodes that are there and have not answered; whether all have.  Call it until they have."""
        now = time.monotonic()
        for name in self.missing:
            lister, getter = self._clients[name]
            is_due = now - self._requested[name] >= CALL_LIMITS.parameters
            if is_due and lister.service_is_ready() and getter.service_is_ready():
                self._requested[name] = now
                lister.call_async(ListParameters.Request()).add_done_callback(partial(self._listed, name))
        return not self.missing

    def _listed(self, name: str, future: Any) -> None:
        names = list(future.result().result.names)
        question = self._clients[name][1].call_async(GetParameters.Request(names=names))
        question.add_done_callback(partial(self._got, name, names))

    def _got(self, name: str, names: list[str], future: Any) -> None:
        try:
            values = [parameter_value_to_python(value) for value in future.result().values]
            self.found[name] = dict(zip(names, values, strict=True))
        except (RuntimeError, ValueError):
            return  # no answer of a node of ours; the next request follows
