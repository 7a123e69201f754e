"""Node `driver`: the arm's hardware as the stack sees it, simulated."""

import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType
from std_srvs.srv import SetBool, Trigger

from wam_description.event import RAISED, Code, Event, Level, fault
from wam_description.interface import Interface, declared
from wam_description.signals import BASE, Answer, NodeStatus, Point, State, Wrench
from wam_description.status import PAUSED
from wam_description.urdf import urdf
from wam_driver.driver import Driver, DriverParameters
from wam_driver.lockstep import Lockstep
from wam_driver.pacer import Pacer
from wam_driver.realtime import Realtime
from wam_driver.safety import Mode
from wam_driver.session import Session
from wam_driver.thresholds import DRIVER
from wam_ros.long_steps import STEPS
from wam_ros.messages import Refused
from wam_ros.network import take_place
from wam_ros.parameters import declare, follow
from wam_ros.ports import Ports
from wam_ros.tolerance import TolerantNode


class DriverNode(TolerantNode):
    """Publishes the state of the arm and takes currents; `Lockstep` or `Realtime` advances its time."""

    def __init__(self, **ros: Any) -> None:
        super().__init__("driver", **ros)
        self._place = take_place(self, "driver")
        shared, own = declare(self, DriverParameters)
        self.driver = Driver(shared, own)
        follow(self, own, lambda new: self.driver.set_effects(new.effects))
        self._ports = ports = Ports(self, declared("driver"), shared, Interface(shared))
        self._arm, self._timing = shared.arm, shared.timing
        self._directory = own.post_mortem_directory
        self._motors = list(shared.arm.motors.names)
        self._frames = (BASE, *shared.arm.covers.names)
        self._reported = ("", False, 0, 0, False)
        self._connected = self._started = False
        self._answered = 0  # newest state, ns, that a command has answered
        self._mode = self.driver.safety.mode
        is_lockstep = shared.timing.mode == "lockstep"
        chain = [name for name, one in ports.interface.declarations.items() if one.reactions]
        self._session = Session(chain, 0 if is_lockstep else int(time.time() * 1e3))  # ms: no driver before had it
        ports.takes_problem = self._take_problem
        ports.feed("motor_current_command", self._take_currents, "effort")
        ports.feed("sim/disturbance", self._take_push)
        ports.watch_peers(self._take_status)
        self.time: Lockstep | Realtime
        if is_lockstep:
            self.time = Lockstep(
                self.driver,
                shared.timing,
                self._senders(shared.nodes),
                ports.interface.unanswered,
                self._session,
                self._publish,
                self._announce,
                self._fault,
                Pacer(shared.timing.real_time_factor, time.perf_counter),
                time.perf_counter,
            )
        else:
            self.time = Realtime(
                self.driver,
                shared.timing,
                own.watchdog,
                own.late_periods,
                self._publish,
                time.perf_counter,
                lambda: ports.held_up(STEPS.nodes),
            )
            advice = self.driver.stale_advice
            senders = ports.interface.publishers("motor_current_command")
            self.driver.stale_advice = lambda: self._with_lateness(ports.held_up(senders) or advice())
        for name, kind, answer in (
            ("enable", SetBool, self._enable),
            ("pause", SetBool, self._pause),
            ("estop", Trigger, lambda _: self.driver.estop()),
            ("reset_fault", Trigger, lambda _: self.driver.reset_fault()),
            ("reset", Trigger, lambda _: self.driver.reset()),
            ("step", Trigger, lambda _: self.time.step()),
        ):
            self.create_service(kind, f"~/{name}", self._served(answer))
        ports.publish("robot_description", 0, urdf(shared.arm))
        self._try_post_mortem()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._watching = self.create_timer(0.02, self._look_for_start, clock=steady)
        if isinstance(self.time, Lockstep):
            self.create_timer(DRIVER.watch, self._watch_lockstep, clock=steady)
            if factor := shared.timing.real_time_factor:
                self.create_timer(shared.timing.period / factor, self.time.go_on, clock=steady)
        else:
            self._started = True
            ports.waits = lambda: bool(ports.absent) or self.time.settles()
            self._announce()  # in lockstep the first status goes to all peers
            self.create_timer(shared.timing.period, self.time.tick, clock=steady)
            self.create_timer(DRIVER.status_period, ports.repeat_taken_status, clock=steady)
            self.time.start()

    def destroy_node(self) -> None:
        """Put on the brakes and report it."""
        self.driver.disable()
        self._announce()
        self.get_logger().info(f"{self._timing.mode}: {self.time.summary}")
        self._ports.wait_for_delivery()
        super().destroy_node()
        self._place.close()

    def raise_priority(self) -> None:
        """Ask the system to prefer this process."""
        self._ports.raise_priority(is_first=True)

    def take_fault(self, reason: str) -> None:
        """Brake where a callback raised."""
        if reason:
            self._fault(fault(RAISED, reason=reason))

    def _senders(self, nodes: Sequence[str]) -> dict[str, str]:
        """Who answers the state of a period in lockstep, by topic."""
        topics = ["motor_current_command", *(["sim/disturbance"] if "scenario" in nodes else [])]
        return {topic: " and ".join(self._ports.interface.publishers(topic)) or "its publisher" for topic in topics}

    # what comes in

    def _take_currents(self, stamp: int, command: State) -> None:
        if not 0 < stamp <= self.driver.stamp:
            raise Refused(
                f"stamp {stamp} ns is not that of a state that was sent, newest {self.driver.stamp} ns; "
                "answer a state with its own stamp"
            )
        if stamp <= self._answered:
            self._ports.claims.stray("motor_current_command")
        self._answered = stamp
        self.time.take_currents(stamp, command.effort)

    def _take_status(self, status: NodeStatus) -> None:
        """Brake where another node reports a fault; note which session it follows."""
        self._session.hear(status)
        if status.level is Level.ERROR and status.fault:
            found = [one.values["topic"] for one in status.events if one.code is Code.FAULT and "topic" in one.values]
            late = f"; {self.time.lateness}" if self.time.lateness else ""
            self._fault(fault("node", node=status.node, fault=status.fault, late=late, topic=next(iter(found), "")))

    def _with_lateness(self, reason: str) -> str:
        """The reason, and that the computer may be the cause of it where many periods are late."""
        return "; ".join(filter(None, (reason, self.time.lateness)))

    def _take_problem(self, problem: Event | None) -> None:
        if problem and self.driver.safety.mode is Mode.ENABLED:
            self.driver.fault(problem)
        self._announce()

    def end(self) -> None:
        """Put on the brakes at once; the others hear of it when the node is destroyed."""
        self.driver.disable()
        self._announce()

    def _take_push(self, stamp: int, wrench: Wrench) -> None:
        refusal = ""
        try:
            self.driver.disturb(wrench)
        except ValueError as error:
            refusal = str(error)
        self.time.take_push(stamp)  # also after a refused push: the state has its answer
        if refusal:
            raise Refused(refusal)

    def _look_for_start(self) -> None:
        """Report that the peers are connected; in lockstep begin."""
        if self._ports.ready and not self._connected:
            self._connected = True
            self._announce()
        if not self._connected or self._ports.absent:
            return
        if not self._started:
            if not self._session.number or self._session.is_overtaken:
                self._session.begin()
                self._announce()
            if self._session.silent:
                return
        self._watching.cancel()
        if not self._started:
            self._started = True
            self.time.start()

    def _watch_lockstep(self) -> None:
        assert isinstance(self.time, Lockstep)
        self.time.watch()
        if self.time.start_overdue:
            self.get_logger().warning(f"waiting for {self.awaited} to be ready", throttle_duration_sec=5.0)

    @property
    def awaited(self) -> str:
        """Nodes without which lockstep does not start, '' once it has."""
        if self._started:
            return ""
        return ", ".join(self._ports.absent or self._session.silent) or "the peers of the driver"

    # what goes out

    def _publish(self) -> None:
        driver, ports = self.driver, self._ports
        stamp = driver.stamp
        if self._arm.joint_sensors:
            ports.publish("joint_sensors", stamp, driver.joint_sensors)
        ports.publish("motor_states", stamp, driver.motor_state)
        ports.counts["steps"] += 1
        if driver.is_outer:
            load = driver.true_contact
            frame = load.cover or BASE
            ports.publish("/clock", stamp, None)
            ports.publish("motor_currents", stamp, State([], [], driver.currents))
            ports.publish("sim/joint_states", stamp, driver.true_joint_state)
            ports.publish("sim/contact/wrench", stamp, Wrench(frame, load.force, load.moment))
            ports.publish("sim/contact/point", stamp, Point(frame, (load.position, 0.0, 0.0)))
            if objects := driver.true_objects:
                ports.publish("sim/objects", stamp, objects)
        if ports.report_due(stamp):
            ports.facts |= self.time.facts()
        ports.report(stamp)
        self._announce()

    def _announce(self) -> None:
        """Publish the status where it has changed."""
        safety, warnings = self.driver.safety, self.driver.warnings
        if safety.mode is not self._mode:
            self._mode = safety.mode
            self._session.since = self.driver.stamp + self._timing.period_ns
        problem = self._ports.problem
        message = f"{safety.mode.value}: {safety.fault or problem or '; '.join(warnings)}".removesuffix(": ")
        reported = (message, self._connected, self._session.number, self._session.since, self.time.is_paused)
        if reported == self._reported:
            return
        is_new_fault = bool(safety.fault) and message != self._reported[0]
        self._reported = reported
        level = Level.ERROR if safety.fault or problem else Level.WARN if warnings else Level.OK
        if is_new_fault:
            self.get_logger().error(message)
        self._ports.publish_status(
            NodeStatus(
                level,
                message,
                connected=self._connected,
                mode=safety.mode.value,
                fault=safety.fault,
                session=self._session.number,
                since=self._session.since,
                stamp=self.driver.stamp,
                facts={PAUSED: "paused"} if self.time.is_paused else {},
                events=safety.events,
            )
        )
        if is_new_fault:
            self._write_post_mortem()

    def _write_post_mortem(self) -> None:
        if not self._directory:
            return
        path = Path(self._directory) / f"post_mortem_{self.driver.stamp}.csv"
        names = [f"{what} {motor}" for what in ("theta", "thetad", "commanded", "actual") for motor in self._motors]
        rows = [",".join(["stamp", *names])]
        rows += [
            ",".join(map(repr, (s.stamp, *s.theta, *s.thetad, *s.commanded, *s.actual))) for s in self.driver.recent
        ]
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text("\n".join(rows) + "\n", encoding="utf-8")
        except OSError as error:
            self._warn_of_post_mortem(error)
        else:
            self.get_logger().error(f"the last {len(self.driver.recent)} samples are in {path}")

    def _try_post_mortem(self) -> None:
        """Warn at the start where the samples of a fault could not be written."""
        if not self._directory:
            return
        try:
            Path(self._directory).mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=self._directory).close()
        except OSError as error:
            self._warn_of_post_mortem(error)

    def _warn_of_post_mortem(self, error: OSError) -> None:
        reason = f"post_mortem_directory {self._directory} cannot be written: {error.strerror or error}"
        self._ports.facts["post_mortem"] = reason
        self.get_logger().warning(f"{reason}; the last samples before a fault are not kept, give another directory")

    # services

    def _served(self, answer: Callable[[Any], Answer]) -> Callable[[Any, Any], Any]:
        def serve(request: Any, response: Any) -> Any:
            response.success, response.message = answer(request)
            self._announce()
            return response

        return serve

    def _enable(self, request: SetBool.Request) -> Answer:
        if not request.data:
            return self.driver.disable()
        if self.driver.safety.mode is Mode.ENABLED:
            return self.driver.enable("")
        if self.awaited and not self._ports.problem:  # which may be why nodes are not connected
            return Answer(False, f"refused: not connected yet: {self.awaited}; start what is missing, then enable")
        faults = {node: fault for node, fault in sorted(self._ports.faults.items()) if fault}
        if problem := self._ports.problem:
            obstacle = problem
        elif self.count_publishers("motor_states") > 1:
            obstacle = TWO_DRIVERS
        elif faults:
            obstacle = "; ".join(f"{node}: {fault}" for node, fault in faults.items())
        else:
            obstacle = self.time.obstacle()
        return self.driver.enable(obstacle)

    def _pause(self, request: SetBool.Request) -> Answer:
        self.time.pause(bool(request.data))
        return Answer(True, "paused" if request.data else "running")

    def _fault(self, event: Event) -> None:
        self.driver.fault(event)
        self._announce()


TWO_DRIVERS = (
    "another driver sends motor_states in this namespace; stop it, or give one of the two another namespace "
    "(-r __ns:=/other) or another ROS_DOMAIN_ID"
)
