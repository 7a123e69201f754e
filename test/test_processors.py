"""Processors: the processes of a lockstep keep to theirs, all threads of them, and nothing else does."""

import os
import time
from pathlib import Path

import pytest
from conftest import LONG

from wam_description.configuration import Configuration, packaged
from wam_ros import processors
from wam_ros.bring_up import Processes
from wam_ros.processors import PROCESSORS, divided, idle_parts, keep_to_processors
from wam_ros.run import PARENT

ENTRIES = ["driver", "velocity_loop", "contact_estimator"]


def test_the_inner_loop_has_the_idlest_processor_and_all_others_the_rest() -> None:
    assert divided({0: 0.1, 3: 0.9, 5: 0.4}) == ({3}, {0, 5})


def test_where_only_one_is_permitted_all_have_it() -> None:
    assert divided({2: 0.0}) == ({2}, {2})


def test_among_processors_that_are_idle_alike_two_arms_choose_by_chance() -> None:
    chosen = {next(iter(divided({0: 1.0, 1: 0.99, 2: 0.5})[0])) for _ in range(100)}
    assert chosen == {0, 1}


def test_every_permitted_processor_is_looked_at() -> None:
    permitted = os.sched_getaffinity(0)
    parts = idle_parts(permitted)
    assert set(parts) == permitted
    assert all(0.0 <= part <= 1.0 for part in parts.values())


def test_a_system_that_shows_no_times_has_no_idle_processor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    permitted = os.sched_getaffinity(0)
    for file, text in (("none", None), ("another", "cpu 1 2\ncpu9999 1 2 3 4 5\nintr 5 4\n\n")):
        if text is not None:
            (tmp_path / file).write_text(text)
        monkeypatch.setattr(processors, "TIMES", tmp_path / file)
        assert idle_parts(permitted) == dict.fromkeys(permitted, 0.0)


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
        for name, process in processes._processes.items()
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


def test_processes_in_realtime_may_be_anywhere(domain_id: int) -> None:
    configuration = Configuration.load(packaged("wam")).with_values({"timing.mode": "realtime", "nodes": ENTRIES[:1]})
    with Processes(configuration) as processes:
        environment = Path("/proc", str(processes._processes["driver"].pid), "environ").read_bytes()
    assert PARENT.encode() in environment
    assert PROCESSORS.encode() not in environment
