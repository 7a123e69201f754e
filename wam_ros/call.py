"""One question to a service of a running stack, for shells without the `ros2` command."""

from functools import partial
from typing import NamedTuple

from rclpy.node import Node

from wam_ros.requests import answer_of, switch_request
from wam_ros.run import Connection

PATIENCE = 10.0  # s
ATTEMPTS = 20


class Reply(NamedTuple):
    """The answer of the service."""

    success: bool
    message: str


def call(service: str, switch: bool | None) -> Reply:
    """Ask a service and wait for its answer.

    Parameters
    ----------
    service : full name, for example '/wam/driver/enable'.
    switch : value of a SetBool; None for a Trigger.
    """
    connection = Connection()
    try:
        node = Node("wam_call", context=connection.context)
        connection.add(node)
        kind, request = switch_request(switch)
        client = node.create_client(kind, service)
        if not client.wait_for_service(PATIENCE):
            return Reply(False, f"no service {service} within {PATIENCE:g} s; start the stack with 'wam up'")
        wait = partial(connection.executor.spin_until_future_complete, timeout_sec=PATIENCE / ATTEMPTS)
        answer = answer_of(client, request, ATTEMPTS, wait)
        if answer is None:
            return Reply(False, f"no answer from {service} within {PATIENCE:g} s")
        return Reply(bool(answer.success), str(answer.message))
    finally:
        connection.close()
