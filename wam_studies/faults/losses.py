"""Loss of each node: SIGKILL, SIGTERM, SIGSTOP, and its start afterwards, in a chain of real processes."""

import math
import signal
from random import Random
from typing import Final

from wam_studies.faults.node_processes import ANSWERS, NodeProcesses
from wam_studies.faults.trials import FAULTS, KEPT, FaultCase, FaultTrial

WAYS: Final = (signal.SIGSTOP, signal.SIGKILL, signal.SIGTERM)
# with the estimate fed back, the estimator belongs to the chain, too
FEEDBACK: Final = {"timing.timeout": 2.0, "force_loop:feedback": "contact_estimate", "force_loop:guard.mode": "off"}


def play(case: FaultCase) -> FaultTrial:
    """A trial of one loss."""
    chance = Random(f"losses {case.seed} {case.number}")
    chain: NodeProcesses = KEPT.ready(NodeProcesses, case.configuration)
    names = list(chain.processes)
    name = names[case.number % len(names)]
    trial = _lost(case, chain, name, WAYS[case.number // len(names) % len(WAYS)], chance)
    if trial.escapes:
        KEPT.discard()
    return trial


def _lost(case: FaultCase, chain: NodeProcesses, name: str, way: signal.Signals, chance: Random) -> FaultTrial:
    what = f"{name} {way.name}"
    if reason := chain.enabled():
        return FaultTrial(case.kind, what, 1, (f"before: {reason}",))
    chain.watch(chance.uniform(0.0, 0.1))
    q, chain.force = list(chain.q), 0.0
    chain.reports.clear()
    process = chain.processes[name]
    process.send(way)
    delay, escapes = math.nan, list[str]()
    if name == "driver":
        chain.watch(chance.uniform(*FAULTS.frozen) if way == signal.SIGSTOP else 0.2)
    else:
        delay = _noticed(chain, name, escapes)
    if way == signal.SIGSTOP:
        process.send(signal.SIGCONT)
    else:
        chain.wait(lambda: name in chain.ended, FAULTS.noticed)
        process.send(signal.SIGKILL)
        chain.wait(lambda: name in chain.ended, FAULTS.noticed)
    if others := [one for one in chain.ended if one != name]:
        escapes.append(f"{', '.join(others)} ended, too")
    if way != signal.SIGSTOP:
        process.start()
    if reason := chain.enabled():
        escapes.append(reason)
    is_new_arm = name == "driver" and way != signal.SIGSTOP
    motion = 0.0 if is_new_arm else max(abs(a - b) for a, b in zip(q, chain.q, strict=True))
    if motion > FAULTS.motion:
        escapes.append(f"the arm moved {motion:.3f} rad")
    if chain.force > FAULTS.force:
        escapes.append(f"{chain.force:.0f} N")
    return FaultTrial(case.kind, what, 1, tuple(escapes), motion, chain.force, delay)


def _noticed(chain: NodeProcesses, name: str, escapes: list[str]) -> float:
    """Wait for the fault that names a lost node; returns the time to zero current, s of the arm's time."""
    if not chain.wait(lambda: chain.mode == "fault", FAULTS.noticed):
        escapes.append(f"not noticed within {FAULTS.noticed:g} s")
    chain.watch(0.05)
    delay = max(0.0, (chain.current_stamp - chain.stamps[name]) * 1e-9)
    if delay > FAULTS.zero_current:
        escapes.append(f"current {delay * 1e3:.0f} ms after the loss")
    texts = " ".join(chain.reports)
    if name not in texts and ANSWERS[name] not in texts:
        found = chain.statuses.get("driver")
        escapes.append(f"not named: '{found.fault if found else ''}'")
    return delay
