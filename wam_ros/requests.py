"""Requests to services as ROS sends them, and their answers."""

import time
from collections import deque
from collections.abc import Callable, Iterable
from functools import cache
from typing import Any

from rcl_interfaces.srv import SetParameters as SetParametersService
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.timer import Timer
from std_srvs.srv import SetBool, Trigger

from wam_description.signals import Answer
from wam_description.wiring import Call, SetParameters
from wam_ros.limits import NODE_LIMITS

Request = Call | SetParameters


def service_request(request: Request) -> tuple[str, Any, Any]:
    """What a request to another node is on ROS: service relative to the stack's namespace, its type, the message."""
    if isinstance(request, SetParameters):
        sent = [Parameter(name, value=value).to_parameter_msg() for name, value in request.values.items()]
        message = SetParametersService.Request(parameters=sent)
        return f"{request.node}/set_parameters", SetParametersService, message
    name = f"{request.node}/{request.service}".lstrip("/")
    if request.data is None:
        return name, Trigger, Trigger.Request()
    return name, SetBool, SetBool.Request(data=request.data)


def answer_of(request: Request, response: Any) -> Answer:
    """The answer of the service of a request."""
    if not isinstance(request, SetParameters):
        return Answer(response.success, response.message)
    results = response.results
    if len(results) != len(request.values):
        failed = f"{request.node} failed while it set the parameters and may use some of them; its log has the reason"
        return Answer(False, failed)
    refused = [result for result in results if not result.successful]
    return Answer(not refused, "; ".join(result.reason for result in refused or results[:1]))


class RequestQueue:
    """Requests of a node to others, made one after the other; what follows a request waits for its answer.

    Parameters
    ----------
    node : that asks.
    refused : called with the reason where a request is refused; what waits is dropped then.
    """

    def __init__(self, node: Node, refused: Callable[[str], None]) -> None:
        self._node, self._refused = node, refused
        self._waiting: deque[Callable[[], None]] = deque()
        self._client = cache(node.create_client)
        self._is_asking = False

    @property
    def is_idle(self) -> bool:
        """Whether nothing waits."""
        return not self._is_asking and not self._waiting

    def clear(self) -> None:
        """Forget what waits: nobody may be there to answer."""
        self._waiting.clear()
        self._is_asking = False

    def add(self, requests: Iterable[Request], then: Callable[[], None]) -> None:
        """Make requests, then do something."""
        self._waiting.extend([*(lambda request=request: self._make(request) for request in requests), then])
        self._go_on()

    def _go_on(self) -> None:
        """Do what waits, up to the next request that has to be answered."""
        while self._waiting and not self._is_asking:
            self._waiting.popleft()()

    def _make(self, request: Request) -> None:
        service, kind, message = service_request(request)
        client = self._client(kind, service)
        self._is_asking = True
        began, is_reported = time.monotonic(), False
        timer: Timer

        def ask_when_found() -> None:
            nonlocal is_reported
            if not is_reported and time.monotonic() - began > NODE_LIMITS.service_wait:
                is_reported = True
                self._node.get_logger().warning(
                    f"waiting for the service {client.srv_name}, which no node offers; start the node '{request.node}' "
                    "that offers it, or let this node request another service"
                )
            if client.service_is_ready():  # before, the request would be lost
                timer.cancel()
                self._node.destroy_timer(timer)
                client.call_async(message).add_done_callback(lambda future: self._answered(request, future.result()))

        timer = self._node.create_timer(0.005, ask_when_found)

    def _answered(self, request: Request, answer: Any) -> None:
        self._is_asking = False
        success, text = answer_of(request, answer)
        if not success:
            self._waiting.clear()
            self._refused(f"{request.node} refuses: {text}" if isinstance(request, SetParameters) else text)
        self._go_on()
