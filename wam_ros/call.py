"""One question to a service of a running stack, for shells without the `ros2` command."""

from typing import NamedTuple

from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from wam_ros.run import Connection

PATIENCE = 10.0  # s
ATTEMPTS = 20  # an answer can be lost while the service still discovers who asks; asking twice does no harm


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
        kind = Trigger if switch is None else SetBool
        client = node.create_client(kind, service)
        if not client.wait_for_service(PATIENCE):
            return Reply(False, f"no service {service} within {PATIENCE:g} s; start the stack with 'wam up'")
        request = kind.Request() if switch is None else kind.Request(data=switch)
        for _ in range(ATTEMPTS):
            future = client.call_async(request)
            connection.executor.spin_until_future_complete(future, timeout_sec=PATIENCE / ATTEMPTS)
            if future.done():
                answer = future.result()
                return Reply(bool(answer.success), str(answer.message))
        return Reply(False, f"no answer from {service} within {PATIENCE:g} s")
    finally:
        connection.close()
