"""The exact stick-slip integrator against small Runge-Kutta steps, energy, and the errata's numbers."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest

from wam_theory.friction_verdict import stiction_cycle
from wam_theory.stability_map import largest_stable_steps
from wam_theory.stick_slip import FrictionNode, IntegralLoop, Kind, Motion, Trajectory, Verdict, assess, simulate

# the testbed of 5.6 on the joint side, b for zeta = 0.05; lb-in and rad
TESTBED = (4.0, 2.0 * 0.05 * math.sqrt(4.0 * (14443.0 + 12960.0)), 14443.0, 12960.0)
TESTBED_MARGIN = {0: 1.73093e-3, 1: 4.8876e-3}  # linear limits at 50 Hz, as test_thesis_items has them


def unit_node(dynamic: float = 1.0, static: float | None = None) -> FrictionNode:
    """A node of zeta = 0.25 with K = J = b = 1: gamma is the gain."""
    return FrictionNode(1.0, 1.0, 2.0, 2.0, dynamic, dynamic if static is None else static)


def peaks(trajectory: Trajectory, force: float) -> list[float]:
    """Magnitude of the error at the start and at each standstill, repeats left out."""
    kinds = (Kind.START, Kind.STICK, Kind.REVERSE)
    return [abs(force - event.contact_force) for event in trajectory.events if event.kind in kinds]


State = tuple[float, float, float]


@dataclass
class SmallSteps:
    """Runge-Kutta steps with set-valued friction; shares nothing with the module but its parameters.

    The last step of a slip is bisected to the standstill, breakaway is interpolated in its step.
    """

    node: FrictionNode
    loop: IntegralLoop
    force: float
    held: float | None = None  # speed of the motor from the last sample, None in a continuous loop

    def contact(self, x: float) -> float:
        force = self.node.contact_stiffness * x
        return max(0.0, force) if self.node.unilateral else force

    def command(self, x: float) -> float:
        e = max(-self.loop.error_limit, min(self.loop.error_limit, self.force - self.contact(x)))
        return self.loop.gain * (e - max(-self.loop.deadband, min(self.loop.deadband, e)))

    def net(self, s: State) -> float:
        return self.node.transmission_stiffness * (s[2] - s[0]) - self.contact(s[0])

    def flow(self, s: State, sign: float) -> State:
        drag = self.node.damping * s[1] + self.node.dynamic_friction * sign
        speed = self.command(s[0]) if self.held is None else self.held
        return s[1], (self.net(s) - drag) / self.node.inertia, speed

    def kutta(self, s: State, h: float, sign: float) -> State:
        def along(d: State, part: float) -> State:
            return s[0] + part * d[0], s[1] + part * d[1], s[2] + part * d[2]

        k1 = self.flow(s, sign)
        k2 = self.flow(along(k1, h / 2), sign)
        k3 = self.flow(along(k2, h / 2), sign)
        k4 = self.flow(along(k3, h), sign)
        x, v, m = (a + h / 6 * (p + 2 * q + 2 * r + u) for a, p, q, r, u in zip(s, k1, k2, k3, k4, strict=True))
        return x, v, m

    def rest_sign(self, s: State) -> float:
        net = self.net(s)
        return 0.0 if abs(net) <= self.node.static_friction * (1 + 1e-12) else math.copysign(1.0, net)

    def stick(self, s: State, h: float) -> tuple[State, float, float]:
        """State, what is left of the step, and sign after it."""
        speed = self.flow(s, 0.0)[2]
        net, rate = self.net(s), self.node.transmission_stiffness * speed
        if abs(net + rate * h) <= self.node.static_friction:
            return (s[0], 0.0, s[2] + speed * h), 0.0, 0.0
        used = max(0.0, (math.copysign(self.node.static_friction, rate) - net) / rate)
        return (s[0], 0.0, s[2] + speed * used), h - used, math.copysign(1.0, rate)

    def slip(self, s: State, h: float, sign: float) -> tuple[State, float, float]:
        after = self.kutta(s, h, sign)
        if after[1] * sign >= 0.0:
            return after, 0.0, sign
        first, last = 0.0, h
        for _ in range(50):
            middle = (first + last) / 2
            if self.kutta(s, middle, sign)[1] * sign >= 0.0:
                first = middle
            else:
                last = middle
        used = h if first == 0.0 and s[1] == 0.0 else last  # it may not leave the standstill at all
        x, _, m = self.kutta(s, first, sign)
        return (x, 0.0, m), h - used, self.rest_sign((x, 0.0, m))

    def run(self, times: Sequence[float], step: float, start: State) -> np.ndarray:
        """x, v, x_m at the times, (n, 3)."""
        s, out, commands = start, [], [0.0] * self.loop.delay_samples
        sign = math.copysign(1.0, s[1]) if s[1] else self.rest_sign(s)
        each, now = round(self.loop.sample_period / step), 0
        for mark in [round(t / step) for t in times]:
            for count in range(now, mark):
                if each and count % each == 0:
                    commands.append(self.command(s[0]))
                    self.held = commands.pop(0)
                left = step
                while left > 1e-15:
                    s, left, sign = self.slip(s, left, sign) if sign else self.stick(s, left)
            now = mark
            out.append(s)
        return np.array(out)


REST = (0.0, 0.0, 0.0)
CASES = {
    "coulomb": (unit_node(), IntegralLoop(1.5), 4.0, REST),
    "stiction": (unit_node(0.7, 1.2), IntegralLoop(0.9), 3.0, REST),
    "frictionless from speed": (unit_node(0.0), IntegralLoop(0.6), -2.0, (0.3, -1.0, 0.1)),
    "saturated, with deadband": (unit_node(1.0, 1.3), IntegralLoop(2.6, 1.1, 0.05), 4.0, REST),
    "hold": (unit_node(0.4, 0.5), IntegralLoop(0.8, sample_period=0.35), 3.0, REST),
    "hold, two samples late, limited": (unit_node(0.4), IntegralLoop(0.5, 1.5, 0.1, 0.2, 2), 3.0, REST),
    "overdamped": (FrictionNode(1.0, 9.0, 2.0, 2.0, 0.3, 0.5), IntegralLoop(0.5, 1.0, 0.02), 2.0, (0.0, 1.0, 0.0)),
    "overdamped hold": (FrictionNode(1.0, 9.0, 2.0, 2.0, 0.3, 0.5), IntegralLoop(2.0, sample_period=1.0), 2.0, REST),
    "critical hold": (FrictionNode(1.0, 4.0, 2.0, 2.0, 0.3, 0.3), IntegralLoop(2.0, sample_period=0.5), 2.0, REST),
    "impact": (FrictionNode(1.0, 0.3, 2.0, 5.0, 0.1, 0.15, True), IntegralLoop(0.5), 1.0, (-1.0, 2.0, -1.0)),
    "rattle": (FrictionNode(1.0, 0.3, 2.0, 5.0, 0.02, 0.03, True), IntegralLoop(1.2, 2.0, 0.1), 0.6, REST),
    "rattle, held": (
        FrictionNode(1.0, 0.3, 2.0, 5.0, 0.02, 0.03, True),
        IntegralLoop(1.2, sample_period=0.1),
        0.6,
        REST,
    ),
    "triple root": (FrictionNode(1.0, math.sqrt(12.0), 2.0, 2.0, 0.2, 0.2), IntegralLoop(12**0.5 / 9), 2.0, REST),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_exact_motion_is_that_of_small_steps(name: str) -> None:
    node, loop, force, start = CASES[name]
    times = [0.5 * n for n in range(1, 41)]
    exact = simulate(node, loop, force, 20.0, start).at(times)
    rough = SmallSteps(node, loop, force).run(times, 0.001 if loop.sample_period else 1.0 / 1024, start)
    # a kink of the law or of the contact inside a step costs Runge-Kutta its order
    close = 1e-5 if loop.error_limit < math.inf or node.unilateral else 1e-8
    for exact_row, rough_row in zip((exact.x, exact.v, exact.x_m), rough.T, strict=True):
        np.testing.assert_allclose(exact_row, rough_row, rtol=0, atol=close)


def test_cases_reach_every_kind_of_event() -> None:
    seen = {event.kind for case in CASES.values() for event in simulate(*case[:3], 20.0, case[3]).events}
    assert seen == set(Kind)


def random_cases(count: int) -> list[tuple[FrictionNode, IntegralLoop, float]]:
    rng = np.random.default_rng(3)
    cases = []
    for _ in range(count):
        ktr, kc, inertia = rng.uniform(0.5, 4.0, 3)
        zeta = rng.choice([0.02, 0.3, 0.8, 1.5]) * rng.uniform(0.7, 1.3)
        damping = 2.0 * zeta * math.sqrt(inertia * (ktr + kc))
        dynamic = rng.uniform(0.1, 1.0)
        static = dynamic * rng.choice([1.0, 1.3])
        gain = rng.uniform(0.1, 2.0) * damping / inertia * (1.0 / ktr + 1.0 / kc)
        limit = rng.choice([math.inf, 1.0])
        deadband = rng.choice([0.0, 0.05])
        period = rng.choice([0.0, 0.0, 0.3])
        node = FrictionNode(inertia, damping, ktr, kc, dynamic, static, bool(rng.integers(2)))
        loop = IntegralLoop(gain, limit, deadband, period, int(rng.integers(3)) if period else 0)
        cases.append((node, loop, rng.uniform(0.2, 6.0)))
    return cases


def test_no_event_is_missed() -> None:
    for node, loop, force in random_cases(40):
        trajectory = simulate(node, loop, force, 40.0)
        times = np.linspace(0.0, 40.0, 2001)
        motion = trajectory.at(times)
        events = trajectory.events
        index = np.searchsorted([event.time for event in events], times, side="right") - 1
        signs = np.array([event.sign for event in events])[index]
        scale = 1e-9 * (1.0 + np.abs(motion.v).max())
        assert np.all(motion.v * signs >= -scale)
        assert np.all(np.abs(motion.v[signs == 0]) == 0.0)
        springs = node.transmission_stiffness * (motion.x_m - motion.x) - motion.contact_force
        assert np.all(np.abs(springs[signs == 0]) <= node.static_friction * (1.0 + 1e-9))


def test_energy_put_in_is_energy_stored_and_dissipated() -> None:
    nodes, weights = np.polynomial.legendre.leggauss(24)
    for name in ("coulomb", "stiction", "saturated, with deadband", "impact", "overdamped", "hold"):
        node, loop, force, start = CASES[name]
        until = 20.0
        trajectory = simulate(node, loop, force, until, start)
        edges = [event.time for event in trajectory.events] + [until]
        put_in = lost = 0.0
        for left, right in pairwise(edges):
            if right - left < 1e-14:
                continue
            fine = np.linspace(left, right, 5)
            for a, b in pairwise(fine):
                times = np.clip((a + b) / 2 + (b - a) / 2 * nodes, left, np.nextafter(right, 0.0))
                m = trajectory.at(times)
                weight = weights * (b - a) / 2
                shaped = np.clip(force - m.contact_force, -loop.error_limit, loop.error_limit)
                speed = loop.gain * (shaped - np.clip(shaped, -loop.deadband, loop.deadband))
                if loop.sample_period:
                    near = trajectory.at([left, (left + right) / 2])
                    speed = (near.x_m[1] - near.x_m[0]) / ((right - left) / 2)
                put_in += np.sum(weight * node.transmission_stiffness * (m.x_m - m.x) * speed)
                lost += np.sum(weight * (node.damping * m.v**2 + node.dynamic_friction * np.abs(m.v)))
        first, last = (stored(node, trajectory.at([t])) for t in (0.0, until))
        assert put_in - lost == pytest.approx(last - first, abs=1e-9)
        assert lost > 0.01


def stored(node: FrictionNode, motion: Motion) -> float:
    """Energy in inertia and both springs."""
    contact = 0.0 if node.unilateral and motion.x[0] < 0.0 else node.contact_stiffness
    stretch = motion.x_m[0] - motion.x[0]
    return 0.5 * (
        node.inertia * motion.v[0] ** 2 + contact * motion.x[0] ** 2 + node.transmission_stiffness * stretch**2
    )


def test_first_peaks_shrink_and_the_response_still_diverges() -> None:
    trajectory = simulate(unit_node(), IntegralLoop(1.5), 4.0, 400.0)
    assert peaks(trajectory, 4.0)[:5] == pytest.approx([4.00, 2.70, 2.94, 3.06, 3.24], abs=0.006)
    assert max(peaks(trajectory, 4.0)) > 1e4
    assert assess(unit_node(), IntegralLoop(1.5), 4.0).verdict is Verdict.DIVERGED


@pytest.mark.slow
@pytest.mark.parametrize(("gamma", "largest"), [(1.1, 25.3), (1.5, 3.45), (2.0, 1.17)])
def test_largest_stable_step_of_domain_two(gamma: float, largest: float) -> None:
    node, loop = unit_node(), IntegralLoop(gamma)
    found = float(largest_stable_steps(gamma, 0.25))
    assert found == pytest.approx(largest, rel=0.005)
    # small steps alone, just on either side: what is left of the error at the end of a long run
    for step, stable in ((0.99 * found, True), (1.01 * found, False)):
        ends = SmallSteps(node, loop, step).run([60.0, 120.0, 180.0, 240.0, 300.0], 1.0 / 64, REST)
        spans = np.abs(step - 2.0 * ends[:, 0])
        assert bool(spans[-1] < 0.2 * step) is stable, spans


def test_early_verdicts_are_those_of_long_runs() -> None:
    rng = np.random.default_rng(11)
    seen = set()
    for _ in range(60):
        gamma, step = rng.uniform(0.2, 2.5), 10.0 ** rng.uniform(-1.0, 1.7)
        zeta = 10.0 ** rng.uniform(-1.3, 0.2)
        static = rng.choice([1.0, 1.0, 1.4])
        damping = 4.0 * zeta
        node, loop = FrictionNode(1.0, damping, 2.0, 2.0, 1.0, static), IntegralLoop(gamma * damping)
        outcome = assess(node, loop, step)
        long = simulate(node, loop, step, 1e300, max_events=800)
        late = peaks(long, step)[-2:]
        seen.add(outcome.verdict)
        if outcome.verdict is Verdict.DIVERGED:
            assert max(late) > 100.0 * step, (gamma, zeta, step)
        elif outcome.verdict is Verdict.SETTLED:
            assert long.ended or max(late) < 1e-2 * step, (gamma, zeta, step)
        else:
            assert outcome.verdict is Verdict.LIMIT_CYCLE
            assert static > 1.0
            span = max(e.contact_force for e in long.events[-40:]) - min(e.contact_force for e in long.events[-40:])
            assert span == pytest.approx(outcome.peak_to_peak, rel=1e-6)
    assert seen == {Verdict.DIVERGED, Verdict.SETTLED, Verdict.LIMIT_CYCLE}


def test_a_force_that_still_rises_in_even_steps_is_not_in_a_cycle_yet() -> None:
    node, loop = FrictionNode(1.0, 0.06, 1.2, 0.08, 1.0, 1.07), IntegralLoop(0.14, 0.5, sample_period=0.5)
    assert assess(node, loop, 30.0, max_events=3000).verdict is Verdict.UNDECIDED
    cycle = assess(node, loop, 30.0)
    assert cycle.verdict is Verdict.LIMIT_CYCLE
    assert cycle.peak_to_peak == pytest.approx(stiction_cycle(node, loop.gain).peak_to_peak, rel=0.02)


def test_saturation_lets_a_destabilising_step_survive() -> None:
    for step in (4.0, 40.0):
        assert assess(unit_node(), IntegralLoop(1.5), step).verdict is Verdict.DIVERGED
        assert assess(unit_node(), IntegralLoop(1.5, error_limit=1.0), step).verdict is Verdict.SETTLED


def testbed(friction: float) -> FrictionNode:
    return FrictionNode(*TESTBED, friction, friction)


testbed.__test__ = False  # type: ignore[attr-defined]


@pytest.mark.parametrize("delay", [0, 1])
def test_sampled_loop_without_friction_diverges_beyond_its_linear_limit(delay: int) -> None:
    margin = TESTBED_MARGIN[delay]
    for factor, verdict in ((0.98, Verdict.SETTLED), (1.02, Verdict.DIVERGED)):
        assert assess(testbed(0.0), IntegralLoop(factor * margin, math.inf, 0.0, 0.02, delay), 36.0).verdict is verdict


def test_one_sample_more_reverses_what_friction_does() -> None:
    late = IntegralLoop(0.9 * TESTBED_MARGIN[1], sample_period=0.02, delay_samples=1)
    assert assess(testbed(0.0), late, 4.0).verdict is Verdict.SETTLED
    assert assess(testbed(8.4), late, 4.0).verdict is Verdict.LIMIT_CYCLE
    prompt = IntegralLoop(1.5 * TESTBED_MARGIN[0], sample_period=0.02)
    assert assess(testbed(0.0), prompt, 4.0).verdict is Verdict.DIVERGED
    assert assess(testbed(8.4), prompt, 4.0).verdict is Verdict.SETTLED
