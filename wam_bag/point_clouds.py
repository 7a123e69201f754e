"""Points of sensor_msgs/PointCloud2 as a table: the bytes in each message read as its fields describe them."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wam_bag.arrays import Index
from wam_bag.errors import Damage
from wam_bag.message_groups import Group

TYPES: Final = dict(enumerate(("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8"), 1))  # of the numbers in PointField
_SIZES: Final = ("height", "width", "is_bigendian", "point_step", "row_step")


def points(group: Group) -> NDArray[Any]:
    """The points of messages of one layout, (m, p), with named fields.

    Raises
    ------
    Damage
        if the sizes in the messages do not fit each other or their data.
    """
    height, width, is_bigendian, step, row_step = map(group.value, _SIZES)
    fields, data = group.value("fields"), group.numbers("data")
    order = ">" if is_bigendian else "<"
    try:
        # some writers leave the count of a single number 0
        formats = [(order + TYPES[one.datatype], (one.count,) if one.count > 1 else ()) for one in fields]
        names, offsets = [one.name for one in fields], [one.offset for one in fields]
        kind = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": step})
        lines = data.reshape(len(data), height, row_step)[:, :, : width * step]
        return np.ascontiguousarray(lines).view(kind).reshape(len(data), height * width)
    except (KeyError, ValueError, OverflowError, ZeroDivisionError) as error:
        listed = ", ".join(f"{one.name} {[one.offset, one.datatype, one.count]}" for one in fields)
        raise Damage(
            f"a point cloud of {height} rows of {width} points, point_step {step} and row_step {row_step} does not fit "
            f"its {data.shape[1]} bytes of data or its fields (offset, datatype, count): {listed} ({error})"
        ) from None


def table_columns(found: Sequence[tuple[Index, NDArray[Any]]]) -> tuple[Index, dict[str, NDArray[Any]]]:
    """Index of the message and the fields of all points, in the order of the messages.

    Parameters
    ----------
    found : indices of messages, (m,), and their points, (m, p), by layout.

    Raises
    ------
    Damage
        if messages with points have different fields.
    """
    filled = [one for one in found if one[1].size] or found[:1]
    shapes = [{name: every[name].shape[2:] for name in every.dtype.names or ()} for _, every in filled]
    for other in shapes:
        if other != shapes[0]:
            raise Damage(f"point clouds of one topic have the fields {', '.join(shapes[0])} and {', '.join(other)}")
    message = np.concatenate([np.empty(0, np.intp), *(np.repeat(rows, every.shape[1]) for rows, every in filled)])
    order = np.argsort(message, kind="stable")
    columns = {}
    for name, shape in shapes[0].items() if shapes else ():
        values = np.concatenate([every[name].reshape(-1, *shape) for _, every in filled])
        columns[name] = values.astype(values.dtype.newbyteorder("="))[order]
    return message[order], columns
