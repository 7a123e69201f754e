"""What every node `driver` has, simulated or real: commands, services, status, and the reasons to brake."""

import time
from typing import Any

from std_srvs.srv import SetBool

from wam_description.agreement import DIGESTS, disagreement
from wam_description.event import RAISED, Code, Event, Level, fault
from wam_description.nodes import NODES
from wam_description.signals import Answer, NodeStatus, State
from wam_description.status import PAUSED, guidance
from wam_description.urdf import urdf
from wam_description.wiring import Declaration
from wam_driver.safety import Mode, Safety
from wam_driver.session import Session
from wam_driver.thresholds import DRIVER
from wam_ros.connections import StackNode
from wam_ros.health import problem_of
from wam_ros.limits import NODE_LIMITS
from wam_ros.messages import Refused

PARAMETERS = "parameters of "  # beginning of what a problem concerns, before the name of a node
TWO_DRIVERS = (
    "another driver sends motor_states in this namespace; stop it, or give one of the two another namespace "
    "(-r __ns:=/other) or another ROS_DOMAIN_ID"
)


class ArmDriver(StackNode):
    """A driver without its motors; your own driver adds the methods that raise NotImplementedError.

    Parameters
    ----------
    declaration : of the node.
    ros : context, namespace and so on, as rclpy's Node takes them.

    Attributes
    ----------
    safety : state of the brakes.
    session : that the other nodes follow.
    """

    is_first = True
    safety: Safety

    def __init__(self, declaration: Declaration, **ros: Any) -> None:
        super().__init__(declaration, **ros)
        is_lockstep = self.shared.timing.mode == "lockstep"
        chain = [name for name, one in self.interface.declarations.items() if one.reactions]
        self.session = Session(chain, 0 if is_lockstep else int(time.time() * 1e3))  # ms: no driver before had it
        self._mode, self._answered = Mode.BRAKED, 0  # newest state, ns, that a command has answered
        self._reported: tuple[Any, ...] = ("",)
        self._informed = ("", True, "", False)  # mode, are nodes missing, advice, is a reset arm kept from moving
        self.inlets.feed("motor_current_command", self._take_currents, "effort")
        self.serve("enable", lambda on: self.enable() if on else self.disable(), SetBool)
        self.serve("estop", self.estop)
        self.serve("reset_fault", self.reset_fault)
        self.outlets.publish("robot_description", 0, urdf(self.shared.arm))
        self.create_timer(NODE_LIMITS.claim_period, self._look_at_nodes)
        if not is_lockstep:
            self.create_timer(DRIVER.status_period, self.health.repeat_taken)

    # what a driver adds

    @property
    def stamp(self) -> int:
        """Time of the present state, ns."""
        raise NotImplementedError

    def command(self, stamp: int, currents: list[float]) -> None:
        """Take currents, A, that answer the state of a stamp, ns."""
        raise NotImplementedError

    def obstacle(self) -> str:
        """What speaks against a release of the brakes, when all else is well; '' where nothing does."""
        return ""

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a person should know, though the arm may move."""
        return ()

    @property
    def unready(self) -> str:
        """What the arm still lacks before it may be enabled, '' where nothing."""
        return ""

    @property
    def advice(self) -> str:
        """What a person at the arm has to do for that, '' where nothing."""
        return ""

    @property
    def lateness(self) -> str:
        """How many periods were late and what to do about it, '' where few were."""
        return ""

    @property
    def is_paused(self) -> bool:
        """Whether the time of the arm is stopped."""
        return False

    # what every driver does

    def enable(self) -> Answer:
        """Let the motors follow commands, unless there is a reason against it."""
        return self.safety.enable(self._reason())

    def _reason(self) -> str:
        """What `enable` is refused for, '' where nothing."""
        rival = TWO_DRIVERS if self.count_publishers("motor_states") > 1 else ""
        return self.health.problem or self.unready or rival or self.peers.faults or self.obstacle()

    def disable(self) -> Answer:
        """Brake at once."""
        return self.safety.disable()

    def estop(self) -> Answer:
        """Stop at once and latch a fault."""
        return self.safety.estop()

    def reset_fault(self) -> Answer:
        """Clear a latched fault; the arm stays braked."""
        return self.safety.reset_fault(self._reason())

    def trip(self, event: Event) -> None:
        """Brake, latch a fault, and `announce` it."""
        self.safety.trip(event)
        self.announce()

    def end(self) -> None:
        """Put on the brakes at once; the others hear of it when the node is destroyed."""
        self.disable()
        self.announce()

    def destroy_node(self) -> None:
        """Put on the brakes and report it."""
        self.end()
        super().destroy_node()

    def take_fault(self, reason: str) -> None:
        """Brake where a callback raised."""
        if reason:
            self.trip(fault(RAISED, reason=reason))

    def take_problem(self, problem: Event | None) -> None:
        """Brake an enabled arm for a problem; a braked one is not enabled while there is one."""
        if problem and self.safety.mode is Mode.ENABLED:
            self.trip(problem)
        elif problem:
            self.safety.restate(problem)
        self.announce()

    def take_status(self, status: NodeStatus) -> None:
        """Brake where another node reports a fault, or was started with other shared parameters."""
        is_peer = status.node in self.peers.names
        if is_peer or status.node in NODES:  # a node that this bring-up does not list answers all the same
            reason = disagreement(status.node, self.health.digests, status.facts.get(DIGESTS, ""))
            self.health.set_problem(PARAMETERS + status.node, problem_of("parameters", reason))
        if not is_peer:
            return
        self._inform()
        self.session.hear(status)
        if status.level is Level.ERROR and status.fault:
            found = [one.values["topic"] for one in status.events if one.code is Code.FAULT and "topic" in one.values]
            late = f"; {self.lateness}" if self.lateness else ""
            event = fault("node", node=status.node, fault=status.fault, late=late, topic=next(iter(found), ""))
            stated = {one.subject: one.values.get("fault") for one in self.safety.events}
            if found and stated.get(event.subject) != status.fault:
                self.safety.restate(event)
            self.trip(event)

    def _look_at_nodes(self) -> None:
        """Drop the problem of a node that has ended, or never was, as its status was replayed; inform the user."""
        for concerned in [problem for problem in self.health.problems if problem.startswith(PARAMETERS)]:
            node = concerned.removeprefix(PARAMETERS)
            if node not in self.peers.names and node not in self.get_node_names():
                self.health.set_problem(concerned, None)
        self._inform()

    def _take_currents(self, stamp: int, command: State) -> None:
        if not 0 < stamp <= self.stamp:
            raise Refused(
                f"stamp {stamp} ns is not that of a published state; the newest is {self.stamp} ns; "
                "answer a state with its own stamp"
            )
        if stamp <= self._answered:
            self.inlets.claims["motor_current_command"].stray()
        self._answered = stamp
        self.command(stamp, command.effort)

    def report_ready(self) -> None:
        """All peers are connected."""
        self.announce()

    def announce(self) -> None:
        """Publish the status where it has changed."""
        safety, session = self.safety, self.session
        if safety.mode is not self._mode:
            self._mode = safety.mode
            session.since = self.stamp + self.shared.timing.period_ns
        problem, warnings = self.health.problem, self.warnings
        reasons = tuple(filter(None, (safety.fault, problem))) or warnings
        state = safety.mode, reasons
        reported = (state, self.health.is_ready, session.number, session.since, self.is_paused)
        if reported == self._reported:
            return
        message = f"{safety.mode.value}: {'; '.join(dict.fromkeys(reasons))}".removesuffix(": ")
        if safety.fault and state != self._reported[0]:
            self.get_logger().error(message)
        self._reported = reported
        self.health.publish(
            NodeStatus(
                Level.ERROR if safety.fault or problem else Level.WARN if warnings else Level.OK,
                message,
                mode=safety.mode.value,
                fault=safety.fault,
                session=session.number,
                since=session.since,
                stamp=self.stamp,
                facts={PAUSED: "paused"} if self.is_paused else {},
                events=safety.events,
            )
        )
        self._inform()

    def _inform(self) -> None:
        """Print on the console what the driver's state is and what to call next, where that has changed."""
        mode, absent = self.health.status.mode, self.peers.absent
        before, *_, was_kept = self._informed
        is_braked = mode == Mode.BRAKED.value
        wait = self.advice if is_braked else ""
        # at the start commands come only after the nodes
        reason = self._reason() if is_braked and (was_kept or before == Mode.FAULT.value) else ""
        state = (mode, bool(absent), wait * (not absent), bool(reason))
        if mode and state != self._informed:
            self._informed = state
            is_played = "scenario" in self.shared.nodes
            wait = f"not connected yet: {', '.join(absent)}" if absent else wait or reason
            text = guidance(mode, before, wait, self.get_namespace(), is_played, self.safety.held)
            self.get_logger().info(text)
