"""Tests a running driver against its contract (`wam_description.driver_contract`), row by row, over topics.

A check is named as its row, and returns what is wrong, '' where nothing is, or raises it.
"""

import math
import os
import statistics
from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from wam_description.driver_contract import REPLY, REQUIREMENTS, STATUS_AGE, STOP
from wam_description.event import Level
from wam_description.signals import State
from wam_ros.driver_bench import DriverBench, Untested, Wrong
from wam_ros.limits import CONFORMANCE_LIMITS
from wam_ros.messages import joint_state

Check = Callable[[DriverBench], str]
OK, WRONG, NOT_TESTED = "ok", "WRONG", "not tested"
ONCE = ("interface", "end", "session")  # a second attempt finds another driver, or none
RUNNING: Final = "the driver already runs, and the test does not end it; leave out --running"


def _interface(bench: DriverBench) -> str:
    bench.wait(lambda: not bench.lacking(), CONFORMANCE_LIMITS.start)
    if found := bench.lacking():
        return f"{', '.join(found)} not found"
    bench.await_person(lambda: bench.arrived["motor_states"])
    return ""


def _rate(bench: DriverBench) -> str:
    bench.forget()
    bench.watch(2 * CONFORMANCE_LIMITS.look)
    states, period = bench.states(), bench.shared.timing.period_ns
    elapsed = states[-1].when - states[0].when
    advanced = (states[-1].stamp - states[0].stamp) * 1e-9
    if abs(advanced / elapsed - 1.0) > CONFORMANCE_LIMITS.period_error:
        return f"stamps advance by {advanced:.3f} s in {elapsed:.3f} s"
    share = len(states) * period * 1e-9 / elapsed
    if not bench.least_share <= share <= 1.0 + 2 * CONFORMANCE_LIMITS.period_error:
        busy, cores = os.getloadavg()[0], os.cpu_count() or 1
        why = f"; {busy:.0f} processes compete for the {cores} processors of this machine" if busy > cores else ""
        return f"{len(states)} states in {elapsed:.2f} s, {share:.0%} of the periods{why}"
    return ""


def _stamps(bench: DriverBench) -> str:
    bench.watch(CONFORMANCE_LIMITS.look)
    stamps = [state.stamp for state in bench.states()]
    for before, stamp in pairwise(stamps):
        if stamp <= before:
            return f"after {before} ns comes {stamp} ns"
    wrong = next((stamp for stamp in stamps if stamp <= 0 or stamp % bench.shared.timing.period_ns), None)
    return f"{wrong} ns is no multiple of {bench.shared.timing.period_ns} ns" if wrong is not None else ""


def _outer(bench: DriverBench) -> str:
    bench.forget()
    bench.watch(CONFORMANCE_LIMITS.look)
    states = {state.stamp for state in bench.states()}
    is_outer = bench.shared.timing.is_outer
    due = sum(map(is_outer, states))
    for topic in ("motor_currents", "/clock"):
        stamps = {one.stamp for one in bench.arrived[topic]}
        strange = sorted(stamp for stamp in stamps if not is_outer(stamp))
        if strange:
            return f"{topic} has the stamp {strange[0]} ns, which begins no outer period"
        if len(stamps & states) < bench.least_share * due - 2:
            return f"{topic} came {len(stamps)} times in {due} outer periods"
    return ""


def _arrays(bench: DriverBench) -> str:
    bench.watch()
    bench.states()  # each has been read
    return ""


def _velocity(bench: DriverBench) -> str:
    bench.enable()
    bench.watch(CONFORMANCE_LIMITS.look)
    states = bench.states()
    compared = []
    position, velocity, _ = (np.array(values) for values in zip(*(one.value for one in states), strict=True))
    times, steps = np.array([one.stamp for one in states]) * 1e-9, np.diff(position, axis=0)
    integrals = np.diff(times) @ (velocity[1:] + velocity[:-1]) / 2.0
    for name, step, integral in zip(bench.motors.names, steps.T, integrals, strict=True):
        moved, travelled = step.sum(), abs(step).sum()
        finest = abs(step[step != 0.0]).min(initial=math.inf)  # step of the encoder, rad
        if travelled < CONFORMANCE_LIMITS.least_travel:
            continue
        compared.append(name)
        # of few counts that are read between other frames, at intervals that vary, the rates are off by their root
        if abs(integral - moved) > 0.1 * travelled + math.sqrt(travelled * finest):
            return f"{name} moved {moved:.4f} rad, the integral of its velocity is {integral:.4f} rad"
    if not compared:
        raise Untested(f"no motor moved {CONFORMANCE_LIMITS.least_travel} rad; give a larger --current")
    return ""


def _braked(bench: DriverBench) -> str:
    bench.brake()
    bench.in_mode("braked")
    bench.watch()
    bench.forget()
    bench.watch()
    return "a current flows" if bench.last_flow() else ""


def _status(bench: DriverBench) -> str:
    before = len(bench.reported)
    bench.watch(4 * STATUS_AGE)
    times = [when for when, _ in bench.reported][before:]
    status = bench.status
    if not (status.session and status.mode):
        return f"session is {status.session or 'missing'}, mode is '{status.mode}'"
    if len(times) < 2 or statistics.median(b - a for a, b in pairwise(times)) > STATUS_AGE:
        return f"{len(times)} came in {4 * STATUS_AGE:g} s"
    infos = bench.node.get_publishers_info_by_topic("status")
    if not all(info.qos_profile.durability.name == "TRANSIENT_LOCAL" for info in infos):
        return "it is not latched: durability is not transient local"
    return ""


def _silence(bench: DriverBench) -> str:
    bench.brake()
    bench.is_answering = False
    bench.watch(3 * CONFORMANCE_LIMITS.settle)
    done, text = bench.ask("enable", True)
    if done or not text:
        return f"it answers {'success' if done else 'a refusal without a reason'}: '{text}'"
    return ""


_current = DriverBench.compare


def _names(bench: DriverBench) -> str:
    names = list(bench.motors.names)[::-1]
    bench.wanted = lambda stamp, currents: joint_state(stamp, names, State([], [], currents[::-1]))
    return bench.compare()


def _refusals(bench: DriverBench) -> str:
    names, bad = list(bench.motors.names), bench.bad()

    def made(names: list[str], values: list[float]) -> Callable[[int], object]:
        return lambda stamp: joint_state(stamp, names, State([], [], values))

    return bench.bears(
        {
            "NaN": made(names, [math.nan, *bad[1:]]),
            "infinite": made(names, [math.inf, *bad[1:]]),
            "short": made(names, bad[:-1]),
            "empty": made(names, []),
            "unknown name": made(["nobody", *names[1:]], bad),
            "doubled name": made([names[-1], *names[1:]], bad),
        }
    )


def _answers(bench: DriverBench) -> str:
    bad, ahead = bench.bad(), 10 * bench.shared.timing.outer_period_ns
    return bench.bears(
        {
            "no stamp": lambda _: bench.command(0, bad),
            "stamp of the future": lambda stamp: bench.command(stamp + ahead, bad),
        }
    )


def _watchdog(bench: DriverBench) -> str:
    bench.enable()
    bench.is_answering = False
    return bench.stops(bench.answered, STOP) or bench.in_mode("fault")


def _repetition(bench: DriverBench) -> str:
    bench.enable()
    old = bench.answered
    bench.wanted = lambda _, currents: bench.command(old, currents)
    wrong = bench.stops(old, STOP) or bench.in_mode("fault")
    if not wrong and bench.longest_pause > STOP:
        raise Untested(f"no command was sent for {1e3 * bench.longest_pause:.0f} ms, which stops any driver")
    return wrong


def _fault(bench: DriverBench) -> str:
    bench.enable()
    bench.ask("estop")
    bench.in_mode("fault")
    fault = bench.status.fault
    if not fault or bench.status.level is not Level.ERROR:
        return f"status has the fault '{fault}' and the level {bench.status.level.name}"
    done, text = bench.ask("enable", True)
    if done or fault not in text:
        return f"enable is {'done' if done else 'refused'}: '{text}'; the fault is '{fault}'"
    bench.ask("reset_fault")
    return bench.in_mode("braked")


def _at_once(bench: DriverBench, service: str, switch: bool | None, mode: str) -> str:
    bench.enable()
    done, text = bench.ask(service, switch)
    last = bench.states()[-1].stamp
    if not done:
        return f"{service} is refused: '{text}'"
    return bench.stops(last, 1e-9 * bench.shared.timing.outer_period_ns) or bench.in_mode(mode)


_disable = partial(_at_once, service="enable", switch=False, mode="braked")
_estop = partial(_at_once, service="estop", switch=None, mode="fault")


def _discard(bench: DriverBench) -> str:
    bench.enable()
    bench.brake()
    bench.watch()
    since = bench.status.since
    bench.is_answering = False
    bench.forget()
    done, text = bench.ask("enable", True)
    if not done:
        return f"enable, straight after a command, is refused: '{text}'"
    bench.watch()
    if bench.last_flow():
        return "the current of an earlier command flows"
    return "" if bench.status.since > since else f"since stays {since} ns"


def _enabled_after_reset(bench: DriverBench) -> str:
    """That a driver can be enabled, whose fault was reset while its cause lasts; '' where it refuses."""
    bench.ask("reset_fault")
    done, text = bench.ask("enable", True)
    return f"enable is done: '{text}'" if done else ""


def _peers(bench: DriverBench) -> str:
    fault = "tested by wam conform"
    bench.enable()
    bench.report(fault)
    bench.in_mode("fault")
    named = [(event.values.get("node"), event.values.get("fault")) for event in bench.status.events]
    if ("velocity_loop", fault) not in named:
        return f"no event of its status names velocity_loop and its fault, '{fault}': {named}"
    bench.ask("reset_fault")
    bench.report(fault)
    bench.watch()
    return _enabled_after_reset(bench)


def _claims(bench: DriverBench) -> str:
    bench.enable()
    other = bench.second_publisher()
    try:
        bench.wait(lambda: bench.status.mode == "fault", 4 * REPLY)
        topics = [event.values.get("topic") for event in bench.status.events]
        return "" if "motor_current_command" in topics else f"no event of its status names the topic: {topics}"
    finally:
        other.destroy_node()
        bench.wait(lambda: bench.node.count_publishers("motor_current_command") == 1, CONFORMANCE_LIMITS.vanish)
        bench.watch(3 * CONFORMANCE_LIMITS.settle)


def _agreement(bench: DriverBench) -> str:
    bench.enable()
    bench.report(node="transform", started_with=bench.digests)
    bench.watch()
    bench.report(started_with=bench.digests[:-1] + "?")
    try:
        return bench.in_mode("fault") or _enabled_after_reset(bench)
    finally:
        bench.report(node="transform")  # as the velocity loop is right again for the next row


def _end(bench: DriverBench) -> str:
    if bench.end is None:
        raise Untested(RUNNING)
    bench.enable()
    bench.end()
    bench.watch()
    mode = bench.status.mode
    return "" if mode in ("braked", "fault") else f"its last status has the mode '{mode}'"


def _session(bench: DriverBench) -> str:
    if bench.restart is None:
        raise Untested(RUNNING)
    before = bench.status.session
    bench.reported.clear()
    bench.restart()
    if not bench.wait(lambda: bench.status.session, CONFORMANCE_LIMITS.start):
        return "no status has come since"
    if bench.status.session <= before:
        return f"its session is {bench.status.session} after {before}"
    return bench.in_mode("braked")


CHECKS: Final[dict[str, Check]] = {key: globals()[f"_{key}"] for key in REQUIREMENTS}


class ConformanceRow(NamedTuple):
    """Result of one row of the contract: ok, WRONG or not tested, and what is wrong."""

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


def conformance_rows(bench: DriverBench, attempts: int) -> Iterator[ConformanceRow]:
    """Test every row of the contract, each until it is right or there are no more attempts.

    Parameters
    ----------
    bench : in the place of the velocity loop.
    attempts : at each row, see `conformance_row`.
    """
    blocked = ""
    for key in REQUIREMENTS:
        row = ConformanceRow(key, NOT_TESTED, blocked) if blocked else conformance_row(bench, key, attempts)
        if key == "interface" and row.verdict == WRONG:
            blocked = "the interface is missing"
        yield row
    bench.brake()


def conformance_row(bench: DriverBench, key: str, attempts: int) -> ConformanceRow:
    """Test one row, with several attempts, as a computer that is busy delays a driver that is right.

    One in which the test itself was held up does not count, and proves nothing.
    """
    verdict, found = NOT_TESTED, ""
    left, held_up, pause = attempts, CONFORMANCE_LIMITS.held_up * attempts, 0.0
    while left and held_up:
        bench.longest_pause = 0.0
        try:
            found = CHECKS[key](bench)
            verdict = WRONG if found else OK
        except Wrong as reason:
            verdict, found = WRONG, str(reason)
        except Untested as reason:
            verdict, found = NOT_TESTED, str(reason)
        finally:
            bench.be_proper()
        if verdict == OK or key in ONCE:
            break
        pause = bench.longest_pause
        left, held_up = (left, held_up - 1) if pause > CONFORMANCE_LIMITS.pause else (left - 1, held_up)
    if verdict != OK and not held_up:
        verdict = NOT_TESTED
        found = f"{found} (this computer delayed the test itself, last by {1e3 * pause:.0f} ms)"
    return ConformanceRow(key, verdict, found)
