"""Play a scenario without ROS and score what the estimator reports in every outer period against the simulator."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wam_description.arm import Arm
from wam_description.configuration import Configuration
from wam_description.parameters import ParameterError
from wam_description.rigid_body import Array, RigidBody
from wam_description.signals import Load
from wam_driver.safety import Mode
from wam_sim.simulation import Simulation
from wam_studies.contact.outcomes import (
    EVALUATION,
    ContactScore,
    EstimatedMoment,
    Mask,
    TrueContact,
    score_of,
    torque_errors,
)
from wam_studies.contact.scenarios import RANGES, BenchmarkScenario


class Played(NamedTuple):
    """A scenario with its moments, the true loads and external torques of each, and why it ended early."""

    scenario: BenchmarkScenario
    moments: list[EstimatedMoment]
    loads: list[Load]
    torques: list[tuple[float, ...]]
    failure: str


def play(configuration: Configuration, scenario: BenchmarkScenario) -> Played:
    """Play a scenario without ROS."""
    configured = configuration.with_values(scenario.values)
    try:
        run = Simulation(configured, scenario.steps)
    except ParameterError:  # the drawn arm is stiffer than the configured one; do what the refusal advises
        finer = {"timing.substeps": 2 * configured.shared.timing.substeps}
        run = Simulation(configured.with_values(finer), scenario.steps)
    body = RigidBody(configured.shared.arm)
    played = Played(scenario, [], [], [], "")
    done = False
    while not done:
        is_outer, stamp = run.driver.is_outer, run.driver.stamp
        joints = run.driver.true_joint_state
        load = run.driver.true_contact if is_outer else None
        done = run.step()
        if load is None:
            continue
        is_moving = max(map(abs, joints.velocity)) > EVALUATION.moving
        played.moments.append(EstimatedMoment(stamp * 1e-9, run.estimate, is_moving))
        played.loads.append(load)
        played.torques.append(torques_of(body, joints.position, load))
        if run.driver.safety.mode is Mode.FAULT:
            return played._replace(failure=run.driver.safety.fault)
    return played._replace(failure=run.scenario.failure)


def torques_of(body: RigidBody, q: Sequence[float], load: Load) -> tuple[float, ...]:
    """Torques on the joints, (n,), N m, of a load in pose q, rad."""
    if not load.cover:
        return (0.0,) * len(q)
    return tuple((np.concatenate((load.force, load.moment)) @ body.cover_jacobian(q, load.cover)).tolist())


def force_of(load: Load) -> float:
    """Size of a load's force, N."""
    return math.hypot(*load.force)


class Span(NamedTuple):
    """Moments `first` to `last` (included) of one true contact."""

    cover: str
    first: int
    last: int


def spans(loads: Sequence[Load]) -> list[Span]:
    """True contacts, in order of time."""
    found: list[Span] = []
    for i, load in enumerate(loads):
        if force_of(load) < EVALUATION.least_force:
            continue
        if found and found[-1].cover == load.cover and i - found[-1].last <= 1 + EVALUATION.gap:
            found[-1] = found[-1]._replace(last=i)
        else:
            found.append(Span(load.cover, i, i))
    return found


def score(played: Played, arm: Arm) -> ContactScore:
    """Score a scenario."""
    moments, contacts = played.moments, [_contact(played, span) for span in spans(played.loads)]
    return score_of(
        arm,
        moments,
        contacts,
        name=played.scenario.name,
        group=played.scenario.group,
        torques=torque_errors(moments, _truth(played), _settled(moments, contacts)),
        not_made=max(0, len(played.scenario.planned) - len(contacts)),
        failure=played.failure,
    )


def _contact(played: Played, span: Span) -> TrueContact:
    times, (cover, first, last) = [one.time for one in played.moments], span
    begin, end = times[first], times[last]
    planned = next((one for one in played.scenario.planned if one.begin - 0.05 <= begin <= one.end), None)
    kind, friction = (planned.kind, planned.friction) if planned else ("", np.nan)
    wait = EVALUATION.settled if played.scenario.group == "moving" else EVALUATION.settled_at_rest
    due = max((i for i in range(first, last) if times[i] - begin <= wait + 1e-9), default=first)
    load = played.loads[due] if played.loads[due].cover else played.loads[due - 1]
    hardest = max(map(force_of, played.loads[first : last + 1]))
    return TrueContact(
        kind, cover, load.position, force_of(load), friction, begin, end, first, due, last, times[max(first - 1, 0)],
        counts=end - begin >= EVALUATION.shortest - 1e-9 and hardest <= EVALUATION.greatest_force,
    )  # fmt: skip


def _settled(moments: Sequence[EstimatedMoment], contacts: Sequence[TrueContact]) -> Mask:
    """Moments away from the start and end of contacts, and from the observer's own transient."""
    times = np.array([one.time for one in moments])
    keep: Mask = times > times[0] + 0.2
    for contact in contacts:
        for edge in (contact.begin, contact.end):
            keep &= ~((times > edge - 0.02) & (times < edge + EVALUATION.edge))
    return keep


def _truth(played: Played) -> Array:
    """True external torques, (k, n); with dither the means over its cycle, as the estimate is one."""
    rows: Array = np.array(played.torques)
    if played.scenario.group != "dither":
        return rows
    count = round(RANGES.dither_cycle / (played.moments[1].time - played.moments[0].time))
    before = np.concatenate((np.repeat(rows[:1], count, axis=0), rows)).cumsum(axis=0)
    return (before[count:] - before[:-count]) / count
