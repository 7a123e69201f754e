"""What travels between machines: plain values without time stamps, the same for topics and for loops."""

from typing import NamedTuple


class State(NamedTuple):
    """Positions, velocities and torques of the motors or of the joints, each (n,).

    Motor side: theta rad, thetad rad/s, motor torque N m.  Joint side: q rad, qd rad/s, torque N m.
    """

    position: list[float]
    velocity: list[float]
    effort: list[float]


class Contact(NamedTuple):
    """A force of the world on one cover."""

    cover: str  # '' where nothing touches
    place: float  # m along the cover, NaN where it is not known
    force: tuple[float, float, float]  # N, in the cover's frame
    place_sd: float = float("nan")  # m, standard deviation of the place, NaN where nobody tells it
    probability: float = float("nan")  # that this cover is touched, of all that may be; NaN where nobody tells it


NO_CONTACT = Contact("", float("nan"), (0.0, 0.0, 0.0))


class Load(NamedTuple):
    """What the world truly does to one cover, as the simulator knows it."""

    cover: str  # '' where nothing touches
    place: float  # m along the cover, NaN where there is none
    force: tuple[float, float, float]  # N, in the cover's frame
    moment: tuple[float, float, float]  # N m, about the origin of the cover's frame, in that frame


NO_LOAD = Load("", float("nan"), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
