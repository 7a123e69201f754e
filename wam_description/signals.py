"""The values that nodes exchange, without time stamps: the same on topics, in the simulation and in a replay."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from wam_description.event import Event, Level

BASE = "base"  # frame of the arm's base, and of a contact that is none
Triple = tuple[float, float, float]
ZERO: Triple = (0.0, 0.0, 0.0)


class State(NamedTuple):
    """Positions, velocities and torques of the motors or of the joints, each (n,).

    Motor side: theta rad, thetad rad/s, motor torque N m.  Joint side: q rad, qd rad/s, torque N m.
    An array that a topic does not carry is empty.
    """

    position: list[float]
    velocity: list[float]
    effort: list[float]


def mask(arrays: str) -> Callable[[Any], Any]:
    """What copies the arrays of a JointState that an input takes, and leaves the others empty.

    With a copy, a step that changes its input does not change that of another node.  Other values cannot be changed.
    """
    position, velocity, effort = (name in arrays.replace("?", "").split() for name in State._fields)

    def masked(value: Any) -> Any:
        if not isinstance(value, State):
            return value
        return State(
            [*value.position] if position else [],
            [*value.velocity] if velocity else [],
            [*value.effort] if effort else [],
        )

    return masked


class Wrench(NamedTuple):
    """Force (3,) N and torque (3,) N m in a named frame."""

    frame: str
    force: Triple
    torque: Triple


class Point(NamedTuple):
    """A position (3,), m, in a named frame; NaN where it is not known."""

    frame: str
    position: Triple


class Table(NamedTuple):
    """Rows of numbers under the column names of the topic; no row where there is nothing to report."""

    frame: str
    rows: tuple[tuple[float, ...], ...]


class PathPoint(NamedTuple):
    """A posture (n,), rad, its velocity (n,), rad/s, empty for a stop, and its time from the start, s."""

    position: tuple[float, ...]
    velocity: tuple[float, ...] = ()
    time: float = 0.0


class PosturePath(NamedTuple):
    """Postures one after the other; without times, as fast as the arm may move."""

    points: tuple[PathPoint, ...]


class ForceCommand(NamedTuple):
    """Commanded force of the arm on the world; `frame` is 'base' or a cover.

    In the frame of a cover a torque that is not zero pins where the force acts: it is that of the force about
    the origin of the cover.
    """

    frame: str
    force: Triple  # N
    torque: Triple = ZERO  # N m; pins the position, refused where it does not


class Contact(NamedTuple):
    """A force of the world on one cover."""

    cover: str  # '' where nothing touches
    position: float  # m along the cover, NaN where it is not known
    force: Triple  # N, in the cover's frame
    position_sd: float = float("nan")  # m, standard deviation of the position, NaN where it is not known
    probability: float = float("nan")  # that this cover is touched and no other, NaN where it is not known
    direction_sd: float = float("nan")  # rad, of the angle of the force about the cover, NaN where it is not known


NO_CONTACT = Contact("", float("nan"), ZERO)


class Load(NamedTuple):
    """The true load of the world on one cover, known to the simulator only."""

    cover: str  # '' where nothing touches
    position: float  # m along the cover, NaN where there is none
    force: Triple  # N, in the cover's frame
    moment: Triple  # N m, about the origin of the cover's frame, in that frame


NO_LOAD = Load("", float("nan"), ZERO, ZERO)


class ObjectState(NamedTuple):
    """The true state of an object of the world, known to the simulator only, in the base frame.

    Attributes
    ----------
    object : index in `World.objects`.
    x, y, z : of a free body or moving obstacle its centre, of a door the middle of its hinge, m.
    qx, qy, qz, qw : orientation.
    vx, vy, vz : velocity of that point, m/s.
    angle : of a door, rad; NaN for others.
    arm_force_x, arm_force_y, arm_force_z : force of the arm on it, N.
    arm_torque_x, arm_torque_y, arm_torque_z : torque of that force about that point, N m.
    other_force_x, other_force_y, other_force_z : force on it of obstacles and other objects, N.
    """

    object: float
    x: float
    y: float
    z: float
    qx: float
    qy: float
    qz: float
    qw: float
    vx: float
    vy: float
    vz: float
    angle: float
    arm_force_x: float
    arm_force_y: float
    arm_force_z: float
    arm_torque_x: float
    arm_torque_y: float
    arm_torque_z: float
    other_force_x: float
    other_force_y: float
    other_force_z: float


class LikelyRange(NamedTuple):
    """A part of a cover where the contact is likely, m along it."""

    cover: str
    low: float
    high: float


class ContactView(NamedTuple):
    """What a viewer draws of a contact: link, position and force, and where else it may be."""

    contact: Contact
    likely: tuple[LikelyRange, ...]


class NodeStatus(NamedTuple):
    """What a node reports about itself; `wam_description.status` writes and reads it as key-value pairs.

    Attributes
    ----------
    level : how serious it is.
    message : one line for people; no program reads it.
    node : name of the node; filled in by the adapter where it is empty.
    connected : whether all publishers and subscribers that the node expects are there.
    mode : of the driver: braked, enabled or fault; '' for other nodes.
    fault : why the driver has stopped, or why it has to, '' where there is no reason.
    step : of the scenario, '' for other nodes.
    session : of the driver, its number; of another node, the one that it follows; 0 where it has none.
    since : of the driver, the time from which commands count, ns: the brakes were switched then.
    stamp : time of the arm that the status belongs to, ns, 0 where it has none.
    facts : further values for people, by name; a number is written as text.
    events : what happened, the most serious first.
    """

    level: Level
    message: str
    node: str = ""
    connected: bool = False
    mode: str = ""
    fault: str = ""
    step: str = ""
    session: int = 0
    since: int = 0
    stamp: int = 0
    facts: Mapping[str, str] = {}
    events: tuple[Event, ...] = ()

    @property
    def subjects(self) -> set[tuple[Any, ...]]:
        """What the status is about; one that only changes in its numbers is stated to people once."""
        return {event.subject for event in self.events} or {(self.level,)}


class Answer(NamedTuple):
    """The answer of a service: whether it was done, and what to do next where it was not."""

    success: bool
    message: str
