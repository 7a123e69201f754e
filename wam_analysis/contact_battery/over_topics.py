"""Scenes of the battery over topics: the scenario as a script, the records from a bag."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from wam_analysis.bag import JointColumns, Messages, PointColumns, WrenchColumns, read
from wam_analysis.contact_battery.run import Belief, Levers, Played, Record, belief
from wam_analysis.contact_battery.scenes import Scene
from wam_control.scenario import Step
from wam_description.arm import Arm
from wam_description.signals import Load

TOPICS = (
    "sim/joint_states",
    "sim/contact/wrench",
    "sim/contact/point",
    "motor_states",
    "external_joint_torques",
    "external_joint_torques_sd",
    "contact/hypotheses",
)


def script(scene: Scene) -> dict[str, Any]:
    """The steps of a scene as the scenario reads them from YAML."""
    return {"steps": [_step(step) for step in scene.steps]}


def _step(step: Step) -> dict[str, Any]:
    body: dict[str, Any] = {"name": step.name, "seconds": step.seconds}
    if step.posture:
        body["posture"] = list(step.posture)
    if step.request:
        body["request"] = step.request
    if step.push:
        push = step.push
        body["push"] = {
            "cover": push.cover,
            "place": push.place,
            "newtons": list(push.force),
            "begin": push.begin,
            "end": push.end,
        }
    return body


def recorded(scene: Scene, bag: Path, arm: Arm, failure: str) -> Played:
    """A scene as a bag has it, every display period an outer one.

    What the hypotheses say is rounded to six digits there.
    """
    topics = read(bag, TOPICS).topics
    columns = {name: next(column for topic, column in topics.items() if topic.endswith(f"/{name}")) for name in TOPICS}
    joints, motors, external = (columns[n] for n in ("sim/joint_states", "motor_states", "external_joint_torques"))
    wrenches, points, felt = (columns[n] for n in ("sim/contact/wrench", "sim/contact/point", "contact/hypotheses"))
    assert isinstance(joints, JointColumns)
    assert isinstance(motors, JointColumns)
    assert isinstance(external, JointColumns)
    spread = columns["external_joint_torques_sd"]
    assert isinstance(spread, JointColumns)
    assert isinstance(wrenches, WrenchColumns)
    assert isinstance(points, PointColumns)
    assert isinstance(felt, Messages)
    levers = Levers(arm)
    torques = dict(zip(external.stamp_ns.tolist(), external.effort.tolist(), strict=True))
    spreads = dict(zip(spread.stamp_ns.tolist(), spread.effort.tolist(), strict=True))
    speeds = dict(zip(motors.stamp_ns.tolist(), motors.velocity.tolist(), strict=True))
    beliefs = {_stamp(message): tuple(_belief(status) for status in message.status) for message in felt.messages}
    records = []
    for i, stamp in enumerate(joints.stamp_ns.tolist()):
        if stamp not in torques or stamp not in beliefs:
            continue
        frame = wrenches.frames[i]
        is_touched = frame in arm.covers.names
        load = Load(
            frame if is_touched else "",
            float(points.point[i, 0]),
            _triple(wrenches.force[i]),
            _triple(wrenches.torque[i]),
        )
        q = joints.position[i].tolist()
        records.append(
            Record(
                stamp=stamp,
                q=tuple(q),
                qd=tuple(joints.velocity[i].tolist()),
                thetad=tuple(speeds[stamp]),
                load=load,
                torques=levers.torques(q, load),
                external=tuple(torques[stamp]),
                external_sd=tuple(spreads[stamp]),
                in_contact=bool(beliefs[stamp]),
                beliefs=beliefs[stamp],
            )
        )
    return Played(scene, records, failure)


def _stamp(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _belief(status: Any) -> Belief:
    facts: Mapping[str, Any] = {pair.key: _numbers(pair.value) for pair in status.values}
    return belief(status.name, facts)


def _numbers(text: str) -> Any:
    """A number, several as a tuple; words as they are."""
    try:
        numbers = tuple(map(float, text.split()))
    except ValueError:
        return text
    return numbers[0] if len(numbers) == 1 else numbers


def _triple(row: np.ndarray) -> tuple[float, float, float]:
    x, y, z = row.tolist()
    return x, y, z
