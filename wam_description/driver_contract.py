"""The contract of a driver of the arm in realtime: what it publishes, takes and promises, one row each.

`docs/driver.md` is the page, `wam_ros.conformance` tests a running driver against it.
"""

from typing import Final, NamedTuple

from wam_description.arm import Shared

STOP: Final = 0.050  # s of the arm's time, from the newest state that was answered to zero current
STATUS_AGE: Final = 0.25  # s, between two repetitions of the status
REPLY: Final = 0.5  # s of the wall clock, for the driver to act on a service or on a status

SENT: Final = ("motor_states", "motor_currents", "/clock", "robot_description")
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
        "publishes motor_states, motor_currents, /clock, robot_description, status and /diagnostics, takes "
        "motor_current_command, serves enable, estop, reset_fault",
        "take names, types and quality of service from docs/topics.md; all of them are reliable",
    ),
    "rate": Requirement(
        "a state in every period; a period of the steady clock is a period of the arm",
        "publish from a timer of timing.period; give the process a priority or a processor of its own",
    ),
    "stamps": Requirement(
        "stamps rise strictly, are multiples of timing.period and above 0",
        "count the periods from 1 and stamp period number times timing.period, not the wall clock",
    ),
    "outer": Requirement(
        "motor_currents and /clock in every outer period, with stamps of states",
        "publish both where shared.timing.is_outer(stamp), with the stamp of the state",
    ),
    "arrays": Requirement(
        "a state has position, velocity and effort of every motor by name, finite",
        "name the motors as arm.motors.names and fill all three arrays",
    ),
    "velocity": Requirement(
        "velocity is the rate of position, rad/s and rad at the motor shaft",
        "convert encoder counts to radians of the motor, and differentiate with the period",
    ),
    "braked": Requirement(
        "begins braked: commands give no current", "let no current flow unless the mode is enabled"
    ),
    "status": Requirement(
        "status is latched, has mode, session and level, and is repeated at least every 0.25 s",
        "publish status transient local, depth 1; repeat it from a timer",
    ),
    "silence": Requirement(
        "refuses enable while no commands come, and states why",
        "answer enable with success false where the last command is older than the watchdog",
    ),
    "current": Requirement(
        "enabled, the commanded amperes flow: motor_currents in A, effort of motor_states in N m",
        "send A in motor_currents and A times arm.motors.torque_constant in the effort",
    ),
    "names": Requirement(
        "a command is matched by name, not by index", "sort the values of a command by its names"
    ),
    "refusals": Requirement(
        "NaN, infinite, short, empty, unknown, doubled: the whole command is refused, the last good one holds",
        "check the whole message before any value of it is used",
    ),
    "answers": Requirement(
        "a command without a stamp, or with one of the future, is refused",
        "refuse stamps that are not above 0 and at most that of the newest state",
    ),
    "watchdog": Requirement(
        "without commands no current flows after 50 ms, and the mode is fault",
        "compare the newest state with the stamp of the last command in every period",
    ),
    "repetition": Requirement(
        "a command that answers an old state again and again is as good as none",
        "let the watchdog use the stamp of the command, not only its arrival",
    ),
    "fault": Requirement(
        "a fault is latched: enable is refused and names it; reset_fault ends braked",
        "keep the first reason until reset_fault, which never enables",
    ),
    "disable": Requirement(
        "enable with false stops the current at once and ends braked", "put on the brakes in the answer itself"
    ),
    "estop": Requirement(
        "estop stops the current at once and latches a fault", "put on the brakes in the answer itself"
    ),
    "discard": Requirement(
        "enable discards every command before it, and moves `since` to the next state",
        "set the command to zero at enable, and since where the brakes are switched",
    ),
    "peers": Requirement(
        "a fault in the status of another node brakes the arm; enable is refused while there is one",
        "listen to status: level ERROR with a fault trips the driver, which names both in an event of its status",
    ),
    "claims": Requirement(
        "two publishers of motor_current_command are a fault, whose event names the topic",
        "count the publishers of the topic in every status period",
    ),
    "agreement": Requirement(
        "brakes, and refuses enable, while the statuses of two nodes have different values of `shared parameters`",
        "compare them as text, with those of your own node where it has them: nodes of two configurations run",
    ),
    "end": Requirement(
        "ended by SIGTERM it brakes first and reports that",
        "disable and publish the status before the node is destroyed",
    ),
    "session": Requirement(
        "started again it is braked and its session is greater",
        "take the session from the wall clock in ms at the start",
    ),
}  # fmt: skip


class DriverContract(NamedTuple):
    """The numbers of the contract on one arm.

    Attributes
    ----------
    motors : names.
    period, outer_period : ns.
    torque_constant : N m/A each; 1 on an arm that is commanded torques.
    peak : A each.
    least_share : of the periods in which a state comes.
    """

    motors: tuple[str, ...]
    period: int
    outer_period: int
    torque_constant: tuple[float, ...]
    peak: tuple[float, ...]
    least_share: float

    @classmethod
    def of(cls, shared: Shared, least_share: float) -> "DriverContract":
        """The contract of a configuration."""
        motors, timing = shared.arm.motors, shared.timing
        peak = tuple(t / k for t, k in zip(motors.peak_torque, motors.torque_constant, strict=True))
        return cls(
            tuple(motors.names), timing.period_ns, timing.outer_period_ns, motors.torque_constant, peak, least_share
        )
