"""Arguments of the formulas as arrays, checked for their range, and quotients that may be infinite."""

import math
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


def quotient(numerator: ArrayLike, denominator: ArrayLike, otherwise: float = math.inf) -> Array:
    """Quotient of arrays or numbers.

    Parameters
    ----------
    numerator, denominator : of any shape that broadcasts.
    otherwise : what the quotient is where the denominator is not above zero.
    """
    above, below = np.broadcast_arrays(numerator, denominator)
    return np.divide(above, below, out=np.full(below.shape, otherwise), where=below > 0.0)


def _checked(arguments: dict[str, ArrayLike], allowed: Callable[[Array], NDArray[np.bool_]], what: str) -> list[Array]:
    arrays = []
    for name, value in arguments.items():
        array = np.asarray(value, dtype=float)
        if not np.all(np.isfinite(array) & allowed(array)):
            raise ValueError(f"{name} is {value!r}; it must be finite and {what}")
        arrays.append(array)
    return arrays
