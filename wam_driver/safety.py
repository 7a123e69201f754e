"""Safety states of the driver: braked, enabled, fault.  Stop always works; a fault is latched until its reset."""

from enum import Enum

from wam_description.signals import Answer


class Mode(Enum):
    """State of the driver."""

    BRAKED = "braked"
    ENABLED = "enabled"
    FAULT = "fault"


class Safety:
    """State machine of the driver: it starts braked; a fault is latched; its reset never enables.

    Attributes
    ----------
    mode : present state.
    fault : the first fault since the last reset, and the first damage under the brakes; empty if there is none.
    """

    def __init__(self) -> None:
        self.mode = Mode.BRAKED
        self.fault = ""
        self._is_damaged = False

    def enable(self, obstacle: str) -> Answer:
        """Release the brakes, unless `obstacle` names a reason against it."""
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
        """Latch a fault; the first reason is kept."""
        if self.mode is not Mode.FAULT:
            self.mode, self.fault = Mode.FAULT, reason

    def damage(self, reason: str) -> None:
        """Latch the first damage done under the brakes, after the fault that has put them on."""
        if self._is_damaged:
            return
        self._is_damaged = True
        before = f"{self.fault}; then " if self.mode is Mode.FAULT else ""
        self.mode, self.fault = Mode.FAULT, before + reason

    def reset_fault(self) -> Answer:
        """Clear the fault; the arm stays braked."""
        if self.mode is not Mode.FAULT:
            return Answer(True, f"{self.mode.value}: no fault was latched")
        cleared, self.fault = self.fault, ""
        self._is_damaged = False
        self.mode = Mode.BRAKED
        return Answer(True, f"braked: fault '{cleared}' cleared; call enable to move")
