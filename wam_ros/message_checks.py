"""Checks of the rows of a driver's contract about messages: what it sends, and which commands it takes.

Each returns what is wrong, '' where nothing is.
"""

import math
import os
import statistics
from collections.abc import Callable
from itertools import pairwise

from wam_description.driver_contract import SENT, STATUS_AGE, TAKEN
from wam_description.signals import State
from wam_ros.driver_bench import DriverBench, Untested
from wam_ros.limits import CONFORMANCE_LIMITS
from wam_ros.messages import joint_state

Check = Callable[[DriverBench], str]


def _interface(bench: DriverBench) -> str:
    probe = bench.probe

    def lacking() -> list[str]:
        found = probe.lacking(SENT, TAKEN)
        name = f"{probe.get_namespace().strip('/')}: driver"
        return found if name in probe.diagnostics else [*found, f"/diagnostics of '{name}'"]

    probe.wait(lambda: not lacking(), CONFORMANCE_LIMITS.start)
    return f"{', '.join(found)} not found" if (found := lacking()) else ""


def _rate(bench: DriverBench) -> str:
    bench.probe.forget()
    bench.probe.watch(2 * CONFORMANCE_LIMITS.look)
    states, period = bench.states(), bench.contract.period
    elapsed = states[-1].when - states[0].when
    advanced = (states[-1].stamp - states[0].stamp) * 1e-9
    if abs(advanced / elapsed - 1.0) > CONFORMANCE_LIMITS.period_error:
        return f"stamps advance by {advanced:.3f} s in {elapsed:.3f} s"
    share = len(states) * period * 1e-9 / elapsed
    if not bench.contract.least_share <= share <= 1.0 + 2 * CONFORMANCE_LIMITS.period_error:
        busy, cores = os.getloadavg()[0], os.cpu_count() or 1
        why = f"; {busy:.0f} processes want the {cores} processors of this machine" if busy > cores else ""
        return f"{len(states)} states in {elapsed:.2f} s, {share:.0%} of the periods{why}"
    return ""


def _stamps(bench: DriverBench) -> str:
    bench.probe.watch(CONFORMANCE_LIMITS.look)
    stamps = [state.stamp for state in bench.states()]
    for before, stamp in pairwise(stamps):
        if stamp <= before:
            return f"after {before} ns comes {stamp} ns"
    wrong = next((stamp for stamp in stamps if stamp <= 0 or stamp % bench.contract.period), None)
    return f"{wrong} ns is no multiple of {bench.contract.period} ns" if wrong is not None else ""


def _outer(bench: DriverBench) -> str:
    bench.probe.forget()
    bench.probe.watch(CONFORMANCE_LIMITS.look)
    states = {state.stamp for state in bench.states()}
    period, outer = bench.contract.period, bench.contract.outer_period
    due = sum((stamp - period) % outer == 0 for stamp in states)
    for topic in ("motor_currents", "/clock"):
        stamps = {one.stamp for one in bench.probe.arrived[topic]}
        strange = sorted(stamp for stamp in stamps if (stamp - period) % outer)
        if strange:
            return f"{topic} has the stamp {strange[0]} ns, which begins no outer period"
        if len(stamps & states) < bench.contract.least_share * due - 2:
            return f"{topic} came {len(stamps)} times in {due} outer periods"
    return ""


def _arrays(bench: DriverBench) -> str:
    bench.probe.watch(CONFORMANCE_LIMITS.settle)
    names = list(bench.contract.motors)
    for _, _, message in bench.states():
        if list(message.name) != names:
            return f"names are {', '.join(message.name) or 'none'}; motors are {', '.join(names)}"
        for field in State._fields:
            values = list(getattr(message, field))
            if len(values) != len(names) or not all(map(math.isfinite, values)):
                return f"{field} is {values}"
    return ""


def _velocity(bench: DriverBench) -> str:
    bench.enable()
    bench.probe.watch(CONFORMANCE_LIMITS.look)
    states = bench.states()
    compared = []
    for i, name in enumerate(bench.contract.motors):
        moved = travelled = integral = 0.0
        for before, after in pairwise(states):
            step = after.message.position[i] - before.message.position[i]
            moved += step
            travelled += abs(step)
            dt = (after.stamp - before.stamp) * 1e-9
            integral += 0.5 * (before.message.velocity[i] + after.message.velocity[i]) * dt
        if travelled < CONFORMANCE_LIMITS.least_travel:
            continue
        compared.append(name)
        if abs(integral - moved) > 0.1 * travelled:
            return f"{name} moved {moved:.4f} rad, the integral of its velocity is {integral:.4f} rad"
    if not compared:
        raise Untested(f"no motor moved {CONFORMANCE_LIMITS.least_travel} rad; give a larger --current")
    return ""


def _braked(bench: DriverBench) -> str:
    bench.brake()
    if wrong := bench.in_mode("braked"):
        return wrong
    bench.probe.watch(CONFORMANCE_LIMITS.settle)
    bench.probe.forget()
    bench.probe.watch(CONFORMANCE_LIMITS.settle)
    return "a current flows" if bench.last_flow() else ""


def _status(bench: DriverBench) -> str:
    probe = bench.probe
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


def _silence(bench: DriverBench) -> str:
    bench.brake()
    bench.probe.is_answering = False
    bench.probe.watch(3 * CONFORMANCE_LIMITS.settle)
    done, text = bench.probe.ask("enable", True)
    if done or not text:
        return f"it answers {'success' if done else 'a refusal without a reason'}: '{text}'"
    return ""


def _current(bench: DriverBench) -> str:
    return bench.compare()


def _names(bench: DriverBench) -> str:
    names = list(bench.contract.motors)[::-1]
    bench.probe.wanted = lambda stamp, currents: joint_state(stamp, names, State([], [], currents[::-1]))
    return bench.compare()


def _refusals(bench: DriverBench) -> str:
    names = list(bench.contract.motors)
    bad = bench.bad()

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
    names = list(bench.contract.motors)
    bad = State([], [], bench.bad())
    return bench.bears(
        {
            "no stamp": lambda _: joint_state(0, names, bad),
            "stamp of the future": lambda stamp: joint_state(stamp + 10 * bench.contract.outer_period, names, bad),
        }
    )


MESSAGE_CHECKS: dict[str, Check] = {
    "interface": _interface,
    "rate": _rate,
    "stamps": _stamps,
    "outer": _outer,
    "arrays": _arrays,
    "velocity": _velocity,
    "braked": _braked,
    "status": _status,
    "silence": _silence,
    "current": _current,
    "names": _names,
    "refusals": _refusals,
    "answers": _answers,
}
