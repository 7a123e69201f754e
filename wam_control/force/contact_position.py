"""Where the controlled force acts: where the command or the parameters pin it, or at the estimated contact."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.force.force_axis import ForceAxis, PressedForce
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_description.arm import Covers
from wam_description.signals import BASE, Contact, ForceCommand, Triple

STEEPEST = math.radians(30.0)  # lean of a force from the normal of a link, up to which its position is estimated well


class ForcePoint(NamedTuple):
    """Point at which the force acts.

    Attributes
    ----------
    cover, position, position_sd : cover, position along it and its standard deviation, m.
    is_certain : whether the position is pinned, or the present estimate alone is certain enough to be used.
    is_pinned : whether the position is pinned.
    is_identified : whether it is pinned, or the link is that of the present estimate, whose position may be unknown.
    is_doubtful : whether something is touched, and the position is not pinned nor the link identified.
    rejection : why the present estimate is not used, '' if it is or is not needed.
    conflict : the cover that is touched instead, so that no force can be controlled there; '' if none is known.
    is_single : False where a second contact is nearly certain, whose torques are not those of the force.
    """

    cover: str
    position: float
    position_sd: float
    is_certain: bool
    is_pinned: bool
    is_identified: bool
    is_doubtful: bool
    rejection: str
    conflict: str
    is_single: bool = True

    def pressed(self, direction: NDArray[np.float64], force: float) -> PressedForce:
        """A force there, N, along a direction (3,), base frame."""
        return PressedForce(self.cover, self.position, self.position_sd, direction, force)


class ContactPosition:
    """Selects the point of action, and keeps the last certain one as long as the contact lasts.

    Without that memory an estimate near its limits would step the measured force back and forth.  A position that is
    not known may be anywhere on the cover: the force is then sensed apart from what depends on it.

    Parameters
    ----------
    covers : of the arm.
    """

    def __init__(self, covers: Covers) -> None:
        self._covers = covers
        self._last: tuple[str, float, float] | None = None
        self._pinned = ("", 0.0)
        self._slid = 0.0

    def slide(self, way: float) -> None:
        """Count a way of the pinned point along its cover, m, since it was pinned or the force began.

        What is touched, or is to be, stays where it is, so that it is touched elsewhere on the link; at the end of a
        cover it is the end that slides.  The way before the touch counts, too: a touch is detected late, and where the
        lever of the force is short the arm moves further along itself than along the force.
        """
        self._slid += way

    def restart(self) -> None:
        """A force begins: it acts where it is pinned."""
        self._slid = 0.0

    def step(
        self, contact: Contact, command: ForceCommand | None, lean: float, parameters: ForceLoopParameters
    ) -> ForcePoint:
        """Point of action for the present estimate; a second call in the same period gives the same.

        Parameters
        ----------
        contact : estimated contact.
        command : commanded force; a torque in it pins the position, see `pinned_position`.
        lean : angle of the commanded force from the normal of the touched cover, rad.
        parameters : of the force loop.
        """
        pinned = pinned_position(command)
        if pinned is not None or parameters.contact_source == "pinned":
            self._last = None
            cover, position = pinned or (parameters.contact_cover, parameters.contact_position)
            if (cover, position) != self._pinned:
                self._pinned, self._slid = (cover, position), 0.0
            conflict = _conflict(contact, cover, parameters)
            position = slid_position(self._covers, cover, position, self._slid)
            sd = parameters.contact_position_sd
            return ForcePoint(cover, position, sd, True, True, True, False, "", conflict, contact.is_single)
        problem = _problem(contact, lean, parameters) if contact.cover else ""
        if not contact.cover:
            self._last = None
        elif not problem:
            sd = 0.0 if math.isnan(contact.position_sd) else contact.position_sd
            self._last = contact.cover, contact.position, sd
        assumed = parameters.contact_cover, parameters.contact_position
        cover, position, sd = self._last or (*assumed, anywhere_sd(self._covers, *assumed))
        if problem:
            used = "the last certain position is used" if self._last else "contact_cover and contact_position are used"
            problem = f"{problem}; {used}"
        is_certain = bool(contact.cover) and not problem
        is_identified = contact.cover == cover and not contact.probability < parameters.link_probability_limit
        conflict = _conflict(contact, cover, parameters)
        is_doubtful = bool(contact.cover) and not is_identified
        return ForcePoint(
            cover, position, sd, is_certain, False, is_identified, is_doubtful, problem, conflict, contact.is_single
        )


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


def _problem(contact: Contact, lean: float, parameters: ForceLoopParameters) -> str:
    """Why an estimated position is not certain, '' if it is; an uncertainty that is not published counts as none."""
    if not contact.is_single:
        return f"a second contact is nearly certain besides that on {contact.cover}"
    if lean > STEEPEST:
        return (
            f"the commanded force is {math.degrees(lean):.0f} deg off the normal of {contact.cover}; a contact "
            f"position is estimated well up to {math.degrees(STEEPEST):.0f} deg, and not on the end of a link; "
            "pin the position (contact_source, or the torque of the command)"
        )
    known = position_is_certain(contact.position, contact.position_sd, parameters.position_uncertainty_limit)
    if known and not contact.probability < parameters.link_probability_limit:
        return ""
    return (
        f"the contact position estimated on {contact.cover} has a standard deviation of "
        f"{contact.position_sd:.3g} m and a probability of {contact.probability:.2f}; "
        f"allowed: at most position_uncertainty_limit, {parameters.position_uncertainty_limit:g} m, "
        f"and at least link_probability_limit, {parameters.link_probability_limit:g}"
    )


def _conflict(contact: Contact, cover: str, parameters: ForceLoopParameters) -> str:
    """Another cover than that of the force whose contact forbids to control it, '' where there is none."""
    if contact.cover in ("", cover) or not contact.probability >= parameters.link_probability_limit:
        return ""
    return contact.cover


def position_is_certain(position: float, position_sd: float, limit: float) -> bool:
    """Whether an estimated contact position is known well enough.

    Parameters
    ----------
    position : m along the cover, NaN where it cannot be observed.
    position_sd : its standard deviation, m; NaN where none is published, which counts as certain.
    limit : largest standard deviation allowed, m.
    """
    return not math.isnan(position) and not position_sd > limit


class ForceCase(NamedTuple):
    """A force at a position in a pose.

    Attributes
    ----------
    axis : of the force.
    point : where it acts.
    desired : commanded force, N.
    signal : its torques per standard deviation of the estimated ones; infinite with sensors.
    elsewhere : the same if another link is touched.
    torque_error : standard deviation of the force by those of the estimated torques, N; 0 with sensors.
    unknown, payload : force, N, of torques at rest before, which no touched surface gives, and the mass at the tool,
        kg, that explains them; 0 where none does.
    """

    axis: ForceAxis
    point: ForcePoint
    desired: float
    signal: float = math.inf
    elsewhere: float = math.inf
    torque_error: float = 0.0
    unknown: float = 0.0
    payload: float = 0.0

    def worse(self, factor: float) -> "ForceCase":
        """The same, with all that is not known of it larger by a factor, and the arm as much slower."""
        axis = self.axis
        return self._replace(
            axis=axis._replace(force_sd=factor * axis.force_sd, speed_fraction=axis.speed_fraction / factor),
            signal=self.signal / factor,
            elsewhere=self.elsewhere / factor,
            torque_error=factor * self.torque_error,
            unknown=factor * self.unknown,
        )
