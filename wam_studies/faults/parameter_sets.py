"""Parameter sets for every node: refused ones change nothing, accepted ones leave an arm that is stable.

A set is in and out of range, of wrong types, of unknown types, in part good and in part not.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from random import Random
from typing import Any, Final, NamedTuple

from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParametersAtomically

from wam_description.arm import Shared
from wam_description.interface import declared
from wam_description.parameters import Field, fields
from wam_description.signals import ZERO
from wam_studies.faults.trials import FAULTS, KEPT, FaultCase, FaultTrial
from wam_studies.faults.watched_stack import WatchedStack, watched_trial

# type codes of rcl_interfaces/ParameterType by the type of the value; that of an array is greater by 5
CODES: Final = {bool: 1, int: 2, float: 3, str: 4}
OF_ARRAY: Final = 5
UNKNOWN_CODES: Final = (10, 11, 77, 200, 255)
UNKNOWN_NAMES: Final = ("x", "x" * 2000, "timing.", "\x1b[2J", "qos_overrides")
EXTREMES: Final[dict[type, tuple[Any, ...]]] = {
    bool: (True, False),
    int: (-(2**63), 2**63 - 1, 0, -1),
    float: (math.nan, math.inf, -math.inf, 1.7e308, -1.7e308, 5e-324, -1.0, 1e9),
    str: ("", "x" * 5000, "\x1b[2J", "\U0001f9be", "nan"),
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
    assignments: Sequence[Assignment]
    is_wrong: bool


def parameter_set(fields: Sequence[Field], present: Mapping[str, Any], chance: Random) -> ParameterSet:
    """A set for a node, drawn at random: one of each kind, of which one is taken.

    Parameters
    ----------
    fields : parameters of the node; at least one.
    present : their values.
    chance : seeded.
    """
    live = [field for field in fields if field.live]
    field = chance.choice(live if live and chance.random() < 0.8 else fields)
    value, near = present[field.name], [_scaled(one, present[one.name], chance) for one in live]
    others = [one for one in chance.sample(near, min(len(near), 3)) if one.name != field.name]
    kind = chance.choice([kind for kind in CODES if kind is not field.kind])
    other, is_array = chance.choice(EXTREMES[kind]), chance.random() < 0.5
    extreme, some = _extreme(field, value, chance), chance.sample(near, chance.randint(min(1, len(near)), len(near)))

    def among(name: str, code: int, value: Any) -> list[Assignment]:
        return chance.sample(found := [*others, Assignment(name, code, value)], len(found))

    sets = {
        "values near the present ones": (some, False),
        "no parameter": ([], False),
        "one name twice": ([_scaled(field, value, chance) for _ in range(2)], False),
        "an unknown type code": (among(field.name, chance.choice(UNKNOWN_CODES), value), True),
        "another type": (among(field.name, CODES[kind] + OF_ARRAY * is_array, [other] if is_array else other), True),
        "an unknown name": (among(chance.choice(UNKNOWN_NAMES), CODES[float], 1.0), True),
        "an extreme value": (among(*extreme), not field.live or _is_outside(field, extreme.value)),
    }
    if field.is_array:
        values = list(value)
        lengths = [[], values[:-1], [*values, *values[:1]], values * 1000]
        sets["an array of another length"] = (among(field.name, _code(field), chance.choice(lengths)), False)
    name = chance.choice(list(sets))
    return ParameterSet(name, *sets[name])


def _code(field: Field) -> int:
    return CODES[field.kind] + OF_ARRAY * field.is_array


def _scaled(field: Field, value: Any, chance: Random) -> Assignment:
    """A value between a fifth and five times the present one, each number of an array by itself."""

    def scaled(one: Any) -> Any:
        if field.kind is int:
            return max(0, one + chance.choice([-1, 0, 1, 5]))
        return one * 5.0 ** chance.uniform(-1.0, 1.0) if field.kind is float else not one if field.kind is bool else one

    return Assignment(field.name, _code(field), list(map(scaled, value)) if field.is_array else scaled(value))


def _extreme(field: Field, value: Any, chance: Random) -> Assignment:
    extreme = chance.choice(EXTREMES[field.kind])
    if field.is_array:
        values = list(value) or [extreme]
        values[chance.randrange(len(values))] = extreme
        extreme = values
    return Assignment(field.name, _code(field), extreme)


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
    todo = parameter_set(_fields(stack, name), _present(stack, name), case.chance)
    trial = watched_trial(case, f"{name}, {todo.name}", partial(_try, name, todo))
    if trial.escapes:
        KEPT.discard()  # its parameters may have changed
    return trial


def _fields(stack: WatchedStack, name: str) -> list[Field]:
    """Parameters of a node."""
    found = (*fields(declared(name).parameter_class), *fields(Shared))
    return [one for one in found if stack.nodes[name].has_parameter(one.name)]


def _present(stack: WatchedStack, name: str) -> dict[str, Any]:
    values = {one: stack.nodes[name].get_parameter(one.name).value for one in _fields(stack, name)}
    return {one.name: list(value) if one.is_array else value for one, value in values.items()}


def _try(name: str, todo: ParameterSet, stack: WatchedStack) -> int:
    """Send the set; what is wrong goes to the escapes of the stack."""
    before = _present(stack, name)
    client = stack.client(SetParametersAtomically, f"{name}/set_parameters_atomically")

    def answer(assignments: Iterable[Assignment]) -> Any:
        request = SetParametersAtomically.Request(parameters=list(map(message, assignments)))
        found = stack.answer(client, request, FAULTS.answered, FAULTS.answered)
        return found and found.result

    answered = answer(todo.assignments)
    if not answered:
        stack.escapes.append("no answer to the set")
        return 1
    after = _present(stack, name)
    changed = [key for key in before if repr(before[key]) != repr(after[key])]
    for escape, holds in {
        f"refused, but {changed} has changed": changed and not answered.successful,
        f"accepted: {str(todo.assignments)[-200:]}": answered.successful and todo.is_wrong,
        "refused without a reason": not answered.successful and not answered.reason,
    }.items():
        if holds:
            stack.escapes.append(escape)
    if answered.successful and changed:
        _push(stack)
        back = [one._replace(value=before[one.name]) for one in todo.assignments if one.name in changed]
        undone = answer(back)
        if not (undone and undone.successful):
            stack.escapes.append("the values before are refused")
    stack.run(0.005)
    return 1


def _push(stack: WatchedStack) -> None:
    """A small push: with parameters that are accepted the arm stays slow and enabled."""
    plant = stack.driver.plant
    plant.push(stack.cover, (0.0, FAULTS.push, 0.0), ZERO)
    stack.run(FAULTS.pushed)
    plant.release()
    stack.run(FAULTS.settling)
    speed = max(abs(v) for v in plant.qd)
    if speed > FAULTS.fast or stack.driver.safety.fault:
        stack.escapes.append(
            f"accepted, then unstable: {speed:.1f} rad/s after a push of {FAULTS.push:g} N {stack.driver.safety.fault}"
        )
