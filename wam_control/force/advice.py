"""What to change so that a refused force would be obeyed: a joint to turn, more force, or a pinned position.

A search over the belief of other forces in other poses, one in each period, since it takes a fifth of a millisecond.
"""

from collections.abc import Callable, Iterator, Sequence

from wam_control.force.axes import Links, TaskAxes
from wam_control.force.belief import Belief
from wam_control.force.force_axis import Angles, ForcePlace
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.task import TaskCommand
from wam_control.force.thresholds import FORCE
from wam_description.event import Value
from wam_description.parts import Joints

Ways = dict[str, Value]


class Search:
    """What helps a refused force, as far as it is known by now.

    Parameters
    ----------
    task : with this force.
    found : what of the tries of `tries` helps, one after the other.

    Attributes
    ----------
    task : that one.
    ways : what helps; `searched` among it where all was tried.
    """

    def __init__(self, task: TaskCommand, found: Iterator[Ways]) -> None:
        self.task, self._found = task, found
        self.ways: Ways = {}

    def step(self) -> Ways:
        """Go on by one try; returns `ways`."""
        self.ways |= next(self._found, {})
        return self.ways


def tries(
    q: Sequence[float],
    task: TaskCommand,
    places: Sequence[tuple[float, ForcePlace]],
    axes: TaskAxes,
    joints: Joints,
    believe: Callable[[Angles, Links], Belief],
    own: ForceLoopParameters,
) -> Iterator[Ways]:
    """After each force that is tried, the way where it would be obeyed with a reserve, else nothing; then `searched`.

    Parameters
    ----------
    q : joint angles (n,), rad.
    task : with the one refused force.
    places : where it acts on each link that may be touched, with the probability of that, the largest first.
    axes : of tasks of this arm.
    joints : of the arm.
    believe : what would be known in a pose of a force on these links.
    own : parameters of the force loop.
    """
    (force,) = task.axes
    place = places[0][1]
    pinned = place._replace(position_sd=own.contact_position_sd, is_pinned=True, is_known=True)
    # where nobody knows yet where it acts, a position helps if it does so anywhere
    whole = axes.forces.covers.length_of(place.cover) if place.cover else 0.0
    pins = (place.position,) if place.is_known else (place.position, *(part * whole for part in FORCE.pins))

    def is_obeyed(pose: Sequence[float], where: Sequence[tuple[float, ForcePlace]], size: float) -> bool:
        tried = task._replace(axes=(force._replace(value=size),))
        on_links = [(chance, axes.of(pose, tried, [at], [1.0])[0]) for chance, at in where]
        return FORCE.hysteresis * believe(pose, on_links).doubt <= own.limits.doubt

    size = force.value or 0.0
    # first, as a refusal advises it at once
    at = next(
        (at for at in pins * (not place.is_pinned) if is_obeyed(q, [(1.0, pinned._replace(position=at))], size)), None
    )
    yield {"no_pin": 1.0} if at is None else {"pin": at}
    for name, was, angle, pose in _turned(q, joints, own.limits.joint_margin):
        is_good = is_obeyed(pose, places, size)
        yield {"turn": name, "turn_from": was, "turn_to": angle} if is_good else {}
        if is_good:
            break
    for factor in FORCE.more:
        larger = float(f"{factor * size:.2g}")
        is_good = abs(larger) <= own.force_limit and is_obeyed(q, places, larger)
        yield {"more_force": larger} if is_good else {}
        if is_good:
            break
    yield {"searched": 1.0}


def _turned(q: Sequence[float], joints: Joints, margin: float) -> Iterator[tuple[str, float, float, Sequence[float]]]:
    """Poses in which one joint is turned, its name, and its angle before and after; the nearest first."""
    for by in FORCE.turned:
        for i in reversed(range(len(q))):
            for angle in (round(q[i] + by, 1) + 0.0, round(q[i] - by, 1) + 0.0):  # no -0
                if joints.lower[i] + margin + FORCE.spare <= angle <= joints.upper[i] - margin - FORCE.spare:
                    yield joints.names[i], q[i], angle, [*q[:i], angle, *q[i + 1 :]]
