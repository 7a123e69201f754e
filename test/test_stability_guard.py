"""What the guard lets pass, what it says of the rest, and that it is right."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from arms import LEVER, changed, one_joint

from wam_analysis.direct import DirectRun
from wam_analysis.guard_study import DIVERGES, exact_trials, table
from wam_control.force_loop import ForceCommand, ForceLoop, ForceLoopParameters
from wam_control.friction_verdict import Domain, judge, linear_margin, stable_error
from wam_control.guard_watch import Watch, place_is_sure
from wam_control.scenario import Step
from wam_control.stability_guard import StabilityGuard, Task, Touch
from wam_control.velocity_loop import VelocityLoopParameters
from wam_description.arm import Timing
from wam_description.configuration import Configuration, packaged
from wam_description.parameters import ParameterError
from wam_description.signals import NO_CONTACT, Contact, State
from wam_theory.stick_slip import ForceLoop as ExactLoop
from wam_theory.stick_slip import FrictionNode, Verdict, assess

WAM, TESTBED = (Configuration.load(packaged(name)) for name in ("wam", "testbed"))
ARM, CLOCK = WAM.shared.arm, WAM.shared.timing
OWN = WAM.node("force_loop", ForceLoopParameters)
Loop = partial(ForceLoop, ARM, timing=CLOCK)
POUND_INCH = 0.1129848  # N m


def guarded(own: ForceLoopParameters, **values: Any) -> ForceLoopParameters:
    return replace(own, guard=replace(own.guard, **values))


def bench(**values: Any) -> ForceLoopParameters:
    own = TESTBED.node("force_loop", ForceLoopParameters)
    return guarded(replace(own, **values), mode="refuse")


def bench_loop(own: ForceLoopParameters) -> ForceLoop:
    return ForceLoop(TESTBED.shared.arm, own, TESTBED.shared.timing)


# ------------------------------------------------------------------------------ one friction node
def section_5_6(friction: float) -> FrictionNode:
    """The testbed of section 5.6, lb, in, s, with its damping ratio of 0.05."""
    inertia, ktr, kc = 4.0, 14443.0, 12960.0
    damping = 2.0 * 0.05 * math.sqrt(inertia * (ktr + kc))
    return FrictionNode(inertia, damping, ktr, kc, friction, friction)


def test_hold_and_delay_move_the_margin_as_the_errata_say() -> None:
    at_50_hz = ExactLoop(1e-3, sample_period=0.02)
    assert linear_margin(section_5_6(8.4), ExactLoop(1e-3)) == pytest.approx(1.21e-3, rel=0.01)
    assert linear_margin(section_5_6(8.4), at_50_hz) == pytest.approx(1.73e-3, rel=0.01)
    assert linear_margin(section_5_6(8.4), replace(at_50_hz, delay_samples=1)) == pytest.approx(4.89e-3, rel=0.01)


def test_domains_are_those_of_figure_5_8() -> None:
    """J = b = K = 1: gamma is the gain; zeta 0.25, domain III from 2.186 on."""
    node = FrictionNode(1.0, 1.0, 2.0, 2.0, 1.0, 1.0)
    found = {gain: judge(node, ExactLoop(gain)) for gain in (0.95, 1.1, 1.5, 2.0, 2.3)}
    assert [str(verdict.domain) for verdict in found.values()] == ["I", "II", "II", "II", "III"]
    assert found[0.95].stable_error == math.inf
    assert found[2.3].stable_error == 0.0
    for gain, largest_step in ((1.1, 25.3), (1.5, 3.45), (2.0, 1.17)):
        assert 0.3 * largest_step < found[gain].stable_error < largest_step


def test_a_loop_that_saturates_at_the_largest_stable_step_shakes_after_a_larger_one() -> None:
    node = FrictionNode(1.0, 1.0, 2.0, 2.0, 1.0, 1.0)
    largest_step = 3.45  # of gamma 1.5, by bisection
    at_the_step = ExactLoop(1.5, error_limit=0.99 * largest_step)
    assert assess(node, at_the_step, 0.9 * largest_step).verdict is Verdict.SETTLED
    shakes = [assess(node, at_the_step, part * largest_step) for part in (1.5, 2.0, 3.0, 5.0, 10.0)]
    assert max(shake.peak_to_peak for shake in shakes if shake.verdict is Verdict.LIMIT_CYCLE) > 2.0 * largest_step
    accepted = replace(at_the_step, error_limit=stable_error(node, ExactLoop(1.5)))
    for part in (1.5, 2.0, 3.0, 5.0, 10.0):
        assert assess(node, accepted, part * largest_step).verdict is Verdict.SETTLED


def test_the_dead_zone_it_names_removes_the_cycle_of_stiction() -> None:
    node, gain = FrictionNode(1.0, 0.5, 40.0, 20.0, 0.8, 1.2), 1e-3
    cycle = judge(node, ExactLoop(gain)).cycle
    without = assess(node, ExactLoop(gain), 3.0)
    assert without.verdict is Verdict.LIMIT_CYCLE
    assert cycle.peak_to_peak == pytest.approx(without.peak_to_peak, rel=0.05)
    assert cycle.deadband == pytest.approx(cycle.peak_to_peak / 2.0)
    with_it = ExactLoop(gain, deadband=1.05 * cycle.deadband)
    assert assess(node, with_it, 3.0).verdict is Verdict.SETTLED
    too_small = ExactLoop(gain, deadband=0.5 * cycle.deadband)
    assert assess(node, too_small, 3.0).verdict is Verdict.LIMIT_CYCLE


def test_nothing_accepted_diverges_and_without_the_guard_much_would() -> None:
    found = table(exact_trials(seed=8, count=10))
    assert found.accepted_and_diverged == 0
    assert sum(count for (_, _, end), count in found.counts.items() if end == DIVERGES) >= 2
    accepted = sum(count for (_, is_accepted, _), count in found.counts.items() if is_accepted)
    assert accepted >= 5, "a guard that refuses everything is none"


# --------------------------------------------------------------------------------------- the arm
def test_a_set_beyond_the_margin_is_refused_with_the_numbers_and_the_old_one_stays() -> None:
    loop = Loop(OWN)
    with pytest.raises(ParameterError) as refusal:
        loop.tune(replace(OWN, force_gain=(0.5,)))
    text = str(refusal.value)
    for part in (
        "force_gain [0.5, 0.5, 0.5] is ",
        "times the largest linearly stable one",
        "domain beyond I",
        "allowed: ",
    ):
        assert part in text
    assert loop.parameters == OWN
    allowed = float(text.split("force_gain up to [")[1].split(",")[0])
    loop.tune(replace(OWN, force_gain=(allowed,)))
    with pytest.raises(ParameterError):
        loop.tune(replace(OWN, force_gain=(1.02 * allowed,)))
    Loop(guarded(replace(OWN, force_gain=(0.5,)), mode="off"))
    warned = Loop(guarded(replace(OWN, force_gain=(0.5,)), mode="warn"))
    assert warned.report.is_warning
    assert warned.report.message.startswith("not stable: force_gain [0.5")


@pytest.mark.parametrize("gain", [0.3, 0.5, 0.87])
def test_the_gain_that_a_refusal_allows_is_accepted(gain: float) -> None:
    for make, own, group in (
        (Loop, OWN, "force"),
        (Loop, replace(OWN, mode="joint_torque"), "torque"),
        (bench_loop, guarded(bench(), mode="refuse"), "force"),
    ):
        name = f"{group}_gain"
        with pytest.raises(ParameterError) as refusal:
            make(replace(own, **{name: (gain,)}))
        said = str(refusal.value).split(f"{name} up to [")[1].split("]")[0]
        assert make(replace(own, **{name: (float(said.split(",")[0]),)})).judgement is not None


def test_a_bad_set_stops_the_loop_at_its_start() -> None:
    with pytest.raises(ParameterError, match=r"torque_gain .* times the largest linearly stable one"):
        Loop(replace(OWN, mode="joint_torque", torque_gain=(0.1,)))
    assert Loop(replace(OWN, mode="joint_torque")).judgement is not None
    assert Loop(replace(OWN, mode="open_loop", force_gain=(9.0,))).judgement is None


def test_a_stiffer_surface_leaves_less_gain_and_a_lag_of_the_feedback_no_more() -> None:
    def scale(own: ForceLoopParameters) -> float:
        judgement = Loop(guarded(own, mode="warn")).judgement
        assert judgement is not None
        return judgement.scale

    fast = replace(OWN, force_gain=(0.05,), feedback="contact_estimate")
    assert scale(guarded(fast, contact_stiffness=16000.0)) < 0.9 * scale(guarded(fast, contact_stiffness=1000.0))
    assert scale(guarded(fast, feedback_lag=0.02)) == pytest.approx(scale(guarded(fast, feedback_lag=0.0)), rel=0.01), (
        "a lag that steadies the loop is not relied on"
    )


def test_the_guard_knows_the_gains_of_the_velocity_loop() -> None:
    for configuration in (WAM, TESTBED):
        guard = configuration.node("force_loop", ForceLoopParameters).guard
        servo = configuration.node("velocity_loop", VelocityLoopParameters)
        assert guard.servo_proportional == servo.proportional_gain
        assert guard.servo_integral == servo.integral_gain


# ----------------------------------------------------------------------------------- the testbed
def press_far(gain: float, limit: float) -> float:
    """Peak to peak of the testbed's force after a step of 50 N, N."""
    extra = {"driver:amplifier.thermal_time": 1e6, "force_loop:guard.mode": "off"}
    conf = TESTBED.with_values({**extra, "force_loop:force_gain": [gain], "force_loop:force_error_limit": [limit]})
    asked = [ForceCommand("base", (0.0, 0.0, -newtons)) for newtons in (15.0, 65.0)]
    steps = [Step("press", 1.5, force=asked[0]), Step("step", 5.0, force=asked[1])]
    run = DirectRun(conf, [Step("release", 0.2, request="enable"), *steps])
    assert run.play() == ""
    return float(np.ptp([row.values[2] for row in run.rows["force_measured"][-41:-1]]))


def test_in_domain_ii_the_saturation_is_held_below_the_stable_error_and_the_testbed_rests() -> None:
    gain = 0.05  # 1.27 of the margin
    with pytest.raises(ParameterError, match=r"domain II; allowed: .* or force_error_limit up to") as refusal:
        bench_loop(bench(force_gain=(gain,)))
    error = float(str(refusal.value).split("force_error_limit up to ")[1].split()[0])
    accepted = bench_loop(bench(force_gain=(gain,), force_error_limit=(error,)))
    assert accepted.judgement is not None
    assert accepted.judgement.domain is Domain.II
    limited = bench_loop(guarded(bench(force_gain=(gain,)), mode="limit"))
    assert limited.judgement is not None
    assert limited.judgement.stable_error == pytest.approx(error, rel=0.01)
    q, still, driven = [-0.001], [0.0], [1.0]
    command = ForceCommand("base", (0.0, 0.0, -150.0))
    out = limited.step(
        State(q, still, driven), State(q, still, driven), NO_CONTACT, None, command, 0.0, None, None, 0.02
    )
    assert math.hypot(*out.limited) == pytest.approx(error, rel=0.01)
    assert press_far(gain, error) < 2.0
    assert press_far(gain, 1000.0) > 20.0


def test_domain_iii_is_refused_whatever_the_saturation() -> None:
    with pytest.raises(ParameterError, match="domain III; allowed: force_gain up to"):
        bench_loop(guarded(bench(force_gain=(0.2,), force_error_limit=(0.01,)), mode="limit"))


# ------------------------------------------------------------------------------- while it moves
def follow(loop: ForceLoop, q: Sequence[float], contact: Contact = NO_CONTACT, periods: int = 300) -> float:
    """Factor of the gains after a while at a pose with a force asked for across the outer link."""
    state = State(list(q), [0.0] * len(q), [1.0] * len(q))
    cover = loop.parameters.contact_cover
    for _ in range(periods):
        loop.step(
            state,
            state,
            contact,
            [0.0] * len(q),
            ForceCommand(cover, (0.0, -1.0, 0.0)),
            0.0,
            None,
            [0.0] * len(q),
            0.005,
        )
    assert loop.watch is not None
    return loop.watch.factor


STIFF_POSE = (0.3, -1.2, 0.2, 1.0)  # where the joint sensors see the foam through a lesser margin than at the box


def test_gains_are_taken_down_where_the_pose_would_leave_the_domain_and_come_back() -> None:
    own = replace(OWN, force_gain=(0.1,))
    loop = Loop(own)
    here = list(own.guard.posture)
    assert follow(loop, here) == 1.0
    factor = follow(loop, STIFF_POSE)
    assert factor < 0.75
    assert f"gains taken {factor:.3g} times" in loop.report.message
    guard = StabilityGuard(ARM, CLOCK, own.guard)
    task = loop_task(loop)
    touch = Touch(STIFF_POSE, "outer_link", 0.28, normal(guard, STIFF_POSE))
    taken = replace(task.law, gain=tuple(factor * gain for gain in task.law.gain))
    share = own.guard.share
    assert min(guard.scales(task._replace(law=taken), [touch])) == pytest.approx(1.0 / share, rel=0.02)
    assert min(guard.scales(task, [touch])) < 1.0 / share, "without the factor the margin is spent"
    assert follow(loop, here) == 1.0
    warned = Loop(guarded(own, mode="warn"))
    follow(warned, STIFF_POSE)
    assert warned.report.facts["gain factor"] == "1"


def loop_task(loop: ForceLoop) -> Task:
    from wam_control.force_loop_parameters import force_law, task_of

    return task_of(loop.parameters, force_law(loop.parameters))


def normal(guard: StabilityGuard, q: Sequence[float]) -> tuple[float, float, float]:
    return guard.touches(q, "outer_link", 0.28)[0].direction


def test_the_velocity_obeys_the_factor() -> None:
    loop = Loop(replace(OWN, force_gain=(0.1,), blend_time=0.0))
    follow(loop, OWN.guard.posture)
    state, command = State(list(STIFF_POSE), [0.0] * 4, [1.0] * 4), ForceCommand("outer_link", (0.0, -1.0, 0.0))
    speeds = []
    for _ in range(300):
        out = loop.step(state, state, NO_CONTACT, None, command, 0.0, list(STIFF_POSE), None, 0.005)
        speeds.append(float(np.linalg.norm(out.velocity)) / (out.error[1] or 1.0))
    assert loop.watch is not None
    assert loop.watch.factor < 0.75
    assert speeds[-1] == pytest.approx(loop.watch.factor * speeds[0], rel=1e-6)


# ----------------------------------------------------------------------------------- scheduling
ROD = changed(one_joint(), motors={"inertia": (2e-3,)}, joints={"viscous_friction": (4.0,)})
FAST = Timing("lockstep", 1e-4, 1, 10, 0, 10, 0, 5.0, 0)


def rod(schedule: str) -> ForceLoop:
    """The joint-torque loop of one joint behind a firm servo, at 1 kHz, tuned for a contact at the tip."""
    own = TESTBED.node("force_loop", ForceLoopParameters)
    guard = replace(
        own.guard, mode="refuse", contact_stiffness=1500.0, servo_proportional=(10.0,), servo_integral=(1000.0,),
        share=1.0, feedback_lag=0.0,
    )  # fmt: skip
    own = replace(
        own, mode="joint_torque", feedback="contact_estimate", torque_gain=(0.004,), torque_error_limit=(10.0,),
        contact_cover="tube", contact_place=LEVER, schedule=schedule, guard=guard,
    )  # fmt: skip
    return ForceLoop(ROD, own, FAST)


@pytest.mark.parametrize("place", [0.4, 0.6])
def test_a_scheduled_gain_keeps_the_margin_as_the_contact_moves(place: float) -> None:
    """Routh, (5.15): the margin is b/J (1/k_tr + 1/k_c), and k_c at the joint goes with the square of the place.

    The loop samples, at 1 kHz, and its servo is not rigid, which takes some per cent.
    """
    ktr = 14.0**2 * 8.33
    expected = (1.0 / ktr + 1.0 / (1500.0 * place**2)) / (1.0 / ktr + 1.0 / (1500.0 * LEVER**2))
    found = follow(rod("place"), [0.0], Contact("tube", place, (0.0, 1.0, 0.0)))
    assert found == pytest.approx(expected, rel=0.1)
    assert follow(rod("off"), [0.0], Contact("tube", place, (0.0, 1.0, 0.0))) == 1.0


def test_an_unsure_place_counts_as_the_worst() -> None:
    loop = rod("place")
    assert follow(loop, [0.0], Contact("tube", 0.4, (0.0, 1.0, 0.0))) > 1.5
    assert follow(loop, [0.0], Contact("tube", math.nan, (0.0, 1.0, 0.0))) == pytest.approx(1.0, rel=0.01)
    assert follow(loop, [0.0]) == pytest.approx(1.0, rel=0.01)


def test_a_place_is_sure_where_it_is_known_closely_enough() -> None:
    assert place_is_sure(0.2, 0.02, 0.03)
    assert place_is_sure(0.2, math.nan, 0.03), "nobody told how sure it is"
    assert not place_is_sure(0.2, 0.04, 0.03)
    assert not place_is_sure(math.nan, 0.0, 0.03)


def test_a_judgement_is_spread_and_not_repeated_while_nothing_moves() -> None:
    loop = Loop(replace(OWN, force_gain=(0.1,)))
    assert isinstance(loop.watch, Watch)
    asked = []
    scales = StabilityGuard.scales

    def counted(self: StabilityGuard, *given: Any) -> Any:
        for scale in scales(self, *given):
            asked.append(scale)
            yield scale

    StabilityGuard.scales = counted  # type: ignore[method-assign]
    try:
        follow(loop, OWN.guard.posture, periods=1)
        assert len(asked) == 1, "one part of the judgement in a period"
        follow(loop, OWN.guard.posture, periods=200)
        done = len(asked)
        follow(loop, OWN.guard.posture, periods=200)
        assert len(asked) == done
        follow(loop, STIFF_POSE, periods=200)
        assert len(asked) == 2 * done
    finally:
        StabilityGuard.scales = scales  # type: ignore[method-assign]
