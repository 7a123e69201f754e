"""Monte Carlo validation of the stability guard: random parameter sets, its verdicts, and simulated responses.

Two references: the exact integrator, which `wam_theory.friction_verdict` uses, too, with steps, contacts and initial
velocities of its own; and, not used by any guard, the testbed in MuJoCo, driver and velocity loop included, for
`wam_control.force.stability_guard`.
"""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from wam_control.force.force_loop import ForceCommand, ForceLoop, ForceLoopParameters
from wam_control.force.stability_guard import GuardAssessment
from wam_control.task.scenario import ScenarioStep
from wam_description.configuration import Configuration
from wam_description.parameters import parameter
from wam_sim.simulation import Simulation
from wam_studies.harness import Study
from wam_studies.scores import NONE_AT_ALL, Row, Scores, by_group, exact, grouped, percent, share
from wam_theory.friction_verdict import friction_verdict, linear_margin, stiction_cycle
from wam_theory.stick_slip import FrictionNode, IntegralLoop, Verdict, assess

RESTS, CYCLES, DIVERGES = "rests", "cycles", "diverges"
ENDS = (RESTS, CYCLES, DIVERGES)  # from good to bad
NODE, TESTBED = "one friction node, exact integrator", "testbed in MuJoCo behind its velocity loop"


@dataclass(frozen=True)
class ValidationLimits:
    """When a response has ended, and how the testbed is pressed."""

    events: tuple[int, ...] = (6000, 100_000)  # of the exact integrator; the second where the first do not decide
    before: float = 15.0  # N, on the testbed's spring before the step
    largest: float = 75.0  # N


LIMITS = ValidationLimits()


class NodeSet(NamedTuple):
    """A friction node under a loop: steps and initial velocities, as force of the contact; softer contacts."""

    node: FrictionNode
    loop: IntegralLoop
    steps: tuple[float, ...]
    velocities: tuple[float, ...]
    softer: tuple[float, ...]


class TestbedSet(NamedTuple):
    """A configuration of the testbed with a saturation, N, and a gain, as a part of the guard's margin."""

    configuration: Configuration
    limit: float
    margin: float
    part: float


class ValidationRecord(NamedTuple):
    """One parameter set: the guard's verdict and the end of the worst response."""

    where: str
    label: str
    domain: str
    is_accepted: bool
    end: str


def validate(case: NodeSet | TestbedSet) -> ValidationRecord:
    """The verdict of the guard and the end of the worst response."""
    return _of_node(case) if isinstance(case, NodeSet) else _of_testbed(case)


@dataclass(frozen=True)
class GuardStudy(Study[NodeSet | TestbedSet, ValidationRecord]):
    """Random nodes under random loops, and the testbed with random friction, gain, saturation and delay."""

    title = "verdicts of the stability guard compared with simulated responses"
    page = "docs/guard.md"
    seeds = (1,)
    base = "testbed"

    sets: int = parameter("random sets of gains for the exact integrator", low=1, default=200)
    testbed: int = parameter("random sets of gains for the testbed in MuJoCo", default=40)

    run = staticmethod(validate)

    def cases(self, seed: int) -> Iterator[NodeSet | TestbedSet]:
        """Nodes, then sets of the testbed."""
        yield from _nodes(seed, self.sets)
        yield from _testbeds(self.configuration, seed, self.testbed)

    def score(self, records: Sequence[ValidationRecord]) -> Scores:
        """Count the accepted sets that diverge and the refused ones that come to rest."""
        verdicts = "refused", "accepted"
        groups = grouped(records, lambda one: f"{one.where}, {one.domain}, {verdicts[one.is_accepted]}")
        return Scores(list(_rows(records)), [by_group("Verdicts and responses", dict(sorted(groups.items())), _ends)])

    def failure(self, record: ValidationRecord) -> str:
        """A sentence about an accepted set that diverges; '' otherwise."""
        return f"{record.label}, accepted, diverges" if record.is_accepted and record.end == DIVERGES else ""


def _rows(records: Sequence[ValidationRecord]) -> Iterator[Row]:
    for where, own in grouped(records, lambda one: one.where).items():
        bad = sum(one.is_accepted and one.end == DIVERGES for one in own)
        lost = sum(not one.is_accepted and one.end == RESTS for one in own)
        yield Row(f"accepted sets that diverge, {where}", exact(bad, len(own)), "sets", required=NONE_AT_ALL)
        yield percent(f"refused sets that come to rest, {where}", share(lost, len(own)))


def _ends(records: Sequence[ValidationRecord]) -> Iterator[Row]:
    counts = Counter(one.end for one in records)
    return (Row(end, exact(counts[end], len(records))) for end in ENDS)


def _nodes(seed: int, count: int) -> Iterator[NodeSet]:
    """Random nodes under random loops, with and without sampling, delay and stiction."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        node, loop = _random_node(random)
        steps = loop.error_limit * 10.0 ** random.uniform(-1.0, 2.0, 6)
        velocities = loop.error_limit * random.uniform(-5.0, 5.0, 2)
        softer = random.uniform(0.05, 1.0, 2).tolist()
        yield NodeSet(node, loop, tuple(steps.tolist()), tuple(velocities.tolist()), tuple(softer))


def _of_node(case: NodeSet) -> ValidationRecord:
    node, loop = case.node, case.loop
    found = friction_verdict(node, loop)
    ends = [
        _exact_end(replace(node, contact_stiffness=part * node.contact_stiffness), loop, step, velocity)
        for part in (1.0, *case.softer)
        for step, velocity in [*((step, 0.0) for step in case.steps), *((0.0, v) for v in case.velocities)]
    ]
    label = f"gain {loop.gain / linear_margin(node, loop):.2f} of the margin, delay {loop.delay_samples}"
    accepted = loop.error_limit <= found.stable_error
    return ValidationRecord(NODE, label, str(found.domain), accepted, max(ends, key=ENDS.index))


def _random_node(random: np.random.Generator) -> tuple[FrictionNode, IntegralLoop]:
    """Inertia and dynamic friction 1; half of the sets without stiction, half without sampling."""
    spans = ((-0.5, 0.5), (-0.7, 0.5), (-1.7, -0.3), (-0.5, 2.5))
    ktr, kc, zeta, limit = (float(10.0 ** random.uniform(*span)) for span in spans)
    frequency = math.sqrt(ktr + kc)
    static = 1.0 + float(random.choice([0.0, 0.4]) * random.random())
    node = FrictionNode(1.0, 2.0 * zeta * frequency, ktr, kc, 1.0, static)
    period = float(random.choice([0.0, random.uniform(0.1, 3.0) / frequency]))
    delay = int(random.integers(0, 3)) if period else 0
    loop = IntegralLoop(1.0, limit, sample_period=period, delay_samples=delay)
    return node, replace(loop, gain=linear_margin(node, loop) * float(random.uniform(0.3, 2.0)))


def _exact_end(node: FrictionNode, loop: IntegralLoop, step: float, velocity: float) -> str:
    """End of the response to a step of the force or to an initial velocity, given as force of the contact, N m."""
    speed = velocity / node.contact_stiffness * node.natural_frequency
    for events in LIMITS.events:
        found = assess(node, loop, step, start=(0.0, speed, 0.0), max_events=events)
        if found.verdict is not Verdict.UNDECIDED:
            break
    if found.verdict is Verdict.SETTLED:
        return RESTS
    if found.verdict is not Verdict.LIMIT_CYCLE:  # one that is not followed to its end has not come to rest
        return DIVERGES
    return _by_size(found.peak_to_peak, loop.error_limit, stiction_cycle(node, loop.gain).peak_to_peak)


def _by_size(peak_to_peak: float, limit: float, stiction: float) -> str:
    if peak_to_peak <= 2.0 * stiction:
        return RESTS
    return CYCLES if peak_to_peak <= limit + 2.0 * stiction else DIVERGES


def _testbeds(testbed: Configuration, seed: int, count: int) -> Iterator[TestbedSet]:
    """The testbed in MuJoCo with random friction, gain, saturation and delay; without winding heat."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        static, delay = float(random.uniform(0.05, 3.0)), int(random.integers(0, 2))
        dynamic = static * float(random.choice([1.0, 0.8]))
        base = testbed.with_values(
            {
                "arm.joints.static_friction": [static],
                "arm.joints.dynamic_friction": [dynamic],
                "driver:amplifier.thermal_time": 1e6,
                "force_loop:delay_samples": delay,
                "force_loop:guard.mode": "warn",
                "force_loop:force_gain": [0.01],
            }
        )
        margin = 0.01 * _assessment(base).scale
        part, limit = float(random.uniform(0.5, 1.9)), float(10.0 ** random.uniform(-0.3, 1.8))
        yield TestbedSet(base, limit, margin, part)


def _of_testbed(case: TestbedSet) -> ValidationRecord:
    gain, limit = case.margin * case.part, case.limit
    values = {"force_loop:force_gain": [gain], "force_loop:force_error_limit": [limit]}
    configuration = case.configuration.with_values(values)
    found = _assessment(configuration)
    noise = 0.5 + 3.0 * found.cycle.peak_to_peak  # N, of plant effects that one node does not have
    ends = [_plant_end(configuration, step, limit, gain, noise) for step in (0.5 * limit, 1.2 * limit, 6.0 * limit)]
    delay = configuration.node("force_loop", ForceLoopParameters).delay_samples
    label = f"gain {case.part:.2f} of the margin, delay {delay}"
    return ValidationRecord(TESTBED, label, str(found.domain), not found.reason, max(ends, key=ENDS.index))


def _assessment(configuration: Configuration) -> GuardAssessment:
    shared = configuration.shared
    loop = ForceLoop(shared.arm, shared.servo, configuration.node("force_loop", ForceLoopParameters), shared.timing)
    assert loop.supervision.assessment is not None
    return loop.supervision.assessment


def _plant_end(configuration: Configuration, step: float, limit: float, gain: float, noise: float) -> str:
    """End of the response to a step on the testbed."""
    force = min(LIMITS.before + step, LIMITS.largest)
    seconds = 3.5 + 1.3 * (force - LIMITS.before) / (gain * 900.0 * min(limit, force - LIMITS.before))
    steps = [
        ScenarioStep("release", 0.2, request="enable"),
        ScenarioStep("press", 1.5, force=ForceCommand("base", (0.0, 0.0, -LIMITS.before))),
        ScenarioStep("step", seconds, force=ForceCommand("base", (0.0, 0.0, -force))),
    ]
    run = Simulation(configuration, steps)
    if run.play():
        return DIVERGES
    force_z = np.array([row.values[2] for row in run.rows["force_measured"][-41:-1]])
    swing = float(np.ptp(force_z))
    return RESTS if swing <= 0.3 * limit + noise else DIVERGES
