"""What is wrong on the bus, as data, and its sentence."""

from enum import Enum


class BusFault(Enum):
    """What is wrong on the bus; the text has fields for the node and a detail."""

    # at the start
    NO_SAFETY_MODULE = (
        "motor controllers answer, but the safety module (node 10) does not; check the cable to the pendant"
    )
    MISSING = "motor controller {node} does not answer; check its cable"
    UNKNOWN_NODE = "node {node} does not belong to this arm; take the configuration of your arm"
    NOT_MOTOR = (
        "node {node} has the role {detail}, which is not the role of a motor controller; disconnect what has its number"
    )
    FIRMWARE = "node {node}: {detail}"
    MIXED_FIRMWARE = "motor controller {node} has another firmware than controller 1: the number of {detail} differs"
    NOT_AWAKE = "motor controller {node} does not wake up; its status is {detail}; switch the arm off and on"
    WRIST = (
        "motor 7 has {detail} poles, allowed 6, those of a wrist; a gimbal has other transmission ratios, and this "
        "driver does not know it"
    )
    COUNTS = "motor controller {node} has {detail} counts per turn, allowed 4096 and 40960"
    GAIN = "motor controller {node} has {detail} counts per N m, far from the maker's value; correct its property IPNM"
    LIMIT = "motor controller {node} has the largest torque (MT) {detail}; it must be above 0"
    INDEX = "motor controller {node} would take the torque of another motor: its index or group is {detail}"
    NOT_ZEROED = (
        "motor controller {node} did not take its zero: it is at {detail} counts, not at those of the home pose"
    )
    # later
    NO_REPLY = "motor controller {node} sends no position; check its cable"
    JUMP = "the position of motor {node} jumps; check its encoder, then start in the home pose again"
    RESET = "motor controller {node} was reset; its zero is lost; check its power, then start in the home pose again"
    ALL_SILENT = "the safety module answers, but no motor controller does; check the cable of the bus"
    NO_POWER = "nothing answers on the bus; check power, cable and adapter"
    ESTOP = "E-stop; release it and press Shift-Idle{detail}"
    SAFETY_IDLE = "the safety module went to idle{detail}; press Shift-Activate when the arm may move"
    SAFETY_SILENT = "the safety module does not answer; check the cable to the pendant"
    CONTROLLER_IDLE = "motor controller {node} left the torque mode: {detail}"
    FOREIGN = "another computer sends on this bus; end its program"
    DOUBLED = "two nodes have the number {node}; give each its own"
    NOT_SENT = "the adapter refused {detail} frames; check adapter, cable and power of the arm"

    @property
    def loses_controllers(self) -> bool:
        """Whether the start has to be repeated."""
        return self not in (BusFault.SAFETY_IDLE, BusFault.CONTROLLER_IDLE, BusFault.FOREIGN, BusFault.DOUBLED)


class Trouble(Exception):
    """A fault, its node and a detail; its text is for people."""

    def __init__(self, fault: BusFault, node: int = 0, detail: object = "") -> None:
        self.fault = fault
        super().__init__(f"bus: {fault.value.format(node=node, detail=detail)}")
