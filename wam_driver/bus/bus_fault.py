"""What is wrong on the bus, as data; `event_text` has the sentences."""

from enum import StrEnum

from wam_description.event import Event, Value, fault


class BusFault(StrEnum):
    """Cause of a fault on the bus."""

    # at the start
    NO_SAFETY_MODULE = "bus_no_safety_module"
    MISSING = "bus_missing"
    UNKNOWN_NODE = "bus_unknown_node"
    NOT_MOTOR = "bus_not_motor"
    FIRMWARE = "bus_firmware"
    MIXED_FIRMWARE = "bus_mixed_firmware"
    NOT_AWAKE = "bus_not_awake"
    WRIST = "bus_wrist"
    COUNTS = "bus_counts"
    GAIN = "bus_gain"
    LIMIT = "bus_limit"
    INDEX = "bus_index"
    NOT_ZEROED = "bus_not_zeroed"
    # later
    NO_REPLY = "bus_no_reply"
    NO_MODE = "bus_no_mode"
    JUMP = "bus_jump"
    RESET = "bus_reset"
    ALL_SILENT = "bus_all_silent"
    NO_POWER = "bus_no_power"
    ESTOP = "bus_estop"
    SAFETY_IDLE = "bus_safety_idle"
    SAFETY_SILENT = "bus_safety_silent"
    CONTROLLER_IDLE = "bus_controller_idle"
    FOREIGN = "bus_foreign"
    DOUBLED = "bus_doubled"
    NOT_SENT = "bus_not_sent"

    @property
    def loses_controllers(self) -> bool:
        """Whether the start has to be repeated."""
        return self not in (BusFault.SAFETY_IDLE, BusFault.CONTROLLER_IDLE, BusFault.FOREIGN, BusFault.DOUBLED)

    def event(self, node: int = 0, detail: Value = "") -> Event:
        """The fault with its node and a detail."""
        return fault(self.value, node=node, detail=detail)


class Trouble(Exception):
    """A fault ends the start."""

    def __init__(self, cause: BusFault, node: int = 0, detail: Value = "") -> None:
        super().__init__(cause)
        self.event = cause.event(node, detail)
