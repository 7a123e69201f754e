"""A ROS node that no message, request or timer ends: what a callback raises is a fault with the node's name."""

import time
import traceback
from collections.abc import Callable, Sequence
from typing import Any, Final

from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter

from wam_bag.printable import printable
from wam_description.defects import UnusableOutput
from wam_description.wiring import raised
from wam_ros.limits import NODE_LIMITS
from wam_ros.network import Place
from wam_ros.process_signals import leaving

_READABLE: Final = frozenset(kind.value for kind in Parameter.Type)


class LeavingNode(Node):
    """Leaves the network within the time of `leaving`; its context knows it, also where a subclass fails to make it.

    Attributes
    ----------
    place : of its name, which becomes free with it; None where others may have the same.
    """

    place: Place | None = None

    def __init__(self, *name: str, **ros: Any) -> None:
        super().__init__(*name, **ros)
        getattr(self.context, "begun", set()).add(self)

    def destroy_node(self) -> None:
        """As that of rclpy."""
        getattr(self.context, "begun", set()).discard(self)
        with leaving(self.context):
            super().destroy_node()
        if self.place:
            self.place.close()


class TolerantNode(LeavingNode):
    """Callbacks that raise are reported, once a second at most, and the node goes on.

    A node that ends at an exception leaves the arm enabled until a watchdog sees it, and anybody could end it who
    finds a message that it cannot bear.  Here the exception goes to `take_fault`, which reports a status of level
    ERROR with a `fault`: the driver brakes and names it.  The fault is over when the node has worked for a second
    without another exception, and not before a step that raised has gone well.
    """

    _has_ended = False
    _exception_time = 0.0  # of the newest one, s
    _exception_fault = ""
    _unserved: tuple[Any, ...] = ()

    def destroy_node(self) -> None:
        """As that of rclpy; what the executor still has for this node is of no use any more."""
        self._has_ended = True
        super().destroy_node()

    def take_fault(self, reason: str) -> None:
        """Report a fault of this node; '' where it is over."""

    @property
    def is_failing(self) -> bool:
        """Whether the work of this node is known to fail still, though it has not been tried for a while."""
        return False

    def create_subscription(self, msg_type: Any, topic: str, callback: Any, *more: Any, **options: Any) -> Any:
        """As that of rclpy."""
        bearing = self.bearing(callback, f"a message on {topic}")
        return super().create_subscription(msg_type, topic, bearing, *more, **options)

    @property
    def subscriptions(self) -> Any:
        """As that of rclpy, without those whose messages no executor is to fetch."""
        return (found for found in super().subscriptions if found not in self._unserved)

    def leave_unserved(self, subscription: Any) -> None:
        """Let no executor fetch the messages of a subscription."""
        self._unserved = (*self._unserved, subscription)

    def create_timer(self, timer_period_sec: float, callback: Any, *more: Any, **options: Any) -> Any:
        """As that of rclpy, on the steady clock unless another is given."""
        name = getattr(callback, "__name__", "a timer")
        options.setdefault("clock", Clock(clock_type=ClockType.STEADY_TIME))
        return super().create_timer(timer_period_sec, self.bearing(callback, name), *more, **options)

    def create_service(self, srv_type: Any, srv_name: str, callback: Any, **options: Any) -> Any:
        """As that of rclpy."""
        if srv_type in (SetParameters, SetParametersAtomically):
            callback = _refusing_unknown_types(callback)
        bearing = self.bearing(callback, f"a request to {srv_name}", self._refuse)
        return super().create_service(srv_type, srv_name, bearing, **options)

    def bearing(
        self, callback: Callable[..., Any], what: str, otherwise: Callable[..., Any] = lambda *_: None
    ) -> Callable[..., Any]:
        """A callback that does nothing once the node has ended; what it raises is a fault.

        Its result is that of `otherwise` then.
        """

        def bear(*arguments: Any) -> Any:
            if not self._has_ended:
                try:
                    return callback(*arguments)
                except Exception as error:
                    self._take_exception(what, error)
            return otherwise(*arguments)

        return bear

    def _refuse(self, request: Any, response: Any) -> Any:
        if hasattr(response, "message"):
            response.success, response.message = False, self._exception_fault
        return response

    def _take_exception(self, what: str, error: Exception) -> None:
        self._exception_time = time.monotonic()
        if self._exception_fault:
            return
        self._exception_fault = printable(self._described(what, error), NODE_LIMITS.exception_length)
        trace = printable("".join(traceback.format_exception(error)[-8:]), 20 * NODE_LIMITS.exception_length, "\n")
        self.get_logger().error(f"{self._exception_fault}\n{trace}")
        self._exception_timer = self.create_timer(NODE_LIMITS.fault_held, self._look_for_end)
        self.take_fault(self._exception_fault)

    def _described(self, what: str, error: Exception) -> str:
        """What a callback raised, with the line of the code, and what to do."""
        if isinstance(error, UnusableOutput):
            return error.what
        text = raised(error)
        return f"unexpected {text}, after {what}; correct it, or report it with the log of node {self.get_name()}"

    def _look_for_end(self) -> None:
        """Report that the fault is over, when callbacks have gone well for a while."""
        if time.monotonic() - self._exception_time < NODE_LIMITS.fault_held or self.is_failing:
            return
        self._exception_fault = ""
        self.destroy_timer(self._exception_timer)
        self.take_fault("")


def _refusing_unknown_types(callback: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """The service of rclpy raises where the type of a value is none of ROS."""

    def answer(request: Any, response: Any) -> Any:
        if not (wrong := _wrong(request.parameters)):
            return callback(request, response)
        refused = SetParametersResult(successful=False, reason=wrong)
        if hasattr(response, "results"):
            response.results = [refused] * len(request.parameters)
        else:
            response.result = refused
        return response

    return answer


def _wrong(parameters: Sequence[Any]) -> str:
    if len(parameters) > NODE_LIMITS.requested_parameters:
        return f"{len(parameters)} parameters in one request; send at most {NODE_LIMITS.requested_parameters}"
    for found in parameters:
        if found.value.type not in _READABLE:
            name = printable(found.name, 100)
            return f"parameter '{name}' has the type {found.value.type}; allowed: {min(_READABLE)} to {max(_READABLE)}"
    return ""
