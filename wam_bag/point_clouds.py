"""Points of sensor_msgs/PointCloud2 as a table: the bytes in each message read as its fields describe them."""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_bag.arrays import Bytes, Index
from wam_bag.errors import Damage
from wam_bag.message_groups import Group

TYPES: Final = dict(enumerate(("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8"), 1))  # of the numbers in PointField
_SIZES: Final = ("height", "width", "is_bigendian", "point_step", "row_step")


class PointTable(NamedTuple):
    """Points of m messages that have p points each: which messages, and the points, (m, p), with named fields."""

    messages: Index
    points: NDArray[Any]


def tables(group: Group) -> list[PointTable]:
    """The points of messages of one layout; `messages` are rows of the group.

    Raises
    ------
    Damage
        if the sizes in a message do not fit each other or its data.
    """
    names = [field.name for field in group.text("fields")]
    paths = [*_SIZES, *(f"fields[{i}].{part}" for i in range(len(names)) for part in ("offset", "datatype", "count"))]
    described = np.hstack([group.numbers(path).astype(np.int64) for path in paths])
    data = group.numbers("data")
    found = []
    rows = np.arange(len(described))
    while len(rows):  # mostly all have the same description
        first = described[rows[0]]
        same = (described[rows] == first).all(axis=1)
        found.append(PointTable(rows[same], _points(data[rows[same]], names, first.tolist())))
        rows = rows[~same]
    return found


def _points(data: Bytes, names: list[str], described: list[int]) -> NDArray[Any]:
    """Bytes of m messages as points, (m, p), from the values of `_SIZES` and the three of each field."""
    height, width, is_bigendian, step, row_step = described[: len(_SIZES)]
    fields = [described[i : i + 3] for i in range(len(_SIZES), len(described), 3)]
    order = ">" if is_bigendian else "<"
    try:
        # some writers leave the count of a single number 0
        formats = [(order + TYPES[number], (count,) if count > 1 else ()) for _, number, count in fields]
        offsets = [offset for offset, _, _ in fields]
        kind = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": step})
        lines = data.reshape(len(data), height, row_step)[:, :, : width * step]
        return np.ascontiguousarray(lines).view(kind).reshape(len(data), height * width)
    except (KeyError, ValueError, OverflowError, ZeroDivisionError) as error:
        listed = ", ".join(f"{name} {place}" for name, place in zip(names, fields, strict=True))
        raise Damage(
            f"a point cloud of {height} rows of {width} points, point_step {step} and row_step {row_step} does not fit "
            f"its {data.shape[1]} bytes of data or its fields (offset, datatype, count): {listed} ({error})"
        ) from None


def table_columns(found: Sequence[PointTable]) -> tuple[Index, dict[str, NDArray[Any]]]:
    """Index of the message and the fields of all points, in the order of the messages.

    Raises
    ------
    Damage
        if messages with points have different fields.
    """
    filled = [table for table in found if table.points.size] or found[:1]
    shapes = [{name: table.points[name].shape[2:] for name in table.points.dtype.names or ()} for table in filled]
    for other in shapes:
        if other != shapes[0]:
            raise Damage(f"point clouds of one topic have the fields {', '.join(shapes[0])} and {', '.join(other)}")
    message = np.concatenate(
        [np.empty(0, np.intp), *(np.repeat(table.messages, table.points.shape[1]) for table in filled)]
    )
    order = np.argsort(message, kind="stable")
    columns = {}
    for name, shape in shapes[0].items() if shapes else ():
        values = np.concatenate([table.points[name].reshape(-1, *shape) for table in filled])
        columns[name] = values.astype(values.dtype.newbyteorder("="))[order]
    return message[order], columns
