"""Monte Carlo validation of the stability guard: random parameter sets, its verdicts, and simulated responses.

Two references that the guard does not use: the exact integrator, with steps and initial velocities of its own, for
`wam_control.force.friction_verdict`; and the testbed in MuJoCo, driver and velocity loop included, for
`wam_control.force.stability_guard`.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wam_analysis.table import plain
from wam_control.force.force_loop import ForceCommand, ForceLoop, ForceLoopParameters
from wam_control.force.friction_verdict import friction_verdict, linear_margin, stiction_cycle
from wam_control.force.stability_guard import GuardAssessment
from wam_control.task.scenario import ScenarioStep
from wam_description.configuration import Configuration, packaged
from wam_sim.simulation import Simulation
from wam_theory.stick_slip import FrictionNode, IntegralLoop, Verdict, assess, simulate

RESTS, CYCLES, DIVERGES = "rests", "cycles", "diverges"
ENDS = (RESTS, CYCLES, DIVERGES)  # from good to bad
EVENTS = 6000
SHORTEST = 20  # events around F_des, below which a response is still in its transient
GROWTH = 1.1  # of the last quarter over the one before, above which a response grows


class Trial(NamedTuple):
    """One parameter set: the guard's verdict and the end of the worst response."""

    label: str
    domain: str
    is_accepted: bool
    end: str


def exact_trials(seed: int, count: int) -> Iterator[Trial]:
    """Random nodes under random loops, with and without sampling, delay and stiction."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        node, loop = _random_node(random)
        found = friction_verdict(node, loop)
        steps = loop.error_limit * 10.0 ** random.uniform(-1.0, 2.0, 6)
        velocities = loop.error_limit * random.uniform(-5.0, 5.0, 2)
        softer = random.uniform(0.05, 1.0, 2).tolist()
        ends = [
            _exact_end(replace(node, contact_stiffness=part * node.contact_stiffness), loop, step, velocity)
            for part in (1.0, *softer)
            for step, velocity in [*((s, 0.0) for s in steps.tolist()), *((0.0, v) for v in velocities.tolist())]
        ]
        label = f"gain {loop.gain / linear_margin(node, loop):.2f} of the margin, delay {loop.delay_samples}"
        accepted = loop.error_limit <= found.stable_error
        yield Trial(label, str(found.domain), accepted, max(ends, key=ENDS.index))


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
    frequency = math.sqrt((node.transmission_stiffness + node.contact_stiffness) / node.inertia)
    speed = velocity / node.contact_stiffness * frequency
    found = assess(node, loop, step, start=(0.0, speed, 0.0), max_events=EVENTS)
    if found.verdict is Verdict.SETTLED:
        return RESTS
    stiction = stiction_cycle(node, loop.gain).peak_to_peak
    if found.verdict is Verdict.LIMIT_CYCLE:
        return _by_size(found.peak_to_peak, loop.error_limit, stiction)
    if found.verdict is Verdict.DIVERGED:
        return DIVERGES
    events = simulate(node, loop, step, max(found.time, 1e-9), (0.0, speed, 0.0), EVENTS).events
    errors = step - np.array([event.contact_force for event in events])
    passes = np.flatnonzero(np.diff(np.sign(errors)))
    around = errors[passes[0] :] if passes.size else errors[:0]  # before it is the transient
    quarter = len(around) // 4
    if quarter < SHORTEST:
        return RESTS
    late, before = np.ptp(around[-quarter:]), np.ptp(around[-2 * quarter : -quarter])
    if late > GROWTH * before and late > loop.error_limit:
        return DIVERGES
    return _by_size(float(late), loop.error_limit, stiction)


def _by_size(peak_to_peak: float, limit: float, stiction: float) -> str:
    if peak_to_peak <= 2.0 * stiction:
        return RESTS
    return CYCLES if peak_to_peak <= limit + 2.0 * stiction else DIVERGES


BEFORE = 15.0  # N, on the testbed's spring before the step
LARGEST = 75.0  # N


def testbed_trials(seed: int, count: int) -> Iterator[Trial]:
    """The testbed in MuJoCo with random friction, gain, saturation and delay; without winding heat."""
    random = np.random.default_rng(seed)
    testbed = Configuration.load(packaged("testbed"))
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
        conf = base.with_values({"force_loop:force_gain": [margin * part], "force_loop:force_error_limit": [limit]})
        found = _assessment(conf)
        noise = 0.5 + 3.0 * found.cycle.peak_to_peak  # N, of plant effects that one node does not have
        ends = [_plant_end(conf, step, limit, margin * part, noise) for step in (0.5 * limit, 1.2 * limit, 6.0 * limit)]
        label = f"gain {part:.2f} of the margin, delay {delay}"
        yield Trial(label, str(found.domain), not found.reason, max(ends, key=ENDS.index))


def _assessment(configuration: Configuration) -> GuardAssessment:
    shared = configuration.shared
    loop = ForceLoop(shared.arm, shared.servo, configuration.node("force_loop", ForceLoopParameters), shared.timing)
    assert loop.assessment is not None
    return loop.assessment


def _plant_end(configuration: Configuration, step: float, limit: float, gain: float, noise: float) -> str:
    """End of the response to a step on the testbed."""
    force = min(BEFORE + step, LARGEST)
    seconds = 3.5 + 1.3 * (force - BEFORE) / (gain * 900.0 * min(limit, force - BEFORE))
    steps = [
        ScenarioStep("release", 0.2, request="enable"),
        ScenarioStep("press", 1.5, force=ForceCommand("base", (0.0, 0.0, -BEFORE))),
        ScenarioStep("step", seconds, force=ForceCommand("base", (0.0, 0.0, -force))),
    ]
    run = Simulation(configuration, steps)
    if run.play():
        return DIVERGES
    force_z = np.array([row.values[2] for row in run.rows["force_measured"][-41:-1]])
    swing = float(np.ptp(force_z))
    return RESTS if swing <= 0.3 * limit + noise else DIVERGES


class ValidationTable(NamedTuple):
    """Counts of trials by domain, verdict and end, and the two kinds of error."""

    counts: dict[tuple[str, bool, str], int]
    accepted_and_diverged: int
    refused_and_stable: int

    def text(self) -> str:
        """The table as text."""
        kinds = [(domain, accepted) for domain in ("I", "II", "III") for accepted in (True, False)]
        counts = [[self.counts.get((*kind, end), 0) for end in ENDS] for kind in kinds]
        rows = [
            [domain, "accepts" if accepted else "refuses", *map(str, row)]
            for (domain, accepted), row in zip(kinds, counts, strict=True)
            if any(row)
        ]
        lines = plain([["domain", "guard", *ENDS]], rows, left=(0, 1))
        total = sum(self.counts.values())
        lines.append(
            f"{total} sets: {self.accepted_and_diverged} accepted that diverge, "
            f"{self.refused_and_stable} refused that come to rest"
        )
        return "\n".join(lines)


def table(trials: Iterator[Trial], seen: Callable[[Trial], None] = lambda _: None) -> ValidationTable:
    """Count trials; `seen` is called with each, to show progress."""
    counts: Counter[tuple[str, bool, str]] = Counter()
    for trial in trials:
        counts[trial.domain, trial.is_accepted, trial.end] += 1
        seen(trial)
    bad = sum(n for (_, accepted, end), n in counts.items() if accepted and end == DIVERGES)
    lost = sum(n for (_, accepted, end), n in counts.items() if not accepted and end == RESTS)
    return ValidationTable(dict(counts), bad, lost)
