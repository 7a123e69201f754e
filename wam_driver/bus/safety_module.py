"""The safety module of the arm: its mode, and what its pendant shows.  Source: libbarrett, `safety_module.{h,cpp}`."""

from enum import IntEnum
from typing import Final, NamedTuple

WATCHED: Final = ("velocity", "torque", "voltage", "heartbeat", "other")  # three bits each, from bit 0


class Lamp(IntEnum):
    """Of a watched quantity, one of three bits."""

    SAFE = 1
    WARNING = 2
    FAULT = 4


class SafetyMode(IntEnum):
    """What the safety module lets the motor controllers do."""

    ESTOP = 0  # no power
    IDLE = 1  # they brake by resistance
    ACTIVE = 2  # they follow their torques


class Button(IntEnum):
    """Button of the pendant that is pressed."""

    ESTOP = 0
    ACTIVATE = 1
    IDLE = 2
    NONE = 3


class Pendant(NamedTuple):
    """What the pendant shows.

    Attributes
    ----------
    button : that is pressed.
    warnings, faults : watched quantities whose lamp shows that.
    """

    button: Button
    warnings: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()

    @classmethod
    def of(cls, value: int) -> "Pendant":
        """From the property PEN."""
        lamps = {name: value >> 3 * at & 7 for at, name in enumerate(WATCHED)}
        lit = [tuple(name for name, lamp in lamps.items() if lamp & bit) for bit in (Lamp.WARNING, Lamp.FAULT)]
        return cls(Button(value >> 26 & 3), *lit)

    @property
    def value(self) -> int:
        """As the property PEN, without the segments and the lamps of the buttons."""
        value = int(self.button) << 26
        for at, name in enumerate(WATCHED):
            lamp = Lamp.FAULT if name in self.faults else Lamp.WARNING if name in self.warnings else Lamp.SAFE
            value |= lamp << 3 * at
        return value
