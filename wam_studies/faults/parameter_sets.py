"""Parameter sets for every node: refused ones change nothing, accepted ones leave an arm that is stable.

A set is in and out of range, of wrong types, of unknown types, in part good and in part not.
"""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from random import Random
from typing import Any, Final, NamedTuple

import numpy as np
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParametersAtomically

from wam_description.arm import Shared
from wam_description.interface import declared
from wam_description.parameters import Field, fields
from wam_studies.faults.trials import FAULTS, KEPT, FaultCase, FaultTrial
from wam_studies.faults.watched_stack import WatchedStack, watched_trial

# type codes of rcl_interfaces/ParameterType
BOOL, INTEGER, DOUBLE, STRING = 1, 2, 3, 4
ARRAYS: Final = {BOOL: 6, INTEGER: 7, DOUBLE: 8, STRING: 9}
CODES: Final = {bool: BOOL, int: INTEGER, float: DOUBLE, str: STRING}
UNKNOWN_CODES: Final = (10, 11, 77, 200, 255)
EXTREMES: Final = {
    BOOL: (True, False),
    INTEGER: (-(2**63), 2**63 - 1, 0, -1),
    DOUBLE: (math.nan, math.inf, -math.inf, 1.7e308, -1.7e308, 5e-324, -1.0, 1e9),
    STRING: ("", "x" * 5000, "\x1b[2J", "\U0001f9be", "nan"),
}


class Assignment(NamedTuple):
    """A parameter, the type code and the value that are sent; the code need not fit the value."""

    name: str
    code: int
    value: Any


class ParameterSet(NamedTuple):
    """A set to be taken or refused as a whole.

    Attributes
    ----------
    name : what is wrong with it, in words.
    assignments : of the set.
    is_wrong : whether it has to be refused; else it may be.
    """

    name: str
    assignments: tuple[Assignment, ...]
    is_wrong: bool


def parameter_set(fields: Sequence[Field], present: Mapping[str, Any], chance: Random) -> ParameterSet:
    """A set for a node, drawn at random.

    Parameters
    ----------
    fields : parameters of the node; at least one.
    present : their values.
    chance : seeded.
    """
    live = [field for field in fields if field.live]
    field = chance.choice(live if live and chance.random() < 0.8 else fields)
    good = [_scaled(one, present[one.name], chance) for one in chance.sample(live, min(len(live), chance.randrange(4)))]
    way = chance.randrange(8)
    if way == 0 and live:
        many = chance.sample(live, chance.randrange(1, len(live) + 1))
        near = tuple(_scaled(one, present[one.name], chance) for one in many)
        return ParameterSet("values near the present ones", near, False)
    if way == 1:
        return ParameterSet("no parameter", (), False)
    value = present[field.name]
    if way == 6:
        twice = tuple(_scaled(field, value, chance) for _ in range(2))
        return ParameterSet("one name twice", twice, False)
    name, bad, is_wrong = _bad(way, field, value, chance)
    others = [one for one in good if one.name != bad.name]
    others.insert(chance.randrange(len(others) + 1), bad)
    return ParameterSet(name, tuple(others), is_wrong)


def _bad(way: int, field: Field, value: Any, chance: Random) -> tuple[str, Assignment, bool]:
    """What is wrong with an assignment, in words; the assignment; whether it has to be refused."""
    if way == 2:
        return "an unknown type code", Assignment(field.name, chance.choice(UNKNOWN_CODES), value), True
    if way == 3:
        kind = chance.choice([kind for kind in CODES.values() if kind != CODES[field.kind]])
        code = ARRAYS[kind] if chance.random() < 0.5 else kind
        other = chance.choice(EXTREMES[kind])
        return "another type", Assignment(field.name, code, [other] if code != kind else other), True
    if way == 4:
        name = chance.choice(["x", "x" * 2000, f"{field.name}.", "\x1b[2J", "qos_overrides"])
        return "an unknown name", Assignment(name, DOUBLE, 1.0), True
    if way == 5 and field.is_array:
        values = list(value)
        values = chance.choice([[], values[:-1], [*values, *values[:1]], values * 1000])
        return "an array of another length", Assignment(field.name, ARRAYS[CODES[field.kind]], values), False
    extreme = _extreme(field, value, chance)
    return "an extreme value", extreme, not field.live or _is_outside(field, extreme.value)


def _code(field: Field) -> int:
    return ARRAYS[CODES[field.kind]] if field.is_array else CODES[field.kind]


def _scaled(field: Field, value: Any, chance: Random) -> Assignment:
    """A value between a fifth and five times the present one."""

    def scaled(one: Any) -> Any:
        if field.kind is float:
            return one * 5.0 ** chance.uniform(-1.0, 1.0)
        if field.kind is int and not isinstance(one, bool):
            return max(0, one + chance.choice([-1, 0, 1, 5]))
        return not one if field.kind is bool else one

    return Assignment(field.name, _code(field), [scaled(one) for one in value] if field.is_array else scaled(value))


def _extreme(field: Field, value: Any, chance: Random) -> Assignment:
    extreme = chance.choice(EXTREMES[CODES[field.kind]])
    if not field.is_array:
        return Assignment(field.name, _code(field), extreme)
    values = list(value) or [extreme]
    values[chance.randrange(len(values))] = extreme
    return Assignment(field.name, _code(field), values)


def _is_outside(field: Field, value: Any) -> bool:
    values = value if isinstance(value, list) else [value]
    if field.choices:
        return any(one not in field.choices for one in values)
    return field.kind in (int, float) and any(not field.low <= one <= field.high or math.isinf(one) for one in values)


# tried on the nodes

FIELDS: Final = list(ParameterValue.get_fields_and_field_types())  # of values, by type code


def message(assignment: Assignment) -> Parameter:
    """A parameter as ROS sends it."""
    value = ParameterValue(type=assignment.code)
    if assignment.code < len(FIELDS):
        setattr(value, FIELDS[assignment.code], assignment.value)
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
    changed = [key for key in before if before[key] != after[key] and repr(before[key]) != repr(after[key])]
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
