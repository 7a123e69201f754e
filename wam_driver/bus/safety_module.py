"""The safety module of the arm: its mode, and what its pendant shows.  Source: libbarrett, `safety_module.{h,cpp}`."""

from enum import IntEnum
from typing import Final, NamedTuple

WATCHED: Final = ("velocity", "torque", "voltage", "heartbeat", "other")  # three bits each, from bit 0


class Lamp(IntEnum):
    """Of a watched quantity, one of three bits; 2 is a warning."""

    SAFE = 1
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
    faults : watched quantities whose lamp shows a fault.
    """

    button: Button
    faults: tuple[str, ...] = ()

    @classmethod
    def of(cls, value: int) -> "Pendant":
        """From the property PEN."""
        lit = tuple(name for at, name in enumerate(WATCHED) if value >> 3 * at & Lamp.FAULT)
        return cls(Button(value >> 26 & 3), lit)

    @property
    def value(self) -> int:
        """As the property PEN, without segments, warnings and the lamps of the buttons."""
        lamps = (Lamp.FAULT if name in self.faults else Lamp.SAFE for name in WATCHED)
        return int(self.button) << 26 | sum(lamp << 3 * at for at, lamp in enumerate(lamps))
