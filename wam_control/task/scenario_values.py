"""Values of a scenario file, each refused with the step, the key and what is allowed."""

from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any

from wam_description.arm import Arm
from wam_description.number_text import as_number
from wam_description.parameters import ParameterError, is_finite, require
from wam_description.signals import BASE, Triple


def known(where: str, body: Any, allowed: Sequence[str], needed: Sequence[str]) -> None:
    """Refuse what is no mapping with these keys."""
    if not isinstance(body, Mapping):
        raise ParameterError(f"{where} is {body!r}; it must be a mapping with {', '.join(needed)}")
    for key in body:
        require(key in allowed, f"{where}: unknown key '{key}'; allowed: {', '.join(allowed)}")
    for key in needed:
        require(key in body, f"{where}: '{key}' is missing")


def number(where: str, key: str, value: Any) -> float:
    """A finite number."""
    is_number = isinstance(value, Real) and not isinstance(value, bool)
    if not is_number or not is_finite(value):
        raise ParameterError(f"{where}: {key} is {value!r}; it must be a finite number{as_number(value)}")
    return float(value)


def numbers(where: str, key: str, value: Any, length: int) -> tuple[float, ...]:
    """A list of finite numbers."""
    require_list(where, key, value, f"{length} numbers")
    require(len(value) == length, f"{where}: {key} is {value!r}; it must be a list of {length} numbers")
    return tuple(number(where, key, element) for element in value)


def triple(where: str, key: str, value: Any) -> Triple:
    """A list of three finite numbers."""
    x, y, z = numbers(where, key, value, 3)
    return x, y, z


def frame(where: str, value: Any, arm: Arm, more: str = "") -> str:
    """The name of a frame in which the world is pressed."""
    frames = (BASE, *arm.covers.names)
    require(is_one_of(value, frames), f"{where}: frame is {value!r}; allowed: {', '.join(frames)}{more}")
    return str(value)


def plain(value: Any) -> Any:
    """The same with floats and tuples in place of other numbers and lists; compiled code takes no others."""
    if isinstance(value, (list, tuple)):
        found = map(plain, value)
        return type(value)(*found) if hasattr(value, "_fields") else tuple(found)
    return float(value) if isinstance(value, Real) else value


def require_made(where: str, key: str, value: Any, kind: Any) -> None:
    """Refuse what is no named tuple of this class; of a step that is made in Python."""
    require(isinstance(value, kind), f"{where}: {key} is {value!r}; give a {kind.__name__}({', '.join(kind._fields)})")


def is_one_of(value: Any, allowed: Sequence[str]) -> bool:
    """Whether it is one of these texts; an array, whose truth is unknown, is none."""
    return isinstance(value, str) and value in allowed


def require_list(where: str, key: str, value: Any, content: str) -> None:
    """Refuse what is no list or tuple; an array, whose truth is unknown, with what makes a list of it."""
    advice = "; give its tolist()" if hasattr(value, "tolist") else ""
    require(isinstance(value, (list, tuple)), f"{where}: {key} is {value!r}; it must be a list of {content}{advice}")
