"""Arguments of the formulas as arrays, checked for their range."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def above_zero(**arguments: ArrayLike) -> list[Array]:
    """Arguments of a formula as arrays, each above zero.

    Raises
    ------
    ValueError
        if one is not finite and above zero; the error names it.
    """
    return _checked(arguments, lambda a: a > 0.0, "above zero")


def zero_or_more(**arguments: ArrayLike) -> list[Array]:
    """Arguments of a formula as arrays, each zero or more.

    Raises
    ------
    ValueError
        if one is not finite or below zero.
    """
    return _checked(arguments, lambda a: a >= 0.0, "zero or more")


def finite(**arguments: ArrayLike) -> list[Array]:
    """Arguments of a formula as arrays, each finite.

    Raises
    ------
    ValueError
        if one is not finite.
    """
    return _checked(arguments, np.isfinite, "a number")


def _checked(arguments: dict[str, ArrayLike], allowed: Callable[[Array], NDArray[np.bool_]], what: str) -> list[Array]:
    arrays = []
    for name, value in arguments.items():
        array = np.asarray(value, dtype=float)
        if not np.all(np.isfinite(array) & allowed(array)):
            raise ValueError(f"{name} is {value!r}; it must be finite and {what}")
        arrays.append(array)
    return arrays
