"""Loss of each node: SIGKILL, SIGTERM, SIGSTOP, and its start afterwards, in a chain of real processes."""

import math
import signal
import time
from functools import partial
from typing import Any, Final

from wam_description.configuration import Configuration
from wam_description.signals import BASE, ZERO, State, Wrench
from wam_description.wiring import Call
from wam_ros.bring_up import NodeProcess
from wam_ros.client import StackClient
from wam_ros.ros_topics import NAMESPACE
from wam_studies.faults.trials import FAULTS, KEPT, FaultCase, FaultTrial

ANSWERS: Final = {  # a topic that each node publishes in every outer period or more often
    "driver": "motor_states",
    "transform": "joint_states",
    "velocity_loop": "motor_current_command",
    "gravity": "gravity_effort",
    "force_loop": "joint_velocity_command",
    "contact_estimator": "external_joint_torques",
}


class NodeProcesses(StackClient):
    """The chain as processes, and what is seen of it over topics.

    Parameters
    ----------
    configuration : of the nodes.

    Attributes
    ----------
    processes : of the nodes by name.
    stamps : newest stamp of the topic by which each node answers, ns.
    current_stamp : newest stamp of a motor current that is not zero, ns.
    q : true joint angles.
    force : largest true force since it was set, N.
    """

    def __init__(self, configuration: Configuration) -> None:
        super().__init__(name="watcher", shared=configuration.shared)
        self._configuration = configuration
        self.processes: dict[str, NodeProcess] = {}
        for name in ANSWERS:
            if name in configuration.shared.nodes:
                self.start(name)
        self.stamps = dict.fromkeys(self.processes, 0)
        self.current_stamp = 0
        self.q: list[float] = []
        self.force = 0.0
        self._hold: list[float] = []
        self.follow_statuses()
        for name in self.processes:
            self.listen(ANSWERS[name], partial(self._answered, name))
        self.listen("motor_currents", self._take_currents, "effort")
        self.listen("sim/joint_states", self._take_angles, "position")
        self.listen("sim/contact/wrench", self._take_force)

    def start(self, name: str) -> None:
        """Start a node."""
        self.processes[name] = NodeProcess(self._configuration, [name], NAMESPACE, "fatal")

    def close(self) -> None:
        """End all nodes."""
        for process in self.processes.values():
            process.send_signal(signal.SIGKILL)
            process.close()
        super().close()

    def _answered(self, name: str, stamp: int, value: Any) -> None:
        self.stamps[name] = stamp
        if name == "transform" and self._hold:
            self.send("joint_posture_command", stamp, State(self._hold, [], []))
            self.send("force_command", stamp, Wrench(BASE, ZERO, ZERO))

    def _take_currents(self, stamp: int, value: State) -> None:
        self.current_stamp = stamp if any(value.effort) else self.current_stamp

    def _take_angles(self, stamp: int, value: State) -> None:
        self.q = value.position

    def _take_force(self, stamp: int, value: Wrench) -> None:
        self.force = max(self.force, math.hypot(*value.force))

    def watch(self, seconds: float) -> None:
        """Let time pass."""
        self.wait(lambda: False, seconds)

    def enabled(self) -> str:
        """Do what an operator does; returns why the arm cannot be enabled, '' where it is and stays so."""
        end, reason = time.monotonic() + FAULTS.recovered, "not tried"
        while reason and time.monotonic() < end:
            reason = self._attempt()
        return reason and f"the arm cannot be enabled within {FAULTS.recovered:g} s: {reason}"

    def _attempt(self) -> str:
        self._hold = []
        self.request(Call("driver", "reset_fault"), FAULTS.answered)
        reason = self.request(Call("driver", "enable", True), FAULTS.answered).message
        before = dict(self.stamps)

        def silent() -> list[str]:
            return [name for name, stamp in before.items() if self.stamps[name] <= stamp]

        if self.wait(lambda: not silent(), 1.0):
            self._hold = list(self.q)
            self.watch(0.1)
            if self.mode == "enabled":
                return ""
        return f"{reason}; silent: {', '.join(silent()) or 'none'}; {self.statuses.get('driver')}"


WAYS: Final = (signal.SIGSTOP, signal.SIGKILL, signal.SIGTERM)
# with the estimate fed back, the estimator belongs to the chain, too
FEEDBACK: Final = {"timing.timeout": 2.0, "force_loop:feedback": "contact_estimate", "force_loop:guard.mode": "off"}


def play(case: FaultCase) -> FaultTrial:
    """A trial of one loss."""
    chain: NodeProcesses = KEPT.ready(NodeProcesses, case.configuration)
    names = list(chain.processes)
    name = names[case.number % len(names)]
    trial = _lost(case, chain, name, WAYS[case.number // len(names) % len(WAYS)])
    if trial.escapes:
        KEPT.discard()
    return trial


def _lost(case: FaultCase, chain: NodeProcesses, name: str, way: signal.Signals) -> FaultTrial:
    what, chance = f"{name} {way.name}", case.chance
    if reason := chain.enabled():
        return FaultTrial(case.kind, what, 1, (f"before: {reason}",))
    chain.watch(chance.uniform(0.0, 0.1))
    q, chain.force = list(chain.q), 0.0
    process = chain.processes[name]
    process.send_signal(way)
    delay, escapes = math.nan, list[str]()
    if name == "driver":
        chain.watch(chance.uniform(*FAULTS.frozen) if way == signal.SIGSTOP else 0.2)
    else:
        delay = _noticed(chain, name, escapes)
    if way == signal.SIGSTOP:
        process.send_signal(signal.SIGCONT)
    elif not chain.wait(lambda: process.poll() is not None, FAULTS.noticed):
        process.kill()
    others = [one for one, other in chain.processes.items() if one != name and other.poll() is not None]
    if others:
        escapes.append(f"{', '.join(others)} ended, too")
    if way != signal.SIGSTOP:
        chain.start(name)
    if reason := chain.enabled():
        escapes.append(reason)
    is_new_arm = name == "driver" and way != signal.SIGSTOP
    motion = 0.0 if is_new_arm else max(abs(a - b) for a, b in zip(q, chain.q, strict=True))
    escapes += [f"the arm moved {motion:.3f} rad"] * (motion > FAULTS.motion)
    escapes += [f"{chain.force:.0f} N"] * (chain.force > FAULTS.force)
    return FaultTrial(case.kind, what, 1, tuple(escapes), motion, chain.force, delay)


def _noticed(chain: NodeProcesses, name: str, escapes: list[str]) -> float:
    """Wait for the fault that names a lost node; returns the time to zero current, s of the arm's time."""
    if not chain.wait(lambda: chain.mode == "fault", FAULTS.noticed):
        escapes.append(f"not noticed within {FAULTS.noticed:g} s")
    chain.watch(0.05)
    delay = max(0.0, (chain.current_stamp - chain.stamps[name]) * 1e-9)
    if delay > FAULTS.zero_current:
        escapes.append(f"current {delay * 1e3:.0f} ms after the loss")
    texts = " ".join(f"{one.message} {one.fault}" for one in chain.statuses.values())
    if name not in texts and ANSWERS[name] not in texts:
        escapes.append(f"not named: '{chain.statuses['driver'].fault}'")
    return delay
