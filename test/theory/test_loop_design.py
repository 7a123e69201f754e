"""A force loop of one's own: margin, domain and safe error against computations that share no code with it."""

import math
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wam_theory.friction_verdict import Domain
from wam_theory.loop_design import loop_design
from wam_theory.rounding import rounded_down, rounded_up
from wam_theory.stick_slip import FrictionNode, IntegralLoop
from wam_theory.thresholds import DESIGN


@pytest.mark.parametrize("value", [0.00518, 0.000702, 6.85, 80.6, 1.09e-05, 0.0])
def test_a_number_of_three_digits_stays_as_it_is(value: float) -> None:
    assert (rounded_down(value), rounded_up(value)) == (value, value)
    assert rounded_down(1.0001 * value) == value


SOFTER = np.geomspace(0.03, 1.0, 12)


def spectral_radius(node: FrictionNode, gain: float, period: float, delay: int, contact: float) -> float:
    """Of the loop from sample to sample, without friction: state x, v, x_m and the commands under way."""
    n = 3 + delay
    rate = np.zeros((4, 4))  # x, v, x_m, held speed
    rate[0, 1] = rate[2, 3] = 1.0
    rate[1, :3] = -(node.transmission_stiffness + contact), -node.damping, node.transmission_stiffness
    rate[1] /= node.inertia
    held, term = np.eye(4), np.eye(4)
    for k in range(1, 60):  # the exponential of a 2^10th of the period, then squared
        term = term @ rate * (period / 1024) / k
        held = held + term
    held = np.linalg.matrix_power(held, 1024)
    step = np.zeros((n, n))
    step[:3, :3] = held[:3, :3]
    command = np.zeros(n)
    command[0] = -gain * contact
    if delay:
        step[:3, 3] = held[:3, 3]  # the oldest command
        step[3 : n - 1, 4:n] = np.eye(delay - 1)
        step[n - 1] = command
    else:
        step[:3] += np.outer(held[:3, 3], command)
    return float(max(abs(np.linalg.eigvals(step))))


def late_motion(node: FrictionNode, loop: IntegralLoop, force: float, seconds: float) -> tuple[float, float]:
    """Largest speed, m/s, and swing of F_c, N, in the last quarter, by small explicit steps of the sampled loop."""
    dt = 1e-4
    each = round(loop.sample_period / dt)
    pending = [0.0] * loop.delay_samples
    x, v, motor, speed, late = 0.0, 0.0, 0.0, 0.0, []
    for k in range(round(seconds / dt)):
        if k * dt > 0.75 * seconds:
            late.append((abs(v), node.contact_stiffness * x))
        if k % each == 0:
            error = force - node.contact_stiffness * x
            pending.append(loop.gain * min(max(error, -loop.error_limit), loop.error_limit))
            speed = pending.pop(0)
        motor += speed * dt
        drive = node.transmission_stiffness * (motor - x) - node.contact_stiffness * x - node.damping * v
        if v == 0.0 and abs(drive) <= node.static_friction:
            continue
        direction = math.copysign(1.0, v or drive)
        after = v + (drive - node.dynamic_friction * direction) / node.inertia * dt
        v = 0.0 if v and after * v <= 0.0 else after
        x += v * dt
        if abs(x) > 1e3:
            return np.inf, np.inf
    return max(late)[0], float(np.ptp(late, axis=0)[1])


@pytest.mark.parametrize("seed", range(4))
def test_the_margin_is_where_an_eigenvalue_of_the_delayed_sampled_loop_leaves_the_unit_circle(seed: int) -> None:
    random = np.random.default_rng(1500 + seed)
    inertia, ktr, kc = (float(10.0 ** random.uniform(*span)) for span in ((-2, 1), (2, 4), (2, 4)))
    damping = float(random.uniform(0.05, 1.0) * np.sqrt((ktr + kc) * inertia))
    rate, delay = float(random.uniform(0.5, 20.0) * np.sqrt((ktr + kc) / inertia)), int(random.integers(0, 4))
    node = FrictionNode(inertia, damping, ktr, kc, 0.1, 0.1)
    margin = loop_design(node, IntegralLoop(1e-3), rate, delay / rate).verdict.margin
    radii = [
        [spectral_radius(node, part * margin, 1.0 / rate, delay, share * kc) for share in SOFTER]
        for part in (0.99, 1.01)
    ]
    assert max(radii[0]) < 1.0
    assert max(radii[1]) > 1.0


NODE = FrictionNode(0.1, 10.0, 2000.0, 1000.0, 0.5, 0.5)
RATE, DELAY = 500.0, 0.002


def of_margin(part: float, node: FrictionNode = NODE, limit: float = np.inf) -> IntegralLoop:
    margin = loop_design(node, IntegralLoop(1e-3), RATE, DELAY).verdict.margin
    return IntegralLoop(part * margin, error_limit=limit)


@pytest.fixture
def with_this_contact_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Softer contacts, which the test of the margin has, are left out: each takes seconds."""
    monkeypatch.setattr("wam_theory.friction_verdict.DESIGN", replace(DESIGN, softer=(1.0,)))


@pytest.mark.slow
def test_in_domain_ii_the_safe_error_creeps_to_its_end_in_a_direct_simulation_and_far_more_does_not() -> None:
    found = loop_design(NODE, of_margin(1.2), RATE, DELAY)
    assert found.verdict.domain is Domain.II
    assert not found.is_safe
    advised = float(re.findall(r"saturate the error at ([\d.e-]+)", found.text())[0])
    assert advised == pytest.approx(found.verdict.stable_error, rel=0.01)
    safe = loop_design(NODE, of_margin(1.2, limit=advised), RATE, DELAY)
    assert safe.is_safe
    force = 3.0 * safe.loop.error_limit
    assert late_motion(NODE, safe.loop, force, 2.0)[0] < 0.005
    assert late_motion(NODE, replace(safe.loop, error_limit=1e4), 100.0 * NODE.static_friction, 2.0)[0] > 1.0


@pytest.mark.slow
@pytest.mark.parametrize("gain", [0.05, 0.1])
def test_the_stiction_cycle_of_a_delayed_loop_is_printed_as_it_is_too_and_makes_it_not_unsafe(gain: float) -> None:
    node = replace(NODE, static_friction=0.6)
    found = loop_design(node, IntegralLoop(gain, 2.0), RATE, DELAY)
    _, swing = late_motion(node, found.loop, 5.0, 30.0)
    assert swing > 1.15 * found.verdict.cycle.peak_to_peak
    printed = re.findall(r"by \(5.8\), \(5.9\), ([\d.e-]+) by simulation; a deadband", found.text())
    assert [float(size) for size in printed] == pytest.approx([swing], rel=0.02)
    assert found.is_safe


@pytest.mark.slow
@pytest.mark.usefixtures("with_this_contact_alone")
def test_a_loop_that_is_sampled_fast_has_the_domain_of_the_continuous_one() -> None:
    node, loop = FrictionNode(0.1, 0.1, 1000.0, 1000.0, 1.0, 1.0), IntegralLoop(0.01)
    found = [loop_design(node, loop, rate).verdict for rate in (0.0, 1e3, 1e10)]
    assert {one.domain for one in found} == {Domain.II}
    assert [one.stable_error for one in found] == pytest.approx([found[0].stable_error] * 3)
    assert [one.margin for one in found] == pytest.approx([2e-3] * 3, rel=1e-2)


@pytest.mark.slow
@pytest.mark.usefixtures("with_this_contact_alone")
def test_a_response_that_is_not_followed_to_its_end_is_undecided_and_its_loop_neither_safe_nor_called_unstable(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("wam_theory.loop_design.DESIGN", replace(DESIGN, patient_events=400))  # 20 ms of these samples
    margin = loop_design(NODE, IntegralLoop(1e-3), 2e4, 5e-4).verdict.margin
    found = loop_design(NODE, IntegralLoop(1.05 * margin, error_limit=1.0), 2e4, 5e-4)
    assert found.verdict.domain is Domain.BEYOND
    assert found.verdict.stable_error == 0.0
    assert found.verdict.undecided_error > 1.0
    assert not found.is_safe
    assert "not shown to be safe" in found.text()
    assert "400 events" in found.text()


def test_a_delay_is_rounded_up_to_whole_periods() -> None:
    assert loop_design(NODE, of_margin(0.5), RATE, 0.002).loop.delay_samples == 1
    assert loop_design(NODE, of_margin(0.5), RATE, 0.0021).loop.delay_samples == 2


@pytest.mark.parametrize(("changed", "rate", "delay", "text"), [
    ({"damping": 0.0}, 500.0, 0.0, "damping is 0; without damping no gain is stable"),
    ({}, 0.0, 0.01, "give the rate of the samples"),
    ({}, -1.0, 0.0, "rate is -1; it must be 0 or more"),
    ({}, 1000.0, 1.0, "allowed: 50 periods"),
    ({"inertia": 1e300}, 500.0, 0.0, r"inertia is 1e\+300; it must be between 1e-12 and 1e\+12"),
    ({"contact_stiffness": 1e-20}, 0.0, 0.0, "contact_stiffness is 1e-20; it must be between"),
    ({}, 1e15, 0.0, r"rate is 1e\+15; it must be between"),
])  # fmt: skip
def test_a_plant_beyond_computation_is_refused(changed: dict[str, float], rate: float, delay: float, text: str) -> None:
    with pytest.raises(ValueError, match=text):
        loop_design(replace(NODE, **changed), IntegralLoop(0.01), rate, delay)


def test_numbers_that_overflow_together_are_refused_by_the_one_that_is_farthest_off() -> None:
    node = FrictionNode(1e-9, 1e-9, 1e12, 1e12, 1e-9, 1e-9)
    with pytest.raises(ValueError, match=r"transmission_stiffness is 1e\+12; compared with the other numbers"):
        loop_design(node, IntegralLoop(1e-9), 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("part", [0.85, 0.995, 1.005])
def test_a_gain_close_to_the_margin_is_warned_of_and_the_one_that_is_advised_is_not(part: float) -> None:
    margin = loop_design(NODE, IntegralLoop(1e-3), RATE, DELAY).verdict.margin
    text = loop_design(NODE, IntegralLoop(part * margin), RATE, DELAY).text()
    assert "assumed: the motor follows its commanded velocity at once" in text
    assert ("close to the margin" in text) == (0.9 < part <= 1.0)
    assert ("not safe" in text) == (part > 1.0)
    if part > 0.9:
        advised = float(re.findall(r"lower the gain to ([\d.e-]+), 0.9 of the largest", text)[0])
        assert 0.89 * margin < advised <= 0.9 * margin
        assert "lower" not in loop_design(NODE, IntegralLoop(advised), RATE, DELAY).text()


@pytest.mark.slow
def test_the_command_prints_the_verdict_and_draws_the_map(tmp_path: Path) -> None:
    words = "guard --inertia .1 --damping 10 --transmission 2000 --contact 1000 --friction .5 --stiction .5 --gain .15"
    command = [sys.executable, "-m", "wam_cli.main", *words.split(), "--rate", "500", "--delay", "0.002"]
    done = subprocess.run(
        [*command, "--picture", str(tmp_path / "map.png")], check=False, capture_output=True, text=True
    )
    assert done.returncode == 1, done.stderr
    assert "domain I" in done.stdout
    assert "not safe: lower the gain to" in done.stdout
    assert (tmp_path / "map.png").stat().st_size > 10_000
    partly = subprocess.run([*command[:4], "--damping", "1"], check=False, capture_output=True, text=True)
    assert partly.returncode == 1
    assert "is missing" in partly.stderr
