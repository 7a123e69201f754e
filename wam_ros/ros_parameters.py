"""ROS parameters from parameter classes: declared, described, checked as a set."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from wam_bag.printable import printable
from wam_description.arm import Shared
from wam_description.configuration import SHARED
from wam_description.parameters import Field, ParameterError, build, build_part, checked, fields, listed, meant, values
from wam_description.wiring import raised

T = TypeVar("T")
OWN_NAMES = ("use_sim_time", "start_type_description_service")  # what rclpy itself declares


def declare(node: Node, cls: type[T]) -> tuple[Shared, T]:
    """Declare the shared parameters and those of `cls` with the values given to the node.

    Returns
    -------
    shared, own
        the parameter objects.

    Raises
    ------
    ParameterError
        names every missing, unknown or refused parameter; nothing is declared then.
    """
    given = {name: _plain(parameter) for name, parameter in node._parameter_overrides.items() if name not in OWN_NAMES}
    shared_names = {field.name for field in fields(Shared)}
    name, where = node.get_name(), f"section '{SHARED}'"
    try:
        shared = build_part(Shared, given)
        where = f"section '/**/{name}' (in a test: arm.start({name}={{...}}))"
        own = build(cls, {key: value for key, value in given.items() if key not in shared_names})
    except ParameterError as error:
        raise ParameterError(f"node '{name}', {where}: {error}") from None
    for part, instance in ((Shared, shared), (cls, own)):
        current = values(instance)
        for field in fields(part):
            node.declare_parameter(field.name, listed(current[field.name]), descriptor(field), ignore_override=True)
    return shared, own


def descriptor(field: Field) -> ParameterDescriptor:
    """Describe a parameter to ROS: meaning, unit, range, whether it may change while running."""
    unit = f" [{field.unit}]" if field.unit else ""
    result = ParameterDescriptor(
        name=field.name,
        description=field.doc + unit,
        additional_constraints=field.allowed,
        read_only=not field.live,
    )
    low, high = max(field.low, -1e308), min(field.high, 1e308)
    if field.kind is float and (low, high) != (-1e308, 1e308):
        result.floating_point_range = [FloatingPointRange(from_value=low, to_value=high, step=0.0)]
    if field.kind is int and abs(field.low) < 2**62 and abs(field.high) < 2**62:
        result.integer_range = [IntegerRange(from_value=int(low), to_value=int(high), step=1)]
    return result


def refusal(node: Node, own: Any, parameters: Iterable[Parameter]) -> str:
    """Why a parameter cannot be set while the node runs, whatever the others are; '' where all can.

    rclpy would name neither its value nor what is allowed.
    """
    live = {field.name: field for field in fields(type(own)) if field.live}
    for parameter in parameters:
        name = parameter.name
        if name in live:
            try:
                checked(live[name], _plain(parameter))
            except ParameterError as error:
                return str(error)
        elif name not in OWN_NAMES:
            shown = f"parameter '{printable(name, 100)}'"
            reason = f"{shown} is chosen at the start" if node.has_parameter(name) else f"unknown {shown}"
            allowed = f"while node {node.get_name()} runs, these may change: {', '.join(sorted(live)) or 'none'}"
            return f"{reason}; {meant(name, live)}{allowed}"
    return ""


def follow(node: Node, own: Any, take: Any, report: Callable[[Mapping[str, Any]], None] = lambda values: None) -> None:
    """Let live parameters change as one set, which is taken or refused as a whole.

    Parameters
    ----------
    own : the present parameter object.
    take : called with the new one; it may raise ParameterError to refuse it.
    report : called with the values that have been taken, by name.
    """
    present = own

    def changed(parameters: list[Parameter]) -> SetParametersResult:
        nonlocal present
        known = values(present)
        given = {parameter.name: _plain(parameter) for parameter in parameters if parameter.name in known}
        try:
            new = build(type(own), {**known, **given})
            if new == present:  # a request that is sent again, as its answer was late, costs nothing
                return SetParametersResult(successful=True)
            take(new)
        except ParameterError as error:
            return SetParametersResult(successful=False, reason=str(error))
        except Exception as error:  # of a node of one's own, which may have taken a part
            take(present)
            reason = f"the node failed while it set the parameters: {raised(error)}"
            return SetParametersResult(successful=False, reason=reason)
        present = new
        report(given)
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(changed)


def _plain(parameter: Parameter) -> Any:
    value = parameter.value
    return tuple(value) if hasattr(value, "__iter__") and not isinstance(value, str) else value
