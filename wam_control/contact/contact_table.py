"""Contact hypotheses as rows of numbers, as the topic `contact/hypotheses` carries them, and back; tracked friction."""

from collections.abc import Mapping, Sequence

from wam_control.contact.contact_inference import Hypothesis
from wam_control.contact.model_errors import TrackedError
from wam_control.contact.model_prior import WAYS, friction_error, load_error
from wam_description.arm import Arm
from wam_description.signals import BASE, NO_CONTACT, Contact, LikelyRange, Table


def hypothesis_table(hypotheses: Sequence[Hypothesis], covers: Sequence[str]) -> Table:
    """Rows in the order of `HYPOTHESIS_COLUMNS`, the most probable hypothesis first."""
    rows = tuple(
        (
            float(covers.index(h.cover)),
            *(h.probability, h.position, h.position_sd, h.low, h.high),
            *h.force,
            *(h.force_sd, float(h.is_lower_bound), h.direction, h.direction_sd),
            *h.moment,
            h.residual,
            float(h.reasons),
        )
        for h in hypotheses
    )
    return Table(hypotheses[0].cover if hypotheses else BASE, rows)


def contact_of(table: Table | None, covers: Sequence[str]) -> Contact:
    """The contact of the most probable hypothesis; none without a row or a table."""
    if table is None or not table.rows:
        return NO_CONTACT
    # in the order of `HYPOTHESIS_COLUMNS`
    link, probability, position, position_sd, _, _, x, y, z, _, _, _, direction_sd, *_ = table.rows[0]
    return Contact(covers[int(link)], position, (x, y, z), position_sd, probability, direction_sd)


def likely_of(table: Table | None, covers: Sequence[str]) -> tuple[LikelyRange, ...]:
    """The parts of covers that hold the contact with 90 % probability in all."""
    rows = () if table is None else table.rows
    parts = (LikelyRange(covers[int(link)], low, high) for link, _, _, _, low, high, *_ in rows)
    return tuple(part for part in parts if part.low < part.high)


def friction_table(errors: Mapping[str, TrackedError], arm: Arm, scale: float) -> Table:
    """Rows in the order of `FRICTION_COLUMNS`: motors, then joints.

    Parameters
    ----------
    errors : of the model, by name.
    arm : of the observer, with the mean friction of both directions.
    scale : its friction per that of the arm.
    """
    names = (*arm.motors.names, *arm.joints.names)
    levels = (*arm.motors.dynamic_friction, *arm.joints.dynamic_friction)
    rows = tuple(
        (
            *(scale * level * (1.0 + errors[friction_error(name, way)].value) for way in WAYS),
            errors[load_error(name)].value,
            *(scale * level * errors[friction_error(name, way)].sd for way in WAYS),
            errors[load_error(name)].sd,
        )
        for name, level in zip(names, levels, strict=True)
    )
    return Table(BASE, rows)
