"""The safety module of the arm: its mode, and what its pendant shows.  Source: libbarrett, `safety_module.{h,cpp}`."""

from enum import IntEnum
from typing import Final

WATCHED: Final = ("velocity", "torque", "voltage", "heartbeat", "other")  # three bits each, from bit 0
SAFE, FAULT = 1, 4  # lamps, of three bits; 2 is a warning


class SafetyMode(IntEnum):
    """What the safety module lets the motor controllers do."""

    ESTOP = 0  # no power
    IDLE = 1  # they brake by resistance
    ACTIVE = 2  # they follow their torques


def faults(pendant: int) -> list[str]:
    """Watched quantities whose lamp shows a fault, by the property PEN."""
    return [name for at, name in enumerate(WATCHED) if pendant >> 3 * at & FAULT]


def pendant_of(*faulty: str) -> int:
    """The property PEN with lamps of faults, without buttons, segments and warnings."""
    return 3 << 26 | sum((FAULT if name in faulty else SAFE) << 3 * at for at, name in enumerate(WATCHED))
