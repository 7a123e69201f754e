"""Requests to services as ROS sends them, and their answers."""

from collections.abc import Callable
from typing import Any, NamedTuple

from rcl_interfaces.srv import SetParameters as SetParametersService
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool, Trigger

from wam_description.wiring import Call, SetParameters


class ServiceRequest(NamedTuple):
    """Name of a service, relative to the namespace of the stack, its type and the message that it is sent."""

    service: str
    kind: Any
    message: Any


def service_request(request: Call | SetParameters) -> ServiceRequest:
    """What a request to another node is on ROS."""
    if isinstance(request, SetParameters):
        sent = [Parameter(name, value=value).to_parameter_msg() for name, value in request.values.items()]
        message = SetParametersService.Request(parameters=sent)
        return ServiceRequest(f"{request.node}/set_parameters", SetParametersService, message)
    kind, message = switch_request(request.data)
    return ServiceRequest(f"{request.node}/{request.service}", kind, message)


def switch_request(data: bool | None) -> tuple[Any, Any]:
    """Type and message of a request with a value, or of a std_srvs/Trigger where it is None."""
    return (Trigger, Trigger.Request()) if data is None else (SetBool, SetBool.Request(data=data))


def refusal_of(request: Call | SetParameters, answer: Any) -> str:
    """Why a request was refused, '' where it was not."""
    if isinstance(request, SetParameters):
        if len(answer.results) != len(request.values):
            return f"{request.node} failed on it and may use a part of it; its log has the reason"
        return "; ".join(result.reason for result in answer.results if not result.successful)
    return "" if answer.success else str(answer.message)


def answer_of(client: Any, message: Any, attempts: int, wait: Callable[[Any], object]) -> Any:
    """The answer of a service, None where there is none.

    An answer can be lost while the service still discovers who asks; asking twice does no harm.

    Parameters
    ----------
    client : of the service, which is ready.
    message : the request.
    attempts : how often it is sent.
    wait : called with the future of each attempt, spins until it is done or the patience with this attempt is over.
    """
    futures: list[Any] = []
    for _ in range(attempts):
        futures.append(client.call_async(message))
        wait(futures[-1])
        for future in futures:  # an earlier one may be answered meanwhile
            if future.done():
                return future.result()
    return None
