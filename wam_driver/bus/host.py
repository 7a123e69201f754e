"""The computer on the bus: it sends and receives frames, and asks nodes for their properties."""

from collections.abc import Container

from wam_description.event import Event
from wam_driver.bus import frames, properties
from wam_driver.bus.bus_fault import BusFault, Trouble
from wam_driver.bus.frames import SAFETY, Frame
from wam_driver.bus.line import Line, incoming
from wam_driver.bus.safety_module import SafetyMode
from wam_driver.thresholds import BUS


class Host:
    """The computer at its end of a line.

    Attributes
    ----------
    versions : of the firmware, by node, of those that are known.
    refused : frames in a row that the adapter has not taken.
    trouble : the first fault, None where there is none.
    counts : errors, lost replies and other things that are no fault if they are rare.
    """

    def __init__(self, line: Line) -> None:
        self.line, self.now = line, line.now
        self.versions: dict[int, int] = {}
        self.refused = 0
        self.trouble: Event | None = None
        self.counts = line.counts

    def send(self, frame: Frame) -> None:
        """Send a frame."""
        if self.line.send(frame):
            self.refused = 0
        else:
            self.refused += 1
            self.counts["frames not sent"] += 1

    def number(self, node: int, name: str) -> int:
        """Number of a property of a node.

        Raises
        ------
        Trouble
            where its firmware has none.
        """
        version = self.versions.get(node, 0)
        found = properties.numbers(version, node == SAFETY).get(name)
        if found is None:
            raise Trouble(BusFault.FIRMWARE, node, f"{name} (its version is {version})")
        return found

    def ask(self, node: int, name: str, attempts: int = BUS.attempts) -> int | None:
        """A property of a node, the position P in counts; None where it does not answer."""
        number = self.number(node, name)
        answer = node, None if name == "P" else number
        for _ in range(attempts):
            self.send(frames.get(node, number))
            for frame in incoming(self.line, BUS.reply + self.line.slack):
                found = frames.read(frame)
                if found and found[:-1] == answer:
                    return found.value
        return None

    def silence(self, otherwise: BusFault) -> BusFault:
        """Why nothing answers, by what the safety module does."""
        mode = self.ask(SAFETY, "MODE", 1)
        if mode is None:
            return BusFault.NO_POWER
        return BusFault.ESTOP if mode == SafetyMode.ESTOP else otherwise

    def demand(
        self, node: int, name: str, allowed: Container[int] | None = None, fault: BusFault = BusFault.MISSING
    ) -> int:
        """A property of a node that has to answer, and to be one of some values.

        Raises
        ------
        Trouble
            where it does not, or is not.
        """
        found = self.ask(node, name)
        if found is None:
            if node == SAFETY:
                raise Trouble(BusFault.NO_SAFETY_MODULE, node)
            raise Trouble(self.silence(BusFault.MISSING), node)
        if allowed is not None and found not in allowed:
            raise Trouble(fault, node, found)
        return found

    def put(self, node: int, name: str, value: int) -> None:
        """Write a property of a node."""
        self.send(frames.put(node, self.number(node, name), value))

    def write(self, node: int, name: str, value: int) -> None:
        """The same, and wait: it takes some time for the node."""
        self.put(node, name, value)
        self.line.sleep(BUS.between_writes)
