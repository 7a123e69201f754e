"""Columns of a topic as named series of equal length, as data frames and spreadsheets take them."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Series = dict[str, NDArray[Any]]


def stamped(times: NDArray[np.int64]) -> Series:
    """The series 'time', s, of times in ns."""
    return {"time": times / 1e9}


def split(fields: Mapping[str, NDArray[Any]], names: Iterable[object]) -> Series:
    """A series 'field.name' for each column of each field; none of a field that is empty."""
    names = list(names)
    return {
        f"{field}.{name}": column
        for field, values in fields.items()
        for name, column in zip(names, values.T, strict=False)
    }
