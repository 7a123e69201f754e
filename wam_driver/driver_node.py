"""Node `driver`: the arm's hardware as the stack sees it, simulated."""

import time
from typing import Any

from std_srvs.srv import SetBool

from wam_description.interface import declared
from wam_description.signals import Answer, Wrench
from wam_driver.arm_driver_node import ArmDriver
from wam_driver.driver import Driver
from wam_driver.lockstep import Lockstep
from wam_driver.realtime import Realtime
from wam_driver.thresholds import DRIVER
from wam_ros.long_steps import STEPS
from wam_ros.messages import Refused
from wam_ros.ros_parameters import follow


class DriverNode(ArmDriver):
    """Publishes the state of the arm and takes currents; `Lockstep` or `Realtime` advances its time."""

    def __init__(self, **ros: Any) -> None:
        super().__init__(declared("driver"), **ros)
        shared, own = self.shared, self.own
        timing, interface = shared.timing, self.interface
        self.driver = Driver(shared, own)
        self.safety = self.driver.safety
        follow(self, own, self.driver.tune)
        self.inlets.feed("sim/disturbance", self._take_push)
        self.serve("pause", self._pause, SetBool)
        self.serve("reset", self.driver.reset)
        self.serve("step", self._step)
        self.time: Lockstep | Realtime
        if timing.mode == "lockstep":
            self.time = Lockstep(
                self.driver,
                interface,
                self.session,
                self._publish,
                self.announce,
                self.trip,
                time.perf_counter,
                lambda: self.peers.faults,
            )
            self.create_timer(DRIVER.watch, self._watch_lockstep)
            if timing.real_time_factor:
                self.create_timer(timing.period / timing.real_time_factor, self.time.go_on)
            return  # the first status goes to all peers
        self.time = Realtime(self.driver, self._publish, time.perf_counter, lambda: self.peers.held_up(STEPS.nodes))
        advice, senders = self.driver.stale_advice, interface.publishers("motor_current_command")
        self.driver.stale_advice = lambda: "; ".join(
            filter(None, (self.peers.held_up(senders) or advice(), self.lateness))
        )
        self.announce()
        self.create_timer(timing.period, self.time.tick)
        self.time.start()

    def destroy_node(self) -> None:
        """Put on the brakes and report it."""
        self.get_logger().info(f"{self.shared.timing.mode}: {self.time.summary}")
        super().destroy_node()

    # the motors

    @property
    def stamp(self) -> int:
        """Time of the present state, ns."""
        return self.driver.stamp

    def command(self, stamp: int, currents: list[float]) -> None:
        """Take currents, A, that answer the state of a stamp, ns."""
        self.time.take_currents(stamp, currents)

    def obstacle(self) -> str:
        """What speaks against a release of the brakes in the time of the arm."""
        return self.driver.obstacle or self.time.obstacle()

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a person should know: what time does not begin without, else what is near a limit."""
        return (self.unready,) if self.time.start_overdue else tuple(self.driver.warnings)

    @property
    def lateness(self) -> str:
        """How many periods were late and what to do about it, '' where few were."""
        return self.time.lateness

    @property
    def is_paused(self) -> bool:
        """Whether the time of the arm is stopped."""
        return self.time.is_paused

    # the beginning

    @property
    def unready(self) -> str:
        """What the arm still lacks before the brakes may be released, '' where nothing."""
        if self.time.is_started:
            return ""
        awaited = ", ".join(self.peers.absent or self.session.silent) or "the peers of the driver"
        return f"not connected yet: {awaited}; start what is missing, then enable"

    def is_waiting(self) -> bool:
        """Whether a realtime driver waits for all nodes, and for a computer that keeps the periods."""
        return isinstance(self.time, Realtime) and (bool(self.peers.absent) or self.time.settles())

    def _watch_lockstep(self) -> None:
        assert isinstance(self.time, Lockstep)
        self.time.watch()
        if not self.time.is_started and self.health.is_ready and not self.peers.absent:
            self._begin()
        if self.time.start_overdue:
            self.announce()

    def _begin(self) -> None:
        """Begin lockstep when all peers follow this driver."""
        if not self.session.number or self.session.is_overtaken:
            self.session.begin()
            self.announce()
        if not self.session.silent:
            self.time.start()

    # what comes in and goes out

    def _take_push(self, stamp: int, wrench: Wrench) -> None:
        try:
            self.driver.disturb(wrench)
        except ValueError as error:
            raise Refused(str(error)) from error
        finally:
            self.time.take_push(stamp)  # also after a refused push: the state has its answer

    def _pause(self, on: bool) -> Answer:
        self.time.pause(on)
        return Answer(True, "paused" if on else "running")

    def _step(self) -> Answer:
        refusal = self.time.step() if self.is_paused else "the driver is running; call pause first"
        text = f"refused: {refusal}" if refusal else f"stepped; the time of the arm is {self.stamp} ns"
        return Answer(not refusal, text)

    def _publish(self) -> None:
        driver, publish = self.driver, self.outlets.publish
        stamp = driver.stamp
        if self.shared.arm.joint_sensors:
            publish("joint_sensors", stamp, driver.joint_sensors)
        publish("motor_states", stamp, driver.motor_state)
        self.health.counts["steps"] += 1
        if driver.is_outer:
            publish("/clock", stamp, None)
            for topic, value in driver.outer_values().items():
                publish(topic, stamp, value)
        self.health.report(stamp, self.time.facts)
        self.announce()
