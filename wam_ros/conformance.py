"""Tests a running driver against its contract (`wam_description.driver_contract`), row by row, over topics."""

import math
import os
import statistics
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import NamedTuple

from wam_description.driver_contract import REPLY, REQUIREMENTS, SENT, STATUS_AGE, STOP, TAKEN, DriverContract
from wam_description.signals import Level, State
from wam_ros.driver_probe import Arrived, DriverProbe
from wam_ros.messages import joint_state

TRIES = 3  # to enable
LOOK = 0.4  # s of watching
PATIENCE_OF_GRAPH = 5.0  # s, for a publisher to vanish
START = 20.0  # s, for a driver to appear
SETTLE = 0.1  # s
TRAVEL = 0.02  # rad, below which a velocity cannot be compared
RATE = 0.05  # largest relative difference of the period
PAUSE = 0.02  # s in which the test itself did not run: what a driver does wrong then may be the machine's doing
MOST_HELD_UP = 3  # times the attempts, that do not count as the test was held up
BAD = 0.15  # of the peak current, in commands that have to be refused
OK, WRONG, NOT_TESTED = "ok", "WRONG", "not tested"
Restart = Callable[[], None]


class ConformanceRow(NamedTuple):
    """What was found for one row of the contract: ok, WRONG or not tested, and what is wrong."""

    key: str
    verdict: str
    found: str = ""

    @property
    def text(self) -> str:
        """For people: the verdict, the row and, where it is wrong, what to do."""
        requirement = REQUIREMENTS[self.key]
        lines = [f"{self.verdict:<10}  {self.key:<10}  {requirement.text}"]
        if self.found:
            lines.append(f"{'':24}{self.found}")
        if self.verdict == WRONG:
            lines.append(f"{'':24}-> {requirement.advice}")
        return "\n".join(lines)


class Untested(Exception):
    """A row cannot be tested; the text says why."""


class Conformance:
    """The rows of the contract, tested one after the other.

    Each check returns what is wrong, '' where nothing is.

    Parameters
    ----------
    probe : in the place of the velocity loop.
    contract : numbers of the arm.
    attempts : at each row, as a machine that is busy delays a driver that is right; one in which the test itself was
        held up does not count.
    end, restart : end the driver as SIGTERM does and start it again; None where it is not ours to end.
    """

    def __init__(
        self,
        probe: DriverProbe,
        contract: DriverContract,
        attempts: int,
        end: Restart | None = None,
        restart: Restart | None = None,
    ) -> None:
        self._probe, self._contract, self._attempts = probe, contract, attempts
        self._end_driver, self._restart = end, restart

    def rows(self) -> Iterator[ConformanceRow]:
        """Test every row, each until it is right or there are no more attempts."""
        blocked = ""
        for key in REQUIREMENTS:
            row = ConformanceRow(key, NOT_TESTED, blocked) if blocked else self.row(key)
            if key == "interface" and row.verdict == WRONG:
                blocked = "the interface is not there"
            yield row
        self._brake()

    def row(self, key: str) -> ConformanceRow:
        """Test one row."""
        check: Callable[[], str] = getattr(self, f"_{key}")
        row = ConformanceRow(key, NOT_TESTED)
        left = held_up = 1 if key in ("interface", "end", "session") else self._attempts
        held_up *= MOST_HELD_UP
        while left and held_up:
            self._probe.longest_pause = 0.0
            try:
                found = check()
                row = ConformanceRow(key, WRONG if found else OK, found)
            except Untested as reason:
                row = ConformanceRow(key, NOT_TESTED, str(reason))
            finally:
                self._probe.be_proper()
            if row.verdict == OK:
                break
            pause = self._probe.longest_pause
            left, held_up = (left, held_up - 1) if pause > PAUSE else (left - 1, held_up)
        if row.verdict != OK and not held_up:
            row = row._replace(
                found=f"{row.found} (this machine held up the test itself, last by {1e3 * pause:.0f} ms)"
            )
        return row

    # states

    def _brake(self) -> None:
        self._probe.ask("enable", False)
        self._probe.ask("reset_fault")

    def _enable(self) -> None:
        """From any state to enabled, with commands that come."""
        probe = self._probe
        answer = (False, "")
        for _ in range(TRIES):
            self._brake()
            probe.is_answering = True
            probe.watch(SETTLE)
            answer = probe.ask("enable", True)
            if answer[0] and probe.wait(lambda: probe.status.mode == "enabled"):
                probe.forget()
                probe.watch(SETTLE)
                if probe.status.mode == "enabled":
                    return
        raise Untested(f"the driver cannot be enabled: {answer[1] or probe.status.message or 'no answer'}")

    def _states(self) -> list[Arrived]:
        states = list(self._probe.arrived["motor_states"])
        if len(states) < 10:
            raise Untested(f"{len(states)} motor_states came")
        return states

    def _flow(self, state: Arrived) -> list[float]:
        """Currents by the effort of a state, A."""
        effort = list(state.message.effort)
        return [t / k for t, k in zip(effort, self._contract.torque_constant, strict=False)]

    def _is_zero(self, state: Arrived) -> bool:
        flow = self._flow(state)
        return all(abs(i) <= self._tolerance(0.0, peak) for i, peak in zip(flow, self._contract.peak, strict=False))

    @staticmethod
    def _tolerance(current: float, peak: float) -> float:
        return 0.1 * abs(current) + 0.005 * peak

    def _last_flow(self) -> int:
        """Stamp of the newest state with a current, ns, 0 where there is none."""
        return max((state.stamp for state in self._states() if not self._is_zero(state)), default=0)

    def _stops(self, after: int, limit: float) -> str:
        """What is wrong with how the current stops, counted from a stamp, ns, that was the last good one."""
        self._probe.watch(REPLY)
        late = (self._last_flow() - after) * 1e-9
        if late > limit + 1e-9 * self._contract.outer_period:
            return f"current still flows {late * 1e3:.0f} ms later; allowed: {limit * 1e3:.0f} ms"
        return ""

    def _in_mode(self, mode: str) -> str:
        probe = self._probe
        if probe.wait(lambda: probe.status.mode == mode):
            return ""
        return f"status.mode is '{probe.status.mode}'; it has to be '{mode}'"

    # what it sends

    def _interface(self) -> str:
        probe = self._probe

        def lacking() -> list[str]:
            found = probe.lacking(SENT, TAKEN)
            name = f"{probe.get_namespace().strip('/')}: driver"
            return found if name in probe.diagnostics else [*found, f"/diagnostics of '{name}'"]

        probe.wait(lambda: not lacking(), START)
        return f"{', '.join(found)} not found" if (found := lacking()) else ""

    def _rate(self) -> str:
        self._probe.forget()
        self._probe.watch(2 * LOOK)
        states, period = self._states(), self._contract.period
        elapsed = states[-1].when - states[0].when
        advanced = (states[-1].stamp - states[0].stamp) * 1e-9
        if abs(advanced / elapsed - 1.0) > RATE:
            return f"stamps advance by {advanced:.3f} s in {elapsed:.3f} s"
        share = len(states) * period * 1e-9 / elapsed
        if not self._contract.least_share <= share <= 1.0 + 2 * RATE:
            busy, cores = os.getloadavg()[0], os.cpu_count() or 1
            why = f"; {busy:.0f} processes want the {cores} processors of this machine" if busy > cores else ""
            return f"{len(states)} states in {elapsed:.2f} s, {share:.0%} of the periods{why}"
        return ""

    def _stamps(self) -> str:
        self._probe.watch(LOOK)
        stamps = [state.stamp for state in self._states()]
        for before, stamp in pairwise(stamps):
            if stamp <= before:
                return f"after {before} ns comes {stamp} ns"
        wrong = next((stamp for stamp in stamps if stamp <= 0 or stamp % self._contract.period), None)
        return f"{wrong} ns is no multiple of {self._contract.period} ns" if wrong is not None else ""

    def _outer(self) -> str:
        self._probe.forget()
        self._probe.watch(LOOK)
        states = {state.stamp for state in self._states()}
        period, outer = self._contract.period, self._contract.outer_period
        due = sum((stamp - period) % outer == 0 for stamp in states)
        for topic in ("motor_currents", "/clock"):
            stamps = {one.stamp for one in self._probe.arrived[topic]}
            strange = sorted(stamp for stamp in stamps if (stamp - period) % outer)
            if strange:
                return f"{topic} has the stamp {strange[0]} ns, which begins no outer period"
            if len(stamps & states) < self._contract.least_share * due - 2:
                return f"{topic} came {len(stamps)} times in {due} outer periods"
        return ""

    def _arrays(self) -> str:
        self._probe.watch(SETTLE)
        names = list(self._contract.motors)
        for _, _, message in self._states():
            if list(message.name) != names:
                return f"names are {', '.join(message.name) or 'none'}; motors are {', '.join(names)}"
            for field in State._fields:
                values = list(getattr(message, field))
                if len(values) != len(names) or not all(map(math.isfinite, values)):
                    return f"{field} is {values}"
        return ""

    def _velocity(self) -> str:
        self._enable()
        self._probe.watch(LOOK)
        states = self._states()
        compared = []
        for i, name in enumerate(self._contract.motors):
            moved = travelled = integral = 0.0
            for before, after in pairwise(states):
                step = after.message.position[i] - before.message.position[i]
                moved += step
                travelled += abs(step)
                dt = (after.stamp - before.stamp) * 1e-9
                integral += 0.5 * (before.message.velocity[i] + after.message.velocity[i]) * dt
            if travelled < TRAVEL:
                continue
            compared.append(name)
            if abs(integral - moved) > 0.1 * travelled:
                return f"{name} moved {moved:.4f} rad, the integral of its velocity is {integral:.4f} rad"
        if not compared:
            raise Untested(f"no motor moved {TRAVEL} rad; give a larger --current")
        return ""

    def _braked(self) -> str:
        self._brake()
        if wrong := self._in_mode("braked"):
            return wrong
        self._probe.watch(SETTLE)
        self._probe.forget()
        self._probe.watch(SETTLE)
        return "a current flows" if self._last_flow() else ""

    def _status(self) -> str:
        probe = self._probe
        before = len(probe.statuses)
        probe.watch(4 * STATUS_AGE)
        times = [when for when, _ in probe.statuses][before:]
        status = probe.status
        if not (status.session and status.mode):
            return f"session is {status.session or 'missing'}, mode is '{status.mode}'"
        if len(times) < 2 or statistics.median(b - a for a, b in pairwise(times)) > STATUS_AGE:
            return f"{len(times)} came in {4 * STATUS_AGE:g} s"
        infos = probe.get_publishers_info_by_topic("status")
        if not all(info.qos_profile.durability.name == "TRANSIENT_LOCAL" for info in infos):
            return "it is not latched: durability is not transient local"
        return ""

    # what it takes

    def _silence(self) -> str:
        self._brake()
        self._probe.is_answering = False
        self._probe.watch(3 * SETTLE)
        done, text = self._probe.ask("enable", True)
        if done or not text:
            return f"it answers {'success' if done else 'a refusal without a reason'}: '{text}'"
        return ""

    def _compare(self) -> str:
        """What is wrong with the currents that flow, against those commanded."""
        probe, contract = self._probe, self._contract
        self._enable()
        differences: list[list[float]] = [[] for _ in contract.motors]
        for _ in range(20):
            probe.watch(0.01)
            if not (probe.arrived["motor_states"] and probe.arrived["motor_currents"]):
                continue
            flow = self._flow(probe.arrived["motor_states"][-1])
            sent = list(probe.arrived["motor_currents"][-1].message.effort)
            if len(flow) != len(contract.motors) or len(sent) != len(contract.motors):
                return "an effort is missing"
            for i, (by_effort, current) in enumerate(zip(flow, sent, strict=True)):
                wanted = probe.commanded[i]
                limit = self._tolerance(wanted, contract.peak[i])
                worst = max(abs(by_effort - wanted), abs(current - wanted))
                differences[i].append(worst if worst > limit else 0.0)
        if probe.status.mode != "enabled":
            return f"it does not stay enabled: {probe.status.message}"
        for i, found in enumerate(differences):
            if statistics.median(found or [math.inf]):
                return (
                    f"{contract.motors[i]}: commanded {probe.commanded[i]:.3g} A, motor_currents has {sent[i]:.3g}, "
                    f"effort of motor_states is {flow[i] * contract.torque_constant[i]:.3g} N m"
                )
        return ""

    def _current(self) -> str:
        return self._compare()

    def _names(self) -> str:
        names = list(self._contract.motors)[::-1]
        self._probe.wanted = lambda stamp, currents: joint_state(stamp, names, State([], [], currents[::-1]))
        return self._compare()

    def _bears(self, messages: dict[str, Callable[[int], object]]) -> str:
        """What is wrong with how bad commands after good ones are taken."""
        probe = self._probe
        for what, make in messages.items():
            self._enable()
            probe.after = [make] * 5
            probe.wait(lambda: not probe.after)
            probe.watch(SETTLE)
            for state in self._states():
                if not all(map(math.isfinite, state.message.effort)):
                    return f"{what}: the effort is no longer finite"
                for i, flow in enumerate(self._flow(state)):
                    if flow > 0.7 * BAD * self._contract.peak[i]:
                        return f"{what}: its {flow:.3g} A reached {self._contract.motors[i]}"
            if probe.status.mode != "enabled":
                return f"{what}: the driver does not stay enabled: {probe.status.message}"
        return ""

    def _refusals(self) -> str:
        names = list(self._contract.motors)
        bad = [BAD * peak for peak in self._contract.peak]

        def made(names: list[str], values: list[float]) -> Callable[[int], object]:
            return lambda stamp: joint_state(stamp, names, State([], [], values))

        return self._bears(
            {
                "NaN": made(names, [math.nan, *bad[1:]]),
                "infinite": made(names, [math.inf, *bad[1:]]),
                "short": made(names, bad[:-1]),
                "empty": made(names, []),
                "unknown name": made(["nobody", *names[1:]], bad),
                "doubled name": made([names[-1], *names[1:]], bad),
            }
        )

    def _answers(self) -> str:
        names = list(self._contract.motors)
        bad = State([], [], [BAD * peak for peak in self._contract.peak])
        return self._bears(
            {
                "no stamp": lambda _: joint_state(0, names, bad),
                "stamp of the future": lambda stamp: joint_state(stamp + 10 * self._contract.outer_period, names, bad),
            }
        )

    # when it stops

    def _watchdog(self) -> str:
        self._enable()
        self._probe.is_answering = False
        return self._stops(self._probe.answered, STOP) or self._in_mode("fault")

    def _repetition(self) -> str:
        self._enable()
        old = self._probe.answered
        self._probe.wanted = lambda _, currents: self._probe.command(old, currents)
        return self._stops(old, STOP) or self._in_mode("fault")

    def _fault(self) -> str:
        probe = self._probe
        self._enable()
        probe.ask("estop")
        if wrong := self._in_mode("fault"):
            return wrong
        fault = probe.status.fault
        if not fault or probe.status.level is not Level.ERROR:
            return f"status has the fault '{fault}' and the level {probe.status.level.name}"
        done, text = probe.ask("enable", True)
        if done or fault not in text:
            return f"enable is {'done' if done else 'refused'}: '{text}'; the fault is '{fault}'"
        probe.ask("reset_fault")
        return self._in_mode("braked")

    def _at_once(self, service: str, switch: bool | None, mode: str) -> str:
        probe = self._probe
        self._enable()
        done, text = probe.ask(service, switch)
        last = self._states()[-1].stamp
        if not done:
            return f"{service} is refused: '{text}'"
        return self._stops(last, 1e-9 * self._contract.outer_period) or self._in_mode(mode)

    def _disable(self) -> str:
        return self._at_once("enable", False, "braked")

    def _estop(self) -> str:
        return self._at_once("estop", None, "fault")

    def _discard(self) -> str:
        probe = self._probe
        self._brake()
        probe.watch(SETTLE)
        since = probe.status.since
        probe.is_answering = False
        probe.forget()
        done, text = probe.ask("enable", True)
        if not done:
            return f"enable, straight after a command, is refused: '{text}'"
        probe.watch(SETTLE)
        if self._last_flow():
            return "a current of before flows"
        return "" if probe.status.since > since else f"since stays {since} ns"

    def _peers(self) -> str:
        probe, fault = self._probe, "tested by wam conform"
        self._enable()
        probe.report(fault)
        if wrong := self._in_mode("fault"):
            return wrong
        if not ("velocity_loop" in probe.status.fault and fault in probe.status.fault):
            return f"the fault '{probe.status.fault}' does not name velocity_loop and its fault, '{fault}'"
        probe.ask("reset_fault")
        probe.report(fault)
        probe.watch(SETTLE)
        probe.ask("reset_fault")
        done, text = probe.ask("enable", True)
        return f"enable is done: '{text}'" if done else ""

    def _claims(self) -> str:
        self._enable()
        other = self._probe.second_publisher()
        try:
            self._probe.wait(lambda: self._probe.status.mode == "fault", 4 * REPLY)
            fault = self._probe.status.fault
            return "" if "motor_current_command" in fault else f"the fault is '{fault}'; it has to name the topic"
        finally:
            other.destroy_node()
            self._probe.wait(lambda: self._probe.count_publishers("motor_current_command") == 1, PATIENCE_OF_GRAPH)
            self._probe.watch(3 * SETTLE)

    # how it ends

    def _end(self) -> str:
        if self._end_driver is None:
            raise Untested("the driver runs already; give its command with --driver")
        self._enable()
        self._end_driver()
        self._probe.watch(SETTLE)
        mode = self._probe.status.mode
        return "" if mode in ("braked", "fault") else f"its last status has the mode '{mode}'"

    def _session(self) -> str:
        if self._restart is None:
            raise Untested("the driver runs already; give its command with --driver")
        probe = self._probe
        before = probe.status.session
        probe.statuses.clear()
        self._restart()
        if not probe.wait(lambda: probe.status.session, START):
            return "no status has come since"
        if probe.status.session <= before:
            return f"its session is {probe.status.session} after {before}"
        return self._in_mode("braked")
