"""The contract of a driver of the arm in realtime: what it publishes, takes and promises, one row each.

`docs/driver.md` is the page, `wam_ros.conformance` tests a running driver against it.
"""

from typing import Final, NamedTuple

STOP: Final = 0.050  # s of the arm's time, from the newest state that was answered to zero current
STATUS_AGE: Final = 0.25  # s, between two repetitions of the status
REPLY: Final = 0.5  # s of the wall clock, for the driver to act on a service or on a status

SENT: Final = ("motor_states", "motor_currents", "/clock", "robot_description", "/diagnostics")
TAKEN: Final = ("motor_current_command",)
SERVICES: Final = {"enable": True, "estop": False, "reset_fault": False}  # whether it is a SetBool, else a Trigger


class Requirement(NamedTuple):
    """One row of the contract.

    Attributes
    ----------
    text : what a driver does.
    advice : what to do about one that does not.
    """

    text: str
    advice: str


REQUIREMENTS: Final = {
    "interface": Requirement(
        "publishes motor_states, motor_currents, /clock, robot_description, status and /diagnostics; takes "
        "motor_current_command; serves enable, estop, reset_fault",
        "take names, types and quality of service from docs/topics.md; all topics are reliable",
    ),
    "rate": Requirement(
        "publishes a state in every period of the steady clock",
        "publish from a timer of timing.period; give the process a priority or its own processor",
    ),
    "stamps": Requirement(
        "publishes stamps that increase, are multiples of timing.period, and are above 0",
        "count the periods from 1 and stamp period number times timing.period, not the wall clock",
    ),
    "outer": Requirement(
        "publishes motor_currents and /clock in every outer period, with the stamp of a state",
        "publish both where shared.timing.is_outer(stamp), with the stamp of the state",
    ),
    "arrays": Requirement(
        "names every motor in a state, with finite position, velocity and effort",
        "name the motors as arm.motors.names and fill all three arrays",
    ),
    "velocity": Requirement(
        "publishes positions of the motor shafts in rad, and their rates in rad/s",
        "convert encoder counts to radians of the motor, and differentiate with the period",
    ),
    "braked": Requirement(
        "starts braked: commands give no current",
        "let no current flow unless the mode is enabled",
    ),
    "status": Requirement(
        "latches its status, with mode, session and level, and repeats it every 0.25 s",
        "publish status transient local, depth 1; repeat it from a timer",
    ),
    "silence": Requirement(
        "refuses enable with the reason, if no commands come",
        "refuse enable if the last command is older than the watchdog",
    ),
    "current": Requirement(
        "lets the commanded current flow when enabled; motor_currents is in A, motor_states.effort in N m",
        "send A in motor_currents and A times arm.motors.torque_constant in the effort",
    ),
    "names": Requirement(
        "matches a command by name, not by index",
        "sort the values of a command by its names",
    ),
    "refusals": Requirement(
        "refuses the whole command if a value is NaN or infinite, or a motor is missing, unknown or repeated; "
        "keeps the last good command",
        "check the whole message before any value of it is used",
    ),
    "answers": Requirement(
        "refuses a command without a stamp, or with a stamp in the future",
        "accept only stamps above 0 and up to that of the newest state",
    ),
    "watchdog": Requirement(
        "stops the current at most 50 ms after the last command, and faults",
        "compare the newest state with the stamp of the last command in every period",
    ),
    "repetition": Requirement(
        "faults also if commands arrive, but all have the stamp of one old state",
        "let the watchdog use the stamp of the command, not only its arrival",
    ),
    "fault": Requirement(
        "latches a fault: refuses enable and names the fault; is braked after reset_fault",
        "keep the first reason until reset_fault, which never enables",
    ),
    "disable": Requirement(
        "if enable is called with false, stops the current at once and brakes",
        "put on the brakes in the answer itself",
    ),
    "estop": Requirement(
        "on estop, stops the current at once and latches a fault",
        "put on the brakes in the answer itself",
    ),
    "discard": Requirement(
        "at enable, discards older commands and sets `since` to the stamp of the next state",
        "set the command to zero at enable, and `since` when the brakes change",
    ),
    "peers": Requirement(
        "faults if the status of another node has a fault; refuses enable until that ends",
        "read the status of all nodes; brake at level ERROR with a fault, and name both in an event",
    ),
    "claims": Requirement(
        "faults if two publishers send motor_current_command, and names the topic in the event",
        "count the publishers of the topic in every status period",
    ),
    "agreement": Requirement(
        "faults and refuses enable while the `shared parameters` of two nodes differ",
        "compare the texts of all nodes with your own; if they differ, two configurations are in use",
    ),
    "end": Requirement(
        "at SIGTERM, brakes and reports it before the process ends",
        "disable and publish the status before the node is destroyed",
    ),
    "session": Requirement(
        "is braked after a restart, with a greater session number",
        "take the session from the wall clock in ms at the start",
    ),
}  # fmt: skip
