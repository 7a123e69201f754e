"""Limits of the adapter: waits, counts and lengths, each with its unit and its reason."""

from dataclasses import dataclass


@dataclass(frozen=True)
class NodeLimits:
    """A node, its messages and its status."""

    long_step: float = 0.02  # s, from which a step holds up the other nodes of its process; a driver waits 0.025 s
    long_step_look: float = 0.01  # s between two looks for one
    long_step_recent: float = 0.1  # s, in which what the others lack is the consequence of one: twice a watchdog
    service_wait: float = 2.0  # s, after which a request reports that it still waits for its service
    newest_kept: int = 2  # messages; one alone would be lost when the next comes just as it is taken
    claim_period: float = 0.1  # s, between looks for second publishers of topics on which nothing comes
    status_on_its_way: float = 0.2  # s, for a status that is to be repeated; a driver has 0.25 s for it
    status_echo: float = 0.1  # s, for the status that the next one replaces; a frozen node takes nothing
    log_period: float = 1.0  # s between two refusals of a topic in the log
    strays: int = 5  # messages out of order after which two publishers of one node name both count as alive
    fault_held: float = 1.0  # s without a further exception, after which a fault is over
    exception_length: int = 300  # characters of an exception that are reported
    # of a trajectory that is taken: to read and to check it takes 17 ms, less than the driver's watchdog
    trajectory_points: int = 500
    table_rows: int = 256  # of a table that is taken; more than any node publishes, read in 1 ms
    message_size: int = 262_144  # bytes; a trajectory of a 7-joint arm with all its arrays has half of it
    # bytes, which the six nodes of a process read in 15 ms; one of ours with ten long refusals has half of it
    status_size: int = 16_384
    requested_parameters: int = 500  # in one request; a node has half as many
    reason_length: int = 400  # characters; a message may hold a name of any length
    turn: int = 16  # messages handed on in one turn, about two inner periods; then timers and services have theirs


@dataclass(frozen=True)
class ProcessLimits:
    """Processes of nodes: their end and their processors."""

    pulse: float = 0.1  # s, after which an executor is woken, and a timer is called, whose wait has not ended by itself
    arrived: float = 0.5  # s, for what has arrived before the end
    # s, for the last messages of all nodes of this process together; only a listener that is frozen needs it
    delivery: float = 4.0
    short_delivery: float = 0.4  # s, where a listener was killed: the middleware waits for it as for one that is frozen
    end: float = 15.0  # s, for all nodes but the recorder to end on a busy machine; usually they take a tenth of one
    recorder_end: float = 120.0  # s, for a recorder to write its bag, usually less than one; a disk may have to wake up
    end_reports: float = 2.0  # s between two lines about a process that has not ended yet
    share: float = 0.8  # of a processor; a process that takes more leaves other programs no time, at its priority
    share_look: float = 2.0  # s, over which that is measured; the start takes less
    looks: int = 10  # for an idle processor
    look: float = 0.005  # s before each of them


@dataclass(frozen=True)
class RecorderLimits:
    """The recorder."""

    streams: int = 8  # numberings tracked for one topic and publisher
    publishers: int = 64  # publishers counted separately in one topic
    held: int = 1000  # messages that wait for the time at which the recording begins
    name_length: int = 200  # bytes of a publisher's name
    # s, between two looks for messages; one after the other by the executor they cost twice as much
    drain_period: float = 0.01
    announced: float = 1.0  # s, at the end, for messages that were announced
    statuses: int = 64  # in a message of /diagnostics
    count_length: int = 16  # digits of a count in /diagnostics


@dataclass(frozen=True)
class CallLimits:
    """Requests from a shell and to other nodes."""

    answer: float = 10.0  # s, for an answer
    silence: float = 2.0  # s, after which a topic that comes in every period of the arm has stopped
    attempt: float = 0.5  # s, after which a service that is just being discovered gets the request again
    set_attempt: float = 3.3  # s, the same for parameters: the guard takes its time over new gains
    waiting: int = 100  # messages that may wait for a slow terminal
    discovery: float = 2.0  # s, after which no more of a stack comes
    parameters: float = 2.0  # s; an answer can be lost while services are still being discovered


@dataclass(frozen=True)
class ConformanceLimits:
    """The test of a driver against its contract."""

    # s in which the test itself did not run: what a driver does wrong then may be the machine's doing
    pause: float = 0.02
    held_up: int = 3  # times the attempts, that do not count as the test was held up
    enable_attempts: int = 3  # requests to enable
    settle: float = 0.1  # s, for a command to act
    bad_current: float = 0.15  # of the peak current, in commands that have to be refused
    kept: int = 20_000  # messages of a topic
    swing: int = 50  # periods, after which the test current changes its sign
    service_wait: float = 10.0  # s, for a service to be found
    spin: float = 0.005  # s of one turn of the executor
    look: float = 0.4  # s of watching
    start: float = 60.0  # s, for a driver to appear on a busy machine
    person: float = 600.0  # s, for a person to do what the driver waits for
    least_travel: float = 0.02  # rad, below which a velocity cannot be compared
    period_error: float = 0.05  # largest relative difference of the period
    vanish: float = 5.0  # s, for a publisher to vanish


@dataclass(frozen=True)
class TestLimits:
    """The test kit."""

    # nobody uses them by default, and their ports are above those that Linux gives to any program
    domains: range = range(215, 233)
    domain_retry: float = 0.05  # s
    patience: float = 300.0  # s of the wall clock, for what must happen at all on a busy machine
    arm_time: float = 10.0  # s of the arm, for a condition
    lockstep_timeout: float = 15.0  # s for the outputs of a step; while this process does not run, no time is counted
    look: float = 0.05  # s of the wall clock between two looks at a condition while the arm's time does not pass


NODE_LIMITS = NodeLimits()
PROCESS_LIMITS = ProcessLimits()
RECORDER_LIMITS = RecorderLimits()
CALL_LIMITS = CallLimits()
CONFORMANCE_LIMITS = ConformanceLimits()
TEST_LIMITS = TestLimits()
