"""Which topics, joints and fields of a recording hold which quantity, and in which unit."""

import math
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

QUANTITIES = {  # units that are shown: that of ROS, of linear joints, others
    "position": ("rad", "m"), "velocity": ("rad/s", "m/s"), "effort": ("N m", "N", "A"), "force": ("N",),
    "torque": ("N m",), "stamp": ("s",),
}  # fmt: skip
COMMAND = "command"  # the type of what another robot was commanded
COMMANDED = "command."  # begins a quantity that was commanded, and the title of its column
MAPPED = (*QUANTITIES, "name", *(COMMANDED + quantity for quantity in QUANTITIES if quantity != "stamp"))
WAYS = {
    "rad": {"rad": 1.0, "deg": math.pi / 180.0, "°": math.pi / 180.0, "turn": math.tau, "rev": math.tau},
    "m": {"m": 1.0, "mm": 1e-3},
}
UNITS = {  # as given: factor, unit that is shown
    **{name: (factor, unit) for unit, names in WAYS.items() for name, factor in names.items()},
    **{f"{name}/s": (factor, f"{unit}/s") for unit, names in WAYS.items() for name, factor in names.items()},
    "rpm": (math.pi / 30.0, "rad/s"),
    "N": (1.0, "N"), "mN": (1e-3, "N"), "kN": (1e3, "N"),
    "Nm": (1.0, "N m"), "N m": (1.0, "N m"), "mNm": (1e-3, "N m"), "mN m": (1e-3, "N m"),
    "A": (1.0, "A"), "mA": (1e-3, "A"),
    "s": (1.0, "s"), "ms": (1e-3, "s"), "us": (1e-6, "s"), "ns": (1e-9, "s"), "h": (3600.0, "s"),
    "day": (86400.0, "s"),
}  # fmt: skip


class TopicMap(NamedTuple):
    """What is taken from a recording.

    Attributes
    ----------
    topics : the only ones that are analysed; all if empty.
    joints : the only ones; where a message has no names, the names of its values.
    commands : topics of commands, besides those whose name shows it.
    fields : path in the message by quantity, such as 'effort': 'current', 'command.position': 'goal'.
    units : factor and unit that is shown by quantity.
    """

    topics: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    commands: tuple[str, ...] = ()
    fields: Mapping[str, str] = {}
    units: Mapping[str, tuple[float, str]] = {}

    def scaled(self, quantity: str) -> tuple[float, str]:
        """Factor and shown unit of a quantity; where positions are in m, the other units are of linear joints, too."""
        is_linear = "m" in self.units.get("position", ())
        return self.units.get(quantity, (1.0, QUANTITIES[quantity][: 1 + is_linear][-1]))


NOTHING_GIVEN = TopicMap()


def topic_map(
    topics: Sequence[str], joints: Sequence[str], commands: Sequence[str], fields: Sequence[str], units: Sequence[str]
) -> TopicMap:
    """The map of the options of `wam analyse`.

    Parameters
    ----------
    fields : QUANTITY=FIELD; the field is a path of names, as actual.positions.
    units : QUANTITY=UNIT, or QUANTITY=FACTOR for what is multiplied to have the unit of ROS.

    Raises
    ------
    ValueError
        with what is allowed.
    """
    named = _values("--map", "FIELD", MAPPED, fields)
    factors = {
        quantity: unit_of(quantity, unit) for quantity, unit in _values("--unit", "UNIT", QUANTITIES, units).items()
    }
    return TopicMap(tuple(topics), tuple(joints), tuple(commands), named, factors)


def _values(option: str, what: str, allowed: Collection[str], texts: Sequence[str]) -> dict[str, str]:
    """The values of an option by quantity."""
    found: dict[str, str] = {}
    for text in texts:
        quantity, _, value = text.partition("=")
        if quantity not in allowed or not value:
            raise ValueError(f"{option} is '{text}'; write QUANTITY={what}, with a quantity of {', '.join(allowed)}")
        if quantity in found:
            raise ValueError(f"{option} {quantity} is given twice, as '{found[quantity]}' and as '{value}'")
        found[quantity] = value
    return found


def unit_of(quantity: str, text: str) -> tuple[float, str]:
    """Factor and shown unit of a unit, or of a factor, as it is written; raises ValueError with what is allowed."""
    if text in UNITS and UNITS[text][1] in QUANTITIES[quantity]:
        return UNITS[text]
    try:
        factor = float(text)
    except ValueError:
        factor = 0.0
    if factor == 0.0 or not math.isfinite(factor):
        fitting = ", ".join(name for name, (_, unit) in UNITS.items() if unit in QUANTITIES[quantity])
        raise ValueError(f"'{text}' is no unit of {quantity}; give --unit {quantity}= and a factor or one of {fitting}")
    return factor, QUANTITIES[quantity][0]
