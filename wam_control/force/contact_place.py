"""Where the controlled force acts: where the command or the parameters pin it, or at the estimated contact."""

import math

from wam_control.force.force_axis import ForcePlace
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.task import TaskAxis
from wam_description.arm import Covers
from wam_description.signals import BASE, Contact, ForceCommand, Triple

STEEPEST = 0.5  # sine of the lean of a force from the normal of a link, up to which its position is estimated well


class ContactPlace:
    """Where one force acts; it is kept while the contact lasts.

    A pinned point is one of the world: the link slides along it.  An estimate near its limits would step the measured
    force back and forth, so the last one that was certain is kept.  A position that is not known may be anywhere on
    the cover: its deviation is that of `anywhere_sd`.

    Parameters
    ----------
    covers : of the arm.
    """

    def __init__(self, covers: Covers) -> None:
        self._covers = covers
        self._last: ForcePlace | None = None
        self._pinned = ("", 0.0)
        self._slid = 0.0

    def slide(self, way: float) -> None:
        """Count a way of the link along itself, m: what is touched, or is to be, is touched elsewhere on it."""
        self._slid += way

    def step(self, axis: TaskAxis, contact: Contact, lean: float, parameters: ForceLoopParameters) -> list[ForcePlace]:
        """Place for the present estimate; one on each link that may be touched while that is not known.

        Parameters
        ----------
        axis : of the force; its cover is '' where any link may touch, its position None where it is estimated.
        contact : estimated contact.
        lean : sine of the angle of the force from the normal of the touched cover.
        parameters : of the force loop.
        """
        covers = self._covers
        if axis.position is not None:
            at = axis.cover, axis.position
            if at != self._pinned:
                self._pinned, self._slid = at, 0.0
            position = slid_position(covers, *at, self._slid)
            return [ForcePlace(axis.cover, position, parameters.contact_position_sd, is_pinned=True, is_known=True)]
        if not contact.cover:
            self._last = None
        elif (
            axis.cover in ("", contact.cover)
            and lean <= STEEPEST
            and not contact.probability < parameters.link_probability_limit
        ):
            sd = 0.0 if math.isnan(contact.position_sd) else contact.position_sd
            known = ForcePlace(contact.cover, contact.position, sd, is_known=True)
            self._last = None if math.isnan(contact.position) else known
        if self._last is not None:
            return [self._last]
        places = []
        for cover in covers.names if contact.cover and not axis.cover else [axis.cover or parameters.contact_cover]:
            is_touched = cover == contact.cover and math.isnan(contact.position)
            middle = covers.length_of(cover) / 2.0
            position = parameters.contact_position if cover == parameters.contact_cover else middle
            places.append(ForcePlace(cover, position, anywhere_sd(covers, cover, position), is_touched=is_touched))
        return places


def slid_position(covers: Covers, cover: str, position: float, way: float) -> float:
    """Where a cover is touched, m, that has slid along itself by a way, m, since that was at a position, m."""
    length = covers.length_of(cover)
    return min(max(position - way, 0.0), length) if position < length - covers.radius_of(cover) else position


def anywhere_sd(covers: Covers, cover: str, position: float) -> float:
    """Deviation from a position, m, rms, of one that is uniformly distributed over a cover, m."""
    length = covers.length_of(cover)
    return math.hypot(length / math.sqrt(12.0), position - length / 2.0)


def pinned_position(command: ForceCommand | None) -> tuple[str, float] | None:
    """Cover and position, m, that a command pins: its torque is that of the force about the origin of the cover.

    A force (fx, fy, fz) at the position x has the torque (0, -x fz, x fy).  None for a command without a torque
    or in the base frame, whose torque determines no cover.
    """
    if command is None or command.frame == BASE or not any(command.torque):
        return None
    (_, fy, fz), (_, my, mz) = command.force, command.torque
    across = fy * fy + fz * fz
    return (command.frame, (fy * mz - fz * my) / across) if across else None


def torque_of_position(force: Triple, position: float) -> Triple:
    """Torque about the origin of a cover, N m, of a force at a position along it; the inverse of `pinned_position`."""
    return 0.0, -position * force[2], position * force[1]
