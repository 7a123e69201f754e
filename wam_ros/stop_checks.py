"""Checks of the rows of a driver's contract about stopping: by itself, by services, by other nodes, and at its end.

Each returns what is wrong, '' where nothing is.
"""

from collections.abc import Callable

from wam_description.driver_contract import REPLY, STOP
from wam_description.event import Level
from wam_ros.driver_bench import DriverBench, Untested
from wam_ros.limits import CONFORMANCE_LIMITS

Check = Callable[[DriverBench], str]


def _watchdog(bench: DriverBench) -> str:
    bench.enable()
    bench.probe.is_answering = False
    return bench.stops(bench.probe.answered, STOP) or bench.in_mode("fault")


def _repetition(bench: DriverBench) -> str:
    bench.enable()
    old = bench.probe.answered
    bench.probe.wanted = lambda _, currents: bench.probe.command(old, currents)
    wrong = bench.stops(old, STOP) or bench.in_mode("fault")
    if not wrong and bench.probe.longest_pause > STOP:
        raise Untested(f"no command was sent for {1e3 * bench.probe.longest_pause:.0f} ms, which stops any driver")
    return wrong


def _fault(bench: DriverBench) -> str:
    probe = bench.probe
    bench.enable()
    probe.ask("estop")
    if wrong := bench.in_mode("fault"):
        return wrong
    fault = probe.status.fault
    if not fault or probe.status.level is not Level.ERROR:
        return f"status has the fault '{fault}' and the level {probe.status.level.name}"
    done, text = probe.ask("enable", True)
    if done or fault not in text:
        return f"enable is {'done' if done else 'refused'}: '{text}'; the fault is '{fault}'"
    probe.ask("reset_fault")
    return bench.in_mode("braked")


def _at_once(bench: DriverBench, service: str, switch: bool | None, mode: str) -> str:
    probe = bench.probe
    bench.enable()
    done, text = probe.ask(service, switch)
    last = bench.states()[-1].stamp
    if not done:
        return f"{service} is refused: '{text}'"
    return bench.stops(last, 1e-9 * bench.contract.outer_period) or bench.in_mode(mode)


def _disable(bench: DriverBench) -> str:
    return _at_once(bench, "enable", False, "braked")


def _estop(bench: DriverBench) -> str:
    return _at_once(bench, "estop", None, "fault")


def _discard(bench: DriverBench) -> str:
    probe = bench.probe
    bench.brake()
    probe.watch(CONFORMANCE_LIMITS.settle)
    since = probe.status.since
    probe.is_answering = False
    probe.forget()
    done, text = probe.ask("enable", True)
    if not done:
        return f"enable, straight after a command, is refused: '{text}'"
    probe.watch(CONFORMANCE_LIMITS.settle)
    if bench.last_flow():
        return "a current of before flows"
    return "" if probe.status.since > since else f"since stays {since} ns"


def _peers(bench: DriverBench) -> str:
    probe, fault = bench.probe, "tested by wam conform"
    bench.enable()
    probe.report(fault)
    if wrong := bench.in_mode("fault"):
        return wrong
    named = [(event.values.get("node"), event.values.get("fault")) for event in probe.status.events]
    if ("velocity_loop", fault) not in named:
        return f"no event of its status names velocity_loop and its fault, '{fault}': {named}"
    probe.ask("reset_fault")
    probe.report(fault)
    probe.watch(CONFORMANCE_LIMITS.settle)
    probe.ask("reset_fault")
    done, text = probe.ask("enable", True)
    return f"enable is done: '{text}'" if done else ""


def _claims(bench: DriverBench) -> str:
    bench.enable()
    other = bench.probe.second_publisher()
    try:
        bench.probe.wait(lambda: bench.probe.status.mode == "fault", 4 * REPLY)
        topics = [event.values.get("topic") for event in bench.probe.status.events]
        return "" if "motor_current_command" in topics else f"no event of its status names the topic: {topics}"
    finally:
        other.destroy_node()
        bench.probe.wait(lambda: bench.probe.count_publishers("motor_current_command") == 1, CONFORMANCE_LIMITS.vanish)
        bench.probe.watch(3 * CONFORMANCE_LIMITS.settle)


def _agreement(bench: DriverBench) -> str:
    probe = bench.probe
    bench.enable()
    probe.report(node="transform", started_with="one")
    probe.watch(CONFORMANCE_LIMITS.settle)
    probe.report(started_with="another")
    try:
        if wrong := bench.in_mode("fault"):
            return wrong
        probe.ask("reset_fault")
        done, text = probe.ask("enable", True)
        return f"enable is done: '{text}'" if done else ""
    finally:
        probe.report(node="transform")  # as the velocity loop is right again for the next row


def _end(bench: DriverBench) -> str:
    if bench.end is None:
        raise Untested("the driver runs already; give its command with --driver")
    bench.enable()
    bench.end()
    bench.probe.watch(CONFORMANCE_LIMITS.settle)
    mode = bench.probe.status.mode
    return "" if mode in ("braked", "fault") else f"its last status has the mode '{mode}'"


def _session(bench: DriverBench) -> str:
    if bench.restart is None:
        raise Untested("the driver runs already; give its command with --driver")
    probe = bench.probe
    before = probe.status.session
    probe.statuses.clear()
    bench.restart()
    if not probe.wait(lambda: probe.status.session, CONFORMANCE_LIMITS.start):
        return "no status has come since"
    if probe.status.session <= before:
        return f"its session is {probe.status.session} after {before}"
    return bench.in_mode("braked")


STOP_CHECKS: dict[str, Check] = {
    "watchdog": _watchdog,
    "repetition": _repetition,
    "fault": _fault,
    "disable": _disable,
    "estop": _estop,
    "discard": _discard,
    "peers": _peers,
    "claims": _claims,
    "agreement": _agreement,
    "end": _end,
    "session": _session,
}
