"""What to change so that a force which is not sensed well enough is: a joint to turn, or more force, if either helps.

More force helps where the errors of the torques are most of the uncertainty.  An uncertain position and friction on the
surface grow with the force; then another pose helps, if any does.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from wam_control.force_axis import ForceAxis

MORE = (1.25, 1.6, 2.0, 3.0, 5.0)  # times the commanded force, tried in this order
GRID, FARTHEST = 0.2, 1.6  # rad: angles that are tried, and how far from the present one; finer took a period


class OtherAxes(NamedTuple):
    """The axis of a force in other poses and for other forces.

    Attributes
    ----------
    q : present joint angles (n,), rad.
    joint : index of the last joint that moves the link, which bends the arm there.
    name, lower, upper : of that joint, and between which angles it may be, rad.
    at : axis of a force, N, in a pose (n,), rad.
    """

    q: Sequence[float]
    joint: int
    name: str
    lower: float
    upper: float
    at: Callable[[Sequence[float], float], ForceAxis]


def advice(others: OtherAxes, force: float, is_sensed: Callable[[ForceAxis, float], bool]) -> str:
    """What to do in place of commanding a force, N, here; each way is checked.

    Parameters
    ----------
    is_sensed : whether a force, N, along an axis is sensed well enough.
    """
    ways = []
    angle = _angle(others, force, is_sensed)
    if angle is not None:
        ways.append(f"turn {others.name} from {others.q[others.joint]:.2f} to {angle:.1f} rad")
    larger = (float(f"{factor * force:.2g}") for factor in MORE)
    enough = next((each for each in larger if is_sensed(others.at(others.q, each), each)), None)
    ways += [f"command {enough:g} N"] if enough else []
    rest = "command another direction or position"
    more = "" if enough else f" (no allowed force up to {MORE[-1]:g} times as large is known well enough)"
    return f"{', or '.join([*ways, rest])}{more}"


def _angle(others: OtherAxes, force: float, is_sensed: Callable[[ForceAxis, float], bool]) -> float | None:
    """The nearest angle of the joint, rad, at which the force is sensed well enough, to half of the grid; or None."""
    present = others.q[others.joint]

    def is_good(angle: float) -> bool:
        pose = [*others.q[: others.joint], angle, *others.q[others.joint + 1 :]]
        return others.lower <= angle <= others.upper and is_sensed(others.at(pose, force), force)

    count = round(FARTHEST / GRID)
    middle = round(present / GRID)
    grid = [GRID * (middle + i) for i in range(-count, count + 1)]
    found = next(filter(is_good, sorted(grid, key=lambda each: abs(each - present))), None)
    if found is None:
        return None
    nearer = found + math.copysign(0.5 * GRID, present - found)
    return nearer if is_good(nearer) else found
