"""Between ROS messages and plain values.  What is not whole and finite is refused whole."""

from collections.abc import Sequence
from math import isfinite, isnan
from typing import Any, NamedTuple

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PointStamped, WrenchStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from wam_description.signals import NO_CONTACT, Contact, State

BASE = "base"  # frame id of the base, and of a contact that is none


class Refused(ValueError):
    """A message that is not let in; the text names the value, what is allowed and what to do."""


class Wrench(NamedTuple):
    """Force (3,) N and torque (3,) N m in a named frame."""

    frame: str
    force: tuple[float, float, float]
    torque: tuple[float, float, float]


def header(stamp: int, frame: str = "") -> Header:
    """Header with a stamp in nanoseconds."""
    return Header(stamp=Time(sec=stamp // 1_000_000_000, nanosec=stamp % 1_000_000_000), frame_id=frame)


def stamp_of(message: Any) -> int:
    """Stamp of a message with a header, ns."""
    time = message.header.stamp
    return int(time.sec * 1_000_000_000 + time.nanosec)


def joint_state(stamp: int, names: Sequence[str], state: State) -> JointState:
    """JointState message; empty arrays stay empty."""
    return JointState(
        header=header(stamp), name=names, position=state.position, velocity=state.velocity, effort=state.effort
    )


def read_joint_state(message: JointState, names: list[str], fields: str) -> State:
    """Values of a JointState in the order of `names`; arrays that were not asked for stay empty.

    Parameters
    ----------
    message : the message; matched by name, never by index.
    names : names that must all be there, once each.
    fields : the arrays that must be filled, separated by blanks; one with a '?' may be empty.

    Raises
    ------
    Refused
        names the first thing that is wrong.
    """
    order = None
    if message.name != names:
        order = _order(list(message.name), names)
    count = len(names)
    asked = fields.split()
    arrays: list[list[float]] = []
    for name in State._fields:
        array = getattr(message, name).tolist()
        if len(array) != count and (array or name in asked):
            raise Refused(f"{name} has {len(array)} values; send {count}, one for each of {', '.join(names)}")
        for value, owner in zip(array, message.name, strict=False):
            if not isfinite(value):
                raise Refused(f"{name} of {owner} is {value}; send finite numbers")
        if not (name in asked or name + "?" in asked):
            array = []
        arrays.append([array[i] for i in order] if order and array else array)
    return State(*arrays)


def _order(found: list[str], names: list[str]) -> list[int]:
    for name in found:
        if name not in names:
            raise Refused(f"unknown name '{name}'; allowed are {', '.join(names)}")
        if found.count(name) > 1:
            raise Refused(f"name '{name}' stands there twice; send each of {', '.join(names)} once")
    for name in names:
        if name not in found:
            raise Refused(f"name '{name}' is missing; send all of {', '.join(names)}")
    return [found.index(name) for name in names]


def wrench_stamped(stamp: int, wrench: Wrench) -> WrenchStamped:
    """WrenchStamped message."""
    message = WrenchStamped(header=header(stamp, wrench.frame))
    message.wrench.force.x, message.wrench.force.y, message.wrench.force.z = map(float, wrench.force)
    message.wrench.torque.x, message.wrench.torque.y, message.wrench.torque.z = map(float, wrench.torque)
    return message


def read_wrench(message: WrenchStamped, frames: Sequence[str]) -> Wrench:
    """Values of a WrenchStamped.

    Raises
    ------
    Refused
        for a frame that is not one of `frames` or a number that is not finite.
    """
    frame, force, torque = message.header.frame_id, message.wrench.force, message.wrench.torque
    if frame not in frames:
        raise Refused(f"frame_id is '{frame}'; allowed are {', '.join(frames)}")
    result = Wrench(frame, (force.x, force.y, force.z), (torque.x, torque.y, torque.z))
    if not all(isfinite(value) for value in (*result.force, *result.torque)):
        raise Refused(f"force {result.force} N, torque {result.torque} N m; send finite numbers")
    return result


def point_stamped(stamp: int, frame: str, point: Sequence[float]) -> PointStamped:
    """PointStamped message, NaN where a coordinate is not known."""
    message = PointStamped(header=header(stamp, frame))
    message.point.x, message.point.y, message.point.z = map(float, point)
    return message


def read_contact(message: PointStamped, frames: Sequence[str]) -> float:
    """Place of a contact along its cover, m; NaN where it is not known, nothing else may be.

    Raises
    ------
    Refused
        for a frame that is not one of `frames` or a place that is infinite.
    """
    frame, place = message.header.frame_id, message.point.x
    if frame not in frames:
        raise Refused(f"frame_id is '{frame}'; allowed are {', '.join(frames)}")
    if not (isfinite(place) or isnan(place)):
        raise Refused(f"place is {place} m; send a finite number, or NaN where it is not known")
    return float(place)


def read_spread(message: PointStamped, frames: Sequence[str]) -> tuple[float, float]:
    """How sure a contact is: standard deviation of its place, m, probability of its cover; NaN where not known.

    Raises
    ------
    Refused
        for a frame that is not one of `frames`, a spread below 0 or a probability outside 0..1.
    """
    place_sd, probability = read_contact(message, frames), float(message.point.y)
    if place_sd < 0.0:
        raise Refused(f"standard deviation of the place is {place_sd} m; send 0 or more, or NaN where it is not known")
    if not (isnan(probability) or 0.0 <= probability <= 1.0):
        raise Refused(f"probability is {probability}; send 0 to 1, or NaN where it is not known")
    return place_sd, probability


def contact_of(wrench: Wrench | None, place: float | None, spread: tuple[float, float] | None = None) -> Contact:
    """The contact that a wrench, a place and a spread describe; none where they are missing or in the base frame."""
    if wrench is None or place is None or wrench.frame == BASE:
        return NO_CONTACT
    return Contact(wrench.frame, place, wrench.force, *(spread or ()))
