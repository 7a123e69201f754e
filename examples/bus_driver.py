"""A driver of your own: the skeleton around a motor bus, here `fake_bus.py`.  Test it, then run the stack on it.

PYTHONPATH=. wam conform --config bus_driver.yaml
PYTHONPATH=. wam up --config bus_driver.yaml
"""

import time
from typing import Any

from fake_bus import FakeBus
from rclpy.clock import Clock, ClockType
from std_srvs.srv import SetBool, Trigger

from wam_description.event import Level
from wam_description.interface import Interface, declared
from wam_description.signals import Answer, NodeStatus, State
from wam_description.urdf import urdf
from wam_driver.safety import Mode, Safety
from wam_ros.messages import Refused
from wam_ros.network import take_place
from wam_ros.parameters import declare
from wam_ros.ports import Ports
from wam_ros.tolerance import TolerantNode

STATUS_PERIOD = 0.05  # s


class BusInterface:
    """What the stack knows of this driver: like the simulated one, without the topics of the simulation."""

    name, parameters = "driver", "wam_driver.driver:DriverParameters"
    ros_node = "bus_driver:BusDriver"
    sources = ("motor_states", "motor_currents", "robot_description", "/clock")
    listens = ("motor_current_command",)


class BusDriver(TolerantNode):
    """Publishes the state of the bus in every period and sends it the last command, while that is safe."""

    def __init__(self, **ros: Any) -> None:
        super().__init__("driver", **ros)
        self._place = take_place(self, "driver")
        self.shared, own = declare(self, declared("bus_driver:BusInterface").parameter_class)
        motors = self.shared.arm.motors
        self._constant, self._watchdog = motors.torque_constant, own.watchdog
        self._peak = [t / k for t, k in zip(motors.peak_torque, self._constant, strict=True)]
        self.bus, self.safety = FakeBus(self._constant), Safety()
        self._tick, self._begin, self._zero = 1, time.perf_counter(), [0.0] * len(self._peak)
        self._session, self._since, self._mode = int(time.time() * 1e3), 0, Mode.BRAKED
        self._command, self._command_stamp, self._came = self._zero, 0, -1.0  # before the first: too old
        self._ports = Ports(self, declared("bus_driver:BusInterface"), self.shared, Interface(self.shared))
        self._ports.takes_problem = self._trip  # a second publisher of the command
        self._ports.feed("motor_current_command", self._take_currents, "effort")
        self._ports.watch_peers(self._take_peer)
        self.create_service(SetBool, "~/enable", self._serve_enable)
        self.create_service(Trigger, "~/estop", self._serve_stop)
        self.create_service(Trigger, "~/reset_fault", self._serve_reset)
        self._ports.publish("robot_description", 0, urdf(self.shared.arm))
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        for period, work in ((self.shared.timing.period, self._run), (STATUS_PERIOD, self._announce)):
            self.create_timer(period, work, clock=steady)

    @property
    def stamp(self) -> int:
        """Time of the present state, ns: periods counted from 1, times the period."""
        return self._tick * self.shared.timing.period_ns

    def _run(self) -> None:
        period = self.shared.timing.period
        due = int((time.perf_counter() - self._begin) / period) + 1 - self._tick
        for left in range(due - 1, -1, -1):
            self._tick += 1
            is_enabled = self.safety.mode is Mode.ENABLED
            age = max((self.stamp - self._command_stamp) * 1e-9, time.perf_counter() - self._came)
            if is_enabled and age > self._watchdog:
                self._trip(f"command stale: {age * 1e3:.0f} ms old; check that velocity_loop runs")
                is_enabled = False
            self.bus.write(self._command if is_enabled else self._zero, not is_enabled, period)
            if left == 0 or self.shared.timing.is_outer(self.stamp):
                self._publish()

    def _publish(self) -> None:
        bus = self.bus
        torque = [i * k for i, k in zip(bus.current, self._constant, strict=True)]
        self._ports.publish("motor_states", self.stamp, State(bus.position, bus.velocity, torque))
        if self.shared.timing.is_outer(self.stamp):
            self._ports.publish("/clock", self.stamp, None)
            self._ports.publish("motor_currents", self.stamp, State([], [], bus.current))
        self._ports.report(self.stamp)

    def _take_currents(self, stamp: int, command: State) -> None:
        if not 0 < stamp <= self.stamp:
            raise Refused(f"stamp {stamp} ns is not that of a state that was sent, newest {self.stamp} ns")
        self._came = time.perf_counter()
        if stamp >= max(self._command_stamp, self._since):
            self._command = [min(max(i, -most), most) for i, most in zip(command.effort, self._peak, strict=True)]
            self._command_stamp = stamp

    def _enable(self) -> Answer:
        faults = [f"{node}: {fault}" for node, fault in self._ports.faults.items() if fault]
        silent = "" if time.perf_counter() - self._came < self._watchdog else "no motor_current_command comes in"
        if self.safety.mode is not Mode.ENABLED:
            self._command, self._command_stamp = self._zero, self.stamp
        return self.safety.enable(self._ports.problem or "; ".join(faults) or silent)

    def _disable(self) -> Answer:
        self._command = self._zero
        self.bus.write(self._zero, True, 0.0)  # now, not in the next period
        return self.safety.disable()

    def _trip(self, reason: str) -> None:
        if reason:
            self.safety.trip(reason)
            self._disable()

    take_fault = _trip  # what a callback of ours raised

    def _take_peer(self, status: NodeStatus) -> None:
        self._trip(f"{status.node}: {status.fault}" if status.level is Level.ERROR and status.fault else "")

    def _serve_enable(self, request: SetBool.Request, response: Any) -> Any:
        return self._answered(self._enable() if request.data else self._disable(), response)

    def _serve_stop(self, _: Any, response: Any) -> Any:
        self._trip("emergency stop")
        return self._answered(Answer(True, "fault: emergency stop"), response)

    def _serve_reset(self, _: Any, response: Any) -> Any:
        return self._answered(self.safety.reset_fault(), response)

    def _answered(self, answer: Answer, response: Any) -> Any:
        response.success, response.message = answer
        self._announce()
        return response

    def _announce(self) -> None:
        safety = self.safety
        if safety.mode is not self._mode:
            self._mode, self._since = safety.mode, self.stamp + self.shared.timing.period_ns
        level, text = (Level.ERROR, safety.fault) if safety.fault else (Level.OK, safety.mode.value)
        status = NodeStatus(level, text, "driver", self._ports.ready, safety.mode.value, safety.fault)
        self._ports.publish_status(status._replace(session=self._session, since=self._since, stamp=self.stamp))

    def destroy_node(self) -> None:
        """Brake, report it, and end when the others have the last messages."""
        self._serve_enable(SetBool.Request(data=False), SetBool.Response())
        self._ports.wait_for_delivery()
        super().destroy_node()
        self._place.close()
