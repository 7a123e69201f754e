"""Safety states of the driver: braked, enabled, fault.  Stop always works; a fault is latched until its reset."""

from collections.abc import Callable
from enum import Enum

from wam_description.event import CAUSE, Event, fault
from wam_description.event_text import sentence
from wam_description.signals import Answer


class Mode(Enum):
    """State of the driver."""

    BRAKED = "braked"
    ENABLED = "enabled"
    FAULT = "fault"


class Safety:
    """State machine of the driver: it starts braked; a fault is latched; its reset never enables.

    Parameters
    ----------
    release : lets the motors follow commands from now on.
    brake : stops the motors at once.
    held : what holds an arm that is not enabled; a real one has no brakes.

    Attributes
    ----------
    mode : present state.
    events : the first fault since the last reset, and the first damage under the brakes.
    """

    def __init__(
        self, release: Callable[[], object], brake: Callable[[], object], held: str = "the brakes are on"
    ) -> None:
        self._release, self._brake, self.held = release, brake, held
        self.mode = Mode.BRAKED
        self.events: tuple[Event, ...] = ()

    @property
    def fault(self) -> str:
        """The faults in words, '' where there is none."""
        return "; then ".join(map(sentence, self.events))

    def enable(self, obstacle: str) -> Answer:
        """Let the motors follow commands, unless `obstacle` names a reason against it, or they do so already."""
        if self.mode is Mode.ENABLED:
            return Answer(True, "enabled already: nothing has changed")
        if self.mode is Mode.FAULT:
            return Answer(False, f"refused: fault '{self.fault}' is latched; call reset_fault first, then enable")
        if obstacle:
            return Answer(False, f"refused: {obstacle}")
        self.mode = Mode.ENABLED
        self._release()
        return Answer(True, "enabled: the motors follow the commands")

    def disable(self) -> Answer:
        """Brake; works in every state and keeps a latched fault."""
        self._brake()
        if self.mode is Mode.ENABLED:
            self.mode = Mode.BRAKED
        return Answer(True, f"{self.mode.value}: the currents are zero; {self.held}")

    def trip(self, event: Event) -> None:
        """Brake and latch a fault; the first one is kept."""
        if self.mode is not Mode.FAULT:
            self.mode, self.events = Mode.FAULT, (event,)
        self._brake()

    def restate(self, event: Event) -> None:
        """Replace a latched fault by the same one with what is known by now, as the names of nodes."""
        self.events = tuple(event if one.subject == event.subject else one for one in self.events)

    def estop(self) -> Answer:
        """Stop at once and latch a fault."""
        self.trip(fault("emergency_stop"))
        return Answer(True, f"fault: {self.fault}; {self.held}; call reset_fault, then enable")

    def damage(self, event: Event) -> None:
        """Latch the first damage done under the brakes, after the fault that has put them on."""
        if not any(one.values[CAUSE] == event.values[CAUSE] for one in self.events):
            self.mode, self.events = Mode.FAULT, (*self.events, event)

    def reset_fault(self, obstacle: str = "") -> Answer:
        """Clear the fault; the arm stays braked, and `obstacle` names what `enable` would be refused for."""
        if self.mode is not Mode.FAULT:
            return Answer(True, f"{self.mode.value}: no fault was latched")
        cleared, self.events = self.fault, ()
        self.mode = Mode.BRAKED
        return Answer(True, f"braked: fault '{cleared}' cleared; {obstacle or 'call enable to move'}")
