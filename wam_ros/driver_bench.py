"""A driver under test: brought into a state, its currents and its mode looked at."""

import math
import statistics
from collections.abc import Callable
from typing import Any

from wam_description.arm import Shared
from wam_description.driver_contract import REPLY, DriverContract
from wam_ros.driver_probe import Arrived, DriverProbe, Spin
from wam_ros.limits import CONFORMANCE_LIMITS

Restart = Callable[[], None]


class Untested(Exception):
    """A row cannot be tested; the text states why."""


class DriverBench(DriverProbe):
    """The probe, and what the checks of the rows do with a driver.

    Parameters
    ----------
    shared : configuration of the arm.
    share : of the periods in which a state has to come.
    current : added to the first motor, A, with a changing sign.
    spin : handles what has arrived, for at most this many seconds.
    ros : as rclpy's Node takes them.

    Attributes
    ----------
    end, restart : end the driver as SIGTERM does and start it again; None where it is not ours to end.
    """

    end: Restart | None = None
    restart: Restart | None = None

    def __init__(self, shared: Shared, share: float, current: float, spin: Spin, **ros: Any) -> None:
        super().__init__(shared, current, spin, **ros)
        self.contract = DriverContract.of(shared, share)

    def brake(self) -> None:
        """To braked, from any state."""
        self.ask("enable", False)
        self.ask("reset_fault")

    def enable(self) -> None:
        """From any state to enabled, with commands that come."""
        answer = (False, "")
        for _ in range(CONFORMANCE_LIMITS.enable_attempts):
            self.brake()
            self.is_answering = True
            self.watch(CONFORMANCE_LIMITS.settle)
            answer = self.ask("enable", True)
            if answer[0] and self.wait(lambda: self.status.mode == "enabled"):
                self.forget()
                self.watch(CONFORMANCE_LIMITS.settle)
                if self.status.mode == "enabled":
                    return
        raise Untested(f"the driver cannot be enabled: {answer[1] or self.status.message or 'no answer'}")

    def states(self) -> list[Arrived]:
        """The states that came."""
        states = list(self.arrived["motor_states"])
        if len(states) < 10:
            raise Untested(f"{len(states)} motor_states came")
        return states

    def flow(self, state: Arrived) -> list[float]:
        """Currents by the effort of a state, A."""
        effort = list(state.message.effort)
        return [t / k for t, k in zip(effort, self.contract.torque_constant, strict=False)]

    def is_zero(self, state: Arrived) -> bool:
        """Whether no current flows, by the effort of a state."""
        flow = self.flow(state)
        return all(abs(i) <= self.tolerance(0.0, peak) for i, peak in zip(flow, self.contract.peak, strict=False))

    @staticmethod
    def tolerance(current: float, peak: float) -> float:
        """Largest difference of a current from the commanded one, A."""
        return 0.1 * abs(current) + 0.005 * peak

    def last_flow(self) -> int:
        """Stamp of the newest state with a current, ns, 0 where there is none."""
        return max((state.stamp for state in self.states() if not self.is_zero(state)), default=0)

    def stops(self, after: int, limit: float) -> str:
        """What is wrong with how the current stops, counted from a stamp, ns, that was the last good one."""
        self.watch(REPLY)
        late = (self.last_flow() - after) * 1e-9
        if late > limit + 1e-9 * self.contract.outer_period:
            return f"current still flows {late * 1e3:.0f} ms later; allowed: {limit * 1e3:.0f} ms"
        return ""

    def in_mode(self, mode: str) -> str:
        """What is wrong with the mode, '' where it is this one."""
        if self.wait(lambda: self.status.mode == mode):
            return ""
        return f"status.mode is '{self.status.mode}'; it has to be '{mode}'"

    def compare(self) -> str:
        """What is wrong with the currents that flow, against those commanded."""
        contract = self.contract
        self.enable()
        differences: list[list[float]] = [[] for _ in contract.motors]
        for _ in range(20):
            self.watch(0.01)
            if not (self.arrived["motor_states"] and self.arrived["motor_currents"]):
                continue
            flow = self.flow(self.arrived["motor_states"][-1])
            sent = list(self.arrived["motor_currents"][-1].message.effort)
            if len(flow) != len(contract.motors) or len(sent) != len(contract.motors):
                return "an effort is missing"
            for i, (by_effort, current) in enumerate(zip(flow, sent, strict=True)):
                wanted = self.commanded[i]
                limit = self.tolerance(wanted, contract.peak[i])
                worst = max(abs(by_effort - wanted), abs(current - wanted))
                differences[i].append(worst if worst > limit else 0.0)
        if self.status.mode != "enabled":
            return f"it does not stay enabled: {self.status.message}"
        for i, found in enumerate(differences):
            if statistics.median(found or [math.inf]):
                return (
                    f"{contract.motors[i]}: commanded {self.commanded[i]:.3g} A, motor_currents has {sent[i]:.3g}, "
                    f"effort of motor_states is {flow[i] * contract.torque_constant[i]:.3g} N m"
                )
        return ""

    def bad(self) -> list[float]:
        """Currents that may not flow, A: of the other sign than those that hold the arm up, so that the two differ."""
        pairs = zip(self.contract.peak, self.carrying, strict=True)
        return [-math.copysign(CONFORMANCE_LIMITS.bad_current * peak, carrying) for peak, carrying in pairs]

    def bears(self, messages: dict[str, Callable[[int], object]]) -> str:
        """What is wrong with how bad commands after good ones are taken."""
        bad = self.bad()
        for what, make in messages.items():
            self.enable()
            self.after = [make] * 5
            self.wait(lambda: not self.after)
            self.watch(CONFORMANCE_LIMITS.settle)
            for state in self.states():
                if not all(map(math.isfinite, state.message.effort)):
                    return f"{what}: the effort is no longer finite"
                for i, flow in enumerate(self.flow(state)):
                    if flow * bad[i] > 0.7 * bad[i] ** 2:
                        return f"{what}: its {flow:.3g} A reached {self.contract.motors[i]}"
            if self.status.mode != "enabled":
                return f"{what}: the driver does not stay enabled: {self.status.message}"
        return ""
