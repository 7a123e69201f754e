"""Parameter sets for every node: refused ones change nothing, accepted ones leave an arm that is stable."""

from functools import partial
from random import Random
from typing import Any, Final

import numpy as np
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParametersAtomically

from wam_description.arm import Shared
from wam_description.interface import declared
from wam_description.parameters import Field, fields
from wam_studies.faults.parameter_faults import (
    BOOL,
    DOUBLE,
    INTEGER,
    STRING,
    Assignment,
    ParameterSet,
    parameter_set,
)
from wam_studies.faults.trials import FAULTS, KEPT, FaultCase, FaultTrial
from wam_studies.faults.watched_stack import WatchedStack, watched_trial

FIELDS: Final = {
    BOOL: "bool_value", INTEGER: "integer_value", DOUBLE: "double_value", STRING: "string_value",
    6: "bool_array_value", 7: "integer_array_value", 8: "double_array_value", 9: "string_array_value",
}  # fmt: skip


def message(assignment: Assignment) -> Parameter:
    """A parameter as ROS sends it."""
    value = ParameterValue(type=assignment.code)
    if field := FIELDS.get(assignment.code):
        setattr(value, field, assignment.value)
    return Parameter(name=assignment.name, value=value)


def play(case: FaultCase) -> FaultTrial:
    """A trial of one set."""
    stack: WatchedStack = KEPT.ready(WatchedStack, case.configuration)
    name = sorted(stack.nodes)[case.number % len(stack.nodes)]
    chance = Random(f"parameters {case.seed} {case.number}")
    todo = parameter_set(_fields(stack, name), _present(stack, name), chance)
    trial = watched_trial(case, f"{name}, {todo.name}", partial(_try, name, todo))
    if trial.escapes:
        KEPT.discard()  # its parameters may have changed
    return trial


def _fields(stack: WatchedStack, name: str) -> list[Field]:
    """Parameters of a node; only its own are live there, apart from a shared group that it owns."""
    declaration = declared(name)
    owned = getattr(declaration.node, "owns", None)
    own = list(fields(declaration.parameter_class))
    shared = [
        one._replace(live=one.live and owned is not None and one.name.startswith(f"{owned}.")) for one in fields(Shared)
    ]
    return [one for one in (*own, *shared) if stack.nodes[name].has_parameter(one.name)]


def _present(stack: WatchedStack, name: str) -> dict[str, Any]:
    node = stack.nodes[name]
    found = {one.name: node.get_parameter(one.name).value for one in _fields(stack, name)}
    return {key: list(value) if hasattr(value, "__iter__") and not isinstance(value, str) else value
            for key, value in found.items()}  # fmt: skip


def _try(name: str, todo: ParameterSet, stack: WatchedStack) -> int:
    """Send the set; what is wrong goes to the escapes of the stack."""
    before = _present(stack, name)
    client = stack.client(SetParametersAtomically, f"{name}/set_parameters_atomically")
    stack.wait(client.service_is_ready, 2.0)
    answer = _answer(stack, client, [message(one) for one in todo.assignments])
    if answer is None:
        stack.escapes.append("no answer to the set")
        return 1
    after = _present(stack, name)
    changed = [key for key in before if not _same(before[key], after[key])]
    if not answer.successful and changed:
        stack.escapes.append(f"refused, but {changed[0]} has changed")
    if answer.successful and todo.is_wrong:
        stack.escapes.append(f"accepted: {str(todo.assignments)[-200:]}")
    if not answer.successful and not answer.reason:
        stack.escapes.append("refused without a reason")
    if answer.successful and changed:
        _push(stack)
        kinds = {one.name: one for one in todo.assignments}
        back = [message(kinds[key]._replace(value=before[key])) for key in changed if key in kinds]
        undone = _answer(stack, client, back)
        if undone is None or not undone.successful:
            stack.escapes.append("the values before are refused")
    stack.run(0.005)
    return 1


def _answer(stack: WatchedStack, client: Any, parameters: list[Parameter]) -> Any:
    future = client.call_async(SetParametersAtomically.Request(parameters=parameters))
    return future.result().result if stack.wait(future.done, 3.0) else None


def _push(stack: WatchedStack) -> None:
    """A small push: with parameters that are accepted the arm stays slow and enabled."""
    plant = stack.driver.plant
    plant.push(stack.cover, np.array([0.0, FAULTS.push, 0.0]), np.zeros(3))
    stack.run(FAULTS.pushed)
    plant.release()
    stack.run(FAULTS.settling)
    speed = max(abs(v) for v in plant.qd)
    if speed > FAULTS.fast or stack.driver.safety.fault:
        stack.escapes.append(
            f"accepted, then unstable: {speed:.1f} rad/s after a push of {FAULTS.push:g} N {stack.driver.safety.fault}"
        )


def _same(a: Any, b: Any) -> bool:
    return bool(a == b) or repr(a) == repr(b)
