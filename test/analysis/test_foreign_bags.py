"""Bags of other robots: what was planted in ten is found within 2 %, and nothing is found in ten quiet ones."""

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_bags import MOTORS, ORIGIN, Sent, by_json, by_mcap_ros2, by_rosbags, joints, wrenches

from wam_analysis.findings.analysis import Analysis, analyse
from wam_analysis.findings.finding import Finding
from wam_analysis.findings.page import page
from wam_analysis.foreign.clocks import rising
from wam_analysis.foreign.topic_map import TopicMap, topic_map
from wam_bag import rosbags_file
from wam_bag.bag import BagError

PANDA = [f"panda_joint{i}" for i in range(1, 8)]
UR = [f"{n}_joint" for n in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")]
RATE = 250.0
CLOSE = 0.02
Made = tuple[Path, TopicMap]


def times(seconds: float, rate: float = RATE) -> Any:
    return np.arange(0.0, seconds, 1.0 / rate)


def chance(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def sine(time: Any, frequency: float, size: float, begin: float = 0.0, end: float = math.inf) -> Any:
    """A cycle of this peak to peak between two times."""
    return 0.5 * size * np.sin(2.0 * np.pi * frequency * time) * ((time >= begin) & (time < end))


def at_rest(time: Any, names: list[str], seed: int, noise: float = 1e-5) -> Any:
    return np.linspace(-1.0, 1.0, len(names)) + noise * chance(seed).normal(size=(len(time), len(names)))


WAVES = ((0.5, 0.31), (0.3, 0.53), (0.15, 1.07), (0.05, 1.9))


def swung(time: Any, seed: int, waves: Any = WAVES) -> tuple[Any, Any, Any]:
    """Position, velocity and acceleration of a motion with several frequencies."""
    drawn = chance(seed)
    phases = drawn.uniform(0.0, 6.0, len(waves))
    parts = [(a, 2.0 * np.pi * f, p) for (a, f), p in zip(waves, phases, strict=True)]
    return (
        sum(a * np.sin(w * time + p) for a, w, p in parts),
        sum(a * w * np.cos(w * time + p) for a, w, p in parts),
        sum(-a * w * w * np.sin(w * time + p) for a, w, p in parts),
    )


DRY, VISCOUS, INERTIA, WEIGHT = 0.8, 0.4, 0.12, 6.0


def loaded(q: Any, v: Any, a: Any, weight: float, seed: int) -> Any:
    friction = DRY * np.sign(v) + VISCOUS * v + INERTIA * a
    return friction + weight * np.sin(q + 0.4) + 0.02 * chance(seed).normal(size=len(q))


def found(made: Made) -> tuple[Analysis, dict[str, float]]:
    analysis = analyse(made[0], lambda doing: None, made[1])
    return analysis, {one.name: one.measured for section in analysis.sections for one in section.findings}


def seven_joints(path: Path) -> tuple[Made, dict[str, float]]:
    """A cycle in one of seven joints, friction in another."""
    time = times(30.0)
    position, velocity, effort = at_rest(time, PANDA, 1), np.zeros((len(time), 7)), np.zeros((len(time), 7))
    position[:, 3] += sine(time, 3.1, 0.02)
    q, v, a = swung(time, 2)
    position[:, 1], velocity[:, 1], effort[:, 1] = q, v, loaded(q, v, a, 0.0, 3)
    sent = joints("/joint_states", time, PANDA, position=position, velocity=velocity, effort=effort)
    planted = {"panda_joint4: frequency": 3.1, "panda_joint4: cycle, peak to peak": 0.02}
    planted |= {"panda_joint2: dry friction": DRY, "panda_joint2: viscous friction": VISCOUS}
    return (by_mcap_ros2(path, sent), TopicMap()), planted | {"panda_joint2: inertia": INERTIA}


def cycle_in_a_window_with_gaps(path: Path) -> tuple[Made, dict[str, float]]:
    """A cycle from 8 to 22 s; the recorder lost two times half a second."""
    time = times(30.0)
    position = at_rest(time, UR, 4)
    position[:, 4] += sine(time, 7.3, 0.004, 8.0, 22.0)
    kept = ~(((time > 3.0) & (time < 3.5)) | ((time > 26.0) & (time < 26.5)))
    sent = joints("/joint_states", time[kept], UR, position=position[kept], velocity=np.zeros_like(position[kept]))
    planted = {"wrist_2_joint: frequency": 7.3, "wrist_2_joint: cycle, peak to peak": 0.004}
    planted |= {"wrist_2_joint: begin": 8.0, "wrist_2_joint: end": 22.0}
    planted |= {"/joint_states: longest gap between stamps": 0.5}
    return (by_rosbags(path, sent), TopicMap()), planted | {"wrist_2_joint, 7.3 Hz: frequency": 7.3}


def wrench_beside_joints(path: Path) -> tuple[Made, dict[str, float]]:
    """Two arms with prefixes, and a wrench that cycles."""
    time = times(20.0)
    names = [f"{side}_{name}" for side in ("left", "right") for name in UR]
    force = 0.1 * chance(5).normal(size=(len(time), 3)) + [0.0, 0.0, -8.0]
    force[:, 1] += sine(time, 5.2, 2.4)
    sent = joints("/arms/joint_states", time, names, position=at_rest(time, names, 6))
    sent += wrenches("/left/ft_sensor/wrench", time, force, "left_tool0")
    planted = {
        "/left/ft_sensor/wrench force.y: frequency": 5.2,
        "/left/ft_sensor/wrench force.y: cycle, peak to peak": 2.4,
    }
    return (by_mcap_ros2(path, sent), TopicMap()), planted | {"/left/ft_sensor/wrench force.y, 5.2 Hz: amplitude": 1.2}


def no_velocities_and_a_weight(path: Path) -> tuple[Made, dict[str, float]]:
    """Velocities are empty, positions in steps of an encoder, and gravity and a spring load the joint."""
    time = times(60.0)
    q, v, a = swung(time, 7)
    quantum = 2.0 * math.pi / 2**17
    position = np.column_stack([quantum * np.rint(q / quantum), np.zeros(len(time))])
    effort = np.column_stack([loaded(q, v, a, WEIGHT, 8) + 2.0 * q, np.zeros(len(time))])
    sent = joints("/robot/joint_states", time, ["j1", "j2"], position=position, effort=effort)
    planted = {"j1: dry friction": DRY, "j1: viscous friction": VISCOUS, "j1: inertia": INERTIA}
    return (by_rosbags(path, sent), TopicMap()), planted


def two_senders_of_a_topic(path: Path) -> tuple[Made, dict[str, float]]:
    """Arm and gripper publish on one topic, best effort: some are lost, all come late by chance."""
    time, drawn = times(30.0), chance(9)
    kept = np.sort(drawn.permutation(len(time))[: int(0.96 * len(time))])
    delay = 1e-3 * drawn.random(len(time))
    position = at_rest(time, UR, 10)
    position[:, 2] += sine(time, 4.1, 0.01)
    arm = joints("/joint_states", time[kept], UR, position=position[kept])
    arm = [one._replace(received=one.received + late) for one, late in zip(arm, delay, strict=False)]
    slow = times(30.0, 31.0) + 0.0007
    gripper = joints("/joint_states", slow, ["finger"], position=at_rest(slow, ["finger"], 11))
    planted = {"elbow_joint: frequency": 4.1, "elbow_joint: cycle, peak to peak": 0.01}
    timing = {f"/joint_states of {', '.join(UR)}: missed periods": float(kept[-1] - kept[0] + 1 - len(kept))}
    return (by_mcap_ros2(path, arm + gripper), TopicMap()), planted | timing


def two_frames_of_a_topic(path: Path) -> tuple[Made, dict[str, float]]:
    """Two force sensors publish on one topic; one of them cycles."""
    time = times(20.0)
    quiet, loud = (0.05 * chance(seed).normal(size=(len(time), 3)) for seed in (12, 13))
    loud[:, 2] += sine(time, 2.7, 6.0)
    sent = wrenches("/wrench", time, quiet, "left_tool") + wrenches("/wrench", time + 1e-4, loud, "right_tool")
    name = "/wrench (right_tool) force.z"
    return (by_rosbags(path, sent), TopicMap()), {f"{name}: frequency": 2.7, f"{name}: cycle, peak to peak": 6.0}


def steps_of_a_force(path: Path) -> tuple[Made, dict[str, float]]:
    """A force follows its command with 0.15 s, 3 % too low; it was commanded before the recording begins."""
    time, tau = times(20.0), 0.15
    command = np.where(time < 5.0, 6.0, np.where(time < 12.0, 20.0, np.where(time < 16.0, 35.0, -10.0)))
    force = np.full((len(time), 3), [0.0, 0.0, 5.82])
    for i in range(1, len(time)):
        force[i, 2] = force[i - 1, 2] + (0.97 * command[i - 1] - force[i - 1, 2]) * (
            1.0 - math.exp(-1.0 / (RATE * tau))
        )
    noisy = 0.02 * chance(14).normal(size=force.shape) - force  # of the environment on the sensor
    asked = wrenches("/controller/target_wrench", time[::5], np.column_stack([0 * command, 0 * command, command])[::5])
    name = "/ft wrench, 20 N at 5.0 s"
    planted = {f"{name}: rise time 10-90 %": math.log(9.0) * tau, f"{name}: force in the steady state": 19.4}
    for at, steady in (("6 N at 0.0 s", 5.82), ("35 N at 12.0 s", 33.95), ("-10 N at 16.0 s", -9.7)):
        planted[f"/ft wrench, {at}: force in the steady state"] = steady
    planted |= {f"{name}: settling time to 5 %": math.log(20.0) * tau}
    planted = {k.replace("/ft wrench", "/ft/wrench"): v for k, v in planted.items()}
    given = TopicMap(commands=("/controller/target_wrench",))
    return (by_mcap_ros2(path, asked + wrenches("/ft/wrench", time, noisy)), given), planted


def commanded_and_not(path: Path) -> tuple[Made, dict[str, float]]:
    """One joint follows a commanded sine and cycles on top of it, the other cycles at a constant command."""
    time = times(30.0)
    asked = np.column_stack([0.8 * np.sin(2.0 * np.pi * 0.5 * time), np.full(len(time), 0.3)])
    position = asked + 1e-5 * chance(15).normal(size=asked.shape)
    position[:, 0] = 0.79 * np.sin(2.0 * np.pi * 0.5 * (time - 0.03)) + sine(time, 9.7, 0.006)
    position[:, 1] += sine(time, 6.3, 0.01)
    sent = joints("/joint_states", time, ["a", "b"], position=position)
    sent += joints("/joint_command", time[::2], ["a", "b"], position=asked[::2])
    planted = {"b: frequency": 6.3, "b: cycle, peak to peak": 0.01, "a: frequency": 0.5, "a: cycle, peak to peak": 1.58}
    planted |= {"a from 0.2 s: frequency": 9.7, "a from 0.2 s: cycle, peak to peak": 0.006}
    return (by_rosbags(path, sent), TopicMap(commands=("/joint_command",))), planted


def stick_slip_of_ros1(path: Path) -> tuple[Made, dict[str, float]]:
    """ROS 1, degrees: 24 slips of 0.2 s, at rest in between, while the command moves steadily."""
    time = times(24.0)
    speed = 20.0 * np.clip((0.1 - np.abs(time % 1.0 - 0.5)) / 0.004, 0.0, 1.0) + 0.01 * chance(18).normal(
        size=len(time)
    )
    position = np.cumsum(speed) / RATE  # deg
    sent = joints("/joint_states", time, ["slide"], position=position[:, np.newaxis], velocity=speed[:, np.newaxis])
    sent += joints("/joint_reference", time, ["slide"], position=(4.0 * time)[:, np.newaxis])
    units = topic_map([], [], ["/joint_reference"], [], ["position=deg", "velocity=deg/s"])
    return (by_rosbags(path, sent, "ros1"), units), {"slide: motions": 24.0, "slide: at rest": 80.0}


def mapped_currents(path: Path) -> tuple[Made, dict[str, float]]:
    """A type of its own in SQLite: currents of motors, 0.25 N m/A."""
    time = times(30.0)
    q, v, a = swung(time, 16)
    current = loaded(q, v, a, 0.0, 17) / 0.25
    sent = [
        Sent("/drives", MOTORS, t, t, "", {"q": [q[i], 0.0], "dq": [v[i], 0.0], "current": [current[i], 0.0]})
        for i, t in enumerate(time.tolist())
    ]
    fields = ["position=q", "velocity=dq", "effort=current"]
    given = topic_map(["/drives"], ["base", "arm"], [], fields, ["effort=0.25"])
    planted = {"base: dry friction": DRY, "base: viscous friction": VISCOUS, "base: inertia": INERTIA}
    return (by_rosbags(path, sent, "sqlite3"), given), planted


PLANTED: list[Callable[[Path], tuple[Made, dict[str, float]]]] = [
    seven_joints, cycle_in_a_window_with_gaps, wrench_beside_joints, no_velocities_and_a_weight, two_senders_of_a_topic,
    two_frames_of_a_topic, steps_of_a_force, commanded_and_not, stick_slip_of_ros1, mapped_currents,
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("plant", PLANTED, ids=lambda plant: plant.__name__)
def test_what_was_planted_is_found_within_two_percent(plant: Any, tmp_path: Path) -> None:
    made, planted = plant(tmp_path / "bag")
    _, numbers = found(made)
    assert {name: numbers.get(name) for name in planted} == pytest.approx(planted, rel=CLOSE)


def resting(path: Path) -> Made:
    time = times(20.0)
    return by_mcap_ros2(path, joints("/joint_states", time, PANDA, position=at_rest(time, PANDA, 20))), TopicMap()


def noisy_wrench(path: Path) -> Made:
    time = times(20.0)
    return by_rosbags(path, wrenches("/wrench", time, chance(21).normal(size=(len(time), 3)))), TopicMap()


def drifting_wrench(path: Path) -> Made:
    time = times(20.0)
    drift = np.cumsum(0.02 * chance(22).normal(size=(len(time), 3)), axis=0)
    return by_mcap_ros2(path, wrenches("/wrench", time, drift)), TopicMap()


def ringing(path: Path) -> Made:
    """An impact rings down: no limit cycle."""
    time = times(20.0)
    ring = np.where(time > 2.0, np.exp(-(time - 2.0) / 1.5) * np.sin(2.0 * np.pi * 6.0 * (time - 2.0)), 0.0)
    force = 0.02 * chance(23).normal(size=(len(time), 3))
    force[:, 0] += 8.0 * ring
    return by_rosbags(path, wrenches("/wrench", time, force)), TopicMap()


def moved_once_and_back(path: Path) -> Made:
    time = times(20.0)
    way = np.clip(time - 4.0, 0.0, 2.0) - np.clip(time - 12.0, 0.0, 2.0)
    position = at_rest(time, ["a"], 24) + 0.3 * way[:, np.newaxis]
    return by_rosbags(path, joints("/joint_states", time, ["a"], position=position), "sqlite3"), TopicMap()


def frictionless_with_gravity(path: Path) -> Made:
    """Two joints swing; weight and inertia alone load them, and each other."""
    time = times(40.0)
    (p, _, a), (q, _, b) = swung(time, 25), swung(time, 26)
    noise = 0.02 * chance(27).normal(size=(len(time), 2))
    effort = np.column_stack(
        [3.0 * np.sin(p) + 2.0 * np.sin(p + q) + 0.2 * a + 0.05 * b, 2.0 * np.sin(p + q) + 0.05 * b]
    )
    sent = joints("/joint_states", time, ["p", "q"], position=np.column_stack([p, q]), effort=effort + noise)
    return by_mcap_ros2(path, sent), TopicMap()


def one_commanded_sine(path: Path) -> Made:
    time = times(20.0)
    asked = np.sin(2.0 * np.pi * 0.7 * time)[:, np.newaxis]
    got = 0.97 * np.sin(2.0 * np.pi * 0.7 * (time - 0.02))[:, np.newaxis] + 1e-5 * chance(28).normal(
        size=(len(time), 1)
    )
    sent = joints("/joint_states", time, ["a"], position=got) + joints("/cmd/joints", time, ["a"], position=asked)
    return by_mcap_ros2(path, sent), TopicMap(commands=("/cmd/joints",))


def coarse_encoder(path: Path) -> Made:
    """Encoders with 4096 steps: two flicker by chance, one turns slowly."""
    time = times(20.0)
    quantum = 2.0 * math.pi / 4096
    steps = np.rint(np.column_stack([0.5 + 0.3 * chance(29).normal(size=(len(time), 2)), 0.02 * time / quantum]))
    return by_rosbags(path, joints("/joint_states", time, ["a", "b", "c"], position=quantum * steps)), TopicMap()


def lossy_and_reset(path: Path) -> Made:
    """Every tenth message is lost by chance, and the clock of the stamps starts again."""
    time = times(20.0)
    kept = time[chance(30).random(len(time)) > 0.1]
    sent = joints("/joint_states", kept, ["a"], position=at_rest(kept, ["a"], 31))
    sent = [one._replace(stamp=one.stamp if one.stamp < 10.0 else one.stamp - 10.0) for one in sent]
    return by_mcap_ros2(path, sent), TopicMap()


def wandering(path: Path) -> Made:
    """Joints that were led by hand: smooth, and never the same twice."""
    time, drawn = times(20.0), chance(32)
    speed = np.zeros((len(time), 3))
    for i in range(1, len(time)):
        speed[i] = 0.995 * speed[i - 1] + 0.01 * drawn.normal(size=3)
    sent = joints("/joint_states", time, ["a", "b", "c"], position=np.cumsum(speed, axis=0) / RATE)
    return by_rosbags(path, sent, "ros1"), TopicMap()


QUIET: list[Callable[[Path], Made]] = [
    resting, noisy_wrench, drifting_wrench, ringing, moved_once_and_back, frictionless_with_gravity, one_commanded_sine,
    coarse_encoder, lossy_and_reset, wandering,
]  # fmt: skip


THERE = {  # frequencies that these have, though no cycle
    "ringing": [6.0],
    "one_commanded_sine": [0.7],
    "frictionless_with_gravity": [0.31, 0.53, 1.07, 1.9, 0.3, 0.5, 0.15],  # of the motion, its sums and harmonics
}


@pytest.mark.slow
@pytest.mark.parametrize("make", QUIET, ids=lambda make: make.__name__)
def test_nothing_is_found_in_a_quiet_bag(make: Any, tmp_path: Path) -> None:
    analysis, numbers = found(make(tmp_path / "bag"))
    invented = [name for name in numbers if name.endswith(("dry friction", "viscous friction", "inertia"))]
    sections = {section.key: section for section in analysis.sections}
    assert invented == []
    assert not any(sections[key].shows for key in {"stability", "stick_slip", "force"} & sections.keys())
    lines = [one.measured for one in sections["frequency"].findings if one.quantity == "frequency"]
    assert all(any(f == pytest.approx(known, rel=CLOSE) for known in THERE.get(make.__name__, ())) for f in lines)


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, 2e-3, 5e-3])
def test_a_joint_that_turns_back_does_not_stick_and_one_that_hunts_does(noise: float, tmp_path: Path) -> None:
    time = times(24.0)
    w = 4.0 * np.pi
    swing = np.column_stack([0.005 * np.sin(w * time), 0.005 * w * np.cos(w * time)])
    phase = (time / 2.0) % 1.0  # rest, a quick step, rest, a quick step back
    hunt = 0.01 * (np.clip((phase - 0.4) / 0.1, 0.0, 1.0) - np.clip((phase - 0.9) / 0.1, 0.0, 1.0))
    both = np.column_stack([swing[:, 0], hunt])
    speed = np.column_stack([swing[:, 1], np.gradient(hunt, time)]) + noise * chance(40).normal(size=both.shape)
    sent = joints("/joint_states", time, ["swings", "hunts"], position=both, velocity=speed)
    asked = np.column_stack(2 * [0.05 * np.sin(np.pi * time)])
    sent += joints("/cmd/joints", time, ["swings", "hunts"], position=asked)
    analysis, numbers = found((by_mcap_ros2(tmp_path / "bag", sent), TopicMap(commands=("/cmd/joints",))))
    (stick_slip,) = (section for section in analysis.sections if section.key == "stick_slip")
    assert [one.partition(":")[0] for one in stick_slip.shows] == ["hunts"]
    assert re.search(r"\(from 0\.(79|8\d), 1\.(79|8\d), 2\.", stick_slip.shows[0])
    assert numbers["swings: motions"] == 1.0
    assert numbers["hunts: motions"] == pytest.approx(24.0, abs=1.0)


def test_a_stamp_of_zero_and_values_that_are_no_numbers(tmp_path: Path) -> None:
    time = times(8.0)
    position = at_rest(time, ["a", "b"], 43)
    position[:, 1] = math.nan
    sent = joints("/joint_states", time, ["a", "b"], position=position, velocity=0.0 * position)
    sent[0] = sent[0]._replace(stamp=-ORIGIN / 1e9)
    sent += wrenches("/wrench", time, np.full((len(time), 3), math.nan))
    analysis, numbers = found((by_mcap_ros2(tmp_path / "bag", sent), TopicMap()))
    assert numbers["/joint_states: missed periods"] == 0.0
    assert "a over time." in page(analysis)
    happened = " ".join(line for section in analysis.sections[:2] for line in section.sentences)
    assert "/joint_states: b without a number for position, velocity or effort." in happened
    assert f"/wrench: {len(time)} forces, none of which is a number." in happened
    stamps = ORIGIN + 10**7 * np.arange(100)
    assert np.array_equal(rising(np.where(np.arange(100) % 5 == 3, 0, stamps), stamps + 800_000), stamps)


def quiet(path: Path, *commands: str) -> Analysis:
    return analyse(path, lambda doing: None, TopicMap(commands=commands))


def cycling(time: Any, frequency: float, size: float, joints: int = 2, noise: float = 1e-5) -> Any:
    """Positions of joints at rest, the first of which has a cycle, (n, joints)."""
    position = np.random.default_rng(7).normal(0.0, noise, (len(time), joints))
    position[:, 0] += 0.5 * size * np.sin(2.0 * np.pi * frequency * time)
    return position


def section(analysis: Analysis, key: str) -> tuple[str, ...]:
    return tuple(next(one for one in analysis.sections if one.key == key).sentences)


@pytest.mark.parametrize(
    ("commands", "origin"), [(("left", "right"), "it was not commanded"), (("left",), "its command is not known")]
)
def test_of_two_robots_neither_has_the_command_of_the_other(commands: str, origin: str, tmp_path: Path) -> None:
    time, names = np.arange(0.0, 10.0, 0.01), ["joint1", "joint2"]
    left, right, rest = cycling(time, 2.0, 0.1), cycling(time, 2.0, 0.02), np.zeros((len(time), 2))
    sent = joints("/left/joint_states", time, names, position=left)
    sent += joints("/right/joint_states", time, names, position=right)
    for side, values in (("left", left), ("right", rest)):
        if side in commands:
            sent += joints(f"/{side}/joint_command", time, names, position=values)
    topics = [f"/{side}/joint_command" for side in commands]
    two, one = section(quiet(by_rosbags(tmp_path / "bag", sent), *topics), "stability")
    assert one.endswith("at the commanded frequency.")
    assert two.startswith("/right")
    assert origin in two


@pytest.mark.parametrize("jump", [100.0, -5.0, -0.6, -0.05])
def test_a_clock_that_is_set_makes_no_gap(jump: float, tmp_path: Path) -> None:
    time = np.arange(0.0, 20.0, 0.01)
    sent = joints("/joint_states", time, ["a", "b"], position=cycling(time, 2.2, 0.02))
    moved = [one._replace(stamp=one.stamp + jump * (one.stamp > 10.0)) for one in sent]
    found = quiet(by_rosbags(tmp_path / "bag", moved))
    told = " ".join(sentence for one in found.sections for sentence in one.sentences)
    assert "a repeats at 2.2 Hz, 0.02 rad peak to peak" in told
    (end,) = (finding for one in found.sections for finding in one.findings if finding.name == "a: end")
    assert end.measured == pytest.approx(20.0, abs=0.05)
    assert "reception times are used" in told
    assert "messages missing" not in told


OTHER_CLOCKS: dict[str, Callable[[float], float]] = {
    "behind": lambda t: t - 40.0,
    "since the start of the computer": lambda t: t - 1.7e9 + 5123.0,
    "never set": lambda t: -1.7e9,
    "simulated, slower": lambda t: 0.5 * t - 1.7e9,
}


@pytest.mark.slow
@pytest.mark.parametrize("clock", list(OTHER_CLOCKS))
@pytest.mark.parametrize("whose", ["state", "command"])
def test_a_command_by_another_clock_is_that_of_the_motion(clock: str, whose: str, tmp_path: Path) -> None:
    """Without the clocks told apart, a commanded motion is a limit cycle that nobody commanded."""
    time = np.arange(0.0, 20.0, 0.01)
    topics = {"state": "/joint_states", "command": "/joint_command"}
    sent = [
        one._replace(stamp=OTHER_CLOCKS[clock](one.stamp)) if name == whose else one
        for name, late in (("state", 0.05), ("command", 0.0))
        for one in joints(topics[name], time, ["a", "b"], position=cycling(time - late, 0.8, 0.3))
    ]
    found = quiet(by_rosbags(tmp_path / "bag", sent), "/joint_command")
    (one,) = (line for line in section(found, "stability") if line.startswith("a: "))
    assert one.endswith("at the commanded frequency.")
    told = [line for line in section(found, "happened") if "clock" in line]
    assert len(told) == 1
    assert (topics[whose] if clock == "never set" else "/joint_") in told[0]


@pytest.mark.parametrize("frames", [("tool", "tool"), ("base", "tool"), ("", "tool")])
def test_a_frame_that_changes_with_the_force_neither_hides_its_steps_nor_makes_gaps(
    frames: tuple[str, str], tmp_path: Path
) -> None:
    time = np.arange(0.0, 12.0, 0.004)
    force = np.zeros((len(time), 3))
    force[:, 2] = np.where(time % 4.0 >= 2.0, 10.0, 0.0)
    sent = [
        one._replace(frame=frames[bool(np.any(one.fields["force"]))])
        for topic in ("/force_command", "/ft/wrench")
        for one in wrenches(topic, time, force)
    ]
    found = quiet(by_rosbags(tmp_path / "bag", sent), "/force_command")
    assert len(section(found, "force")) == 5
    assert section(found, "verdict")[2].startswith("Shows: 5 force steps; ")
    assert section(found, "timing") == ("No message is missing.",)


def following(frame_at: float, measured_at: float, cycle: float = 0.0) -> list[Sent]:
    """A command of 10 N from 4 s and 5 N from 12 s on, and the force that follows it, with a cycle from 12 s on.

    Both are in `base` until they go over to `tool`, whose z is flipped.
    """
    time, tau = np.arange(0.0, 20.0, 0.005), 0.2
    asked = np.where(time < 4.0, 0.0, np.where(time < 12.0, 10.0, 5.0))
    force = np.zeros((len(time), 3))
    for i in range(1, len(time)):
        force[i, 2] = force[i - 1, 2] + (asked[i - 1] - force[i - 1, 2]) * (1.0 - math.exp(-0.005 / tau))
    force[:, 2] += cycle * np.sin(4.0 * np.pi * time) * (time >= 12.0)
    asked = np.column_stack([0.0 * asked, 0.0 * asked, asked])
    return [
        one._replace(frame="tool", fields={"force": -one.fields["force"]}) if one.stamp >= goes_over else one
        for topic, values, goes_over in (("/ft/command", asked, frame_at), ("/ft/wrench", force, measured_at))
        for one in wrenches(topic, time, values, "base")
    ]


GOES_OVER = (
    "/ft/command changes to the frame tool at 12.0 s; that is not evaluated as a step, because what was commanded "
    "before is in another frame."
)
NOT_COMPARED = "/ft/wrench (tool), in the frame tool, is not compared with the command /ft/command, in the frame base."


@pytest.mark.slow
@pytest.mark.parametrize(
    ("frame_at", "measured_at", "doubt"), [(12.0, 99.0, GOES_OVER), (99.0, 9.0, NOT_COMPARED), (12.0, 12.0, GOES_OVER)]
)
def test_a_step_ends_where_command_or_force_goes_over_to_another_frame(
    frame_at: float, measured_at: float, doubt: str, tmp_path: Path
) -> None:
    analysis, numbers = found(
        (by_rosbags(tmp_path / "bag", following(frame_at, measured_at)), TopicMap(commands=("/ft/command",)))
    )
    label = "/ft/wrench" if measured_at > 20.0 else "/ft/wrench (base)"
    name = f"{label}, 10 N at 4.0 s"
    assert len(section(analysis, "force")) == 2
    assert section(analysis, "force")[1] == doubt
    assert section(analysis, "verdict")[2].startswith("Shows: 1 force step; ")
    assert section(analysis, "verdict")[1] == f"Problems: {doubt}"
    assert numbers[f"{name}: rise time 10-90 %"] == pytest.approx(math.log(9.0) * 0.2, rel=0.01)
    assert numbers[f"{name}: force in the steady state"] == pytest.approx(10.0, abs=1e-3)
    assert numbers[f"{name}: overshoot"] == pytest.approx(0.0, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_a_stamp_in_another_unit_is_refused_until_the_unit_is_given(unit: str, factor: float, tmp_path: Path) -> None:
    """Taken as seconds, an inertia of 0.5 kg m2 became one of 5e5."""
    time = 7.0 + times(12.0)
    position = at_rest(time, ["x", "y"], 33) + np.column_stack([sine(time, 3.1, 0.02), np.zeros(len(time))])
    sent = joints("/state", time, ["x", "y"], position=position)
    fields = ["name=state.name", "position=state.position", "stamp=time"]
    bag = by_json(tmp_path / "bag", [one._replace(stamp=round(factor * one.stamp)) for one in sent])
    with pytest.raises(ValueError, match=f"--unit stamp={unit}"):
        found((bag, topic_map(["/state"], [], [], fields, [])))
    _, numbers = found((bag, topic_map(["/state"], [], [], fields, [f"stamp={unit}"])))
    assert numbers["x: frequency"] == pytest.approx(3.1, rel=CLOSE)
    assert numbers["/state: period"] == pytest.approx(4.0, rel=1e-3)


@pytest.fixture
def small(tmp_path: Path) -> Path:
    time = times(4.0, 50.0)
    sent = joints("/ur/joint_states", time, UR, position=at_rest(time, UR, 34))
    sent += joints("/ur/motor_states", time, UR, position=at_rest(time, UR, 35))
    return by_rosbags(tmp_path / "small", sent + wrenches("/ft/wrench", time, at_rest(time, ["x", "y", "z"], 36)))


@pytest.mark.slow
def test_a_topic_that_is_named_as_one_of_ours_makes_no_recording_of_ours(small: Path) -> None:
    analysis, numbers = found((small, TopicMap()))
    assert analysis.sections[0].sentences[0].startswith("Another robot's recording")
    assert {"/ur/joint_states: period", "/ur/motor_states: period", "/ft/wrench: period"} <= numbers.keys()
    assert "/ur/motor_states elbow_joint: at rest" in numbers
    assert page(analysis).count('<figure class="chart"') >= 3


def test_only_what_is_named_is_analysed(small: Path) -> None:
    given = topic_map(["/ur/joint_states"], ["elbow_joint"], [], [], [])
    analysis, numbers = found((small, given))
    assert "elbow_joint over time." in page(analysis)
    assert {name.partition(":")[0] for name in numbers} == {"elbow_joint", "/ur/joint_states"}
    with pytest.raises(ValueError, match=r"no topic /nothing; its topics: /ft/wrench, /ur/joint_states"):
        found((small, TopicMap(topics=("/nothing",))))
    with pytest.raises(ValueError, match=r"no joint zzz; its joints: elbow_joint, shoulder_lift_joint"):
        found((small, TopicMap(joints=("elbow_joint", "zzz"))))
    for topic in ("/ur/joint_states", "/ft/wrench"):
        with pytest.raises(ValueError, match=rf"{topic} has no field 'time'"):
            found((small, topic_map([topic], [], [], ["stamp=time"], [])))
        with pytest.raises(ValueError, match=rf"{topic} has stamps of ROS"):
            found((small, topic_map([topic], [], [], [], ["stamp=us"])))


@pytest.mark.parametrize(("options", "message"), [
    (([], [], [], ["speed=v"], []), "--map is 'speed=v'"),
    (([], [], [], [], ["effort=lbf"]), "'lbf' is no unit of effort; give --unit effort= and a factor or one of N, mN"),
    (([], [], [], [], ["name=s"]), "--unit is 'name=s'"),
    (([], [], [], [], ["effort=deg"]), "'deg' is no unit of effort; give"),
    (([], [], [], ["effort=a", "effort=b"], []), "--map effort is given twice, as 'a' and as 'b'"),
])  # fmt: skip
def test_an_option_that_says_nothing_is_refused(options: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        topic_map(*options)


def test_without_rosbags_a_sentence_says_how_to_read_the_bag(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    time = times(1.0, 50.0)
    bag = by_rosbags(tmp_path / "bag", joints("/joint_states", time, ["a"], position=at_rest(time, ["a"], 37)), "ros1")

    def nowhere(name: str) -> Any:
        raise ImportError(name)

    monkeypatch.setattr(rosbags_file.importlib, "import_module", nowhere)
    with pytest.raises(BagError, match=r"rosbags reads it: pip install 'wam_stack\[rosbags\]'$"):
        found((bag, TopicMap()))


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, 1e-3])
@pytest.mark.parametrize("dry", [DRY, 0.0])
@pytest.mark.parametrize("waves", [[(0.3, 2.0)], [(0.5, 0.31), (0.3, 0.53), (0.15, 1.07)]])
def test_inertia_is_given_only_where_the_motion_tells_it_from_a_weight(
    waves: list[tuple[float, float]], dry: float, noise: float, tmp_path: Path
) -> None:
    """At 2 Hz a weight of 3 N m changes the inertia by a tenth; a joint without dry friction was refused."""
    time, drawn = times(30.0), chance(71)
    parts = [(a, 2.0 * np.pi * f) for a, f in waves]
    q = sum(a * np.sin(w * time) for a, w in parts)
    v = sum(a * w * np.cos(w * time) for a, w in parts)
    effort = dry * np.sign(v) + VISCOUS * v - sum(0.2 * a * w * w * np.sin(w * time) for a, w in parts)
    effort += 3.0 * np.sin(q) + 0.02 * drawn.normal(size=len(time))
    velocity = v + noise * drawn.normal(size=len(time))
    states = {"position": q, "velocity": velocity, "effort": effort}
    sent = joints("/joint_states", time, ["j"], **{name: value[:, np.newaxis] for name, value in states.items()})
    analysis, numbers = found((by_mcap_ros2(tmp_path / "weight", sent), TopicMap()))
    planted = {"j: viscous friction": VISCOUS, "j: inertia": 0.2, "j: dry friction": dry}
    identifiable = {
        name: value for name, value in planted.items() if value > 0.0 and (len(waves) > 1 or "inertia" not in name)
    }
    assert {name: numbers[name] for name in planted if name in numbers} == pytest.approx(identifiable, rel=CLOSE)
    (section,) = (one for one in analysis.sections if one.key == "friction")
    told = section.sentences[1]
    assert ("cannot be separated from weight" in " ".join(section.sentences)) is (len(waves) == 1)
    assert ("not identifiable: dry friction" in told) is (dry == 0.0)
    assert " % of the effort (rms)" in told


def recorded_late(effort: Any, how: float) -> Any:
    """An effort through a filter of the first order at so many Hz, or late by a whole number of samples."""
    if isinstance(how, int):
        return np.concatenate([np.full(how, effort[0]), effort[: len(effort) - how]])
    kept, late = math.exp(-2.0 * math.pi * how / RATE), effort.copy()
    for i in range(1, len(late)):
        late[i] = kept * late[i - 1] + (1.0 - kept) * 0.5 * (effort[i] + effort[i - 1])
    return late


@pytest.mark.slow
@pytest.mark.parametrize(("how", "drag", "weight", "count", "rise"), [
    (0, 0.4, WEIGHT, 0, 0), *((how, 0.0, WEIGHT, 0, 0) for how in (10.0, 20.0)),
    (0, 0.0, 0.0, 2.0 * np.pi / 2**12, 0), (0, 0.0, 0.0, 0, 0.9), (0, 0.0, 0.0, 0, -0.6),
    *((how, 0.0, w, 0, 0) for how in (2, 4, 6) for w in (0, WEIGHT)),
])  # fmt: skip
def test_an_effort_that_lags_or_holds_a_drag_gives_the_friction_all_the_same(
    how: float, drag: float, weight: float, count: float, rise: float, tmp_path: Path
) -> None:
    time = times(40.0)
    q, v, a = swung(time, 81, WAVES if weight else ((0.8, 0.3), (0.2, 1.2)))
    effort = loaded(q, v, a, weight, 82) + drag * v * np.abs(v) + rise * np.sign(v) * np.exp(-((v / 0.2) ** 2))
    motion = {"position": count * np.rint(q / count)} if count else {"position": q, "velocity": v}
    states = motion | {"effort": recorded_late(effort, how)}
    sent = joints("/joint_states", time, ["j"], **{name: value[:, np.newaxis] for name, value in states.items()})
    analysis, numbers = found((by_mcap_ros2(tmp_path / "bag", sent), TopicMap()))
    planted = {"j: dry friction": DRY, "j: viscous friction": VISCOUS, "j: inertia": INERTIA}
    assert {name: numbers.get(name) for name in planted} == pytest.approx(planted, rel=CLOSE)
    assert how == 0 or "behind the motion" in section(analysis, "friction")[1]


@pytest.mark.slow
def test_friction_of_a_slow_motion_by_hand_is_within_its_errors(tmp_path: Path) -> None:
    time = times(40.0)
    drawn, speed = chance(84), np.zeros(10000)
    for i in range(1, len(speed)):
        speed[i] = 0.992 * speed[i - 1] + 0.008 * drawn.normal()
    speed = 0.06 * np.convolve(speed, np.ones(100) / 100, "same") / np.std(speed)
    q, a = np.cumsum(speed) / RATE, np.gradient(speed, time)
    effort = loaded(q, speed, a, 0.0, 85) + 0.05 * drawn.normal(size=len(time))
    velocity = speed + 2e-3 * drawn.normal(size=len(time))
    states = {"position": q, "velocity": velocity, "effort": effort}
    sent = joints("/joint_states", time, ["j"], **{name: value[:, np.newaxis] for name, value in states.items()})
    analysis, _ = found((by_mcap_ros2(tmp_path / "bag", sent), TopicMap()))
    (friction,) = (one for one in analysis.sections if one.key == "friction")
    for one in friction.findings:
        truth = {"dry friction": DRY, "viscous friction": VISCOUS, "inertia": INERTIA}[one.quantity]
        assert abs(one.measured - truth) < max(3.0 * one.error, CLOSE * truth)


def cycle_of(analysis: Analysis, frequency: float) -> Finding:
    """The size of the cycle of a frequency."""
    (stability,) = (one for one in analysis.sections if one.key == "stability")
    rows = [one.quantity for one in stability.findings]
    at = [i for i, one in enumerate(stability.findings) if one.quantity == "frequency"]
    (row,) = (i for i in at if stability.findings[i].measured == pytest.approx(frequency, rel=CLOSE))
    assert rows[row - 1] == "cycle, peak to peak"
    return stability.findings[row - 1]


def of_positions(path: Path, time: Any, position: Any) -> Analysis:
    return quiet(by_mcap_ros2(path, joints("/joint_states", time, ["j"], position=position[:, np.newaxis])))


@pytest.mark.parametrize("shape", ["triangle", "square"])
@pytest.mark.parametrize("jitter", [0.0, 0.4])
def test_corners_of_a_cycle_are_not_cut_off(shape: str, jitter: float, tmp_path: Path) -> None:
    """Triangles were 3 to 5 % low where the stamps jitter, squares of few samples up to 3 % high where not."""
    time = times(20.0, 200.0)
    time = np.sort(time + jitter / 200.0 * chance(91).uniform(-1.0, 1.0, len(time)))
    phase = 2.0 * np.pi * 7.87 * time + 1.3
    wave = 2.0 / np.pi * np.arcsin(np.sin(phase)) if shape == "triangle" else np.sign(np.sin(phase))
    found = cycle_of(of_positions(tmp_path / "bag", time, 0.005 * wave + at_rest(time, ["j"], 92)[:, 0]), 7.87)
    assert found.measured == pytest.approx(0.01, rel=CLOSE)


@pytest.mark.slow
@pytest.mark.parametrize("tau", [3.0, 6.0, 10.0])
def test_a_slow_ring_down_is_no_limit_cycle_in_any_of_its_parts(tau: float, tmp_path: Path) -> None:
    time = times(20.0)
    ring = np.where(time > 1.5, np.exp(-(time - 1.5) / tau) * np.sin(2.0 * np.pi * 5.3 * (time - 1.5)), 0.0)
    sentences = section(of_positions(tmp_path / "bag", time, 0.02 * ring + at_rest(time, ["j"], 94)[:, 0]), "stability")
    assert sentences == ("Nothing in this recording was found to repeat five times without a gap.",)


@pytest.mark.slow
@pytest.mark.parametrize("way", ["triangle", "waves", "velocity"])
def test_a_cycle_beside_a_commanded_motion_of_any_shape_is_found(way: str, tmp_path: Path) -> None:
    time = times(30.0)

    def path(at: Any) -> Any:
        return 0.8 / np.pi * np.arcsin(np.sin(2.0 * np.pi * 0.47 * at)) if way == "triangle" else 0.5 * swung(at, 95)[0]

    said = {"velocity": 0.5 * swung(time, 95)[1]} if way == "velocity" else {"position": path(time)}
    sent = joints("/joint_command", time[::2], ["j"], **{q: one[::2, np.newaxis] for q, one in said.items()})
    position = path(time - 0.03) + at_rest(time, ["j"], 96)[:, 0]
    for size in (0.006, 0.0):
        states = joints("/joint_states", time, ["j"], position=(position + sine(time, 8.7, size))[:, np.newaxis])
        analysis = quiet(by_mcap_ros2(tmp_path / f"bag{size:g}", sent + states), "/joint_command")
        (stability,) = (one for one in analysis.sections if one.key == "stability")
        assert len(stability.shows) == (size > 0.0)
        if size:
            assert cycle_of(analysis, 8.7).measured == pytest.approx(size, rel=CLOSE)
