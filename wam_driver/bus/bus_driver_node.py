"""Node `driver` of a real arm: the contract of docs/driver.md around a motor bus."""

import time
from collections.abc import Sequence
from typing import Any, Protocol

from rclpy.clock import Clock, ClockType
from std_srvs.srv import SetBool, Trigger

from wam_description.arm import Shared
from wam_description.event import RAISED, Event, Level, fault
from wam_description.interface import Interface, declared
from wam_description.parameters import ParameterError
from wam_description.signals import Answer, NodeStatus, State
from wam_description.transmission_map import TransmissionMap
from wam_description.urdf import urdf
from wam_driver.bus.arm_bus import ArmBus
from wam_driver.bus.lines import SIMULATED, line_of
from wam_driver.safety import Mode, Safety
from wam_driver.thresholds import DRIVER
from wam_ros.messages import Refused
from wam_ros.network import take_place
from wam_ros.parameters import declare
from wam_ros.ports import Ports, problem_of
from wam_ros.tolerance import TolerantNode


class Hardware(Protocol):
    """Motors of an arm: `ArmBus`, or a bus of your own.

    Attributes
    ----------
    position, velocity, current : of the motors, rad, rad/s, A, (n,).
    is_running : whether they are known.
    advice : what a person has to do before the motors may be released, '' where nothing.
    fault : why they were braked, '' where there is no reason.
    """

    position: list[float]
    velocity: list[float]
    current: list[float]

    @property
    def is_running(self) -> bool: ...  # noqa: D102 - an attribute
    @property
    def advice(self) -> str: ...  # noqa: D102 - an attribute
    @property
    def fault(self) -> str: ...  # noqa: D102 - an attribute

    def go_on(self) -> None:
        """Take a step of the start, until `is_running`."""

    def exchange(self, periods: int) -> None:
        """Take the state, some periods after the last one."""

    def command(self, currents: Sequence[float]) -> None:
        """Send currents, A, at once; nothing unless released."""

    def release(self) -> None:
        """Let the motors follow commands, zero first."""

    def brake(self) -> None:
        """No current, at once."""

    def stop(self) -> None:
        """Brake as safely as the hardware can."""

    def clear(self) -> None:
        """Forget a fault; the motors stay braked."""

    def confirm_home(self) -> bool:
        """A person states that the arm is at its home pose; whether that was requested."""

    def close(self) -> None:
        """End the connection."""


class BusDriver(TolerantNode):
    """Publishes the state of the hardware in every period and sends it each command, while that is safe.

    A driver of your own replaces `entry`, its declaration, and `make_hardware`.
    """

    entry = "wam_driver.bus.interface:BusInterface"

    def __init__(self, **ros: Any) -> None:
        super().__init__("driver", **ros)
        self._place = take_place(self, "driver")
        declaration = declared(self.entry)
        self.shared, own = declare(self, declaration.parameter_class)
        if self.shared.timing.mode != "realtime":
            raise ParameterError("timing.mode is lockstep, which is for simulated arms; set it to realtime")
        self._watchdog, self._constant = own.watchdog, self.shared.arm.motors.torque_constant
        self.hardware, self.safety = self.make_hardware(self.shared, own), Safety()
        self._tick, self._begin = 1, time.perf_counter()
        self._session, self._since, self._mode = int(time.time() * 1e3), 0, Mode.BRAKED
        self._command_stamp, self._came = 0, -1.0  # before the first: too old
        self._published = ""
        self._ports = Ports(self, declaration, self.shared, Interface(self.shared))
        self._ports.waits = lambda: not self.hardware.is_running
        self._ports.takes_problem = self._trip  # a second publisher of the command
        self._ports.feed("motor_current_command", self._take_currents, "effort")
        self._ports.watch_peers(self._take_peer)
        self.create_service(SetBool, "~/enable", self._serve_enable)
        self.create_service(Trigger, "~/estop", self._serve_stop)
        self.create_service(Trigger, "~/reset_fault", self._serve_reset)
        self.create_service(Trigger, "~/confirm_home", self._serve_home)
        self._ports.publish("robot_description", 0, urdf(self.shared.arm))
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        for period, work in ((self.shared.timing.period, self._run), (DRIVER.status_period, self._announce)):
            self.create_timer(period, work, clock=steady)

    def make_hardware(self, shared: Shared, own: Any) -> Hardware:
        """The motors: those of the production WAM on its bus."""
        arm, timing = shared.arm, shared.timing
        home = TransmissionMap.of(arm).motor_positions(arm.joints.start)
        line = line_of(shared, own)
        if own.interface != SIMULATED:
            self.get_logger().warning("this driver was tested on a simulated bus only, never on a real arm")
        return ArmBus(line, arm.motors.torque_constant, home, timing.period)

    def raise_priority(self) -> None:
        """Ask the system to prefer this process."""
        self._ports.raise_priority(is_first=True)

    @property
    def stamp(self) -> int:
        """Time of the present state, ns: periods counted from 1, times the period."""
        return self._tick * self.shared.timing.period_ns

    def _run(self) -> None:
        hardware, timing = self.hardware, self.shared.timing
        due = int((time.perf_counter() - self._begin) / timing.period) + 1 - self._tick
        if due < 1:
            return
        self._tick += due
        self._ports.counts["late periods"] += due - 1
        if hardware.is_running:
            age = max((self.stamp - self._command_stamp) * 1e-9, time.perf_counter() - self._came)
            if self.safety.mode is Mode.ENABLED and age > self._watchdog:
                cure = f"{due - 1} periods missed, check that velocity_loop runs"
                self._trip(fault("command_stale", age_ms=age * 1e3, allowed_ms=self._watchdog * 1e3, cure=cure))
            hardware.exchange(due)
            self._publish(due)
        else:
            hardware.go_on()
        self._trip(problem_of("hardware", hardware.fault))

    def _publish(self, due: int) -> None:
        """The state; where periods were left out, also the outer ones among them."""
        hardware, timing = self.hardware, self.shared.timing
        torque = [i * k for i, k in zip(hardware.current, self._constant, strict=True)]
        for stamp in range(self.stamp - (due - 1) * timing.period_ns, self.stamp + 1, timing.period_ns):
            is_outer = timing.is_outer(stamp)
            if stamp == self.stamp or is_outer:
                self._ports.publish("motor_states", stamp, State(hardware.position, hardware.velocity, torque))
            if is_outer:
                self._ports.publish("/clock", stamp, None)
                self._ports.publish("motor_currents", stamp, State([], [], hardware.current))
        self._ports.counts["steps"] += 1
        self._ports.report(self.stamp)

    def _take_currents(self, stamp: int, command: State) -> None:
        if not 0 < stamp <= self.stamp:
            raise Refused(f"stamp {stamp} ns is not that of a state that was sent, newest {self.stamp} ns")
        self._came = time.perf_counter()
        if stamp >= max(self._command_stamp, self._since):
            self._command_stamp = stamp
            if self.safety.mode is Mode.ENABLED:
                self.hardware.command(command.effort)

    def _enable(self) -> Answer:
        if self.safety.mode is Mode.ENABLED:
            return Answer(True, "enabled already: nothing has changed")
        faults = [f"{node}: {why}" for node, why in self._ports.faults.items() if why]
        silent = "" if time.perf_counter() - self._came < self._watchdog else "no motor_current_command comes in"
        answer = self.safety.enable(self._ports.problem or self.hardware.advice or "; ".join(faults) or silent)
        if answer.success:
            self._command_stamp = self.stamp
            self.hardware.release()
        return answer

    def _disable(self) -> Answer:
        self.hardware.brake()  # now, not in the next period
        return self.safety.disable()

    def _trip(self, event: Event | None) -> None:
        if event and self.safety.mode is not Mode.FAULT:
            self.safety.trip(event)
            self.get_logger().error(self.safety.fault)
        if event:
            self.hardware.brake()

    def take_fault(self, reason: str) -> None:
        """Brake where a callback of ours raised."""
        self._trip(problem_of(RAISED, reason))

    def _take_peer(self, status: NodeStatus) -> None:
        if status.level is Level.ERROR and status.fault:
            self._trip(fault("node", node=status.node, fault=status.fault, late=""))

    def _serve_enable(self, request: SetBool.Request, response: Any) -> Any:
        return self._answered(self._enable() if request.data else self._disable(), response)

    def _serve_stop(self, _: Any, response: Any) -> Any:
        self.hardware.stop()
        self._trip(fault("emergency_stop"))
        return self._answered(Answer(True, "fault: emergency stop"), response)

    def _serve_reset(self, _: Any, response: Any) -> Any:
        self.hardware.clear()
        return self._answered(self.safety.reset_fault(), response)

    def _serve_home(self, _: Any, response: Any) -> Any:
        is_taken = self.hardware.confirm_home()
        text = "the zero is set" if is_taken else "refused: the driver does not wait for the home pose"
        return self._answered(Answer(is_taken, text), response)

    def _answered(self, answer: Answer, response: Any) -> Any:
        response.success, response.message = answer
        self._announce()
        return response

    def _announce(self) -> None:
        safety, advice = self.safety, self.hardware.advice
        if advice != self._published and safety.mode is not Mode.FAULT:
            self._published = advice
            self.get_logger().info(advice or "the arm may be enabled")
        if safety.mode is not self._mode:
            self._mode, self._since = safety.mode, self.stamp + self.shared.timing.period_ns
        waiting = f"{safety.mode.value}: {advice}" if advice else safety.mode.value
        level, text = (Level.ERROR, safety.fault) if safety.fault else (Level.OK, waiting)
        status = NodeStatus(level, text, "driver", self._ports.ready, safety.mode.value, safety.fault)
        status = status._replace(events=safety.events)
        self._ports.publish_status(status._replace(session=self._session, since=self._since, stamp=self.stamp))

    def destroy_node(self) -> None:
        """Brake, report it, and end when the others have the last messages."""
        self._serve_enable(SetBool.Request(data=False), SetBool.Response())
        self._ports.wait_for_delivery()
        super().destroy_node()
        self.hardware.close()
        self._place.close()
