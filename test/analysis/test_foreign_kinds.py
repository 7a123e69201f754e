"""Kinds of faults in other people's recordings, each at several rates and in several formats."""

import csv
import math
import re
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from foreign_bags import CONTROLLER, INTERFACES, JOINTS, Sent, by_json, by_mcap_ros2, by_rosbags, joints, wrenches

from wam_analysis.findings.analysis import analyse
from wam_analysis.foreign.topic_map import topic_map
from wam_bag.bag import BagError
from wam_description.topics import TRAJECTORY

NOTHING = topic_map([], [], [], [], [])
DEGREES = topic_map([], [], [], [], ["position=deg", "velocity=deg/s"])
MAPPED = topic_map(["/state"], [], [], ["name=state.name", "position=state.position", "stamp=time"], [])
DRY, VISCOUS = 1.5, 0.8
RISE = 6.0 - 6.0 * np.exp(-np.maximum(np.arange(-2.0, 18.0, 0.004), 0.0) / 0.1)

sqlite, ros1 = (partial(by_rosbags, storage=one) for one in ("sqlite3", "ros1"))


def json_directory(path: Path, sent: list[Sent]) -> Path:
    path.mkdir()
    by_json(path / "part", sent)
    return path


class Case(NamedTuple):
    """A recording: what is in it, how it is written, what the reader gives, and what must come out."""

    name: str
    write: Callable[[Path, list[Sent]], Path]
    sent: list[Sent]
    numbers: dict[str, float]
    wrong: str = ""
    given: Any = NOTHING
    absent: tuple[str, ...] = ()


def motion(rate: float, frequency: float, size: float, seconds: float = 30.0) -> tuple[Any, Any, Any, Any]:
    """Time, position, velocity and effort of a sine with friction."""
    time, w = np.arange(0.0, seconds, 1.0 / rate), 2.0 * math.pi * frequency
    velocity = size * w * np.cos(w * time)
    noise = 0.01 * np.random.default_rng(3).normal(size=len(time))
    return time, size * np.sin(w * time), velocity, DRY * np.sign(velocity) + VISCOUS * velocity + noise


@cache
def one(topic: str, rate: float, frequency: float, size: float, change: Any = None, seconds: float = 30) -> list[Sent]:
    """A joint `a` in a sine, its position changed."""
    time, q, v, effort = motion(rate, frequency, size, seconds)
    q = q if change is None else change(q)
    return joints(topic, time, ["a"], position=q[:, None], velocity=v[:, None], effort=effort[:, None])


FRICTION = {"a: dry friction": DRY, "a: viscous friction": VISCOUS}


def sine(frequency: float, size: float) -> dict[str, float]:
    return {"a: frequency": frequency, f"a, {frequency:.3g} Hz: amplitude": size}


def wrapped(low: float, turn: float = 2.0 * math.pi) -> Any:
    return lambda q: (q - low) % turn + low


def wraps() -> list[Case]:
    degrees = one("/joint_states", 50.0, 0.25, 700.0, wrapped(-180.0, 360.0))
    alone = [s._replace(fields={k: v for k, v in s.fields.items() if k in ("name", "position")})
             for s in one("/joint_states", 60.0, 0.3, 5.0, wrapped(0.0))]  # fmt: skip
    said, largest = "it is unwrapped", math.radians(700.0)
    return [
        Case("from zero", sqlite, one("/joint_states", 100.0, 0.25, 4.0, wrapped(0.0)), sine(0.25, 4.0) | FRICTION,
             said),
        Case("several turns", by_mcap_ros2, one("/arm/joint_states", 250.0, 0.2, 20.0, wrapped(-math.pi)),
             sine(0.2, 20.0) | FRICTION, said),
        Case("in degrees", ros1, degrees, sine(0.25, largest), said, DEGREES),
        Case("position alone", by_rosbags, alone, sine(0.3, 5.0), said),
        Case("rests at pi", sqlite, joints("/s", np.arange(3000) / 100.0, ["a"], position=wrapped(-math.pi)(
            math.pi + 2e-4 * np.random.default_rng(8).choice([0, -1, 1], (3000, 1), p=[0.86, 0.09, 0.05]))), {}, said,
            NOTHING, ("a: never moved.",)),
        Case("an encoder behind a gear", sqlite, one("/joint_states", 100.0, 0.3, 2.5, wrapped(-0.6, 1.2)),
             sine(0.3, 2.5) | FRICTION, said),
        Case("a counter of 16 bits", by_mcap_ros2, one("/joint_states", 100.0, 0.3, 5e5, wrapped(-32768.0, 65536.0)),
             sine(0.3, 5e5), said),
        *(Case(f"a wheel, {size:g}", sqlite, one("/joint_states", 10.0, 0.3, size, wrapped(-math.pi)), sine(0.3, size),
               said) for size in (10.0, 30.0)),
    ]  # fmt: skip


def without(sent: list[Sent], lacks: Callable[[int], bool], *fields: str) -> list[Sent]:
    return [s._replace(fields={k: v for k, v in s.fields.items() if k not in fields}) if lacks(i) else s
            for i, s in enumerate(sent)]  # fmt: skip


def sparse() -> list[Case]:
    made = [
        ("every other", by_rosbags, 100.0, lambda i: i % 2, ("velocity", "effort"), 1500),
        ("three of four", sqlite, 200.0, lambda i: i % 4, ("velocity", "effort"), 1500),
        ("effort alone", ros1, 125.0, lambda i: i % 3 == 1, ("effort",), 2500),
        ("left out in JSON", partial(by_json, kind=JOINTS), 100.0, lambda i: i % 3 != 1, ("velocity", "effort"), 1000),
        ("velocity alone", by_mcap_ros2, 80.0, lambda i: i % 5 == 0, ("velocity",), 1920),
    ]
    return [
        *(Case(name, write, without(one("/joint_states", rate, 0.7, 0.5), lacks, *fields),
               sine(0.7, 0.5) | FRICTION | {"/joint_states: period": 1e3 / rate, "/joint_states: missed periods": 0.0},
               f"in only {kept} of {30.0 * rate:g} messages")
          for name, write, rate, lacks, fields, kept in made),
        *(Case(f"{quantity} of 0", ros1, [s._replace(fields=s.fields | {quantity: [0.0]} if i % 4 in zero else s.fields)
               for i, s in enumerate(one("/js", 100.0, 0.7, 0.5))], sine(0.7, 0.5) | FRICTION,
               f"the {quantity} jumps to 0 in {750 * len(zero)} of 3000 messages")
          for quantity, zero in (("position", (0,)), ("velocity", (1,)), ("effort", (1,)), ("effort", (0, 2)))),
        Case("in turns", sqlite, without(without(one("/js", 100.0, 0.7, 0.5), lambda i: i % 2, "effort"),
                                         lambda i: not i % 2, "position", "velocity"),
             sine(0.7, 0.5) | FRICTION, "1500 of 3000"),
        Case("an effort of 0", ros1, [s._replace(fields=s.fields | {"effort": [0.0] * (i % 2)}) for i, s in enumerate(
            one("/js", 100.0, 0.7, 0.5))], {}, "1500 of 3000", NOTHING, ("touches the arm. To find",)),
    ]  # fmt: skip


def stamped(sent: list[Sent], change: Callable[[float], float]) -> list[Sent]:
    return [s._replace(stamp=change(s.stamp)) for s in sent]


def coarse() -> list[Case]:
    made = [
        ("seconds", by_rosbags, 100.0, math.floor),
        ("centiseconds", sqlite, 250.0, lambda t: round(100.0 * t) / 100.0),
        ("two of three", ros1, 150.0, lambda t: math.floor(50.0 * t) / 50.0),
        ("read in halves", sqlite, 100.0, lambda t: t - 0.9975 * (round(100.0 * t) % 400 == 250)),
        ("never set", by_mcap_ros2, 50.0, lambda t: -1.7e9),
        ("the first from before", sqlite, 100.0, lambda t: t - 3600.0 * (t == 0.0) + 1e-6 * math.sin(9.0 * t)),
        ("milliseconds", by_mcap_ros2, 400.0, lambda t: round(t, 3)),
        ("parts of a float", by_mcap_ros2, 125.0, lambda t: math.floor(2048.0 * t) / 2048.0),
        ("set forward", sqlite, 100.0, lambda t: t + 0.4 * (t > 11.0)),
    ]
    unset = [s._replace(stamp=-1.7e9) for s in one("/joint_states", 50.0, 0.7, 0.5)]
    stall = [s._replace(received=max(s.received, 12.25 + 7e-5 * i) if 12.0 < s.received < 12.3 else s.received)
             for i, s in enumerate(unset)]  # fmt: skip
    gap = [s for s in unset if not 15.01 < s.received < 17.39]
    sent = one("/joint_states", 100.0, 0.7, 0.5)
    packets = {of: [s._replace(stamp=at, received=at + 5e-4) for i, s in enumerate(sent) for at in [
        sent[min(i - i % of + of - 1, 2999)].stamp + 3e-4 * (i % of)]] for of in (2, 5)}  # fmt: skip
    simulated = np.ceil(np.arange(3000) * 2.5) * 0.004  # by steps of 4 ms
    moves = np.cumsum(np.clip(np.sin(0.8 * math.pi * simulated), 0.1, 0.4) - 0.1)[:, None] / 50.0
    changes = [s for i, s in enumerate(joints("/js", np.arange(3000) / 100.0, ["a"], position=moves))
               if not i or moves[i] != moves[i - 1]]  # fmt: skip
    return [
        *(Case(f"packets of {of}", sqlite, those, sine(0.7, 0.5) | FRICTION | {"/joint_states: period": 10.0},
               "placed evenly") for of, those in packets.items()),
        Case("steps of a simulation", sqlite, joints("/js", simulated, ["a"], position=0.5 * np.sin(
            1.4 * math.pi * simulated)[:, None]), sine(0.7, 0.5) | {"/js: period": 10.0}),
        Case("only what changes", ros1, changes, {"a: motions": 12.0}, "messages come only when a value changes"),
        *(Case(name, write, stamped(one("/joint_states", rate, 0.7, 0.5), change),
               sine(0.7, 0.5) | FRICTION | {"/joint_states: period": 1e3 / rate}, "reception times are used")
          for name, write, rate, change in made),
        *(Case(f"never set, {what}", write, those, FRICTION | {"/joint_states: missed periods": lost}, "reception")
          for what, write, those, lost in (("a stall", ros1, stall, 0.0), ("a gap", sqlite, gap, 119.0))),
    ]  # fmt: skip


def twice() -> list[Case]:
    sent = one("/joint_states", 100.0, 0.7, 0.5)
    again = [s._replace(received=s.received + 0.003) for s in sent]
    relayed = [s._replace(stamp=s.stamp + 0.003) for s in again]
    expected = sine(0.7, 0.5) | FRICTION | {"/joint_states: period": 10.0}
    # at 0.4 of the computer's time; it stops for 12 s, and its last message is repeated
    slow = [s._replace(stamp=s.stamp - 1.7e9, received=s.stamp / 0.4 + 12.0 * (s.stamp > 13.0)) for s in sent]
    slow += [slow[1300]._replace(received=slow[1300].received + 0.025 * k) for k in range(1, 480)]
    return [
        *(Case(f"receptions set by {by:g} s", ros1,
               [s._replace(received=s.received + by * (s.stamp > 11.0)) for s in sent],
               expected | {"/joint_states: delay of the receptions": 1.0}, f"by up to {abs(by):g} s")
          for by in (-2.0, -0.5, 5.0)),
        Case("a simulation that stopped", ros1, slow, expected, "the first message of each is used"),
        Case("all", by_rosbags, sent + again, expected, "the first message of each is used"),
        Case("relayed", by_mcap_ros2, sent + relayed, expected, "3000 of 6000 messages repeat the one before"),
        Case("fast", ros1, stamped(one("/js", 50.0, 0.7, 0.5, None, 120.0), lambda t: 1.01 * t), {}, "a clock is fast"),
        Case("faster", ros1, stamped(one("/js", 50.0, 0.7, 0.5, None, 10.0), lambda t: 1.08 * t), {}, "runs at 108 %"),
        Case("a part", sqlite, sent + again[: len(again) // 3], expected, "the first message of each is used"),
        Case("less of a part", sqlite, sent + without(again[:1000], bool, "effort"), expected, "the first message of"),
        Case("few of a good clock", ros1, [s._replace(stamp=s.stamp - 5.0) for s in sent] + [
            s._replace(topic="/x", fields={"name": ["x"], "position": [0.0]}) for s in sent[500:2000:500]], expected),
        Case("others", by_rosbags, [s._replace(stamp=sent[i - (i % 50 == 7)].stamp) for i, s in enumerate(sent)],
             expected, "60 of 3000 stamps repeat the one before"),
        Case("in bursts", by_rosbags, [s._replace(received=s.received - s.stamp % -0.07) for s in sent], expected),
        Case("a burst", ros1, [s._replace(received=max(s.received, 15.59 + 1e-6 * i) if i < 1560 else s.received)
                               if i > 1500 else s for i, s in enumerate(sent)], expected),
    ]  # fmt: skip


def by_chance() -> list[Case]:
    """Delays that change the order of messages, and values that are no numbers, which are no lost messages."""
    drawn, sent, fast = np.random.default_rng(5), *(one("/joint_states", rate, 0.7, 0.5) for rate in (100.0, 1e3))
    late, mixed = ([s._replace(received=s.received + most * by) for s, by in zip(sent, drawn.random(3000), strict=True)]
                   for most in (0.03, 0.7))  # fmt: skip
    none = {"position": [math.nan, 0.2], "velocity": [math.nan, 0.0], "effort": [math.nan, 0.0], "name": ["a", "b"]}
    both = [{q: [*v, *none[q][1:]] for q, v in s.fields.items()} for s in sent]
    lacking = drawn.random(len(sent)) < 0.1
    some = [s._replace(fields=none if lacks else has) for s, has, lacks in zip(sent, both, lacking, strict=True)]
    expected = sine(0.7, 0.5) | FRICTION | {"/joint_states: period": 10.0, "/joint_states: missed periods": 0.0}
    played = [s._replace(stamp=s.stamp % 15.0, received=s.received + 0.008 * (i % 50 == 7)) for i, s in enumerate(sent)]
    gap, jitter = {"/joint_states: longest gap between stamps": 0.01}, {"/joint_states: reception jitter": 12.2}
    after = [s._replace(stamp=32.0 + s.stamp / 300.0, received=32.001 + s.stamp / 300.0) for s in sent[:30]]
    told = f"in only {len(sent) - np.count_nonzero(lacking)} of {len(sent)}"
    return [
        Case("late", by_rosbags, late, expected),
        Case("in no order", by_rosbags, mixed, expected),
        Case("late, some lost", sqlite, [s for s in late if drawn.random() > 0.1], jitter, "messages missing"),
        Case("at any time", ros1, [s for s in fast if drawn.random() < 0.1], {}, "irregular stamps"),
        Case("played in a loop, some late", sqlite, played, expected | gap, "reception times are used"),
        Case("all at once after a pause", sqlite, sent + after, FRICTION, "messages missing"),
        Case("no numbers", sqlite, some, expected, told),
        Case("no velocity, no numbers", ros1, without(some, lambda _: True, "velocity"), expected, told),
    ]


def names() -> list[Case]:
    time = np.arange(0.0, 20.0, 0.01)
    both = np.column_stack([0.3 * np.sin(2 * np.pi * 0.7 * time), 0.1 * np.sin(2 * np.pi * 1.9 * time)])

    def called(*own: str) -> list[Sent]:
        return joints("/joint_states", time, own, position=both)

    def numbers(a: str, b: str) -> dict[str, float]:
        return {f"{a}: frequency": 0.7, f"{b}: frequency": 1.9,
                f"{a}, 0.7 Hz: amplitude": 0.3, f"{b}, 1.9 Hz: amplitude": 0.1}  # fmt: skip

    short, long = ([s._replace(fields=s.fields | {"effort": n * [1.0]}) for s in called("x", "y")] for n in (1, 3))
    given = topic_map([], ["p", "q"], [], [], [])
    return [
        Case("none", by_mcap_ros2, called(), numbers("joint1", "joint2"), "without a name"),
        Case("none of a command", sqlite, called("x", "y") + [s._replace(topic="/cmd") for s in called()], {},
             "without a name", topic_map([], [], ["/cmd"], [], []), ("Nothing measured is named joint1, joint2;",)),
        Case("none, ROS 1, given", ros1, called(), numbers("p", "q"), "", given),
        Case("empty", by_rosbags, called("", ""), numbers("joint1", "joint2"), "without a name"),
        Case("one of two", sqlite, called("x"), numbers("x", "joint2"), "without a name"),
        Case("twice", by_rosbags, called("x", "x"), numbers("x", "x (2)"), "a joint's name twice"),
        Case("short effort", by_rosbags, short, numbers("x", "y"), "effort of another length than the names"),
        Case("long effort", by_rosbags, long, numbers("x", "y"), "effort of another length than the names"),
        Case("effort of one", ros1, one("/js", 100.0, 0.7, 0.5, None, 20.0) + called("x", "y"),
             FRICTION | numbers("x", "y"), "", NOTHING,
             ("x: friction is not identified: no message has all of position, effort.",)),
        Case("nothing now and then", ros1, without(called("x", "y"), lambda i: i % 9 == 4, "position"),
             numbers("x", "y"), "messages with no value", NOTHING, ("1778 messages; joints",)),
    ]  # fmt: skip


def of_ros2_control() -> list[Case]:
    """States of old and new controllers, and of interfaces, those of one joint without effort."""
    states = one("/state", 100.0, 0.7, 0.5)

    def controller(commanded: str, measured: str) -> list[Sent]:
        points = [{"positions": s.fields["position"], "velocities": s.fields["velocity"], "effort": s.fields["effort"]}
                  for s in states]  # fmt: skip
        parts = [{measured: point, commanded: {"positions": point["positions"]}} for point in points]
        return [s._replace(kind=CONTROLLER, fields={"joint_names": ["a"], **part})
                for s, part in zip(states, parts, strict=True)]  # fmt: skip

    interfaces = [
        s._replace(kind=INTERFACES, fields={"joint_names": ["b", "a"], "interface_values": [
            {"interface_names": ["position"], "values": [0.1]},
            {"interface_names": ["effort", "position"], "values": [*s.fields["effort"], *s.fields["position"]]},
        ]}) for s in states
    ]  # fmt: skip
    expected = sine(0.7, 0.5) | FRICTION
    followed = ("at the commanded frequency.", ", 1 joint.", "'messages': '3000 of 3000 ")
    beside = interfaces + one("/joint_states", 50.0, 0.7, 0.5)
    return [
        Case("new controller", by_rosbags, controller("reference", "feedback"), expected, "", NOTHING, followed),
        Case("old controller", sqlite, controller("desired", "actual"), expected, "", NOTHING, followed),
        Case("interfaces", by_rosbags, interfaces, expected, "", NOTHING, ("b: never moved.",)),
        Case("beside joint states", by_rosbags, beside, expected | {"/joint_states: period": 20.0}),
        Case("both", ros1, one("/joint_states", 50.0, 0.7, 0.5) + controller("desired", "actual"),
             {"/joint_states a: cycle, peak to peak": 1.0, "/joint_states a: end": 30.0}, "", NOTHING, followed[:2]),
        Case("2", sqlite, one("/l/js", 50.0, 0.7, 0.5) + one("/r/js", 50.0, 0.7, 0.5), {}, "", NOTHING, ("2 joints",)),
    ]  # fmt: skip


def called_as_commands() -> list[Case]:
    expected = sine(0.7, 0.5) | FRICTION
    force = np.zeros((3000, 3))
    force[:, 2] = 3.0 * np.sin(2.0 * np.pi * 2.1 * np.arange(3000) / 100.0)
    cycle = {"/cmd/wrench force.z: frequency": 2.1, "/cmd/wrench force.z: cycle, peak to peak": 6.0}
    named = topic_map(["/goal/ref"], [], [], [], [])
    parts = [*MAPPED.fields.items(), ("command.position", "state.effort")]
    sent = topic_map(["/state"], [], [], [f"{quantity}={path}" for quantity, path in parts], [])
    return [
        Case("in the same message", by_json, one("/state", 100.0, 0.7, 0.5), {},
             "a position: a gain and a delay do not explain", sent, ("Taken as commands: /state command.",)),
        Case("target", by_rosbags, one("/target/joint_states", 100.0, 0.7, 0.5), expected),
        Case("desired", sqlite, one("/arm_desired/desired", 200.0, 0.7, 0.5), expected),
        Case("goal", ros1, one("/goal/ref", 125.0, 0.7, 0.5), expected, "", named),
        Case("wrench", by_mcap_ros2, wrenches("/cmd/wrench", np.arange(3000) / 100.0, force), cycle),
    ]  # fmt: skip


def follows() -> list[Case]:
    """Joints and a force that follow a path, late, by a part of it, or through a play; and steps."""
    to, time = topic_map([], [], ["/cmd"], [], []), np.arange(0.0, 21.0, 0.004)

    def path(at: Any) -> Any:
        return 0.5 * np.sin(1.3 * at) + 0.2 * np.sin(4.1 * at)

    def joint(commanded: Any, measured: Any, every: int = 10) -> list[Sent]:
        command = joints("/cmd", time[::every], ["a"], position=commanded[::every, None])
        return joints("/js", time, ["a"], position=np.asarray(measured)[:, None]) + command

    played = list(path(time[:1]))
    for at in path(time[1:] - 0.02):
        played.append(min(max(played[-1], at - 0.01), at + 0.01))
    steps = np.repeat([0.1, 0.5, -0.3], len(time) // 3)
    risen = steps + np.repeat([0.0, -0.4, 0.8], len(time) // 3) * np.exp(-np.maximum(time % 7.0 - 0.06, 0.0) / 0.2)
    quick = steps + np.repeat([0.0, -0.4, 0.8], len(time) // 3) * np.exp(-(time % 7.0) / 0.07)
    grows = steps + 0.005 * np.exp(time % 7.0 / 2.0) * np.sin(25.0 * (time % 7.0))
    force = np.outer(path(time), (0.0, 0.0, 3.0)) + 5.0
    noise, ramp = 0.01 * np.random.default_rng(4).normal(size=force.shape), np.clip(time / 10.0 - 0.2, 0.0, 1.0)

    def trajectory(shape: list[float], **more: Any) -> Case:
        points = [{"positions": [q], "velocities": [0.0], "time_from_start": {"sec": s}, **more}
                  for s, q in ((2, 1.0), (9, -0.5))]  # fmt: skip
        goal = Sent("/t", TRAJECTORY, 2.0, 2.0, "", {"joint_names": ["a"], "points": points})
        late = 0.22 + 0.75 * np.polynomial.Polynomial(shape)(np.clip(1.0 - (time - 4.1) / 3.5, -1.0, 1.0))
        expected = {"a position: delay": 0.1, "a position: gain": 1.0, "a position: largest steady error": 0.03}
        sent = [*joint(late, late)[: len(late)], goal]
        return Case(f"a trajectory {more}", by_rosbags, sent, expected, "", NOTHING, ("/t: 1 message;",))

    goals, way = np.arange(0.0, 21.0, 0.05), [0.0]  # streamed: each is replaced half way, and the next begins there
    for at in goals[1:]:
        way.append(0.5 * (way[-1] + path(at + 0.05)))
    streamed = [Sent("/t", TRAJECTORY, at, at, "", {"joint_names": ["a"], "points": [
        {"positions": [path(at + 0.1)], "time_from_start": {"nanosec": 100_000_000}}]}) for at in goals]  # fmt: skip
    streamed += joint(path(time), np.interp(time - 0.1, goals, way))[: len(time)]
    stops = np.cumsum(0.004 * np.sign(np.sin(4.0 * time)) * (time % 0.7 < 0.4))
    both = time + 4e-4 * np.random.default_rng(5).random(len(time))
    alike = [s for topic, late in (("/js", 0.04), ("/cmd", 0.0)) for s in joints(
        topic, both, ["a"], position=np.interp(time - late, time, path(time))[:, None])]  # fmt: skip
    coarse = time[::2]
    shaken = coarse + 3e-4 * np.random.default_rng(6).random(len(coarse))
    locked = [*joints("/js", coarse, ["a"], position=path(coarse - 0.016)[:, None]),
              *joints("/cmd", shaken, ["a"], position=path(coarse)[:, None])]  # fmt: skip
    return [
        Case("by whole periods", ros1, alike, {"a position: delay": 0.04, "a position: gain": 1.0}, "", to),
        Case("a stream", by_rosbags, streamed, {"a position: delay": 0.1, "a position: gain": 1.0}),
        Case("a stream by another clock", sqlite, [s._replace(stamp=s.stamp + 20.0 * (s.topic == "/t"))
             for s in streamed], {"a position: delay": 0.1, "a position: gain": 1.0}, "/t: stamps 20 s ahead"),
        Case("away", ros1, joint(path(time), path(np.maximum(time - 0.8, 0.0))), {"a position: delay": 0.8}, "", to),
        Case("before", ros1, joint(path(time), path(time + 0.3)), {}, "a gain and a delay do not explain", to),
        Case("by two periods", sqlite, locked, {"a position: delay": 0.01585, "a position: gain": 1.0}, "", to),
        *(Case(f"a clock {by:g} s off", sqlite, [s._replace(stamp=s.stamp + by * (s.topic == topic))
               for s in joint(path(time), path(time - 0.03))], {"a position: delay": 0.03 - min(by, 0.0)}, told, to)
          for topic, by, told in (("/cmd", 0.35, "/cmd: stamps 0.35 s ahead"), ("/js", 0.6, "/js: stamps 0.6 s ahead"),
                                  ("/cmd", 0.02, "/cmd: stamps 0.02 s ahead"),
                                  ("/cmd", -0.2, "0.2 s behind those of /js, as sent late"))),
        Case("late", by_rosbags, joint(path(time), 0.9 * path(time - 0.03)), {"a position: gain": 0.9,
             "a position: delay": 0.03}, "", to, ("Shows: a position: follows ",)),
        Case("play", ros1, joint(path(time), played, 2), {"a position: play": 0.02, "a position: delay": 0.02}, "", to),
        Case("steps", sqlite, joint(steps, risen - 0.02), {"a position: largest steady error": 0.02,
             "a position: median rise time 10-90 %": 0.2 * math.log(9.0)}, "", to),
        Case("grows", by_rosbags, joint(steps, grows), {}, "position, 0.5 rad at 7.0 s: it DIVERGES", to),
        Case("hunts", ros1, joint(steps, quick + 0.004 * np.sin(9.0 * np.maximum(time - 1.0, 0.0))),
             {"a: frequency": 4.5 / math.pi, "a: cycle, peak to peak": 0.008}, "", to),
        Case("pushed", ros1, joint(path(time), path(time - 0.03) + 0.3 * (time // 4.0 == 2.0)), {}, " error is", to),
        Case("connects", sqlite, joint(path(time), path(time - 0.03) + 0.4 * (time < 1.0)), {"a position: delay": 0.03},
             "the zero of the position moves once", to, ("with a gain of 1; the largest",)),
        Case("a rate", sqlite, joints("/js", time, ["a"], position=path(time - 0.05)[:, None]) + joints(
            "/cmd", time, ["a"], velocity=np.gradient(path(time), time)[:, None]), {"a velocity: delay": 0.05}, "", to),
        Case("at its end", sqlite, joint(0.1 + 0.2 * (time > 20.99), 0.1 + 0.0 * time), {}, "", to),
        Case("does not", sqlite, joint(steps, 0.0 * steps), {}, "a position: it was commanded to move, and never", to),
        Case("stops, late", sqlite, joint(stops, np.interp(time - 0.2, time, stops), 2), {}, "", to, (" as rest.",)),
        Case("a ramp", ros1, joint(ramp, np.interp(time - 0.1, time, ramp) + 0.5 * noise[:, 0]),
             {"a position: delay": 0.1}, "", to),
        trajectory([0.0, 1.5, 0.0, -0.5]), trajectory([0.0, 1.875, 0.0, -1.25, 0.0, 0.375], accelerations=[0.0]),
        Case("a force", by_mcap_ros2, wrenches("/f", time + 0.05, 0.8 * force + noise) + wrenches("/cmd", time, force),
             {"/f force.z: gain": 0.8, "/f force.z: delay": 0.05, "/f force.z: offset": -0.2 * force[:, 2].mean()},
             "", to),
    ]  # fmt: skip


def few_cycles() -> list[Case]:
    fast = one("/js", 250.0, 0.15, 0.5, lambda q: q + 0.001 * np.sin(0.088 * math.pi * np.arange(len(q))), 20.0)
    part = one("/js", 200.0, 0.15, 0.6, lambda q: q + 0.002 * np.sin(0.11 * math.pi * np.arange(len(q))) *
               (np.arange(len(q)) // 3000 == 1), 60.0)  # fmt: skip
    seven = one("/js", 100.0, 0.25, 0.3, lambda q: np.pad(q[:2800], (500, 700)), 40.0)
    other = one("/js", 100.0, 0.25, 0.3, lambda q: np.where(np.arange(len(q)) // 400 % 2, 0.8, 1.0) * q, 48.0)
    lost = [s for s, kept in zip(fast, np.random.default_rng(3).random(len(fast)) > 0.15, strict=True) if kept]
    return [
        Case("beside a fast one", sqlite, without(fast, lambda _: True, "velocity", "effort"),
             {"a: frequency": 11.0, "a: cycle, peak to peak": 0.002}),
        *(Case("rests and halves", by_rosbags, without(sent, lambda _: True, "velocity", "effort"),
               {"a: frequency": f, "a: cycle, peak to peak": 0.6}) for sent, f in ((seven, 0.25), (other, 0.125))),
        Case("in a part", sqlite, part, {"a from 15.0 s: frequency": 11.0, "a from 15.0 s: end": 30.0}),
        Case("in each half", by_rosbags, without(one("/js", 100.0, 0.3, 0.5, lambda q: np.interp(
            np.arange(3000) * 9 // 10 / 0.9, np.arange(3000), q)), lambda _: True, "velocity", "effort"), {}, "",
            NOTHING, ("a repeats at 0.3 Hz, 1 rad peak to peak. /js: 3000 messages",)),
        Case("few samples", ros1, in_steps(17.1, 0.005, 1e-6), sine(17.1, 0.005)),
        Case("with some lost", ros1, lost, {"a, 11 Hz: amplitude": 0.001}, "messages missing"),
        *(Case(f"{frequency:g} Hz", write, one("/joint_states", rate, frequency, 0.4, None, seconds), {}, "", NOTHING,
               ("No clear vibration was found above", f"recording: {seconds:g} s"))
          for write, rate, frequency, seconds in (
              (by_rosbags, 250.0, 0.4, 10.0), (sqlite, 100.0, 0.1, 30.0), (ros1, 50.0, 0.03, 100.0))),
    ]  # fmt: skip


def in_steps(frequency: float, size: float, step: float) -> list[Sent]:
    sent = one("/joint_states", 50.0, frequency, size, lambda q: step * np.rint(q / step + 0.23), 60.0)
    return without(sent, lambda _: True, "velocity", "effort")


def still() -> list[Case]:
    def with_flicker(write: Any, seed: int, count: float, noise: float, often: float = 0.03) -> Case:
        drawn = np.random.default_rng(seed)
        time = np.cumsum(drawn.choice([0.008, 0.01], 3000))
        a, speed = 0.5 * np.sin(0.6 * math.pi * time), 0.3 * math.pi * np.cos(0.6 * math.pi * time)
        b = 1.2 + count * np.where(drawn.random(3000) < often, drawn.choice([-1, 1], 3000), 0)
        position, velocity = np.column_stack([a, b]), np.column_stack([speed, noise * drawn.normal(size=3000)])
        acting = DRY * np.sign(speed) + VISCOUS * speed + 0.01 * drawn.normal(size=3000)
        effort = np.column_stack([acting, 0.2 + 0.0 * time])
        sent = joints("/joint_states", time, ["a", "b"], position=position, velocity=velocity, effort=effort)
        return Case(f"{count:g}, {noise:g}", write, sent, FRICTION, "", NOTHING, ("b: never moved.",))

    times = np.arange(6000) / 200.0 + 2e-4 * np.random.default_rng(1).random(6000)
    hum = 2.0 + 0.8 * np.sin(38.0 * math.pi * times)[:, None]
    pressed = wrenches("/f", times[1000:4000], np.ones((3000, 3)))
    return [
        Case("a hum", by_rosbags, joints("/s", times, ["a"], position=0.0 * hum, effort=hum),
             {"a effort, 19 Hz: amplitude": 0.8}),
        *(Case(f"not in the {part}", sqlite, joints("/s", times, ["a"], position=0.0 * hum) + pressed, {},
               f"/f: no message in the {part} {seconds} s of the") for part, seconds in (("first", 5), ("last", 10))),
        Case("a cycle of four counts", by_rosbags, in_steps(0.3, math.pi / 1024.0, math.pi / 2048.0),
             {"a: frequency": 0.3}, "", NOTHING, ("a: moved by 0.00614 rad, more slowly than 0.0185 rad/s, or",)),
        *(with_flicker(*each) for each in ((by_rosbags, 1, 1e-4, 0.0), (sqlite, 2, 1e-3, 1e-4), (ros1, 3, 2e-5, 1e-3),
                                           (sqlite, 4, 1.9e-3, 0.0, 0.003), (ros1, 5, 4e-4, 0.0, 0.13))),
        Case("on its way", ros1, joints("/s", times, ["a"], position=4e-4 * np.rint(np.interp(
            times, (5.0, 9.0, 20.0, 21.0), (0.0, 114.0, 114.0, 1000.0))[:, None])), {}, "", NOTHING,
            ("Nothing in this recording was found to repeat",)),
        Case("a belt", ros1, joints("/s", np.arange(600) / 50.0, ["a"], position=0.02 * np.arange(600)[:, None]),
             {}, "", NOTHING, ("a: always in motion",)),
        Case("noise", by_rosbags,
             joints("/s", range(2000), ["a"], position=1e-3 * np.random.default_rng(11).normal(size=(2000, 1))),
             {}, "", NOTHING, ("a: never moved.",)),
        Case("a valve", sqlite,
             joints("/s", range(600), ["a"], position=np.arange(600)[:, None] // 200 % 2, velocity=np.zeros((600, 1))),
             {"a: motions": 2.0}, "the velocity is 0"),
        *(Case(f"a gripper, {rate:g} Hz", by_rosbags,
               joints("/joint_states", time, ["a"], position=0.04 * (time[:, None] // 7.7 % 2.0), **given),
               {"a: motions": 7.0}, wrong)
          for rate, wrong in ((50.0, ""), (100.0, "the velocity is 0"))
          for time in [np.arange(0.0, 60.0, 1.0 / rate)]
          for given in [{"velocity": np.zeros((len(time), 1))} if wrong else {}]),
    ]  # fmt: skip


def brief_rests() -> list[Case]:
    """A joint that moves back and forth in 1 s each, or ten times as fast, and rests for 0.4 s of that between."""

    def resting(write: Any, rate: float, faster: float, least: str, wrong: str = "") -> Case:
        phase = np.arange(0.0, 14.0, faster / rate) % 1.4
        way = np.where(np.arange(len(phase)) * faster / rate % 2.8 < 1.4, 1.0, -1.0)
        position = 0.3 * way * np.cos(math.pi * np.minimum(phase, 1.0))
        velocity = {"velocity": np.gradient(position, 1.0 / rate)[:, None]} if wrong else {}
        sent = joints("/joint_states", np.arange(len(phase)) / rate, ["a"], position=position[:, None], **velocity)
        sent = without(sent, lambda i: phase[i] > 1.0, "velocity")  # as JSON leaves out what is 0
        return Case(f"{faster:g}{wrong}", write, sent, {"a: motions": 10.0}, wrong, NOTHING,
                    (f"at rest for 28 % of {least}",))  # fmt: skip

    gaps = [s for i, s in enumerate(one("/js", 100.0, 0.31, 0.7)) if i % 700 > 60]
    slow = [s._replace(fields=s.fields | {"velocity": s.fields["velocity"] * (np.abs(s.fields["velocity"]) > 0.2)})
            for s in one("/js", 100.0, 0.3, 0.5)[80:]]  # fmt: skip
    always, time = ("always in motion (",), np.arange(0.0, 28.0, 0.02)
    return [resting(by_rosbags, 100.0, 1.0, "the time"), resting(ros1, 100.0, 1.0, "the time", "velocity in only"),
            resting(sqlite, 1000.0, 10.0, "the time"),
            Case("gaps", sqlite, gaps, FRICTION, "messages missing", NOTHING, always),
            Case("slow ones as zero", by_rosbags, slow, FRICTION, "", NOTHING, always),
            Case("ten bits", ros1, in_steps(0.3, 0.6, 0.0046), {}, "", NOTHING, always),
            Case("a servo", ros1, joints("/js", time, ["a"], position=0.005 * np.rint(20.0 * np.clip(
                np.abs(time[:, None] % 2.4 - 1.2) - 0.8, 0.0, 0.4) / 0.4)), {"a: motions": 12.0})]  # fmt: skip


def zeros() -> list[Case]:
    def moved(at: float, by: float, rate: float) -> Any:
        return lambda q: q + by * (np.arange(len(q)) / rate > at)

    made = [
        (by_rosbags, 100.0, 0.5, ()), (sqlite, 250.0, -1.3, ()), (ros1, 100.0, 3.0, ()), (sqlite, 200.0, 0.012, ()),
        (by_mcap_ros2, 100.0, 0.06, ()), (by_rosbags, 125.0, 0.15, ("velocity",)), (sqlite, 500.0, -0.1, ("velocity",)),
    ]  # fmt: skip
    away = one("/joint_states", 100.0, 0.7, 0.5, lambda q: q + 0.3 * (np.arange(len(q)) % 900 == 500))
    frozen = one("/drive/status", 100.0, 0.7, 0.5, lambda q: np.where(np.arange(len(q)) // 30 == 40, q[1200], q))
    grips = 0.04 * (np.arange(1500) // 250 % 2) + 2e-5 * np.random.default_rng(6).normal(size=1500)
    return [
        *(Case(f"a frozen encoder {lacks}", sqlite, without(frozen, lambda _: True, *lacks),
               {"a: frequency": 0.7} | FRICTION, "is frozen in motion in 29 of 3000") for lacks in ((), ("velocity",))),
        Case("a gripper comes back", ros1, joints("/g", np.arange(1500) / 50.0, ["a"], position=grips[:, None]),
             {"a: motions": 5.0}),
        Case("there and back", sqlite, away, sine(0.7, 0.5) | FRICTION, "the position jumps away and back 3 times"),
        Case("now and then", ros1, one("/js", 100.0, 0.7, 0.5, lambda q: q * (np.arange(len(q)) % 150 != 13)),
             sine(0.7, 0.5) | FRICTION, "the position jumps away and back"),
        *(Case(f"{by:g}", write,
               without(one("/joint_states", rate, 0.7, 0.5, moved(12.5, by, rate)), lambda _: True, *lacks),
               sine(0.7, 0.5) | FRICTION, "the zero of the position moves once")
          for write, rate, by, lacks in made),
    ]  # fmt: skip


def contradictions() -> list[Case]:
    def scaled(factor: float, write: Any, rate: float) -> Case:
        sent = one("/joint_states", rate, 0.7, 0.5)
        sent = [s._replace(fields=s.fields | {"velocity": factor * s.fields["velocity"]}) for s in sent]
        said, found = (f"{factor:.3g} times the rate", {}) if factor else ("0 in every message", FRICTION)
        return Case(f"{factor:g}", write, sent, sine(0.7, 0.5) | found, f"velocity is {said}")

    def slipping(kept: float, write: Any, rate: float) -> Case:
        def slip(q: Any) -> Any:
            """Of the motion in 3 of every 8 s only a part is counted."""
            steps = np.diff(q, prepend=0.0)
            return np.cumsum(np.where(np.arange(len(q)) / rate % 8.0 > 5.0, kept, 1.0) * steps)

        sent = one("/joint_states", rate, 0.3, 0.7, slip)
        return Case(f"{kept:g} is counted", write, sent, {}, "an encoder slips or stops")

    def late(by: int, write: Any, rate: float) -> Case:
        speeds = np.roll(motion(rate, 0.7, 0.5)[2], by).tolist()
        sent = [s._replace(fields=s.fields | {"velocity": [v]})
                for s, v in zip(one("/joint_states", rate, 0.7, 0.5), speeds, strict=True)]  # fmt: skip
        return Case(f"late by {by}", write, sent, sine(0.7, 0.5) | FRICTION, f"velocity is about {by / rate:.3g} s")

    zero = {"velocity": [0.0], "position": [0.0], "effort": [0.0]}
    sent = one("/joint_states", 100.0, 0.7, 0.5)
    seconds = [[s._replace(fields=s.fields | zero, stamp=s.stamp + 0.0042) for s in sent[::every]] for every in (1, 10)]
    told = "took turns; the topic is not"
    both = [Case(f"{len(some)} of a second", sqlite, sent + some, {}, told) for some in seconds]
    time, *_ = moving = motion(200.0, 0.7, 0.5)
    steps = np.arange(len(time))
    buzz = np.where(steps % 800 < 100, 3e-6 * (-1.0) ** steps * (1.0 + 0.01 * np.sin(steps)), 0.0)
    position, velocity, effort = (np.column_stack([one, one]) for one in moving[1:])
    position[:, 1], velocity[:, 1] = buzz, 0.0
    quiet = joints("/joint_states", time, ["a", "b"], position=position, velocity=velocity, effort=effort)
    both.append(Case("one that buzzes", by_rosbags, quiet, sine(0.7, 0.5) | FRICTION))
    both += [Case(f"{rate:g} Hz", sqlite, one("/joint_states", rate, 0.01 * rate, 0.5, None, 600.0 / rate),
                  {"/joint_states: period": 1e3 / rate}) for rate in (1.0, 0.2)]  # fmt: skip
    scales = ((0.85, sqlite, 200.0), (57.3, by_rosbags, 100.0), (0.0, by_rosbags, 100.0), (0.0, sqlite, 250.0),
              (0.0, ros1, 125.0), (-1.0, sqlite, 200.0), (0.105, ros1, 50.0), (1.05, ros1, 50.0))  # fmt: skip
    counts = 0.0015 * np.rint(np.clip(np.arange(3000) - [[900], [1900]], 0, 60) / 30.0).sum(0)[:, None]
    pulses = joints("/js", np.arange(3000) / 100.0, ["a"], position=counts, velocity=100.0 * np.diff(
        counts, axis=0, prepend=0.0))  # fmt: skip
    seen = one("/js", 100.0, 0.1, 0.05, lambda q: q + 2e-3 * np.random.default_rng(2).normal(size=len(q)))
    ends = joints("/js", np.arange(60.0), ["a"], position=np.arange(60)[:, None] % 2, effort=np.ones((60, 1)))
    both += [Case("from end to end in each message", ros1, ends, {"/js: period": 1e3})]
    slow = [s._replace(fields=s.fields | {"velocity": 0.024 * np.rint(s.fields["velocity"] / 0.024)})
            for s in one("/js", 100.0, 0.1, 0.05)]  # fmt: skip
    both += [Case("a coarse velocity", sqlite, slow, {})]
    both += [Case("slow for its noise", by_rosbags, seen, {}), Case("pulses of an encoder", sqlite, pulses, {})]
    speeds = np.diff(motion(50.0, 0.7, 0.5)[1], prepend=0.0) * 50.0
    differences = [s._replace(fields=s.fields | {"velocity": [v]})
                   for s, v in zip(one("/js", 50.0, 0.7, 0.5), speeds, strict=True)]  # fmt: skip
    both += [Case("a difference", ros1, differences, sine(0.7, 0.5) | FRICTION, "velocity is about 0.01 s")]
    both += [late(10, by_rosbags, 100.0), late(4, ros1, 250.0), *(scaled(*each) for each in scales)]
    return [*both, slipping(0.0, by_rosbags, 200.0), slipping(0.0, ros1, 50.0), slipping(0.7, sqlite, 125.0),
            *(Case(f"slips by {by:g} now and then", by_rosbags, one("/js", 100.0, 0.3, 0.7, lambda q, by=by: q - by *
                   np.clip(np.arange(len(q)) / 20.0 - [[31], [66], [109]], 0.0, 1.0).sum(0)), {}, "an encoder slips")
              for by in (0.15, 0.06))]  # fmt: skip


def formats() -> list[Case]:
    sent = one("/state", 100.0, 0.7, 0.5)
    time = np.arange(0.0, 12.0, 0.004)
    force = np.zeros((len(time), 3))
    force[time > 4.0, 2] = 10.0
    frames = wrenches("/ft/wrench", time, force, "/tool0") + wrenches("/force_command", time, force, "tool0")
    step = {"/ft/wrench, 10 N at 4.0 s: force in the steady state": 10.0}
    commanded = topic_map([], [], ["/force_command"], [], [])
    return [
        Case("JSON in a directory", json_directory, sent, {"a: frequency": 0.7}, "", MAPPED),
        Case("parts of a force", by_json, [s._replace(fields={"x": 0.0, "y": s.fields["position"][0]}) for s in sent],
             {"/state force.y: frequency": 0.7}, "",
             topic_map(["/state"], [], [], ["force=state.x,state.y", "stamp=time"], [])),
        Case("dates", by_json, [s._replace(fields=s.fields | {"at": str(np.datetime64(round(1e9 * s.stamp), "ns"))})
                                for s in sent], {"a: frequency": 0.7}, "",
             topic_map(["/state"], [], [], ["name=state.name", "position=state.position", "stamp=state.at"], [])),
        Case("the number of a motor", by_json, [s._replace(fields=s.fields | {"name": 7}) for s in sent],
             {"7: frequency": 0.7}, "", MAPPED),
        Case("JSON of ROS", lambda path, sent: by_json(path, sent, "sensor_msgs/JointState"),
             without(one("/joint_states", 100.0, 0.7, 0.5), lambda _: True, "velocity"), sine(0.7, 0.5) | FRICTION),
        Case("taps", ros1, wrenches("/f", time, np.outer(
            np.exp(-(time % 6.0 - 1.0) ** 2 / 1.5e-4), (0.0, 0.0, 9.0)).round(2)), {}),
        *(Case(f"slash, {n}", way, frames, step, "", commanded) for n, way in enumerate((by_rosbags, sqlite))),
    ]  # fmt: skip


def held_over() -> list[Case]:
    def repeated(times: int, *quantities: str) -> list[Sent]:
        sent = one("/joint_states", 400.0, 0.7, 0.5)
        return [s._replace(fields=s.fields | {q: sent[i - i % times].fields[q] for q in quantities})
                for i, s in enumerate(sent)]  # fmt: skip

    every, time = ("position", "velocity", "effort"), np.arange(0.0, 30.0, 0.01)
    way, same = 0.3 * time[:, None], 0.3 + 0.0 * time[:, None]
    steady = joints("/js", time, ["a"], position=way, velocity=same, effort=same)
    return [
        Case("all", by_rosbags, repeated(4, *every), sine(0.7, 0.5) | FRICTION, "only repeated in 9000 of 12000"),
        Case("a constant speed", sqlite, steady, {}),
        Case("effort", ros1, repeated(2, "effort"), sine(0.7, 0.5) | FRICTION, "effort only repeated in 6000"),
    ]


def wrong_efforts() -> list[Case]:
    chance = np.random.default_rng(1)

    def changed(change: Any) -> list[Sent]:
        sent = one("/joint_states", 100.0, 0.7, 0.5)
        return [s._replace(fields=s.fields | {"effort": change(s.fields["effort"])}) for s in sent]

    both = [s._replace(fields={name: [*value, *value] for name, value in s.fields.items()} | {
        "name": ["a", "b"], "effort": [*s.fields["effort"], 0.0]}) for s in changed(np.asarray)]  # fmt: skip
    return [
        Case("0 of one", sqlite, both, FRICTION, "", NOTHING, ("b: friction is not identified: its effort never",)),
        Case("sign", sqlite, changed(lambda e: -e), sine(0.7, 0.5), "as if the effort had the other sign"),
        Case("noise", by_rosbags, changed(lambda e: chance.normal(size=1)), sine(0.7, 0.5), "", NOTHING,
             ("a: friction is not identified: the errors are too large (dry friction ", "; the model leaves ")),
        Case("limited", by_rosbags, changed(lambda e: np.clip(e, -1.6, 1.6)), sine(0.7, 0.5), "as if it was limited"),
        Case("one value", ros1, changed(lambda e: 40.0 + 0.0 * e), {}, "", NOTHING, ("touches the arm. To find",)),
        Case("a limited force", sqlite, wrenches("/ft", np.arange(3000) / 100.0, np.clip(
            12.0 * chance.normal(size=(3000, 3)), -9.0, 9.0)), {}, "/ft: the force.z is exactly -9 N or 9 N in 4"),
    ]  # fmt: skip


def other_units() -> list[Case]:
    def scaled(quantity: str, by: float, write: Any, wrong: str, *units: str) -> Case:
        sent = one("/joint_states", 100.0, 0.7, 0.5)
        sent = [s._replace(fields=s.fields | {quantity: by * s.fields[quantity]}) for s in sent]
        told = "If it was recorded in another unit, give " + " or ".join(f"--unit {quantity}={unit})" for unit in units)
        return Case(quantity, write, sent, {}, wrong or told, NOTHING, (told,))

    degree = 180.0 / math.pi
    slow = one("/joint_states", 100.0, 0.7, 5.0)  # of 5 degrees
    alone = [s._replace(fields={k: v for k, v in s.fields.items() if k != "velocity"}) for s in slow]
    often = [[s._replace(fields={"name": [name], "position": s.fields["position"]})
              for s in one("/joint_states", 100.0, 0.7, 20.0)] for name in ("motor1", "left_wheel")]  # fmt: skip
    two, in_degrees = "one of the two has another unit", "if its position is in deg, give --unit position=deg"
    return [
        Case("position alone", by_rosbags, alone, {}, in_degrees, NOTHING, ()),
        Case("a belt", sqlite, joints("/s", np.arange(900) / 50.0, ["a"], position=0.3 * np.arange(900)[:, None]), {}),
        Case("linear", sqlite, slow, FRICTION, "", topic_map([], [], [], [], ["position=m"]), ("N, viscous", "N s/m")),
        *(Case("a motor's shaft and a wheel may turn often and fast", by_rosbags, sent, {}) for sent in often),
        scaled("position", degree, ros1, two, "deg (shown in rad", "mm (shown in m"),
        scaled("velocity", degree, sqlite, two, "deg/s (shown in rad/s", "mm/s (shown in m/s", "rpm (shown in rad/s"),
        scaled("effort", 1e3, by_rosbags, "", "mN (shown in N", "mNm (shown in N m", "mA (shown in A"),
    ]


KINDS = (
    held_over, wrong_efforts, other_units, wraps, sparse, coarse, twice, names, called_as_commands,
    follows, few_cycles, still, brief_rests, zeros, contradictions, formats, of_ros2_control, by_chance,
)  # fmt: skip
CASES = [pytest.param(case, id=f"{kind.__name__}: {case.name}") for kind in KINDS for case in kind()]


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("case", CASES)
def test_a_fault_is_read_right_and_said(case: Case, tmp_path: Path) -> None:
    analysis = analyse(case.write(tmp_path / "bag", case.sent), lambda doing: None, case.given)
    numbers = {one.name: one.measured for section in analysis.sections for one in section.findings}
    assert {name: numbers.get(name) for name in case.numbers} == pytest.approx(case.numbers, rel=0.02)
    wrong = " ".join(sentence for section in analysis.sections for sentence in section.wrong)
    assert case.wrong in wrong if case.wrong else not wrong
    every = " ".join(sentence for section in analysis.sections for sentence in section.sentences)
    every += str(analysis.provenance)
    assert all(sentence in every for sentence in case.absent)


def test_a_map_to_more_values_than_names_is_refused(tmp_path: Path) -> None:
    sent = [s._replace(fields=s.fields | {"position": [0.0, 1.0]}) for s in one("/state", 50.0, 0.7, 0.5, None, 1.0)]
    with pytest.raises(ValueError, match="/state has 2 values for 1 names"):
        analyse(by_json(tmp_path / "bag", sent), lambda doing: None, MAPPED)


def numbers(path: Path, storage: str, count: int) -> Path:
    """A bag of numbers alone."""
    kind = "std_msgs/msg/Float64"
    return by_rosbags(path, [Sent("/state", kind, 0.0, 0.01 * k, "", {"data": k}) for k in range(count)], storage)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3", "ros1"])
def test_topics_that_are_not_read_and_how_to_read_them_are_said(storage: str, tmp_path: Path) -> None:
    with pytest.raises(BagError, match=r"100 messages of .* --topic /state --map"):
        analyse(numbers(tmp_path / "bag", storage, 100), lambda doing: None)
    with pytest.raises(BagError, match="is empty"):
        analyse(numbers(tmp_path / "none", storage, 0), lambda doing: None)


class Written(NamedTuple):
    """How a table is written: titles of time, position, velocity and effort, and what its numbers are divided by."""

    titles: tuple[str, ...] = ("time", "position.a", "velocity.a", "effort.a")
    units: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0)
    delimiter: str = ","
    decimal: str = "."
    fields: tuple[str, ...] = ()
    given: tuple[str, ...] = ()
    times: Callable[[float], Any] = float
    comment: str = ""
    below: str = ""


def date(time: float) -> str:
    return str(np.datetime64("2024-05-01T12:00:00") + np.timedelta64(round(1e9 * time), "ns"))


def german(time: float) -> str:
    return f"{time:,.4f}".translate(str.maketrans(",.", ".,"))


TITLES = ("position.a", "velocity.a", "effort.a")
WITH_UNITS = ("time [ms]", "position.a (deg)", "velocity.a [deg/s]", "effort.a [mA]")
OTHER_UNITS = (1e-3, math.pi / 180.0, math.pi / 180.0, 1e-3)
TABLES = {
    "plain": Written(),
    "no velocity": Written(("time", "position.a", "speed", "effort.a")),
    "renamed": Written(("t", "q.a", "velocity.a", "effort.a"), fields=("position=q",)),
    "units in the titles": Written(WITH_UNITS, OTHER_UNITS),
    "units, renamed": Written(("t [ms]", *WITH_UNITS[1:]), OTHER_UNITS, fields=("stamp=t [ms]",)),
    "a torque constant": Written(("time", *TITLES[:2], "effort.a [A]"), (1.0, 1.0, 1.0, 0.12), given=("effort=0.12",)),
    "decimal commas": Written(delimiter=";", decimal=","),
    "decimal commas in quotes": Written(decimal=","),
    "separators of thousands": Written(("Zeit [ms]", *WITH_UNITS[1:]), OTHER_UNITS, ";", times=german),
    "the delimiter above": Written(delimiter=";", decimal=",", comment="sep=;\n"),
    "two columns": Written(("s", *TITLES, "ns"), fields=("stamp=s,ns",), times=lambda time: int(time) + 50),
    "two columns, us": Written(("s", *TITLES, "us"), fields=("stamp=s,us",), times=int),
    "tabs": Written(delimiter="\t"),
    "bars": Written(delimiter="|"),
    "ns since 1970": Written(times=lambda time: 17 * 10**17 + round(1e9 * time)),
    "rounded": Written(times=lambda time: math.floor(time / 0.003) * 0.003),
    "dates": Written(times=date),
    "a day with dots": Written(times=lambda time: f"{date(time)[8:10]}.05.2024 {date(time)[11:]}"),
    "dates of a zone": Written(times=lambda time: f"{date(time)}+02:00"),
    "dates of two zones": Written(times=lambda time: f"{date(time)}Z" if time < 9 else f"{date(time - 3600)}-01:00"),
    "hours": Written(("time [h]", *WITH_UNITS[1:]), (3600.0, *OTHER_UNITS[1:])),
    "dates as Python logs them": Written(times=lambda time: date(time).replace("T", " ").replace(".", ",")),
    "a row of units": Written(units=OTHER_UNITS, below="ms,deg,deg/s,mA\n"),
    "some rows without a time": Written(times=lambda time: "" if round(100.0 * time) % 1000 == 7 else time),
    "a comment above": Written(comment="# recorded by hand\n"),
    "blanks": Written(delimiter=" "),
    "a number before each row": Written(("time", "position.a", "velocity.a", "effort.a", "")),
    "titles as numpy writes them": Written(("# time", *(f" {title}" for title in TITLES))),
}


def table_of(how: Written) -> tuple[list[str], list[list[Any]]]:
    time, *others = motion(100.0, 0.7, 0.5)
    columns = [[how.times(one / how.units[0]) for one in time.tolist()]]
    columns += [(values / unit).tolist() for values, unit in zip(others, how.units[1:], strict=True)]
    if len(how.titles) > len(columns):
        columns.append([round((1e6 if how.titles[-1] == "us" else 1e9) * (one % 1.0)) for one in time.tolist()])
    return list(how.titles), columns


@pytest.mark.parametrize("how", TABLES.values(), ids=TABLES)
@pytest.mark.parametrize("is_file", [True, False])
def test_a_table_is_read_as_a_recording(is_file: bool, how: Written, tmp_path: Path) -> None:
    titles, columns = table_of(how)
    source: Any = dict(zip(WITH_UNITS if how.below else titles, columns, strict=True))  # a file alone has such a row
    if is_file:
        source = tmp_path / ("table.CSV" if how.below else "table.txt" if how.comment else "table.csv")
        with source.open("w", newline="") as stream:
            stream.write(how.comment)
            writer = csv.writer(stream, delimiter=how.delimiter)
            writer.writerow(titles)
            stream.write(how.below)
            writer.writerows([str(one).replace(".", how.decimal) for one in row] for row in zip(*columns, strict=True))
    analysis = analyse(source, lambda doing: None, topic_map([], [], [], how.fields, how.given))
    numbers = {one.name: one.measured for section in analysis.sections for one in section.findings}
    expected = sine(0.7, 0.5) | FRICTION
    assert {name: numbers.get(name) for name in expected} == pytest.approx(expected, rel=0.02)
    told = " ".join(analysis.sections[1].sentences)
    assert ("is computed from the position: a." in told) is not any("velocity" in one for one in titles)
    assert ("Not used" in analysis.sections[0].sentences[0]) is ("speed" in titles)
    assert "joints: reception jitter" not in numbers
    assert sum("Hz: amplitude" in name for name in numbers) == 1
    assert analysis.recording.duration == pytest.approx(29.99, abs=0.02)


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9), ("day", 1.0 / 86400.0)])
def test_a_time_that_can_hardly_be_in_seconds_is_refused_until_its_unit_is_given(unit: str, factor: float) -> None:
    titles, columns = table_of(Written(units=(1.0 / factor, 1.0, 1.0, 1.0)))
    table = dict(zip(titles, columns, strict=True))
    with pytest.raises(ValueError, match=f"'time' increases by .* so it is hardly in s; give --unit stamp={unit}"):
        analyse(table, lambda doing: None)
    given = topic_map([], [], [], [], [f"stamp={unit}"])
    analysis = analyse(table, lambda doing: None, given)
    assert analysis.recording.duration == pytest.approx(30.0, abs=0.02)
    with pytest.raises(ValueError, match="are in rad and in m"):
        analyse(table | {"position.b [mm]": columns[1]}, lambda doing: None, given)


@pytest.mark.parametrize(("text", "given", "message"), [
    ("time,position.a\n0,01,1,5\n0,02,1,6\n", NOTHING, "a row of 4 cells below 2 titles"),
    ("time,position.a,position.a\n0,1,2\n", NOTHING, "has two columns 'position.a'"),
    ('"time", "position.a"\n0,1\n0.1, "ERR"\n', NOTHING, "'position.a': a cell has 'ERR', which is no number; lea"),
    ("time,position.a\n0,1\n# end,\n", NOTHING, "'time': a cell has '# end', which is no number; .* dates are re"),
    ("Date\t27\ntime\tposition.a\tvelocity.a\n0\t1\t2\n", NOTHING, "below 2 titles, its first line; remove"),
    ('time,position.a,velocity.a,effort.a\n0,"1,2,3\n' + 2**15 * "1,1,2,3\n", NOTHING, "cell has '1,2,3', which"),
    ("time,position.a\n3,1\n3,2\n", NOTHING, "the time is the same in all 2 rows"),
    ("time,position.a\n" + 2 * "".join(f"{i},1\n" for i in range(200)), NOTHING, "after 200 rows the time goes"),
    ("time,position.a\n" + 40 * "".join(f"0.{i},1\n" for i in range(10, 70)), NOTHING, "after 60 rows the time"),
    ("time,position,of\n" + "".join(f"{i // 3},{i},j{i % 3}\n" for i in range(90)), NOTHING, "each time, by 'of'"),
    ("time,position.a\n0,1\n", topic_map([], [], ["/a"], [], []), "titles command.position.JOINT"),
    ("time,position.a\n0,1\n", topic_map([], ["b"], [], [], []), "has no joint b; its joints: a"),
    ("time,effort.a [A]\n0,1\n", topic_map([], [], [], [], ["effort=Nm"]), "--unit gives another one for effort"),
    ("time,position.a [mm]\n0,1\n", topic_map([], [], [], [], ["position=deg"]), "another one for position"),
    ("time,q\n0,1\n", topic_map([], [], [], ["effort=q", "position=p"], []), "no column 'p'; .* position=.*: time"),
    ("time,f\n0,1\n", topic_map([], [], [], ["force=f"], []), "no column 'f.x'; name that of force .*: time, f"),
    ("0,1\n1,1\n", NOTHING, "numbers in its first row"), ("t,q\n" + 10**6 * "1", NOTHING, "is no table: field larger"),
])  # fmt: skip
def test_a_table_that_cannot_be_read_is_refused(text: str, given: Any, message: str, tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=message):
        analyse(path, lambda doing: None, given)


def test_a_command_without_an_axis_is_that_of_the_axis_that_follows_and_spikes_hide_no_cycle() -> None:
    time = np.arange(0.0, 20.0, 0.004)
    asked = 8.0 * (time >= 5.0)
    force = asked + np.sin(6.0 * math.pi * time) + np.where(np.arange(len(time)) % 1700 == 800, 3e4, 0.0)
    table = {"time": time, "force.x": 0.1 * np.sin(time), "force.z": force, "command.force.x": asked}
    table = {name: column[(time < 11.0) | (time > 11.3)] for name, column in table.items()}
    sections = analyse(table, lambda doing: None, NOTHING).sections
    numbers = {one.name: one.measured for section in sections for one in section.findings}
    assert numbers["wrench, 8 N at 5.0 s: force in the steady state"] == pytest.approx(8.0, abs=0.01)
    assert numbers["wrench force.z: cycle, peak to peak"] == pytest.approx(2.0, rel=0.02)
    told = " ".join(sentence for section in sections for sentence in section.wrong)
    assert re.search("force.z jumps away and back 3 times, by up to 3.00e.04 N.*but force.z of wrench follows it", told)
    assert not any("more than most robots" in sentence for section in sections for sentence in section.sentences)


@pytest.mark.parametrize(("change", "since", "ramp", "said"), [
    (lambda t: RISE - 6.0 * (t > 9.0), 2.0, 1e-6, "the force jumps from one message to the next at 9.0 s, by up to 6"),
    (lambda t: RISE + 0.01 * np.exp(0.35 * t) * np.sin(30.0 * t), 2.0, 1e-6, "the force DIVERGES, by"),
    (lambda t: RISE, 2.0, 1e-6, "wrench, 6 N m at 2.0 s: a step from 0 N m."),
    (lambda t: 5.7 + 0.0 * t, 0.0, 1e-6, "wrench, 6 N at 0.0 s: commanded from the beginning."),
    (lambda t: 3.0 * np.clip(t - 5.0, 0.0, 2.0), 7.0, 2.0, "wrench, 6 N at 7.0 s: a step from 0 N."),
])  # fmt: skip
def test_what_a_force_does_is_said(change: Any, since: float, ramp: float, said: str) -> None:
    time = np.arange(0.0, 20.0, 0.004)
    force = change(time) + np.random.default_rng(4).normal(0.0, 0.03, len(time))
    axis = "torque.z" if "N m" in said else "force.z"
    table = {"time": time, axis: force, f"command.{axis}": np.interp(time, [since - ramp, since], [0.0, 6.0])}
    sections = analyse(table, lambda doing: None).sections
    assert said in " ".join(sentence for section in sections for sentence in section.sentences)
    assert any(said in sentence for section in sections for sentence in section.wrong) is ("the force" in said)


@pytest.mark.parametrize(("joints", "name"), [([], "q[2]"), (["elbow"], "elbow")])
def test_a_table_holds_commands_and_a_joint_has_the_name_of_its_column(joints: list[str], name: str) -> None:
    time, q, _, effort = motion(100.0, 0.7, 0.5)
    table = {"time": time, "q[1]": 0.0 * q, "q[2]": q, "command.q[2]": 0.5 * np.sin(1.4 * math.pi * time)}
    table |= {"tau (2)": effort, "force": effort}
    found = analyse(table, lambda doing: None, topic_map([], joints, [], ["position=q[2]", "effort=tau (2)"], []))
    told = " ".join(sentence for section in found.sections for sentence in section.sentences)
    assert f"{name}: repeats at the commanded frequency" in told
    assert "Taken as commands: joints_command" in told
    assert "Not used: q[1]; force; rename" in told
