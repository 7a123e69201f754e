"""ROS parameters from parameter classes: declared, described, checked as a set."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from wam_bag.printable import printable
from wam_description.agreement import with_facts
from wam_description.arm import Shared
from wam_description.parameters import Field, ParameterError, build, fields, listed, values
from wam_description.signals import NodeStatus
from wam_description.wiring import raised
from wam_ros.limits import NODE_LIMITS

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
    if field.kind is float and (low, high) != (-1e308, 1e308):
        result.floating_point_range = [FloatingPointRange(from_value=low, to_value=high, step=0.0)]
    if field.kind is int and abs(field.low) < 2**62 and abs(field.high) < 2**62:
        result.integer_range = [IntegerRange(from_value=int(low), to_value=int(high), step=1)]
    return result


def follow_together(
    node: Node, parts: Sequence[tuple[Any, Any, str]], report: Callable[[Mapping[str, Any]], None] = lambda values: None
) -> None:
    """Let live parameters of several parts change as one set: where one part refuses, all of them keep their values.

    Parameters
    ----------
    parts : of each part the present parameter object; what is called with the new one, which may raise
        ParameterError to refuse the set; and what the names of its parameters begin with.
    report : called with the values that have been taken, by name.
    """
    present = [own for own, _, _ in parts]

    def changed(parameters: list[Parameter]) -> SetParametersResult:
        given = {parameter.name: _plain(parameter) for parameter in parameters}
        before = present.copy()
        try:
            for i, (_, take, prefix) in enumerate(parts):
                present[i] = _updated(present[i], given, prefix, take)
        except Exception as error:
            is_refused = isinstance(error, ParameterError)  # else of a node of one's own, which may have taken a part
            for i, (_, take, _) in enumerate(parts):
                if present[i] is not before[i] or not is_refused:
                    take(before[i])
            present[:] = before
            reason = str(error) if is_refused else f"the node failed while it set the parameters: {raised(error)}"
            return SetParametersResult(successful=False, reason=reason)
        if present != before:
            report(given)
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(changed)


class Follower:
    """Takes live values of shared parameters from the status of another node.

    Parameters
    ----------
    other : name of that node.
    name : of the group of these parameters.
    group : the present parameter object.
    take : called with the new parameter object; it may raise ParameterError, though the other node uses it.
    refuse : called with the reason why the other node's values are not in use here, with '' where they are.
    report : called with the values that have been taken, by name.

    Attributes
    ----------
    other : name of the other node.
    has_heard : whether any status of it has come.
    """

    def __init__(
        self,
        other: str,
        name: str,
        group: Any,
        take: Callable[[Any], None],
        refuse: Callable[[str], None],
        report: Callable[[Mapping[str, Any]], None],
    ) -> None:
        self.other, self._name, self._used, self._take = other, name, group, take
        self._heard, self._problem, self.has_heard = group, "", False
        self._refuse, self._report = refuse, report

    def hear(self, status: NodeStatus) -> None:
        """Take the values in the status of a node, where they are new; that of any other node is ignored."""
        if status.node != self.other:
            return
        self.has_heard = True
        try:
            heard = with_facts(self._heard, f"{self._name}.", status.facts)
        except ParameterError as error:  # no node of ours reports such values
            self._refuse(f"{self.other} reports {self._name}.* that cannot be read: {_why(error)}")
            return
        if heard != self._heard:
            self._heard = heard
            self.settle()
        self._refuse(self._problem)

    def settle(self) -> None:
        """Take the values that the other node uses, where this one does not use them yet."""
        self._problem = ""
        if self._heard != self._used:
            try:
                self._take(self._heard)
            except Exception as error:
                if not isinstance(error, ParameterError):  # of a node of one's own, which may have taken a part
                    self._used = None
                self._problem = f"{self.other} uses {self._name}.* that are not accepted here: {_why(error)}"
            else:
                before = values(self._used) if self._used is not None else {}
                self._used, present = self._heard, values(self._heard)
                self._report({f"{self._name}.{key}": v for key, v in present.items() if before.get(key) != v})
        self._refuse(self._problem)


def _why(error: Exception) -> str:
    return printable(str(error) if isinstance(error, ParameterError) else raised(error), NODE_LIMITS.reason_length)


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
