"""Real-time factor of the simulation: lockstep over topics in one process and in several, and the loop without ROS.

The scenario is a short form of the demonstration: enable, move, a push on the outer link, brake.  What is required is
of a computer on which the bare plant, MuJoCo's step of the same arm, makes 94 times real time: how fast it is here is
measured in each round, too, and must and aim are about what follows for that computer.
"""

import tempfile
import time
from pathlib import Path
from typing import Any

import mujoco
import yaml
from comparing import arguments, machine, mark, quartiles, ratios, save, table
from comparing.clock import Readings, watched_clock
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from wam_control.task.scenario import ScenarioStep, load
from wam_description.arm import Shared
from wam_description.configuration import Configuration, packaged
from wam_description.mjcf import mjcf
from wam_description.nodes import EACH, GROUPED
from wam_description.rigid_body import RigidBody
from wam_description.transmission_map import TransmissionMap
from wam_driver.driver import DriverParameters
from wam_ros.bring_up import Composition, Processes
from wam_sim.simulation import Simulation

STEADY = ClockType.STEADY_TIME
POLL = 0.02  # s between two readings of the arm's time
BARE = 94.0  # times real time of the bare plant on the computer of the requirements
ROWS = {  # must, aim
    "direct run": (14.0, 20.0),
    "lockstep": (4.0, 5.5),
    "lockstep, recorded": (3.0, 4.5),
    "grouped, recorded": (1.8, 3.0),
    "one process per node, recorded": (1.2, 1.6),
}


def scenario(seconds: float) -> dict[str, Any]:
    """Steps of `seconds` in total."""
    push = {
        "cover": "outer_link",
        "contact_position": 0.28,
        "newtons": [0.0, 12.0, 0.0],
        "begin": 0.1,
        "end": 0.3 * seconds,
    }
    return {
        "steps": [
            {"name": "release", "seconds": 0.1 * seconds, "request": "enable"},
            {"name": "move", "seconds": 0.4 * seconds, "posture": [0.0, -0.8, 0.0, 0.3]},
            {"name": "be pushed", "seconds": 0.4 * seconds, "posture": [0.1, -0.9, 0.0, 0.5], "push": push},
            {"name": "brake", "seconds": 0.1 * seconds, "request": "disable"},
        ]
    }


def scenario_steps(seconds: float, shared: Shared) -> list[ScenarioStep]:
    """The steps of `scenario`, as the scenario node has them."""
    with tempfile.TemporaryDirectory(prefix="wam_bench_") as folder:
        script = Path(folder) / "script.yaml"
        script.write_text(yaml.safe_dump(scenario(seconds)), encoding="utf-8")
        return load(script, shared)


def bare(configuration: Configuration, seconds: float) -> float:
    """Times real time of MuJoCo's steps alone, of the arm that its motors hold at its start."""
    shared, driver = configuration.shared, configuration.node("driver", DriverParameters)
    arm, step = shared.arm, shared.timing.substep
    model = mujoco.MjModel.from_xml_string(mjcf(arm, step, driver.world, driver.effects))
    data = mujoco.MjData(model)
    n, transmission = len(arm.joints.names), TransmissionMap.of(arm)
    data.qpos[n : 2 * n] = arm.joints.start
    data.qpos[:n] = transmission.motor_from_joint @ arm.joints.start
    data.ctrl[:] = transmission.motor_torques(RigidBody(arm).gravity_torque(arm.joints.start).tolist())
    count = round(seconds / step)
    begin = time.perf_counter()
    for _ in range(count):
        mujoco.mj_step(model, data)
    return count * step / (time.perf_counter() - begin)


def direct(configuration: Configuration, script: Path) -> float:
    """Simulated seconds per second of wall-clock time, without ROS."""
    run = Simulation(configuration, load(script, configuration.shared))
    begin = time.perf_counter()
    if failure := run.play():
        raise SystemExit(failure)
    return run.driver.stamp / 1e9 / (time.perf_counter() - begin)


def lockstep(configuration: Configuration, *recorder: str) -> float:
    """The same over topics in one process, without the start of the nodes."""
    nodes = {"nodes": [*configuration.shared.nodes, "scenario", *recorder]}
    seen: Readings = []
    with Composition(configuration.with_values(nodes)) as composition:
        driver: Any = composition.nodes["driver"]
        player: Any = composition.nodes["scenario"]
        watch = Node("stopwatch", context=composition.context)
        watch.create_timer(
            POLL, lambda: seen.append((time.perf_counter(), driver.driver.stamp)), clock=Clock(clock_type=STEADY)
        )
        composition.executor.add_node(watch)
        composition.spin(lambda: player.done)
        composition.executor.remove_node(watch)
        watch.destroy_node()
        if player.failure:
            raise SystemExit(player.failure)
    return _speed(seen)


def processes(configuration: Configuration, how: str) -> float:
    """The same in processes, with the recorder, seen from outside."""
    nodes = {"nodes": [*configuration.shared.nodes, "scenario", "recorder"]}
    with (
        watched_clock() as (executor, seen),
        Processes(configuration.with_values(nodes), log_level="warn", processes=how) as stack,
    ):
        while not stack.ended():
            executor.spin_once(timeout_sec=0.1)
        if stack.failures:
            raise SystemExit(stack.failures[0])
    if stack.bag_failure:
        raise SystemExit(stack.bag_failure)
    return _speed(seen)


def _speed(seen: Readings) -> float:
    first, last = seen[0][1], seen[-1][1]
    running = [(at, stamp) for at, stamp in seen if first < stamp < last]
    (begin, start), (end, stop) = running[0], running[-1]
    return (stop - start) / 1e9 / (end - begin)


def main() -> None:
    """Measure in turns, print the table."""
    given = arguments(__doc__, rounds=5, quick_rounds=1)
    speeds: dict[str, list[float]] = {row: [] for row in ROWS}
    plant: list[float] = []
    with tempfile.TemporaryDirectory(prefix="wam_bench_") as folder:
        script = Path(folder) / "script.yaml"
        script.write_text(yaml.safe_dump(scenario(2.0 if given.quick else 5.0)), encoding="utf-8")
        configuration = Configuration.load(packaged("wam")).with_values(
            {
                "timing.mode": "lockstep",
                "timing.real_time_factor": 0.0,
                "scenario:script": str(script),
                "recorder:directory": folder,
            }
        )
        for i in range(given.rounds):
            recorded = configuration.with_values({"recorder:name": f"round_{i}"})
            plant.append(bare(configuration, 2.0 if given.quick else 20.0))
            speeds["direct run"].append(direct(configuration, script))
            speeds["lockstep"].append(lockstep(configuration))
            speeds["lockstep, recorded"].append(lockstep(recorded, "recorder"))
            for row, how in (("grouped", GROUPED), ("one process per node", EACH)):
                named = configuration.with_values({"recorder:name": f"{how}_{i}"})
                speeds[f"{row}, recorded"].append(processes(named, how))
    rows, measured = [], dict[str, Any]()
    for name, values in speeds.items():
        real, least, scaled = quartiles(values), ratios(speeds["direct run"], values), ratios(values, plant)
        there = BARE * scaled.median
        rows.append([name, f"{real:.2f}", f"{there:.2f}", f"{least:.2f}", mark(there, *ROWS[name])])
        measured[name] = {"real_time_ratio": real, "direct_ratio": least, "bare_ratio": scaled}
    print(f"{machine()}; the bare plant makes {quartiles(plant):.0f} times real time")
    required = f"with a bare plant of {BARE:.0f}"
    head = ["scenario", "times real time (middle half)", required, "direct run is faster by", "[must, aim]"]
    print(table(head, rows))
    save("speed", given, measured)


if __name__ == "__main__":
    main()
