"""Where the controlled force acts: at the estimated contact if it is certain enough, else where the parameters say."""

import math
from typing import NamedTuple

from wam_control.force_loop_parameters import ForceLoopParameters
from wam_description.signals import Contact


class ForcePoint(NamedTuple):
    """Point at which the force acts.

    Attributes
    ----------
    cover, position : cover, and position along it, m.
    is_certain : whether the present estimate alone is certain enough to be used.
    rejection : why the present estimate is not used, '' if it is, or if no contact is detected.
    """

    cover: str
    position: float
    is_certain: bool
    rejection: str


class ContactPosition:
    """Selects the point of action, and keeps the last certain one as long as the contact lasts.

    Without that memory an estimate near its limits would step the measured force back and forth.
    """

    def __init__(self) -> None:
        self._last: tuple[str, float] | None = None

    def step(self, contact: Contact, parameters: ForceLoopParameters) -> ForcePoint:
        """Point of action for the present estimate; a second call in the same period gives the same."""
        is_certain = contact_is_certain(contact, parameters)
        if not contact.cover:
            self._last = None
        elif is_certain:
            self._last = contact.cover, contact.place
        rejection = self._rejection(contact, parameters) if contact.cover and not is_certain else ""
        cover, position = self._last or (parameters.contact_cover, parameters.contact_position)
        return ForcePoint(cover, position, is_certain, rejection)

    def _rejection(self, contact: Contact, parameters: ForceLoopParameters) -> str:
        used = "the last certain position is used" if self._last else "contact_cover and contact_position are used"
        return (
            f"the contact position estimated on {contact.cover} has a standard deviation of "
            f"{contact.position_sd:.3g} m and a probability of {contact.probability:.2f}; "
            f"allowed: at most position_uncertainty_limit, {parameters.position_uncertainty_limit:g} m, "
            f"and at least link_probability_limit, {parameters.link_probability_limit:g}; {used}"
        )


def contact_is_certain(contact: Contact, parameters: ForceLoopParameters) -> bool:
    """Whether position and link are known well enough; an uncertainty that is not published (NaN) counts as none."""
    return position_is_certain(contact.place, contact.position_sd, parameters.position_uncertainty_limit) and not (
        contact.probability < parameters.link_probability_limit
    )


def position_is_certain(position: float, position_sd: float, limit: float) -> bool:
    """Whether an estimated contact position is known well enough.

    Parameters
    ----------
    position : m along the cover, NaN where it cannot be observed.
    position_sd : its standard deviation, m; NaN where none is published, which counts as certain.
    limit : largest standard deviation allowed, m.
    """
    return not math.isnan(position) and not position_sd > limit
