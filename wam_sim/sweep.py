"""One scenario with many parameter sets: how well each holds the commanded force."""

import math
from bisect import bisect_right
from collections.abc import Sequence
from itertools import groupby, product
from typing import Any, NamedTuple

import numpy as np

from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.task.scenario import FORCE_LOOP, ScenarioStep, require_playable
from wam_description.configuration import Configuration
from wam_description.parameters import ParameterError
from wam_description.rigid_body import RigidBody
from wam_description.signals import BASE
from wam_description.wiring import raised
from wam_sim.bus import TopicValue
from wam_sim.reactions import (
    BRIEF,
    SETTLING_TIME,
    STEADY,
    RecordedReaction,
    doubts,
    too_short,
    unassessed,
    watched_times,
)
from wam_sim.simulation import Simulation

MOST_SETS = 100_000  # of a sweep: their configurations take a gigabyte
SETTLED = 0.5  # part of the time of one commanded force, after which the error counts as settled


class Axis(NamedTuple):
    """A parameter of a sweep, as `Configuration.with_values` names it, and its values; a random one has two ends."""

    name: str
    values: tuple[Any, ...]


class SweepPoint(NamedTuple):
    """One run: values of the configuration and the scenario."""

    configuration: Configuration
    steps: tuple[ScenarioStep, ...]


class SweepResult(NamedTuple):
    """What a run gave; the forces are along the commanded direction and true, as only the simulator knows them.

    Attributes
    ----------
    failure : why the scenario failed, the parameters were refused, or what a step commands was not carried out; ''
        where nothing was.
    duration : of the arm's time, s.
    force_rms, force_worst : of commanded minus true force in the settled part of each commanded force that was not
        refused there, N.
    force_peak : largest true force, N.
    unassessed : commands that last too briefly: forces to be steady, tasks to be reported as not reached; and forces
        that were refused, or that another link hides, which bears more; '' for none.
    reported : parameters that the guard lowered; steps that count as carried out, and what the force loop reported at
        the end of each: the measured force may not be the true one; '' for nothing.
    """

    failure: str
    duration: float = 0.0
    force_rms: float = math.nan
    force_worst: float = math.nan
    force_peak: float = math.nan
    unassessed: str = ""
    reported: str = ""


def grid(axes: Sequence[Axis]) -> list[tuple[Any, ...]]:
    """Every combination of the values.

    Raises
    ------
    ValueError
        where there are more than `MOST_SETS`.
    """
    count = math.prod(len(axis.values) for axis in axes)
    if count > MOST_SETS:
        counts = ", ".join(f"{axis.name}: {len(axis.values)}" for axis in axes)
        raise ValueError(f"{count} sets in all, {counts}; at most {MOST_SETS} are played: give fewer values")
    return list(product(*(axis.values for axis in axes)))


def listed(axes: Sequence[Axis]) -> list[tuple[Any, ...]]:
    """The first values together, then the second ones and so on.

    Raises
    ------
    ValueError
        where one axis has more values than another.
    """
    if len({len(axis.values) for axis in axes}) > 1:
        counts = ", ".join(f"{axis.name}: {len(axis.values)}" for axis in axes)
        raise ValueError(f"a list needs the same number of values for each parameter; given: {counts}")
    return list(zip(*(axis.values for axis in axes), strict=True))


def drawn(axes: Sequence[Axis], count: int, seed: int) -> list[tuple[Any, ...]]:
    """Values drawn at random between the two ends of each axis, by their logarithm where both are above 0.

    Raises
    ------
    ValueError
        where an axis has not two numbers that rise.
    """
    random = np.random.default_rng(seed)
    for name, values in axes:
        if len(values) != 2 or not all(isinstance(v, (int, float)) for v in values) or not values[0] < values[1]:
            raise ValueError(
                f"{name} has the values {values}; a random sweep needs two numbers, the lowest and the highest"
            )
    return [
        tuple(
            float(low * (high / low) ** part) if low > 0.0 else float(low + (high - low) * part)
            for part, (_, (low, high)) in zip(random.random(len(axes)), axes, strict=True)
        )
        for _ in range(count)
    ]


def points(
    configuration: Configuration, steps: Sequence[ScenarioStep], axes: Sequence[Axis], sets: Sequence[Sequence[Any]]
) -> list[SweepPoint]:
    """The runs of these parameter sets.

    Raises
    ------
    ParameterError
        where the configuration has no such parameter.
    """
    names = [axis.name for axis in axes]
    named = (dict(zip(names, values, strict=True)) for values in sets)
    return [SweepPoint(configuration.with_values(values), tuple(steps)) for values in named]


def outcome(point: SweepPoint) -> SweepResult:
    """Play the scenario and measure; refused parameters are a failure of this run alone."""
    try:
        run = Simulation(point.configuration, point.steps)
        require_playable("the scenario", point.steps, point.configuration)
        failure = run.play()
    except ParameterError as error:
        return SweepResult(str(error))
    except Exception as error:  # other runs go on
        return SweepResult(f"unexpected {raised(error)}")
    reactions, played = run.reactions, run.played
    measured = _measured(run, [failure, run.unmet])
    brief = filter(None, (measured.unassessed, _unassessed(run)))
    lowered = getattr(run.nodes.get(FORCE_LOOP), "lowered", "")
    reports = [f"the guard lowered it; used: {lowered}"] * bool(lowered)
    reports += [f"{one.name}: {why.name}" for one in played if one.step.commands_arm for why in doubts(reactions, one)]
    return measured._replace(unassessed="; ".join(dict.fromkeys(brief)), reported="; ".join(dict.fromkeys(reports)))


def _measured(run: Simulation, failures: Sequence[str]) -> SweepResult:
    body, reactions = RigidBody(run.configuration.shared.arm), run.reactions
    truth = {row.stamp: row for row in run.rows.get("sim/contact/wrench", [])}
    joints = {row.stamp: row.values[: len(body.arm.joints.names)] for row in run.rows.get("sim/joint_states", [])}
    errors: list[float] = []
    brief: list[str] = []
    axes = run.rows.get("force_axis", [])
    commands = [row for row in run.rows.get("force_command", []) if row.stamp in truth]
    for (_, *force), rows in groupby(commands, key=lambda row: (row.frame, *row.values)):
        held = list(rows)
        settled = held[int(SETTLED * len(held)) :]
        if not any(force[:3]):
            continue
        command = f"{math.hypot(*force[:3]):.3g} N in {held[0].frame}"
        if refusal := _refusal(reactions, settled[0].stamp, settled[-1].stamp):
            brief.append(f"{command} refused: {refusal}")
            continue
        if BRIEF < held[-1].stamp - held[0].stamp < 1e9 * STEADY - BRIEF:  # no sample of a chirp
            brief.append(f"{command}: commanded for less than {STEADY:g} s")
        seen = [row for row in settled if _is_seen(row, truth[row.stamp], axes)]
        if len(seen) < len(settled):
            part = 100.0 * (1.0 - len(seen) / len(settled))
            brief.append(f"{command}: another link bears more in {part:.0f} % of its steady state")
        errors += [_error(body, joints[row.stamp], row, truth[row.stamp]) for row in seen]
    peak = max((math.hypot(*row.values[:3]) for row in truth.values()), default=0.0)
    rms = math.sqrt(sum(e * e for e in errors) / len(errors)) if errors else math.nan
    failure = "; ".join(filter(None, failures))
    largest = max(map(abs, errors), default=math.nan)
    return SweepResult(failure, run.driver.stamp * 1e-9, rms, largest, peak, "; ".join(dict.fromkeys(brief)))


def _refusal(reactions: Sequence[RecordedReaction], begin: int, end: int) -> str:
    """Why the force loop did not control a force between two times, ns; '' where it did."""
    return next((one.reason for one in reactions if one.holds and one.begin <= end and one.end > begin), "")


def _unassessed(run: Simulation) -> str:
    """Steps whose task commands a force, a torque or a motion too briefly to be assessed; '' where none was."""
    if FORCE_LOOP not in run.configuration.shared.nodes:
        return ""
    played = run.played
    settling = [(0, run.configuration.node(FORCE_LOOP, ForceLoopParameters).limits.settling_time)]
    settling += [
        (one.begin, setting.value)
        for one in played
        for setting in one.step.settings
        if (setting.node, setting.name) == (FORCE_LOOP, SETTLING_TIME) and isinstance(setting.value, (int, float))
    ]
    times = watched_times((one.step.task, one.begin, one.end) for one in played)
    brief = unassessed(run.reactions, times, played, settling)
    return f"{', '.join(one.name for one in brief)}: {too_short(settling, brief)}" if brief else ""


def _is_seen(command: TopicValue, true: TopicValue, axes: Sequence[TopicValue]) -> bool:
    """Whether the true force, that on the link which bears most, is the one that is commanded.

    A force in the frame of the base is commanded on the link that the last `force_axis` has.
    """
    link = command.frame
    if link == BASE and (row := bisect_right(axes, command.stamp, key=lambda one: one.stamp)):
        link = axes[row - 1].frame
    return BASE in (link, true.frame) or link == true.frame


def _error(body: RigidBody, q: Sequence[float], command: TopicValue, true: TopicValue) -> float:
    """Commanded minus true force along the commanded one, N; nothing that is touched holds nothing."""
    force, acting = (
        np.array(row.values[:3]) if row.frame == BASE else body.cover_pose(q, row.frame).rotation @ row.values[:3]
        for row in (command, true)
    )
    size = float(np.linalg.norm(force))
    return size + float(force @ acting) / size
