"""Scenarios on the nodes in this process, in lockstep: their script, and the records from the bag."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import yaml

from wam_bag.bag import JointColumns, PointColumns, TableColumns, WrenchColumns, read
from wam_control.contact.contact_table import hypotheses_of
from wam_control.task.scenario import ScenarioStep
from wam_description.arm import Arm
from wam_description.configuration import Configuration
from wam_description.signals import Load
from wam_ros.bring_up import Composition
from wam_sim.replay import tables
from wam_studies.contact.scenarios import BenchmarkScenario
from wam_studies.contact.simulation import LoadTorques, Played, Record, hypothesis

TOPICS = (
    "sim/joint_states",
    "sim/contact/wrench",
    "sim/contact/point",
    "motor_states",
    "external_joint_torques",
    "external_joint_torques_sd",
    "contact/hypotheses",
)


def play_over_topics(configuration: Configuration, scenario: BenchmarkScenario, domain_id: int | None = None) -> Played:
    """Play one scenario in a ROS domain, the one of the environment where None."""
    shared = configuration.shared
    with TemporaryDirectory(prefix="wam_benchmark_") as folder:
        steps = Path(folder) / "scenario.yaml"
        steps.write_text(yaml.safe_dump(script(scenario)), encoding="utf-8")
        own = {
            "nodes": [*shared.nodes, "scenario", "recorder"],
            "timing.mode": "lockstep",
            "timing.real_time_factor": 0.0,
            "timing.timeout": 60.0,
            "timing.display_divisor": 1,
            "scenario:script": str(steps),
            "recorder:directory": folder,
            "recorder:name": "scenario",
        }
        with Composition(configuration.with_values({**scenario.values, **own}), domain_id=domain_id) as composition:
            failure = composition.play().failure
        return recorded(scenario, Path(folder) / "scenario", shared.arm, failure)


def script(scenario: BenchmarkScenario) -> dict[str, Any]:
    """The steps of a scenario in the format of the scenario node."""
    return {"steps": [_step(step) for step in scenario.steps]}


def _step(step: ScenarioStep) -> dict[str, Any]:
    body: dict[str, Any] = {"name": step.name, "seconds": step.seconds}
    if step.posture:
        body["posture"] = list(step.posture)
    if step.request:
        body["request"] = step.request
    if step.push:
        push = step.push
        body["push"] = {
            "cover": push.cover,
            "contact_position": push.position,
            "newtons": list(push.force),
            "begin": push.begin,
            "end": push.end,
        }
    return body


def recorded(scenario: BenchmarkScenario, bag: Path, arm: Arm, failure: str) -> Played:
    """The records of a scenario from its bag."""
    topics = read(bag, TOPICS).topics
    columns = {name: next(column for topic, column in topics.items() if topic.endswith(f"/{name}")) for name in TOPICS}
    joints, motors, external = (columns[n] for n in ("sim/joint_states", "motor_states", "external_joint_torques"))
    wrenches, points, estimates = (
        columns[n] for n in ("sim/contact/wrench", "sim/contact/point", "contact/hypotheses")
    )
    assert isinstance(joints, JointColumns)
    assert isinstance(motors, JointColumns)
    assert isinstance(external, JointColumns)
    deviations = columns["external_joint_torques_sd"]
    assert isinstance(deviations, JointColumns)
    assert isinstance(wrenches, WrenchColumns)
    assert isinstance(points, PointColumns)
    assert isinstance(estimates, TableColumns)
    load_torques = LoadTorques(arm)
    torques = dict(zip(external.stamp_ns.tolist(), external.effort.tolist(), strict=True))
    sds = dict(zip(deviations.stamp_ns.tolist(), deviations.effort.tolist(), strict=True))
    speeds = dict(zip(motors.stamp_ns.tolist(), motors.velocity.tolist(), strict=True))
    hypotheses = {
        stamp: tuple(hypothesis(h.cover, h._asdict()) for h in hypotheses_of(table, arm.covers.names))
        for stamp, table in zip(estimates.stamp_ns.tolist(), tables(estimates), strict=True)
    }
    records = []
    for i, stamp in enumerate(joints.stamp_ns.tolist()):
        if stamp not in torques or stamp not in hypotheses:
            continue
        frame = wrenches.frames[i]
        in_contact_with_world = frame in arm.covers.names
        load = Load(
            frame if in_contact_with_world else "",
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
                torques=load_torques.torques(q, load),
                external=tuple(torques[stamp]),
                external_sd=tuple(sds[stamp]),
                in_contact=bool(hypotheses[stamp]),
                hypotheses=hypotheses[stamp],
            )
        )
    return Played(scenario, records, failure)


def _triple(row: np.ndarray) -> tuple[float, float, float]:
    x, y, z = row.tolist()
    return x, y, z
