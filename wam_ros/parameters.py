"""ROS parameters from parameter classes: declared, described, checked as a set."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    ParameterEvent,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_parameter_events

from wam_description.arm import Shared
from wam_description.parameters import Field, ParameterError, build, fields, listed, values
from wam_description.wiring import raised

T = TypeVar("T")
OWN_NAMES = ("use_sim_time", "start_type_description_service")  # what rclpy itself declares


def declare(node: Node, cls: type[T], live: str | None = None) -> tuple[Shared, T]:
    """Declare the shared parameters and those of `cls` with the values given to the node.

    Parameters
    ----------
    live : beginning of the names of shared parameters that this node takes while it runs; the others are
        read-only here, live or not.

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
    if not given:
        raise ParameterError(
            f"node '{node.get_name()}' has no parameters; start it with --ros-args --params-file config/wam.yaml, "
            "or with 'wam node'"
        )
    try:
        shared = build(Shared, {name: value for name, value in given.items() if name in shared_names})
        own = build(cls, {name: value for name, value in given.items() if name not in shared_names})
    except ParameterError as error:
        raise ParameterError(f"node '{node.get_name()}': {error}") from None
    for part, instance in ((Shared, shared), (cls, own)):
        current = values(instance)
        for field in fields(part):
            value = current[field.name]
            is_followed = part is cls or (live is not None and field.name.startswith(live))
            node.declare_parameter(
                field.name,
                Parameter(field.name, value=listed(value)).value,
                descriptor(field._replace(live=field.live and is_followed)),
                ignore_override=True,
            )
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
    if field.kind is float and not field.is_array and (low, high) != (-1e308, 1e308):
        result.floating_point_range = [FloatingPointRange(from_value=low, to_value=high, step=0.0)]
    if field.kind is int and not field.is_array and abs(field.low) < 2**62 and abs(field.high) < 2**62:
        result.integer_range = [IntegerRange(from_value=int(low), to_value=int(high), step=1)]
    return result


def follow(node: Node, own: T, take: Any, prefix: str = "") -> None:
    """Let the live parameters change while the node runs, as a set.

    Parameters
    ----------
    own : the present parameter object.
    take : called with the new parameter object; it may raise ParameterError to refuse the set.
    prefix : what the names of these parameters begin with.
    """
    follow_together(node, [(own, take, prefix)])


def follow_together(
    node: Node, parts: Sequence[tuple[Any, Any, str]], report: Callable[[Mapping[str, Any]], None] = lambda values: None
) -> None:
    """Let live parameters of several parts change as one set: where one part refuses, all of them keep their values.

    Parameters
    ----------
    parts : own, take and prefix of each part, as `follow` takes them.
    report : called with the values that have been taken, by name.
    """
    present = [own for own, _, _ in parts]

    def changed(parameters: list[Parameter]) -> SetParametersResult:
        given = {parameter.name: _plain(parameter) for parameter in parameters}
        before = present.copy()
        try:
            for i, (_, take, prefix) in enumerate(parts):
                present[i] = _updated(present[i], given, prefix, take)
        except ParameterError as error:
            for i, (_, take, _) in enumerate(parts):
                if present[i] is not before[i]:
                    present[i] = before[i]
                    take(before[i])
            return SetParametersResult(successful=False, reason=str(error))
        except Exception as error:  # of a node of one's own: it must not go on with a part of the set
            present[:] = before
            for own, (_, take, _) in zip(before, parts, strict=True):
                take(own)
            return SetParametersResult(successful=False, reason=f"the node failed on it: {raised(error)}")
        if present != before:
            report(given)
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(changed)


def follow_other(
    node: Node,
    other: str,
    group: T,
    take: Any,
    prefix: str,
    refuse: Callable[[str], None],
    report: Callable[[Mapping[str, Any]], None],
) -> None:
    """Take the live changes of shared parameters at another node of the same namespace.

    Parameters
    ----------
    other : name of that node.
    group : the present parameter object.
    take : called with the new parameter object; it may raise ParameterError, though the other node uses it.
    prefix : what the names of these parameters begin with.
    refuse : called with the reason where `take` does not accept what the other node uses.
    report : called with the values that have been taken, by name.
    """
    state = {"group": group}

    def changed(event: ParameterEvent) -> None:
        if event.node != f"{node.get_namespace().rstrip('/')}/{other}":
            return
        given = {found.name: _plain(Parameter.from_parameter_msg(found)) for found in event.changed_parameters}
        present = _updated(state["group"], given, prefix, lambda new: None)
        if present is state["group"]:
            return
        state["group"] = present
        try:
            take(present)
        except ParameterError as error:
            refuse(f"{other} uses {prefix}* that are not accepted here: {error}")
        else:
            report({name: value for name, value in given.items() if name.startswith(prefix)})

    node.create_subscription(ParameterEvent, "/parameter_events", changed, qos_profile_parameter_events)


def _updated(own: T, given: Mapping[str, Any], prefix: str, take: Any) -> T:
    """The parameter object with new values that `take` has accepted; the same one where none of them is of it."""
    known = values(own)
    update = {name.removeprefix(prefix): value for name, value in given.items() if name.startswith(prefix)}
    update = {name: value for name, value in update.items() if name in known}
    if not update:
        return own
    new = build(type(own), {**known, **update})
    if new == own:  # a request that is sent again, as its answer was late, costs nothing
        return own
    take(new)
    return new


def _plain(parameter: Parameter) -> Any:
    value = parameter.value
    return tuple(value) if hasattr(value, "__iter__") and not isinstance(value, str) else value
