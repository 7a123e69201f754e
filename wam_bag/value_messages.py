"""Messages that carry one value: joint states, wrenches, points, tables of numbers, a clock, a truth, a text.

A value is any object with the fields of the type: position, velocity and effort; frame, force and torque; frame and
position; frame and rows; the value itself.
"""

from collections.abc import Callable
from functools import cache, lru_cache
from itertools import chain
from typing import Any, Final

from wam_bag.cdr import Pattern, encoded

JOINT_STATE: Final = "sensor_msgs/msg/JointState"
WRENCH: Final = "geometry_msgs/msg/WrenchStamped"
POINT: Final = "geometry_msgs/msg/PointStamped"
TABLE: Final = "sensor_msgs/msg/PointCloud2"
TIME: Final = "rosgraph_msgs/msg/Clock"
BOOL: Final = "std_msgs/msg/Bool"
STRING: Final = "std_msgs/msg/String"
_FLOAT64: Final = 8  # sensor_msgs/PointField, which has as many bytes

Encode = Callable[[int, Any], bytes]


@cache
def joint_states(names: tuple[str, ...], counts: tuple[int, ...]) -> Pattern:
    """Joint states of these names, with so many positions, velocities and efforts."""
    return Pattern(JOINT_STATE, (((0, 0), ""), names, *((0.0,) * count for count in counts)))


@cache
def wrenches(frame: str) -> Pattern:
    """Wrenches in a frame."""
    return Pattern(WRENCH, (((0, 0), frame), ((0.0,) * 3, (0.0,) * 3)))


@cache
def points(frame: str) -> Pattern:
    """Points in a frame."""
    return Pattern(POINT, (((0, 0), frame), (0.0,) * 3))


@cache
def clocks() -> Pattern:
    """Clocks."""
    return Pattern(TIME, ((0, 0),))


@lru_cache(maxsize=256)
def tables(columns: tuple[str, ...], frame: str, rows: int) -> Pattern:
    """Tables with so many rows."""
    fields = [(name, _FLOAT64 * i, _FLOAT64, 1) for i, name in enumerate(columns)]
    step = _FLOAT64 * len(columns)
    data = bytes(step * rows)
    return Pattern(TABLE, (((0, 0), frame), 1, rows, fields, False, step, step * rows, data, False), "data")


def encoder(kind: str, names: tuple[str, ...] = (), columns: tuple[str, ...] = ()) -> Encode | None:
    """What turns a stamp, ns, and a value into a serialized message, None for any other type.

    Parameters
    ----------
    kind : ``package/msg/Type``.
    names : of the motors or joints of joint states.
    columns : of a table.
    """

    def joint_state(stamp: int, value: Any) -> bytes:
        position, velocity, effort = value
        counts = len(position), len(velocity), len(effort)
        return joint_states(names, counts).pack(stamp, position, velocity, effort)

    def table(stamp: int, value: Any) -> bytes:
        return tables(columns, value.frame, len(value.rows)).pack(stamp, tuple(chain.from_iterable(value.rows)))

    encoders: dict[str, Encode] = {
        JOINT_STATE: joint_state,
        WRENCH: lambda stamp, value: wrenches(value.frame).pack(stamp, (*value.force, *value.torque)),
        POINT: lambda stamp, value: points(value.frame).pack(stamp, value.position),
        TABLE: table,
        TIME: lambda stamp, value: clocks().pack(stamp),
        BOOL: lambda stamp, value: encoded(BOOL, [bool(value)]),
        STRING: lambda stamp, value: encoded(STRING, [value]),
    }
    return encoders.get(kind)
