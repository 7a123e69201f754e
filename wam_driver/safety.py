"""The driver's safety: braked, enabled, fault.  Stop always works; a fault stays until it is reset."""

from enum import Enum
from typing import NamedTuple


class Mode(Enum):
    """What the driver lets through."""

    BRAKED = "braked"
    ENABLED = "enabled"
    FAULT = "fault"


class Answer(NamedTuple):
    """Answer to a request: whether it was done, and what to do where it was not."""

    success: bool
    message: str


class Safety:
    """State machine of design rules: starts braked; reset never enables; a fault is latched.

    Attributes
    ----------
    mode : present state.
    fault : the first fault since the last reset, empty where there is none.
    """

    def __init__(self) -> None:
        self.mode = Mode.BRAKED
        self.fault = ""

    def enable(self, obstacle: str) -> Answer:
        """Release the brakes; `obstacle` names what speaks against it, empty where nothing does."""
        if self.mode is Mode.FAULT:
            return Answer(False, f"refused: fault '{self.fault}' is latched; call reset_fault first, then enable")
        if obstacle:
            return Answer(False, f"refused: {obstacle}")
        self.mode = Mode.ENABLED
        return Answer(True, "enabled: brakes released")

    def disable(self) -> Answer:
        """Put on the brakes; works in every state and keeps a latched fault."""
        if self.mode is Mode.ENABLED:
            self.mode = Mode.BRAKED
        return Answer(True, f"{self.mode.value}: brakes on, currents zero")

    def trip(self, reason: str) -> None:
        """Latch a fault; the first one is the one that is kept."""
        if self.mode is not Mode.FAULT:
            self.mode, self.fault = Mode.FAULT, reason

    def reset_fault(self) -> Answer:
        """Clear the fault; the arm stays braked."""
        if self.mode is not Mode.FAULT:
            return Answer(True, f"{self.mode.value}: no fault was latched")
        cleared, self.fault = self.fault, ""
        self.mode = Mode.BRAKED
        return Answer(True, f"braked: fault '{cleared}' cleared; call enable to move")
