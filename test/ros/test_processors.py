"""Processors: processes keep to those that they were given, all threads of them, and nothing else does."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import LONG

from wam_description.configuration import Configuration, packaged
from wam_description.nodes import EACH, GROUPED
from wam_ros import processors
from wam_ros.bring_up import Processes
from wam_ros.limits import PROCESS_LIMITS
from wam_ros.priority import fifo_is_granted
from wam_ros.processors import PROCESSORS, idle_processor, keep_to_processors, placed_groups
from wam_ros.run import PARENT

OWN = os.getpriority(os.PRIO_PROCESS, 0)
ENTRIES = ["driver", "velocity_loop", "contact_estimator"]


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
    configuration = Configuration.load(packaged("wam")).with_values({"timing.mode": "lockstep", "nodes": ENTRIES})
    with Processes(configuration) as processes:
        end = time.monotonic() + LONG
        while {policy for threads in placed(processes).values() for policy, _ in threads} != {os.SCHED_BATCH}:
            assert time.monotonic() < end, "threads keep another policy"
            time.sleep(0.02)
        found = placed(processes)
    driver, velocity_loop, contact_estimator = ({where for _, where in found[name]} for name in ENTRIES)
    assert driver == velocity_loop
    (inner,) = driver
    assert len(inner) == 1
    assert contact_estimator == {frozenset(permitted - inner or permitted)}
    assert os.sched_getaffinity(0) == permitted
    assert os.sched_getscheduler(0) != os.SCHED_BATCH


REALTIME = Configuration.load(packaged("wam")).with_values({"timing.mode": "realtime", "nodes": ENTRIES})


def places(
    monkeypatch: pytest.MonkeyPatch,
    permitted: set[int],
    granted: bool = True,
    how: str = EACH,
    configured: Configuration = REALTIME,
) -> dict[str, str]:
    """Processors of each process, where the system permits these, and grants SCHED_FIFO or not."""
    monkeypatch.setattr(processors.os, "sched_getaffinity", lambda _: permitted)
    monkeypatch.setattr(processors, "fifo_is_granted", lambda fifo: granted and fifo > 0)
    monkeypatch.setattr(processors, "idle_processor", lambda: max(permitted))
    return {" ".join(group): place.get(PROCESSORS, "") for group, place in placed_groups(configured.shared, how)}


@pytest.mark.parametrize(("how", "count"), [(EACH, 2), (GROUPED, 1)])
def test_in_realtime_the_driver_s_process_has_a_processor_and_all_others_the_rest(
    how: str, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    driver, *others = places(monkeypatch, {0, 1, 2}, how=how).values()
    assert driver == "2"
    assert [set(place.split()) for place in others] == [{"0", "1"}] * count


@pytest.mark.parametrize(("permitted", "granted"), [({0, 1, 2, 3}, False), ({0, 1}, True)])
def test_without_priority_or_a_third_processor_they_may_be_anywhere(
    permitted: set[int], granted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert set(places(monkeypatch, permitted, granted).values()) == {""}


def test_processes_in_realtime_have_the_processors_that_they_were_given(domain_id: int) -> None:
    permitted = frozenset(os.sched_getaffinity(0))
    is_apart = len(permitted) >= PROCESS_LIMITS.processors and fifo_is_granted(REALTIME.shared.timing.fifo_priority)
    with Processes(REALTIME) as processes:
        end = time.monotonic() + LONG
        expected = expected_priorities()
        while any(
            is_apart == (permitted in {where for _, where in of}) for of in placed(processes).values()
        ) or expected != {name: priority(processes.processes[name].pid) for name in ENTRIES}:
            assert time.monotonic() < end, "some threads are elsewhere, or have another priority"
            time.sleep(0.02)
        found = placed(processes)
        assert is_apart == (PROCESSORS.encode() in environment_of(processes, "driver"))
    driver, *others = ({where for _, where in found[name]} for name in ENTRIES)
    if is_apart:
        (alone,) = driver
        assert len(alone) == 1
        assert others == [{permitted - alone}] * 2
    assert os.SCHED_BATCH not in {policy for of in found.values() for policy, _ in of}
    assert os.sched_getscheduler(0) not in {os.SCHED_FIFO, os.SCHED_BATCH}, "to look does not change it"


def priority(process: int) -> tuple[int, int]:
    """Priority of SCHED_FIFO, 0 without it, and niceness of a process."""
    return os.sched_getparam(process).sched_priority, os.getpriority(os.PRIO_PROCESS, process)


def expected_priorities() -> dict[str, tuple[int, int]]:
    """By node: SCHED_FIFO where it is granted, of the outer nodes one less; else niceness, where that is."""
    timing = REALTIME.shared.timing
    if fifo_is_granted(timing.fifo_priority):
        outer = (timing.fifo_priority - 1, OWN)
        return {"driver": (timing.fifo_priority, OWN), "velocity_loop": (timing.fifo_priority, OWN), ENTRIES[2]: outer}
    program = f"import os; os.setpriority(os.PRIO_PROCESS, 0, {timing.niceness})"
    is_granted = not subprocess.run([sys.executable, "-c", program], stderr=subprocess.DEVNULL, check=False).returncode
    return dict.fromkeys(ENTRIES, (0, timing.niceness if is_granted else OWN))


def environment_of(processes: Processes, name: str) -> bytes:
    environment = Path("/proc", str(processes.processes[name].pid), "environ").read_bytes()
    assert PARENT.encode() in environment
    return environment
