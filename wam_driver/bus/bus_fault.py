"""What is wrong on the bus, as data, and its sentence."""

from enum import Enum


class BusFault(Enum):
    """What is wrong on the bus; the text has fields for the node and a detail."""

    # at the start
    NO_SAFETY_MODULE = "motor controllers answer, the safety module, node 10, does not; check the cable to the pendant"
    MISSING = "motor controller {node} does not answer; check its cable"
    UNKNOWN_NODE = "node {node} is none of this arm; is the configuration that of your arm?"
    NOT_MOTOR = "node {node} has the role {detail}, which is not that of a motor controller"
    FIRMWARE = "node {node}: {detail}"
    MIXED_FIRMWARE = "motor controller {node}: its firmware numbers {detail} differently from controller 1"
    NOT_AWAKE = "motor controller {node} does not wake up; its status is {detail}"
    WRIST = "motor 7 has {detail} poles, 6 are those of the wrist; gimbals have other ratios"
    COUNTS = "motor controller {node} has {detail} counts per turn, allowed 4096 and 40960"
    GAIN = "motor controller {node} has {detail} counts per N m, too far from those of the maker"
    LIMIT = "motor controller {node} has the largest torque {detail}, which is none"
    INDEX = "motor controller {node} has index or group {detail}, with which it takes the torque of another motor"
    NOT_ZEROED = "motor controller {node} is at {detail} counts, not those of home; it did not take its zero"
    # later
    NO_REPLY = "motor controller {node} sends no position"
    JUMP = "the position of motor {node} jumps"
    RESET = "motor controller {node} was reset; its zero is lost"
    ALL_SILENT = "no motor controller answers, the safety module does; check the cable of the bus"
    NO_POWER = "nothing answers on the bus; check power, cable and adapter"
    ESTOP = "E-stop; release it and press Shift-Idle{detail}"
    SAFETY_IDLE = "the safety module went to idle{detail}; press Shift-Activate when the arm may move"
    SAFETY_SILENT = "the safety module does not answer"
    CONTROLLER_IDLE = "motor controller {node} left the torque mode: {detail}"
    FOREIGN = "another computer sends on this bus; end its program"
    DOUBLED = "two nodes have the number {node}"
    NOT_SENT = "the adapter does not take frames: {detail} were refused"

    @property
    def loses_controllers(self) -> bool:
        """Whether the start has to be repeated."""
        kept = (BusFault.SAFETY_IDLE, BusFault.CONTROLLER_IDLE, BusFault.FOREIGN, BusFault.DOUBLED)
        return self not in kept


class Trouble(Exception):
    """A fault, its node and a detail; its text is for people."""

    def __init__(self, fault: BusFault, node: int = 0, detail: object = "") -> None:
        self.fault = fault
        super().__init__(f"bus: {fault.value.format(node=node, detail=detail)}")
