"""A node next to a running stack that needs the parameters of its driver, as a program of the user's would be."""

from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from wam_description.arm import Shared
from wam_description.parameters import build_part
from wam_ros.remote_parameters import RemoteParameters
from wam_ros.run import Connection


def run_next_to(
    namespace: str,
    make: Callable[[Any, Shared], Node],
    until: Callable[[], bool],
    between: Callable[[Any], object] = lambda node: None,
) -> None:
    """Run a node until a condition holds; a stack that starts later is waited for.

    Parameters
    ----------
    namespace : of the stack.
    make : makes the node from the context of ROS and the driver's shared parameters.
    until : the condition.
    between : called with the node between two callbacks, at least every tenth of a second.
    """
    connection = Connection()
    try:
        connection.add(asking := Node("asks_for_parameters", context=connection.context, namespace=namespace))
        requested = RemoteParameters(asking, ["driver"])
        while not until() and requested.missing:
            requested.ask()
            connection.executor.spin_once(timeout_sec=0.05)
        if requested.missing:
            return
        connection.add(node := make(connection.context, build_part(Shared, requested.found["driver"])))
        while not until():
            connection.executor.spin_once(timeout_sec=0.1)
            between(node)
    finally:
        connection.close()
