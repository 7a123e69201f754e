"""Points of sensor_msgs/PointCloud2 as a table: the bytes in each message read as its fields describe them."""

from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_bag.errors import Damage
from wam_bag.message_groups import Group, Index

TYPES: Final = ("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8")  # of the numbers 1 to 8 in PointField
_SIZES: Final = ("height", "width", "is_bigendian", "point_step", "row_step")


class PointTable(NamedTuple):
    """Points of m messages that have p points each: which messages, and the fields by name, (m, p) or (m, p, n)."""

    messages: Index
    points: int
    columns: dict[str, NDArray[Any]]


def tables(group: Group) -> list[PointTable]:
    """The points of messages of one layout; `messages` are rows of the group.

    Raises
    ------
    Damage
        if the sizes in a message do not fit each other or its data.
    """
    count = group.layout.counts["fields"]
    names = [group.text(f"fields[{i}].name")[0] for i in range(count)]
    if len(set(names)) < count:
        raise Damage(f"a point cloud has two fields of the same name; its fields: {', '.join(names)}")
    paths = [*_SIZES, *(f"fields[{i}].{part}" for i in range(count) for part in ("offset", "datatype", "count"))]
    described = np.hstack([group.numbers(path).astype(np.int64) for path in paths])
    data = group.numbers("data")
    found = []
    rows = np.arange(len(described))
    while len(rows):  # mostly all have the same description
        first = described[rows[0]]
        same = (described[rows] == first).all(axis=1)
        points = _points(data[rows[same]], first[: len(_SIZES)].tolist())
        fields = _fields(points, names, first[len(_SIZES) :].reshape(-1, 3).tolist(), bool(first[2]))
        found.append(PointTable(rows[same], points.shape[1], dict(zip(names, fields, strict=True))))
        rows = rows[~same]
    return found


def _points(data: NDArray[np.uint8], sizes: list[int]) -> NDArray[np.uint8]:
    """Bytes of m messages as points, (m, points, bytes of a point)."""
    height, width, _, point_step, row_step = sizes
    fits = row_step >= width * point_step and height * row_step == data.shape[1]
    if not fits or (height * width and not point_step):
        raise Damage(
            f"a point cloud of {height} rows of {width} points has point_step {point_step}, row_step {row_step} and "
            f"{data.shape[1]} bytes of data, which do not fit"
        )
    lines = data.reshape(len(data), height, row_step)[:, :, : width * point_step]
    return lines.reshape(len(data), height * width, point_step)


def _fields(
    points: NDArray[np.uint8], names: Sequence[str], fields: list[list[int]], is_bigendian: bool
) -> Iterator[NDArray[Any]]:
    for name, (offset, number, count) in zip(names, fields, strict=True):
        if not 1 <= number <= len(TYPES):
            raise Damage(f"field '{name}' of a point cloud has the datatype {number}; allowed: 1 to {len(TYPES)}")
        dtype = np.dtype((">" if is_bigendian else "<") + TYPES[number - 1])
        width = count or 1  # some writers leave it 0
        end = offset + width * dtype.itemsize
        if end > points.shape[2]:
            raise Damage(f"field '{name}' of a point cloud ends at byte {end} of points of {points.shape[2]} bytes")
        values = np.ascontiguousarray(points[:, :, offset:end]).view(dtype).astype(dtype.newbyteorder("="))
        yield values if width > 1 else values[:, :, 0]


def table_columns(found: Sequence[PointTable]) -> tuple[Index, dict[str, NDArray[Any]]]:
    """Index of the message and the fields of all points, in the order of the messages.

    Raises
    ------
    Damage
        if messages with points have different fields.
    """
    filled = [table for table in found if table.points] or found[:1]
    shapes = {name: values.shape[2:] for table in filled[:1] for name, values in table.columns.items()}
    for table in filled:
        if (others := {name: values.shape[2:] for name, values in table.columns.items()}) != shapes:
            raise Damage(f"point clouds of one topic have the fields {', '.join(shapes)} and {', '.join(others)}")
    message = np.concatenate([np.empty(0, np.intp), *(np.repeat(table.messages, table.points) for table in filled)])
    order = np.argsort(message, kind="stable")
    return message[order], {
        name: np.concatenate([table.columns[name].reshape(-1, *shape) for table in filled])[order]
        for name, shape in shapes.items()
    }
