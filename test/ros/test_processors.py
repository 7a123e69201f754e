"""Processors: processes keep to those that they were given, all threads of them, and nothing else does."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import wait

from wam_description.configuration import Configuration, packaged
from wam_description.nodes import EACH, GROUPED
from wam_ros import processors
from wam_ros.bring_up import Processes
from wam_ros.processors import PROCESSORS, idle_processor, keep_to_processors, placed_groups

OWN = os.getpriority(os.PRIO_PROCESS, 0)
ENTRIES = ["driver", "velocity_loop", "contact_estimator"]
LOCKSTEP, REALTIME = (
    Configuration.load(packaged("wam")).with_values({"timing.mode": mode, "nodes": ENTRIES})
    for mode in ("lockstep", "realtime")
)


def test_a_permitted_processor_is_taken_for_the_inner_loop() -> None:
    permitted = os.sched_getaffinity(0)
    try:
        for one in permitted:
            os.sched_setaffinity(0, {one})
            assert idle_processor() == one
    finally:
        os.sched_setaffinity(0, permitted)


@pytest.mark.parametrize("given", ["", "x", "-1", "99999999999", "9999"])
def test_processors_that_do_not_exist_are_none(given: str) -> None:
    permitted = os.sched_getaffinity(0)
    environment = {PROCESSORS: given}
    keep_to_processors(environment)
    assert environment == {}
    assert os.sched_getaffinity(0) == permitted
    assert os.sched_getscheduler(0) != os.SCHED_BATCH


def placed(processes: Processes) -> dict[str, set[tuple[int, frozenset[int]]]]:
    """Policy and processors of all threads of each node."""
    return {
        name: {
            (os.sched_getscheduler(int(thread.name)), frozenset(os.sched_getaffinity(int(thread.name))))
            for thread in Path("/proc", str(process.pid), "task").iterdir()
        }
        for name, process in processes.processes.items()
    }


def test_processes_of_a_lockstep_keep_to_their_processors(domain_id: int) -> None:
    permitted = os.sched_getaffinity(0)
    with Processes(LOCKSTEP) as processes:
        policies = lambda: {policy for threads in placed(processes).values() for policy, _ in threads}  # noqa: E731
        wait(lambda: policies() == {os.SCHED_BATCH}, "threads keep another policy")
        found = placed(processes)
    driver, velocity_loop, contact_estimator = ({where for _, where in found[name]} for name in ENTRIES)
    assert driver == velocity_loop
    (inner,) = driver
    assert len(inner) == 1
    assert contact_estimator == {frozenset(permitted - inner or permitted)}
    assert os.sched_getaffinity(0) == permitted
    assert os.sched_getscheduler(0) != os.SCHED_BATCH


@pytest.mark.parametrize(("how", "inner"), [(EACH, {"driver", "velocity_loop"}), (GROUPED, {"driver velocity_loop"})])
def test_in_lockstep_the_inner_loop_has_a_processor_and_all_others_the_rest(
    how: str, inner: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(processors.os, "sched_getaffinity", lambda _: {0, 1, 2})
    monkeypatch.setattr(processors, "idle_processor", lambda: 2)
    found = {" ".join(group): place[PROCESSORS] for group, place in placed_groups(LOCKSTEP.shared, how)}
    assert found == {name: "2" if name in inner else "0 1" for name in found}
    assert inner < found.keys()


def test_processes_in_realtime_may_be_anywhere_with_their_priority(domain_id: int) -> None:
    permitted = frozenset(os.sched_getaffinity(0))
    with Processes(REALTIME) as processes:
        present = lambda: {name: priority(processes.processes[name].pid) for name in ENTRIES}  # noqa: E731
        wait(lambda: present() == expected_priorities(), "some have another priority")
        found = {one for threads in placed(processes).values() for one in threads}
    assert {where for _, where in found} == {permitted}
    assert os.SCHED_BATCH not in {policy for policy, _ in found}


def priority(process: int) -> tuple[int, int]:
    """Priority of SCHED_FIFO, 0 without it, and niceness of a process."""
    return os.sched_getparam(process).sched_priority, os.getpriority(os.PRIO_PROCESS, process)


def expected_priorities() -> dict[str, tuple[int, int]]:
    """By node: SCHED_FIFO where it is granted, of the outer nodes one less; else niceness, where that is."""
    timing = REALTIME.shared.timing
    fifo = f"import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param({timing.fifo_priority}))"
    if subprocess.run([sys.executable, "-c", fifo], stderr=subprocess.DEVNULL, check=False).returncode == 0:
        outer = (timing.fifo_priority - 1, OWN)
        return {"driver": (timing.fifo_priority, OWN), "velocity_loop": (timing.fifo_priority, OWN), ENTRIES[2]: outer}
    program = f"import os; os.setpriority(os.PRIO_PROCESS, 0, {timing.niceness})"
    is_granted = not subprocess.run([sys.executable, "-c", program], stderr=subprocess.DEVNULL, check=False).returncode
    return dict.fromkeys(ENTRIES, (0, timing.niceness if is_granted else OWN))
