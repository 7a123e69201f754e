"""Columns of a topic as named series of equal length, as data frames and spreadsheets take them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wam_bag.columns import (
    BoolColumns,
    ClockColumns,
    Columns,
    JointColumns,
    Messages,
    PointColumns,
    TableColumns,
    WrenchColumns,
)

Series = dict[str, NDArray[Any]]
AXES = ("x", "y", "z")


def series(columns: Columns) -> Series:
    """Named series, each (k,): 'time', s, by the stamp or where there is none the log time, then the numbers.

    A message is a row, 'position.joint1' or 'force.x' a name; of a table each of its rows is one.
    """
    if isinstance(columns, TableColumns):
        found: Series = {"time": columns.row_stamp_ns / 1e9, "message": columns.message}
        for name, values in columns.columns.items():
            found |= (
                _split(name, values, tuple(map(str, range(values.shape[-1])))) if values.ndim > 1 else {name: values}
            )
        return found
    time = columns.log_time_ns if isinstance(columns, BoolColumns | Messages) else columns.stamp_ns
    found = {"time": time / 1e9}
    if isinstance(columns, JointColumns):
        for field in ("position", "velocity", "effort"):
            found |= _split(field, getattr(columns, field), columns.names)
    elif isinstance(columns, WrenchColumns):
        found |= {
            "frame": columns.frames,
            **_split("force", columns.force, AXES),
            **_split("torque", columns.torque, AXES),
        }
    elif isinstance(columns, PointColumns):
        found |= {"frame": columns.frames, **_split("point", columns.point, AXES)}
    elif isinstance(columns, BoolColumns):
        found["data"] = columns.data
    elif not isinstance(columns, ClockColumns):
        found["message"] = np.fromiter(columns.messages, object, len(columns.messages))
    return found


def _split(field: str, values: NDArray[Any], names: tuple[str, ...]) -> Series:
    """A series for each column; none of a field that is empty."""
    return {f"{field}.{name}": column for name, column in zip(names, values.T, strict=False)}
