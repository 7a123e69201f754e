"""Node `driver`: the arm's hardware as the stack sees it, simulated."""

import math
import tempfile
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.clock import Clock, ClockType
from std_srvs.srv import SetBool, Trigger

from wam_description.interface import Interface, declared
from wam_description.signals import BASE, Answer, Level, NodeStatus, Point, State, Wrench
from wam_description.urdf import urdf
from wam_driver.driver import Driver, DriverParameters
from wam_driver.safety import Mode
from wam_ros.messages import Refused
from wam_ros.network import take_place
from wam_ros.parameters import declare, follow
from wam_ros.ports import Ports
from wam_ros.run import raise_priority
from wam_ros.tolerance import TolerantNode


class DriverNode(TolerantNode):
    """Publishes the state of the arm and takes currents.

    realtime: a period of the steady clock is a period of the arm; the last command is held.
    lockstep: the arm goes on when the answer to its present state has come.
    """

    def __init__(self, **ros: Any) -> None:
        super().__init__("driver", **ros)
        self._place = take_place(self, "driver")
        shared, own = declare(self, DriverParameters)
        self.driver = Driver(shared, own)
        follow(self, own, lambda new: self.driver.set_added_friction(new.effects.added_coulomb_friction))
        self._ports = ports = Ports(self, declared("driver"), shared, Interface(shared))
        self._arm, self._timing = shared.arm, shared.timing
        self._directory = own.post_mortem_directory
        self._motors = list(shared.arm.motors.names)
        self._frames = (BASE, *shared.arm.covers.names)
        self._currents: tuple[int, list[float]] = (0, [])
        self._push_stamp = 0
        self._paused = False
        self._reported = ("", False)
        self._connected = False
        self._command_came = -math.inf
        self._watchdog = own.watchdog
        ports.feed("motor_current_command", self._take_currents, "effort")
        ports.feed("sim/disturbance", self._take_push)
        ports.watch_peers(self._hear)
        for name, kind, answer in (
            ("enable", SetBool, self._enable),
            ("pause", SetBool, self._pause),
            ("estop", Trigger, lambda _: self.driver.estop()),
            ("reset_fault", Trigger, lambda _: self.driver.reset_fault()),
            ("reset", Trigger, lambda _: self.driver.reset()),
            ("step", Trigger, self._step_once),
        ):
            self.create_service(kind, f"~/{name}", self._served(answer))
        ports.publish("robot_description", 0, urdf(shared.arm))
        self._try_post_mortem()
        if shared.timing.mode == "realtime":  # in lockstep the first status goes to all peers
            self._announce()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._watching = self.create_timer(0.02, self._look_for_start, clock=steady)
        self._now = time.perf_counter
        self._progress = self._now()
        if shared.timing.mode == "lockstep":
            self._is_played = "scenario" in shared.nodes
            self.create_timer(0.1, self._watch_progress, clock=steady)
            self._started = False
        else:
            raise_priority(shared.timing.niceness)
            self._started = True
            self._latencies: list[float] = []
            self._published: deque[tuple[int, float]] = deque(maxlen=100)
            self._done = self._missed = 0
            self.create_timer(shared.timing.period, self._tick, clock=steady)
            # half a period of slack, so that a timer that comes a little early or late misses nothing
            self._begin = self._now() - 0.5 * shared.timing.period
            self._publish()

    def destroy_node(self) -> None:
        """Put on the brakes and say so."""
        self.driver.disable()
        self._announce()
        self._ports.wait_for_delivery()
        super().destroy_node()
        self._place.close()

    def take_fault(self, reason: str) -> None:
        """Brake where a callback raised."""
        if reason:
            self._fault(reason)

    # what comes in

    def _hear(self, status: NodeStatus) -> None:
        """Brake where another node reports a fault."""
        if status.level is Level.ERROR and status.fault:
            self._fault(f"{status.node}: {status.fault}")

    def _take_currents(self, stamp: int, command: State) -> None:
        if self._ports.publisher_count("motor_current_command") > 1:
            self._fault(TWO_PUBLISHERS)
            raise Refused(TWO_PUBLISHERS)
        currents, now = command.effort, self._now()
        if self._timing.mode == "realtime":
            if not 0 < stamp <= self.driver.stamp:
                raise Refused(
                    f"stamp {stamp} ns is not that of a state that was sent, newest {self.driver.stamp} ns; "
                    "answer a state with its own stamp"
                )
            while self._published and self._published[0][0] < stamp:
                self._published.popleft()
            if self._published and self._published[0][0] == stamp:
                self._latencies.append(now - self._published.popleft()[1])
            self.driver.command(stamp, currents)
            self._progress = now
            self._command_came = now
            return
        self._currents = (stamp, currents)
        self._go_on()

    def _take_push(self, stamp: int, wrench: Wrench) -> None:
        if wrench.frame == BASE:
            if any(wrench.force):
                raise Refused(f"frame_id is '{BASE}'; push on one of {', '.join(self._arm.covers.names)}")
            self.driver.plant.release()
        else:
            self.driver.plant.push(wrench.frame, np.array(wrench.force), np.array(wrench.torque))
        self._push_stamp = stamp
        if self._timing.mode == "lockstep":
            self._go_on()

    # lockstep

    def _look_for_start(self) -> None:
        """Say that the peers are connected; in lockstep begin."""
        if self._ports.ready and not self._connected:
            self._connected = True
            self._announce()
        if not self._connected or self._ports.absent:
            return
        self._watching.cancel()
        if not self._started:
            self._started = True
            self._publish()
            self._progress = self._now()

    def _missing(self) -> list[str]:
        stamp = self.driver.stamp
        missing = [] if self._currents[0] == stamp else ["motor_current_command"]
        if self._is_played and self.driver.is_outer and self._push_stamp != stamp:
            missing.append("sim/disturbance")
        return missing

    def _go_on(self) -> None:
        if self._started and not self._paused and not self._missing():
            self._one_period()

    def _one_period(self) -> None:
        self.driver.command(*self._currents)
        self.driver.advance(0.0)
        self._progress = self._now()
        self._publish()
        self._announce()

    def _watch_progress(self) -> None:
        waited = self._now() - self._progress
        if waited < self._timing.timeout or self._paused or not self._started:
            if not self._started and waited > self._timing.timeout:
                absent = ", ".join(self._ports.absent) or "the peers of the driver"
                self.get_logger().warning(f"waiting for {absent} to be ready", throttle_duration_sec=5.0)
            return
        if self.driver.safety.mode is Mode.ENABLED:
            missing = " and ".join(self._missing())
            self._fault(f"lockstep: no {missing} for the state of {self.driver.stamp} ns within {waited:.1f} s")

    # realtime

    def _tick(self) -> None:
        now = self._now()
        due = int((now - self._begin) / self._timing.period) - self._done
        if due <= 0:
            return
        self._done += due
        if self._paused:
            return
        self._missed += due - 1
        age = now - self._progress
        for left in range(due - 1, -1, -1):
            self.driver.advance(age)
            if left == 0 or self.driver.is_outer:
                self._publish()
        self._announce()

    def _timing_facts(self) -> dict[str, str]:
        latencies = sorted(self._latencies) or [float("nan")]
        self._latencies = []
        return {
            "latency p50 [us]": f"{latencies[len(latencies) // 2] * 1e6:.0f}",
            "latency p99 [us]": f"{latencies[int(len(latencies) * 0.99)] * 1e6:.0f}",
            "missed periods": str(self._missed),
            "periods": str(self._done),
            "rate [Hz]": f"{(self._done - self._missed) / (self._now() - self._begin):.1f}",
        }

    # what goes out

    def _publish(self) -> None:
        driver, ports = self.driver, self._ports
        stamp = driver.stamp
        if self._arm.joint_sensors:
            ports.publish("joint_sensors", stamp, driver.joint_sensors)
        if self._timing.mode == "realtime":
            self._published.append((stamp, self._now()))
        ports.publish("motor_states", stamp, driver.motor_state)
        ports.counts["steps"] += 1
        if driver.is_outer:
            load = driver.true_contact
            frame = load.cover or BASE
            ports.publish("/clock", stamp, None)
            ports.publish("motor_currents", stamp, State([], [], driver.currents))
            ports.publish("sim/joint_states", stamp, driver.true_joint_state)
            ports.publish("sim/contact/wrench", stamp, Wrench(frame, load.force, load.moment))
            ports.publish("sim/contact/point", stamp, Point(frame, (load.place, 0.0, 0.0)))
        if self._timing.mode == "realtime" and ports.report_due(stamp):
            ports.facts |= self._timing_facts()
        ports.report(stamp)

    def _announce(self) -> None:
        """Publish the status where it has changed."""
        safety, warnings = self.driver.safety, self.driver.warnings
        message = f"{safety.mode.value}: {safety.fault or '; '.join(warnings)}".removesuffix(": ")
        if (message, self._connected) == self._reported:
            return
        is_new_fault = bool(safety.fault) and message != self._reported[0]
        self._reported = (message, self._connected)
        level = Level.ERROR if safety.fault else Level.WARN if warnings else Level.OK
        if is_new_fault:
            self.get_logger().error(message)
        self._ports.publish_status(
            NodeStatus(
                level,
                message,
                connected=self._connected,
                mode=safety.mode.value,
                fault=safety.fault,
                stamp=self.driver.stamp,
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
        now = self._now()
        obstacle = ""
        if self._ports.publisher_count("motor_current_command") > 1:
            obstacle = TWO_PUBLISHERS
        elif self.count_publishers("motor_states") > 1:
            obstacle = TWO_DRIVERS
        elif faults := [f"{node}: {fault}" for node, fault in sorted(self._ports.faults.items()) if fault]:
            obstacle = "; ".join(faults)
        elif self._timing.mode == "realtime" and now - self._command_came > self._watchdog:
            obstacle = "no motor_current_command comes in; start velocity_loop and its peers, then enable"
        self._progress = now
        return self.driver.enable(obstacle)

    def _pause(self, request: SetBool.Request) -> Answer:
        self._paused = bool(request.data)
        self._progress = self._now()
        if not self._paused and self._timing.mode == "lockstep":
            self._go_on()
        return Answer(True, "paused" if self._paused else "running")

    def _step_once(self, _: Trigger.Request) -> Answer:
        if not self._paused:
            return Answer(False, "refused: the driver is running; call pause first")
        if self._timing.mode == "lockstep":
            if missing := self._missing():
                return Answer(False, f"refused: still waiting for {' and '.join(missing)}")
            self._one_period()
        else:
            self.driver.advance(0.0)
            self._publish()
        return Answer(True, f"at {self.driver.stamp} ns")

    def _fault(self, reason: str) -> None:
        self.driver.fault(reason)
        self._announce()


TWO_DRIVERS = (
    "another driver sends motor_states in this namespace; stop it, or give one of the two another namespace "
    "(-r __ns:=/other) or another ROS_DOMAIN_ID"
)
TWO_PUBLISHERS = (
    "two publishers send motor_current_command; stop all but one ('ros2 topic info -v' lists them), then reset_fault"
)
