"""Parameters as data: frozen dataclasses that carry unit, range and meaning of every field.

A parameter class alone defines what a parameter means; its value is in one YAML file in ``config/`` and
nowhere else.  The same classes check the values, describe the parameters to ROS and fill
``docs/parameters.md``.
"""

import dataclasses
import difflib
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from functools import cache
from types import SimpleNamespace
from typing import Any, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

from wam_description.number_text import as_number

T = TypeVar("T")
Value = bool | int | float | str | tuple[Any, ...]
SINGULAR = {
    f"{name}s": name
    for name in (
        "name",
        "shape",
        "size",
        "position",
        "rotation",
        "cover",
        "angle",
        "joint",
        "link",
        "obstacle",
        "shaft",
    )
}  # of the names of lists


class ParameterError(ValueError):
    """A parameter set that is refused as a whole; the message names the parameter."""


class Field(NamedTuple):
    """One parameter: its dotted name, its Python type and its declaration."""

    name: str
    kind: type
    is_array: bool
    doc: str
    unit: str
    low: float
    high: float
    choices: tuple[str, ...]
    live: bool
    width: int
    is_common: bool
    length: int
    default: Value | None
    follows: str

    @property
    def is_required(self) -> bool:
        """Whether every configuration has to give its value."""
        return self.default is None and not self.follows

    @property
    def allowed(self) -> str:
        """The allowed values in words, empty if every value of the type is allowed."""
        if self.choices:
            return "one of " + ", ".join(self.choices)
        if self.kind in (str, bool):
            return ""
        return f"{self.low:g} to {self.high:g}"


def parameter(
    doc: str,
    unit: str = "",
    low: float = 0.0,
    high: float = 1e9,
    *,
    within: float = 0.0,
    choices: tuple[str, ...] = (),
    live: bool = False,
    width: int = 1,
    is_common: bool = False,
    length: int = 0,
    default: Value | None = None,
    follows: str = "",
) -> Any:
    """Declare a field of a parameter class.  One that every configuration has to give has no `default`.

    Parameters
    ----------
    doc : what the parameter is, one sentence.
    unit : SI unit, empty for pure numbers and names.
    low, high : inclusive range of each number.
    within : largest size of numbers of both signs, in place of that range.
    choices : allowed strings.
    live : True if a running node may take a new value; of every field of a class whose `are_live` is true it may.
    width : number of values of a list for each name that it runs over, which `aligned` checks.
    is_common : whether a single value of a list counts for all.
    length : number of values of a list that runs over no names; 0 for any.
    default : the value where a configuration gives none.  The field is then an argument by keyword, so it can be
        anywhere in its class.
    follows : name of the parameter whose value it has where a configuration gives none; `like` sets it.
    """
    metadata = locals()  # the arguments
    if metadata.pop("within"):
        metadata |= {"low": -within, "high": within}
    if default is None:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=default, kw_only=True, metadata=metadata)


def like(cls: type, name: str, doc: str = "") -> Any:
    """Declare a field that has unit, range and, where a configuration gives none, the value of another parameter.

    Parameters
    ----------
    cls : class of the other parameter.
    name : its name in the section, as 'arm.links.mass'.
    doc : what the field is, where that is another sentence.
    """
    other = next(field for field in fields(cls) if field.name == name.rpartition(".")[2])
    return parameter(doc or other.doc, other.unit, other.low, other.high, width=other.width, follows=name)


_hints: Callable[[type], dict[str, Any]] = cache(get_type_hints)


def fields(cls: type) -> tuple[Field, ...]:
    """Every parameter of a class, nested classes as dotted names, in order of declaration."""
    return _fields(cls)


@cache
def _fields(cls: type) -> tuple[Field, ...]:
    hints, found = _hints(cls), list[Field]()
    for item in dataclasses.fields(cls):
        hint = hints[item.name]
        if isinstance(hint, type) and dataclasses.is_dataclass(hint):
            found += [field._replace(name=f"{item.name}.{field.name}") for field in fields(hint)]
        else:
            is_array = get_origin(hint) is tuple
            found.append(Field(item.name, get_args(hint)[0] if is_array else hint, is_array, **item.metadata))
    are_live = getattr(cls, "are_live", False)
    return tuple(field._replace(live=field.live or are_live) for field in found)


def meant(name: str, known: Iterable[str]) -> str:
    """A question after the known name that is most like a wrong one, to begin a clause with; '' if none is."""
    near = difflib.get_close_matches(name, known, n=1)
    return f"did you mean '{near[0]}'? " if near else ""


def dotted(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted names, as ROS has them, and values of a nested mapping, each as it is given; an empty group is a value."""
    for key, value in tree.items():
        if isinstance(value, Mapping) and value:
            yield from dotted(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value


def given_once(where: str, tree: Mapping[str, Any]) -> dict[str, Any]:
    """A nested mapping as a flat one with dotted names; refused where a name is given twice, or a group is empty.

    Raises
    ------
    ParameterError
        begins with `where`: file and section, or step.
    """
    found: dict[str, Any] = {}
    for name, value in dotted(tree):
        require(name not in found, f"{where}: '{name}' is given twice, with dots and without; remove one")
        require(not isinstance(value, Mapping), f"{where}: '{name}' is empty; give it a value, or leave it out")
        found[name] = value
    return found


def nested(flat: Mapping[str, Any]) -> dict[str, Any]:
    """A flat mapping with dotted names as a nested one; the inverse of `dotted`."""
    tree: dict[str, Any] = {}
    for name, value in flat.items():
        *groups, leaf = name.split(".")
        branch = tree
        for group in groups:
            branch = branch.setdefault(group, {})
        branch[leaf] = value
    return tree


def listed(value: Any) -> Any:
    """A value as ROS and YAML carry it, where a tuple is a list."""
    return list(value) if isinstance(value, tuple) else value


def values(instance: Any) -> dict[str, Value]:
    """The flat ``{dotted name: value}`` of a parameter object; the inverse of `build`."""
    return dict(dotted(dataclasses.asdict(instance)))


def build(cls: type[T], flat: Mapping[str, Any]) -> T:
    """Make a parameter object from flat names and values, or refuse the set as a whole.

    Raises
    ------
    ParameterError
        names every missing and unknown parameter, or the first value that is not allowed.
    """
    known = {field.name: field for field in fields(cls)}
    # a parameter that follows one which is missing has no value either
    defaults = {name: flat.get(field.follows, field.default) for name, field in known.items()}
    flat = {**{name: value for name, value in defaults.items() if value is not None}, **flat}
    missing = [name for name in known if name not in flat]
    unknown = [name for name in flat if name not in known]
    if missing or unknown:
        parts = [f"missing parameter '{name}'" for name in missing]
        parts += [f"unknown parameter '{name}'" for name in unknown]
        parts += ["docs/parameters.md lists what there is"] * cls.__module__.startswith("wam_")
        raise ParameterError("; ".join(parts))
    return _assemble(cls, nested({name: checked(field, flat[name]) for name, field in known.items()}))


def build_part(cls: type[T], flat: Mapping[str, Any], prefix: str = "") -> T:
    """Make a parameter object from its part of flat names and values, which also hold other parameters.

    Parameters
    ----------
    cls : parameter class.
    flat : values by name, as those of a node.
    prefix : of its names there, as 'world.'; without one, names that it does not know belong to others.

    Raises
    ------
    ParameterError
        as `build`.
    """
    if prefix:
        return build(cls, {key.removeprefix(prefix): value for key, value in flat.items() if key.startswith(prefix)})
    known = {field.name for field in fields(cls)}
    return build(cls, {key: value for key, value in flat.items() if key in known})


def _assemble(cls: type[T], tree: Mapping[str, Any]) -> T:
    hints = _hints(cls)
    return cls(
        **{key: _assemble(hints[key], value) if isinstance(value, dict) else value for key, value in tree.items()}
    )


def checked(field: Field, value: Any) -> Value:
    """A value of a parameter in its type, or a refusal of what is none, or out of range.

    Raises
    ------
    ParameterError
        names the parameter, the value and what is allowed.
    """
    if field.is_array:
        if isinstance(value, (str, bytes, bytearray, memoryview, Mapping, Set)) or not hasattr(value, "__iter__"):
            raise ParameterError(
                f"parameter '{field.name}' is {value!r}; it must be a list of {field.kind.__name__}{as_number(value)}"
            )
        if field.length and len(value) != field.length:
            raise ParameterError(f"parameter '{field.name}' has {len(value)} values; it needs {field.length}")
        return tuple(_checked_scalar(field, element) for element in value)
    return _checked_scalar(field, value)


def _checked_scalar(field: Field, value: Any) -> bool | int | float | str:
    def refuse(allowed: str) -> ParameterError:
        unit = f" {field.unit}" if field.unit else ""
        return ParameterError(f"parameter '{field.name}' is {value!r}{unit}; allowed: {allowed}")

    if field.kind is str or field.kind is bool:
        if not isinstance(value, field.kind):
            raise refuse(
                "true, false"
                if field.kind is bool
                else f"{field.allowed or 'a text'}, in quotes, in a shell as \"'a'\""
            )
        if field.choices and value not in field.choices:
            raise refuse(field.allowed)
        return value
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise refuse(f"a number{as_number(value)}")
    if field.kind is int and is_finite(value) and value != int(value):
        raise refuse("a whole number")
    if not is_finite(value) or not field.low <= value <= field.high:
        raise refuse(field.allowed)
    return field.kind(value)


def is_finite(value: float) -> bool:
    """Whether a number is finite, as a float also where it is an int of hundreds of digits."""
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def require(condition: bool, message: str) -> None:
    """Refuse a parameter set whose values do not fit each other."""
    if not condition:
        raise ParameterError(message)


def require_fit(own: Any, arm: Any) -> None:
    """Refuse parameters that do not fit an arm, by their class and by classes nested in it.

    A class may have a method `require_fit`.  It may have `aligned_with` if its lists are `aligned` with the names of a
    part of the arm: its dotted name, for the message, and that part.

    Raises
    ------
    ParameterError
        names all that is wrong.
    """
    refusals = list(_misfits(own, arm))
    require(not refusals, "; ".join(refusals))


def _misfits(own: Any, arm: Any) -> Iterator[str]:
    for item in dataclasses.fields(own):
        value = getattr(own, item.name)
        if dataclasses.is_dataclass(value):
            yield from _misfits(value, arm)
    try:
        if group_and_part := getattr(own, "aligned_with", ()):
            group, part = group_and_part
            aligned(group, getattr(arm, part).names, own)
        getattr(own, "require_fit", lambda arm: None)(arm)
    except ParameterError as error:
        yield str(error)


def lengths(group: str, names: Sequence[Any], arrays: Mapping[str, Sequence[Any]], width: int = 1) -> None:
    """Refuse arrays that do not have `width` values for each of the names.

    Parameters
    ----------
    group : dotted name of the parameter class, for the message.
    names : what the arrays run over.
    arrays : arrays by the name of their field.
    """
    _require_lengths(group, ((name, array, width * len(names), False) for name, array in arrays.items()))


def aligned(group: str, names: Sequence[Any], given: Any) -> None:
    """Refuse the lists of a parameter object that do not have as many values for each of the names as they declare.

    Parameters
    ----------
    group : dotted name of its class, for the message.
    names : what all of its lists run over.
    given : the object.
    """
    lists = ((name, array, one["width"] * len(names), one["is_common"]) for name, array, one in _lists(given))
    _require_lengths(group, lists)


def _require_lengths(group: str, lists: Iterable[tuple[str, Sequence[Any], int, bool]]) -> None:
    """Refuse lists, each with its name, of another length than needed; one value is enough where that is common."""
    wrong = [
        f"parameter '{group}.{name}' has {len(array)} values; it needs {'1 or ' * is_common}{needed}"
        for name, array, needed, is_common in lists
        if len(array) not in (needed, 1 if is_common else needed)
    ]
    require(not wrong, "; ".join(wrong))


def each(array: tuple[T, ...], count: int) -> tuple[T, ...]:
    """A list with one value for each of `count`, from one that has them or a single value for all."""
    return array * count if len(array) == 1 else array


def named(group: str, given: Any, least: int = 0) -> None:
    """Refuse lists that are not `aligned` with the first one, and in that one too few, empty or equal names."""
    (key, names, _), *_ = _lists(given)
    require(len(names) >= least, f"parameter '{group}.{key}' is empty; name at least one")
    require(
        "" not in names and len(set(names)) == len(names),
        f"parameter '{group}.{key}' is {', '.join(map(repr, names))}; give each a name of its own",
    )
    aligned(group, names, given)


def empty(cls: type[T]) -> T:
    """A parameter object of lists that run over nothing."""
    return cls(*[()] * len(fields(cls)))


def rows(given: Any) -> list[Any]:
    """What the lists of a parameter object run over, each with its own values: `name` of `names`, `size` of `sizes`."""
    lists = [(SINGULAR.get(name, name), array, declared["width"]) for name, array, declared in _lists(given)]
    count = len(lists[0][1])
    return [
        SimpleNamespace(
            **{name: array[i] if width == 1 else array[width * i : width * (i + 1)] for name, array, width in lists}
        )
        for i in range(count)
    ]


def _lists(given: Any) -> Iterator[tuple[str, tuple[Any, ...], Mapping[str, Any]]]:
    """Name, values and declaration of each list of a parameter object."""
    for item in dataclasses.fields(given):
        value = getattr(given, item.name)
        if isinstance(value, tuple):
            yield item.name, value, item.metadata


@dataclasses.dataclass(frozen=True)
class Nothing:
    """The parameters of a node that has none of its own."""
