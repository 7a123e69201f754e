"""Lockstep: the same scenario gives the same numbers, bit for bit, wherever and however it runs."""

import dataclasses
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bag_comparison import compare

from wam_bag.bag import Bag, TableColumns, read
from wam_control.task.scenario import load
from wam_description.arm import Timing
from wam_description.configuration import Configuration, packaged
from wam_description.interface import process_groups
from wam_description.nodes import EACH, GROUPED, ONE
from wam_description.synchroniser import InputSpec, Synchroniser
from wam_ros.testing import RunningArm, playing
from wam_sim.replay import tables
from wam_sim.simulation import Rows, Simulation

STEPS = [
    {"name": "release", "seconds": 0.1, "request": "enable"},
    {
        "name": "move and be pushed",
        "seconds": 0.5,
        "posture": [0.1, -0.7, 0.05, 0.4],
        "push": {"cover": "outer_link", "contact_position": 0.3, "newtons": [0.0, 9.0, 2.0], "begin": 0.1, "end": 0.4},
    },
    {"name": "press on nothing", "seconds": 0.1, "force": {"frame": "outer_link", "newtons": [0.0, -3.0, 0.0]}},
    {"name": "brake", "seconds": 0.1, "request": "disable"},
]


NUMBERS = ("position", "velocity", "effort", "force", "torque", "point")


def record_in_processes(configured: Configuration, how: str = EACH) -> None:
    from wam_ros.bring_up import Processes

    with Processes(configured, processes=how) as processes:
        ((name, code),) = processes.wait(bool).items()
        assert (name.split()[-1], code) == ("scenario", 0)


def play_directly(configured: Configuration) -> Simulation:
    run = Simulation(configured, load(configured.sections["scenario"]["script"], configured.shared))
    assert run.play() == ""
    return run


def differences(rows: Rows, bag: Bag) -> list[str]:
    """Topics of a direct run whose numbers are not those of the bag, bit for bit."""
    found = []
    for topic, published in rows.items():
        columns: Any = bag.topics[f"/wam/{topic}"]
        if isinstance(columns, TableColumns):
            tabled = [[number for row in table.rows for number in row] for table in tables(columns)]
            if repr([list(row.values) for row in published]) != repr(tabled):
                found.append(topic)
            continue
        fields = [getattr(columns, name, None) for name in NUMBERS]
        numbers = np.hstack([field for field in fields if field is not None])
        here = np.array([row.values for row in published])
        if here.shape != numbers.shape or here.tobytes() != np.ascontiguousarray(numbers).tobytes():
            found.append(f"{topic}: {here.shape} and {numbers.shape}")
        if [row.stamp for row in published] != columns.stamp_ns.tolist():
            found.append(f"{topic}: stamps")
        if published[0].frame and [row.frame for row in published] != list(columns.frames):
            found.append(f"{topic}: frames")
    return found


@pytest.mark.parametrize(("delay", "dither_cycle"), [(0, 0), (1, 40)])
def test_lockstep_over_topics_equals_the_loop_without_ros(delay: int, dither_cycle: int, arm: RunningArm) -> None:
    bag = arm.play(STEPS, timing={"outer_delay": delay, "dither_cycle": dither_cycle})
    run = play_directly(arm.configuration)
    assert len(run.rows["motor_states"]) == 801
    assert differences(run.rows, bag) == []


@pytest.mark.slow
def test_one_period_of_delay_changes_the_numbers(tmp_path: Path) -> None:
    runs = [play_directly(playing(STEPS, tmp_path, timing={"outer_delay": delay})) for delay in (0, 1)]
    assert runs[0].rows["motor_states"] != runs[1].rows["motor_states"]


def test_processes_under_load_say_what_one_process_says(tmp_path: Path, arm: RunningArm) -> None:
    def named(name: str) -> Configuration:
        return playing(STEPS, tmp_path, recorder={"name": name})

    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2)]
    try:
        record_in_processes(named("loaded"))
    finally:
        for process in busy:
            process.kill()
            process.wait()
    record_in_processes(named("grouped"), GROUPED)
    arm.play(STEPS, recorder={"name": "composed"})
    assert compare(tmp_path / "loaded", tmp_path / "composed") == []
    assert compare(tmp_path / "grouped", tmp_path / "composed") == []
    bag = read(tmp_path / "loaded")
    assert "/wam/status" in bag.topics
    assert len(bag.topics["/wam/motor_states"].log_time_ns) == 801


def test_what_works_every_inner_period_shares_a_process_and_so_does_the_rest_without_the_recorder() -> None:
    nodes = [*Configuration.load(packaged("wam")).shared.nodes, "scenario", "recorder"]
    outer = ["transform", "gravity", "force_loop", "contact_estimator", "scenario"]
    assert process_groups(nodes, GROUPED) == [["driver", "velocity_loop"], outer, ["recorder"]]
    assert process_groups(nodes, ONE) == [nodes]
    assert process_groups(nodes, EACH) == [[node] for node in nodes]
    own = "wam_control.velocity.position_loop:PositionLoopNode"
    assert process_groups(["driver", own], GROUPED) == [["driver", own]], "what counts is that it is an inner loop"


def test_a_node_of_another_name_has_a_process_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "own_nodes.py").write_text(
        "from wam_control.velocity.gravity_node import GravityNode\n"
        "class Slow(GravityNode):\n    name = 'slow'\n"
        "class Another(GravityNode):\n    pass\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    slow, another = "own_nodes:Slow", "own_nodes:Another"
    assert process_groups(["force_loop", slow, another], GROUPED) == [["force_loop", another], [slow]]


MS = 1_000_000
TIMING = Timing("lockstep", 0.001, 2, 5, 1, 10, 0, 5.0, 0.0, 0, 0)


def puts(synchroniser: Synchroniser, topic: str, stamp: int, value: str) -> list[tuple[int, float, str, str | None]]:
    """Stamp, dt, state and command of each step that an input completes."""
    steps = synchroniser.inlets[topic](stamp, value)
    return [(inputs.stamp, inputs.dt, inputs["state"], inputs["command"]) for inputs in steps]


def test_a_step_waits_for_the_command_that_belongs_to_the_state() -> None:
    synchroniser = Synchroniser(TIMING, "state", {"command": InputSpec(outer=True, delay=1)})
    assert puts(synchroniser, "state", 1 * MS, "s1") == [(1 * MS, 0.001, "s1", None)]
    assert puts(synchroniser, "state", 2 * MS, "s2") == []
    assert synchroniser.missing(2 * MS) == ["command"]
    assert puts(synchroniser, "command", 1 * MS, "c1") == [(2 * MS, 0.001, "s2", "c1")]
    assert puts(synchroniser, "command", 6 * MS, "c6") == []
    assert puts(synchroniser, "state", 6 * MS, "s6") == [(6 * MS, 0.004, "s6", "c1")]
    assert puts(synchroniser, "state", 7 * MS, "s7") == [(7 * MS, 0.001, "s7", "c6")]


def test_a_node_that_begins_late_leaves_out_the_steps_whose_inputs_it_has_missed() -> None:
    synchroniser = Synchroniser(TIMING, "state", {"command": InputSpec(outer=True, delay=1)})
    for tick in (1003, 1004, 1005, 1006):  # they need the command of 1001
        assert puts(synchroniser, "state", tick * MS, f"s{tick}") == []
    assert puts(synchroniser, "command", 1006 * MS, "c1006") == []
    assert puts(synchroniser, "state", 1007 * MS, "s1007") == [(1007 * MS, 0.001, "s1007", "c1006")]


def test_a_step_waits_fifty_periods_for_the_answer_to_an_earlier_state_and_then_does_without() -> None:
    synchroniser = Synchroniser(TIMING, "state", {"command": InputSpec(outer=True, delay=5)})
    late = [((11 + i) * MS, 0.001, "s", "c1") for i in range(5)]
    expected = {10: [(10 * MS, 0.001, "s", "c1")], 56: [], 57: late}
    puts(synchroniser, "state", 1 * MS, "s1")
    puts(synchroniser, "command", 1 * MS, "c1")
    for tick in range(6, 61):  # they need the answers to 1, 6, 11 ...; that to 6 never comes
        made = puts(synchroniser, "state", tick * MS, "s")
        assert made == expected.get(tick, made)
    assert puts(synchroniser, "command", 11 * MS, "c11")[0][2:] == ("s", "c11")


def test_in_realtime_a_step_takes_the_newest_and_never_waits() -> None:
    realtime = dataclasses.replace(TIMING, mode="realtime")
    synchroniser = Synchroniser(realtime, "state", {"command": InputSpec(outer=True)})
    assert puts(synchroniser, "state", 1_000_000, "s1") == [(1_000_000, 0.001, "s1", None)]
    assert puts(synchroniser, "command", 1_000_000, "old") == []
    assert puts(synchroniser, "command", 6_000_000, "new") == []
    assert puts(synchroniser, "state", 9_000_000, "s9") == [(9_000_000, 0.008, "s9", "new")]
    assert puts(synchroniser, "state", 9_000_000, "s9") == [], "one that comes twice starts one step"


@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
def test_the_age_of_an_input_counts_from_the_state_that_caused_it(mode: str) -> None:
    timing = dataclasses.replace(TIMING, mode=mode)
    synchroniser = Synchroniser(timing, "state", {"command": InputSpec(outer=True, delay=1)})
    assert list(synchroniser.inlets["command"](1_000_000, "c1")) == []
    (inputs,) = synchroniser.inlets["state"](4_000_000, "s4")
    assert (inputs.age("command"), inputs.stamp_of("command")) == (0.003, 1_000_000)
    assert (inputs.age("nothing"), inputs["nothing"]) == (0.0, None)


@pytest.mark.parametrize(("delay", "taken"), [(0, {1: 1, 6: 6, 11: 11}), (1, {1: None, 6: 1, 11: 6})])
def test_an_outer_step_takes_states_and_inputs_of_outer_periods_only(delay: int, taken: dict[int, int | None]) -> None:
    spec = InputSpec(outer=False, delay=delay)
    synchroniser = Synchroniser(TIMING, "state", {"sensors": spec}, outer=True, thinned=True)
    for tick in range(1, 12):
        synchroniser.inlets["sensors"](tick * 1_000_000, tick)
        steps = [(inputs.stamp, inputs["sensors"]) for inputs in synchroniser.inlets["state"](tick * 1_000_000, tick)]
        assert steps == ([(tick * 1_000_000, taken[tick])] if tick in taken else [])


def test_an_outer_step_waits_for_its_inputs_of_both_rates_and_leaves_out_what_one_of_them_has_missed() -> None:
    specs = {"sensors": InputSpec(outer=False), "estimate": InputSpec(outer=True)}
    synchroniser = Synchroniser(TIMING, "state", specs, outer=True)
    assert list(synchroniser.inlets["state"](1 * MS, "s1")) == []
    for tick in range(1, 7):
        assert list(synchroniser.inlets["sensors"](tick * MS, tick)) == []
    assert synchroniser.missing(1 * MS) == ["estimate"]
    assert list(synchroniser.inlets["state"](6 * MS, "s6")) == []
    (inputs,) = synchroniser.inlets["estimate"](6 * MS, "e6")  # that of the first one can no longer come
    assert (inputs["state"], inputs["sensors"], inputs["estimate"]) == ("s6", 6, "e6")
