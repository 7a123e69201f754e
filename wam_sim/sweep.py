"""Parameter sets of a sweep: every combination, a list, or drawn at random; each maps names to values."""

import math
from collections.abc import Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np

MOST_SETS = 100_000  # of a sweep: their configurations take a gigabyte
Values = dict[str, Any]  # of one set, by the names of parameters


class Axis(NamedTuple):
    """A parameter of a sweep, as `Configuration.with_values` names it, and its values; a random one has two ends."""

    name: str
    values: tuple[Any, ...]


def grid(axes: Sequence[Axis]) -> list[Values]:
    """Every combination of the values.

    Raises
    ------
    ValueError
        where there are more than `MOST_SETS`.
    """
    count = math.prod(len(axis.values) for axis in axes)
    if count > MOST_SETS:
        counts = ", ".join(f"{axis.name}: {len(axis.values)}" for axis in axes)
        raise ValueError(f"{count} sets in all, {counts}; at most {MOST_SETS} are played: give fewer values")
    return [_named(axes, values) for values in product(*(axis.values for axis in axes))]


def listed(axes: Sequence[Axis]) -> list[Values]:
    """The first values together, then the second ones and so on.

    Raises
    ------
    ValueError
        where one axis has more values than another.
    """
    if len({len(axis.values) for axis in axes}) > 1:
        counts = ", ".join(f"{axis.name}: {len(axis.values)}" for axis in axes)
        raise ValueError(f"a list needs the same number of values for each parameter; given: {counts}")
    return [_named(axes, values) for values in zip(*(axis.values for axis in axes), strict=True)]


def drawn(axes: Sequence[Axis], count: int, seed: int) -> list[Values]:
    """Values drawn at random between the two ends of each axis, by their logarithm where both are above 0.

    Raises
    ------
    ValueError
        where an axis has not two numbers that rise.
    """
    random = np.random.default_rng(seed)
    for name, values in axes:
        if len(values) != 2 or not all(isinstance(v, (int, float)) for v in values) or not values[0] < values[1]:
            raise ValueError(
                f"{name} has the values {values}; a random sweep needs two numbers, the lowest and the highest"
            )
    return [
        {
            name: float(low * (high / low) ** part) if low > 0.0 else float(low + (high - low) * part)
            for part, (name, (low, high)) in zip(random.random(len(axes)), axes, strict=True)
        }
        for _ in range(count)
    ]


def _named(axes: Sequence[Axis], values: Sequence[Any]) -> Values:
    return {axis.name: value for axis, value in zip(axes, values, strict=True)}
